"""Rigid contacts at rest right after an impact: which of them stay closed, by sentence 2 of the law (events/law).

STRUCK        the state after the impact, in the level in which all touching contacts are open
STILL, AFTER  the same without negligible speeds, and in the level in which the contacts of CLOSED are closed
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    ACCELERATION_TERMS,
    AFTER,
    CHANGE,
    CHANNELS,
    CLOSE,
    CLOSED,
    COMPLIANT_KEY,
    ELEMENTS,
    ENTERS,
    FAILED,
    FREED,
    FURTHER,
    HELD,
    KEY,
    LEADERS,
    LEVEL,
    LOST_STILLED,
    MATRIX,
    MODES,
    NEED,
    OFFSET,
    OK,
    PLACE,
    RATE_MATRIX,
    REACH,
    REFUSED,
    RELEASED,
    RELEASED_TERMS,
    RESTING_LIST,
    RESTING_SIZES,
    ROW,
    ROWS,
    SIGNAL,
    SMALL_PROBLEM,
    SPEED,
    STILL,
    STRUCK,
    TOUCHING,
    WORKED,
)
from multiphi_exudyn.events.law.bounces import has_rebounded
from multiphi_exudyn.events.law.changes import clear
from multiphi_exudyn.events.law.impact import RESTING, add_friction_rows, collide, fill_rows, least_change
from multiphi_exudyn.events.law.impact_round_off import negligible_speed, resting_size, speed_size
from multiphi_exudyn.events.law.phases import first_exit, opening, phase_of
from multiphi_exudyn.events.law.redundancy import keep_independent
from multiphi_exudyn.events.states.maps import find_level, find_map, move
from multiphi_exudyn.events.states.signals import sign_of
from multiphi_exudyn.events.states.state_arrays import accelerate, acceleration_sizes, copy_state
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import ABOVE, BELOW, SIDES
from multiphi_exudyn.mathematics.orthonormal import norm

__all__ = ["drop_pulled", "find_pressed", "reaction_sign", "same_speed"]


@compiled
def find_pressed(ints: Ints, numbers: Numbers, waves: Waves, count: int) -> int:
    """2. Set CLOSED: contacts at rest relative to their stop that the free motion would close; return how many.

    The free motion is judged by its acceleration, and if that presses none of them by its first derivative that is not
    zero. A contact counts as at rest also if it would be back at its stop, with the contacts at rest held, before its
    gap is more than round-off. NEED or FAILED.
    """
    level, resting, multipliers = ints[STRUCK + LEVEL], ints[RESTING_LIST], ints[FURTHER]
    strict_count = list_resting(ints, numbers, count, 0)
    status = solve_resting_forces(ints, numbers, strict_count)
    rest_count = list_resting(ints, numbers, count, 1) if status == OK else 0
    if rest_count > strict_count:
        status = solve_resting_forces(ints, numbers, rest_count)
    if status < 0:
        return status
    for i in range(ints[ELEMENTS]):
        ints[ints[CLOSED] + i] = 0
    pressed = 0
    for k in range(rest_count):
        if numbers[multipliers + k] > 0.0:
            ints[ints[CLOSED] + ints[resting + k]] = 1
            pressed += 1
    if pressed == 0:
        for k in range(rest_count):
            exit_ = first_exit(ints, level, ints[resting + k])
            if phase_of(ints, numbers, waves, STRUCK, exit_) == REFUSED:
                ints[ints[CLOSED] + ints[resting + k]] = 1
                pressed += 1
    for i in range(ints[ELEMENTS]):
        ints[ints[HELD] + i] = 0
    return keep_independent(ints, numbers, ints[CLOSED]) if pressed > 0 else 0


@compiled
def list_resting(ints: Ints, numbers: Numbers, count: int, unseen: int) -> int:
    """2. List touching contacts at rest relative to their stop after an impact, and return their number.

    unseen: 1 to include contacts whose gap the accelerations close again before it is more than round-off.
    """
    level, rest, v = ints[STRUCK + LEVEL], 0, ints[STRUCK + SPEED]
    n = ints[level + MODES] + ints[CHANNELS]
    fill_rows(ints, numbers, level, ints[TOUCHING], count, 0)
    for k in range(count):
        row, speed = ints[ROWS] + k * n, 0.0
        for i in range(n):
            speed += numbers[row + i] * numbers[v + i]
        size = RESTING * (speed_size(ints, numbers, RELEASED, row) + speed_size(ints, numbers, STRUCK, row))
        if unseen == 1 and has_rebounded(ints, numbers, k) == 0:
            size = max(size, negligible_speed(ints, numbers, STRUCK, ints[ints[TOUCHING] + k], row))
        if abs(speed) <= size:
            ints[ints[RESTING_LIST] + rest] = ints[ints[TOUCHING] + k]
            rest += 1
    return rest


@compiled
def solve_resting_forces(ints: Ints, numbers: Numbers, rest: int) -> int:
    """Solve for the forces (rest,) and accelerations of contacts at rest; return OK, NEED or FAILED."""
    level = ints[STRUCK + LEVEL]
    n = ints[level + MODES] + ints[CHANNELS]
    accelerate(ints, numbers, STRUCK, ints[ACCELERATION])
    if rest == 0:
        return OK
    acceleration_sizes(ints, numbers, STRUCK, ints[ACCELERATION_TERMS])
    acceleration_sizes(ints, numbers, RELEASED, ints[RELEASED_TERMS])
    fill_rows(ints, numbers, level, ints[RESTING_LIST], rest, 0)
    rows = add_friction_rows(ints, numbers, STRUCK, ints[RESTING_LIST], rest, rest, RELEASED)
    for k in range(rows):
        size = resting_size(numbers, ints[ACCELERATION_TERMS], ints[RELEASED_TERMS], ints[ROWS] + k * n, n)
        numbers[ints[RESTING_SIZES] + k] = size
    sizes, forces, resting = ints[RESTING_SIZES], ints[FURTHER], ints[RESTING_LIST]
    if least_change(ints, numbers, level, resting, rest, rows, ints[ACCELERATION], sizes, -1, -1, forces) < 0:
        return sliding_level(ints, rest)
    for k in range(rest, rows):
        side, leader = ints[ints[ints[SMALL_PROBLEM] + SIDES] + k], ints[ints[LEADERS] + k]
        if numbers[forces + leader] > 0.0 and side in (BELOW, ABOVE):
            ints[ints[ENTERS] + ints[ints[RESTING_LIST] + leader]] = CLOSE + 1 if side == BELOW else CLOSE + 2
    for i in range(ints[level + MODES]):
        numbers[ints[ACCELERATION] + i] += numbers[ints[CHANGE] + i]
    return OK


@compiled
def sliding_level(ints: Ints, rest: int) -> int:
    """10. Return NEED if the level with sliding contacts, whose forces are indeterminate, is missing; else FAILED.

    If its motion is indeterminate too, it is refused when it is built (levels/level/sliding.py).
    """
    for i in range(ints[ELEMENTS]):
        ints[ints[KEY] + i] = ints[ints[COMPLIANT_KEY] + i]
    for k in range(rest):
        i = ints[ints[RESTING_LIST] + k]
        if ints[ints[ENTERS] + i] > CLOSE:
            ints[ints[KEY] + i] = ints[ints[ENTERS] + i]
    return NEED if find_level(ints, ints[KEY]) < 0 else FAILED


@compiled
def drop_pulled(ints: Ints, numbers: Numbers, count: int, same: int) -> int:
    """2. Remove from CLOSED the contacts that would pull in its level; return their number, NEED or FAILED.

    AFTER becomes the state in that level: its displacement comes from the level before the impact, its velocity from
    STILL.
    """
    status = remove_negligible_speeds(ints, numbers, count)
    if status < 0:
        return status
    key, closed, pulled = ints[KEY], ints[CLOSED], 0
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[ints[ENTERS] + i] if ints[closed + i] == 1 else ints[ints[COMPLIANT_KEY] + i]
    level = find_level(ints, key)
    if level < 0:
        return level
    status = move(ints, numbers, WORKED, STILL, level, AFTER)
    if status < 0:
        return status
    for i in range(ints[ELEMENTS]):
        if ints[closed + i] == 1:
            sign = reaction_sign(ints, numbers, WORKED, STILL, level, i)
            if sign <= NEED:
                return sign
            freed = ints[ints[FREED] + i]
            if sign < freed or (freed == 1 and same == 1 and level == ints[WORKED + LEVEL]):
                pulled += 1
                ints[closed + i] = 2
    for i in range(ints[ELEMENTS]):
        ints[closed + i] = 1 if ints[closed + i] == 1 else 0
    return pulled


@compiled
def remove_negligible_speeds(ints: Ints, numbers: Numbers, count: int) -> int:
    """Set STILL: after an impact, contacts that stay closed lose negligible speeds, and give them to no other contact.

    FURTHER holds the impulses (count,) on the touching contacts. OK or FAILED.
    """
    level, touching, held, moving = ints[STRUCK + LEVEL], ints[TOUCHING], 0, 0
    n, v = ints[level + MODES] + ints[CHANNELS], ints[STRUCK + SPEED]
    for i in range(ints[ELEMENTS]):
        if ints[ints[CLOSED] + i] == 1:
            ints[touching + count + held] = i
            held += 1
    clear(numbers, LOST_STILLED)
    fill_rows(ints, numbers, level, touching + count, held, 0)
    for k in range(held):
        row, speed = ints[ROWS] + k * n, 0.0
        for i in range(n):
            speed += numbers[row + i] * numbers[v + i]
        if not abs(speed) <= RESTING * speed_size(ints, numbers, STRUCK, row):
            moving = 1
    for k in range(count):
        numbers[ints[FURTHER] + k] = 0.0
    if moving == 0:
        copy_state(ints, numbers, STRUCK, STILL)
        return OK
    status = collide(ints, numbers, STRUCK, touching, count, held, -1, -1, STILL, ints[FURTHER], LOST_STILLED)
    if status < 0:
        return status
    for h in range(held):
        for k in range(count):
            if ints[touching + k] == ints[touching + count + h]:
                numbers[ints[FURTHER] + k] -= numbers[ints[FURTHER] + count + h]
    return OK


@compiled
def reaction_sign(ints: Ints, numbers: Numbers, places: int, speeds: int, level: int, contact: int) -> int:
    """Return the sign of a contact's reaction in a level, zero if it is round-off of the mapped terms; or NEED.

    xi is that of the state ``places``, xi' that of ``speeds``. This is the same function as the signal in the level
    that a refused contact would enter alone: so the contact requests its change at the root of the function that
    decides on it.
    """
    row, n = ints[opening(ints, level, contact) + SIGNAL + ROW], ints[level + MODES] + ints[CHANNELS]
    x_map, v_map = find_map(ints, ints[places + LEVEL], level), find_map(ints, ints[speeds + LEVEL], level)
    if x_map < 0 or v_map < 0:
        return min(x_map, v_map)
    value, size = numbers[row + 2 * n], abs(numbers[row + 2 * n])
    for i in range(n):
        term = numbers[row + i] * numbers[ints[x_map + OFFSET] + i]
        value += term
        size += abs(term)
    width = ints[ints[places + LEVEL] + MODES] + ints[CHANNELS]
    for j in range(width):
        factor, terms = 0.0, 0.0
        for i in range(n):
            term = numbers[row + i] * numbers[ints[x_map + MATRIX] + i * width + j]
            factor += term
            terms += abs(term)
        value += factor * numbers[ints[places + PLACE] + j]
        size += terms * abs(numbers[ints[places + PLACE] + j])
    width = ints[ints[speeds + LEVEL] + MODES] + ints[CHANNELS]
    for j in range(width):
        factor, terms, reached = 0.0, 0.0, 0.0
        for i in range(n):
            term = numbers[row + n + i] * numbers[ints[v_map + RATE_MATRIX] + i * width + j]
            factor += term
            terms += abs(term)
            reached += abs(numbers[row + i] * numbers[ints[v_map + MATRIX] + i * width + j])
        value += factor * numbers[ints[speeds + SPEED] + j]
        size += terms * abs(numbers[ints[speeds + SPEED] + j]) + reached * numbers[ints[speeds + REACH] + j]
    return sign_of(value, size)


@compiled
def same_speed(ints: Ints, numbers: Numbers, before: int, after: int) -> int:
    """Return 1 if an impact has changed no velocity by more than round-off."""
    r, changed = ints[ints[before + LEVEL] + MODES], 0.0
    for i in range(r):
        difference = numbers[ints[after + SPEED] + i] - numbers[ints[before + SPEED] + i]
        changed += difference * difference
    return 1 if math.sqrt(changed) <= RESTING * norm(numbers, ints[before + SPEED], r) else 0
