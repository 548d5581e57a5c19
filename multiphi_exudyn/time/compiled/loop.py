"""The compiled loop of one event rule: enters the kernel with a state, and comes back with the next one."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import Phase, State
from multiphi_exudyn.time.compiled.kernel import CHATTER, FULL, run
from multiphi_exudyn.time.compiled.pack import Pack
from multiphi_exudyn.time.compiled.record import NUMBERS, PHASES, Record

__all__ = ["CompiledLoop"]


class CompiledLoop:
    """``rule`` packed for the kernel; it serves every run under that rule."""

    def __init__(self, rule: EventRule) -> None:
        self._pack = Pack(rule)

    @property
    def bytes_packed(self) -> int:
        """Bytes of the arrays that the kernel works on."""
        return sum(array.nbytes for array in self._pack.levels)

    def record(self) -> Record:
        """An empty record of a run."""
        return Record(self._pack)

    def advance(
        self, state: State, time: float, end: float, record: Record, window: int, period: float, within: float
    ) -> tuple[State, float, int, bool]:
        """(state, time [s], samples, whether it was chatter that stopped it) as far as the kernel comes from a state.

        window, period, within: of the chatter check of motion.py.
        """
        position = self._pack.position(state.level)
        if position is None or Phase.HELD_BACK in state.phases:
            return state, time, 0, False
        self._pack.connect()
        levels = self._pack.levels
        x, v = np.zeros((2, levels.squared.shape[1]))
        r = len(state.displacement)
        x[:r], v[:r] = state.displacement, state.velocity
        phases = np.array([NUMBERS[phase] for phase in state.phases], np.int8)
        first, status, taken = record.count, FULL, 0
        while status == FULL:
            record.make_room()
            status, position, time, record.count, record.happened, samples, transitions = run(
                levels,
                position,
                x,
                v,
                phases,
                time,
                end,
                record.count,
                record.happened,
                record.spans,
                record.levels,
                record.coefficients,
                record.standings,
                record.amounts,
                record.kinds,
                window,
                period,
                within,
            )
            taken += samples
            self._pack.rule.transitions += transitions
        if record.count == first:
            return state, time, taken, False
        level = self._pack.loaded[position]
        r = level.level.modes
        reached = State(level, x[:r], v[:r], tuple(PHASES[k] for k in phases.tolist()))
        return reached, time, taken, status == CHATTER
