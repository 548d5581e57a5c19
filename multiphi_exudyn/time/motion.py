"""Motion: a run under way, which the loop on flat arrays (loop.py) carries from event to event.

It has q >= 0 channels, pieces of which may follow while it goes on. A failure on the way ends it early, with its cause.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.level_arrays import LevelArrays, Measure
from multiphi_exudyn.events.state import Loss, Phase, State
from multiphi_exudyn.events.state_arrays import measure
from multiphi_exudyn.mathematics.compiled import entry
from multiphi_exudyn.time.balance import Statistics
from multiphi_exudyn.time.chatter import allowed, window
from multiphi_exudyn.time.loop import advance
from multiphi_exudyn.time.loop_record import ACCUMULATED
from multiphi_exudyn.time.record import PHASES, Record
from multiphi_exudyn.time.trajectory import Again, Start, Trajectory

__all__ = ["NUMBERS", "Motion", "carry", "measured"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}


RECORD_BYTES = 2**31  # of a run: ten million segments of a small model; a laptop has room for it, and for a copy
NOTHING = Loss()
SUMS = (a.WORK, a.DEFECTS, a.TRUNCATED)
NOT_FINITE = "the motion is not finite"

carry, measured = entry(advance), entry(measure)


@dataclass
class _Kept:
    """What a run keeps while another one has the arrays.

    last_decision [s], decisions, ring: of the chatter check, the last ones. piece, age: which of the channels, and
    since when [s] it lasts. work [J]: of what varies in time since the last segment ended. defects, truncated: sums so
    far, see Segments.
    """

    last_decision: float
    decisions: int = 0
    ring: list[float] = field(default_factory=list)
    piece: int = 0
    age: float = 0.0
    work: float = 0.0
    defects: float = 0.0
    truncated: float = 0.0


class Motion:
    """A run under way on ``arrays``, which it takes over from whatever run had them; collects segments and events.

    compiled: False for the loop as plain Python. loop: what is called in its place. time [s]: how far it is. message:
    why it goes no further, or "". start_loss: at a start without events. Nothing has happened before ``begin``, or
    ``advance``, is called.
    """

    def __init__(
        self,
        arrays: LevelArrays,
        start: Start,
        compiled: bool | None = None,
        loop: Callable[..., Any] | None = None,
    ) -> None:
        self.arrays, self.start = arrays, start
        self._loop: Callable[..., Any] = loop or (advance if compiled is False else carry)
        self._measured: Measure = measure if compiled is False else measured
        self.model, self.levels = arrays.levels.model, arrays.levels
        self.time, self.message, self.start_loss = start.time, "", NOTHING
        self.record = Record(self.model.contacts, self.arrays)
        self._state: State | None = start.state
        self._starting = True
        self._window, self._allowed = window(self.model), allowed(self.model)
        self._kept = _Kept(start.time)
        self._evaluations = self._transitions = 0
        self._unavailable: Exception | None = None

    def begin(self) -> Motion:
        """Itself, after whatever happens at the start."""
        self._carry(self.time)
        return self

    @property
    def state(self) -> State:
        """Where it is; there is none after a failure at the start."""
        assert self._state is not None, self.message
        return self._state

    def go_on_from(self, state: State, time: float) -> None:
        """Forget what has been collected, and go on from a state and a time [s]."""
        self._state, self.time, self.message, self.start_loss = state, time, "", NOTHING
        self._starting = False
        self.record = Record(self.model.contacts, self.arrays)
        self._kept = replace(self._kept, last_decision=time, decisions=0, ring=[], defects=math.nan)
        if self.arrays.owner and self.arrays.owner() is self:
            self.arrays.owner = None

    def go_on_with(self, state: State, time: float) -> None:
        """``go_on_from`` a state under static loads alone."""
        self.go_on_from(self.levels.with_channels(state), time)

    @property
    def static_state(self) -> State:
        """The present state as one under static loads alone."""
        return self.levels.without_channels(self.state)

    def advance(self, end: float, to_change: bool = False) -> None:
        """Carries the state to ``end``, or to the failure that stops it; if asked, no further than a first event."""
        if not self.message and self.time < end:
            self._carry(end, to_change)

    def trajectory(self, end: float, again: Again | None = None) -> Trajectory:
        """What has been collected; again: see Trajectory."""
        segments, events = self.record.segments(self._kept.defects, self._kept.truncated), self.record.events()
        return Trajectory(
            model=self.model,
            segments=segments,
            events=events,
            t_end=self.time if self.message else end,
            status="failed" if self.message else "ok",
            message=self.message,
            start=self.start,
            start_loss=self.start_loss,
            final=self._state if segments else None,
            final_work=self._kept.work,
            load=self.levels.load,
            stats=Statistics(
                levels_built=self.model.levels_built,
                levels_possible=self.model.levels_possible,
                transitions=self._transitions,
                events=len(events),
                segments=len(segments),
                function_evaluations=self._evaluations,
                record_bytes=self.record.bytes,
                array_bytes=self.arrays.buffers.size,
            ),
            again=again,
        )

    # ------------------------------------------------------------------ the loop

    def _carry(self, end: float, to_change: bool = False) -> None:
        """A failure ends the run, with its instant and its cause."""
        try:
            self._take_over()
            self.arrays.ints[a.STOP_AT_EVENT] = int(to_change)
            with np.errstate(all="ignore"):  # as compiled: what is not finite is found, and told
                answer = self._run(end)
            self._leave()
            if answer == a.FAILED:
                raise self.failure()
            if self._state is not None and not np.all(np.isfinite(self._state.displacement)):
                raise NumericalFailure(NOT_FINITE)  # a growing mode that no exit watches
        except (MultiPhiError, np.linalg.LinAlgError) as failure:
            singular = "" if isinstance(failure, MultiPhiError) else "linear algebra of a level or an impact fails: "
            self.message = f"at t = {self.time:.9g} s: {singular}{failure}"

    def _run(self, end: float) -> int:
        """The loop until it ends, with all that it needs."""
        while True:
            answer = int(self._loop(*self.arrays.buffers.all, end))
            if answer == a.FULL:
                self.record.take()
                self._check_record()
            elif answer == a.NEED:
                self._supply()
            else:
                return answer

    def _check_record(self) -> None:
        """End the run before its record takes the machine."""
        taken, segments = self.record.bytes, self.record.count
        if taken > RECORD_BYTES:
            self._leave()
            raise NumericalFailure(
                f"record: got {taken / 1e9:.2g} GB of {segments} segments, need at most {RECORD_BYTES / 1e9:.2g} GB: "
                "a shorter run, from whose end others go on (start=), or fewer events or samples of loads"
            )

    def _supply(self) -> None:
        """Pack what the loop needs, in arrays that begin anew where they have become too large."""
        try:
            self.arrays.supply()
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            self._unavailable = error
            self.arrays.ints[a.GIVEN_UP] = 1
        if self.arrays.full:
            self._leave()
            self.arrays.forget()
            self._enter()
        elif self.arrays.outgrown:
            self.record.take()
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
        self._keep(self.arrays.numbers[: a.RUN_NUMBERS].tolist())

    def _keep(self, given: list[float]) -> None:
        """What the first numbers of the arrays say."""
        ints, numbers = self.arrays.ints, self.arrays.numbers
        decisions, start = int(ints[a.DECISIONS]), int(ints[a.RING])
        ring = numbers[start : start + 2 * min(decisions, self._window + 1)].tolist() if decisions else []
        sums = (given[place] for place in SUMS)
        self._kept = _Kept(given[a.LAST_DECISION], decisions, ring, int(ints[a.PIECE]), given[a.AGE], *sums)

    def _enter(self) -> None:
        """The present state, or the start, into the arrays."""
        arrays, kept, state = self.arrays, self._kept, self._state
        arrays.channels.set(arrays.buffers, kept.piece, kept.age, self.time)
        level = 0 if state is None else arrays.level(state.level.states)
        arrays.begin_record()
        ring = arrays.ring(2 * (self._window + 1))
        arrays.ints[a.WINDOW], arrays.ints[a.DECISIONS] = self._window, kept.decisions
        for slot in (a.TRANSITIONS, a.GIVEN_UP):
            arrays.ints[slot] = 0
        numbers = arrays.numbers
        if kept.ring:
            numbers[ring : ring + len(kept.ring)] = kept.ring
        numbers[a.TIME], numbers[a.LAST_DECISION], numbers[a.WORK] = self.time, kept.last_decision, kept.work
        numbers[a.DEFECTS], numbers[a.TRUNCATED] = kept.defects, kept.truncated
        numbers[a.ALLOWED], numbers[int(arrays.ints[a.FOUND]) + 1] = self._allowed, 0.0
        if state is None:
            start = self.start
            arrays.set_start(start.displacement, start.velocity, start.states, start.held)
        else:
            phases = [NUMBERS[phase] for phase in state.phases]
            arrays.set_state(level, state.displacement, state.velocity, phases, self._measured)
            arrays.ints[a.STARTING] = a.GOING_ON if self._starting else 0

    def _leave(self) -> None:
        """The state that the loop has come to, and what it has recorded."""
        ints, numbers = self.arrays.ints, self.arrays.numbers
        self.record.take()
        given = numbers[: a.RUN_NUMBERS].tolist()
        self._keep(given)
        self.time = given[a.TIME]
        if not ints[a.STARTING]:
            if self._starting:
                lost = given[a.LOST_AT_START : a.LOST_AT_START + a.LOSSES]
                self.start_loss = Loss(*lost) if any(lost) else NOTHING
            self._state, self._starting = self._state_reached(), False
        samples = int(ints[a.FOUND]) + 1
        self._evaluations += int(numbers[samples])
        self._transitions += int(ints[a.TRANSITIONS])
        ints[a.TRANSITIONS], numbers[samples] = 0, 0.0

    def _state_reached(self) -> State:
        ints, numbers = self.arrays.ints, self.arrays.numbers
        record, x, v = ints[a.CURRENT + a.LEVEL : a.CURRENT + a.SPEED + 1].tolist()
        level = self.arrays.loaded[int(ints[record + a.NUMBER])]
        if ints[a.CURRENT + a.SETTLED]:
            phases = (Phase.ARMED,) * int(ints[record + a.EXIT_COUNT])
        else:
            standing = ints[ints[a.CURRENT + a.PHASES] :][: ints[record + a.EXIT_COUNT]]
            phases = tuple(PHASES[k] for k in standing.tolist())
        n = level.level.modes
        return State(level, numbers[x : x + n].copy(), numbers[v : v + n].copy(), phases)

    def failure(self) -> Exception:
        """What has stopped the loop."""
        ints, told = self.arrays.ints, self.arrays.numbers[a.TOLD : a.TOLD + 3].tolist()
        cause, flags = int(ints[a.CAUSE]), ints[ints[a.CAUSED_BY] :][: ints[a.ELEMENTS]]
        names = ", ".join(self.model.contacts[i].name for i in np.flatnonzero(flags).tolist())
        if cause == a.UNAVAILABLE and self._unavailable is not None:
            return self._unavailable
        complete = self.model.level_at(()).modes == self.model.base.modes.count
        sentences = {
            a.NOT_FINITE: NOT_FINITE,
            a.TOO_LONG: f"search for the next event: got motion of up to {told[0] / (2 * math.pi):g} Hz, whose "
            f"samples every {told[1]:g} s until the end, in {told[2]:g} s, would take for ever; "
            "need fewer modes or a shorter run",
            a.CHATTER: f"chatter: {self._window} events in {told[0]:g} s, more than {self._allowed} in a period of the "
            f"highest kept mode or load ({told[1]:g} Hz) or all within {ACCUMULATED:g} of the time so far",
            a.NOT_ADMISSIBLE: f"contacts {names}: no set of closed contacts is admissible at this instant",
            a.SQUEEZED: f"rigid contacts {names}: their stops move against each other and leave no way out"
            + ("" if complete else " in the kept modes, need more of them"),
            a.UNSETTLED: "no forces were found that agree with what moves: round-off decides which contacts push, or "
            "friction is so high that they are not unique, need a smaller coefficient",
            a.MIXED: f"rigid contacts {names}: struck together with several restitutions, need one",
            a.GAINING: f"rigid contacts {names}: an impact with friction and several restitutions would make energy, "
            "need one restitution",
        }
        return NumericalFailure(sentences[cause])
