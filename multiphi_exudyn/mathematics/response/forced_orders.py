"""Particular solutions of one equation of first and of second order, pushed by a polynomial, in flat buffers."""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Waves, compiled
from multiphi_exudyn.mathematics.response.forced_response import NEAREST_FAR, OUTWEIGHED, PER_DEGREE, TAYLOR

__all__ = ["clear_rows", "first_order", "is_far", "is_forced", "second_order", "taylor_terms"]


@compiled
def is_far(size: float, degree: int, horizon: float) -> int:
    """1 where a pole at this distance is far for a push of a degree: the finite polynomial is never large."""
    return 1 if size * horizon >= NEAREST_FAR + PER_DEGREE * degree else 0


@compiled
def first_order(
    waves: Waves,
    real: float,
    imag: float,
    size: float,
    given: int,
    degree: int,
    horizon: float,
    moving: float,
    most: int,
    w: int,
) -> int:
    """w (K + 1,) of w' = distance w + p(t), distance = s - mu: K + 1, and nothing more if that is above ``most``.

    Far from the pole, and nearer where that is not much more than what is ``moving`` there already,
    w_k = ((k + 1) w_k+1 / T - p_k) / distance, else w_k+1 = T (distance w_k + p_k) / (k + 1). size: |distance|.
    """
    distance, far = complex(real, imag), is_far(size, degree, horizon)
    if far == 1 or size * moving > 0.0:
        inverse, above, total = complex(real / size / size, -imag / size / size), 0j, 0.0
        for k in range(degree, -1, -1):
            above = ((k + 1) / horizon * above - waves[given + k]) * inverse
            waves[w + k] = above
            total += abs(above.real) + abs(above.imag)
        if far == 1 or total <= OUTWEIGHED * moving:
            return degree + 1
    rows = taylor_terms(degree, size * horizon, 1)
    if rows <= most:
        waves[w] = 0j
        for k in range(rows - 1):
            push = waves[given + k] if k <= degree else 0j
            waves[w + k + 1] = (distance * waves[w + k] + push) * (horizon / (k + 1))
    return rows


@compiled
def second_order(
    waves: Waves,
    square: float,
    delta: float,
    real: float,
    imag: float,
    given: int,
    degree: int,
    horizon: float,
    most: int,
    w: int,
) -> int:
    """w (K + 1,) of w'' + 2 (delta + mu) w' + (omega^2 + 2 delta mu + mu^2) w = p(t), poles close together; K + 1."""
    mu = complex(real, imag)
    slope, value = 2 * (delta + mu), square + 2 * delta * mu + mu * mu
    size = math.hypot(value.real, value.imag)
    distance = math.sqrt(size)
    if is_far(distance, degree + 1, horizon) == 1:
        inverse, first, second = complex(value.real / size / size, -value.imag / size / size), 0j, 0j
        for k in range(degree, -1, -1):
            above = (k + 1) / horizon * first
            waves[w + k] = (waves[given + k] - slope * above - (k + 1) / horizon * second) * inverse
            first, second = waves[w + k], above
        return degree + 1
    rows = taylor_terms(degree, max(distance, math.hypot(slope.real, slope.imag)) * horizon, 2)
    if rows <= most:
        waves[w] = 0j
        waves[w + 1] = 0j
        for k in range(rows - 2):
            push = waves[given + k] if k <= degree else 0j
            pulled = slope * waves[w + k + 1] * ((k + 1) / horizon) + value * waves[w + k]
            waves[w + k + 2] = (push - pulled) * (horizon * horizon / ((k + 1) * (k + 2)))
    return rows


@compiled
def taylor_terms(degree: int, reach: float, order: int) -> int:
    """Coefficients of a Taylor series up to round-off, reach = |distance| T."""
    term, count = 1.0, 0
    while term > TAYLOR:
        count += 1
        term *= reach / count
    return degree + 1 + order + count


@compiled
def clear_rows(waves: Waves, x: int, r: int, rows: int, wanted: int) -> int:
    """Makes x (rows, r) longer by zeros where more rows are wanted: how many it has then."""
    for k in range(rows * r, wanted * r):
        waves[x + k] = 0j
    return max(rows, wanted)


@compiled
def is_forced(waves: Waves, forces: int, r: int, degree: int) -> int:
    """1 where anything acts on a mode; its p_d stand r apart."""
    for d in range(degree + 1):
        if waves[forces + d * r] != 0:
            return 1
    return 0
