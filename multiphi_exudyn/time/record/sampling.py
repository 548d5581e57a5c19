"""Sampling: values of recorded segments at given times, from the same flow as in the loop (events/flow.py).

A segment is recorded by the state at its start: xi, xi', the piece of the channels and the time in it, and the horizon
of its powers of time (record.py). ``offsets`` (levels,) are the places of the levels in the ints, 0 where a level is
not packed: the segments of that level are skipped.

At evenly spaced times exp(lambda t) is multiplied by a constant factor, and computed exactly every few samples.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANNELS,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FORCED,
    FLOW_FREE,
    FLOW_WAVES,
    LOOK_WIDTH,
    MODES,
    NEED,
    NEED_SIZES,
    NEEDED,
    NEEDED_FROM,
    OK,
    PLACE,
    PRESCRIBED,
    RESPONSE,
    SEEN,
    SEGMENT_WIDTH,
    SIGNALS,
    SIZES,
    SPEED,
    WORK_WAVES,
)
from multiphi_exudyn.events.states.flow import state_at
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Shorts, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import POWERS, SCALES, differentiate, exponentials
from multiphi_exudyn.mathematics.response.response_arrays import SHAPES
from multiphi_exudyn.time.loop.motion_size import SAMPLES, add_sample_at
from multiphi_exudyn.time.record.segment_restart import restart_segment

__all__ = ["sample_rows", "sample_sizes", "sample_states"]

RESTART = 32  # samples between exact exponentials: so many round-offs add up
EVEN = 4e-16  # of the last time, by which evenly spaced times may be off


@compiled
def sample_states(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    places: Ints,
    after: Numbers,
    count: int,
    width: int,
    states: Numbers,
) -> int:
    """Put xi and xi' of the segments ``places`` (count,), ``after`` [s] their starts, into ``states``.

    states: (2, count, width). Return OK, or NEED where there is no room for a response.
    """
    expanded = -1
    for k in range(count):
        i, t = places[k], after[k]
        level, start = offsets[rows[i * SEGMENT_WIDTH]], rows[i * SEGMENT_WIDTH + 2]
        if level == 0:
            continue
        n, x, v = ints[level + MODES] + ints[CHANNELS], ints[AFTER + PLACE], ints[AFTER + SPEED]
        if t != 0.0 and expanded != i:
            if restart_segment(ints, numbers, waves, rows, coordinates, offsets, i, 1.0) == NEED:
                return NEED
            expanded = i
        if t != 0.0:
            state_at(ints, numbers, waves, level, t, x, v)
        for c in range(n):
            states[k * width + c] = numbers[x + c] if t != 0.0 else coordinates[start + c]
            states[(count + k) * width + c] = numbers[v + c] if t != 0.0 else coordinates[start + n + c]
    return OK


@compiled
def sample_rows(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    instants: Numbers,
    first: int,
    segments: int,
    functions: Numbers,
    function: int,
    width: int,
    times: Numbers,
    count: int,
    left: int,
    values: Numbers,
    result: int,
) -> int:
    """Put row.(xi, xi', 1) (count,) at times [s] into ``values``, at an event its limit from the left or the right.

    Of the segments from ``first`` before ``segments``. function: place of the rows (levels, 2 width + 1), in the order
    of offsets. result: place of the first value. Return OK or NEED.
    """
    i, k, step = -1, 0, even_step(times, count)
    while k < count:
        i = segment_at(instants, first, segments, times[k], left, i)
        level, last = offsets[rows[i * SEGMENT_WIDTH]], k + 1
        segment_end = instants[i + 1] if i + 1 < segments else math.inf
        while last < count and times[k] < times[last] < segment_end:
            last += 1
        if level > 0:
            if restart_segment(ints, numbers, waves, rows, coordinates, offsets, i, 1.0) == NEED:
                return NEED
            segment_start, row = instants[i], function + rows[i * SEGMENT_WIDTH] * (2 * width + 1)
            list_signal_coefficients(ints, numbers, waves, level, functions, row, width)
            constant, n = functions[row + 2 * width], ints[level + MODES] + ints[CHANNELS]
            for index in range(n - ints[CHANNELS] + ints[PRESCRIBED], n):
                constant += functions[row + index] * numbers[ints[AFTER + PLACE] + index]
            sample_flow(ints, numbers, waves, segment_start, constant, times, k, last, step, values, result)
        k = last
    return OK


@compiled
def sample_sizes(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    instants: Numbers,
    begin: int,
    segments: int,
    end: float,
) -> int:
    """Set SEEN from SAMPLES even instants up to ``end`` [s]: number of samples, mean |y|^2, largest energy.

    Of the segments from ``begin`` before ``segments``. Return OK or NEED.
    """
    i, expanded, first = -1, -1, instants[begin]
    for part in range(LOOK_WIDTH):
        numbers[SEEN + part] = 0.0
    for k in range(SAMPLES):
        t = end if k == SAMPLES - 1 else first + (end - first) * k / (SAMPLES - 1)
        i = segment_at(instants, begin, segments, t, 0, i)
        level = offsets[rows[i * SEGMENT_WIDTH]]
        if level == 0:
            continue
        if ints[level + SIZES] == 0:
            ints[NEEDED], ints[NEEDED_FROM] = NEED_SIZES, level
            return NEED
        if expanded != i and restart_segment(ints, numbers, waves, rows, coordinates, offsets, i, 1.0) == NEED:
            return NEED
        expanded, weight = i, 0.5 if k == 0 or k == SAMPLES - 1 else 1.0
        add_sample_at(ints, numbers, waves, level, t - instants[i], weight, 1)
    return OK


@compiled
def list_signal_coefficients(
    ints: Ints, numbers: Numbers, waves: Waves, level: int, functions: Numbers, row: int, width: int
) -> None:
    """Set SIGNALS: coefficients (p,) on the flow of a row over xi, xi'."""
    r, c, result, free = ints[level + MODES], ints[FLOW_WAVES], ints[SIGNALS], ints[FLOW_FREE]
    n, rate, count = r + ints[PRESCRIBED], ints[WORK_WAVES], ints[FLOW_COUNT]
    for j in range(count):
        value = 0j
        slope = 0j
        shape, size = ints[ints[level + RESPONSE] + SHAPES] + j * r, r
        if j >= free:
            shape, size = ints[FLOW_FORCED] + (j - free) * n, n
        for k in range(size):
            value += functions[row + k] * waves[shape + k]
            slope += functions[row + width + k] * waves[shape + k]
        waves[result + j] = value * waves[c + j]
        waves[rate + j] = slope * waves[c + j]
    differentiate(ints, numbers, waves, ints[FLOW_BASIS], rate, rate)
    for j in range(count):
        waves[result + j] += waves[rate + j]


@compiled
def sample_flow(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    segment_start: float,
    constant: float,
    times: Numbers,
    first: int,
    last: int,
    step: float,
    values: Numbers,
    result: int,
) -> None:
    """Put a constant plus SIGNALS on the flow of a segment into ``values``, from ``first`` before ``last``."""
    basis, p, phi, c = ints[FLOW_BASIS], ints[FLOW_COUNT], ints[WORK_WAVES], ints[SIGNALS]
    powers, factors, unit = ints[basis + POWERS], ints[WORK_WAVES] + p, numbers[ints[basis + SCALES]]
    even = step > 0.0 and last - first > 1
    if even:
        exponentials(ints, numbers, waves, basis, step, 1.0, factors)
    for k in range(first, last):
        t, value = times[k] - segment_start, constant
        if not even or (k - first) % RESTART == 0:
            exponentials(ints, numbers, waves, basis, t, t, phi)
        else:
            for j in range(p):
                if ints[powers + j] > 0:
                    waves[phi + j] = waves[phi + j - 1] * (t / unit)
                else:
                    waves[phi + j] *= waves[factors + j]
        for j in range(p):
            value += waves[c + j].real * waves[phi + j].real - waves[c + j].imag * waves[phi + j].imag
        values[result + k] = value


@compiled
def even_step(times: Numbers, count: int) -> float:
    """The step [s] of times that are evenly spaced and ascending, else zero."""
    step = (times[count - 1] - times[0]) / max(count - 1, 1)
    for k in range(count):
        if abs(times[k] - (times[0] + k * step)) > EVEN * times[count - 1]:
            return 0.0
    return max(step, 0.0)


@compiled
def segment_at(instants: Numbers, first: int, segments: int, t: float, left: int, near: int) -> int:
    """Return the last segment that begins at t [s] or before; from the left the last before t; at least the first.

    near: a segment to begin the search with, -1 for none.
    """
    low, high = first, segments
    if near >= 0 and instants[near] < t:
        low, high = near, min(near + 2, segments)
        if high < segments and instants[high] <= t:
            high = segments
    while high - low > 1:
        middle = (low + high) // 2
        begins = instants[middle]
        if begins < t or (begins == t and left == 0):
            low = middle
        else:
            high = middle
    return low
