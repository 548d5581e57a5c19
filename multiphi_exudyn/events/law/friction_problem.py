"""Friction elements at rest, and the complementarity problem of their accelerations and forces (sentence 12)."""

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
from multiphi_exudyn.events.law.changes import NO_REQUEST
from multiphi_exudyn.events.law.impact import fill_rows
from multiphi_exudyn.events.law.impact_round_off import resting_size
from multiphi_exudyn.events.law.phases import first_exit, opening
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.events.states.state_arrays import accelerate, acceleration_sizes
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.principal_pivoting import pose
from multiphi_exudyn.mathematics.orthonormal import norm, scalar_product
from multiphi_exudyn.mathematics.round_off import ALIKE

__all__ = [
    "at_limit",
    "list_at_rest",
    "pose_friction_problem",
    "pose_rows",
    "pressure",
    "slip_force",
    "sort_by_reserve",
]


@compiled
def pose_rows(ints: Ints, count: int, r: int, n: int) -> None:
    """Pose the small problem of ROWS (count, n), with r unknowns."""
    for k in range(count):
        ints[ints[LEADERS] + k] = -1
    pose(
        ints, ints[SMALL_PROBLEM], count, r, n, ints[ROWS], ints[ROWS], ints[VALUES], ints[VALUE_SIZES],
        ints[LOWEST], ints[HIGHEST], ints[LEADERS], ints[RATIOS], ints[CHANGE], ints[FURTHER],
    )  # fmt: skip


@compiled
def list_at_rest(ints: Ints, numbers: Numbers, requests: int) -> int:
    """List the rigid friction elements that stick, request a change or have no slip velocity, and their links.

    A slipping contact that requests to open has a slip velocity: it is at rest only if that is round-off. Return their
    number, or zero if none of them requests a change.
    """
    states, count, request_count = ints[ints[WORKED + LEVEL] + STATES], 0, 0
    for i in range(ints[ELEMENTS]):
        requested = ints[requests + i]
        if numbers[ints[LIMITS] + i] > 0.0 and pressure(ints, numbers, i) > 0.0:
            signal = first_exit(ints, ints[WORKED + LEVEL], i) + SIGNAL
            sticks = ints[ints[STICKS] + i]
            rests = ints[states + i] == sticks or (requested != NO_REQUEST and requested >= sticks)
            if rests or row_sign(ints, numbers, WORKED, signal, 0.0) == 0:
                ints[ints[RESTING_LIST] + count] = i
                ints[ints[TOUCHING] + count] = ints[ints[HELD_LINKS] + i]
                count += 1
                request_count += 1 if requested != NO_REQUEST else 0
    return count if request_count > 0 else 0


@compiled
def sort_by_reserve(ints: Ints, numbers: Numbers, count: int) -> None:
    """12. Sort the elements at rest by the reserve of their static limit over their limit, the smallest first.

    Of redundant elements the one with the largest reserve then reaches its limit last; the others exert their limit.
    Reserves that are equal but for round-off keep their order.
    """
    level, sizes = ints[ENTERED_STATE + LEVEL], ints[VALUES]
    n = ints[level + MODES] + ints[CHANNELS]
    for k in range(count):
        i = ints[ints[RESTING_LIST] + k]
        reserve = numbers[ints[STATIC_LIMITS] + i] - numbers[ints[LIMITS] + i]
        row = ints[level + SPEEDS] + ints[ints[HELD_LINKS] + i] * (n + 1)
        size = reserve * pressure(ints, numbers, i) * norm(numbers, row, ints[level + MODES]) if reserve > 0.0 else 0.0
        position = k
        while position > 0 and (1.0 - ALIKE) * numbers[sizes + position - 1] > size:
            numbers[sizes + position] = numbers[sizes + position - 1]
            ints[ints[RESTING_LIST] + position] = ints[ints[RESTING_LIST] + position - 1]
            position -= 1
        numbers[sizes + position] = size
        ints[ints[RESTING_LIST] + position] = i
    for k in range(count):
        ints[ints[TOUCHING] + k] = ints[ints[HELD_LINKS] + ints[ints[RESTING_LIST] + k]]


@compiled
def pose_friction_problem(ints: Ints, numbers: Numbers, count: int, requests: int) -> None:
    """Pose the problem of the elements at rest: accelerations if all of them slip, and bounds of the added forces."""
    level = ints[ENTERED_STATE + LEVEL]
    n = ints[level + MODES] + ints[CHANNELS]
    accelerate(ints, numbers, ENTERED_STATE, ints[ACCELERATION])
    acceleration_sizes(ints, numbers, ENTERED_STATE, ints[ACCELERATION_TERMS])
    fill_rows(ints, numbers, level, ints[TOUCHING], count, 0)
    for k in range(count):
        i, row = ints[ints[RESTING_LIST] + k], ints[ROWS] + k * n
        normal, forward = pressure(ints, numbers, i), ints[ints[STICKS] + i] + SLIP_FORWARD
        limit, static_limit = normal * numbers[ints[LIMITS] + i], normal * numbers[ints[STATIC_LIMITS] + i]
        force_of_slip = slip_force(ints, i, limit)
        low, high = force_of_slip - static_limit, force_of_slip + static_limit
        if static_limit <= limit and at_limit(ints, numbers, i, ints[requests + i]) == 1:  # the force would exceed it
            low = force_of_slip - limit if ints[requests + i] == forward else force_of_slip + limit
            high = low
        numbers[ints[LOWEST] + k] = low
        numbers[ints[HIGHEST] + k] = high
        numbers[ints[VALUES] + k] = scalar_product(numbers, row, numbers, ints[ACCELERATION], n)
        numbers[ints[VALUE_SIZES] + k] = resting_size(
            numbers, ints[ACCELERATION_TERMS], ints[ACCELERATION_TERMS], row, n
        )
    pose_rows(ints, count, ints[level + MODES], n)


@compiled
def slip_force(ints: Ints, element: int, limit: float) -> float:
    """Return the friction force along -h of an element that slips in the level of ENTERED_STATE, zero if idle."""
    way = ints[ints[KEY] + element] - ints[ints[STICKS] + element]
    if way == IDLE:
        return 0.0
    return limit if way == SLIP_FORWARD else -limit


@compiled
def pressure(ints: Ints, numbers: Numbers, element: int) -> float:
    """Return the factor of an element's friction limits in WORKED: the normal force N, zero if it is round-off, or 1.

    It is 1 for friction that is no part of a contact, whose limits are forces.
    """
    level, x, v = ints[WORKED + LEVEL], ints[WORKED + PLACE], ints[WORKED + SPEED]
    if ints[ints[KINDS] + element] == SLIDING:
        return 1.0
    if ints[ints[level + STATES] + element] == OPEN:
        return 0.0
    signal, n = opening(ints, level, element) + SIGNAL, ints[level + MODES] + ints[CHANNELS]
    if row_sign(ints, numbers, WORKED, signal, 0.0) <= 0:
        return 0.0
    row = ints[signal + ROW]
    value = (
        scalar_product(numbers, row, numbers, x, n)
        + scalar_product(numbers, row + n, numbers, v, n)
        + numbers[row + 2 * n]
    )
    return value * numbers[ints[STIFFNESSES] + element] if ints[ints[KINDS] + element] == COMPLIANT else value


@compiled
def at_limit(ints: Ints, numbers: Numbers, element: int, requested: int) -> int:
    """Return 1 if an element that sticks requests to slip with a force at its limit, and not beyond it."""
    level = ints[WORKED + LEVEL]
    sticks = ints[ints[STICKS] + element]
    if ints[ints[level + STATES] + element] != sticks or requested == NO_REQUEST:
        return 0
    exit_ = first_exit(ints, level, element) + (requested - sticks - SLIP_FORWARD) * EXIT_INTS
    return 1 if row_sign(ints, numbers, WORKED, exit_ + SIGNAL, 0.0) == 0 else 0
