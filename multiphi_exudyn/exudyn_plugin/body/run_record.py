"""Record of a run in Exudyn: what a body has to know of it to say how far it can be trusted (reliability.py)."""

from __future__ import annotations

from multiphi_exudyn.events.state import Loss, State
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.time.reliability import RunSummary

__all__ = ["RunRecord"]


class RunRecord:
    """Levels that a run has been in, what it lost at its start, and its largest energy [J] there and after events."""

    def __init__(self, start: State, lost: Loss) -> None:
        self._levels: dict[tuple[int, ...], Level] = {}
        self._truncated = _truncated(lost)
        self._energy = 0.0
        self.see(start, lost.total)

    def see(self, state: State, lost: float = 0.0) -> None:
        """Count a state among those of the run; lost: energy [J] that it had before besides."""
        self.include(state.level.level)
        self.reach(state.kinetic + float(state.level.strain(state.displacement)) + lost)

    def include(self, level: Level) -> None:
        """Count a level among those of the run."""
        self._levels.setdefault(level.indices, level)

    def reach(self, energy: float) -> None:
        """Count an energy [J] among those of the run."""
        self._energy = max(self._energy, energy)

    def of(self, lost: Loss, truncated: float) -> RunSummary:
        """The summary with what was lost at events, and truncated at others [J]."""
        return RunSummary(tuple(self._levels.values()), self._truncated + _truncated(lost) + truncated, self._energy)


def _truncated(loss: Loss) -> float:
    return loss.truncation_kinetic + loss.truncation_strain
