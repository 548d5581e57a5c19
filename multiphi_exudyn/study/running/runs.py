"""One run of one model: its histories on the common time grid, its energy, and what it cost."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

__all__ = ["ModelRun", "from_arrays", "interval_array", "path_length", "to_arrays"]


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


def path_length(positions: np.ndarray) -> float:
    """Length [m] of the path through positions (k,) [m], both directions added."""
    return float(np.sum(np.abs(np.diff(positions))))


def interval_array(intervals: Sequence[tuple[float, float]]) -> np.ndarray:
    """Intervals as an array (m, 2); (0, 2) for none."""
    return np.array(intervals, dtype=float).reshape(-1, 2)


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
