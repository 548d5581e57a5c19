"""Start conditions: where a run begins, in base coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.display import Shown
from multiphi_exudyn.events.transitions.state import State

__all__ = ["Start"]


@dataclass(repr=False)  # not frozen: every run makes one, which would take three times as long
class Start(Shown):
    """y, y' (m,) in base coordinates; compliant contacts that start closed, rigid ones that start at their gap.

    penetrating: includes the friction that sticks. gaps: (c,) [m] of all contacts at y = 0, with the stops and held
    displacements at the start. states: numbers of all elements' states, those contacts closed. held: displacements (h,)
    that links hold. time [s], state: of the start, and the final state of the run that is continued, if any.
    """

    displacement: np.ndarray
    velocity: np.ndarray
    penetrating: tuple[int, ...]
    touching: tuple[int, ...]
    gaps: np.ndarray
    states: tuple[int, ...]
    held: np.ndarray
    time: float = 0.0
    state: State | None = None

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "time", f"{self.time:g} s"
        yield "states", str(self.states)
