"""First descent of signals through zero, compiled: certified like first_descent.py, marching with intervals that adapt.

    g(t) = constant + Re sum_j a_j exp(lambda_j t)

An interval is clear by the Bernstein coefficients of the cubic Hermite interpolant and its remainder
(first_descent.py), it holds one root where g' is certified negative and g ends below zero, and is halved otherwise.
What stays undecided is left to first_descent.py.
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.mathematics.first_descent import RESOLUTION, SIMULTANEOUS
from multiphi_exudyn.mathematics.root_search import HERMITE, LIFTED, TIME_ROUND_OFF
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.time.compiled.waves import copy, derivatives, jit, multiply, prepare, sample, shift

__all__ = ["FOUND", "NONE", "UNDECIDED", "first_descent", "meets_another"]

NONE, FOUND, UNDECIDED = 0, 1, 2
MOST_SAMPLES = 2**18  # of one search: where signals have all but decayed, steps stay narrow; blocks serve better there


@jit
def widest(
    constants: np.ndarray, bounds: np.ndarray, count: int, shortest: float, horizon: float, refine: float, most: int
) -> int:
    """The power of two for the longest interval: the remainder is small beside the signals, the horizon not passed."""
    wanted = horizon * refine
    for s in range(count):
        if bounds[s, 4] > 0:
            size = RESOLUTION / HERMITE * (abs(constants[s]) + bounds[s, 0])
            wanted = min(wanted, math.sqrt(math.sqrt(size / bounds[s, 4])))
    ratio = wanted / refine / shortest
    return most if not ratio < 2.0**most else max(math.frexp(ratio)[1] - 1, 0)


@jit
def rises(
    left: np.ndarray,
    right: np.ndarray,
    h: float,
    bounds: np.ndarray,
    constant: float,
    signal: np.ndarray,
    rates: np.ndarray,
    phi: np.ndarray,
    p: int,
) -> bool:
    """Whether g starts at zero or above and stays above it; see root_search.py."""
    noise = ZERO * (bounds[0] + abs(constant))
    if left[0] < -noise:
        return False
    inner_left, inner_right = left[0] + h * left[1] / 3, right[0] - h * right[1] / 3
    if min(3 * inner_left, 1.5 * inner_right, right[0]) > LIFTED * h**4 * bounds[4]:
        return True
    if left[0] > noise:
        return False
    if left[1] > bounds[2] * h:
        return True
    if left[1] < -ZERO * bounds[1]:
        return False
    _, _, curvature, third = derivatives(signal, constant, rates, phi, p)
    return curvature > bounds[3] * h or (curvature >= -ZERO * bounds[2] and third > bounds[4] * h)


@jit
def falls(
    left: np.ndarray,
    right: np.ndarray,
    h: float,
    bounds: np.ndarray,
    constant: float,
    signal: np.ndarray,
    rates: np.ndarray,
    phi_left: np.ndarray,
    phi_right: np.ndarray,
    p: int,
) -> bool:
    """Whether g falls all the way through an interval, and through zero."""
    if left[1] >= 0 or right[1] >= 0 or right[0] >= -ZERO * (bounds[0] + abs(constant)):
        return False
    _, _, c0, _ = derivatives(signal, constant, rates, phi_left, p)
    _, _, c1, _ = derivatives(signal, constant, rates, phi_right, p)
    highest = max(left[1], right[1], left[1] + h * c0 / 3, right[1] - h * c1 / 3)
    return highest + HERMITE * h**4 * bounds[5] < 0


@jit
def root(
    start: float,
    h: float,
    top: int,
    left: np.ndarray,
    right: np.ndarray,
    bound: float,
    constant: float,
    signal: np.ndarray,
    rates: np.ndarray,
    factors: np.ndarray,
    shortest: float,
    p: int,
    given: np.ndarray,
    phi: np.ndarray,
) -> tuple[float, int]:
    """The root of g in [start, start + h], in which g falls, and the samples it took, by the method of root_search.py.

    given: the exponentials at the start; phi: those at the root.
    """
    rise = right[0] - left[0]
    s = -left[0] / rise
    toward_left, toward_right = rise / (left[1] * h), rise / (right[1] * h)
    s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right)
    a, b, u = 0.0, h, h * min(max(s, 0.01), 0.99)
    tolerance = TIME_ROUND_OFF * (start + h)
    taken = 0
    while taken < 100:
        taken += 1
        shift(rates, factors, shortest, top, u, p, given, phi)
        value, slope, curvature, third = derivatives(signal, constant, rates, phi, p)
        if value >= 0:
            a = u
        else:
            b = u
        following = (a + b) / 2
        if slope != 0:
            newton, c2, c3 = value / slope, curvature / (2 * slope), third / (6 * slope)
            better = u - newton - c2 * newton**2 - (2 * c2**2 - c3) * newton**3
            left_out = 5 * abs(c2) * (c2**2 + abs(c3)) + bound / (24 * abs(slope))
            if left_out * newton**4 <= tolerance or abs(newton) <= tolerance:
                u = min(max(better, a), b)
                break
            if a < better < b:
                following = better
        u = following
    shift(rates, factors, shortest, top, u, p, given, phi)
    return start + u, taken


@jit
def meets_another(
    found: int, signals: np.ndarray, slopes: np.ndarray, constants: np.ndarray, count: int, phi: np.ndarray, p: int
) -> bool:
    """Whether a second signal reaches zero, falling, at the root of signal ``found``."""
    for s in range(count):
        if s == found:
            continue
        g, slope, size = constants[s], 0.0, abs(constants[s])
        for j in range(p):
            re, im = signals[s, 0, j], signals[s, 1, j]
            g += re * phi[0, j] - im * phi[1, j]
            slope += slopes[s, 0, j] * phi[0, j] - slopes[s, 1, j] * phi[1, j]
            size += math.sqrt((re * re + im * im) * (phi[0, j] ** 2 + phi[1, j] ** 2))
        if g <= SIMULTANEOUS * size and slope <= 0:
            return True
    return False


@jit
def first_descent(
    signals: np.ndarray,
    constants: np.ndarray,
    count: int,
    rates: np.ndarray,
    factors: np.ndarray,
    magnitudes: np.ndarray,
    growth: float,
    shortest: float,
    refine: float,
    p: int,
    start: float,
    horizon: float,
    slopes: np.ndarray,
    bounds: np.ndarray,
    values: np.ndarray,
    phi: np.ndarray,
) -> tuple[int, float, int, int]:
    """(NONE | FOUND | UNDECIDED, its time, the signal that falls, samples taken) in (start, horizon].

    signals (s, 2, p), of which ``count`` count; slopes as they, bounds (s, BOUNDS), values (2, s, 2), phi (3, 2, p):
    room to work in, phi[2] the exponentials at the start, then at the descent. magnitudes (p, BOUNDS): |lambda|^k.
    factors (k, 2, p): exp(lambda h) for h = shortest 2^k. growth: the largest Re lambda above zero.
    """
    eternal, swell = True, math.exp(growth * (2 * horizon + shortest))
    for s in range(count):
        prepare(signals[s], rates, magnitudes, swell, p, slopes[s], bounds[s])
        if not bounds[s, 5] < math.inf:
            return UNDECIDED, start, 0, 0
        eternal = eternal and constants[s] > bounds[s, 0]
    if eternal:
        return NONE, horizon, 0, 0
    top = widest(constants, bounds, count, shortest, horizon, refine, len(factors) - 1)
    copy(phi[2, 0], p, phi[0, 0])
    copy(phi[2, 1], p, phi[0, 1])
    for s in range(count):
        sample(signals[s], slopes[s], constants[s], phi[0], p, values[0, s])
    k, t, here, samples = top, start, 0, 1
    while t < horizon:
        there = 1 - here
        h = math.ldexp(shortest, k)
        multiply(phi[here], factors[k], p, phi[there])
        samples += 1
        doubtful, fallen, roomy = 0, 0, True
        for s in range(count):
            left, right = values[here, s], values[there, s]
            sample(signals[s], slopes[s], constants[s], phi[there], p, right)
            remainder = HERMITE * h**4 * bounds[s, 4]
            low = min(left[0], left[0] + h * left[1] / 3, right[0] - h * right[1] / 3, right[0])
            roomy = roomy and right[0] + h * right[1] > 8 * remainder
            if not low > remainder and not rises(
                left, right, h, bounds[s], constants[s], signals[s], rates, phi[here], p
            ):
                doubtful, fallen = doubtful + 1, s
        if samples > MOST_SAMPLES:
            return UNDECIDED, t, fallen, samples
        if doubtful == 0:
            t, here, k = t + h, there, k + 1 if roomy and k < top else k
            continue
        left, right = values[here, fallen], values[there, fallen]
        if doubtful == 1 and falls(
            left, right, h, bounds[fallen], constants[fallen], signals[fallen], rates, phi[here], phi[there], p
        ):
            found, taken = root(
                t,
                h,
                k,
                left,
                right,
                bounds[fallen, 4],
                constants[fallen],
                signals[fallen],
                rates,
                factors,
                shortest,
                p,
                phi[here],
                phi[2],
            )
            return FOUND if found <= horizon else NONE, found, fallen, samples + taken
        k -= 1
        if k < 0:
            return UNDECIDED, t, fallen, samples
    return NONE, horizon, 0, samples
