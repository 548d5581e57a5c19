"""First descent of signals through zero, certified: no crossing is stepped over; on flat buffers.

    g(t) = constant + Re sum_j a_j phi_j(t),   wanted: the first t in (start, horizon] with g falling below 0

s signals on one basis (basis_arrays.py): a (s, p) in the waves, constants (s,) and noise (s,) in the numbers. Between
two samples a distance h apart g differs from its cubic Hermite interpolant by at most h^4/384 max|g^(4)|, and
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

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import (
    ETERNAL,
    POWERS,
    PURE,
    RATES,
    SCALES,
    SIZE,
    differentiate,
    exponentials,
    magnitude,
)
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.mathematics.search.block_search import LOCAL, NONE, descent_in_block
from multiphi_exudyn.mathematics.search.doubtful_signal import ROOT, SAMPLES, SUSPECT
from multiphi_exudyn.mathematics.search.signal_bounds import (
    BOUNDING,
    DERIVATIVES,
    INTERVALS,
    OF_A_SIGNAL,
    all_above,
    all_finite,
    bound,
    sample_distance,
)
from multiphi_exudyn.mathematics.search.signal_starts import near_descent, sample_start, stay_above

__all__ = [
    "INSTANT",
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

NOT_FINITE, TOO_LONG = -2, -3  # as NONE, instead of the signal that falls
RESULT = 4  # numbers: time of the descent; samples, added up; sample distance and time left where it is TOO_LONG

PATIENCE = 1000  # blocks, less than a second, after which a search looks at how many are left,
MOST_BLOCKS = 1_000_000  # of which it takes so many at most: minutes
WINDOW = 1.0  # of the time in which the fastest growing exponential grows e-fold: bounds hold no longer than twice this
SIMULTANEOUS = 1e-11  # of sum |a_j|: a falling signal farther from zero at another's root has its own later,
INSTANT = 1e-9  # of 1 / max |lambda|: and so has one that is nearer but takes longer, unless it is round-off


def scratch_numbers(p: int, count: int) -> int:
    """Numbers that a search among so many signals on p exponentials works in."""
    return SUSPECT + BOUNDING * p + (OF_A_SIGNAL + 4) * count


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
    found, searched, before, begin = NONE, 0, 0.0, start
    while found == NONE and begin < horizon and count > 0:
        until = min(horizon, begin + window)
        latest = 2 * until - begin  # a block may end behind
        bound(ints, numbers, waves, basis, signals, count, begin, latest, bounds)
        if ints[basis + ETERNAL] == 1 and all_above(numbers, constants, bounds, count) == 1:
            break
        if all_finite(numbers, constants, bounds, count) == 0:
            return NOT_FINITE
        if begin == 0.0:
            sample_start(ints, numbers, waves, basis, signals, constants, bounds, count)
            if until == horizon and stay_above(numbers, constants, noise, bounds, count, horizon) == 1:
                break
        if begin == 0.0 and count > 1 and ints[basis + PURE] == 1:
            found = near_descent(
                ints, numbers, waves, basis, signals, constants, noise, bounds, count, latest, suspect, scratch_wave
            )
            if found != NONE:
                found = found if numbers[suspect + ROOT] <= horizon else NONE
                break
        step = sample_distance(numbers, constants, bounds, count, until - begin)
        known, before = 1 if step == before else 0, step
        searched += 1
        if searched > PATIENCE and horizon - begin > MOST_BLOCKS * INTERVALS * step:
            numbers[result + 2] = step
            numbers[result + 3] = horizon - begin
            return TOO_LONG
        found = descent_in_block(
            ints, numbers, waves, basis, signals, constants, noise, bounds, count, begin, step, horizon, known,
            suspect, scratch_wave,
        )  # fmt: skip
        begin += INTERVALS * step
    numbers[result + 1] += numbers[suspect + SAMPLES]
    if found != NONE:
        numbers[result] = numbers[suspect + ROOT]
    return found


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

    One whose slope is round-off does not fall: it may be zero for as long as another one holds it there.

    scratch_wave: p waves. result: where (count,) ints begin.
    """
    p, powers, rates, scales = ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES], ints[basis + SCALES]
    exponentials(ints, numbers, waves, basis, time, time, scratch_wave)
    instant = INSTANT / numbers[scales + 1] if numbers[scales + 1] > 0.0 else 0.0
    total = 0
    for s in range(count):
        value, slope, terms, steepest = numbers[constants + s], 0.0, abs(numbers[constants + s]), 0.0
        for j in range(p):
            a, phi = waves[signals + s * p + j], waves[scratch_wave + j]
            value += (a * phi).real
            slope += (a * phi * waves[rates + j]).real
            size = magnitude(waves, signals + s * p + j) * magnitude(waves, scratch_wave + j)
            terms += size
            steepest += size * magnitude(waves, rates + j)
            if ints[powers + j] > 0:
                slope += ints[powers + j] / numbers[scales] * (a * waves[scratch_wave + j - 1]).real
        soon = max(ZERO * terms, -slope * instant)
        falls = terms > 0.0 and slope < -ZERO * steepest and value <= min(SIMULTANEOUS * terms, soon)
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
