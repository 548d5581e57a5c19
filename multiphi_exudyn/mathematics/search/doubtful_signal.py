"""A suspect: a signal that may have a root in an interval, which is divided until that is decided, on flat buffers.

    g(t) = constant + Re sum_j a_j phi_j(t),   max|g^(k)| <= bound_k, k = 0 ... 6

An interval is divided until certified monotony or curvature decides; an inverse Taylor series gives the root. The
bounds and their source are those of zero_crossing.py.

It is a record in the numbers: g and its derivatives (5,) at the ends of the interval, at a point, and at its minimum;
its constant; the origin of its times; bounds of |g| ... |g^(6)|; the round-off of |g^(k)|, k < 3; the last root; the
number of samples; and a stack of later intervals: their ends, g and its derivatives there.
Its coefficients and those of its derivatives, (5, p), are the ``rows`` in the waves, with p more to work in.
"""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import SIZE, differentiate, exponentials
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.mathematics.search.hermite_root import estimate
from multiphi_exudyn.mathematics.search.signal_bounds import DERIVATIVES, HERMITE, LIFTED, QUINTIC, round_off

__all__ = [
    "DESCENT",
    "LEFT",
    "RIGHT",
    "ROOT",
    "ROWS",
    "SAMPLES",
    "SUSPECT",
    "combine",
    "divide",
    "find_root",
    "sample_at",
    "set_suspect",
]

SAMPLED = 5  # g and its derivatives up to the fourth are computed at every point of a division
NARROWEST = 1e-13  # of an interval's end in its block: narrower intervals are not divided
TIME_ROUND_OFF = 1e-15  # of the time itself: accuracy of a root
MOST_STEPS = 100  # towards a root; a dozen is many
LEFT, RIGHT, POINT, MINIMUM = 0, 5, 10, 15
CONSTANT, ORIGIN, BOUNDS, NOISE, ROOT, SAMPLES, STACK = 20, 21, 22, 29, 32, 33, 34
DEEPEST = 64  # divisions: 1e-13 is reached after 44
SUSPECT = STACK + DEEPEST * (1 + SAMPLED)  # numbers of the record
ROWS = SAMPLED + 1  # in p: waves of its coefficients and working memory
UNDECIDED, NO_DESCENT, DESCENT = 0, 1, 2


@compiled
def set_suspect(
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
    """Make a signal the suspect: set its record, and the coefficients (5, p) of g and its derivatives in ``rows``."""
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
    """Set the suspect and its first four derivatives (5,) at time u after its origin."""
    p, phi = ints[basis + SIZE], rows + SAMPLED * ints[basis + SIZE]
    exponentials(ints, numbers, waves, basis, u, numbers[suspect + ORIGIN] + u, phi)
    combine(numbers, waves, p, phi, suspect, result, rows)
    numbers[suspect + SAMPLES] += 1.0


@compiled
def combine(numbers: Numbers, waves: Waves, p: int, phi: int, suspect: int, result: int, rows: int) -> None:
    """Set the suspect and its first four derivatives (5,) at exponentials phi."""
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
    """Return DESCENT, with the root of the suspect, or NO_DESCENT in [left, right], by division.

    The samples of the suspect at both ends have to be set.
    """
    narrowest, depth = NARROWEST * right, 0
    while True:
        verdict = decide(ints, numbers, waves, basis, left, right, narrowest, suspect, rows)
        if verdict == DESCENT:
            return DESCENT
        stacked = suspect + STACK + (1 + SAMPLED) * depth
        if verdict == UNDECIDED:
            numbers[stacked] = right
            for k in range(SAMPLED):
                numbers[stacked + 1 + k] = numbers[suspect + RIGHT + k]
            depth += 1
            right = (left + right) / 2
            sample_at(ints, numbers, waves, basis, right, suspect, suspect + RIGHT, rows)
        else:
            if depth == 0:
                return NO_DESCENT
            depth -= 1
            left, right = right, numbers[stacked - 1 - SAMPLED]
            for k in range(SAMPLED):
                numbers[suspect + LEFT + k] = numbers[suspect + RIGHT + k]
                numbers[suspect + RIGHT + k] = numbers[stacked - SAMPLED + k]


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
    """Return DESCENT with the root of the suspect in [left, right], NO_DESCENT, or UNDECIDED.

    The decision is certified by bounds of g, g', g''.
    """
    width, noise = right - left, numbers[suspect + NOISE]
    at_left, at_right = numbers[suspect + LEFT], numbers[suspect + RIGHT]
    low, minus_high = lowest_value(numbers, suspect, 1.0, width), lowest_value(numbers, suspect, -1.0, width)
    if low > 0.0 or min(low, minus_high) >= -noise or rises(numbers, suspect, width) == 1:
        return NO_DESCENT
    if at_left < -noise:
        numbers[suspect + ROOT] = left
        return DESCENT
    if lowest(numbers, suspect, 1, 1.0, width) > 0.0:
        return NO_DESCENT
    falls = lowest(numbers, suspect, 1, -1.0, width) > 0.0 or width < narrowest
    falls = falls or lowest(numbers, suspect, 2, -1.0, width) > 0.0
    if falls and at_right < -noise:
        find_root(ints, numbers, waves, basis, 0, left, right, suspect, suspect + RIGHT, rows)
        return DESCENT
    if falls:
        return NO_DESCENT
    if lowest(numbers, suspect, 2, 1.0, width) > 0.0:
        return decide_convex(ints, numbers, waves, basis, left, right, suspect, rows)
    return UNDECIDED


@compiled
def lowest(numbers: Numbers, suspect: int, order: int, sign: float, width: float) -> float:
    """Return a lower bound of sign times a derivative of the suspect: least Bernstein coefficient minus remainder."""
    left, right = sign * numbers[suspect + LEFT + order], sign * numbers[suspect + RIGHT + order]
    inner_left = left + sign * width * numbers[suspect + LEFT + order + 1] / 3
    inner_right = right - sign * width * numbers[suspect + RIGHT + order + 1] / 3
    remainder = HERMITE * width * width * width * width * numbers[suspect + BOUNDS + order + 4]
    return min(left, right, inner_left, inner_right) - remainder


@compiled
def lowest_value(numbers: Numbers, suspect: int, sign: float, width: float) -> float:
    """Return the same for the suspect itself, by the quintic, with its second derivatives."""
    left, right, first, second = suspect + LEFT, suspect + RIGHT, sign * width / 5, sign * width * width / 20
    at_left, at_right = sign * numbers[left], sign * numbers[right]
    inner = min(at_left + first * numbers[left + 1], at_right - first * numbers[right + 1])
    middle_left = at_left + 2 * first * numbers[left + 1] + second * numbers[left + 2]
    middle_right = at_right - 2 * first * numbers[right + 1] + second * numbers[right + 2]
    remainder = QUINTIC * width * width * width * width * width * width * numbers[suspect + BOUNDS + 6]
    return min(at_left, at_right, inner, middle_left, middle_right) - remainder


@compiled
def rises(numbers: Numbers, suspect: int, width: float) -> int:
    """Return 1 where the suspect starts at zero or above and stays above zero.

    By g/t as in ``room_in_interval``, or by the first derivative that is not round-off, with Taylor's remainder.
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
    """Return DESCENT or NO_DESCENT of a convex piece; a root lies before the minimum, if that is below zero.

    An estimate of the minimum is enough where g is below zero there, or where the tangent is above zero everywhere.
    """
    noise, lower = numbers[suspect + NOISE], suspect + RIGHT
    if numbers[suspect + LEFT + 1] >= -numbers[suspect + NOISE + 1]:
        return NO_DESCENT
    if numbers[suspect + RIGHT + 1] > 0.0 and numbers[lower] >= -noise:
        t = left + (right - left) * estimate(numbers, suspect + LEFT + 1, suspect + RIGHT + 1, right - left)
        lower = suspect + MINIMUM
        sample_at(ints, numbers, waves, basis, t, suspect, lower, rows)
        if numbers[lower] > abs(numbers[lower + 1]) * (right - left):
            return NO_DESCENT
        if numbers[lower] >= -noise:
            find_root(ints, numbers, waves, basis, 1, left, right, suspect, suspect + RIGHT, rows)
            t = numbers[suspect + ROOT]
            sample_at(ints, numbers, waves, basis, t, suspect, lower, rows)
        right = t
    if numbers[lower] >= -noise:
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
    """Find the root in [left, right] of the suspect (order 0, falling) or of its derivative (order 1, rising).

    Inverse Taylor series to third order, kept inside the bracket, from inverse Hermite interpolation.
    at_right: offset of g and its derivatives at the right end.
    """
    sign = 1.0 if order == 0 else -1.0
    tolerance, point = TIME_ROUND_OFF * right, suspect + POINT + order
    t = left + (right - left) * estimate(numbers, suspect + LEFT + order, at_right + order, right - left)
    for _ in range(MOST_STEPS):
        sample_at(ints, numbers, waves, basis, t, suspect, suspect + POINT, rows)
        value, slope = numbers[point], numbers[point + 1]
        if sign * value >= 0.0:
            left = t
        else:
            right = t
        next_t = (left + right) / 2
        if slope != 0.0:
            newton, c2, c3 = value / slope, numbers[point + 2] / (2 * slope), numbers[point + 3] / (6 * slope)
            improved = t - newton - c2 * newton * newton - (2 * c2 * c2 - c3) * newton * newton * newton
            truncated = 5 * abs(c2) * (c2 * c2 + abs(c3)) + numbers[suspect + BOUNDS + order + 4] / (24 * abs(slope))
            if truncated * newton * newton * newton * newton <= tolerance or abs(newton) <= tolerance:
                t = min(max(improved, left), right)
                break
            if left < improved < right:
                next_t = improved
        t = next_t
    numbers[suspect + ROOT] = t
