"""First descent of signals through zero in flat buffers, certified: first_descent.py and root_search.py, for the loop.

    g(t) = constant + Re sum_j a_j phi_j(t),   wanted: the first t in (start, horizon] with g falling below 0

s signals on one basis (flat_basis.py): a (s, p) in the waves, constants (s,) and noise (s,) in the numbers. Between two
samples a distance h apart g differs from its cubic Hermite interpolant by at most h^4/384 max|g^(4)|, and
max|g^(k)| <= sum_j |a_j^(k)| (t/T)^d_j exp(Re lambda_j t). A cubic lies above the smallest of its Bernstein
coefficients:

    min(g0, g0 + h g0'/3, g1 - h g1'/3, g1) > h^4/384 max|g^(4)|

proves that an interval holds no root. Intervals follow each other, wider where all signals are far from zero; in one
that stays in doubt g is divided until monotony or curvature of certified sign decides, and an inverse Taylor series
finishes. A touch without crossing is no descent. The answer does not depend on the samples.

Source of the bounds: P. J. Davis, Interpolation and Approximation, 1963, ch. 3; G. Farin, Curves and Surfaces
for CAGD, ch. 5.
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.flat_basis import (
    ETERNAL,
    POWERS,
    PURE,
    RATES,
    SCALES,
    SIZE,
    differentiate,
    exponential_size,
    exponentials,
    magnitude,
)
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = [
    "NONE",
    "NOT_FINITE",
    "RESULT",
    "TOO_LONG",
    "first_descent",
    "first_sign",
    "scratch_numbers",
    "scratch_waves",
    "simultaneous",
]

NONE, NOT_FINITE, TOO_LONG = -1, -2, -3  # instead of the signal that falls
RESULT = 4  # numbers: time of the descent; samples, added up; sample distance and time left where it is TOO_LONG

DERIVATIVES = 7  # g and its derivatives up to the sixth are bounded
SAMPLED = 5  # g and its derivatives up to the fourth are known at every point of a division
INTERVALS = 64  # in a block
WIDEST = 3  # doublings of an interval where all signals are far from zero
ROOMY = 8.0  # of the remainder: above it at the end of an interval the next one may be wider
RESOLUTION = 0.02  # wanted remainder of a block's intervals, of the signal's typical size
HERMITE = 1 / 384
LIFTED = 1 / 162  # max of u (1 - u)^2 / 24 on [0, 1]
PATIENCE = 1000  # blocks, less than a second, after which a search looks at how many are left,
MOST_BLOCKS = 1_000_000  # of which it takes so many at most: minutes
WINDOW = 1.0  # of the time in which the fastest growing exponential grows e-fold: bounds hold no longer than twice this
NARROWEST = 1e-13  # of an interval's end in its block: an interval in doubt is not divided below this
TIME_ROUND_OFF = 1e-15  # of the time itself: a root is not sought closer
MOST_STEPS = 100  # towards a root; a dozen is many
SIMULTANEOUS = 1e-11  # of sum |a_j|: a falling signal farther from zero at another's root has its own later,
INSTANT = 1e-9  # of 1 / max |lambda|: and so has one that is nearer but takes longer, unless it is round-off

# A suspect, the signal whose interval is in doubt, as a record in the numbers: g and its derivatives (5,) at the ends
# of the interval, at a point, and at its minimum; its constant; since when its times count; bounds of |g| ... |g^(6)|;
# which |g^(k)|, k < 3, are round-off; the last root found; how many samples were taken; and a stack of the intervals
# that follow: their ends, g and its derivatives there.
LEFT, RIGHT, POINT, MINIMUM = 0, 5, 10, 15
CONSTANT, ORIGIN, BOUNDS, NOISE, ROOT, SAMPLES, STACK = 20, 21, 22, 29, 32, 33, 34
DEEPEST = 64  # divisions: 1e-13 is reached after 44
SUSPECT = STACK + DEEPEST * (1 + SAMPLED)  # numbers of the record
UNDECIDED, NO_DESCENT, DESCENT = 0, 1, 2

# Waves, in p: the suspect's derivatives (5, p), phi where it is sampled, at the left and the right end of an interval,
# factors of phi over 1, 2, 4, ... sample distances, coefficients of the signals, and of their derivatives, from a
# block's start.
PHI = SAMPLED
HERE, THERE, FACTORS = PHI + 1, PHI + 2, PHI + 3
LOCAL = FACTORS + 1 + WIDEST
DOUBTFUL, NO_ROOT, ROOM = 0, 1, 2  # what an interval leaves to a signal


def scratch_numbers(p: int, count: int) -> int:
    """Numbers that a search among so many signals on p exponentials works in."""
    return SUSPECT + p + (DERIVATIVES + 4) * count


def scratch_waves(p: int, count: int) -> int:
    """Waves that it works in."""
    return p * (LOCAL + 2 * count)


@compiled
def first_descent(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    noise: int,
    count: int,
    start: float,
    horizon: float,
    scratch: int,
    scratch_wave: int,
    result: int,
) -> int:
    """The signal that falls first in (start, horizon], its time in the result; NONE, NOT_FINITE or TOO_LONG.

    scratch, scratch_wave: where ``scratch_numbers`` numbers and ``scratch_waves`` waves are free.
    """
    scales, suspect, bounds = ints[basis + SCALES], scratch, scratch + SUSPECT
    growth = numbers[scales + 2]
    window = WINDOW / growth if growth > 0.0 else math.inf
    numbers[suspect + SAMPLES] = 0.0
    found, searched, begin = NONE, 0, start
    while found == NONE and begin < horizon and count > 0:
        until = min(horizon, begin + window)
        latest = 2 * until - begin  # a block may end behind
        bound(ints, numbers, waves, basis, signals, count, begin, latest, bounds, scratch_wave)
        if ints[basis + ETERNAL] == 1 and all_above(numbers, constants, bounds, count) == 1:
            break
        if all_finite(numbers, bounds, count) == 0:
            return NOT_FINITE
        if begin == 0.0 and count > 1 and ints[basis + PURE] == 1:
            found = near_descent(
                ints, numbers, waves, basis, signals, constants, noise, bounds, count, latest, suspect, scratch_wave
            )
            if found != NONE:
                found = found if numbers[suspect + ROOT] <= horizon else NONE
                break
        step = sample_distance(numbers, constants, bounds, count, until - begin)
        searched += 1
        if searched > PATIENCE and horizon - begin > MOST_BLOCKS * INTERVALS * step:
            numbers[result + 2] = step
            numbers[result + 3] = horizon - begin
            return TOO_LONG
        found = descent_in_block(
            ints, numbers, waves, basis, signals, constants, noise, bounds, count, begin, step, horizon, suspect,
            scratch_wave,
        )  # fmt: skip
        begin += INTERVALS * step
    numbers[result + 1] += numbers[suspect + SAMPLES]
    if found != NONE:
        numbers[result] = numbers[suspect + ROOT]
    return found


@compiled
def bound(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    count: int,
    start: float,
    latest: float,
    bounds: int,
    scratch_wave: int,
) -> None:
    """Upper bounds (count, 7) of |g|, |g'|, ..., |g^(6)| on [start, latest], constants left out.

    sum_j |a_j^(k)| e_j, e_j = (latest / T)^d_j exp(min(Re lambda_j, 0) start + max(Re lambda_j, 0) latest); where every
    power is zero a_j^(k) = a_j lambda_j^k. The e_j (p,) are left behind the bounds.
    """
    p, powers, rates = ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES]
    envelope, ratio = bounds + DERIVATIVES * count, latest / numbers[ints[basis + SCALES]]
    for j in range(p):
        if ints[powers + j] > 0:
            numbers[envelope + j] = numbers[envelope + j - 1] * ratio
        else:
            decay = waves[rates + j].real
            numbers[envelope + j] = exponential_size(decay * (start if decay < 0 else latest)) if decay != 0 else 1.0
    for s in range(count):
        for k in range(DERIVATIVES):
            numbers[bounds + DERIVATIVES * s + k] = 0.0
        if ints[basis + PURE] == 1:
            for j in range(p):
                size, fast = magnitude(waves, signals + s * p + j) * numbers[envelope + j], magnitude(waves, rates + j)
                for k in range(DERIVATIVES):
                    numbers[bounds + DERIVATIVES * s + k] += size
                    size *= fast
        else:
            for j in range(p):
                waves[scratch_wave + j] = waves[signals + s * p + j]
            for k in range(DERIVATIVES):
                total = 0.0
                for j in range(p):
                    total += magnitude(waves, scratch_wave + j) * numbers[envelope + j]
                numbers[bounds + DERIVATIVES * s + k] = total
                differentiate(ints, numbers, waves, basis, scratch_wave, scratch_wave)


@compiled
def all_above(numbers: Numbers, constants: int, bounds: int, count: int) -> int:
    """1 where every constant outweighs all that moves."""
    for s in range(count):
        if not numbers[constants + s] > numbers[bounds + DERIVATIVES * s]:
            return 0
    return 1


@compiled
def all_finite(numbers: Numbers, bounds: int, count: int) -> int:
    """1 where the signals and their highest derivatives are bounded by finite numbers."""
    for s in range(count):
        first = bounds + DERIVATIVES * s
        if not numbers[first] + numbers[first + DERIVATIVES - 1] < math.inf:
            return 0
    return 1


@compiled
def sample_distance(numbers: Numbers, constants: int, bounds: int, count: int, remaining: float) -> float:
    """Sample distance of the next block: a power of two, at which the remainder is small beside the signals.

    Never more than what takes the block to the horizon, where it ends at once.
    """
    longest = power_of_two_above(remaining / INTERVALS)
    step = math.inf
    for s in range(count):
        fourth = numbers[bounds + DERIVATIVES * s + 4]
        if fourth > 0.0:
            wanted = RESOLUTION * (abs(numbers[constants + s]) + numbers[bounds + DERIVATIVES * s]) / HERMITE
            step = min(step, math.sqrt(math.sqrt(wanted / fourth)))
    return min(longest, power_of_two_above(step) / 2) if step < math.inf else longest


@compiled
def power_of_two_above(value: float) -> float:
    """The smallest power of two that is greater than a positive ``value``."""
    power = 2.0 ** float(math.floor(math.log2(value)))
    while power > value:  # a logarithm is rounded
        power /= 2
    while power <= value:
        power *= 2
    return power


@compiled
def near_descent(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    noise: int,
    bounds: int,
    count: int,
    valid: float,
    suspect: int,
    scratch_wave: int,
) -> int:
    """A first descent near t = 0 that Taylor's theorem certifies at once, NONE if it is not that plain.

    2 g max|g''| < g'^2 (Kantorovich) gives a falling g one root before 2 g / |g'|; the others stay above zero.
    valid: how long the bounds hold, for ever where nothing grows. Every power is zero.
    """
    p, rates, starts = ints[basis + SIZE], ints[basis + RATES], bounds + DERIVATIVES * count + ints[basis + SIZE]
    for s in range(count):
        value, slope = numbers[constants + s], 0.0
        for j in range(p):
            a = waves[signals + s * p + j]
            value += a.real
            slope += (a * waves[rates + j]).real
        numbers[starts + 2 * s] = value
        numbers[starts + 2 * s + 1] = slope
    for s in range(count):
        value, slope = numbers[starts + 2 * s], numbers[starts + 2 * s + 1]
        if value > 0.0 and slope < 0.0 and 2 * value * numbers[bounds + DERIVATIVES * s + 2] < slope * slope:
            latest = -2 * value / slope
            if (latest <= valid or ints[basis + ETERNAL] == 1) and others_stay_above(
                numbers, starts, bounds, count, s, latest
            ) == 1:
                take_up(
                    ints, numbers, waves, basis, signals + s * p, numbers[constants + s], numbers[noise + s],
                    bounds + DERIVATIVES * s, 0.0, suspect, scratch_wave,
                )  # fmt: skip
                sample_at(ints, numbers, waves, basis, 0.0, suspect, suspect + LEFT, scratch_wave)
                sample_at(ints, numbers, waves, basis, latest, suspect, suspect + RIGHT, scratch_wave)
                find_root(ints, numbers, waves, basis, 0, 0.0, latest, suspect, suspect + RIGHT, scratch_wave)
                return s
    return NONE


@compiled
def others_stay_above(numbers: Numbers, starts: int, bounds: int, count: int, falling: int, latest: float) -> int:
    """1 where by their values and slopes at t = 0 no other signal falls before ``latest``."""
    for s in range(count):
        first = bounds + DERIVATIVES * s
        high = numbers[starts + 2 * s] > numbers[first + 1] * latest
        if s != falling and not high and not numbers[starts + 2 * s + 1] > numbers[first + 2] * latest:
            return 0
    return 1


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
    suspect: int,
    scratch_wave: int,
) -> int:
    """The signal that falls first in a block of intervals, NONE if none does."""
    p, values = ints[basis + SIZE], bounds + DERIVATIVES * count + ints[basis + SIZE]
    here, there, factors = scratch_wave + HERE * p, scratch_wave + THERE * p, scratch_wave + FACTORS * p
    local = begin_block(ints, numbers, waves, basis, signals, constants, count, start, step, values, scratch_wave)
    known, wide, place, end, found = 0, 0, 0, horizon - start, NONE
    while found == NONE and place < INTERVALS and place * step < end:
        while place + (1 << wide) > INTERVALS:
            wide -= 1
        while known < wide:
            multiply(waves, factors + known * p, factors + known * p, p, factors + (known + 1) * p)
            known += 1
        left, width = place * step, step * (1 << wide)
        advance_exponentials(ints, numbers, waves, basis, here, factors + wide * p, start + left + width, there)
        sample(numbers, waves, local, constants, count, p, there, values + 2 * count)
        numbers[suspect + SAMPLES] += 1.0
        room = least_room(numbers, constants, noise, bounds, count, 0, count, values, width, place)
        if room == DOUBTFUL and wide > 0:
            wide = 0
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
    count: int,
    start: float,
    step: float,
    values: int,
    scratch_wave: int,
) -> int:
    """Where the coefficients of the signals (count, p) from a block's start on begin, those of g' (count, p) behind.

    The first of its values, and the exponentials there and their factors from one sample to the next, as well.
    """
    p, unit = ints[basis + SIZE], numbers[ints[basis + SCALES]]
    here, local = scratch_wave + HERE * p, scratch_wave + LOCAL * p
    exponentials(ints, numbers, waves, basis, start, unit, here)
    for s in range(count):
        multiply(waves, signals + s * p, here, p, local + s * p)
        differentiate(ints, numbers, waves, basis, local + s * p, local + (count + s) * p)
    exponentials(ints, numbers, waves, basis, 0.0, start, here)
    exponentials(ints, numbers, waves, basis, step, unit, scratch_wave + FACTORS * p)
    sample(numbers, waves, local, constants, count, p, here, values)
    return local


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
    powers, ratio = ints[basis + POWERS], t / numbers[ints[basis + SCALES]]
    for j in range(ints[basis + SIZE]):
        if ints[powers + j] > 0:
            waves[there + j] = waves[there + j - 1] * ratio
        else:
            waves[there + j] = waves[here + j] * waves[factors + j]


@compiled
def sample(
    numbers: Numbers, waves: Waves, local: int, constants: int, count: int, p: int, phi: int, result: int
) -> None:
    """g and g' of every signal, (count, 2), where the exponentials are phi."""
    for s in range(count):
        value, slope, a = numbers[constants + s], 0.0, local + s * p
        for j in range(p):
            value += (waves[a + j] * waves[phi + j]).real
            slope += (waves[a + count * p + j] * waves[phi + j]).real
        numbers[result + 2 * s] = value
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
        spread = width * width * width * width * numbers[bounds + DERIVATIVES * s + 4]
        if not min(left, left + rise / 3, right - after / 3, right) > HERMITE * spread:
            sunk = left < -round_off(numbers[bounds + DERIVATIVES * s], numbers[constants + s], numbers[noise + s])
            lifted = min(3 * left + rise, 1.5 * right - after / 2, right) > LIFTED * spread
            if place > 0 or sunk or not lifted:
                return DOUBTFUL
        if not right + after > ROOMY * HERMITE * spread:
            room = NO_ROOT
    return room


@compiled
def round_off(size: float, constant: float, noise: float) -> float:
    """What |g| is round-off of its terms, or of what they are made of."""
    return max(ZERO * (size + abs(constant)), noise)


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
                bounds + DERIVATIVES * s, start, suspect, rows,
            )  # fmt: skip
            combine(numbers, waves, p, here, suspect, suspect + LEFT, rows)
            combine(numbers, waves, p, there, suspect, suspect + RIGHT, rows)
            verdict = divide(ints, numbers, waves, basis, left, left + width, suspect, rows)
            if verdict == DESCENT and numbers[suspect + ROOT] <= earliest:
                found, earliest = s, numbers[suspect + ROOT]
    numbers[suspect + ROOT] = start + earliest
    return found


@compiled
def take_up(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signal: int,
    constant: float,
    noise: float,
    bounds: int,
    origin: float,
    suspect: int,
    rows: int,
) -> None:
    """A signal becomes the suspect: its record, and the coefficients (5, p) of g and its derivatives in ``rows``."""
    p = ints[basis + SIZE]
    numbers[suspect + CONSTANT] = constant
    numbers[suspect + ORIGIN] = origin
    for k in range(DERIVATIVES):
        numbers[suspect + BOUNDS + k] = numbers[bounds + k]
    numbers[suspect + NOISE] = round_off(numbers[bounds], constant, noise)
    numbers[suspect + NOISE + 1] = ZERO * numbers[bounds + 1]
    numbers[suspect + NOISE + 2] = ZERO * numbers[bounds + 2]
    for j in range(p):
        waves[rows + j] = waves[signal + j]
    for k in range(1, SAMPLED):
        differentiate(ints, numbers, waves, basis, rows + (k - 1) * p, rows + k * p)


@compiled
def sample_at(
    ints: Ints, numbers: Numbers, waves: Waves, basis: int, u: float, suspect: int, result: int, rows: int
) -> None:
    """The suspect and its first four derivatives (5,) a time u after its origin."""
    p, phi = ints[basis + SIZE], rows + PHI * ints[basis + SIZE]
    exponentials(ints, numbers, waves, basis, u, numbers[suspect + ORIGIN] + u, phi)
    combine(numbers, waves, p, phi, suspect, result, rows)
    numbers[suspect + SAMPLES] += 1.0


@compiled
def combine(numbers: Numbers, waves: Waves, p: int, phi: int, suspect: int, result: int, rows: int) -> None:
    """The suspect and its first four derivatives (5,) where the exponentials are phi."""
    for k in range(SAMPLED):
        value = 0.0
        for j in range(p):
            value += (waves[rows + k * p + j] * waves[phi + j]).real
        numbers[result + k] = value
    numbers[result] += numbers[suspect + CONSTANT]


@compiled
def divide(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    left: float,
    right: float,
    suspect: int,
    rows: int,
) -> int:
    """DESCENT, at the suspect's root, or NO_DESCENT in [left, right], by division until every part is decided.

    The suspect is known at both ends.
    """
    narrowest, depth = NARROWEST * right, 0
    while True:
        verdict = decide(ints, numbers, waves, basis, left, right, narrowest, suspect, rows)
        if verdict == DESCENT:
            return DESCENT
        follower = suspect + STACK + (1 + SAMPLED) * depth
        if verdict == UNDECIDED:
            numbers[follower] = right
            for k in range(SAMPLED):
                numbers[follower + 1 + k] = numbers[suspect + RIGHT + k]
            depth += 1
            right = (left + right) / 2
            sample_at(ints, numbers, waves, basis, right, suspect, suspect + RIGHT, rows)
        else:
            if depth == 0:
                return NO_DESCENT
            depth -= 1
            left, right = right, numbers[follower - 1 - SAMPLED]
            for k in range(SAMPLED):
                numbers[suspect + LEFT + k] = numbers[suspect + RIGHT + k]
                numbers[suspect + RIGHT + k] = numbers[follower - SAMPLED + k]


@compiled
def decide(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    left: float,
    right: float,
    narrowest: float,
    suspect: int,
    rows: int,
) -> int:
    """What certified bounds of g, g', g'' say about a descent of the suspect in [left, right].

    DESCENT at its root, NO_DESCENT, or UNDECIDED.
    """
    width, noise = right - left, numbers[suspect + NOISE]
    at_left, at_right = numbers[suspect + LEFT], numbers[suspect + RIGHT]
    low = lowest(numbers, suspect, 0, width)
    if low > 0.0 or max(-low, highest(numbers, suspect, 0, width)) <= noise or rises(numbers, suspect, width) == 1:
        return NO_DESCENT
    if at_left < -noise:
        numbers[suspect + ROOT] = left
        return DESCENT
    if lowest(numbers, suspect, 1, width) > 0.0:
        return NO_DESCENT
    falls = highest(numbers, suspect, 1, width) < 0.0 or width < narrowest or highest(numbers, suspect, 2, width) < 0.0
    if falls and at_right < -noise:
        find_root(ints, numbers, waves, basis, 0, left, right, suspect, suspect + RIGHT, rows)
        return DESCENT
    if falls:
        return NO_DESCENT
    if lowest(numbers, suspect, 2, width) > 0.0:
        return decide_convex(ints, numbers, waves, basis, left, right, suspect, rows)
    return UNDECIDED


@compiled
def lowest(numbers: Numbers, suspect: int, order: int, width: float) -> float:
    """What a derivative of the suspect is certainly above: its Bernstein coefficients less their remainder."""
    left, right = suspect + LEFT + order, suspect + RIGHT + order
    inner_left = numbers[left] + width * numbers[left + 1] / 3
    inner_right = numbers[right] - width * numbers[right + 1] / 3
    remainder = HERMITE * width * width * width * width * numbers[suspect + BOUNDS + order + 4]
    return min(numbers[left], numbers[right], inner_left, inner_right) - remainder


@compiled
def highest(numbers: Numbers, suspect: int, order: int, width: float) -> float:
    """What a derivative of the suspect is certainly below; see ``lowest``."""
    left, right = suspect + LEFT + order, suspect + RIGHT + order
    inner_left = numbers[left] + width * numbers[left + 1] / 3
    inner_right = numbers[right] - width * numbers[right + 1] / 3
    remainder = HERMITE * width * width * width * width * numbers[suspect + BOUNDS + order + 4]
    return max(numbers[left], numbers[right], inner_left, inner_right) + remainder


@compiled
def rises(numbers: Numbers, suspect: int, width: float) -> int:
    """1 where the suspect starts at zero or above and stays above it.

    By g/t, as ``least_room`` says; or by the first derivative that counts, with Taylor's remainder.
    """
    left, right, bounds = suspect + LEFT, suspect + RIGHT, suspect + BOUNDS
    if numbers[left] < -numbers[suspect + NOISE]:
        return 0
    inner_left = numbers[left] + width * numbers[left + 1] / 3
    inner_right = numbers[right] - width * numbers[right + 1] / 3
    spread = width * width * width * width * numbers[bounds + 4]
    if min(3 * inner_left, 1.5 * inner_right, numbers[right]) > LIFTED * spread:
        return 1
    for order in range(1, 4):
        if numbers[left + order] > numbers[bounds + order + 1] * width:
            return 1
        if order < 3 and numbers[left + order] < -numbers[suspect + NOISE + order]:
            return 0
    return 0


@compiled
def decide_convex(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    left: float,
    right: float,
    suspect: int,
    rows: int,
) -> int:
    """DESCENT or NO_DESCENT of a convex piece: it lies before the minimum, if the minimum lies below zero."""
    if numbers[suspect + LEFT + 1] >= -numbers[suspect + NOISE + 1]:
        return NO_DESCENT
    lower = suspect + RIGHT
    if numbers[suspect + RIGHT + 1] > 0.0:
        find_root(ints, numbers, waves, basis, 1, left, right, suspect, suspect + RIGHT, rows)
        right, lower = numbers[suspect + ROOT], suspect + MINIMUM
        sample_at(ints, numbers, waves, basis, right, suspect, lower, rows)
    if numbers[lower] >= -numbers[suspect + NOISE]:
        return NO_DESCENT
    find_root(ints, numbers, waves, basis, 0, left, right, suspect, lower, rows)
    return DESCENT


@compiled
def find_root(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    order: int,
    left: float,
    right: float,
    suspect: int,
    at_right: int,
    rows: int,
) -> None:
    """Root in [left, right] of the suspect (order 0, falling) or of its derivative (order 1, rising).

    Inverse Taylor series to third order, kept inside the bracket, from inverse Hermite interpolation.
    at_right: where g and its derivatives at the right end stand.
    """
    sign = 1.0 if order == 0 else -1.0
    tolerance, point = TIME_ROUND_OFF * right, suspect + POINT + order
    t = left + (right - left) * guess(numbers, suspect + LEFT + order, at_right + order, right - left)
    for _ in range(MOST_STEPS):
        sample_at(ints, numbers, waves, basis, t, suspect, suspect + POINT, rows)
        value, slope = numbers[point], numbers[point + 1]
        if sign * value >= 0.0:
            left = t
        else:
            right = t
        following = (left + right) / 2
        if slope != 0.0:
            newton, c2, c3 = value / slope, numbers[point + 2] / (2 * slope), numbers[point + 3] / (6 * slope)
            better = t - newton - c2 * newton * newton - (2 * c2 * c2 - c3) * newton * newton * newton
            left_out = 5 * abs(c2) * (c2 * c2 + abs(c3)) + numbers[suspect + BOUNDS + order + 4] / (24 * abs(slope))
            if left_out * newton * newton * newton * newton <= tolerance or abs(newton) <= tolerance:
                t = min(max(better, left), right)
                break
            if left < better < right:
                following = better
        t = following
    numbers[suspect + ROOT] = t


@compiled
def guess(numbers: Numbers, at_left: int, at_right: int, width: float) -> float:
    """Where in its interval, as a fraction, a monotone function is zero: inverse cubic Hermite interpolation."""
    rise = numbers[at_right] - numbers[at_left]
    slope_left, slope_right = numbers[at_left + 1], numbers[at_right + 1]
    s = -numbers[at_left] / rise if rise != 0.0 else 0.5
    if slope_left * rise > 0.0 and slope_right * rise > 0.0:
        toward_left, toward_right = rise / (slope_left * width), rise / (slope_right * width)
        s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right)
    return min(max(s, 0.01), 0.99)


@compiled
def simultaneous(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    count: int,
    found: int,
    time: float,
    scratch_wave: int,
    result: int,
) -> int:
    """How many signals reach zero, falling, at the first descent of ``found``, itself among them; which, as 1, in ints.

    scratch_wave: p waves. result: where (count,) ints begin.
    """
    p, powers, rates, scales = ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES], ints[basis + SCALES]
    exponentials(ints, numbers, waves, basis, time, time, scratch_wave)
    instant = INSTANT / numbers[scales + 1] if numbers[scales + 1] > 0.0 else 0.0
    total = 0
    for s in range(count):
        value, slope, terms = numbers[constants + s], 0.0, abs(numbers[constants + s])
        for j in range(p):
            a, phi = waves[signals + s * p + j], waves[scratch_wave + j]
            value += (a * phi).real
            slope += (a * phi * waves[rates + j]).real
            terms += magnitude(waves, signals + s * p + j) * magnitude(waves, scratch_wave + j)
            if ints[powers + j] > 0:
                slope += ints[powers + j] / numbers[scales] * (a * waves[scratch_wave + j - 1]).real
        soon = max(ZERO * terms, -slope * instant)
        falls = terms > 0.0 and slope <= 0.0 and value <= min(SIMULTANEOUS * terms, soon)
        ints[result + s] = 1 if s == found or falls else 0
        total += ints[result + s]
    return total


@compiled
def first_sign(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signal: int,
    constant: float,
    sizes: int,
    since: int,
    scratch: int,
    scratch_wave: int,
) -> int:
    """+1 or -1 as a signal is, or becomes at once, positive or negative at t = 0; 0 if it vanishes.

    By the first derivative, from the order ``since`` on, that is not round-off of its terms. sizes: of which terms (p,)
    the coefficients are sums, in the numbers. scratch, scratch_wave: p numbers and p waves.
    """
    p, powers, rates, unit = (
        ints[basis + SIZE],
        ints[basis + POWERS],
        ints[basis + RATES],
        numbers[ints[basis + SCALES]],
    )
    for j in range(p):
        waves[scratch_wave + j] = waves[signal + j]
        numbers[scratch + j] = numbers[sizes + j]
    for order in range(DERIVATIVES):
        value = constant if order == 0 else 0.0
        noise = ZERO * abs(value)
        for j in range(p):
            if ints[powers + j] == 0:
                value += waves[scratch_wave + j].real
                noise += ZERO * numbers[scratch + j]
        if order >= since and abs(value) > noise:
            return 1 if value > 0.0 else -1
        differentiate(ints, numbers, waves, basis, scratch_wave, scratch_wave)
        for j in range(p):
            size = numbers[scratch + j]
            numbers[scratch + j] = size * magnitude(waves, rates + j)
            if ints[powers + j] > 0:
                numbers[scratch + j - 1] += ints[powers + j] / unit * size
    return 0
