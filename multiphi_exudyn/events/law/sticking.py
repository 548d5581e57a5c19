"""Rigid friction elements at rest are decided together, by sentence 12 of the law (decision.py).

    h.x'' = A eta'' = A eta''_0 + A A^T z,   -limit <= f <= limit complementary to h.x'',   f = f_0 + z

f is the force along +h, f_0 that of slip, eta''_0 the acceleration in the level in which all of them slip: those that
stick or turn are at rest relative to their counter-surface. f = -limit: slip+, f = limit: slip-, between: stick. The
limit of a contact that gives way is mu N, a number at an instant: N goes with places and speeds alone. Such contacts
do not slip in that level but are idle, f_0 = 0, and stay so where others stick for them: of two with one pressure the
push of one would be the limit of the other, for as long as they are.
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
from multiphi_exudyn.events.law.changes import NOBODY, is_held, transfer, without_stick
from multiphi_exudyn.events.law.friction_problem import (
    at_limit,
    key_push,
    list_at_rest,
    pose_rows,
    pressure,
    pull,
    sort_by_reserve,
)
from multiphi_exudyn.events.law.impact import RESTING, fill_rows
from multiphi_exudyn.events.law.phases import opening
from multiphi_exudyn.events.law.redundancy import held_links, independent
from multiphi_exudyn.events.law.switching import open_and_enter
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import ABOVE, BELOW, BETWEEN, SIDES, WAITING, product
from multiphi_exudyn.mathematics.complementarity.least_distance import FOLLOWING
from multiphi_exudyn.mathematics.complementarity.principal_pivoting import SOLVED, solve

__all__ = ["stick_together"]


@compiled
def stick_together(ints: Ints, numbers: Numbers, waves: Waves, asking: int) -> int:
    """12. Which rigid friction elements stick, and where the others slip; OK, NEED or FAILED.

    Where any changes they ask no more. Once at an instant, where there are several. A closed rigid contact that would
    pull beside them opens, and they are decided once more without it: also one beside which some fall from their
    static limits, which without it hold.
    """
    count, wishes = list_at_rest(ints, numbers, asking), ints[WISHES]
    if count < 2 or ints[TOGETHER] == 1:
        return OK
    ints[TOGETHER] = 1
    states = ints[ints[WORKED + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        ints[wishes + i] = ints[states + i]
    pulling = 1
    while pulling > 0:
        falling = decide_at_rest(ints, numbers, count, asking)
        status = hold_without(ints, numbers, count, asking) if falling > 0 else falling
        if status < 0:
            return status
        pulling = let_go(ints, numbers)
    changed = 0
    for i in range(ints[ELEMENTS]):
        if ints[wishes + i] == ints[states + i]:
            ints[wishes + i] = NOBODY
        else:
            changed += 1
    if changed == 0:
        return OK
    for i in range(ints[ELEMENTS]):
        opens = ints[wishes + i] == OPEN and ints[ints[KINDS] + i] == RIGID
        ints[asking + i] = NOBODY if opens else ints[asking + i]
    for k in range(count):
        ints[asking + ints[ints[RESTING_LIST] + k]] = NOBODY
    if stand_still(ints, numbers, count) < 0:
        return FAILED
    return open_and_enter(ints, numbers, waves)


@compiled
def decide_at_rest(ints: Ints, numbers: Numbers, count: int, asking: int) -> int:
    """12. WISHES and ENTERED_STATE: what those at rest do beside all that WISHES holds; how many fall, NEED or FAILED.

    They fall from their static limits.
    """
    states, wishes, key = ints[ints[WORKED + LEVEL] + STATES], ints[WISHES], ints[KEY]
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[wishes + i]
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        ints[key + i] = without_stick(ints, i, ints[states + i])
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    sort_by_reserve(ints, numbers, count)
    pull(ints, numbers, count, asking)
    falling, fallen = 1, 0
    while falling > 0:
        if solve(ints, numbers, ints[SMALL_PROBLEM], 1) != SOLVED:
            ints[CAUSE] = UNSETTLED
            return FAILED
        falling = choose(ints, numbers, count, asking)
        fallen += falling
    thin_out_idle(ints, numbers, count)
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[wishes + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    return status if status < 0 else fallen


@compiled
def hold_without(ints: Ints, numbers: Numbers, count: int, asking: int) -> int:
    """12. After some fell: WISHES and ENTERED_STATE without the closed contacts that would be pulled if those stuck.

    Where without these contacts none falls; else as they were. OK, NEED or FAILED.
    """
    c, wishes, before, union, closed = ints[ELEMENTS], ints[WISHES], ints[SINGLES], ints[UNION], 0
    for i in range(c):
        ints[before + i] = ints[wishes + i]
        closed += is_held(ints, ENTERED_STATE, i)
    if closed == 0:
        return OK
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        if numbers[ints[STATIC_LIMITS] + i] > numbers[ints[LIMITS] + i]:
            ints[wishes + i] = ints[ints[STICKS] + i]
    for i in range(c):
        ints[union + i] = held_links(ints, numbers, i, ints[wishes + i])
        ints[ints[KEY] + i] = ints[wishes + i]
    if independent(ints, numbers, union) == 1:
        status = transfer(ints, numbers, WORKED, ints[KEY], ENTERED_STATE)
        if status < 0:
            return status
        if let_go(ints, numbers) > 0:
            falling = decide_at_rest(ints, numbers, count, asking)
            if falling <= 0:
                return falling
    for i in range(c):
        ints[wishes + i] = ints[before + i]
        ints[ints[KEY] + i] = ints[before + i]
    return transfer(ints, numbers, WORKED, ints[KEY], ENTERED_STATE)


@compiled
def let_go(ints: Ints, numbers: Numbers) -> int:
    """3, 12. How many rigid contacts ENTERED_STATE pulls, which are then to open by WISHES."""
    level, pulled = ints[ENTERED_STATE + LEVEL], 0
    for i in range(ints[ELEMENTS]):
        if is_held(ints, ENTERED_STATE, i) == 0:
            continue
        if row_sign(ints, numbers, ENTERED_STATE, opening(ints, level, i) + SIGNAL, 0.0) < 0:
            ints[ints[WISHES] + i] = OPEN
            pulled += 1
    return pulled


@compiled
def stand_still(ints: Ints, numbers: Numbers, count: int) -> int:
    """ENTERED_STATE: those at rest have no speed; what is left of one for round-off would turn them. OK or FAILED.

    Those that stick are held.
    """
    level, v, problem = ints[ENTERED_STATE + LEVEL], ints[ENTERED_STATE + SPEED], ints[SMALL_PROBLEM]
    r, loose = ints[level + MODES], 0
    n = r + ints[CHANNELS]
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        if ints[ints[level + STATES] + i] != ints[ints[STICKS] + i]:
            ints[ints[TOUCHING] + loose] = ints[ints[HELD_LINKS] + i]
            loose += 1
    if loose == 0:
        return OK
    fill_rows(ints, numbers, level, ints[TOUCHING], loose, 0)
    for k in range(loose):
        row, terms = ints[ROWS] + k * n, 0.0
        for j in range(n):
            terms += abs(numbers[row + j]) * (abs(numbers[v + j]) + numbers[ints[ENTERED_STATE + SWING] + j])
        numbers[ints[VALUES] + k] = product(numbers, row, v, n)
        numbers[ints[VALUE_SIZES] + k] = terms
        numbers[ints[LOWEST] + k] = -math.inf
        numbers[ints[HIGHEST] + k] = math.inf
    pose_rows(ints, loose, r, n)
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
def choose(ints: Ints, numbers: Numbers, count: int, asking: int) -> int:
    """12. WISHES: the states of the solution; how many of them begin to slip, and fall from their static limit.

    Those that come from slip fall first: what then does not need more than its static limit goes on sticking. Who asks
    at its static limit, which it would exceed, falls unless others bear more now. Whose bound is its limit slips there,
    whether it has come to it or only to round-off of it.
    """
    states, falling = ints[ints[WORKED + LEVEL] + STATES], 0
    for stuck in range(2):
        for k in range(count):
            i, low, high = ints[ints[RESTING_LIST] + k], ints[LOWEST] + k, ints[HIGHEST] + k
            presses, sticks = pressure(ints, numbers, i), ints[ints[STICKS] + i]
            limit, most = presses * numbers[ints[LIMITS] + i], presses * numbers[ints[STATIC_LIMITS] + i]
            slipped = key_push(ints, i, limit)
            side, entered, asked = ints[ints[ints[SMALL_PROBLEM] + SIDES] + k], sticks, ints[asking + i]
            force = numbers[ints[FURTHER] + k] - slipped
            reached = abs(force) >= (1.0 - FOLLOWING) * most
            if numbers[low] == numbers[high]:
                entered += SLIP_FORWARD if numbers[low] - slipped < 0.0 else SLIP_BACKWARD
            elif side in (BELOW, ABOVE) or (reached and (most <= limit or at_limit(ints, numbers, i, asked) == 1)):
                entered += SLIP_BACKWARD if side == ABOVE or force > 0.0 else SLIP_FORWARD
                now = (ints[states + i] == sticks) == (stuck == 1)
                if now and most > limit and abs(force) > limit:
                    numbers[low] = slipped - limit if entered == sticks + SLIP_FORWARD else slipped + limit
                    numbers[high] = numbers[low]
                    falling += 1
            ints[ints[WISHES] + i] = entered
        if falling > 0:
            break
    return falling


@compiled
def thin_out_idle(ints: Ints, numbers: Numbers, count: int) -> None:
    """12. Of those at rest with exactly their limit, each sticks that does not follow from those that stick already.

    Who can bear more comes first. Who cannot slips where another takes over: only round-off keeps it within its limit.
    """
    union, wishes, sides = ints[UNION], ints[WISHES], ints[ints[SMALL_PROBLEM] + SIDES]
    for i in range(ints[ELEMENTS]):
        ints[union + i] = held_links(ints, numbers, i, ints[wishes + i])
    for k in range(count):
        if ints[sides + k] == WAITING:
            ints[union + ints[ints[RESTING_LIST] + k]] = 0
    for side in (WAITING, BETWEEN):
        for k in range(count):
            i = ints[ints[RESTING_LIST] + k]
            if ints[sides + k] == side and ints[union + i] == 0:
                ints[union + i] = 2
                if independent(ints, numbers, union) == 1:
                    ints[wishes + i] = ints[ints[STICKS] + i]
                else:
                    ints[union + i] = 0
                    ints[wishes + i] = ints[ints[KEY] + i] if side == WAITING else ints[wishes + i]
