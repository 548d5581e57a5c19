"""First descent of signals through zero, certified: no crossing is stepped over; on flat buffers.

    g(t) = constant + Re sum_j a_j phi_j(t),   result: the first t in (start, horizon] with g falling below 0

s signals on one basis (basis_arrays.py): a (s, p) in the waves, constants (s,) and noise (s,) in the numbers. Between
two samples a distance h apart g differs from its cubic Hermite interpolant by at most h^4/384 max|g^(4)|, and
max|g^(k)| <= sum_j |a_j^(k)| (t/T)^d_j exp(Re lambda_j t). A cubic lies above the smallest of its Bernstein
coefficients:

    min(g0, g0 + h g0'/3, g1 - h g1'/3, g1) > h^4/384 max|g^(4)|

proves that an interval holds no root. Intervals are wider where all signals are far from zero; an undecided one is
divided until certified monotony or curvature decides, and an inverse Taylor series gives the root. A touch without
crossing is no descent. Where the drift of every signal, its terms without exponential, exceeds the bounds of its other
terms there is no search. The result does not depend on the samples.

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
    PER_SIGNAL,
    all_above,
    all_finite,
    bound,
    drift_above,
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

NOT_FINITE, TOO_LONG = -2, -3  # in place of the falling signal, like NONE
RESULT = 4  # numbers: time of the descent; total samples; sample distance and remaining time for TOO_LONG

PATIENCE = 1000  # blocks, less than a second, after which a search checks how many remain,
MOST_BLOCKS = 1_000_000  # at most: minutes
SKIPPED = 12.0  # sample distances that are searched also where drift exceeds: bounds from their end cost as much
WINDOW = 1.0  # of the time in which the fastest growing exponential grows e-fold: bounds hold for at most twice this
SIMULTANEOUS = 1e-11  # of sum |a_j|: a falling signal farther from zero at another's root has a later root,
INSTANT = 1e-9  # of 1 / max |lambda|: and so has a nearer one that needs more time, unless it is round-off


def scratch_numbers(p: int, count: int) -> int:
    """Return the count of working numbers of a search among ``count`` signals on p exponentials."""
    return SUSPECT + BOUNDING * p + (PER_SIGNAL + 4) * count


def scratch_waves(p: int, count: int) -> int:
    """Return its count of working waves."""
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
    """Return the signal that falls first in (start, horizon], its time in the result; NONE, NOT_FINITE or TOO_LONG.

    scratch, scratch_wave: offsets of ``scratch_numbers`` numbers and ``scratch_waves`` waves of working memory.
    """
    scales, suspect, bounds = ints[basis + SCALES], scratch, scratch + SUSPECT
    growth = numbers[scales + 2]
    window = WINDOW / growth if growth > 0.0 else math.inf
    numbers[suspect + SAMPLES] = 0.0
    falling, blocks, previous_step, begin = NONE, 0, 0.0, start
    while falling == NONE and begin < horizon and count > 0:
        window_end = min(horizon, begin + window)
        latest = 2 * window_end - begin  # a block may end later than the window
        bound(ints, numbers, waves, basis, signals, count, begin, latest, bounds)
        if ints[basis + ETERNAL] == 1 and all_above(numbers, constants, bounds, count) == 1:
            break
        if all_finite(numbers, constants, bounds, count) == 0:
            return NOT_FINITE
        later = begin
        if ints[basis + PURE] == 0:
            later = drift_above(ints, numbers, waves, basis, signals, constants, bounds, count, begin, window_end)
            if later >= horizon:
                break
        if begin == 0.0:
            sample_start(ints, numbers, waves, basis, signals, constants, bounds, count)
            if window_end == horizon and stay_above(numbers, constants, noise, bounds, count, horizon) == 1:
                break
        if begin == 0.0 and count > 1 and ints[basis + PURE] == 1:
            falling = near_descent(
                ints, numbers, waves, basis, signals, constants, noise, bounds, count, latest, suspect, scratch_wave
            )
            if falling != NONE:
                falling = falling if numbers[suspect + ROOT] <= horizon else NONE
                break
        step = sample_distance(numbers, constants, bounds, count, window_end - begin)
        if later > begin + SKIPPED * step:
            begin = later - step  # where no signal is zero
            continue
        has_factors, previous_step = 1 if step == previous_step else 0, step
        blocks += 1
        if blocks > PATIENCE and horizon - begin > MOST_BLOCKS * INTERVALS * step:
            numbers[result + 2] = step
            numbers[result + 3] = horizon - begin
            return TOO_LONG
        falling = descent_in_block(
            ints, numbers, waves, basis, signals, constants, noise, bounds, count, begin, step, horizon, has_factors,
            suspect, scratch_wave,
        )  # fmt: skip
        begin += INTERVALS * step
    numbers[result + 1] += numbers[suspect + SAMPLES]
    if falling != NONE:
        numbers[result] = numbers[suspect + ROOT]
    return falling


@compiled
def simultaneous(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    count: int,
    first: int,
    time: float,
    scratch_wave: int,
    result: int,
) -> int:
    """Return the number of signals that reach zero, falling, at the first descent of ``first``, and flag them in ints.

    A signal whose slope is round-off does not fall: another contact may keep it at zero.

    scratch_wave: p waves. result: offset of the flags (count,) in the ints.
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
                power = ints[powers + j] / numbers[scales]
                slope += power * (a * waves[scratch_wave + j - 1]).real
                steepest += power * magnitude(waves, signals + s * p + j) * magnitude(waves, scratch_wave + j - 1)
        allowed = max(ZERO * terms, -slope * instant)
        falls = terms > 0.0 and slope < -ZERO * steepest and value <= min(SIMULTANEOUS * terms, allowed)
        ints[result + s] = 1 if s == first or falls else 0
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
    constant_size: float,
    sizes: int,
    since: int,
    scratch: int,
    scratch_wave: int,
) -> int:
    """Return the sign of a signal just after t = 0, +1 or -1; 0 if it vanishes.

    It is the sign of the first derivative, of order ``since`` or more, that is not round-off of its terms.
    constant_size: the sum of the |terms| of the constant. sizes: offset of those (p,) of the coefficients. scratch,
    scratch_wave: p working numbers and waves.
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
        noise = ZERO * constant_size if order == 0 else 0.0
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
