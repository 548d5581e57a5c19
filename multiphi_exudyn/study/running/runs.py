"""One run of one model: its histories on the common time grid, its energy, and what it cost."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

__all__ = ["ModelRun", "from_arrays", "interval_array", "to_arrays", "way"]


@dataclass(frozen=True)
class ModelRun:
    """What a model answered; a failed one has a status, a cause and no histories.

    kind: as in a scene's file. label: for tables and figures. dofs: coordinates integrated.
    time: (k,) s, the same for every run of a comparison. points [m], gaps [m], contact_force [N]: (k,) each.
    contact_intervals: contact -> (m, 2) s. impulse: contact -> N s to the end of the run.
    friction_force [N], slip [m]: (k,) each, of every friction; stick_intervals: friction -> (m, 2) s.
    energy_time (j,) s, energy (j,) J: kinetic + strain, compliant contacts included. ledger: J, row by row.
    steps: time steps, or events where a model has no steps.
    offline_s: building, linearising, static start. first_s: the solver alone, from the start to the end, the
    first time; repeats_s: the same again. sampling_s: the histories put on the common grid afterwards.
    indicators: end of the window [s] -> the model's own estimate of its truncation error; none of other models.
    warnings: what to distrust in a reduced model's answer (``Trajectory.warnings``). horizon_s: tolerance -> until when
    [s] the model, nudged, stays as near to itself (``Trajectory.horizon``); only of reduced models that were asked.
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
        """Median of the repeats [s]; the first run where it was not repeated."""
        return statistics.median(self.repeats_s) if self.repeats_s else self.first_s

    def slipped(self, friction: str) -> float:
        """Length [m] of the way, to and fro, of a friction's patch."""
        return way(self.slip[friction])


def way(places: np.ndarray) -> float:
    """Length [m] of the way, to and fro, through places (k,) [m]."""
    return float(np.sum(np.abs(np.diff(places))))


def interval_array(given: Sequence[tuple[float, float]]) -> np.ndarray:
    """Contact intervals as (m, 2), also where there are none."""
    return np.array(given, dtype=float).reshape(-1, 2)


def to_arrays(run: ModelRun) -> dict[str, np.ndarray]:
    """The whole run as arrays, "FIELD" or "FIELD/NAME", numbers and texts without dimension."""
    arrays: dict[str, np.ndarray] = {}
    for each in fields(run):
        value = getattr(run, each.name)
        if isinstance(value, Mapping):
            arrays |= {f"{each.name}/{name}": np.asarray(item) for name, item in value.items()}
        else:
            arrays[each.name] = np.asarray(value)
    return arrays


def from_arrays(arrays: Mapping[str, np.ndarray]) -> ModelRun:
    """The run that ``to_arrays`` was given."""
    given: dict[str, Any] = {}
    for key, array in arrays.items():
        name, _, entry = key.partition("/")
        value = array if array.ndim else array.item()
        if entry:
            given.setdefault(name, {})[entry] = value
        else:
            given[name] = value
    return ModelRun(**given | {name: tuple(given[name].tolist()) for name in ("repeats_s", "warnings")})
