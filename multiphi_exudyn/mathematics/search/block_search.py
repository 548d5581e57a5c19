"""First descent of signals in a block of intervals, on flat buffers; certified as zero_crossing.py says.

Intervals follow each other by factors of their exponentials, wider where all signals are far from zero; one that stays
in doubt is divided signal by signal (doubtful_signal.py).
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
    take_up,
)
from multiphi_exudyn.mathematics.search.signal_bounds import (
    HERMITE,
    INTERVALS,
    LIFTED,
    OF_A_SIGNAL,
    OPPOSITE,
    round_off,
)

__all__ = ["LOCAL", "NONE", "descent_in_block"]

NONE = -1  # instead of the signal that falls
WIDEST = 3  # doublings of an interval where all signals are far from zero
ROOMY = 24.0  # of the remainder: above it at the end of an interval the next one may be wider
DOUBTFUL, NO_ROOT, ROOM = 0, 1, 2  # what an interval leaves to a signal

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
    known: int,
    suspect: int,
    scratch_wave: int,
) -> int:
    """The signal that falls first in a block of intervals, NONE if none does.

    known: 1 where the block before had the same sample distance: its factors are used again.
    """
    p, values = ints[basis + SIZE], bounds + OF_A_SIGNAL * count
    here, there, factors = scratch_wave + HERE * p, scratch_wave + THERE * p, scratch_wave + FACTORS * p
    local = begin_block(ints, numbers, waves, basis, signals, constants, bounds, count, start, scratch_wave)
    if known == 0:
        begin_factors(ints, numbers, waves, basis, step, factors)
    wide, place, end, found = 0, 0, horizon - start, NONE
    while found == NONE and place < INTERVALS and place * step < end:
        while place + (1 << wide) > INTERVALS:
            wide -= 1
        left, width = place * step, step * (1 << wide)
        advance_exponentials(ints, numbers, waves, basis, here, factors + wide * p, start + left + width, there)
        sample(numbers, waves, local, constants, bounds, count, p, there, values + 2 * count)
        numbers[suspect + SAMPLES] += 1.0
        room = least_room(numbers, constants, noise, bounds, count, 0, count, values, width, place)
        if room == DOUBTFUL and wide > 0:
            wide -= 1
            continue
        if room == DOUBTFUL:
            found = descent_in_interval(
                ints, numbers, waves, basis, local, constants, noise, bounds, count, start, left, width, end, place,
                values, here, there, suspect, scratch_wave,
            )  # fmt: skip
        here, there = there, here
        for k in range(2 * count):
            numbers[values + k] = numbers[values + 2 * count + k]
        place += 1 << wide
        wide = wide + 1 if room == ROOM and wide < WIDEST else wide
    return found


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
    """Where the coefficients of the signals (count, p) from a block's start on begin, those of g' (count, p) behind.

    The first of its values, and the exponentials there, as well.
    """
    p, unit, values = ints[basis + SIZE], numbers[ints[basis + SCALES]], bounds + OF_A_SIGNAL * count
    here, local = scratch_wave + HERE * p, scratch_wave + LOCAL * p
    exponentials(ints, numbers, waves, basis, start, unit, here)
    for s in range(count):
        multiply(waves, signals + s * p, here, p, local + s * p)
        if numbers[bounds + OF_A_SIGNAL * s + OPPOSITE] == 0.0:
            differentiate(ints, numbers, waves, basis, local + s * p, local + (count + s) * p)
    exponentials(ints, numbers, waves, basis, 0.0, start, here)
    sample(numbers, waves, local, constants, bounds, count, p, here, values)
    return local


@compiled
def begin_factors(ints: Ints, numbers: Numbers, waves: Waves, basis: int, step: float, factors: int) -> None:
    """Factors (1 + WIDEST, p) of the exponentials over 1, 2, 4, ... sample distances."""
    p = ints[basis + SIZE]
    exponentials(ints, numbers, waves, basis, step, numbers[ints[basis + SCALES]], factors)
    for k in range(WIDEST):
        multiply(waves, factors + k * p, factors + k * p, p, factors + (k + 1) * p)


@compiled
def multiply(waves: Waves, a: int, b: int, p: int, result: int) -> None:
    """Products (p,) of complex numbers."""
    for j in range(p):
        waves[result + j] = waves[a + j] * waves[b + j]


@compiled
def advance_exponentials(
    ints: Ints, numbers: Numbers, waves: Waves, basis: int, here: int, factors: int, t: float, there: int
) -> None:
    """phi (p,) at a next sample: those of power zero times their factors, the others times t / T."""
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
    """g and g' of every signal, (count, 2), where the exponentials are phi."""
    moved, slope = 0.0, 0.0
    for s in range(count):
        a = local + s * p
        if numbers[bounds + OF_A_SIGNAL * s + OPPOSITE] == 1.0:
            moved, slope = -moved, -slope
        else:
            moved, slope = 0.0, 0.0
            for j in range(p):
                moved += (waves[a + j] * waves[phi + j]).real
                slope += (waves[a + count * p + j] * waves[phi + j]).real
        numbers[result + 2 * s] = numbers[constants + s] + moved
        numbers[result + 2 * s + 1] = slope


@compiled
def least_room(
    numbers: Numbers,
    constants: int,
    noise: int,
    bounds: int,
    count: int,
    first: int,
    last: int,
    values: int,
    width: float,
    place: int,
) -> int:
    """DOUBTFUL where one of the signals from ``first`` to before ``last`` may have a root in an interval.

    NO_ROOT where none has, ROOM where moreover the next interval may be wider. values: g and g' at both ends. In a
    block's first interval a signal may rise from zero: then the Bernstein coefficients of (g - g0 (1 - u)^3) / u,
    u = t / h, exceed the remainder, at most h^4/162 max|g^(4)| u.
    """
    room = ROOM
    for s in range(first, last):
        left, right = numbers[values + 2 * s], numbers[values + 2 * (count + s)]
        rise, after = width * numbers[values + 2 * s + 1], width * numbers[values + 2 * (count + s) + 1]
        spread = width * width * width * width * numbers[bounds + OF_A_SIGNAL * s + 4]
        if not min(left, left + rise / 3, right - after / 3, right) > HERMITE * spread:
            sunk = left < -round_off(numbers[bounds + OF_A_SIGNAL * s], numbers[constants + s], numbers[noise + s])
            lifted = min(3 * left + rise, 1.5 * right - after / 2, right) > LIFTED * spread
            if place > 0 or sunk or not lifted:
                return DOUBTFUL
        if not right + after > ROOMY * HERMITE * spread:
            room = NO_ROOT
    return room


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
    place: int,
    values: int,
    here: int,
    there: int,
    suspect: int,
    rows: int,
) -> int:
    """The signal that falls first in an interval of a block, up to its ``end``; of several at once the last one.

    values, here, there: g and g' of all signals, and the exponentials, at its ends.
    """
    p, found, earliest = ints[basis + SIZE], NONE, end
    for s in range(count):
        doubt = least_room(numbers, constants, noise, bounds, count, s, s + 1, values, width, place) == DOUBTFUL
        if doubt and left < earliest:
            take_up(
                ints, numbers, waves, basis, local + s * p, numbers[constants + s], numbers[noise + s],
                bounds + OF_A_SIGNAL * s, start, suspect, rows,
            )  # fmt: skip
            combine(numbers, waves, p, here, suspect, suspect + LEFT, rows)
            combine(numbers, waves, p, there, suspect, suspect + RIGHT, rows)
            verdict = divide(ints, numbers, waves, basis, left, left + width, suspect, rows)
            if verdict == DESCENT and numbers[suspect + ROOT] <= earliest:
                found, earliest = s, numbers[suspect + ROOT]
    numbers[suspect + ROOT] = start + earliest
    return found
