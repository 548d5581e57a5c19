"""Changes at an instant: requests of elements, the levels entered, and the energy lost by that.

Sets of elements are flags (c,) in the ints. Requests (c,) hold the state that each element requests, or NO_REQUEST.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ASKED,
    BACKWARD,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    COMPLIANT,
    ELEMENT,
    ELEMENTS,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FORWARD,
    IDLE,
    KINDS,
    LEVEL,
    LOSSES,
    LOST,
    LOST_NOW,
    MAPPED_AGAIN,
    MODES,
    OK,
    OPEN,
    RIGID,
    ROW,
    SEGMENTS,
    SLIP_FORWARD,
    SPRINGS,
    STATES,
    STICKS,
    TRANSITIONS_NOW,
    TURN,
    VISCOUS,
    WORKED,
)
from multiphi_exudyn.events.law.impact_round_off import speed_size
from multiphi_exudyn.events.law.phases import update_phases
from multiphi_exudyn.events.states.energies import lose
from multiphi_exudyn.events.states.maps import find_level, move
from multiphi_exudyn.events.states.signals import gap, row_sign
from multiphi_exudyn.events.states.state_arrays import copy_state
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled

__all__ = [
    "NO_REQUEST",
    "bears_no_impulse",
    "clear",
    "enter",
    "flag_requests",
    "is_closed_rigid",
    "record_change",
    "segment_at",
    "set_requested_states",
    "state_without_stick",
    "transfer",
]

NO_REQUEST = -1  # in place of a requested state


@compiled
def flag_requests(ints: Ints, requests: int, flags: int) -> None:
    """Set flags (c,) of the elements that have a request."""
    for i in range(ints[ELEMENTS]):
        ints[flags + i] = 1 if ints[requests + i] != NO_REQUEST else 0


@compiled
def set_requested_states(ints: Ints, numbers: Numbers, requests: int) -> None:
    """8, 10. Replace requested states of WORKED that depend on a slip velocity or on a force law's displacement."""
    level = ints[WORKED + LEVEL]
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        element = ints[exit_ + ELEMENT]
        if ints[exit_ + TURN] >= 0 and ints[requests + element] == ints[exit_ + ASKED]:
            along = ints[exit_ + TURN + ROW] + ints[level + MODES] + ints[CHANNELS]
            sign = row_sign(ints, numbers, WORKED, exit_ + TURN, speed_size(ints, numbers, WORKED, along))
            if sign != 0:
                ints[requests + element] = ints[exit_ + (FORWARD if sign > 0 else BACKWARD)]
    for i in range(ints[ELEMENTS]):
        if ints[requests + i] != NO_REQUEST and ints[ints[SEGMENTS] + 3 * i] > 0:
            segment = segment_at(ints, numbers, WORKED, i)
            if segment != ints[ints[level + STATES] + i]:
                ints[requests + i] = segment


@compiled
def segment_at(ints: Ints, numbers: Numbers, state: int, element: int) -> int:
    """8. Return the segment of a force law in which its displacement lies."""
    record, knots_passed = ints[SEGMENTS] + 3 * element, 0
    first, above, below = ints[record], ints[record + 1], ints[record + 2]
    while knots_passed < above and gap(ints, numbers, state, first + knots_passed) < 0.0:
        knots_passed += 1
    if knots_passed > 0:
        return knots_passed
    while knots_passed < below and gap(ints, numbers, state, first + above + knots_passed) < 0.0:
        knots_passed += 1
    return above + knots_passed if knots_passed > 0 else 0


@compiled
def is_closed_rigid(ints: Ints, state: int, element: int) -> int:
    """Return 1 if an element is a closed rigid contact."""
    closed = ints[ints[ints[state + LEVEL] + STATES] + element] != OPEN
    return 1 if closed and ints[ints[KINDS] + element] == RIGID else 0


@compiled
def bears_no_impulse(ints: Ints, numbers: Numbers, element: int) -> int:
    """12. Return 1 for friction without a spring whose normal force is no reaction: it transmits no impulse."""
    rigid = ints[ints[STICKS] + element] >= 0 and numbers[ints[SPRINGS] + element] == 0.0
    return 1 if rigid and ints[ints[KINDS] + element] != RIGID else 0


@compiled
def state_without_stick(ints: Ints, element: int, before: int) -> int:
    """12. Return the state of a friction element that does not stick: idle at a contact that is not rigid, else slip.

    The direction of slip is that of the state ``before``, or forward if that is no slip.
    """
    sticks = ints[ints[STICKS] + element]
    gives_way = ints[ints[KINDS] + element] in (COMPLIANT, VISCOUS)
    return sticks + IDLE if gives_way else max(before, sticks + SLIP_FORWARD)


@compiled
def record_change(ints: Ints, numbers: Numbers, element: int, entered: int, impulse: float) -> None:
    """List a change: the state entered, or SHARED; shared impulses precede the change that they belong to."""
    k = ints[CHANGE_COUNT]
    ints[ints[CHANGES] + k * CHANGE_WIDTH] = element
    ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] = entered
    ints[ints[CHANGES] + k * CHANGE_WIDTH + 2] = ints[ints[ints[WORKED + LEVEL] + STATES] + element]
    numbers[ints[CHANGE_IMPULSES] + k] = impulse
    ints[CHANGE_COUNT] = k + 1


@compiled
def enter(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """Copy a state to WORKED, update its phases, and add the energies in LOST_NOW to LOST."""
    copy_state(ints, numbers, state, WORKED)
    update_phases(ints, numbers, waves, WORKED, -1)
    ints[TRANSITIONS_NOW] += 1
    if ints[TRANSITIONS_NOW] > 1:
        ints[MAPPED_AGAIN] = 1
    for k in range(LOSSES):
        numbers[LOST + k] += numbers[LOST_NOW + k]


@compiled
def transfer(ints: Ints, numbers: Numbers, state: int, key: int, result: int) -> int:
    """Map a state into the level with a key (eq. 38.6), losses to truncation in LOST_NOW; return OK or NEED."""
    level = find_level(ints, key)
    if level < 0:
        return level
    clear(numbers, LOST_NOW)
    if level == ints[state + LEVEL]:
        copy_state(ints, numbers, state, result)
        return OK
    status = move(ints, numbers, state, state, level, result)
    if status < 0:
        return status
    lose(ints, numbers, state, result, 0.0, LOST_NOW)
    return OK


@compiled
def clear(numbers: Numbers, losses: int) -> None:
    """Set losses (6,) to zero."""
    for k in range(LOSSES):
        numbers[losses + k] = 0.0
