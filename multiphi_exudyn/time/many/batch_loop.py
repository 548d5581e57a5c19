"""Batch loop: starts that are packed in the arrays, advanced to the end one after the other by one call.

The samples and sizes of their motions take one call each. A start that lacks a level, fills the record or fails ends
the call.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    COUNTED,
    DRIVE_NEXT,
    END_REACHED,
    FOUND,
    FRESH,
    GIVEN_UP,
    HORIZON,
    NEED,
    OF_A_RUN,
    OK,
    PIECE,
    PRESCRIBED,
    RECORD_COUNTS,
    SEEN,
    SEGMENT_COUNT,
    SEGMENT_ROOM,
    START,
    STARTING,
    STOP_AT_EVENT,
    SUMMED,
    TIME,
    TRANSITIONS,
)
from multiphi_exudyn.events.states.channel_values import keep_drive, load_piece, set_drive
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Shorts, Waves, compiled
from multiphi_exudyn.time.loop.loop import advance
from multiphi_exudyn.time.loop.loop_record import keep_segment
from multiphi_exudyn.time.record.sampling import sample_rows, sample_sizes

__all__ = ["RUN_WIDTH", "advance_starts", "measure_starts", "sample_starts"]

RUN_WIDTH = OF_A_RUN + 2


@compiled
def advance_starts(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    end: float,
    first_piece_end: float,
    initial: Numbers,
    count: int,
    ends: Ints,
    run_numbers: Numbers,
) -> int:
    """Advance the packed starts to ``end`` [s] one after the other; return how many of them have reached it.

    first_piece_end: end [s] of the first piece of the channels. initial: the numbers of a run at its start. ends:
    counts (count + 1, COUNTED) of the record, the first ones zero. run_numbers: numbers (count, RUN_WIDTH) of each
    run, with its function evaluations and transitions. A segment of zero length after those of a run has its final
    state.
    """
    for k in range(count):
        for i in range(OF_A_RUN):
            numbers[i] = initial[i]
        ints[START], ints[STARTING], ints[STOP_AT_EVENT], ints[GIVEN_UP] = k, FRESH, 0, 0
        if ints[PRESCRIBED] > 0:
            ints[PIECE] = 0
            load_piece(ints, waves)
            set_drive(ints, numbers, waves, ints[DRIVE_NEXT], 0.0, numbers[TIME], first_piece_end)
            keep_drive(ints, waves)
        status = advance(ints, numbers, waves, end)
        if status != END_REACHED or ints[SEGMENT_COUNT] >= ints[SEGMENT_ROOM]:
            for i in range(COUNTED):
                ints[RECORD_COUNTS + i] = ends[COUNTED * k + i]
            return k
        for i in range(OF_A_RUN):
            run_numbers[k * RUN_WIDTH + i] = numbers[i]
        run_numbers[k * RUN_WIDTH + OF_A_RUN] = numbers[ints[FOUND] + 1]
        run_numbers[k * RUN_WIDTH + OF_A_RUN + 1] = ints[TRANSITIONS]
        ints[SUMMED] = 1  # no work in zero time
        keep_segment(ints, numbers, 0.0, numbers[HORIZON])
        for i in range(COUNTED):
            ends[COUNTED * (k + 1) + i] = ints[RECORD_COUNTS + i]
    return count


@compiled
def sample_starts(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    instants: Numbers,
    ends: Ints,
    runs: int,
    functions: Numbers,
    levels: int,
    points: int,
    width: int,
    times: Numbers,
    count: int,
    values: Numbers,
) -> int:
    """Put the values (runs, points, count) at times [s] of a record of ``advance_starts`` into ``values``.

    functions: the points' rows (points, levels, 2 width + 1), see sampling.py. Return OK or NEED.
    """
    for k in range(runs):
        for p in range(points):
            place, function = (k * points + p) * count, p * levels * (2 * width + 1)
            first, last = ends[COUNTED * k], ends[COUNTED * (k + 1)] - 1
            status = sample_rows(
                ints, numbers, waves, rows, coordinates, offsets, instants, first, last, functions, function, width,
                times, count, 0, values, place,
            )  # fmt: skip
            if status == NEED:
                return NEED
    return OK


@compiled
def measure_starts(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    instants: Numbers,
    ends: Ints,
    chosen: Ints,
    runs: int,
    end: float,
    sizes: Numbers,
) -> int:
    """Put mean |y|^2 and largest energy (runs, 2) of the ``chosen`` runs into ``sizes``; return OK or NEED."""
    for i in range(runs):
        first, last = ends[COUNTED * chosen[i]], ends[COUNTED * (chosen[i] + 1)] - 1
        status = sample_sizes(ints, numbers, waves, rows, coordinates, offsets, instants, first, last, end)
        if status == NEED:
            return NEED
        sizes[2 * i], sizes[2 * i + 1] = numbers[SEEN + 1], numbers[SEEN + 2]
    return OK
