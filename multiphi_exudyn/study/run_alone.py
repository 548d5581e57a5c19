"""One reduced run in a process of its own, which prints what it used: ``python -m ...run_alone FILE``.

FILE holds a pickled task: the arguments of MultiPhiModel and those of simulate. Nothing but the reduced model is
imported here, so that the printed modules and memory are those that a run needs.
"""

from __future__ import annotations

import json
import pickle
import sys
import tracemalloc
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.simulate import simulate

__all__ = ["run_alone"]

PACKAGE = "multiphi_exudyn"


def run_alone(model_arguments: dict[str, Any], run_arguments: dict[str, Any]) -> dict[str, Any]:
    """Resources used by the run, with the names of ``needs.Needs``; memory includes that of the model."""
    tracemalloc.start()
    model = MultiPhiModel(**model_arguments)
    with kept_back():
        run = simulate(model, **run_arguments)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    imported = [name.partition(".")[0] for name in sys.modules]
    others = {name for name in packages_distributions() if not name.startswith("_")} - {PACKAGE}
    return {
        "status": run.status,
        "levels_built": run.stats.levels_built,
        "levels_possible": run.stats.levels_possible,
        "dofs_carried": max(segment.level.level.modes for segment in run.segments) if run.segments else 0,
        "dofs_given": model.structure.n,
        "modules": imported.count(PACKAGE),
        "packages": sorted(others & set(imported)),
        "memory": peak,
        "warnings": list(run.warnings),
    }


if __name__ == "__main__":
    print(json.dumps(run_alone(*pickle.loads(Path(sys.argv[1]).read_bytes()))))
