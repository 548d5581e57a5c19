"""One run of one model: its histories on the common time grid, its energy, and what it cost; where it ran.

Times are CPU times: waiting for other programs does not count.
"""

from __future__ import annotations

import importlib.metadata
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import threadpool_info

__all__ = [
    "FEWEST_ROUNDS",
    "REPEAT_BUDGET_S",
    "TURNS_BUDGET_S",
    "ModelRun",
    "environment",
    "from_arrays",
    "import_times",
    "in_turns",
    "interval_array",
    "load_average",
    "machine",
    "modes_text",
    "path_length",
    "repeated",
    "timed",
    "to_arrays",
    "undisturbed",
]

PACKAGES = ("multiphi-exudyn", "exudyn", "numpy", "scipy")
IMPORTED = ("multiphi_exudyn", "exudyn")
IMPORT_LIMIT_S = 60  # s; an import that takes longer is not reported
REPEAT_BUDGET_S = 2.0  # s; a run that takes longer is timed once
STEADY_S = 0.3  # s, over which short runs are repeated: a machine's speed varies
ROUNDS = 200  # of runs in turns
TURNS_BUDGET_S = 20.0  # s, of all rounds of a study but the first at every point
FEWEST_ROUNDS = 8  # whose lower quartile says more than repeats in one stretch do
UNDISTURBED = 0.25  # share of the shortest times: a machine may be slow for three quarters of the rounds

T = TypeVar("T")


@dataclass(frozen=True)
class ModelRun:
    """Result of one model. A failed run has a status and a cause, and no histories.

    kind: as in the scene file. label: for tables and figures. dofs: number of coordinates integrated.
    time: (k,) s, the same for every run of a comparison. points [m], gaps [m], contact_force [N]: (k,) each.
    contact_intervals: contact -> (m, 2) s. impulse: contact -> N s to the end of the run.
    friction_force [N], slip [m]: (k,) each, of every friction; stick_intervals: friction -> (m, 2) s.
    energy_time (j,) s, energy (j,) J: kinetic + strain, compliant contacts included. ledger: J, row by row.
    steps: time steps, or events where a model has no steps.
    offline_s: building, linearising, static start. first_s: solver alone, first run from start to end; repeats_s: its
    repeats. sampling_s: interpolation of the histories on the common grid after the run.
    indicators: end of the window [s] -> the model's own estimate of its truncation error; empty for other models.
    warnings: of a reduced model (``Trajectory.warnings``). horizon_s: tolerance -> time [s] up to which the same run
    from a perturbed start differs by less (``Trajectory.horizon``); only for reduced models, on request.
    """

    name: str
    kind: str
    label: str
    dofs: int = 0
    status: str = "ok"
    message: str = ""
    time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    points: Mapping[str, np.ndarray] = field(default_factory=dict)
    gaps: Mapping[str, np.ndarray] = field(default_factory=dict)
    contact_force: Mapping[str, np.ndarray] = field(default_factory=dict)
    contact_intervals: Mapping[str, np.ndarray] = field(default_factory=dict)
    impulse: Mapping[str, float] = field(default_factory=dict)
    friction_force: Mapping[str, np.ndarray] = field(default_factory=dict)
    slip: Mapping[str, np.ndarray] = field(default_factory=dict)
    stick_intervals: Mapping[str, np.ndarray] = field(default_factory=dict)
    energy_time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    energy: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ledger: Mapping[str, float] = field(default_factory=dict)
    steps: int = 0
    offline_s: float = 0.0
    first_s: float = 0.0
    repeats_s: tuple[float, ...] = ()
    sampling_s: float = 0.0
    indicators: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    horizon_s: Mapping[str, float] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """True if the run reached its end."""
        return self.status == "ok"

    @property
    def online_s(self) -> float:
        """Median time of the repeats [s], or of the first run if there are no repeats."""
        return statistics.median(self.repeats_s) if self.repeats_s else self.first_s

    def slipped(self, friction: str) -> float:
        """Distance [m] that a friction has slipped, both directions added."""
        return path_length(self.slip[friction])


def to_arrays(run: ModelRun) -> dict[str, np.ndarray]:
    """All fields of the run as arrays named "FIELD" or "FIELD/NAME"; numbers and texts have no dimension."""
    arrays: dict[str, np.ndarray] = {}
    for each in fields(run):
        value = getattr(run, each.name)
        if isinstance(value, Mapping):
            arrays |= {f"{each.name}/{name}": np.asarray(item) for name, item in value.items()}
        else:
            arrays[each.name] = np.asarray(value)
    return arrays


def from_arrays(arrays: Mapping[str, np.ndarray]) -> ModelRun:
    """The run from the arrays of ``to_arrays``."""
    values: dict[str, Any] = {}
    for key, array in arrays.items():
        name, _, entry = key.partition("/")
        value = array if array.ndim else array.item()
        if entry:
            values.setdefault(name, {})[entry] = value
        else:
            values[name] = value
    return ModelRun(**values | {name: tuple(values[name].tolist()) for name in ("repeats_s", "warnings")})


def interval_array(intervals: Sequence[tuple[float, float]]) -> np.ndarray:
    """Intervals as an array (m, 2); (0, 2) for none."""
    return np.array(intervals, dtype=float).reshape(-1, 2)


def modes_text(modes: object) -> str:
    """Number of modes as text: "r = 12", "all modes"."""
    return "all modes" if modes == "all" else f"r = {modes}"


def path_length(positions: np.ndarray) -> float:
    """Length [m] of the path through positions (k,) [m], both directions added."""
    return float(np.sum(np.abs(np.diff(positions))))


def timed(run: Callable[[], T]) -> tuple[T, float]:
    """Result of ``run``, and its CPU time [s]."""
    started = time.process_time()
    result = run()
    return result, time.process_time() - started


def repeated(run: Callable[[], float], first: float, fewest: int) -> tuple[float, ...]:
    """Times [s] of the repeats of a run, which returns its time.

    first: what it took before [s], 0 where that says nothing of a repeat. At least ``fewest`` repeats (0: none), fewer
    where REPEAT_BUDGET_S ends, more for short runs until STEADY_S.
    """
    repeats: list[float] = []
    spent = 0.0
    while fewest and (len(repeats) < fewest or spent < STEADY_S) and first + spent < REPEAT_BUDGET_S:
        repeats.append(run())
        spent += repeats[-1]
    return tuple(repeats)


def in_turns(runs: Sequence[Callable[[], float]], budget_s: float) -> list[tuple[float, ...]]:
    """Times [s] of several runs, each of which returns its time, as they take turns, forwards and backwards.

    A change of the machine's speed then changes all of them alike. budget_s: after which no further round begins.
    """
    times: list[list[float]] = [[] for _ in runs]
    order, started = list(zip(runs, times, strict=True)), time.perf_counter()
    for number in range(ROUNDS):
        if number and time.perf_counter() - started > budget_s:
            break
        for run, found in order:
            found.append(run())
        order.reverse()
    return [tuple(found) for found in times]


def undisturbed(times: Sequence[float]) -> float:
    """Lower quartile of times in turns: that of a machine which something else slows down now and then.

    The median of such times lies at random among the fast or the slow ones.
    """
    return float(np.quantile(times, UNDISTURBED))


def environment() -> dict[str, Any]:
    """Machine and versions, and the date."""
    return {"date": datetime.now(timezone.utc).isoformat(timespec="seconds"), **machine()}


def import_times() -> dict[str, float | None]:
    """Import time [s] of each package with all its public names in a new interpreter; None for a failure."""
    return {name: _import_time(name) for name in IMPORTED}


def load_average() -> float | None:
    """Load average of the machine over the last minute; None where the system has none."""
    return os.getloadavg()[0] if hasattr(os, "getloadavg") else None


def machine() -> dict[str, Any]:
    """Versions, machine and the number of threads of its linear algebra."""
    return {
        "python": platform.python_version(),
        "system": platform.platform(),
        "processor": _processor(),
        "cores": os.cpu_count(),
        "threads": {"BLAS threads": max((pool["num_threads"] for pool in threadpool_info()), default=1)},
        "versions": {name: _version(name) for name in PACKAGES},
    }


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """Name of the processor, or "unknown"."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown")


def _import_time(module: str) -> float | None:
    """Time [s] to import all public names of a module, some of which are loaded lazily."""
    code = f"import time; t = time.perf_counter(); from {module} import *; print(time.perf_counter() - t)"
    path = os.pathsep.join(filter(None, sys.path))
    try:
        process = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            timeout=IMPORT_LIMIT_S,
            check=True,
            env=os.environ | {"PYTHONPATH": path},
        )
        return float(process.stdout.split()[-1])
    except (subprocess.SubprocessError, ValueError, IndexError, OSError):
        return None
