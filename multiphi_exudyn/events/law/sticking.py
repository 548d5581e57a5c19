"""Rigid friction elements at rest are decided together, by sentence 12 of the law (events/law).

    h.x'' = A eta'' = A eta''_0 + A A^T z,   -limit <= f <= limit complementary to h.x'',   f = f_0 + z

f is the force along +h, f_0 that of slip, and eta''_0 the acceleration in the level in which all of these elements
slip: those that stick, or reverse their slip, have no velocity relative to their counter-surface. f = -limit means
slip+, f = limit slip-, and a force between them stick.

At a contact that is not rigid the limit is mu N, a number at an instant, as N depends on displacements and velocities
only. In that level such friction does not slip but is idle, f_0 = 0, and stays idle if other elements stick for it: of
two with one normal force, the force of one would otherwise be the limit of the other.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    CAUSE,
    CHANGE,
    CHANNELS,
    ELEMENTS,
    ENTERED_STATE,
    FAILED,
    FURTHER,
    HELD_LINKS,
    HIGHEST,
    KEY,
    KINDS,
    LEVEL,
    LIMITS,
    LOWEST,
    MODES,
    OK,
    OPEN,
    RESTING_LIST,
    RIGID,
    ROWS,
    SIGNAL,
    SINGLES,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SMALL_PROBLEM,
    SPEED,
    SPEEDS_CHANGED,
    STATES,
    STATIC_LIMITS,
    STICKS,
    SWING,
    TOGETHER,
    TOUCHING,
    UNION,
    UNSETTLED,
    VALUE_SIZES,
    VALUES,
    WISHES,
    WORKED,
)
from multiphi_exudyn.events.law.changes import NO_REQUEST, is_closed_rigid, state_without_stick, transfer
from multiphi_exudyn.events.law.friction_problem import (
    at_limit,
    list_at_rest,
    pose_friction_problem,
    pose_rows,
    pressure,
    slip_force,
    sort_by_reserve,
)
from multiphi_exudyn.events.law.impact import RESTING, fill_rows
from multiphi_exudyn.events.law.phases import opening
from multiphi_exudyn.events.law.redundancy import are_independent, held_links
from multiphi_exudyn.events.law.switching import open_and_enter
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import ABOVE, BELOW, SIDES, WAITING
from multiphi_exudyn.mathematics.complementarity.principal_pivoting import SOLVED, solve
from multiphi_exudyn.mathematics.complementarity.row_sides import free_balanced_rows
from multiphi_exudyn.mathematics.orthonormal import scalar_product
from multiphi_exudyn.mathematics.round_off import FOLLOWING

__all__ = ["stick_together"]


@compiled
def stick_together(ints: Ints, numbers: Numbers, waves: Waves, requests: int) -> int:
    """12. Decide together which rigid friction elements stick and how the others slip; return OK, NEED or FAILED.

    This is done once at an instant, and only if several are at rest. If any of them changes, their requests are
    removed. A closed rigid contact that would pull beside them opens, and the decision is repeated without it. The same
    holds for a contact that would pull if elements stuck which now fall from their static limits, if all of these stick
    without it.
    """
    count, targets = list_at_rest(ints, numbers, requests), ints[WISHES]
    if count < 2 or ints[TOGETHER] == 1:
        return OK
    ints[TOGETHER] = 1
    states = ints[ints[WORKED + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        ints[targets + i] = ints[states + i]
    pulling = 1
    while pulling > 0:
        falling = decide_at_rest(ints, numbers, count, requests)
        status = retry_without_pulled(ints, numbers, count, requests) if falling > 0 else falling
        if status < 0:
            return status
        pulling = open_pulled(ints, numbers)
    changed = 0
    for i in range(ints[ELEMENTS]):
        if ints[targets + i] == ints[states + i]:
            ints[targets + i] = NO_REQUEST
        else:
            changed += 1
    if changed == 0:
        return OK
    for i in range(ints[ELEMENTS]):
        opens = ints[targets + i] == OPEN and ints[ints[KINDS] + i] == RIGID
        ints[requests + i] = NO_REQUEST if opens else ints[requests + i]
    for k in range(count):
        ints[requests + ints[ints[RESTING_LIST] + k]] = NO_REQUEST
    if zero_resting_speeds(ints, numbers, count) < 0:
        return FAILED
    return open_and_enter(ints, numbers, waves)


@compiled
def decide_at_rest(ints: Ints, numbers: Numbers, count: int, requests: int) -> int:
    """12. Decide the elements at rest beside the states in WISHES; return how many fall to slip, NEED or FAILED.

    WISHES becomes their states and ENTERED_STATE the state in that level. An element falls from its static limit.
    """
    states, targets, key = ints[ints[WORKED + LEVEL] + STATES], ints[WISHES], ints[KEY]
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[targets + i]
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        ints[key + i] = state_without_stick(ints, i, ints[states + i])
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    sort_by_reserve(ints, numbers, count)
    pose_friction_problem(ints, numbers, count, requests)
    falling, fallen = 1, 0
    while falling > 0:
        if solve(ints, numbers, ints[SMALL_PROBLEM], 1) != SOLVED:
            ints[CAUSE] = UNSETTLED
            return FAILED
        free_balanced_rows(ints, numbers, ints[SMALL_PROBLEM])
        falling = choose_states(ints, numbers, count, requests)
        fallen += falling
    stick_independent_set(ints, numbers, count)
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[targets + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    return status if status < 0 else fallen


@compiled
def retry_without_pulled(ints: Ints, numbers: Numbers, count: int, requests: int) -> int:
    """12. Try without the closed contacts that would pull if the fallen elements stuck; return OK, NEED or FAILED.

    If no element falls without these contacts, WISHES and ENTERED_STATE become that decision; else they are restored.
    """
    c, targets, before, union, closed = ints[ELEMENTS], ints[WISHES], ints[SINGLES], ints[UNION], 0
    for i in range(c):
        ints[before + i] = ints[targets + i]
        closed += is_closed_rigid(ints, ENTERED_STATE, i)
    if closed == 0:
        return OK
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        if numbers[ints[STATIC_LIMITS] + i] > numbers[ints[LIMITS] + i]:
            ints[targets + i] = ints[ints[STICKS] + i]
    for i in range(c):
        ints[union + i] = held_links(ints, numbers, i, ints[targets + i])
        ints[ints[KEY] + i] = ints[targets + i]
    if are_independent(ints, numbers, union) == 1:
        status = transfer(ints, numbers, WORKED, ints[KEY], ENTERED_STATE)
        if status < 0:
            return status
        if open_pulled(ints, numbers) > 0:
            falling = decide_at_rest(ints, numbers, count, requests)
            if falling <= 0:
                return falling
    for i in range(c):
        ints[targets + i] = ints[before + i]
        ints[ints[KEY] + i] = ints[before + i]
    return transfer(ints, numbers, WORKED, ints[KEY], ENTERED_STATE)


@compiled
def open_pulled(ints: Ints, numbers: Numbers) -> int:
    """3, 12. Set the target state OPEN for rigid contacts that ENTERED_STATE pulls, and return their number."""
    level, pulled = ints[ENTERED_STATE + LEVEL], 0
    for i in range(ints[ELEMENTS]):
        if is_closed_rigid(ints, ENTERED_STATE, i) == 0:
            continue
        if row_sign(ints, numbers, ENTERED_STATE, opening(ints, level, i) + SIGNAL, 0.0) < 0:
            ints[ints[WISHES] + i] = OPEN
            pulled += 1
    return pulled


@compiled
def zero_resting_speeds(ints: Ints, numbers: Numbers, count: int) -> int:
    """Remove the slip velocities of elements at rest from ENTERED_STATE; return OK or FAILED.

    They are round-off, and would turn the direction of slip. Elements that stick have none.
    """
    level, v, problem = ints[ENTERED_STATE + LEVEL], ints[ENTERED_STATE + SPEED], ints[SMALL_PROBLEM]
    r, slipping = ints[level + MODES], 0
    n = r + ints[CHANNELS]
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        if ints[ints[level + STATES] + i] != ints[ints[STICKS] + i]:
            ints[ints[TOUCHING] + slipping] = ints[ints[HELD_LINKS] + i]
            slipping += 1
    if slipping == 0:
        return OK
    fill_rows(ints, numbers, level, ints[TOUCHING], slipping, 0)
    for k in range(slipping):
        row, terms = ints[ROWS] + k * n, 0.0
        for j in range(n):
            terms += abs(numbers[row + j]) * (abs(numbers[v + j]) + numbers[ints[ENTERED_STATE + SWING] + j])
        numbers[ints[VALUES] + k] = scalar_product(numbers, row, numbers, v, n)
        numbers[ints[VALUE_SIZES] + k] = terms
        numbers[ints[LOWEST] + k] = -math.inf
        numbers[ints[HIGHEST] + k] = math.inf
    pose_rows(ints, slipping, r, n)
    if solve(ints, numbers, problem, 0) != SOLVED:
        ints[CAUSE] = UNSETTLED
        return FAILED
    ints[SPEEDS_CHANGED] = 1
    for i in range(r):
        before = abs(numbers[v + i])
        numbers[v + i] += numbers[ints[CHANGE] + i]
        numbers[v + i] = 0.0 if abs(numbers[v + i]) <= RESTING * before else numbers[v + i]
    return OK


@compiled
def choose_states(ints: Ints, numbers: Numbers, count: int, requests: int) -> int:
    """12. Set WISHES to the states of the solution, and return how many elements fall from their static limit.

    Elements that come from slip fall first: the others may then need no more than their static limit, and go on
    sticking. An element that requests slip at its static limit, with a force that would exceed it, falls unless others
    now bear more. An element whose bound is its limit slips there, also if its force is within round-off of the limit.
    One that needs just a larger static limit, to round-off, sticks: that limit still holds it, and if not for long, it
    falls by itself.
    """
    states, falling = ints[ints[WORKED + LEVEL] + STATES], 0
    for stuck in range(2):
        for k in range(count):
            i, low, high = ints[ints[RESTING_LIST] + k], ints[LOWEST] + k, ints[HIGHEST] + k
            normal, sticks = pressure(ints, numbers, i), ints[ints[STICKS] + i]
            limit, most = normal * numbers[ints[LIMITS] + i], normal * numbers[ints[STATIC_LIMITS] + i]
            force_of_slip = slip_force(ints, i, limit)
            side, entered, requested = ints[ints[ints[SMALL_PROBLEM] + SIDES] + k], sticks, ints[requests + i]
            force = numbers[ints[FURTHER] + k] - force_of_slip
            reached = abs(force) >= (1.0 - FOLLOWING) * most
            if numbers[low] == numbers[high]:
                entered += SLIP_FORWARD if numbers[low] - force_of_slip < 0.0 else SLIP_BACKWARD
            elif side in (BELOW, ABOVE) or (reached and (most <= limit or at_limit(ints, numbers, i, requested) == 1)):
                entered += SLIP_BACKWARD if side == ABOVE or force > 0.0 else SLIP_FORWARD
                falls_first = (ints[states + i] == sticks) == (stuck == 1)
                if falls_first and most > limit and abs(force) > limit:
                    numbers[low] = force_of_slip - limit if entered == sticks + SLIP_FORWARD else force_of_slip + limit
                    numbers[high] = numbers[low]
                    falling += 1
            ints[ints[WISHES] + i] = entered
        if falling > 0:
            break
    return falling


@compiled
def stick_independent_set(ints: Ints, numbers: Numbers, count: int) -> None:
    """12. Let elements at rest without an added force stick, as long as the sticking directions are independent.

    They have a larger static limit, or are idle. An element that bears just its limit, to round-off, and can bear no
    more keeps slipping: it would stick only to slip at the same instant.
    """
    union, targets, sides = ints[UNION], ints[WISHES], ints[ints[SMALL_PROBLEM] + SIDES]
    for i in range(ints[ELEMENTS]):
        ints[union + i] = held_links(ints, numbers, i, ints[targets + i])
    for k in range(count):
        if ints[sides + k] == WAITING:
            ints[union + ints[ints[RESTING_LIST] + k]] = 0
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        if ints[sides + k] == WAITING:
            ints[union + i] = 2
            if are_independent(ints, numbers, union) == 1:
                ints[targets + i] = ints[ints[STICKS] + i]
            else:
                ints[union + i] = 0
                ints[targets + i] = ints[ints[KEY] + i]
