"""Start of a run in flat arrays: from displacement and velocity in all modes of the base to the first state of a level.

The base stands among the levels as one with xi = (y, w), in which all contacts are open. In its key (c,) the contacts
that touch their stop at the start, or lie inside it, are closed: rigid ones touch, compliant ones penetrate.

    v = y' + H p,   p = argmin |v|,  p >= 0,   of the rigid contacts that touch          (impact.py, in all modes)
    eta = Psi^T (y - y_inf - R w),   eta' = Psi^T (v - Y w')                             (eq. 38.6)

Which touching contacts stay closed is decided as at any impact; the losses are those of an impact and of truncation.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    AFTER,
    AGAIN,
    ARMED,
    ASKING,
    CHANGE_COUNT,
    CHANNELS,
    COMPLIANT_KEY,
    COORDINATES,
    DRIVE,
    ELEMENTS,
    EXIT_COUNT,
    FAILED,
    FIRST_CHANGE,
    FREED,
    GIVEN,
    GIVEN_SPRINGS,
    KINDS,
    LEVEL,
    LOSSES,
    LOST,
    LOST_AT_START,
    MAP_SIZES,
    MODES,
    OK,
    OPEN,
    PHASES,
    PLACE,
    PRESCRIBED,
    REACHED,
    RIGID,
    SET_SIZES,
    SETTLED,
    SLOWED,
    SPEED,
    START,
    START_STATES,
    STARTS,
    STATES,
    STICKS,
    STRAIN,
    STRIKING,
    TRANSITIONS_NOW,
    WORKED,
)
from multiphi_exudyn.events.law.changes import NO_REQUEST, bears_no_impulse, clear
from multiphi_exudyn.events.law.decision import decide
from multiphi_exudyn.events.law.rebounds import collide_and_rebound, repeat_impacts, set_rebound_speeds
from multiphi_exudyn.events.law.striking import impact, record_impact_changes
from multiphi_exudyn.events.states.energies import lose
from multiphi_exudyn.events.states.maps import find_level, find_map, move
from multiphi_exudyn.events.states.state_arrays import copy_state, measure
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["begin"]


@compiled
def begin(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Set WORKED to the state right after the start; return OK, NEED or FAILED.

    REACHED is the state before any request is decided. The energies lost are summed in LOST, and changes are listed.
    """
    states, count, strikes = ints[ints[GIVEN + LEVEL] + STATES], 0, 0
    enter_start(ints, numbers)
    measure(ints, numbers, GIVEN)
    touching = 0
    for i in range(ints[ELEMENTS]):
        touching += ints[states + i] if ints[ints[KINDS] + i] == RIGID else 0
    for i in range(ints[ELEMENTS]):
        rigid = ints[ints[KINDS] + i] == RIGID
        ints[ints[COMPLIANT_KEY] + i] = OPEN if rigid else ints[states + i]
        sticks = ints[ints[STICKS] + i]
        if touching > 0 and bears_no_impulse(ints, numbers, i) == 1 and ints[ints[COMPLIANT_KEY] + i] >= sticks:
            ints[ints[COMPLIANT_KEY] + i] = max(ints[states + i], sticks + 1)  # slips, in either direction
        ints[ints[STRIKING] + i] = ints[states + i] if rigid else OPEN
        ints[ints[FREED] + i] = 0
        ints[ints[ASKING] + i] = NO_REQUEST
        ints[ints[AGAIN] + i] = 0
        count += ints[ints[STRIKING] + i]
    level = find_level(ints, ints[COMPLIANT_KEY])
    if level < 0:
        return level
    ints[CHANGE_COUNT] = 0
    clear(numbers, LOST_AT_START)
    copy_state(ints, numbers, GIVEN, SLOWED)
    if count > 0:
        strikes = strike(ints, numbers, waves, level, count)
        level = ints[AFTER + LEVEL]
    status = enter_given(ints, numbers, SLOWED, level, REACHED) if strikes >= 0 else strikes
    if status < 0:
        return status
    ints[FIRST_CHANGE] = ints[CHANGE_COUNT]
    status = decide(ints, numbers, waves)
    ints[FIRST_CHANGE] = 0
    if status < 0:
        return status
    ints[TRANSITIONS_NOW] += strikes
    lose(ints, numbers, SLOWED, REACHED, 0.0, LOST)
    numbers[LOST + STRAIN] += numbers[GIVEN_SPRINGS]
    for k in range(LOSSES):
        numbers[LOST + k] += numbers[LOST_AT_START + k]
    return OK


@compiled
def enter_start(ints: Ints, numbers: Numbers) -> None:
    """Set GIVEN to start number START in the arrays (start_arrays.py), with the present w and w'."""
    m, q, elements, here = ints[COORDINATES], ints[PRESCRIBED], ints[ELEMENTS], ints[ints[GIVEN + LEVEL] + STATES]
    held, place, speed = ints[CHANNELS] - q, ints[GIVEN + PLACE], ints[GIVEN + SPEED]
    start = ints[STARTS] + ints[START] * (2 * m + held + 1)
    for i in range(elements):
        ints[here + i] = ints[ints[START_STATES] + ints[START] * elements + i]
    for i in range(m):
        numbers[place + i] = numbers[start + i]
        numbers[speed + i] = numbers[start + m + i]
    for k in range(q):
        numbers[place + m + k] = numbers[ints[DRIVE] + k]
        numbers[speed + m + k] = numbers[ints[DRIVE] + q + k]
    for k in range(held):
        numbers[place + m + q + k] = numbers[start + 2 * m + k]
        numbers[speed + m + q + k] = 0.0
    numbers[GIVEN_SPRINGS] = numbers[start + 2 * m + held]


@compiled
def strike(ints: Ints, numbers: Numbers, waves: Waves, level: int, count: int) -> int:
    """Let the given velocity strike the touching contacts: set SLOWED, in all modes, and AFTER, in a level.

    level: in which all of them are open; AFTER is in that of the contacts that stay closed. Return 1 if this is a
    transition, 0 if not; NEED or FAILED.
    """
    status = enter_given(ints, numbers, GIVEN, level, WORKED)
    if status >= 0:
        status = impact(ints, numbers, waves)
    if status < 0:
        return status
    strikes = 1 if ints[CHANGE_COUNT] > 0 else 0
    ints[CHANGE_COUNT] = 0
    bouncing = set_rebound_speeds(ints, numbers, GIVEN, count)
    if bouncing < 0 or collide_and_rebound(ints, numbers, GIVEN, count, bouncing, SLOWED, LOST_AT_START) < 0:
        return FAILED
    if bouncing > 0 and repeat_impacts(ints, numbers, SLOWED, count, LOST_AT_START) < 0:
        return FAILED
    record_impact_changes(ints, numbers, count)
    return strikes


@compiled
def enter_given(ints: Ints, numbers: Numbers, speeds: int, level: int, result: int) -> int:
    """Map the displacement of GIVEN and the velocity of ``speeds`` into a level, all exits armed; return OK or NEED.

    A displacement that is round-off of the level's static equilibrium becomes zero.
    """
    status = move(ints, numbers, GIVEN, speeds, level, result)
    if status < 0:
        return status
    x, w, q = ints[result + PLACE], ints[GIVEN + PLACE] + ints[COORDINATES], ints[CHANNELS]
    way = find_map(ints, ints[GIVEN + LEVEL], level)
    for i in range(ints[level + MODES]):
        sizes = ints[way + MAP_SIZES] + i * (q + 1)
        size = numbers[ints[SET_SIZES] + i] + numbers[sizes + q]
        for k in range(q):
            size += numbers[sizes + k] * abs(numbers[w + k])
        if abs(numbers[x + i]) <= ZERO * size:
            numbers[x + i] = 0.0
    for i in range(ints[level + EXIT_COUNT]):
        ints[ints[result + PHASES] + i] = ARMED
    ints[result + SETTLED] = 1
    return OK
