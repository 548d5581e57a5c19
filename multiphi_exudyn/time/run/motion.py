"""Motion: a run under way, which the loop on flat arrays (loop.py) carries from event to event.

It has q >= 0 channels, pieces of which may follow while it goes on. A failure on the way ends it early, with its cause.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.packing.start_arrays import Measure, Start, set_starts, set_state
from multiphi_exudyn.events.states.state_arrays import measure
from multiphi_exudyn.events.transitions.exits import exits_of
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.time.loop.chatter import limits
from multiphi_exudyn.time.loop.failures import failure
from multiphi_exudyn.time.loop.loop import advance
from multiphi_exudyn.time.record.record import Record
from multiphi_exudyn.time.record.recorded_segments import Events, Recorded
from multiphi_exudyn.time.trajectory.final_state import Ending
from multiphi_exudyn.time.trajectory.trajectory import Again, Trajectory

__all__ = ["Motion", "carry", "measured", "motion_of"]

RECORD_BYTES = 2**31  # of a run: ten million segments of a small model; a laptop has room for it, and for a copy

carry, measured = entry(advance), entry(measure)
quiet = np.errstate(all="ignore")  # as compiled: what is not finite is found, and told


class Motion:
    """A run under way on ``arrays``, which it takes over from whatever run had them; collects segments and events.

    compiled: False for the loop as plain Python. loop: what is called in its place. time [s]: how far it is. message:
    why it goes no further, or "". sums_works: whether the loop sums the works of segments, for a ledger; others are
    integrated when one is asked for. Nothing has happened before ``begin``, or ``advance``, is called.
    """

    def __init__(
        self,
        arrays: LevelArrays,
        start: Start,
        compiled: bool | None = None,
        loop: Callable[..., Any] | None = None,
    ) -> None:
        self.arrays, self.start = arrays, start
        self._loop: Callable[..., Any] = loop or (carry.plain if compiled is False else carry)
        self._measured: Measure = measured.plain if compiled is False else measured
        self.levels = arrays.levels
        self.model = self.levels.model
        self.time, self.message = start.time, ""
        self.record = Record(self.model.contacts, arrays)
        self._window, self._allowed = limits(self.model)
        ending = Ending(self._at_first(start.time), self.record)
        self._ending = ending if start.state is None else ending.at(start.state)
        self._starting = self.sums_works = True
        self._unavailable: Exception | None = None

    def _at_first(self, time: float) -> np.ndarray:
        """The first numbers of the arrays for a run that sets out at a time [s]."""
        numbers = np.zeros(a.OF_A_RUN)
        numbers[a.TIME] = numbers[a.LAST_DECISION] = time
        numbers[a.ALLOWED] = self._allowed
        if self.levels.excitation.pushes:
            numbers[a.GIVEN_POTENTIAL] = self.levels.excitation.static.dot(self.start.displacement)
        return numbers

    def begin(self) -> Motion:
        """Itself, after whatever happens at the start."""
        self._carry(self.time)
        return self

    @property
    def state(self) -> State:
        """Where it is; there is none after a failure at the start."""
        state = self._ending.state
        assert state is not None, self.message
        return state

    @property
    def start_loss(self) -> Loss:
        """Energies [J] that its start took, where no event carries them."""
        return self._ending.start_loss

    @property
    def events(self) -> Events:
        """What has happened so far."""
        return Events(self.record, self._ending.numbers[a.LOST_SO_FAR : a.LOST_SO_FAR + a.LOSSES])

    def go_on_from(self, state: State, time: float) -> None:
        """Forget what has been collected, and go on from a state and a time [s]."""
        self.time, self.message, self._starting = time, "", False
        self.record = Record(self.model.contacts, self.arrays)
        numbers, piece = self._ending.numbers.copy(), self._ending.piece
        numbers[a.LAST_DECISION], numbers[a.DEFECTS] = time, math.nan
        numbers[a.LOOK_END] = numbers[a.LOOK_FIRST]
        numbers[a.LOST_AT_START : a.LOST_AT_START + a.LOSSES] = 0.0
        numbers[a.WORKS : a.WORKS + 3] = numbers[a.LOST_SO_FAR : a.LOST_SO_FAR + a.LOSSES] = 0.0
        self._ending = Ending(numbers, self.record, piece=piece).at(state)
        if self.arrays.owner and self.arrays.owner() is self:
            self.arrays.owner = None

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
        sums = self._ending.numbers[a.WORKS : a.VERDICT + 2].tolist()
        damped, varying, rubbed, defects, truncated, share, error = sums
        return Trajectory(
            model=self.model,
            segments=Recorded(self.record, defects, truncated, (damped, varying, rubbed), (share, error)),
            events=self.events,
            t_end=self.time if self.message else end,
            status="failed" if self.message else "ok",
            message=self.message,
            start=self.start,
            ending=self._ending,
            load=self.levels.excitation.static,
            again=again,
        )

    # ------------------------------------------------------------------ the loop

    def _carry(self, end: float, to_change: bool = False) -> None:
        """A failure ends the run, with its instant and its cause."""
        try:
            self.take_over()
            self.arrays.buffers.ints[a.STOP_AT_EVENT] = to_change
            answer = self._run(end)
            self._leave()
            if answer == a.FAILED:
                raise self.failure()
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
                "make the run shorter and continue it (start=), or give loads fewer samples"
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
        """Get the arrays from the run that has them, and has left them."""
        if self.arrays.owner is None or self.arrays.owner() is not self:
            self._enter()
            self.arrays.owner = weakref.ref(self)

    def _reached(self) -> Ending:
        """Where the loop stands, copied: another run may take the arrays over."""
        arrays, before = self.arrays, self._ending
        ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
        state = before.level, before.displacement, before.velocity, before.phases
        if not ints[a.STARTING]:
            record, x, v, *_, waits, settled = ints[a.CURRENT : a.CURRENT + a.STATE_INTS].tolist()
            level, exits = arrays.loaded[int(ints[record + a.NUMBER])], int(ints[record + a.EXIT_COUNT])
            n = level.level.modes
            phases = (a.ARMED,) * exits if settled else tuple(ints[waits : waits + exits].tolist())
            state = level, numbers[x : x + n].copy(), numbers[v : v + n].copy(), phases
        return Ending(
            numbers[: a.OF_A_RUN].copy(),
            self.record,
            *state,
            *arrays.chatter,
            int(ints[a.PIECE]),
            float(numbers[ints[a.FOUND] + 1]),
            int(ints[a.TRANSITIONS]),
            self.model.levels_built,
            arrays.buffers.size,
        )

    def _enter(self) -> None:
        """The present state, or the start, into the arrays."""
        arrays, ending = self.arrays, self._ending
        level = 0 if ending.level is None else arrays.level(ending.level.states)
        arrays.begin_record()
        arrays.set_chatter(self._window, ending.decisions, ending.ring)
        arrays.buffers.numbers[: a.OF_A_RUN] = ending.numbers
        arrays.channels.set(arrays.buffers, ending.piece, float(ending.numbers[a.AGE]), self.time)
        if ending.level is None:
            set_starts(arrays, (self.start,))
        else:
            set_state(arrays, level, ending.displacement, ending.velocity, ending.phases, self._measured)
            arrays.ints[a.STARTING] = a.GOING_ON if self._starting else 0
        ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
        ints[a.TRANSITIONS], ints[a.GIVEN_UP] = ending.transitions, 0
        ints[a.WORKING] = int(self.sums_works)
        numbers[a.TIME], numbers[ints[a.FOUND] + 1] = self.time, ending.evaluations

    def _leave(self) -> None:
        """The state that the loop has come to, and what it has recorded."""
        self.record.take()
        self._ending = self._reached()
        self.time = float(self._ending.numbers[a.TIME])
        if not self.arrays.buffers.ints[a.STARTING]:
            self._starting = False

    def land(self, part: dict[str, np.ndarray], told: np.ndarray) -> None:
        """Be where batch.py has brought it: its record, of which the last segment is its final state.

        told: numbers of a run at its end, evaluations, transitions. It goes no further: its chatter check begins anew.
        """
        rows = part["rows"]
        number, piece, start, waits = rows[-1].tolist()
        level = self.arrays.loaded[number]
        n, exits = level.level.modes, len(exits_of(level))
        phases = part["phases"][waits : waits + exits].tolist() if waits >= 0 else [a.ARMED] * exits
        x = part["coordinates"][start : start + 2 * n]
        self.record.keep(part | {"rows": rows[:-1]})
        ended = Ending(
            told[: a.OF_A_RUN],
            self.record,
            level,
            x[:n],
            x[n:],
            tuple(phases),
            piece=piece,
            levels_built=self.model.levels_built,
            array_bytes=self.arrays.buffers.size,
        )
        evaluations, transitions = told[a.OF_A_RUN :].tolist()
        self._ending = ended._replace(evaluations=evaluations, transitions=int(transitions))
        self._starting, self.time = False, float(told[a.TIME])

    def failure(self) -> Exception:
        """What has stopped the loop."""
        if self.arrays.ints[a.CAUSE] == a.UNAVAILABLE and self._unavailable is not None:
            return self._unavailable
        return failure(self.arrays)


def motion_of(levels: LoadedLevels, start: Start, compiled: bool | None = None) -> Motion:
    """The run in these levels."""
    levels.arrays = levels.arrays or LevelArrays(levels)
    return Motion(levels.arrays, start, compiled)
