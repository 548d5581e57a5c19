"""Motion: a run in progress, which the loop on flat arrays (loop.py) advances from event to event.

It has q >= 0 channels; further pieces of them may follow during the run. A failure ends the run early, with its cause.
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
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.time.loop.chatter import limits
from multiphi_exudyn.time.loop.failures import failure
from multiphi_exudyn.time.loop.loop import advance
from multiphi_exudyn.time.record.loop_copies import LoopState, RecordPart, copy_loop
from multiphi_exudyn.time.record.record import Record
from multiphi_exudyn.time.record.recorded_segments import Events, Recorded
from multiphi_exudyn.time.trajectory.final_state import FinalState
from multiphi_exudyn.time.trajectory.trajectory import Rerun, Trajectory

__all__ = ["Motion", "carry", "measured", "motion_of"]

RECORD_BYTES = 2**31  # of a run: ten million segments of a small model; a laptop has memory for it and for a copy

carry, measured = entry(advance), entry(measure)
NO_RING = np.zeros(0)
quiet = np.errstate(all="ignore")  # as in compiled code: numbers that are not finite are checked for


class Motion:
    """A run in progress on ``arrays``, which may have belonged to another run before; collects segments and events.

    compiled: False for the loop as plain Python. loop: a function to call in its place. time: present time [s].
    message: cause of a failure, or "". is_summing_works: whether the loop sums the works of segments for a ledger;
    otherwise they are integrated when a ledger is made. The run begins with ``process_start`` or ``advance``.
    """

    def __init__(
        self,
        arrays: LevelArrays,
        start: Start,
        compiled: bool | None = None,
        loop: Callable[..., Any] | None = None,
    ) -> None:
        self.arrays, self.start = arrays, start
        self._loop = loop or (carry.plain if compiled is False else None)
        self._measured: Measure = measured.plain if compiled is False else measured
        self.levels = arrays.levels
        self.model = self.levels.model
        self.time, self.message = start.time, ""
        self.record = Record(self.model.contacts, arrays)
        self._window, self._allowed = limits(self.model)
        ending = FinalState(self._initial_numbers(start.time), self.record)
        self._final = ending if start.state is None else ending.at(start.state)
        self._starting = self.is_summing_works = True
        self._unavailable: Exception | None = None

    def _initial_numbers(self, time: float) -> np.ndarray:
        """Numbers of a run at its start at a time [s]."""
        numbers = np.zeros(a.OF_A_RUN)
        numbers[a.TIME] = numbers[a.LAST_DECISION] = time
        numbers[a.ALLOWED], numbers[a.HORIZON] = self._allowed, 1.0
        if self.levels.excitation.pushes:
            numbers[a.GIVEN_POTENTIAL] = self.levels.excitation.static.dot(self.start.displacement)
        return numbers

    def process_start(self) -> Motion:
        """Process the events at the start, and return the motion."""
        self._run_guarded(self.time)
        return self

    @property
    def state(self) -> State:
        """The present state; there is none after a failure at the start."""
        state = self._final.state
        assert state is not None, self.message
        return state

    @property
    def start_loss(self) -> Loss:
        """Energies [J] lost at the start that no event records."""
        return self._final.start_loss

    @property
    def events(self) -> Events:
        """Events so far."""
        return Events(self.record, self._final.numbers[a.LOST_SO_FAR : a.LOST_SO_FAR + a.LOSSES])

    def continue_from(self, state: State, time: float) -> None:
        """Drop the collected segments and events, and continue from a state and a time [s]."""
        self.time, self.message, self._starting = time, "", False
        self.record = Record(self.model.contacts, self.arrays)
        numbers, piece = self._final.numbers.copy(), self._final.piece
        numbers[a.TIME] = numbers[a.LAST_DECISION] = time
        numbers[a.DEFECTS] = math.nan
        numbers[a.LOOK_END] = numbers[a.LOOK_FIRST]
        numbers[a.LOST_AT_START : a.LOST_AT_START + a.LOSSES] = 0.0
        numbers[a.WORKS : a.WORKS + 3] = numbers[a.LOST_SO_FAR : a.LOST_SO_FAR + a.LOSSES] = 0.0
        self._final = FinalState(numbers, self.record, piece=piece).at(state)
        if self.arrays.owner and self.arrays.owner() is self:
            self.arrays.owner = None

    @property
    def static_state(self) -> State:
        """The present state as a state under static loads alone."""
        return self.levels.without_channels(self.state)

    def advance(self, end: float, to_change: bool = False) -> None:
        """Advance the state to ``end`` [s] or a failure; with ``to_change`` no further than the first event."""
        if not self.message and self.time < end:
            self._run_guarded(end, to_change)

    def trajectory(self, end: float, again: Rerun | None = None) -> Trajectory:
        """Trajectory of the segments and events so far; again: see Trajectory."""
        return Trajectory(
            model=self.model,
            segments=Recorded(self.record, self._final.numbers[a.WORKS : a.VERDICT + 2]),
            events=self.events,
            t_end=self.time if self.message else end,
            status="failed" if self.message else "ok",
            message=self.message,
            start=self.start,
            ending=self._final,
            load=self.levels.excitation.static,
            again=again,
        )

    # ------------------------------------------------------------------ the loop

    def _run_guarded(self, end: float, to_change: bool = False) -> None:
        """Run the loop to ``end`` [s]; a failure ends the run, with its instant and its cause."""
        try:
            self.take_over()
            self.arrays.buffers.ints[a.STOP_AT_EVENT] = to_change
            answer = self._run(end)
            self._read_arrays()
            if answer == a.FAILED:
                raise self.failure()
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            singular = "" if isinstance(error, MultiPhiError) else "linear algebra of a level or an impact fails: "
            self.message = f"at t = {self.time:.9g} s: {singular}{error}"

    def _run(self, end: float) -> int:
        """Call the loop until it ends, and supply what it needs."""
        while True:
            buffers = self.arrays.buffers
            answer = int(buffers.bound(carry)(end) if self._loop is None else self._loop(*buffers.all, end))
            if answer == a.FULL:
                self.record.collect()
                self._check_record()
            elif answer == a.NEED:
                self._supply()
            else:
                return answer

    def _check_record(self) -> None:
        """End the run before its record fills the memory."""
        size, segments = self.record.bytes, self.record.count
        if size > RECORD_BYTES:
            self._read_arrays()
            raise NumericalFailure(
                f"record: got {size / 1e9:.2g} GB of {segments} segments, need at most {RECORD_BYTES / 1e9:.2g} GB: "
                "make the run shorter and continue it (start=), or give loads fewer samples"
            )

    @quiet
    def _supply(self) -> None:
        """Pack what the loop needs; arrays that have become too large are built anew."""
        try:
            self.arrays.supply()
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            self._unavailable = error
            self.arrays.ints[a.GIVEN_UP] = 1
        if self.arrays.full:
            self._read_arrays()
            self.arrays.forget()
            self._write_arrays()
        elif self.arrays.outgrown:
            self.record.collect()
            self.arrays.begin_record()

    # ------------------------------------------------------------------ the state in the arrays

    def take_over(self) -> None:
        """Write this run into the arrays, unless they already hold it."""
        if self.arrays.owner is None or self.arrays.owner() is not self:
            self.arrays.owner = None  # in case that this fails half-way
            self._write_arrays()
            self.arrays.owner = weakref.ref(self)

    def _write_arrays(self) -> None:
        """Write the present state, or the start, into the arrays."""
        arrays, ending = self.arrays, self._final
        level = 0 if ending.level is None else arrays.level(ending.level.states)
        arrays.begin_record()
        arrays.set_chatter(self._window, ending.decisions, ending.ring)
        arrays.buffers.numbers[: a.OF_A_RUN] = ending.numbers
        if arrays.channels.prescribed:
            arrays.channels.set(arrays.buffers, ending.piece, float(ending.numbers[a.AGE]), self.time)
        if ending.level is None:
            set_starts(arrays, (self.start,))
        else:
            set_state(arrays, level, ending.displacement, ending.velocity, ending.phases, self._measured)
            ints, numbers = arrays.buffers.ints, arrays.buffers.numbers
            ints[a.STARTING] = a.GOING_ON if self._starting else 0
            ints[a.TRANSITIONS], numbers[ints[a.FOUND] + 1] = ending.transitions, ending.evaluations
        ints = arrays.buffers.ints
        ints[a.GIVEN_UP], ints[a.WORKING] = 0, int(self.is_summing_works)

    def _read_arrays(self) -> None:
        """Read the loop's state and record from the arrays."""
        part, state = copy_loop(self.arrays)
        if state.level is None:  # none yet
            _, _, level, x, v, phases, *_ = self._final
            state = state._replace(level=level, displacement=x, velocity=v, phases=phases)
        else:
            self._starting = False
        self._take(part, state, *self.arrays.chatter)

    def take_result(self, part: RecordPart, state: LoopState) -> None:
        """Take the result of batch.py; the chatter check begins anew."""
        self._starting = False
        self._take(part, state, 0, NO_RING)

    def _take(self, part: RecordPart, state: LoopState, decisions: int, ring: np.ndarray) -> None:
        """Append to the record, and take the present state."""
        self.record.append(part)
        built, size = self.model.levels_built, self.arrays.buffers.size
        self._final = FinalState(state.numbers, self.record, *state[1:], decisions, ring, built, size)
        self.time = float(state.numbers[a.TIME])

    def failure(self) -> Exception:
        """Return the error that has stopped the loop."""
        if self.arrays.ints[a.CAUSE] == a.UNAVAILABLE and self._unavailable is not None:
            return self._unavailable
        return failure(self.arrays)


def motion_of(levels: LoadedLevels, start: Start, compiled: bool | None = None) -> Motion:
    """Return a motion in these levels, on their own arrays."""
    levels.arrays = levels.arrays or LevelArrays(levels)
    return Motion(levels.arrays, start, compiled)
