"""Signals of a state, and gaps: s = row . (xi, xi', 1), and its sign.

A sum is judged by the sizes of its own terms (round_off.py), to which the scales of the state belong (state_arrays.py).
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    ACCELERATION_TERMS,
    CHANNELS,
    GAPS,
    LEVEL,
    MAPPED,
    MAPPED_SPEED,
    MODES,
    PLACE,
    PRESCRIBED,
    RATED,
    REACH,
    ROW,
    SPEED,
    SWING,
)
from multiphi_exudyn.events.states.state_arrays import accelerate, acceleration_sizes
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["gap", "held_part", "held_size", "mapped_size", "rate_sign", "row_sign", "sign_of"]


@compiled
def sign_of(value: float, size: float) -> int:
    """Return the sign of a sum, zero if it is round-off of its terms, whose absolute values add up to ``size``."""
    if abs(value) <= ZERO * size:
        return 0
    return 1 if value > 0.0 else -1


@compiled
def row_sign(ints: Ints, numbers: Numbers, state: int, signal: int, terms: float) -> int:
    """9. Return the sign of a signal, zero if it is round-off of its terms.

    The parts of a mode's displacement and of its velocity may cancel, as at the root of a damper's force, so each
    counts by itself. At the root of a signal all displacements, or velocities, may be round-off of their earlier
    values: |eta'| / omega and omega |eta| count too. terms: the size of further terms of the signal.
    """
    n, row = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW]
    x, v, reach, swing = ints[state + PLACE], ints[state + SPEED], ints[state + REACH], ints[state + SWING]
    rated, value = ints[signal + RATED] == 1, numbers[row + 2 * n]
    size = abs(value) + terms
    for i in range(n):
        displaced = numbers[row + i] * numbers[x + i]
        value += displaced
        size += abs(displaced) + abs(numbers[row + i]) * numbers[reach + i]
        if rated:
            damped = numbers[row + n + i] * numbers[v + i]
            value += damped
            size += abs(damped) + abs(numbers[row + n + i]) * numbers[swing + i]
    return sign_of(value, size)


@compiled
def mapped_size(ints: Ints, numbers: Numbers, state: int, signal: int, rate: int) -> float:
    """Return the size of the terms of a signal, or of its rate, in the map that has made a state, else zero.

    The displacements and velocities of two levels may be large where a gap or a contact force is small.
    """
    r, row, size = ints[ints[state + LEVEL] + MODES], ints[signal + ROW], 0.0
    mapped, mapped_speed = ints[state + MAPPED], ints[state + MAPPED_SPEED]
    if rate == 1:
        mapped = mapped_speed
    for i in range(r):
        size += abs(numbers[row + i]) * numbers[mapped + i]
    if rate == 0 and ints[signal + RATED] == 1:
        row += r + ints[CHANNELS]
        for i in range(r):
            size += abs(numbers[row + i]) * numbers[mapped_speed + i]
    return size


@compiled
def rate_sign(ints: Ints, numbers: Numbers, state: int, signal: int) -> int:
    """9. Return the sign of a signal's time derivative, zero if it is round-off of its terms.

    At a turning point all velocities may be round-off of their earlier values: omega |eta| counts too, and so do the
    terms of the map that has made the state. If the signal depends on velocities, the terms of the accelerations count,
    as they may cancel.
    """
    n, row = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW]
    v, swing, accelerations, terms = (
        ints[state + SPEED],
        ints[state + SWING],
        ints[ACCELERATION],
        ints[ACCELERATION_TERMS],
    )
    rated = ints[signal + RATED] == 1
    if rated:
        accelerate(ints, numbers, state, accelerations)
        acceleration_sizes(ints, numbers, state, terms)
    value, size = 0.0, mapped_size(ints, numbers, state, signal, 1)
    for i in range(n):
        moved = numbers[row + i] * numbers[v + i]
        value += moved
        size += abs(moved) + abs(numbers[row + i]) * numbers[swing + i]
        if rated:
            value += numbers[row + n + i] * numbers[accelerations + i]
            size += abs(numbers[row + n + i]) * numbers[terms + i]
    return sign_of(value, size)


@compiled
def held_part(ints: Ints, numbers: Numbers, state: int, signal: int) -> float:
    """Return the part of a signal due to held channels, constant until the next transition."""
    held = ints[CHANNELS] - ints[PRESCRIBED]
    first, total = ints[ints[state + LEVEL] + MODES] + ints[PRESCRIBED], 0.0
    for k in range(first, first + held):
        total += numbers[ints[signal + ROW] + k] * numbers[ints[state + PLACE] + k]
    return total


@compiled
def held_size(ints: Ints, numbers: Numbers, state: int, signal: int) -> float:
    """Return the size of the terms of that part."""
    held = ints[CHANNELS] - ints[PRESCRIBED]
    first, total = ints[ints[state + LEVEL] + MODES] + ints[PRESCRIBED], 0.0
    for k in range(first, first + held):
        total += abs(numbers[ints[signal + ROW] + k] * numbers[ints[state + PLACE] + k])
    return total


@compiled
def gap(ints: Ints, numbers: Numbers, state: int, element: int) -> float:
    """Return the gap of a contact [m]."""
    level, x = ints[state + LEVEL], ints[state + PLACE]
    n = ints[level + MODES] + ints[CHANNELS]
    row = ints[level + GAPS] + element * (n + 1)
    value = numbers[row + n]
    for i in range(n):
        value += numbers[row + i] * numbers[x + i]
    return value
