"""Record of a run in Exudyn: levels and energies, from which the warnings of a body are derived (run_warnings.py)."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mechanics.elements.force_law import ForceLaw
from multiphi_exudyn.time.reliability.law_span import LawPlaces
from multiphi_exudyn.time.reliability.run_warnings import RunSummary

__all__ = ["RunRecord"]


class RunRecord:
    """Levels of a run, the energy lost at its start, and its largest energy [J] there and after events."""

    def __init__(self, start: State, lost: Loss) -> None:
        self._levels: dict[tuple[int, ...], Level] = {}
        self._truncated = _truncated(lost)
        self._energy = 0.0
        self._places = LawPlaces()
        self.include_state(start, lost.total)

    def include_state(self, state: State, lost: float = 0.0) -> None:
        """Include the level and the energy of a state; lost: energy [J] lost right before, which is added."""
        self.include_level(state.level.level)
        self.include_energy(state.kinetic + float(state.level.strain(state.displacement)) + lost)

    def include_level(self, level: Level) -> None:
        """Include a level."""
        self._levels.setdefault(level.indices, level)

    def include_places(self, level: LoadedLevel, xi: np.ndarray, times: np.ndarray) -> None:
        """Include the places of force laws in a last segment, at coordinates (r, k) of a level at times (k,) [s]."""
        for i, law in enumerate(level.level.base.contacts):
            if isinstance(law, ForceLaw) and law.is_last(level.states[i]):
                gaps = level.level.gap_rows[i] @ xi + level.gap_constants[i]
                self._places.include(law, times, law.centre + gaps)

    def include_energy(self, energy: float) -> None:
        """Include an energy [J] in the largest one."""
        self._energy = max(self._energy, energy)

    def summary(self, lost: Loss, truncated: float) -> RunSummary:
        """Summary of the run; lost: at events, truncated: at events that ``lost`` does not contain [J]."""
        return RunSummary(
            tuple(self._levels.values()), self._truncated + _truncated(lost) + truncated, self._energy, self._places
        )


def _truncated(loss: Loss) -> float:
    return loss.truncation_kinetic + loss.truncation_strain
