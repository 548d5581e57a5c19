"""Driven motion: a run under loads and stops that vary in time, exact from event to event like any other.

In the coordinates xi = (eta, w) the motion from a state is again a sum of exponentials (driven/flow.py), so events are
certified as they are elsewhere. Where a piece of a load ends, the motion goes on in the same level with the next one; a
load that jumps there may make contacts change, by the same rule.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from multiphi_exudyn.events.state import Phase
from multiphi_exudyn.time.driven.rule import DrivenRule
from multiphi_exudyn.time.driven.segment import DrivenSegment
from multiphi_exudyn.time.driven.state import DrivenState
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.segment import Segment

__all__ = ["DrivenMotion"]


@dataclass
class DrivenMotion(Motion):
    """A run under an excitation."""

    work: float = field(default=0.0, init=False)  # of what varies, at instants, since the last segment began

    def _begin(self) -> None:
        super()._begin()
        self.work = self._varying_work(self.start.displacement, self._state)

    @property
    def _state(self) -> DrivenState:
        assert isinstance(self.state, DrivenState)
        return self.state

    def _continue(self, end: float) -> None:
        """On to the end of the present pieces, and into the next ones."""
        if self.time >= self._state.drive.until:
            self._next_piece()
        self._one_segment(min(end, self._state.drive.until))

    def _next_piece(self) -> None:
        """The same state under the drive that follows; a load that jumps may make contacts ask."""
        before, level = self._state, self._state.level
        assert isinstance(self.rule, DrivenRule)
        drive = self.rule.excitation.drive(self.time)
        w, w_t, _ = drive.values
        (eta, _), (eta_t, old_w_t) = level.split(before.displacement), level.split(before.velocity)
        eta_t = eta_t + level.plain.level.vectors.T @ (level.carried @ (old_w_t - w_t))
        displacement, velocity = np.concatenate([eta, w]), np.concatenate([eta_t, w_t])
        after = replace(before, displacement=displacement, velocity=velocity, drive=drive)
        moved = level.configuration(after.displacement) - level.configuration(before.displacement)
        self.work += _energy(after) - _energy(before) - float(self.rule.load @ moved)
        self.state = after
        functions = ((i, self.rule.function(level, i)) for i, p in enumerate(after.phases) if p is Phase.ARMED)
        asking = {i for i, s in functions if s.sign(after.displacement, after.velocity, after.reach) < 0}
        if asking:
            self._decide(asking)

    def _decide(self, asking: set[int], again: Iterable[int] = ()) -> None:
        before = self._state.level.configuration(self._state.displacement)
        super()._decide(asking, again)
        self.work += self._varying_work(before, self._state)

    def _varying_work(self, before: np.ndarray, state: DrivenState) -> float:
        """Work [J] of the varying loads where the configuration jumps from y (m,) to that of a state."""
        _, w = state.level.split(state.displacement)
        moved = state.level.configuration(state.displacement) - before
        return float((state.level.excitation.patterns @ w) @ moved)

    def _segment(self, started: float, coefficients: np.ndarray, armed_at: float) -> Segment:
        state, entry_work, self.work = self._state, self.work, 0.0
        given = started, self.time, state.level, coefficients, state.phases, armed_at
        return DrivenSegment(*given, flow=state.flow, entry_work=entry_work)

    def _work_since(self) -> float:
        return self.work


def _energy(state: DrivenState) -> float:
    return float(state.level.kinetic(state.velocity) + state.level.strain(state.displacement))
