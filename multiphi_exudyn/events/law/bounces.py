"""Bounces of rigid contacts: gap velocities, rebounds, and the last bounce of a sequence (sentence 11)."""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    ARMED,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    COMPRESSED,
    ELEMENTS,
    EXIT_COUNT,
    FAILED,
    FIRST_CHANGE,
    FIRST_EXITS,
    FURTHER,
    IMPULSES,
    INSTANT_TIME,
    KINDS,
    LANDING,
    LASTS,
    LEVEL,
    LOST_IN_IMPACT,
    MODES,
    OK,
    OPEN,
    PHASES,
    REACHED,
    RECOVERING,
    RESTITUTIONS,
    RIGID,
    ROWS,
    SETTLED,
    SPEED,
    SPEEDS,
    STATES,
    STRUCK,
    TOUCHING,
    WANTED,
    WORKED,
)
from multiphi_exudyn.events.law.impact import RESTING, collide, fill_rows
from multiphi_exudyn.events.law.impact_round_off import negligible_speed, speed_size
from multiphi_exudyn.events.states.signals import gap
from multiphi_exudyn.events.states.state_arrays import copy_state, same_level
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.orthonormal import scalar_product
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = [
    "BRIEF",
    "apply_further_impact",
    "has_rebounded",
    "is_on_last_bounce",
    "is_rebound_only",
    "last_bounce",
    "mark_last_bounces",
    "row_speed",
]

BRIEF = 1e-12  # relative to the time so far: a shorter bounce is the last


@compiled
def is_on_last_bounce(ints: Ints, element: int) -> int:
    """Return 1 if an open contact comes to an instant on its last bounce.

    Whatever other elements do first at that instant, the contact is to stay closed.
    """
    level = ints[REACHED + LEVEL]
    if ints[ints[level + STATES] + element] != OPEN:
        return 0
    return 1 if ints[ints[REACHED + PHASES] + ints[ints[level + FIRST_EXITS] + element]] == LANDING else 0


@compiled
def row_speed(ints: Ints, numbers: Numbers, state: int, k: int) -> float:
    """Return the gap velocity of a touching contact, zero if it is round-off; ROWS must have been filled."""
    n = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS]
    row = ints[ROWS] + k * n
    speed = scalar_product(numbers, row, numbers, ints[state + SPEED], n)
    return 0.0 if abs(speed) <= RESTING * speed_size(ints, numbers, state, row) else speed


@compiled
def apply_further_impact(ints: Ints, numbers: Numbers, state: int, count: int, losses: int) -> int:
    """Replace a struck state by the one after one more impact, with the gap velocities WANTED; return OK or FAILED."""
    touching, further = ints[TOUCHING], ints[FURTHER]
    if collide(ints, numbers, state, touching, count, 0, ints[WANTED], -1, COMPRESSED, further, losses) < 0:
        return FAILED
    copy_state(ints, numbers, COMPRESSED, state)
    for k in range(count):
        numbers[ints[IMPULSES] + k] += numbers[further + k]
    return OK


@compiled
def has_rebounded(ints: Ints, numbers: Numbers, k: int) -> int:
    """Return 1 if a touching contact has restitution and has been struck."""
    contact = ints[ints[TOUCHING] + k]
    rebounds = numbers[ints[RESTITUTIONS] + contact] > 0.0 and is_on_last_bounce(ints, contact) == 0
    return 1 if rebounds and numbers[ints[IMPULSES] + k] > 0.0 else 0


@compiled
def last_bounce(ints: Ints, numbers: Numbers, count: int) -> int:
    """11. Begin the last bounce of contacts whose next bounce is too low or too short; return how many, or FAILED.

    The last bounce takes as long as all bounces that would follow. ACCELERATION must hold xi'' of STRUCK.
    """
    level, last = ints[STRUCK + LEVEL], 0
    n = ints[level + MODES] + ints[CHANNELS]
    fill_rows(ints, numbers, level, ints[TOUCHING], count, 0)
    for k in range(count):
        contact, row, wanted = ints[ints[TOUCHING] + k], ints[ROWS] + k * n, ints[WANTED] + k
        restitution, speed = numbers[ints[RESTITUTIONS] + contact], row_speed(ints, numbers, STRUCK, k)
        may_end = has_rebounded(ints, numbers, k) == 1 and restitution < 1.0 and ints[ints[LASTS] + contact] == 0
        numbers[wanted] = 0.0
        falling = -scalar_product(numbers, row, numbers, ints[ACCELERATION], n)
        negligible = max(
            negligible_speed(ints, numbers, STRUCK, contact, row), 0.5 * BRIEF * numbers[INSTANT_TIME] * falling
        )
        if may_end and 0.0 < speed <= negligible:
            numbers[wanted] = speed / (1.0 - restitution)
            ints[ints[LASTS] + contact] = 1
            last += 1
    if last > 0 and apply_further_impact(ints, numbers, STRUCK, count, LOST_IN_IMPACT) < 0:
        return FAILED
    return last


@compiled
def is_rebound_only(ints: Ints, numbers: Numbers) -> int:
    """Return 1 if an instant has changed nothing but rebounds of contacts with restitution below 1."""
    for k in range(ints[CHANGE_COUNT]):
        restitution = numbers[ints[RESTITUTIONS] + ints[ints[CHANGES] + k * CHANGE_WIDTH]]
        if not 0.0 < restitution < 1.0:
            return 0
    return 1 if ints[CHANGE_COUNT] > 0 and same_level(ints, REACHED, WORKED) == 1 else 0


@compiled
def mark_last_bounces(ints: Ints, numbers: Numbers) -> None:
    """11. Set phases of WORKED for contacts on their last bounce, begun now, or before without an impact since.

    A contact that has been struck was at its stop: its exit is armed if its gap is within the round-off of the instant
    at its speed.
    """
    level, armed = ints[WORKED + LEVEL], 1
    n = ints[level + MODES] + ints[CHANNELS]
    for i in range(ints[ELEMENTS]):
        if ints[ints[KINDS] + i] == RIGID and ints[ints[level + STATES] + i] == OPEN:
            struck = 0
            for k in range(ints[FIRST_CHANGE], ints[CHANGE_COUNT]):
                if ints[ints[CHANGES] + k * CHANGE_WIDTH] == i and numbers[ints[CHANGE_IMPULSES] + k] != 0.0:
                    struck = 1
            phase = ints[WORKED + PHASES] + ints[ints[level + FIRST_EXITS] + i]
            speed = scalar_product(numbers, ints[level + SPEEDS] + i * (n + 1), numbers, ints[WORKED + SPEED], n)
            round_off = ZERO * numbers[INSTANT_TIME] * speed
            if struck == 1 and ints[phase] == RECOVERING and -gap(ints, numbers, WORKED, i) <= round_off:
                ints[phase] = ARMED
            last = ints[ints[LASTS] + i] == 1 or (struck == 0 and is_on_last_bounce(ints, i) == 1)
            if last and ints[phase] == ARMED:
                ints[phase] = LANDING
    for k in range(ints[level + EXIT_COUNT]):
        armed = armed if ints[ints[WORKED + PHASES] + k] == ARMED else 0
    ints[WORKED + SETTLED] = armed
