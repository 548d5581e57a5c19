"""Terms of the work over a segment: factors of its flow's exponentials, and the works that need no products of two.

In the scratch memory, of n coordinates, p exponentials and q channels: coefficients of xi, xi', xi'' (3, p, n), of
D xi' (p, n), of the factors of w_k and w_k' (p, 2 q), and of T_e and s_e.xi' (work.py).
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANNELS,
    DISSIPATION,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FORCED,
    FLOW_FREE,
    FLOW_WAVES,
    FREQUENCIES,
    LEVEL,
    MODES,
    PLACE,
    POWER,
    PRESCRIBED,
    RESPONSE,
    RUBBING,
    RUBBINGS,
    SPEED,
    SWINGS,
    WORK_NUMBERS,
    WORK_WAVES,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import POWERS, RATES, SCALES
from multiphi_exudyn.mathematics.response.response_arrays import SHAPES
from multiphi_exudyn.time.loop.work_sums import damping_work

__all__ = [
    "add_constants",
    "add_friction",
    "free_damping_work",
    "free_motion_square",
    "list_factors",
    "list_terms",
    "motion_square",
]


@compiled
def motion_square(ints: Ints, numbers: Numbers) -> float:
    """|eta'|^2 + |omega eta|^2 at the start of the flow."""
    level, total = ints[AFTER + LEVEL], 0.0
    for i in range(ints[level + MODES]):
        speed = numbers[ints[AFTER + SPEED] + i]
        swing = numbers[ints[level + FREQUENCIES] + i] * numbers[ints[AFTER + PLACE] + i]
        total += speed * speed + swing * swing
    return total


@compiled
def free_motion_square(ints: Ints, waves: Waves) -> float:
    """|eta'|^2 + |omega eta|^2 of the free response alone: the sum of |V c lambda|^2."""
    level, rates, total = ints[AFTER + LEVEL], ints[ints[FLOW_BASIS] + RATES], 0.0
    r = ints[level + MODES]
    for j in range(ints[FLOW_FREE]):
        rate, shape = waves[ints[FLOW_WAVES] + j] * waves[rates + j], ints[ints[level + RESPONSE] + SHAPES] + j * r
        for i in range(r):
            speed = rate * waves[shape + i]
            total += speed.real * speed.real + speed.imag * speed.imag
    return total


@compiled
def list_terms(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, first: int) -> None:
    """Coefficients of xi, xi', xi'' (3, p, n) of the flow, from its ``first`` term on."""
    level, basis, p, free = ints[AFTER + LEVEL], ints[FLOW_BASIS], ints[FLOW_COUNT], ints[FLOW_FREE]
    r, c, unit = ints[level + MODES], ints[FLOW_WAVES], numbers[ints[ints[FLOW_BASIS] + SCALES]]
    n, moving = r + ints[CHANNELS], r + ints[PRESCRIBED]
    for j in range(first, p):
        shape, size = ints[ints[level + RESPONSE] + SHAPES] + j * r, r
        if j >= free:
            shape, size = ints[FLOW_FORCED] + (j - free) * moving, moving
        for i in range(n):
            scratch[j * n + i] = waves[shape + i] * waves[c + j] if i < size else 0j
    for j in range(p, 3 * p if n > r else 2 * p):
        if j % p < first:
            continue
        rate, power = waves[ints[basis + RATES] + j % p], 0
        if j % p + 1 < p:
            power = ints[ints[basis + POWERS] + j % p + 1]
        for i in range(n):
            scratch[j * n + i] = rate * scratch[(j - p) * n + i]
            if power > 0:
                scratch[j * n + i] += power / unit * scratch[(j - p + 1) * n + i]


@compiled
def free_damping_work(ints: Ints, numbers: Numbers, waves: Waves, duration: float) -> float:
    """Work of damping [J] on the free response alone, without powers of time (work_sums.py).

    The change of the form is summed from exp(lambda t) - 1: in short segments the difference of two states would be
    round-off.
    """
    level, sums, c = ints[AFTER + LEVEL], ints[WORK_NUMBERS], ints[FLOW_WAVES]
    r, rates = ints[level + MODES], ints[ints[FLOW_BASIS] + RATES]
    changes = sums + 2 * r
    for i in range(4 * r):
        numbers[sums + i] = 0.0
    for j in range(ints[FLOW_FREE]):
        rate, shape = waves[rates + j], ints[ints[level + RESPONSE] + SHAPES] + j * r
        half, growth = math.sin(0.5 * rate.imag * duration), math.expm1(rate.real * duration)
        sine_part = math.sin(rate.imag * duration) * (1.0 + growth)
        change = waves[c + j] * complex(growth * (1.0 - 2.0 * half * half) - 2.0 * half * half, sine_part)
        total = 2.0 * waves[c + j] + change
        for i in range(r):
            place, speed = waves[shape + i], waves[shape + i] * rate
            numbers[sums + i] += (place * total).real
            numbers[sums + r + i] += (speed * total).real
            numbers[changes + i] += (place * change).real
            numbers[changes + r + i] += (speed * change).real
    return damping_work(ints, numbers, level, sums, changes)


@compiled
def list_factors(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, closed_count: int) -> None:
    """Coefficients of D xi' (p, n), of the factors of w_k and w_k' (p, 2 q) without e_k, and of T_e and s_e.xi'.

    closed_count: the first terms, whose D xi' is not needed, and of which the level keeps the other coefficients.
    """
    level, p, q, r = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], ints[ints[AFTER + LEVEL] + MODES]
    n = r + q
    for j in range(closed_count):
        for k in range(2 * q):
            speed_place = ints[level + SWINGS] + j * (r + 2 * q) + r + k
            scratch[4 * p * n + 2 * q * j + k] = waves[ints[FLOW_WAVES] + j] * waves[speed_place]
    for j in range(closed_count, p):
        for i in range(n):
            row, total = ints[level + DISSIPATION] + i * n, 0j
            for k in range(n):
                total += numbers[row + k] * scratch[(p + j) * n + k]
            scratch[(3 * p + j) * n + i] = total
        for k in range(q):
            row, value_factor, rate_factor = ints[level + POWER] + k * (4 * n + 1), 0j, 0j
            for i in range(n):
                x, v, a = scratch[j * n + i], scratch[(p + j) * n + i], scratch[(2 * p + j) * n + i]
                value_factor += numbers[row + i] * v
                rate_factor += numbers[row + n + i] * x + numbers[row + 2 * n + i] * v + numbers[row + 3 * n + i] * a
            scratch[4 * p * n + 2 * q * j + k] = value_factor
            scratch[4 * p * n + 2 * q * j + q + k] = rate_factor
        for e in range(ints[level + RUBBINGS]):
            row, tension, speed = ints[level + RUBBING] + n + e * (4 * n + 1), 0j, 0j
            for i in range(n):
                v = scratch[(p + j) * n + i]
                tension += numbers[row + i] * scratch[j * n + i] + numbers[row + n + i] * v
                speed += numbers[row + 2 * n + i] * v
            at = 4 * p * n + 2 * q * p + 2 * (e * p + j)
            scratch[at] = tension
            scratch[at + 1] = speed


@compiled
def add_constants(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, works: Numbers) -> None:
    """Add (e_k + b_k times the index places) times the change of w_k to the work of varying loads."""
    level, p, q, basis = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], ints[FLOW_BASIS]
    n = ints[level + MODES] + q
    for k in range(ints[PRESCRIBED]):
        row = ints[level + POWER] + k * (4 * n + 1)
        constant = numbers[row + 4 * n]
        for index in range(n - q + ints[PRESCRIBED], n):
            constant += numbers[row + n + index] * numbers[ints[AFTER + PLACE] + index]
        for j in range(ints[FLOW_FREE], p):
            start_value = 1.0 if ints[ints[basis + POWERS] + j] == 0 else 0.0
            works[1] += constant * (scratch[j * n + n - q + k] * (waves[ints[WORK_WAVES] + j] - start_value)).real


@compiled
def add_friction(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, works: Numbers) -> None:
    """Add the constant friction forces times slip to the work of friction: f and the constant part of T_e."""
    level, row = ints[AFTER + LEVEL], ints[ints[AFTER + LEVEL] + RUBBING]
    n = ints[level + MODES] + ints[CHANNELS]
    for j in range(ints[FLOW_COUNT]):
        work = 0j
        for i in range(n):
            work += numbers[row + i] * scratch[j * n + i]
        for e in range(ints[level + RUBBINGS]):
            pair = row + n + e * (4 * n + 1)
            constant, slip = numbers[pair + 4 * n], 0j
            for index in range(n - ints[CHANNELS] + ints[PRESCRIBED], n):
                constant += numbers[pair + index] * numbers[ints[AFTER + PLACE] + index]
            for i in range(n):
                slip += numbers[pair + 3 * n + i] * scratch[j * n + i]
            work += constant * slip
        start_value = 1.0 if ints[ints[ints[FLOW_BASIS] + POWERS] + j] == 0 else 0.0
        works[2] += (work * (waves[ints[WORK_WAVES] + j] - start_value)).real
