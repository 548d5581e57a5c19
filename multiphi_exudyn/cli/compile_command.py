"""``multiphi-exudyn compile``: compile in advance, for a container or for the workers of a cluster."""

from __future__ import annotations

import sys

from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody
from multiphi_exudyn.mathematics.compiling.compiled import available, compile_entries
from multiphi_exudyn.time.simulate import simulate

__all__ = ["run_compile"]


USERS = (simulate, CreateMultiPhiBody)  # their modules define the compiled functions


def run_compile() -> bool:
    """Compile the functions of runs and of bodies in Exudyn, and print where they are stored; return True if so."""
    path = compile_entries() if available() else None
    if path is None:
        why = "no folder is writable; set NUMBA_CACHE_DIR to one that is" if available() else "numba is not installed"
        print(f"the compiled loop is not kept: {why}", file=sys.stderr)
        return False
    print(f"compiled, and kept in {path}")
    return True
