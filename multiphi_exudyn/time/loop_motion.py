"""Motion in the loop of flat arrays: a run under way, as in motion.py, that loop.py carries."""

from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.state import Event, State
from multiphi_exudyn.mathematics.compiled import entry
from multiphi_exudyn.time.driven.arrays import DrivenArrays
from multiphi_exudyn.time.driven.level import DrivenLevel
from multiphi_exudyn.time.driven.record import DrivenRecord
from multiphi_exudyn.time.driven.state import DrivenState
from multiphi_exudyn.time.loop import ACCUMULATED, advance
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.record import PHASES, Record
from multiphi_exudyn.time.segment import Segment

__all__ = ["DrivenLoopMotion", "LoopMotion"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}
ARRAY_BYTES = 2**29  # of a model's arrays under one load: half of what a model may keep (model.py)
FEWEST_LEVELS = 8  # packed whatever they take: a run that goes to and fro between a few would pack them at every event

carry = entry(advance)


@dataclass
class _Kept:
    """What a run keeps while another one has the arrays: the ring of the chatter check and what it is about."""

    ring: np.ndarray
    decisions: int = 0
    last_decision: float = 0.0


@dataclass
class LoopMotion(Motion):
    """A run that the loop carries on the arrays of its rule, which it takes over from whatever run had them."""

    arrays: LevelArrays = field(kw_only=True)

    def __post_init__(self) -> None:
        self.record = self._new_record()
        self._kept = _Kept(np.zeros(2 * (self.window + 1)))
        self._unavailable: Exception | None = None
        super().__post_init__()

    def go_on_from(self, state: State, time: float) -> None:
        """Forget what has been collected, and go on from a state and a time [s]."""
        super().go_on_from(state, time)
        self.record, self._kept = self._new_record(), _Kept(np.zeros(2 * (self.window + 1)), last_decision=time)
        if self.arrays.owner and self.arrays.owner() is self:
            self.arrays.owner = None

    def advance(self, end: float, to_change: bool = False) -> None:
        """Carries the state to ``end``, or to the failure that stops it; if asked, no further than a first event."""
        if self.message or self.time >= end:
            return
        with self._failing():
            self._take_over()
            self.arrays.ints[a.STOP_AT_EVENT] = int(to_change)
            with np.errstate(all="ignore"):  # as compiled: what is not finite is found, and told
                answer = self._run(end)
            self._leave()
            if answer == a.FAILED:
                raise self._failure()

    def _run(self, end: float) -> int:
        """The loop until it ends, with all that it needs."""
        while True:
            answer = int(carry(*self.arrays.buffers.all, end))
            if answer == a.FULL:
                self.record.take(self.arrays)
            elif answer == a.NEED:
                self._supply()
            else:
                return answer

    def _supply(self) -> None:
        """Pack what the loop needs, in arrays that begin anew where they have become too large."""
        try:
            self.arrays.supply()
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            self._unavailable = error
            self.arrays.ints[a.GIVEN_UP] = 1
        if self.arrays.buffers.size > ARRAY_BYTES and len(self.arrays.loaded) > FEWEST_LEVELS:
            self._leave()
            self.arrays.forget()
            self._enter()
        elif self.arrays.outgrown:
            self.record.take(self.arrays)
            self.arrays.begin_record()

    # ------------------------------------------------------------------ the state in the arrays

    def _take_over(self) -> None:
        """Get the arrays from the run that has them."""
        owner = self.arrays.owner() if self.arrays.owner else None
        if owner is not self:
            if owner is not None:
                owner.give_up_arrays()
            self._enter()
            self.arrays.owner = weakref.ref(self)

    def give_up_arrays(self) -> None:
        """Keep what stands in the arrays alone: another run takes them over."""
        ints, numbers = self.arrays.ints, self.arrays.numbers
        ring = numbers[ints[a.RING] :][: len(self._kept.ring)].copy()
        self._kept = _Kept(ring, int(ints[a.DECISIONS]), float(numbers[a.LAST_DECISION]))

    def _enter(self) -> None:
        """The present state into the arrays."""
        arrays, kept = self.arrays, self._kept
        level = arrays.level(self.state.closed)
        arrays.begin_record()
        ring = arrays.ring(len(kept.ring))
        arrays.ints[a.WINDOW], arrays.ints[a.DECISIONS] = self.window, kept.decisions
        for slot in (a.TRANSITIONS, a.GIVEN_UP):
            arrays.ints[slot] = 0
        numbers = arrays.numbers
        numbers[ring : ring + len(kept.ring)] = kept.ring
        numbers[a.TIME], numbers[a.LAST_DECISION] = self.time, kept.last_decision
        numbers[a.ALLOWED], numbers[int(arrays.ints[a.FOUND]) + 1] = self._allowed, 0.0
        arrays.set_state(level, self.state.displacement, self.state.velocity, [NUMBERS[p] for p in self.state.phases])

    def _leave(self) -> None:
        """The state that the loop has come to, and what it has recorded."""
        ints, numbers = self.arrays.ints, self.arrays.numbers
        self.record.take(self.arrays)
        self.give_up_arrays()
        self.time, self.state = float(numbers[a.TIME]), self._state_reached()
        samples = int(ints[a.FOUND]) + 1
        self._evaluations += int(numbers[samples])
        self.rule.transitions += int(ints[a.TRANSITIONS])
        ints[a.TRANSITIONS], numbers[samples] = 0, 0.0

    def _state_reached(self) -> State:
        ints, numbers = self.arrays.ints, self.arrays.numbers
        record = int(ints[a.CURRENT + a.LEVEL])
        level = self.arrays.loaded[int(ints[record + a.NUMBER])]
        n, phases = level.level.modes, ints[ints[a.CURRENT + a.PHASES] :][: ints[record + a.EXIT_COUNT]]
        x, v = (numbers[ints[a.CURRENT + part] :][:n].copy() for part in (a.PLACE, a.SPEED))
        return State(level, x, v, tuple(PHASES[k] for k in phases.tolist()))

    def _failure(self) -> Exception:
        """What has stopped the loop."""
        ints, told = self.arrays.ints, self.arrays.numbers[a.TOLD : a.TOLD + 3].tolist()
        cause, flags = int(ints[a.CAUSE]), ints[ints[a.CAUSED_BY] :][: ints[a.ELEMENTS]]
        involved = np.flatnonzero(flags).tolist()
        names = ", ".join(self.model.contacts[i].name for i in involved)
        if cause == a.UNAVAILABLE and self._unavailable is not None:
            return self._unavailable
        if cause == a.SQUEEZED:
            return self.rule.squeezed(involved)
        sentences = {
            a.NOT_FINITE: "the motion is not finite",
            a.TOO_LONG: f"search for the next event: got motion of up to {told[0] / (2 * math.pi):g} Hz, whose "
            f"samples every {told[1]:g} s until the end, in {told[2]:g} s, would take for ever; "
            "need fewer modes or a shorter run",
            a.CHATTER: f"chatter: {self.window} events in {told[0]:g} s, more than {self._allowed} in a period of the "
            f"highest kept mode ({told[1]:g} Hz) or all within {ACCUMULATED:g} of the time so far",
            a.NOT_ADMISSIBLE: f"contacts {names}: no set of closed contacts is admissible at this instant",
            a.UNSETTLED: "least distance: round-off decides which inequalities push",
        }
        return NumericalFailure(sentences[cause])

    def _new_record(self) -> Record:
        return Record([contact.name for contact in self.model.contacts])

    def _collected(self) -> tuple[Sequence[Segment], Sequence[Event]]:
        return self.record.segments(), self.record.events()

    def _keep_event(self, event: Event) -> None:
        self.record.add_event(event)


@dataclass
class DrivenLoopMotion(LoopMotion):
    """A run under an excitation that the loop carries."""

    arrays: DrivenArrays = field(kw_only=True)

    def __post_init__(self) -> None:
        self._piece, self._age, self._work = 0, 0.0, 0.0
        super().__post_init__()

    def _begin(self) -> None:
        super()._begin()
        patterns = self.arrays.rule.excitation.patterns
        w = self.state.displacement[len(self.state.displacement) - patterns.shape[1] :]
        moved = self.state.level.configuration(self.state.displacement) - self.start.displacement
        self._work = float((patterns @ w) @ moved)

    def _enter(self) -> None:
        self.arrays.set_drive(self._piece, self._age, self.time)
        super()._enter()
        self.arrays.numbers[a.WORK] = self._work

    def give_up_arrays(self) -> None:
        """Keep what stands in the arrays alone."""
        super().give_up_arrays()
        ints, numbers = self.arrays.ints, self.arrays.numbers
        self._piece, self._age, self._work = int(ints[a.PIECE]), float(numbers[a.AGE]), float(numbers[a.WORK])

    def _state_reached(self) -> State:
        state, rule = super()._state_reached(), self.arrays.rule
        assert isinstance(state.level, DrivenLevel)
        drive = self.arrays.drives[self._piece].after(self._age)
        given = state.level, state.displacement, state.velocity, state.phases, drive
        return DrivenState(*given, rule.until, rule.finders)

    def _work_since(self) -> float:
        return self._work

    def _new_record(self) -> Record:
        return DrivenRecord([contact.name for contact in self.model.contacts], self.arrays.drives)
