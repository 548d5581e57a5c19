"""Loop copies: the record of the loop (loop_record.py) and its state, copied out of its arrays by one compiled call.

The copy is two blocks. The arrays of a record are taken from them when they are first read: to take them at once would
make a short run longer.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import (
    ARMED,
    CHANNELS,
    COORDINATE_COUNT,
    COORDINATE_NUMBERS,
    COPY,
    COUNTED,
    CURRENT,
    EVENT_COUNT,
    EVENT_INTS,
    EVENT_NUMBERS,
    EVENT_WIDTH,
    EVENT_WIDTH_NUMBERS,
    EXIT_COUNT,
    FOUND,
    IMPACT_COUNT,
    IMPACT_INTS,
    IMPACT_NUMBERS,
    IMPACT_WIDTH,
    INSTANTS,
    LEFT_OUT,
    LEFT_OUT_COUNT,
    LEVEL,
    MODES,
    NUMBER,
    OF_A_RUN,
    PHASE_COUNT,
    PHASE_INTS,
    PHASES,
    PIECE,
    PLACE,
    RECORD_COUNTS,
    SEGMENT_COUNT,
    SEGMENT_INTS,
    SEGMENT_WIDTH,
    SETTLED,
    SHARED,
    SPEED,
    STARTING,
    TRANSITIONS,
)
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled, entry

__all__ = ["EMPTY", "LoopState", "RecordPart", "copy_loop"]

OF_INTS = "rows", "phases", "left_out", "kinds", "struck"  # in the order of ``gather``
OF_NUMBERS = "instants", "coordinates", "amounts", "impacts"
OF_EVENTS = "kinds", "struck", "amounts", "impacts"
EMPTY: dict[str, np.ndarray] = {  # numbers and places of segments and events: below 2**31 by RECORD_BYTES (motion.py)
    "rows": np.empty((0, a.SEGMENT_WIDTH), np.int32),
    "phases": np.empty(0, np.int8),
    "left_out": np.empty(0, np.int64),
    "kinds": np.empty((0, a.EVENT_WIDTH), np.int32),
    "struck": np.empty(0, np.int32),
    "instants": np.empty(0),
    "coordinates": np.empty(0),
    "amounts": np.empty((0, a.EVENT_WIDTH_NUMBERS)),
    "impacts": np.empty((0, a.IMPACT_WIDTH)),
}


@compiled
def move_ints(ints: Ints, start: int, count: int, place: int) -> int:
    """Move ints to a place before them, which may overlap with theirs, and return where the next ones go."""
    for i in range(count if place != start else 0):
        ints[place + i] = ints[start + i]
    return place + count


@compiled
def move_numbers(numbers: Numbers, start: int, count: int, place: int) -> int:
    """Move numbers to a place before them, or copy them to one behind, and return where the next ones go.

    A place before them may overlap with theirs, one behind them may not.
    """
    for i in range(count if place != start else 0):
        numbers[place + i] = numbers[start + i]
    return place + count


@compiled
def number_levels(ints: Ints, segments: int, place: int) -> int:
    """Number the levels in the rows of segments anew, in the order in which they are visited.

    The numbers that they had are put at ``place``; return how many they are.
    """
    count = 0
    for k in range(segments):
        row, i = ints[SEGMENT_INTS] + k * SEGMENT_WIDTH, 0
        while i < count and ints[place + i] != ints[row]:
            i += 1
        if i == count:
            ints[place + count] = ints[row]
            count += 1
        ints[row] = i
    return count


@compiled
def gather(ints: Ints, numbers: Numbers, waves: Waves) -> None:
    """Gather the record and the state CURRENT, where there is one, at SEGMENT_INTS and INSTANTS; empty the record.

    Ints: rows, phases, segments left out, kinds and ``struck`` of the record; the levels visited; phases of the state.
    Numbers: instants, coordinates, amounts and impacts of the record; those of the run and its evaluations; xi, xi' of
    the state. From COPY on: offsets of both; the counts of the record; the number of events; the number of the state's
    level, -1 without a state; piece and transitions; places of the levels visited, of phases and of the run's numbers;
    where both end.
    """
    segments, changes, impacts, events, number = ints[SEGMENT_COUNT], ints[EVENT_COUNT], ints[IMPACT_COUNT], 0, -1
    for k in range(changes):
        events += 1 if ints[ints[EVENT_INTS] + k * EVENT_WIDTH + 1] != SHARED else 0
    first, first_number = ints[SEGMENT_INTS], ints[INSTANTS]
    place = move_ints(ints, ints[PHASE_INTS], ints[PHASE_COUNT], first + segments * SEGMENT_WIDTH)
    place = move_ints(ints, ints[LEFT_OUT], ints[LEFT_OUT_COUNT], place)
    place = move_ints(ints, ints[EVENT_INTS], changes * EVENT_WIDTH, place)
    visited = move_ints(ints, ints[IMPACT_INTS], impacts, place)
    phases = visited + number_levels(ints, segments, visited)
    spot = first_number + (segments + 1 if segments > 0 else 0)
    spot = move_numbers(numbers, ints[COORDINATE_NUMBERS], ints[COORDINATE_COUNT], spot)
    spot = move_numbers(numbers, ints[EVENT_NUMBERS], changes * EVENT_WIDTH_NUMBERS, spot)
    of_run = move_numbers(numbers, ints[IMPACT_NUMBERS], impacts * IMPACT_WIDTH, spot)
    spot = move_numbers(numbers, ints[FOUND] + 1, 1, move_numbers(numbers, 0, OF_A_RUN, of_run))
    place = phases
    if ints[STARTING] == 0:
        level = ints[CURRENT + LEVEL]
        n, number = ints[level + MODES] + ints[CHANNELS], ints[level + NUMBER]
        spot = move_numbers(numbers, ints[CURRENT + PLACE], n, spot)
        spot = move_numbers(numbers, ints[CURRENT + SPEED], n, spot)
        for e in range(ints[level + EXIT_COUNT]):
            ints[place + e] = ARMED if ints[CURRENT + SETTLED] == 1 else ints[ints[CURRENT + PHASES] + e]
        place += ints[level + EXIT_COUNT]
    ints[COPY], ints[COPY + 1] = first, first_number
    head = COPY + 2
    for k in range(COUNTED):
        ints[head + k] = ints[RECORD_COUNTS + k]
        ints[RECORD_COUNTS + k] = 0
    head += COUNTED
    ints[head], ints[head + 1], ints[head + 2], ints[head + 3] = events, number, ints[PIECE], ints[TRANSITIONS]
    ints[head + 4], ints[head + 5], ints[head + 6] = visited - first, phases - first, of_run - first_number
    ints[head + 7], ints[head + 8] = place - first, spot - first_number


gathered = entry(gather)


class RecordPart(NamedTuple):
    """Segments and events of a record.

    levels: of the segments, by the numbers in their rows. segments, left_out, events: how many there are. arrays:
    returns those arrays of a record (record.py) that have rows.
    """

    levels: Sequence[LoadedLevel]
    segments: int
    left_out: int
    events: int
    arrays: Callable[[], dict[str, np.ndarray]]

    def without_segments(self) -> RecordPart:
        """The events alone."""
        return RecordPart((), 0, 0, self.events, lambda: {k: v for k, v in self.arrays().items() if k in OF_EVENTS})


class LoopState(NamedTuple):
    """State of the loop: numbers of its run; level, xi, xi' (n,) and phases of exits; piece of the channels; counts.

    level: None before the start.
    """

    numbers: np.ndarray
    level: LoadedLevel | None
    displacement: np.ndarray
    velocity: np.ndarray
    phases: tuple[int, ...]
    piece: int
    evaluations: float
    transitions: int


def copy_loop(arrays: LevelArrays) -> tuple[RecordPart, LoopState]:
    """Copy the record, which is then empty in the arrays, and the state."""
    buffers, loaded = arrays.buffers, arrays.loaded
    buffers.bound(gathered)()
    first, first_number, *counts, events, number, piece, transitions, visited, phases, of_run, ints_end, end = (
        buffers.ints[COPY : a.RUN_INTS].tolist()
    )
    ints = buffers.ints[first : first + ints_end].astype(np.int32)
    numbers = buffers.numbers[first_number : first_number + end].copy()
    levels = list(map(loaded.__getitem__, ints[visited:phases].tolist()))
    part = RecordPart(levels, counts[0], counts[4], events, lambda: _split(counts, ints, numbers))
    after = of_run + OF_A_RUN
    middle = (after + 1 + end) // 2
    state = LoopState(
        numbers[of_run:after],
        loaded[number] if number >= 0 else None,
        numbers[after + 1 : middle],
        numbers[middle:],
        tuple(ints[phases:].tolist()),
        piece,
        float(numbers[after]),
        transitions,
    )
    return part, state


def _split(counts: Sequence[int], ints: np.ndarray, numbers: np.ndarray) -> dict[str, np.ndarray]:
    """Arrays of a record, those that have rows, in the blocks of a copy."""
    segments, coordinates, phases, changes, left_out, impacts = counts
    rows = {
        "rows": segments,
        "phases": phases,
        "left_out": left_out,
        "kinds": changes,
        "struck": impacts,
        "instants": segments + 1 if segments else 0,  # the last one is the end of the last segment
        "coordinates": coordinates,
        "amounts": changes,
        "impacts": impacts,
    }
    parts = {}
    for block, names in ((ints, OF_INTS), (numbers, OF_NUMBERS)):
        place = 0
        for name in names:
            shape = rows[name], *EMPTY[name].shape[1:]
            start, place = place, place + math.prod(shape)
            if rows[name]:
                parts[name] = block[start:place].reshape(shape).astype(EMPTY[name].dtype, copy=False)
    return parts
