"""Terms of the work over a segment: what its flow's exponentials are multiplied by, and what needs no product of two.

In the scratch memory, of n coordinates, p exponentials and q channels: coefficients of xi, xi', xi'' (3, p, n), of
D xi' (p, n), of what w_k and w_k' are multiplied by (p, 2 q), and of T_e and s_e.xi' (work.py).
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
from multiphi_exudyn.time.loop.work_sums import dissipated

__all__ = [
    "add_constants",
    "add_friction",
    "dissipated_freely",
    "list_terms",
    "swinging",
    "swinging_alone",
    "weigh_terms",
]


@compiled
def swinging(ints: Ints, numbers: Numbers) -> float:
    """|eta'|^2 + |omega eta|^2 at the start of the flow."""
    level, total = ints[AFTER + LEVEL], 0.0
    for i in range(ints[level + MODES]):
        speed = numbers[ints[AFTER + SPEED] + i]
        swing = numbers[ints[level + FREQUENCIES] + i] * numbers[ints[AFTER + PLACE] + i]
        total += speed * speed + swing * swing
    return total


@compiled
def swinging_alone(ints: Ints, waves: Waves) -> float:
    """The same of the free response alone: the sum of |V c lambda|^2."""
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
def dissipated_freely(ints: Ints, numbers: Numbers, waves: Waves, duration: float) -> float:
    """The work of damping on the free response alone, without powers of time (work_sums.py).

    Its change is summed from exp(lambda t) - 1: the difference of two states would be round-off in short segments.
    """
    level, sums, c = ints[AFTER + LEVEL], ints[WORK_NUMBERS], ints[FLOW_WAVES]
    r, rates = ints[level + MODES], ints[ints[FLOW_BASIS] + RATES]
    changes = sums + 2 * r
    for i in range(4 * r):
        numbers[sums + i] = 0.0
    for j in range(ints[FLOW_FREE]):
        rate, shape = waves[rates + j], ints[ints[level + RESPONSE] + SHAPES] + j * r
        half, grown = math.sin(0.5 * rate.imag * duration), math.expm1(rate.real * duration)
        turned = math.sin(rate.imag * duration) * (1.0 + grown)
        change = waves[c + j] * complex(grown * (1.0 - 2.0 * half * half) - 2.0 * half * half, turned)
        whole = 2.0 * waves[c + j] + change
        for i in range(r):
            place, speed = waves[shape + i], waves[shape + i] * rate
            numbers[sums + i] += (place * whole).real
            numbers[sums + r + i] += (speed * whole).real
            numbers[changes + i] += (place * change).real
            numbers[changes + r + i] += (speed * change).real
    return dissipated(ints, numbers, level, sums, changes)


@compiled
def weigh_terms(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, apart: int) -> None:
    """Coefficients of D xi' (p, n), of what w_k, w_k' are multiplied by (p, 2 q), but e_k, and of T_e, s_e.xi'.

    apart: the first terms, whose D xi' nobody needs, and of which the level knows the others.
    """
    level, p, q, r = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], ints[ints[AFTER + LEVEL] + MODES]
    n = r + q
    for j in range(apart):
        for k in range(2 * q):
            swing = ints[level + SWINGS] + j * (r + 2 * q) + r + k
            scratch[4 * p * n + 2 * q * j + k] = waves[ints[FLOW_WAVES] + j] * waves[swing]
    for j in range(apart, p):
        for i in range(n):
            row, total = ints[level + DISSIPATION] + i * n, 0j
            for k in range(n):
                total += numbers[row + k] * scratch[(p + j) * n + k]
            scratch[(3 * p + j) * n + i] = total
        for k in range(q):
            row, held, moved = ints[level + POWER] + k * (4 * n + 1), 0j, 0j
            for i in range(n):
                x, v, a = scratch[j * n + i], scratch[(p + j) * n + i], scratch[(2 * p + j) * n + i]
                held += numbers[row + i] * v
                moved += numbers[row + n + i] * x + numbers[row + 2 * n + i] * v + numbers[row + 3 * n + i] * a
            scratch[4 * p * n + 2 * q * j + k] = held
            scratch[4 * p * n + 2 * q * j + q + k] = moved
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
    """Adds e_k, and b_k times what is held, times what w_k has changed by to the work of what varies."""
    level, p, q, basis = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], ints[FLOW_BASIS]
    n = ints[level + MODES] + q
    for k in range(ints[PRESCRIBED]):
        row = ints[level + POWER] + k * (4 * n + 1)
        constant = numbers[row + 4 * n]
        for held in range(n - q + ints[PRESCRIBED], n):
            constant += numbers[row + n + held] * numbers[ints[AFTER + PLACE] + held]
        for j in range(ints[FLOW_FREE], p):
            began = 1.0 if ints[ints[basis + POWERS] + j] == 0 else 0.0
            works[1] += constant * (scratch[j * n + n - q + k] * (waves[ints[WORK_WAVES] + j] - began)).real


@compiled
def add_friction(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, works: Numbers) -> None:
    """Adds the limits times the ways slipped, f times what xi has changed by, and what is constant of T_e likewise."""
    level, row = ints[AFTER + LEVEL], ints[ints[AFTER + LEVEL] + RUBBING]
    n = ints[level + MODES] + ints[CHANNELS]
    for j in range(ints[FLOW_COUNT]):
        pushed = 0j
        for i in range(n):
            pushed += numbers[row + i] * scratch[j * n + i]
        for e in range(ints[level + RUBBINGS]):
            pair = row + n + e * (4 * n + 1)
            constant, moved = numbers[pair + 4 * n], 0j
            for held in range(n - ints[CHANNELS] + ints[PRESCRIBED], n):
                constant += numbers[pair + held] * numbers[ints[AFTER + PLACE] + held]
            for i in range(n):
                moved += numbers[pair + 3 * n + i] * scratch[j * n + i]
            pushed += constant * moved
        began = 1.0 if ints[ints[ints[FLOW_BASIS] + POWERS] + j] == 0 else 0.0
        works[2] += (pushed * (waves[ints[WORK_WAVES] + j] - began)).real
