"""Bounds of signals and of their derivatives, and the sample distance that follows from them, on flat buffers.

    g(t) = constant + Re sum_j a_j phi_j(t),   |g^(k)(t)| <= sum_j |a_j^(k)| (t/T)^d_j exp(Re lambda_j t)

a^(k): coefficients of the k-th derivative. Signals are as in zero_crossing.py.
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import (
    POWERS,
    RATES,
    SCALES,
    SIZE,
    exponential_size,
    magnitude,
)
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = [
    "BOUNDING",
    "DERIVATIVES",
    "HERMITE",
    "INTERVALS",
    "LIFTED",
    "OPPOSITE",
    "PER_SIGNAL",
    "QUINTIC",
    "all_above",
    "all_finite",
    "bound",
    "drift_above",
    "power_of_two_above",
    "round_off",
    "sample_distance",
]

DERIVATIVES = 7  # g and its derivatives up to the sixth are bounded
OPPOSITE = 7  # 1 where a signal is the previous one with the opposite sign, but for its constant, else 0
PER_SIGNAL = 8  # numbers: its bounds, and whether it is opposite
BOUNDING = 4  # in p: working numbers behind the bounds
INTERVALS = 64  # in a block
RESOLUTION = 0.004  # remainder of a block's intervals, relative to the typical size of the signal
HERMITE = 1 / 384
QUINTIC = 1 / 46080  # max of u^3 (1 - u)^3 / 720 on [0, 1]
LIFTED = 1 / 162  # max of u (1 - u)^2 / 24 on [0, 1]


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
) -> None:
    """Set upper bounds of |g|, |g'|, ..., |g^(6)| on [start, latest], without constants, and the flags OPPOSITE.

    sum_j b_j with b_j = |a_j| (latest / T)^d_j exp(min(Re lambda_j, 0) start + max(Re lambda_j, 0) latest) for g; every
    derivative has |lambda_j| b_j + d_j+1 / latest b_j+1 in place of b_j, where j + 1 has the next power. BOUNDING p
    numbers behind the bounds are working memory.
    """
    p, powers, rates = ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES]
    sizes, fast, envelope, link = bounds + PER_SIGNAL * count, p, 2 * p, 3 * p
    ratio, factor = latest / numbers[ints[basis + SCALES]], 1.0
    for j in range(p):
        decay = waves[rates + j].real
        numbers[sizes + link + j] = 0.0
        if ints[powers + j] > 0:
            factor *= ratio
            numbers[sizes + link + j - 1] = ints[powers + j] / latest
        else:
            exponent = decay * (start if decay < 0.0 else latest)
            factor = exponential_size(exponent) if exponent != 0.0 else 1.0
        numbers[sizes + envelope + j] = factor
        numbers[sizes + fast + j] = magnitude(waves, rates + j)
    for s in range(count):
        first, opposite = bounds + PER_SIGNAL * s, is_opposite(waves, signals + s * p, p) if s > 0 else 0
        numbers[first + OPPOSITE] = opposite
        for k in range(DERIVATIVES if opposite == 1 else 0):
            numbers[first + k] = numbers[first - PER_SIGNAL + k]
        for j in range(p if opposite == 0 else 0):
            numbers[sizes + j] = magnitude(waves, signals + s * p + j) * numbers[sizes + envelope + j]
        for k in range(DERIVATIVES if opposite == 0 else 0):
            total = 0.0
            for j in range(p):
                size = numbers[sizes + j]
                total += size
                linked = numbers[sizes + link + j] * numbers[sizes + j + 1]  # the last one to none
                numbers[sizes + j] = size * numbers[sizes + fast + j] + linked
            numbers[first + k] = total


@compiled
def is_opposite(waves: Waves, signal: int, p: int) -> int:
    """Return 1 where the coefficients (p,) of a signal are those of the previous one with the opposite sign."""
    for j in range(p):
        if waves[signal + j] != -waves[signal - p + j]:
            return 0
    return 1


@compiled
def all_above(numbers: Numbers, constants: int, bounds: int, count: int) -> int:
    """Return 1 where every constant is larger than the bound of its variable part."""
    for s in range(count):
        if not numbers[constants + s] > numbers[bounds + PER_SIGNAL * s]:
            return 0
    return 1


@compiled
def drift_above(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    bounds: int,
    count: int,
    start: float,
    latest: float,
) -> float:
    """Return until when, at most ``latest``, the drift of every signal keeps it above zero; ``start`` for not at all.

    The drift is the constant and the terms without exponential that are constant or linear in time. It exceeds the
    bounds of the other terms from the start on, as ``bound`` has set them.
    """
    p, powers, rates = ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES]
    envelope, until = bounds + PER_SIGNAL * count + 2 * p, latest
    for s in range(count):
        value, slope = numbers[constants + s], 0.0
        for j in range(p):
            a = signals + s * p + j
            if waves[rates + j] != 0 or ints[powers + j] > 1:
                value -= magnitude(waves, a) * numbers[envelope + j]
            elif ints[powers + j] == 1:
                slope += waves[a].real / numbers[ints[basis + SCALES]]
            else:
                value += waves[a].real
        if not value + slope * start > 0.0:
            return start
        if not value + slope * until > 0.0:
            until = -value / slope
    return until


@compiled
def all_finite(numbers: Numbers, constants: int, bounds: int, count: int) -> int:
    """Return 1 where the bounds of signals and of their highest derivatives are finite."""
    for s in range(count):
        first = bounds + PER_SIGNAL * s
        if not abs(numbers[constants + s]) + numbers[first] + numbers[first + DERIVATIVES - 1] < math.inf:
            return 0
    return 1


@compiled
def sample_distance(numbers: Numbers, constants: int, bounds: int, count: int, remaining: float) -> float:
    """Return the sample distance of the next block: a power of two with a small remainder relative to the signals.

    It is at most the one with which the block reaches the horizon.
    """
    longest = power_of_two_above(remaining / INTERVALS)
    step = math.inf
    for s in range(count):
        fourth = numbers[bounds + PER_SIGNAL * s + 4]
        if fourth > 0.0:
            wanted = RESOLUTION * (abs(numbers[constants + s]) + numbers[bounds + PER_SIGNAL * s]) / HERMITE
            distance = math.sqrt(math.sqrt(wanted / fourth))
            step = min(step, distance) if distance > 0.0 else step  # zero after underflow: no limit
    return min(longest, power_of_two_above(step) / 2) if step < math.inf else longest


@compiled
def power_of_two_above(value: float) -> float:
    """Return the smallest power of two that is greater than ``value``."""
    return math.ldexp(1.0, math.frexp(value)[1])


@compiled
def round_off(size: float, constant: float, noise: float) -> float:
    """Return the size of |g| below which it is round-off of its terms, or of their own terms (noise)."""
    return max(ZERO * (size + abs(constant)), noise)
