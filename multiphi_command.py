"""Start of the command line: one BLAS thread, asked for before numpy is loaded.

More threads cost the small matrices of a modal model more than they give, and on a busy machine they spoil
timings by a factor of ten. What the user has set stays.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from multiphi_exudyn.cli import main  # noqa: E402  (the threads come first)

__all__ = ["main"]
