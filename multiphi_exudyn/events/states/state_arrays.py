"""States in flat arrays (arrays.py): their copies, scales and accelerations.

    eta'' = motion . (xi, xi', 1)                                                     (38.3)

The scales of a state are the displacements that its velocities lead to, |eta'| / omega, and the velocities that its
displacements lead to, omega |eta|. The round-off of a motion is relative to them. At the instant of a transition the
terms of the map count as well.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    CHANNELS,
    DRIVE,
    EXIT_COUNT,
    FREQUENCIES,
    LEVEL,
    MAPPED,
    MAPPED_SPEED,
    MODES,
    MOTION,
    PERIODS,
    PHASES,
    PLACE,
    PRESCRIBED,
    REACH,
    SETTLED,
    SPEED,
    SWING,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = [
    "accelerate",
    "acceleration_sizes",
    "clear_turning_speeds",
    "copy_state",
    "keep_scales",
    "measure",
    "same_level",
]


@compiled
def copy_state(ints: Ints, numbers: Numbers, given: int, result: int) -> None:
    """Copy a state, phases included."""
    ints[result + LEVEL] = ints[given + LEVEL]
    ints[result + SETTLED] = ints[given + SETTLED]
    for part in range(PLACE, SWING + 1):
        original, copy = ints[given + part], ints[result + part]
        for i in range(ints[ints[given + LEVEL] + MODES] + ints[CHANNELS]):
            numbers[copy + i] = numbers[original + i]
    for i in range(ints[ints[given + LEVEL] + EXIT_COUNT]):
        ints[ints[result + PHASES] + i] = ints[ints[given + PHASES] + i]


@compiled
def same_level(ints: Ints, one: int, other: int) -> int:
    """Return 1 if two states are of the same level."""
    return 1 if ints[one + LEVEL] == ints[other + LEVEL] else 0


@compiled
def measure(ints: Ints, numbers: Numbers, state: int) -> None:
    """Compute the scales of a state: |eta'| / omega, omega |eta|, and for channels the sizes of w and w'."""
    level, x, v = ints[state + LEVEL], ints[state + PLACE], ints[state + SPEED]
    r, q, reach, swing = ints[level + MODES], ints[PRESCRIBED], ints[state + REACH], ints[state + SWING]
    for i in range(r):
        numbers[reach + i] = abs(numbers[v + i]) * numbers[ints[level + PERIODS] + i]
        numbers[swing + i] = abs(numbers[x + i]) * numbers[ints[level + FREQUENCIES] + i]
    sizes = ints[DRIVE] + 3 * q
    for i in range(r + ints[CHANNELS]):
        numbers[ints[state + MAPPED] + i] = 0.0
        numbers[ints[state + MAPPED_SPEED] + i] = 0.0
    for k in range(ints[CHANNELS]):
        numbers[reach + r + k] = numbers[sizes + k] if k < q else 0.0
        numbers[swing + r + k] = numbers[sizes + q + k] if k < q else 0.0


@compiled
def keep_scales(ints: Ints, numbers: Numbers, earlier: int, state: int) -> None:
    """Give a state of the same level and instant the scales of an earlier one where they are larger."""
    for part in range(REACH, SWING + 1):
        scale, own = ints[earlier + part], ints[state + part]
        for i in range(ints[ints[state + LEVEL] + MODES]):
            numbers[own + i] = max(numbers[own + i], numbers[scale + i])


@compiled
def clear_turning_speeds(ints: Ints, numbers: Numbers, state: int) -> None:
    """Set modal velocities of a state to zero if they are round-off of omega |eta|.

    A mode at its turning point would strike with them, on one processor and not on another.
    """
    v, swing = ints[state + SPEED], ints[state + SWING]
    for i in range(ints[ints[state + LEVEL] + MODES]):
        if abs(numbers[v + i]) <= ZERO * numbers[swing + i]:
            numbers[v + i] = 0.0


@compiled
def accelerate(ints: Ints, numbers: Numbers, state: int, result: int) -> None:
    """Compute xi'' (n,)."""
    level, x, v = ints[state + LEVEL], ints[state + PLACE], ints[state + SPEED]
    r, q = ints[level + MODES], ints[CHANNELS]
    n = r + q
    row = ints[level + MOTION]
    for i in range(r):
        total = numbers[row + 2 * n]
        for j in range(n):
            total += numbers[row + j] * numbers[x + j] + numbers[row + n + j] * numbers[v + j]
        numbers[result + i] = total
        row += 2 * n + 1
    for k in range(q):
        numbers[result + r + k] = numbers[ints[DRIVE] + 2 * ints[PRESCRIBED] + k] if k < ints[PRESCRIBED] else 0.0


@compiled
def acceleration_sizes(ints: Ints, numbers: Numbers, state: int, result: int) -> None:
    """Compute the sizes (n,) of the terms of the accelerations, and omega |eta'|, which the velocities lead to.

    Displacements and velocities count with the terms of the map that has made them.
    """
    level, x, v = ints[state + LEVEL], ints[state + PLACE], ints[state + SPEED]
    mapped, mapped_speed = ints[state + MAPPED], ints[state + MAPPED_SPEED]
    r, q, sizes = ints[level + MODES], ints[PRESCRIBED], ints[DRIVE] + 3 * ints[PRESCRIBED]
    n = r + ints[CHANNELS]
    row = ints[level + MOTION]
    for i in range(r):
        total = abs(numbers[row + 2 * n]) + numbers[ints[level + FREQUENCIES] + i] * abs(numbers[v + i])
        for j in range(r):
            total += abs(numbers[row + j]) * max(abs(numbers[x + j]), numbers[mapped + j])
            total += abs(numbers[row + n + j]) * max(abs(numbers[v + j]), numbers[mapped_speed + j])
        for k in range(q):
            total += abs(numbers[row + r + k]) * numbers[sizes + k]
            total += abs(numbers[row + n + r + k]) * numbers[sizes + q + k]
        numbers[result + i] = total
        row += 2 * n + 1
    for k in range(n - r):
        numbers[result + r + k] = numbers[sizes + 2 * q + k] if k < q else 0.0
