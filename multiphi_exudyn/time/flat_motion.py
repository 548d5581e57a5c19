"""Motion in the loop of flat arrays: a run under way, as in motion.py."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.state import Event, State
from multiphi_exudyn.time.driven.arrays import DrivenArrays
from multiphi_exudyn.time.driven.flow import Flow
from multiphi_exudyn.time.driven.level import DrivenLevel
from multiphi_exudyn.time.driven.segment import DrivenSegment
from multiphi_exudyn.time.driven.state import DrivenState
from multiphi_exudyn.time.loop import ACCUMULATED, advance
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.record import PHASES, Record, Segments
from multiphi_exudyn.time.segment import Segment

__all__ = ["FlatDrivenMotion", "FlatMotion"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}


@dataclass
class FlatMotion(Motion):
    """A run that the loop carries; ``step``: the loop, compiled or as it is."""

    arrays: LevelArrays = None  # type: ignore[assignment]
    step: Callable[..., int] = advance

    def __post_init__(self) -> None:
        self.record = Record(self.arrays)
        super().__post_init__()
        if not self.message:
            self._enter()

    def _enter(self) -> None:
        """The first state in the loop's arrays."""
        arrays = self.arrays
        level = arrays.level(self.state.closed)
        self.record.begin()
        ints, numbers = arrays.ints, arrays.numbers
        ring = arrays.ring(self.window)
        ints, numbers = arrays.ints, arrays.numbers
        given = {a.WINDOW: self.window, a.RING: ring, a.DECISIONS: 0, a.TRANSITIONS: 0, a.GIVEN_UP: 0, a.PIECE: 0}
        for slot, value in given.items():
            ints[slot] = value
        numbers[a.TIME], numbers[a.LAST_DECISION], numbers[a.ALLOWED], numbers[a.WORK] = 0.0, 0.0, self._allowed, 0.0
        numbers[int(ints[a.FOUND]) + 1] = 0.0
        arrays.set_state(level, self.state.displacement, self.state.velocity, [NUMBERS[p] for p in self.state.phases])

    def advance(self, end: float, to_change: bool = False) -> None:
        """Carries the state to ``end``, or to the failure that stops it; if asked, no further than a first event."""
        with self._failing():
            if self.message:
                return
            self.arrays.ints[a.STOP_AT_EVENT] = int(to_change)
            with np.errstate(all="ignore"):
                answer = self._run(end)
            self.record.take()
            self.time = float(self.arrays.numbers[a.TIME])
            self.state = self._leave()
            if answer == a.FAILED:
                self._fail()

    def _run(self, end: float) -> int:
        """The loop until it ends, packing what it needs."""
        while True:
            answer = self.step(*self.arrays.buffers.all, end)
            if answer == a.FULL:
                self.record.take()
            elif answer == a.NEED:
                try:
                    self.arrays.supply()
                    self._keep_room()
                except (NumericalFailure, np.linalg.LinAlgError) as error:
                    self._unavailable = error
                    self.arrays.ints[a.GIVEN_UP] = 1
            else:
                return int(answer)

    def _keep_room(self) -> None:
        """Where a level has come that is larger than the record has room for, take the record first."""
        if self.arrays.record_room < self.arrays.most_coordinates:
            self.record.take()

    def _fail(self) -> None:
        """Raise the failure that has stopped the loop."""
        ints, told = self.arrays.ints, self.arrays.numbers[a.TOLD : a.TOLD + 3].tolist()
        cause = int(ints[a.CAUSE])
        flags = ints[ints[a.CAUSED_BY] :][: ints[a.ELEMENTS]]
        involved = [int(i) for i in np.flatnonzero(flags)]
        names = ", ".join(self.model.contacts[i].name for i in involved)
        if cause == a.UNAVAILABLE:
            raise self._unavailable
        if cause == a.NOT_FINITE:
            raise NumericalFailure("the motion is not finite")
        if cause == a.TOO_LONG:
            raise NumericalFailure(
                f"search for the next event: got motion of up to {told[0] / (2 * math.pi):g} Hz, whose "
                f"samples every {told[1]:g} s until the end, in {told[2]:g} s, would take for ever; "
                "need fewer modes or a shorter run"
            )
        if cause == a.CHATTER:
            raise NumericalFailure(
                f"chatter: {self.window} events in {told[0]:g} s, more than {self._allowed} in a period of the highest "
                f"kept mode ({told[1]:g} Hz) or all within {ACCUMULATED:g} of the time so far"
            )
        if cause == a.NOT_ADMISSIBLE:
            raise NumericalFailure(f"contacts {names}: no set of closed contacts is admissible at this instant")
        if cause == a.SQUEEZED:
            raise self.rule._squeezed(involved)
        raise NumericalFailure("least distance: round-off decides which inequalities push")

    def _leave(self) -> State:
        """The state that the loop has come to."""
        ints, numbers = self.arrays.ints, self.arrays.numbers
        record = int(ints[a.CURRENT + a.LEVEL])
        level = self.arrays.loaded[ints[record + a.NUMBER]]
        n, phases = level.level.modes, ints[ints[a.CURRENT + a.PHASES] :][: ints[record + a.EXIT_COUNT]]
        x, v = (numbers[ints[a.CURRENT + part] :][:n].copy() for part in (a.PLACE, a.SPEED))
        return State(level, x, v, tuple(PHASES[k] for k in phases.tolist()))

    def trajectory(self, end: float) -> Any:
        """What has been collected."""
        if not self.message or len(self.record.spans):
            ints = self.arrays.ints
            self._evaluations = int(self.arrays.numbers[int(ints[a.FOUND]) + 1])
            self.rule.transitions += int(ints[a.TRANSITIONS])
        return super().trajectory(end)

    def _collected(self) -> tuple[Sequence[Segment], Sequence[Event]]:
        return self.record.segments(), self.record.events()

    def _keep_event(self, event: Event) -> None:
        self.events.append(event)
        self.record.add_event(event)


@dataclass
class FlatDrivenMotion(FlatMotion):
    """A run under an excitation that the loop carries."""

    arrays: DrivenArrays = None  # type: ignore[assignment]

    def _enter(self) -> None:
        self.arrays.set_drive()
        super()._enter()
        patterns = self.arrays.rule.excitation.patterns
        moved = self.state.level.configuration(self.state.displacement) - self.start.displacement
        w = self.state.displacement[len(self.state.displacement) - patterns.shape[1] :]
        self.arrays.numbers[a.WORK] = float((patterns @ w) @ moved)

    def _leave(self) -> State:
        state, drive = super()._leave(), self.arrays.drives[int(self.arrays.ints[a.PIECE])]
        rule = self.arrays.rule
        assert isinstance(state.level, DrivenLevel)
        drive = drive.after(float(self.arrays.numbers[a.AGE]))
        return DrivenState(
            state.level, state.displacement, state.velocity, state.phases, drive, rule.until, rule.finders
        )

    def _work_since(self) -> float:
        return float(self.arrays.numbers[a.WORK])

    def _collected(self) -> tuple[Sequence[Segment], Sequence[Event]]:
        return Segments(self.record, self._driven_segment), self.record.events()

    def _driven_segment(self, i: int) -> DrivenSegment:
        """The i-th segment of the record."""
        record, level = self.record, self.record.level(i)
        assert isinstance(level, DrivenLevel)
        start, end, armed_at, horizon, work, age = record.spans[i].tolist()
        drive = self.arrays.drives[record.rows[i, 1]]
        flow = Flow.of(level, *record.state(i), drive.after(age), horizon)
        return DrivenSegment(start, end, level, flow.coefficients, record.standing(i), armed_at, flow, work)
