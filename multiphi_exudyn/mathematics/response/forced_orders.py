"""Particular solutions of one equation of first or second order with a polynomial as input, in flat buffers."""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Waves, compiled
from multiphi_exudyn.mathematics.response.forced_response import NEAREST_FAR, OUTWEIGHED, PER_DEGREE, TAYLOR

__all__ = ["clear_rows", "first_order", "is_far", "is_forced", "second_order", "taylor_terms"]


@compiled
def is_far(size: float, degree: int, horizon: float) -> int:
    """Return 1 where a pole is so far, for an input of this degree, that the finite polynomial is not large."""
    return 1 if size * horizon >= NEAREST_FAR + PER_DEGREE * degree else 0


@compiled
def first_order(
    waves: Waves,
    real: float,
    imag: float,
    size: float,
    forces: int,
    degree: int,
    horizon: float,
    motion: float,
    most: int,
    w: int,
) -> int:
    """Set w (K + 1,) of w' = distance w + p(t), distance = s - mu, and return K + 1; only that if it is above ``most``.

    Far from the pole, and nearer where w is not much larger than ``motion``, the free motion of the pole,
    w_k = ((k + 1) w_k+1 / T - p_k) / distance, else w_k+1 = T (distance w_k + p_k) / (k + 1). size: |distance|.
    """
    distance, far = complex(real, imag), is_far(size, degree, horizon)
    if far == 1 or size * motion > 0.0:
        inverse, coefficient, total = complex(real / size / size, -imag / size / size), 0j, 0.0
        for k in range(degree, -1, -1):
            coefficient = ((k + 1) / horizon * coefficient - waves[forces + k]) * inverse
            waves[w + k] = coefficient
            total += abs(coefficient.real) + abs(coefficient.imag)
        if far == 1 or total <= OUTWEIGHED * motion:
            return degree + 1
    count = taylor_terms(degree, size * horizon, 1)
    if count <= most:
        waves[w] = 0j
        for k in range(count - 1):
            force = waves[forces + k] if k <= degree else 0j
            waves[w + k + 1] = (distance * waves[w + k] + force) * (horizon / (k + 1))
    return count


@compiled
def second_order(
    waves: Waves,
    square: float,
    delta: float,
    real: float,
    imag: float,
    forces: int,
    degree: int,
    horizon: float,
    most: int,
    w: int,
) -> int:
    """Set w (K + 1,) of w'' + 2 (delta + mu) w' + (omega^2 + 2 delta mu + mu^2) w = p(t), poles close; return K + 1."""
    mu = complex(real, imag)
    slope, value = 2 * (delta + mu), square + 2 * delta * mu + mu * mu
    size = math.hypot(value.real, value.imag)
    distance = math.sqrt(size)
    if is_far(distance, degree + 1, horizon) == 1:
        inverse, first, second = complex(value.real / size / size, -value.imag / size / size), 0j, 0j
        for k in range(degree, -1, -1):
            above = (k + 1) / horizon * first
            waves[w + k] = (waves[forces + k] - slope * above - (k + 1) / horizon * second) * inverse
            first, second = waves[w + k], above
        return degree + 1
    rows = taylor_terms(degree, max(distance, math.hypot(slope.real, slope.imag)) * horizon, 2)
    if rows <= most:
        waves[w] = 0j
        waves[w + 1] = 0j
        for k in range(rows - 2):
            force = waves[forces + k] if k <= degree else 0j
            restoring = slope * waves[w + k + 1] * ((k + 1) / horizon) + value * waves[w + k]
            waves[w + k + 2] = (force - restoring) * (horizon * horizon / ((k + 1) * (k + 2)))
    return rows


@compiled
def taylor_terms(degree: int, reach: float, order: int) -> int:
    """Return the number of Taylor coefficients up to round-off, reach = |distance| T."""
    term, count = 1.0, 0
    while term > TAYLOR:
        count += 1
        term *= reach / count
    return degree + 1 + order + count


@compiled
def clear_rows(waves: Waves, x: int, r: int, rows: int, wanted: int) -> int:
    """Append zero rows to x (rows, r) up to ``wanted`` rows; return their number."""
    for k in range(rows * r, wanted * r):
        waves[x + k] = 0j
    return max(rows, wanted)


@compiled
def is_forced(waves: Waves, forces: int, r: int, degree: int) -> int:
    """Return 1 where a force acts on a mode; its p_d are r apart."""
    for d in range(degree + 1):
        if waves[forces + d * r] != 0:
            return 1
    return 0
