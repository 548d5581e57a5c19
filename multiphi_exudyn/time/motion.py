"""Motion: a run under way, which the loop on flat arrays (loop.py) carries from event to event.

It has q >= 0 channels, pieces of which may follow while it goes on. A failure on the way ends it early, with its cause.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.entering import Measure, set_start, set_state
from multiphi_exudyn.events.exits import exits_of
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.loaded_levels import LoadedLevels
from multiphi_exudyn.events.state import Loss, Phase, State
from multiphi_exudyn.events.state_arrays import measure
from multiphi_exudyn.mathematics.compiled import entry
from multiphi_exudyn.mathematics.round_off import all_finite
from multiphi_exudyn.time.balance import Statistics
from multiphi_exudyn.time.chatter import limits
from multiphi_exudyn.time.failures import NOT_FINITE, failure
from multiphi_exudyn.time.loop import advance
from multiphi_exudyn.time.record import PHASES, Record
from multiphi_exudyn.time.recorded import Events, Recorded
from multiphi_exudyn.time.start import Start
from multiphi_exudyn.time.trajectory import Again, Trajectory

__all__ = ["NUMBERS", "Motion", "carry", "measured", "motion_of"]

NUMBERS = {phase: number for number, phase in enumerate(PHASES)}


RECORD_BYTES = 2**31  # of a run: ten million segments of a small model; a laptop has room for it, and for a copy
NOTHING = Loss()
NO_RING = np.zeros(0)

carry, measured = entry(advance), entry(measure)
quiet = np.errstate(all="ignore")  # as compiled: what is not finite is found, and told


class _Kept(NamedTuple):
    """What a run keeps while another one has the arrays: its own of their first numbers, and the chatter check's.

    piece: which of the channels.
    """

    numbers: np.ndarray
    decisions: int
    ring: np.ndarray
    piece: int


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
        self._loop: Callable[..., Any] = loop or (quiet(advance) if compiled is False else carry)
        self._measured: Measure = measure if compiled is False else measured
        self.levels = arrays.levels
        self.model = self.levels.model
        self.time, self.message, self.start_loss = start.time, "", NOTHING
        self.record = Record(self.model.contacts, arrays)
        self._state: State | None = start.state
        self._starting = True
        self._window, self._allowed = limits(self.model)
        self._kept = _Kept(self._at_first(start.time), 0, NO_RING, 0)
        self._evaluations = self._transitions = 0
        self._unavailable: Exception | None = None

    def _at_first(self, time: float) -> np.ndarray:
        """The first numbers of the arrays for a run that sets out at a time [s]."""
        numbers = np.zeros(a.OF_A_RUN)
        numbers[a.TIME] = numbers[a.LAST_DECISION] = time
        numbers[a.ALLOWED] = self._allowed
        return numbers

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
        numbers = self._kept.numbers.copy()
        numbers[a.LAST_DECISION], numbers[a.DEFECTS] = time, math.nan
        self._kept = _Kept(numbers, 0, NO_RING, self._kept.piece)
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
        numbers = self._kept.numbers
        segments = Recorded(self.record, float(numbers[a.DEFECTS]), float(numbers[a.TRUNCATED]))
        events = Events(self.record)
        return Trajectory(
            model=self.model,
            segments=segments,
            events=events,
            t_end=self.time if self.message else end,
            status="failed" if self.message else "ok",
            message=self.message,
            start=self.start,
            start_loss=self.start_loss,
            final=self._state if self.record.count else None,
            final_work=float(numbers[a.WORK]),
            load=self.levels.excitation.static,
            stats=Statistics(
                levels_built=self.model.levels_built,
                levels_possible=self.model.levels_possible,
                transitions=self._transitions,
                events=len(events),
                segments=self.record.count,
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
            self.take_over()
            self.arrays.ints[a.STOP_AT_EVENT] = int(to_change)
            answer = self._run(end)
            self._leave()
            if answer == a.FAILED:
                raise self.failure()
            if self._state is not None and not all_finite(self._state.displacement):
                raise NumericalFailure(NOT_FINITE)  # a growing mode that no exit watches
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            singular = "" if isinstance(error, MultiPhiError) else "linear algebra of a level or an impact fails: "
            self.message = f"at t = {self.time:.9g} s: {singular}{error}"

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

    @quiet
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

    def take_over(self) -> None:
        """Get the arrays from the run that has them."""
        owner = self.arrays.owner() if self.arrays.owner else None
        if owner is not self:
            if owner is not None:
                owner.give_up_arrays()
            self._enter()
            self.arrays.owner = weakref.ref(self)

    def give_up_arrays(self) -> None:
        """Keep what stands in the arrays alone: another run takes them over."""
        ints, numbers = self.arrays.buffers.ints, self.arrays.buffers.numbers
        self._kept = _Kept(numbers[: a.OF_A_RUN].copy(), *self.arrays.chatter, int(ints[a.PIECE]))

    def _enter(self) -> None:
        """The present state, or the start, into the arrays."""
        arrays, state, (kept, decisions, ring, piece) = self.arrays, self._state, self._kept
        level = 0 if state is None else arrays.level(state.level.states)
        arrays.begin_record()
        arrays.set_chatter(self._window, decisions, ring)
        arrays.buffers.numbers[: a.OF_A_RUN] = kept
        arrays.channels.set(arrays.buffers, piece, float(kept[a.AGE]), self.time)
        if state is None:
            start = self.start
            set_start(arrays, start.displacement, start.velocity, start.states, start.held, start.penetrating)
        else:
            phases = [NUMBERS[phase] for phase in state.phases]
            set_state(arrays, level, state.displacement, state.velocity, phases, self._measured)
            arrays.ints[a.STARTING] = a.GOING_ON if self._starting else 0
        ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
        ints[a.TRANSITIONS] = ints[a.GIVEN_UP] = 0
        numbers[a.TIME] = self.time
        numbers[ints[a.FOUND] + 1] = 0.0

    def _leave(self) -> None:
        """The state that the loop has come to, and what it has recorded."""
        ints, numbers = self.arrays.buffers.ints, self.arrays.buffers.numbers
        self.record.take()
        self.give_up_arrays()
        self.time = float(numbers[a.TIME])
        if not ints[a.STARTING]:
            if self._starting:
                self._tell_start(numbers)
            self._state, self._starting = self._state_reached(), False
        samples = ints[a.FOUND] + 1
        self._evaluations += int(numbers[samples])
        self._transitions += int(ints[a.TRANSITIONS])
        ints[a.TRANSITIONS], numbers[samples] = 0, 0.0

    def _tell_start(self, numbers: np.ndarray) -> None:
        lost = numbers[a.LOST_AT_START : a.LOST_AT_START + a.LOSSES].tolist()
        self.start_loss = Loss(*lost) if any(lost) else NOTHING

    def land(self, part: dict[str, np.ndarray], told: np.ndarray) -> None:
        """Be where several.py has brought it: its record, of which the last segment is its final state.

        told: numbers of a run at its end, evaluations, transitions. It goes no further: its chatter check begins anew.
        """
        rows, spans = part["rows"], part["spans"]
        number, piece, _, start, waits = rows[-1].tolist()
        level = self.arrays.loaded[number]
        n, exits = level.level.modes, len(exits_of(level))
        phases = part["phases"][waits : waits + exits].tolist() if waits >= 0 else [0] * exits
        x = part["coordinates"][start : start + 2 * n]
        self._state, self._starting = State(level, x[:n], x[n:], tuple(PHASES[k] for k in phases)), False
        self.record.keep(part | {"rows": rows[:-1], "spans": spans[:-1]})
        self._kept, self.time = _Kept(told[: a.OF_A_RUN], 0, NO_RING, piece), float(told[a.TIME])
        self._evaluations, self._transitions = map(int, told[a.OF_A_RUN :].tolist())
        self._tell_start(told)

    def _state_reached(self) -> State:
        ints, numbers = self.arrays.buffers.ints, self.arrays.buffers.numbers
        record, x, v, *_, waits, settled = ints[a.CURRENT : a.CURRENT + a.STATE_INTS].tolist()
        level, exits = self.arrays.loaded[int(ints[record + a.NUMBER])], int(ints[record + a.EXIT_COUNT])
        phases = (Phase.ARMED,) * exits if settled else tuple(PHASES[k] for k in ints[waits : waits + exits].tolist())
        n = level.level.modes
        return State(level, numbers[x : x + n].copy(), numbers[v : v + n].copy(), phases)

    def failure(self) -> Exception:
        """What has stopped the loop."""
        if self.arrays.ints[a.CAUSE] == a.UNAVAILABLE and self._unavailable is not None:
            return self._unavailable
        return failure(self.arrays)


def motion_of(levels: LoadedLevels, start: Start, compiled: bool | None = None) -> Motion:
    """The run in these levels."""
    levels.arrays = levels.arrays or LevelArrays(levels)
    return Motion(levels.arrays, start, compiled)
