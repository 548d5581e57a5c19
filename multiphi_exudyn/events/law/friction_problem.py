"""Who is at rest, and the small problem of what pulls them and what friction may bear (sentence 12)."""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    ACCELERATION_TERMS,
    CHANGE,
    CHANNELS,
    COMPLIANT,
    ELEMENTS,
    ENTERED_STATE,
    EXIT_INTS,
    FURTHER,
    HELD_LINKS,
    HIGHEST,
    IDLE,
    KEY,
    KINDS,
    LEADERS,
    LEVEL,
    LIMITS,
    LOWEST,
    MODES,
    OPEN,
    PLACE,
    RATIOS,
    RESTING_LIST,
    ROW,
    ROWS,
    SIGNAL,
    SLIDING,
    SLIP_FORWARD,
    SMALL_PROBLEM,
    SPEED,
    SPEEDS,
    STATES,
    STATIC_LIMITS,
    STICKS,
    STIFFNESSES,
    TOUCHING,
    VALUE_SIZES,
    VALUES,
    WORKED,
)
from multiphi_exudyn.events.law.changes import NOBODY
from multiphi_exudyn.events.law.impact import fill_rows
from multiphi_exudyn.events.law.impact_round_off import resting_size
from multiphi_exudyn.events.law.phases import first_exit, opening
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.events.states.state_arrays import accelerate, acceleration_sizes
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import norm, product
from multiphi_exudyn.mathematics.complementarity.principal_pivoting import pose

__all__ = ["at_limit", "key_push", "list_at_rest", "pose_rows", "pressure", "pull", "sort_by_reserve"]


@compiled
def pose_rows(ints: Ints, count: int, r: int, n: int) -> None:
    """The small problem of ROWS (count, n), with r unknowns."""
    for k in range(count):
        ints[ints[LEADERS] + k] = -1
    pose(
        ints, ints[SMALL_PROBLEM], count, r, n, ints[ROWS], ints[ROWS], ints[VALUES], ints[VALUE_SIZES],
        ints[LOWEST], ints[HIGHEST], ints[LEADERS], ints[RATIOS], ints[CHANGE], ints[FURTHER],
    )  # fmt: skip


@compiled
def list_at_rest(ints: Ints, numbers: Numbers, asking: int) -> int:
    """How many rigid friction elements stick, or ask, or have no speed, where one asks; which: the resting list.

    Their links are those that touch.
    """
    states, count, asks = ints[ints[WORKED + LEVEL] + STATES], 0, 0
    for i in range(ints[ELEMENTS]):
        asked = ints[asking + i]
        if numbers[ints[LIMITS] + i] > 0.0 and pressure(ints, numbers, i) > 0.0:
            signal = first_exit(ints, ints[WORKED + LEVEL], i) + SIGNAL
            rests = ints[states + i] == ints[ints[STICKS] + i] or asked != NOBODY
            if rests or row_sign(ints, numbers, WORKED, signal, 0.0) == 0:
                ints[ints[RESTING_LIST] + count] = i
                ints[ints[TOUCHING] + count] = ints[ints[HELD_LINKS] + i]
                count += 1
                asks += 1 if asked != NOBODY else 0
    return count if asks > 0 else 0


@compiled
def sort_by_reserve(ints: Ints, numbers: Numbers, count: int) -> None:
    """12. Those at rest by what they bear beyond their limits: of redundant ones who has most comes to its limit last.

    The others of them push with their limit, and may not bear more.
    """
    level, sizes = ints[ENTERED_STATE + LEVEL], ints[VALUES]
    n = ints[level + MODES] + ints[CHANNELS]
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        more = numbers[ints[STATIC_LIMITS] + i] - numbers[ints[LIMITS] + i]
        row = ints[level + SPEEDS] + ints[ints[HELD_LINKS] + i] * (n + 1)
        size = more * pressure(ints, numbers, i) * norm(numbers, row, ints[level + MODES]) if more > 0.0 else 0.0
        at = k
        while at > 0 and numbers[sizes + at - 1] > size:
            numbers[sizes + at] = numbers[sizes + at - 1]
            ints[ints[RESTING_LIST] + at] = ints[ints[RESTING_LIST] + at - 1]
            at -= 1
        numbers[sizes + at] = size
        ints[ints[RESTING_LIST] + at] = i
    for k in range(count):
        ints[ints[TOUCHING] + k] = ints[ints[HELD_LINKS] + ints[ints[RESTING_LIST] + k]]


@compiled
def pull(ints: Ints, numbers: Numbers, count: int, asking: int) -> None:
    """The problem of those at rest: what accelerates them where all of them slip, and what force they may add."""
    level = ints[ENTERED_STATE + LEVEL]
    n = ints[level + MODES] + ints[CHANNELS]
    accelerate(ints, numbers, ENTERED_STATE, ints[ACCELERATION])
    acceleration_sizes(ints, numbers, ENTERED_STATE, ints[ACCELERATION_TERMS])
    fill_rows(ints, numbers, level, ints[TOUCHING], count, 0)
    for k in range(count):
        i, row = ints[ints[RESTING_LIST] + k], ints[ROWS] + k * n
        presses, forward = pressure(ints, numbers, i), ints[ints[STICKS] + i] + SLIP_FORWARD
        limit, most = presses * numbers[ints[LIMITS] + i], presses * numbers[ints[STATIC_LIMITS] + i]
        slipped = key_push(ints, i, limit)
        low, high = slipped - most, slipped + most
        if most <= limit and at_limit(ints, numbers, i, ints[asking + i]) == 1:  # and rises
            low = slipped - limit if ints[asking + i] == forward else slipped + limit
            high = low
        numbers[ints[LOWEST] + k] = low
        numbers[ints[HIGHEST] + k] = high
        numbers[ints[VALUES] + k] = product(numbers, row, ints[ACCELERATION], n)
        numbers[ints[VALUE_SIZES] + k] = resting_size(
            numbers, ints[ACCELERATION_TERMS], ints[ACCELERATION_TERMS], row, n
        )
    pose_rows(ints, count, ints[level + MODES], n)


@compiled
def key_push(ints: Ints, element: int, limit: float) -> float:
    """With what force against +h an element pushes that does not stick, in the level of ENTERED_STATE; zero if idle."""
    way = ints[ints[KEY] + element] - ints[ints[STICKS] + element]
    if way == IDLE:
        return 0.0
    return limit if way == SLIP_FORWARD else -limit


@compiled
def pressure(ints: Ints, numbers: Numbers, element: int) -> float:
    """What the limits of friction are to be multiplied by in WORKED: N of a contact, zero where it is round-off."""
    level, x, v = ints[WORKED + LEVEL], ints[WORKED + PLACE], ints[WORKED + SPEED]
    if ints[ints[KINDS] + element] == SLIDING:
        return 1.0
    if ints[ints[level + STATES] + element] == OPEN:
        return 0.0
    signal, n = opening(ints, level, element) + SIGNAL, ints[level + MODES] + ints[CHANNELS]
    if row_sign(ints, numbers, WORKED, signal, 0.0) <= 0:
        return 0.0
    row = ints[signal + ROW]
    value = product(numbers, row, x, n) + product(numbers, row + n, v, n) + numbers[row + 2 * n]
    return value * numbers[ints[STIFFNESSES] + element] if ints[ints[KINDS] + element] == COMPLIANT else value


@compiled
def at_limit(ints: Ints, numbers: Numbers, element: int, asked: int) -> int:
    """1 where an element that sticks asks to slip, with what it bears at its limit, and not beyond it."""
    level = ints[WORKED + LEVEL]
    sticks = ints[ints[STICKS] + element]
    if ints[ints[level + STATES] + element] != sticks or asked == NOBODY:
        return 0
    exit_ = first_exit(ints, level, element) + (asked - sticks - SLIP_FORWARD) * EXIT_INTS
    return 1 if row_sign(ints, numbers, WORKED, exit_ + SIGNAL, 0.0) == 0 else 0
