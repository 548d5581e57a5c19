"""Impact in flat arrays: rigid contacts strike, or their motion presses them to their stops.

    v+ = v- + A^T p,   p = argmin |v- + A^T p|,  p >= 0,   A = H^T Phi_l                         (Moreau, restitution 0)

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, CISM 302 (1988).
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    BY_IMPACT,
    CAUSE,
    CAUSED_BY,
    CHANGE,
    CHANNELS,
    COORDINATES,
    DIRECTIONS,
    ELEMENTS,
    FAILED,
    GAPS,
    JOIN_NUMBERS,
    LEAST,
    LEAST_INTS,
    LEAST_NUMBERS,
    LEAST_SIZES,
    LEVEL,
    MODES,
    OK,
    PLACE,
    REACH,
    ROWS,
    SPEED,
    SPEEDS,
    SQUEEZED,
    STOP_WORK,
    UNSETTLED,
)
from multiphi_exudyn.events.flat_state import copy_state, kinetic, measure
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.flat_least_distance import EXCLUDED, UNDECIDED, flat_least_distance, norm
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["RESTING", "collide", "fill_rows", "independent", "nearest", "resting_size", "speed_size", "unseen_speed"]

RESTING = 1e-12  # of what it could be at such speeds: a gap velocity below it is zero right after an impact


@compiled
def fill_rows(ints: Ints, numbers: Numbers, level: int, contacts: int, count: int, held: int) -> None:
    """Gap velocities (count + held, n) from xi', of the last ``held`` contacts with the opposite sign."""
    n = ints[level + MODES] + ints[CHANNELS]
    for k in range(count + held):
        sign = 1.0 if k < count else -1.0
        row, own = ints[ROWS] + k * n, ints[level + SPEEDS] + ints[contacts + k] * (n + 1)
        for i in range(n):
            numbers[row + i] = sign * numbers[own + i]


@compiled
def nearest(
    ints: Ints, numbers: Numbers, level: int, contacts: int, count: int, vector: int, sizes: int, multipliers: int
) -> int:
    """The change (r,) that makes ``vector`` (n,) admissible, rows v >= 0, and its multipliers (count,); OK or FAILED.

    sizes: (count,) of the terms of rows v beside those of v itself, -1 for none.
    """
    r = ints[level + MODES]
    n = r + ints[CHANNELS]
    for k in range(count):
        row, value, terms = ints[ROWS] + k * n, 0.0, 0.0
        for i in range(n):
            value += numbers[row + i] * numbers[vector + i]
            terms += abs(numbers[row + i]) * abs(numbers[vector + i])
        numbers[ints[LEAST] + k] = -value
        numbers[ints[LEAST_SIZES] + k] = terms + (numbers[sizes + k] if sizes >= 0 else 0.0)
    answer = flat_least_distance(
        ints, numbers, ints[ROWS], n, ints[LEAST], ints[LEAST_SIZES], count, r, ints[CHANGE], multipliers,
        ints[LEAST_NUMBERS], ints[LEAST_INTS],
    )  # fmt: skip
    if answer == EXCLUDED:
        ints[CAUSE] = SQUEEZED
        for i in range(ints[ELEMENTS]):
            ints[ints[CAUSED_BY] + i] = 0
        for k in range(ints[ints[LEAST_INTS]]):
            ints[ints[CAUSED_BY] + ints[contacts + ints[ints[LEAST_INTS] + 1 + 2 * count + k]]] = 1
        return FAILED
    if answer == UNDECIDED:
        ints[CAUSE] = UNSETTLED
        return FAILED
    return OK


@compiled
def collide(
    ints: Ints,
    numbers: Numbers,
    state: int,
    contacts: int,
    count: int,
    held: int,
    result: int,
    impulses: int,
    losses: int,
) -> int:
    """The state after Moreau's impact, in a level in which the contacts are open; adds its losses; OK or FAILED.

    held: the last so many contacts keep no speed away from their stop either. impulses: (count + held,) [N s].
    What is left of a speed that the impact has taken away but for round-off would bounce and rock on until it
    underflows, and what is left of a place where it has come to rest would swing, and strike again: both become zero.
    """
    level = ints[state + LEVEL]
    r, channels = ints[level + MODES], ints[CHANNELS]
    fill_rows(ints, numbers, level, contacts, count, held)
    if nearest(ints, numbers, level, contacts, count + held, ints[state + SPEED], -1, impulses) < 0:
        return FAILED
    plastic = 0.0
    for k in range(count + held):
        plastic += 0.5 * numbers[impulses + k] * numbers[ints[LEAST] + k]
    copy_state(ints, numbers, state, result)
    v, before, x, reach = ints[result + SPEED], ints[state + SPEED], ints[result + PLACE], ints[state + REACH]
    for i in range(r):
        numbers[v + i] += numbers[ints[CHANGE] + i]
    rest = norm(numbers, v, r) <= RESTING * norm(numbers, before, r)
    for i in range(r):
        if rest or abs(numbers[v + i]) <= RESTING * abs(numbers[before + i]):
            numbers[v + i] = 0.0
            if abs(numbers[x + i]) <= ZERO * numbers[reach + i]:
                numbers[x + i] = 0.0
    measure(ints, numbers, result)
    lost = kinetic(ints, numbers, state) - kinetic(ints, numbers, result)
    if channels == 0:
        plastic = lost
    numbers[losses + BY_IMPACT] += plastic
    numbers[losses + STOP_WORK] += plastic - lost
    return OK


@compiled
def speed_size(ints: Ints, numbers: Numbers, state: int, row: int) -> float:
    """What a gap velocity could be at the speeds of a state, whose directions an impact mixes."""
    r, q, v = ints[ints[state + LEVEL] + MODES], ints[CHANNELS], ints[state + SPEED]
    prescribed = 0.0
    for k in range(r, r + q):
        prescribed += abs(numbers[row + k]) * abs(numbers[v + k])
    return norm(numbers, row, r) * norm(numbers, v, r) + prescribed


@compiled
def unseen_speed(ints: Ints, numbers: Numbers, state: int, contact: int, row: int) -> float:
    """Gap velocity that the free motion turns back before the gap is more than round-off of its terms.

    xi'' of the state stands in the accelerations.
    """
    level, x = ints[state + LEVEL], ints[state + PLACE]
    n = ints[level + MODES] + ints[CHANNELS]
    gaps = ints[level + GAPS] + contact * (n + 1)
    size, falling = abs(numbers[gaps + n]), 0.0
    for i in range(n):
        size += abs(numbers[gaps + i]) * abs(numbers[x + i])
        falling -= numbers[row + i] * numbers[ints[ACCELERATION] + i]
    return math.sqrt(2.0 * ZERO * size * falling) if falling > 0.0 else 0.0


@compiled
def resting_size(numbers: Numbers, one: int, other: int, row: int, n: int) -> float:
    """Of which terms a gap's acceleration is the sum, in the larger of two states' sizes (n,)."""
    total = 0.0
    for i in range(n):
        total += abs(numbers[row + i]) * max(numbers[one + i], numbers[other + i])
    return total


@compiled
def independent(ints: Ints, numbers: Numbers, flags: int) -> int:
    """1 where of the contacts with a flag (c,) none follows from the others, so that they can be closed together."""
    m, found, smallest = ints[COORDINATES], 0, math.inf
    q = ints[JOIN_NUMBERS]
    for k in range(ints[ELEMENTS]):
        if ints[flags + k] == 0:
            continue
        if found == m:
            return 0
        own = q + found * m
        for i in range(m):
            numbers[own + i] = numbers[ints[DIRECTIONS] + k * m + i]
        for _ in range(2):
            for b in range(found):
                product = 0.0
                for i in range(m):
                    product += numbers[q + b * m + i] * numbers[own + i]
                for i in range(m):
                    numbers[own + i] -= product * numbers[q + b * m + i]
        length = norm(numbers, own, m)
        smallest = min(smallest, length)
        for i in range(m):
            numbers[own + i] /= length if length > 0.0 else 1.0
        found += 1
    return 1 if smallest > INDEPENDENT else 0
