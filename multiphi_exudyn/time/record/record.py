"""Record: segments and events of a run, copied from the loop's arrays, and values of many segments at once."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.excitation.excitation import Drive
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.transitions.exits import exits_of
from multiphi_exudyn.events.transitions.state import Phase
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.mechanics.elements.element import Element, ElementState
from multiphi_exudyn.time.record.growing_array import GrowingArray
from multiphi_exudyn.time.record.loop_copies import EMPTY, RecordPart, copy_loop
from multiphi_exudyn.time.record.sampling import sample_rows, sample_sizes, sample_states
from multiphi_exudyn.time.record.work import integrate_works, work_waves
from multiphi_exudyn.time.segments.segment import Segment, owners
from multiphi_exudyn.time.segments.segment_flow import Flow

__all__ = ["PHASES", "Record"]

PHASES = (Phase.ARMED, Phase.RECOVERING, Phase.REFUSED, Phase.HELD_BACK, Phase.LANDING)  # in the order of their numbers

states_of, values_of, sizes_of = entry(sample_states), entry(sample_rows), entry(sample_sizes)
works_of = entry(integrate_works)

FEW = 2  # levels: of more, only those of the requested times are evaluated

STILL = Drive(0.0, math.inf, ())  # no channel is a function of time
UNDRIVEN = 1.0, 0.0, 0.0  # horizon, work and age without such channels


def _joined(name: str) -> property:
    """An array of a record."""
    return property(lambda record: record.whole(name))


class Record:
    """Segments and events of a run, in arrays that grow by parts.

    levels: each once. rows (n, 4): of every segment, number of its level, piece, places of its coordinates and phases
    (-1: all armed). instants (n + 1,): starts of the segments and end of the last [s].
    coordinates: xi, xi' at every start; with channels that are functions of time also horizon [s], work [J] at the
    start and age [s] of the piece; with phases that are not armed also the delay [s] until the last of them is armed.
    phases: at the starts where some are not armed. left_out: segments whose works the loop has not summed.
    kinds (m, 3): contact, state entered (or SHARED), state left. amounts (m, 3): time [s], two truncation losses [J].
    struck (p,): rows of these that have a row of impacts (p, 5): impulse [N s], losses [J] by impact, as stop work, to
    damping, to friction. arrays: those of the loop.
    """

    def __init__(self, contacts: Sequence[Element], arrays: LevelArrays) -> None:
        self._contacts, self.arrays = contacts, arrays
        self.count = self.left_out_count = 0  # of segments
        self.event_count = 0
        self.levels: list[LoadedLevel] = []
        self._numbers: dict[tuple[int, ...], int] = {}  # of the levels, by the states of their elements
        self._parts: dict[str, GrowingArray] = {}
        self._unread: tuple[RecordPart, list[int]] | None = None  # last part, and numbers of its levels in this record
        self._last: dict[str, np.ndarray] = {}  # its arrays once they are read, not yet added to the parts

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_last": self._latest, "_unread": None}

    rows, instants, coordinates = _joined("rows"), _joined("instants"), _joined("coordinates")
    phases, left_out = _joined("phases"), _joined("left_out")
    kinds, amounts, struck, impacts = _joined("kinds"), _joined("amounts"), _joined("struck"), _joined("impacts")

    def collect(self) -> None:
        """Move the loop's segments and events from its arrays to this record."""
        self.append(copy_loop(self.arrays)[0])

    def collect_events(self) -> None:
        """Move the loop's events to this record; what it has of segments is left to the next ``begin_record``."""
        if self.arrays.ints[a.EVENT_COUNT]:
            self.append(copy_loop(self.arrays)[0].without_segments())

    def append(self, part: RecordPart) -> None:
        """Append a part, whose levels may have other numbers in this record."""
        if not (part.segments or part.events):
            return
        if self.count or self.event_count:
            self._add_last()
        numbers = []
        for level in part.levels:  # one may have been packed twice
            number = self._numbers.setdefault(level.states, len(self.levels))
            numbers.append(number)
            if number == len(self.levels):
                self.levels.append(level)
        self._unread = part, numbers
        self.count += part.segments
        self.left_out_count += part.left_out
        self.event_count += part.events
        vars(self).pop("event_rows", None)

    @property
    def _latest(self) -> dict[str, np.ndarray]:
        """Arrays of the last part that have rows, until they are added to the others."""
        if self._unread is not None:
            (part, numbers), self._unread = self._unread, None
            self._last = part.arrays()
            if numbers != list(range(len(numbers))):
                rows = self._last["rows"]
                rows[:, 0] = np.array(numbers)[rows[:, 0]]
        return self._last

    @property
    def bytes(self) -> int:
        """Memory of the record."""
        return sum(part.nbytes for part in self._latest.values()) + sum(part.bytes for part in self._parts.values())

    def whole(self, name: str) -> np.ndarray:
        """Return an array of the record as a whole."""
        if not self._parts:
            return self._latest.get(name, EMPTY[name])
        self._add_last()
        return self._parts[name].whole

    @property
    def visited(self) -> tuple[tuple[int, ...], ...]:
        """States of the elements of every visited level."""
        return tuple(self._numbers)

    def _add_last(self) -> None:
        """Add the last part to those before it."""
        if not (part := self._latest):
            return
        self._last, parts, rows = {}, self._parts, part.get("rows", EMPTY["rows"])
        if parts:
            rows[:, 2] += parts["coordinates"].count
            rows[rows[:, 3] >= 0, 3] += parts["phases"].count
            if "left_out" in part:
                part["left_out"] += parts["rows"].count
            if "struck" in part:
                part["struck"] += parts["kinds"].count
            if parts["instants"].count and "instants" in part:
                part["instants"] = part["instants"][1:]  # the first one is the end of the earlier segments
        else:
            self._parts = parts = {name: GrowingArray(empty) for name, empty in EMPTY.items()}
        for name, array in part.items():
            parts[name].add(array)

    @functools.cached_property
    def event_rows(self) -> np.ndarray:
        """Indices of the rows of kinds and amounts that are events."""
        return np.flatnonzero(self.kinds[:, 1] != a.SHARED).astype(np.int32)

    @functools.cached_property
    def contact_states(self) -> list[tuple[str, tuple[ElementState, ...]]]:
        """Name and states of every contact."""
        return [(contact.name, contact.states) for contact in self._contacts]

    def level(self, i: int) -> LoadedLevel:
        """Level of the i-th segment."""
        return self.levels[int(self.rows[i, 0])]

    def state(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """xi, xi' (n,) at the start of the i-th segment."""
        n, start = self.level(i).level.modes, self.rows[i, 2]
        return self.coordinates[start : start + n], self.coordinates[start + n : start + 2 * n]

    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """xi and xi' (2, k, n) of the segments ``places`` (k,), times ``after`` (k,) [s] their starts.

        n: largest number of coordinates of a level; coordinates beyond those of a level are zero.
        """
        visited = sorted(set(self.rows[places, 0].tolist()))
        width = max((self.levels[number].level.modes for number in visited), default=0)
        result = np.zeros((2, len(places), width))
        arguments = np.ascontiguousarray(places), np.ascontiguousarray(after), len(places), width, result.ravel()
        for offsets in self._packed(visited):
            while self._supply(states_of(*self._record_arguments(offsets), *arguments)):
                pass
        return result

    def values(self, times: np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> np.ndarray:
        """row.(xi, xi', 1) (k,) at times (k,) [s]; row: (2 n + 1,) of a level with n coordinates."""
        visited = list(range(len(self.levels)))
        if len(visited) > FEW:
            first, last = owners(self.instants[:-1], np.array([times.min(), times.max()]), side).tolist()
            visited = sorted(set(self.rows[first : last + 1, 0].tolist()))
        width = max(self.levels[number].level.modes for number in visited)
        functions, result = np.zeros((len(self.levels), 2 * width + 1)), np.empty(len(times))
        for number in visited:
            function, n = row(self.levels[number]), self.levels[number].level.modes
            functions[number, :n], functions[number, width : width + n] = function[:n], function[n : 2 * n]
            functions[number, -1] = function[-1]
        at = np.ascontiguousarray(times), len(times), int(side == "left")
        arguments = self.instants, 0, len(self.rows), functions.ravel(), 0, width, *at, result, 0
        for offsets in self._packed(visited):
            while self._supply(values_of(*self._record_arguments(offsets), *arguments)):
                pass
        return result

    def sizes(self, end: float) -> tuple[float, float]:
        """Mean of |y|^2 [m2 kg] and largest energy [J] up to ``end`` [s], see ``Segments``."""
        square, largest = 0.0, 0.0
        for offsets in self._packed(list(range(len(self.levels)))):
            while self._supply(sizes_of(*self._record_arguments(offsets), self.instants, 0, len(self.rows), end)):
                pass
            square += float(self.arrays.numbers[a.SEEN + 1])
            largest = max(largest, float(self.arrays.numbers[a.SEEN + 2]))
        return square, largest

    def works(self, places: np.ndarray) -> tuple[float, float, float]:
        """Work [J] of damping, of varying loads, jumps at the starts included, and of friction in segments (k,)."""
        total = np.zeros(3)
        for offsets in self._packed(np.unique(self.rows[places, 0]).tolist()):
            for level in offsets[offsets > 0].tolist():
                self.arrays.add_powers(level)
            works = np.zeros(3)
            arguments = self.instants, places, len(places), self._work_memory(), works
            while self._supply(works_of(*self._record_arguments(offsets), *arguments)):
                works[:] = 0.0
            total += works
        damping, varying, friction = total.tolist()
        return damping, varying, friction - self._spring_energy(places)

    def _spring_energy(self, places: np.ndarray) -> float:
        """Energy [J] taken up by springs in segments (k,) in which their stretch follows the force of a link."""
        rows, total = [level.potential_form.follows for level in self.levels], 0.0
        for number in (k for k in np.unique(self.rows[places, 0]) if len(rows[k])):
            chosen, n = places[self.rows[places, 0] == number], rows[number].shape[1] - 1
            for sign, after in ((-1, np.zeros(len(chosen))), (1, self.instants[chosen + 1] - self.instants[chosen])):
                x = self.states(chosen, after)[0][:, :n]
                total += sign * 0.5 * float(np.sum((x @ rows[number][:, :-1].T + rows[number][:, -1]) ** 2))
        return total

    def _work_memory(self) -> np.ndarray:
        """Scratch memory for the work of a segment."""
        pairs = sum(any(state.rubs for state in contact.states) for contact in self._contacts)
        room, q = self.arrays.scratch, int(self.arrays.ints[a.CHANNELS])
        return self.arrays.memory(work_waves(room.coordinates, room.exponentials, q, pairs))

    def _packed(self, visited: list[int]) -> Iterator[np.ndarray]:
        """Places (levels,) in the arrays of levels with these numbers, as many at a time as there is room for."""
        while visited:
            if self.arrays.full:
                self.arrays.forget()
            offsets = np.zeros(len(self.levels), np.int64)
            while visited and not self.arrays.full:
                number = visited.pop()
                offsets[number] = self.arrays.level(self.levels[number].states)
            yield offsets

    def _record_arguments(self, offsets: np.ndarray) -> tuple[np.ndarray, ...]:
        """First arguments of every compiled function of sampling.py and work.py."""
        return *self.arrays.borrow_buffers(int(self.rows[-1, 1])), self.rows.ravel(), self.coordinates, offsets

    def _supply(self, answer: int) -> bool:
        """Supply what a compiled function needs; return whether it is to be called again."""
        if answer == a.NEED:
            self.arrays.supply()
        return answer == a.NEED

    def phases_at_start(self, i: int) -> tuple[Phase, ...]:
        """Phases at the start of the i-th segment."""
        level, start = self.level(i), self.rows[i, 3]
        armed = (Phase.ARMED,) * len(exits_of(level))
        return armed if start < 0 else tuple(PHASES[k] for k in self.phases[start : start + len(armed)])

    def start_phases(self) -> np.ndarray:
        """Phases (n, e), in numbers, at the start of every segment; e: largest number of exits of a level."""
        counts = np.array([len(exits_of(level)) for level in self.levels], np.int64)[self.rows[:, 0]]
        numbers, starts = np.zeros((len(self.rows), int(np.max(counts, initial=0))), np.int64), self.rows[:, 3]
        for count in np.unique(counts[starts >= 0]).tolist():
            unsettled = (starts >= 0) & (counts == count)
            numbers[unsettled, :count] = self.phases[starts[unsettled][:, None] + np.arange(count)]
        return numbers

    def segment(self, i: int) -> Segment:
        """Return the i-th segment."""
        level, (start, end) = self.level(i), self.instants[i : i + 2].tolist()
        xi, xi_t = self.state(i)
        horizon, work, age, armed_at = self._start_values(i)
        held = xi[level.modal.modes + level.excitation.prescribed :]
        drive = self.arrays.channels.drive(self.rows[i, 1]).after(age) if level.excitation.prescribed else STILL
        flow = Flow.of(level, xi, xi_t, drive.beside(held), horizon)
        return Segment(start, end, level, flow, self.phases_at_start(i), armed_at, work)

    def _start_values(self, i: int) -> tuple[float, float, float, float]:
        """Horizon [s], work [J], age of the piece [s] at the i-th start, and delay [s] until all are armed."""
        level, (*_, start, phases) = self.level(i), self.rows[i].tolist()
        place, driven = start + 2 * level.level.modes, UNDRIVEN
        if level.excitation.prescribed:
            driven = self.coordinates[place : place + a.DRIVEN_WIDTH].tolist()
            place += a.DRIVEN_WIDTH
        return *driven, float(self.coordinates[place]) if phases >= 0 else 0.0

    @property
    def losses(self) -> np.ndarray:
        """Energies [J] lost at every row of kinds, (m, 6)."""
        losses = np.zeros((len(self.kinds), a.LOSSES))
        losses[:, [a.KINETIC, a.STRAIN]] = self.amounts[:, 1:]
        losses[self.struck[:, None], [a.BY_IMPACT, a.STOP_WORK, a.DAMPING, a.FRICTION]] = self.impacts[:, 1:]
        return losses
