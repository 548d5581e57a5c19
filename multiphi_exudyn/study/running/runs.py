"""One run of one model: its histories on the common time grid, its energy, and what it cost."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

__all__ = ["ModelRun", "interval_array"]


@dataclass(frozen=True)
class ModelRun:
    """What a model answered; a failed one has a status, a cause and no histories.

    kind: "reduced", "user-object" or "full". label: for tables and figures. dofs: coordinates integrated.
    time: (k,) s, the same for every run of a comparison. points [m], gaps [m], contact_force [N]: (k,) each.
    contact_intervals: contact -> (m, 2) s. impulse: contact -> N s to the end of the run.
    energy_time (j,) s, energy (j,) J: kinetic + strain, compliant contacts included. ledger: J, row by row.
    steps: time steps, or events where a model has no steps.
    offline_s: building, linearising, static start. first_s: the solver alone, from the start to the end, the
    first time; repeats_s: the same again. sampling_s: the histories put on the common grid afterwards.
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
    energy_time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    energy: np.ndarray = field(default_factory=lambda: np.zeros(0))
    ledger: Mapping[str, float] = field(default_factory=dict)
    steps: int = 0
    offline_s: float = 0.0
    first_s: float = 0.0
    repeats_s: tuple[float, ...] = ()
    sampling_s: float = 0.0

    @property
    def ok(self) -> bool:
        """True if the run reached its end."""
        return self.status == "ok"

    @property
    def online_s(self) -> float:
        """Median of the repeats [s]; the first run where it was not repeated."""
        return statistics.median(self.repeats_s) if self.repeats_s else self.first_s


def interval_array(given: Sequence[tuple[float, float]]) -> np.ndarray:
    """Contact intervals as (m, 2), also where there are none."""
    return np.array(given, dtype=float).reshape(-1, 2)
