"""Impact in flat arrays: rigid contacts strike, or their motion presses them to their stops.

    v+ = v- + A^T p,   p >= least,  A v+ >= wanted, complementary,   A = H^T Phi_l     (Moreau; without restitution: 0)

A contact with friction has a second row, along h_t - v_t, and an impulse along it within mu times its first one.

Where others hang on the structure an impulse A^T p gives it B A^T p, B = F F^T the mobility that they leave it:

    v+ = v- + F z,   z = argmin |z|,  A F z >= wanted - A v-

Source: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, CISM 302 (1988).
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    BY_IMPACT,
    CAUSE,
    CAUSED_BY,
    CHANGE,
    CHANNELS,
    CLOSE,
    ELEMENTS,
    ENTERS,
    FAILED,
    FRICTIONS,
    HELD_LINKS,
    HIGHEST,
    LEADERS,
    LEVEL,
    LOWEST,
    MOBILITY,
    MODES,
    MOVED,
    OK,
    PLACE,
    PUSHING,
    RATIOS,
    REACH,
    ROWS,
    SMALL_PROBLEM,
    SPEED,
    SPEEDS,
    SQUEEZED,
    STATIC_FRICTIONS,
    STOP_WORK,
    UNSETTLED,
    VALUE_SIZES,
    VALUES,
)
from multiphi_exudyn.events.law.impact_round_off import speed_size
from multiphi_exudyn.events.states.energies import kinetic
from multiphi_exudyn.events.states.state_arrays import copy_state, measure
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import EXCLUDED_ROWS, EXCLUDING
from multiphi_exudyn.mathematics.complementarity.principal_pivoting import EXCLUDED, UNDECIDED, pose, solve
from multiphi_exudyn.mathematics.orthonormal import norm, scalar_product
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["IMMOVABLE", "RESTING", "add_friction_rows", "collide", "fill_rows", "least_change"]

RESTING = 1e-12  # relative to its possible size at such velocities: a smaller gap velocity after an impact is zero
IMMOVABLE = 1e-11  # of a contact's mobility: below it attached bodies prevent any motion of the contact


@compiled
def fill_rows(ints: Ints, numbers: Numbers, level: int, contacts: int, count: int, held: int) -> None:
    """Fill ROWS (count + held, n) with gap velocities as functions of xi', the last ``held`` with opposite sign."""
    n = ints[level + MODES] + ints[CHANNELS]
    for k in range(count + held):
        sign = 1.0 if k < count else -1.0
        row, speeds = ints[ROWS] + k * n, ints[level + SPEEDS] + ints[contacts + k] * (n + 1)
        for i in range(n):
            numbers[row + i] = sign * numbers[speeds + i]


@compiled
def add_friction_rows(
    ints: Ints, numbers: Numbers, state: int, contacts: int, count: int, first: int, released: int
) -> int:
    """10. Append rows of tangential velocities of contacts (count,) behind ``first`` rows; return the number of rows.

    The impulse along such a row is limited by that of its contact. released: -1 for an impact. For forces at rest it is
    the state before the impact: a contact that slides after it then has no row, but its normal force brings friction
    with it.
    """
    level, rows, pushing, mu = ints[state + LEVEL], first, ints[PUSHING], ints[FRICTIONS]
    n = ints[level + MODES] + ints[CHANNELS]
    for i in range(first * n if pushing != ints[ROWS] else 0):
        numbers[pushing + i] = numbers[ints[ROWS] + i]
    for k in range(count):
        contact, slips = ints[contacts + k], 0
        tangential = ints[level + SPEEDS] + ints[ints[HELD_LINKS] + contact] * (n + 1)
        ints[ints[ENTERS] + contact] = CLOSE
        if numbers[ints[STATIC_FRICTIONS] + contact] == 0.0:
            continue
        if released >= 0:
            slips = slip_sign(ints, numbers, state, released, tangential)
        if slips != 0:
            ints[ints[ENTERS] + contact] = CLOSE + 1 if slips > 0 else CLOSE + 2
            for i in range(n):
                numbers[pushing + k * n + i] -= slips * numbers[mu + contact] * numbers[tangential + i]
            continue
        for i in range(n):
            numbers[ints[ROWS] + rows * n + i] = numbers[tangential + i]
            numbers[pushing + rows * n + i] = numbers[tangential + i]
        ints[ints[LEADERS] + rows] = k
        numbers[ints[RATIOS] + rows] = numbers[(mu if released < 0 else ints[STATIC_FRICTIONS]) + contact]
        rows += 1
    return rows


@compiled
def slip_sign(ints: Ints, numbers: Numbers, state: int, released: int, row: int) -> int:
    """Return the sign of the velocity along a row after an impact, zero if it is round-off."""
    n, size = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], speed_size(ints, numbers, state, row)
    speed = scalar_product(numbers, row, numbers, ints[state + SPEED], n)
    if abs(speed) <= RESTING * (size + speed_size(ints, numbers, released, row)):
        return 0
    return 1 if speed > 0.0 else -1


@compiled
def least_change(
    ints: Ints,
    numbers: Numbers,
    level: int,
    contacts: int,
    count: int,
    rows: int,
    vector: int,
    sizes: int,
    wanted: int,
    least: int,
    multipliers: int,
) -> int:
    """Solve for the smallest change (r,) of ``vector`` v (n,) with rows v >= wanted; return OK or FAILED.

    multipliers: those of the rows (rows,). sizes: (rows,) terms of rows v besides those of v itself, -1 for none.
    wanted: (count,), -1 for zero. least: lower bounds (count,) of the contacts' multipliers, -1 for zero. The first
    ``count`` rows are those of the contacts, the others those of their friction.
    """
    r = ints[level + MODES]
    n = r + ints[CHANNELS]
    for k in range(rows):
        row, value, terms = ints[ROWS] + k * n, 0.0, 0.0
        for i in range(n):
            value += numbers[row + i] * numbers[vector + i]
            terms += abs(numbers[row + i]) * abs(numbers[vector + i])
        for j in range(count if least >= 0 else 0):
            pushed = numbers[least + j] * scalar_product(numbers, row, numbers, ints[ROWS] + j * n, r)
            value += pushed
            terms += abs(pushed)
        friction_bound = 0.0
        if least >= 0 and k >= count:
            friction_bound = numbers[ints[RATIOS] + k] * numbers[least + ints[ints[LEADERS] + k]]
        numbers[ints[VALUES] + k] = value - numbers[wanted + k] if wanted >= 0 and k < count else value
        numbers[ints[VALUE_SIZES] + k] = terms + (numbers[sizes + k] if sizes >= 0 else 0.0)
        numbers[ints[LOWEST] + k] = -friction_bound
        numbers[ints[HIGHEST] + k] = math.inf if k < count else friction_bound
        ints[ints[LEADERS] + k] = -1 if k < count else ints[ints[LEADERS] + k]
    if ints[level + MOBILITY] >= 0:
        limit_rows(ints, numbers, level, count)
    problem = ints[SMALL_PROBLEM]
    pose(
        ints, problem, rows, r, n, ints[ROWS], ints[PUSHING], ints[VALUES], ints[VALUE_SIZES], ints[LOWEST],
        ints[HIGHEST], ints[LEADERS], ints[RATIOS], ints[CHANGE], multipliers,
    )  # fmt: skip
    outcome = solve(ints, numbers, problem, 0)
    if outcome == EXCLUDED:
        ints[CAUSE] = SQUEEZED
        for i in range(ints[ELEMENTS]):
            ints[ints[CAUSED_BY] + i] = 0
        for k in range(ints[problem + EXCLUDING]):
            row = ints[ints[problem + EXCLUDED_ROWS] + k]
            ints[ints[CAUSED_BY] + ints[contacts + (row if row < count else ints[ints[LEADERS] + row])]] = 1
        return FAILED
    if outcome == UNDECIDED:
        ints[CAUSE] = UNSETTLED
        return FAILED
    for j in range(count if least >= 0 else 0):
        numbers[multipliers + j] += numbers[least + j]
        for i in range(r):
            numbers[ints[CHANGE] + i] += numbers[least + j] * numbers[ints[ROWS] + j * n + i]
    if ints[level + MOBILITY] >= 0:
        limit_change(ints, numbers, level)
    return OK


@compiled
def limit_rows(ints: Ints, numbers: Numbers, level: int, count: int) -> None:
    """Replace rows (count, r) by rows F; a contact that cannot move for attached bodies has no condition."""
    r, limited = ints[level + MODES], ints[CHANGE]
    n = r + ints[CHANNELS]
    for k in range(count):
        row, length, limited_length = ints[ROWS] + k * n, norm(numbers, ints[ROWS] + k * n, r), 0.0
        for j in range(r):
            numbers[limited + j] = 0.0
            for i in range(r):
                numbers[limited + j] += numbers[row + i] * numbers[ints[level + MOBILITY] + i * r + j]
        limited_length = norm(numbers, limited, r)
        held = limited_length * limited_length <= IMMOVABLE * length * length
        for j in range(r):
            numbers[row + j] = 0.0 if held else numbers[limited + j]
        if held:
            numbers[ints[VALUES] + k] = 0.0


@compiled
def limit_change(ints: Ints, numbers: Numbers, level: int) -> None:
    """Replace the change z (r,) by F z."""
    r, z = ints[level + MODES], ints[MOVED]
    for i in range(r):
        numbers[z + i] = numbers[ints[CHANGE] + i]
    for i in range(r):
        numbers[ints[CHANGE] + i] = 0.0
        for j in range(r):
            numbers[ints[CHANGE] + i] += numbers[ints[level + MOBILITY] + i * r + j] * numbers[z + j]


@compiled
def collide(
    ints: Ints,
    numbers: Numbers,
    state: int,
    contacts: int,
    count: int,
    held: int,
    wanted: int,
    least: int,
    result: int,
    impulses: int,
    losses: int,
) -> int:
    """2. Compute Moreau's impact in a level in which the contacts are open, and add its losses; return OK or FAILED.

    held: the number of last contacts that get no velocity away from their stop either. wanted: their lower bounds of
    gap velocities (count + held,), -1 for zero. least: lower bounds of impulses, the same. impulses: (count + held,) [N
    s], those of friction behind them.

    Velocities that the impact has reduced to round-off are set to zero, as the contact would bounce and rock with them
    until they underflow. So are displacements that are round-off, as they would swing and strike again.
    """
    level = ints[state + LEVEL]
    r, channels = ints[level + MODES], ints[CHANNELS]
    n, both, plastic = r + channels, count + held, 0.0
    fill_rows(ints, numbers, level, contacts, count, held)
    rows = add_friction_rows(ints, numbers, state, contacts, count if held == 0 else 0, both, -1)
    if least_change(ints, numbers, level, contacts, both, rows, ints[state + SPEED], -1, wanted, least, impulses) < 0:
        return FAILED
    for k in range(rows if least >= 0 else 0):
        numbers[ints[VALUES] + k] = scalar_product(numbers, ints[ROWS] + k * n, numbers, ints[state + SPEED], n)
    for k in range(both if least < 0 else 0):
        plastic -= 0.5 * numbers[impulses + k] * numbers[ints[VALUES] + k]
        if wanted >= 0:
            plastic -= numbers[impulses + k] * numbers[wanted + k]
    copy_state(ints, numbers, state, result)
    v, before, x, reach = ints[result + SPEED], ints[state + SPEED], ints[result + PLACE], ints[state + REACH]
    for i in range(r):
        numbers[v + i] += numbers[ints[CHANGE] + i]
    for k in range(both if least < 0 else 0, rows):
        after = scalar_product(numbers, ints[ROWS] + k * n, numbers, v, n)
        plastic -= 0.5 * numbers[impulses + k] * (numbers[ints[VALUES] + k] + after)
    stopped = norm(numbers, v, r) <= RESTING * norm(numbers, before, r)
    for i in range(r):
        if stopped or abs(numbers[v + i]) <= RESTING * abs(numbers[before + i]):
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
