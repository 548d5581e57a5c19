"""Round-off of velocities and accelerations, where an impact or contact at rest is decided (sentence 9)."""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    CHANNELS,
    GAPS,
    LEVEL,
    MODES,
    PLACE,
    SPEED,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.orthonormal import norm
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["negligible_speed", "resting_size", "speed_size"]


@compiled
def speed_size(ints: Ints, numbers: Numbers, state: int, row: int) -> float:
    """Return the size of a gap velocity at the velocities of a state, whose directions an impact mixes."""
    r, q, v = ints[ints[state + LEVEL] + MODES], ints[CHANNELS], ints[state + SPEED]
    prescribed = 0.0
    for k in range(r, r + q):
        prescribed += abs(numbers[row + k]) * abs(numbers[v + k])
    return norm(numbers, row, r) * norm(numbers, v, r) + prescribed


@compiled
def negligible_speed(ints: Ints, numbers: Numbers, state: int, contact: int, row: int) -> float:
    """Return the largest gap velocity that the free motion reverses before the gap is more than round-off of its terms.

    ACCELERATION must hold xi'' of the state.
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
    """Return the sum of the terms of a gap's acceleration, with the larger of two states' sizes (n,)."""
    total = 0.0
    for i in range(n):
        total += abs(numbers[row + i]) * max(numbers[one + i], numbers[other + i])
    return total
