"""First descent of signals in a block of intervals, on flat buffers; certified as zero_crossing.py says.

The exponentials are advanced from interval to interval by factors; intervals are wider where all signals are far from
zero. An undecided interval is divided signal by signal (doubtful_signal.py).
"""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import POWERS, PURE, SCALES, SIZE, differentiate, exponentials
from multiphi_exudyn.mathematics.search.doubtful_signal import (
    DESCENT,
    LEFT,
    RIGHT,
    ROOT,
    ROWS,
    SAMPLES,
    combine,
    divide,
    set_suspect,
)
from multiphi_exudyn.mathematics.search.signal_bounds import (
    HERMITE,
    INTERVALS,
    LIFTED,
    OPPOSITE,
    PER_SIGNAL,
    round_off,
)

__all__ = ["LOCAL", "NONE", "descent_in_block"]

NONE = -1  # in place of the falling signal: there is none
WIDEST = 3  # doublings of an interval where all signals are far from zero
ROOMY = 24.0  # of the remainder: above it at the end of an interval the next one may be wider
DOUBTFUL, NO_ROOT, ROOM = 0, 1, 2  # outcomes for a signal in an interval

# Waves, in p: rows of the suspect, phi at the left and the right end of an interval, factors of phi over 1, 2, 4, ...
# sample distances, coefficients of the signals, and of their derivatives, from a block's start.
HERE, THERE, FACTORS = ROWS, ROWS + 1, ROWS + 2
LOCAL = FACTORS + 1 + WIDEST


@compiled
def descent_in_block(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    noise: int,
    bounds: int,
    count: int,
    start: float,
    step: float,
    horizon: float,
    has_factors: int,
    suspect: int,
    scratch_wave: int,
) -> int:
    """Return the signal that falls first in a block of intervals, NONE if none falls.

    has_factors: 1 where the previous block had the same sample distance, so that its factors are reused.
    """
    p, values = ints[basis + SIZE], bounds + PER_SIGNAL * count
    here, there, factors = scratch_wave + HERE * p, scratch_wave + THERE * p, scratch_wave + FACTORS * p
    local = begin_block(ints, numbers, waves, basis, signals, constants, bounds, count, start, scratch_wave)
    if has_factors == 0:
        begin_factors(ints, numbers, waves, basis, step, factors)
    doublings, index, end, falling = 0, 0, horizon - start, NONE
    while falling == NONE and index < INTERVALS and index * step < end:
        while index + (1 << doublings) > INTERVALS:
            doublings -= 1
        left, width = index * step, step * (1 << doublings)
        advance_exponentials(ints, numbers, waves, basis, here, factors + doublings * p, start + left + width, there)
        sample(numbers, waves, local, constants, bounds, count, p, there, values + 2 * count)
        numbers[suspect + SAMPLES] += 1.0
        outcome = room_in_interval(numbers, constants, noise, bounds, count, 0, count, values, width, index)
        if outcome == DOUBTFUL and doublings > 0:
            doublings -= 1
            continue
        if outcome == DOUBTFUL:
            falling = descent_in_interval(
                ints, numbers, waves, basis, local, constants, noise, bounds, count, start, left, width, end, index,
                values, here, there, suspect, scratch_wave,
            )  # fmt: skip
        here, there = there, here
        for k in range(2 * count):
            numbers[values + k] = numbers[values + 2 * count + k]
        index += 1 << doublings
        doublings = doublings + 1 if outcome == ROOM and doublings < WIDEST else doublings
    return falling


@compiled
def begin_block(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    bounds: int,
    count: int,
    start: float,
    scratch_wave: int,
) -> int:
    """Set up a block; return the offset of its signals' coefficients (count, p), which those of g' (count, p) follow.

    The coefficients count from the start of the block. Its first values and exponentials are set, too.
    """
    p, unit, values = ints[basis + SIZE], numbers[ints[basis + SCALES]], bounds + PER_SIGNAL * count
    here, local = scratch_wave + HERE * p, scratch_wave + LOCAL * p
    exponentials(ints, numbers, waves, basis, start, unit, here)
    for s in range(count):
        multiply(waves, signals + s * p, here, p, local + s * p)
        if numbers[bounds + PER_SIGNAL * s + OPPOSITE] == 0.0:
            differentiate(ints, numbers, waves, basis, local + s * p, local + (count + s) * p)
    exponentials(ints, numbers, waves, basis, 0.0, start, here)
    sample(numbers, waves, local, constants, bounds, count, p, here, values)
    return local


@compiled
def begin_factors(ints: Ints, numbers: Numbers, waves: Waves, basis: int, step: float, factors: int) -> None:
    """Set the factors (1 + WIDEST, p) of the exponentials over 1, 2, 4, ... sample distances."""
    p = ints[basis + SIZE]
    exponentials(ints, numbers, waves, basis, step, numbers[ints[basis + SCALES]], factors)
    for k in range(WIDEST):
        multiply(waves, factors + k * p, factors + k * p, p, factors + (k + 1) * p)


@compiled
def multiply(waves: Waves, a: int, b: int, p: int, result: int) -> None:
    """Set products (p,) of complex numbers."""
    for j in range(p):
        waves[result + j] = waves[a + j] * waves[b + j]


@compiled
def advance_exponentials(
    ints: Ints, numbers: Numbers, waves: Waves, basis: int, here: int, factors: int, t: float, there: int
) -> None:
    """Set phi (p,) at the next sample: those of power zero times their factors, the others times t / T."""
    powers, ratio, phi = ints[basis + POWERS], t / numbers[ints[basis + SCALES]], 0j
    if ints[basis + PURE] == 1:
        multiply(waves, here, factors, ints[basis + SIZE], there)
    for j in range(ints[basis + SIZE] if ints[basis + PURE] == 0 else 0):
        phi = phi * ratio if ints[powers + j] > 0 else waves[here + j] * waves[factors + j]
        waves[there + j] = phi


@compiled
def sample(
    numbers: Numbers, waves: Waves, local: int, constants: int, bounds: int, count: int, p: int, phi: int, result: int
) -> None:
    """Set g and g' of every signal, (count, 2), at exponentials phi."""
    value, slope = 0.0, 0.0
    for s in range(count):
        a = local + s * p
        if numbers[bounds + PER_SIGNAL * s + OPPOSITE] == 1.0:
            value, slope = -value, -slope
        else:
            value, slope = 0.0, 0.0
            for j in range(p):
                value += (waves[a + j] * waves[phi + j]).real
                slope += (waves[a + count * p + j] * waves[phi + j]).real
        numbers[result + 2 * s] = numbers[constants + s] + value
        numbers[result + 2 * s + 1] = slope


@compiled
def room_in_interval(
    numbers: Numbers,
    constants: int,
    noise: int,
    bounds: int,
    count: int,
    first: int,
    last: int,
    values: int,
    width: float,
    index: int,
) -> int:
    """Return DOUBTFUL where one of the signals from ``first`` to before ``last`` may have a root in an interval.

    Else NO_ROOT, or ROOM where the next interval may be wider as well. values: g and g' at both ends. In a block's
    first interval a signal may rise from zero: then the Bernstein coefficients of (g - g0 (1 - u)^3) / u,
    u = t / h, exceed the remainder, at most h^4/162 max|g^(4)| u.
    """
    outcome = ROOM
    for s in range(first, last):
        left, right = numbers[values + 2 * s], numbers[values + 2 * (count + s)]
        rise, right_rise = width * numbers[values + 2 * s + 1], width * numbers[values + 2 * (count + s) + 1]
        spread = width * width * width * width * numbers[bounds + PER_SIGNAL * s + 4]
        if not min(left, left + rise / 3, right - right_rise / 3, right) > HERMITE * spread:
            is_below = left < -round_off(numbers[bounds + PER_SIGNAL * s], numbers[constants + s], numbers[noise + s])
            rises = min(3 * left + rise, 1.5 * right - right_rise / 2, right) > LIFTED * spread
            if index > 0 or is_below or not rises:
                return DOUBTFUL
        if not right + right_rise > ROOMY * HERMITE * spread:
            outcome = NO_ROOT
    return outcome


@compiled
def descent_in_interval(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    local: int,
    constants: int,
    noise: int,
    bounds: int,
    count: int,
    start: float,
    left: float,
    width: float,
    end: float,
    index: int,
    values: int,
    here: int,
    there: int,
    suspect: int,
    rows: int,
) -> int:
    """Return the signal that falls first in an interval of a block, up to its ``end``; the last of simultaneous ones.

    values, here, there: g and g' of all signals, and the exponentials, at its ends.
    """
    p, falling, earliest = ints[basis + SIZE], NONE, end
    for s in range(count):
        is_doubtful = (
            room_in_interval(numbers, constants, noise, bounds, count, s, s + 1, values, width, index) == DOUBTFUL
        )
        if is_doubtful and left < earliest:
            set_suspect(
                ints, numbers, waves, basis, local + s * p, numbers[constants + s], numbers[noise + s],
                bounds + PER_SIGNAL * s, start, suspect, rows,
            )  # fmt: skip
            combine(numbers, waves, p, here, suspect, suspect + LEFT, rows)
            combine(numbers, waves, p, there, suspect, suspect + RIGHT, rows)
            verdict = divide(ints, numbers, waves, basis, left, left + width, suspect, rows)
            if verdict == DESCENT and numbers[suspect + ROOT] <= earliest:
                falling, earliest = s, numbers[suspect + ROOT]
    numbers[suspect + ROOT] = start + earliest
    return falling
