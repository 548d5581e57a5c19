"""The decision of an instant: which elements change their states, and which level follows, by the law (events/law).

``decide`` computes the state after an instant, ``settle`` repeats decisions until no refused element is untreated, and
``apply_requests`` passes requests to striking, sticking or switching. Negative gaps that truncation leaves are
reported. An exchange of states without end is a failure, with a cause.

The decision works on the state WORKED, which begins as a copy of REACHED and leaves REACHED as it was: if something is
missing (NEED) the decision is repeated from the start.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    AFTER,
    AGAIN,
    ARMED,
    ASKED,
    ASKING,
    CAUSE,
    CAUSED_BY,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_ROOM,
    CHANGE_WIDTH,
    CHANGES,
    COMPLIANT_KEY,
    DENIED,
    ELEMENT,
    ELEMENTS,
    EVENT,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FAILED,
    FIRMNESS,
    FIRST_CHANGE,
    FIRST_EXITS,
    FREED,
    FRICTION,
    HEARD,
    KINDS,
    KNOTS,
    LANDING,
    LEVEL,
    LOST,
    LOST_NOW,
    MAPPED_AGAIN,
    NOT_ADMISSIBLE,
    OK,
    OPEN,
    PENDING,
    PHASES,
    PULLING,
    REACHED,
    RECOVERING,
    REFUSED,
    RIGID,
    SHARED,
    SIGNAL,
    SPEEDS_CHANGED,
    SPRINGS,
    STATES,
    STICKS,
    STRIKING,
    TOGETHER,
    TRANSITIONS_NOW,
    VISCOUS,
    WORKED,
)
from multiphi_exudyn.events.law.bounces import mark_last_bounces
from multiphi_exudyn.events.law.changes import (
    NO_REQUEST,
    bears_no_impulse,
    clear,
    enter,
    flag_requests,
    is_closed_rigid,
    set_requested_states,
)
from multiphi_exudyn.events.law.phases import arm_return_exits, hold_back, is_pulled, update_phases
from multiphi_exudyn.events.law.rebounds import clear_last_bounces, flag_touching
from multiphi_exudyn.events.law.sticking import stick_together
from multiphi_exudyn.events.law.striking import close_without_impact, impact
from multiphi_exudyn.events.law.switching import switch
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.events.states.state_arrays import clear_turning_speeds, copy_state, same_level
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mechanics.elements.element import ALWAYS_TAKEN, TAKEN_FALLING, TAKEN_ONCE

__all__ = ["ROUNDS", "decide", "decide_jump"]

MOST_RETURNS = 3  # changes of an element from or to a state at an instant; after more it keeps its state
ROUNDS = 20  # decisions at one instant: with more the contacts exclude each other's states without end


@compiled
def decide(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Set WORKED to the state right after an instant at which elements request changes; return OK, NEED or FAILED.

    ASKING holds the requests; AGAIN flags the elements that were refused at this instant before. The energies lost are
    summed in LOST, and the changes are listed. If in the end every element is in its old state, no contact was struck,
    no friction spring has dropped from its static limit and no rigid contact would pull, the instant changes nothing.
    """
    clear(numbers, LOST)
    first, struck = ints[FIRST_CHANGE], 0
    ints[CHANGE_COUNT] = first
    ints[TRANSITIONS_NOW] = 0
    ints[MAPPED_AGAIN] = 0
    ints[SPEEDS_CHANGED] = 0
    copy_state(ints, numbers, REACHED, WORKED)
    clear_last_bounces(ints)
    ints[TOGETHER] = 0
    clear_turning_speeds(ints, numbers, WORKED)
    status = settle(ints, numbers, waves)
    if status < 0:
        return status
    for k in range(first, ints[CHANGE_COUNT]):
        shared = ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] == SHARED
        if shared or numbers[ints[CHANGE_IMPULSES] + k] != 0.0:
            struck = 1
    changed = struck == 1 or numbers[LOST + FRICTION] != 0.0 or same_level(ints, REACHED, WORKED) == 0
    if ints[CHANGE_COUNT] > first and not changed and is_pulled(ints, numbers, waves, REACHED) == 0:
        copy_state(ints, numbers, REACHED, WORKED)
        flag_requests(ints, ints[ASKING], ints[DENIED])
        update_phases(ints, numbers, waves, WORKED, ints[DENIED])
        hold_back(ints, WORKED)
        clear(numbers, LOST)
        ints[CHANGE_COUNT] = first
    mark_last_bounces(ints, numbers)
    return OK


@compiled
def decide_jump(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """1. Decide after channels have jumped: OK without any request, EVENT with at least one, else NEED or FAILED."""
    exits, request_count = ints[ints[REACHED + LEVEL] + EXITS], 0
    for i in range(ints[ELEMENTS]):
        ints[ints[ASKING] + i] = NO_REQUEST
        ints[ints[AGAIN] + i] = 0
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        exit_ = exits + k * EXIT_INTS
        is_armed = ints[ints[REACHED + PHASES] + k] in (ARMED, LANDING)
        if is_armed and row_sign(ints, numbers, REACHED, exit_ + SIGNAL, 0.0) < 0:
            ints[ints[ASKING] + ints[exit_ + ELEMENT]] = ints[exit_ + ASKED]
            request_count = 1
    ints[CHANGE_COUNT] = 0
    if request_count == 0:
        return OK
    status = decide(ints, numbers, waves)
    return status if status < 0 else EVENT


@compiled
def settle(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Repeat decisions at one instant until no refused element is untreated; return OK, NEED or FAILED."""
    c, requests, treated, freed, pending = ints[ELEMENTS], ints[ASKING], ints[HEARD], ints[FREED], ints[PENDING]
    flag_requests(ints, requests, treated)
    request_count = 0
    for i in range(c):
        ints[freed + i] = is_closed_rigid(ints, WORKED, i) if ints[requests + i] == OPEN else 0
        request_count += ints[treated + i]
    if request_count > 0:
        status = apply_requests(ints, numbers, waves, requests)
        if status < 0:
            return status
    else:
        update_phases(ints, numbers, waves, WORKED, -1)
    for _ in range(ROUNDS + c + ints[KNOTS]):
        arm_return_exits(ints, numbers)
        refusals = classify_refusals(ints)
        if refusals == 0:
            return OK
        if ints[CHANGE_COUNT] + 3 * c > ints[CHANGE_ROOM]:
            break
        status = OK
        if refusals == 1:
            for i in range(c):
                if ints[pending + i] != NO_REQUEST:
                    ints[treated + i] = 1
                    if ints[pending + i] == OPEN and is_closed_rigid(ints, WORKED, i) == 1:
                        ints[freed + i] = 1
            status = apply_requests(ints, numbers, waves, pending)
        elif refusals == 2:  # treated before: changes of others at this instant have removed its reaction
            changes = ints[CHANGE_COUNT]
            status = switch(ints, numbers, waves, ints[PULLING])
            if status == OK and ints[CHANGE_COUNT] == changes:
                hold_back(ints, WORKED)
                return OK
        else:
            hold_back(ints, WORKED)
            return OK
        if status < 0:
            return status
    ints[CAUSE] = NOT_ADMISSIBLE
    flag_requests(ints, pending, ints[CAUSED_BY])
    return FAILED


@compiled
def classify_refusals(ints: Ints) -> int:
    """7. Return what kind of refused exits WORKED has, as a number from 0 to 3.

    0: none. 1: exits of elements not treated yet at this instant, requests in PENDING. 2: exits that are always taken,
    requests in PULLING. 3: others only. An element that has changed counts as treated. An exit that is taken once, and
    that of a viscous contact that would pull, is taken if another element has changed since; the first one does not
    wait if an impact at this instant has reversed it.
    """
    level, treated, pending, always_taken = ints[WORKED + LEVEL], ints[HEARD], ints[PENDING], ints[PULLING]
    for k in range(ints[FIRST_CHANGE], ints[CHANGE_COUNT]):
        if ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] != SHARED:
            ints[treated + ints[ints[CHANGES] + k * CHANGE_WIDTH]] = 1
    for i in range(ints[ELEMENTS]):
        ints[pending + i] = NO_REQUEST
        ints[always_taken + i] = NO_REQUEST
    refused, untreated, taken_count = 0, 0, 0
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        element = ints[exit_ + ELEMENT]
        if ints[ints[WORKED + PHASES] + k] == REFUSED or is_reversed_by_impact(ints, k) == 1:
            refused = 1
            if ints[treated + element] == 0:
                ints[pending + element] = ints[exit_ + ASKED]
                untreated = 1
            viscous = ints[exit_ + ASKED] == OPEN and ints[ints[KINDS] + element] == VISCOUS
            once = viscous or ints[exit_ + FIRMNESS] == TAKEN_ONCE
            once = once and is_return(ints, element, ints[exit_ + ASKED]) == 0
            if ints[exit_ + FIRMNESS] == ALWAYS_TAKEN or ints[exit_ + FIRMNESS] == TAKEN_FALLING or once:
                ints[always_taken + element] = ints[exit_ + ASKED]
                taken_count = 1
    if refused == 0:
        return 0
    if untreated == 1:
        return 1
    return 2 if taken_count == 1 else 3


@compiled
def is_reversed_by_impact(ints: Ints, exit_number: int) -> int:
    """Return 1 if an exit taken once is recovering in WORKED, but was not before an impact at this instant.

    It was armed before the instant in the same state, or leads back to that state, which was left before the impact.
    """
    level, before = ints[WORKED + LEVEL], ints[REACHED + LEVEL]
    exit_ = ints[level + EXITS] + exit_number * EXIT_INTS
    element = ints[exit_ + ELEMENT]
    waits = ints[ints[WORKED + PHASES] + exit_number] == RECOVERING and ints[exit_ + FIRMNESS] == TAKEN_ONCE
    if not waits or is_return(ints, element, ints[exit_ + ASKED]) == 1:
        return 0
    if ints[ints[before + STATES] + element] != ints[ints[level + STATES] + element]:
        return 1 if ints[SPEEDS_CHANGED] == 1 and ints[ints[before + STATES] + element] == ints[exit_ + ASKED] else 0
    k = ints[ints[before + FIRST_EXITS] + element] + exit_number - ints[ints[level + FIRST_EXITS] + element]
    return 1 if ints[ints[REACHED + PHASES] + k] == ARMED else 0


@compiled
def is_return(ints: Ints, element: int, requested: int) -> int:
    """8. Return 1 if an element was the last to change, out of the requested state, or has changed too often."""
    last, left, count = NO_REQUEST, NO_REQUEST, 0
    for k in range(ints[FIRST_CHANGE], ints[CHANGE_COUNT]):
        last = ints[ints[CHANGES] + k * CHANGE_WIDTH]
        left = ints[ints[CHANGES] + k * CHANGE_WIDTH + 2]
        involved = left == requested or ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] == requested
        count += 1 if last == element and involved else 0
    return 1 if (last == element and left == requested) or count > MOST_RETURNS else 0


@compiled
def apply_requests(ints: Ints, numbers: Numbers, waves: Waves, requests: int) -> int:
    """10. Set WORKED to the state, with its phases, after the requests (c,) are decided; return OK, NEED or FAILED.

    HEARD flags all contacts that touch at this instant. FREED flags those of them whose reaction has fallen to zero at
    it. A friction spring that reaches its limit sticks in an impact. What a viscous contact requests is left for the
    next decision, after the impact.
    """
    c, striking, states = ints[ELEMENTS], ints[STRIKING], ints[ints[WORKED + LEVEL] + STATES]
    set_requested_states(ints, numbers, requests)
    strikes, before = 0, ints[CHANGE_COUNT]
    clear(numbers, LOST_NOW)
    flag_touching(ints, numbers, requests)
    for i in range(c):
        rigid = ints[ints[KINDS] + i] == RIGID
        ints[striking + i] = 1 if rigid and ints[ints[HEARD] + i] == 1 and ints[states + i] == OPEN else 0
        strikes += 1 if ints[striking + i] == 1 and ints[requests + i] != NO_REQUEST else 0
        requested = ints[states + i] if ints[requests + i] == NO_REQUEST else ints[requests + i]
        sticks = ints[ints[STICKS] + i]
        if numbers[ints[SPRINGS] + i] > 0.0 and ints[states + i] == sticks and requested > sticks:
            requested = sticks  # its velocity after the impact decides whether it slips
        ints[ints[COMPLIANT_KEY] + i] = OPEN if rigid else requested
        if follows_impact(ints, requests, i) == 1:
            ints[ints[COMPLIANT_KEY] + i] = ints[states + i]
        if (
            bears_no_impulse(ints, numbers, i) == 1 and ints[ints[COMPLIANT_KEY] + i] >= sticks
        ):  # slips, in either direction
            begins = ints[states + i] == sticks and requested > sticks
            ints[ints[COMPLIANT_KEY] + i] = requested if begins else max(ints[states + i], sticks + 1)
    if strikes == 0:
        status = stick_together(ints, numbers, waves, requests)
        remaining = 0
        for i in range(c):
            remaining += 1 if ints[requests + i] != NO_REQUEST else 0
        if status < 0 or remaining == 0:
            return status
        return switch(ints, numbers, waves, requests)
    for i in range(c):
        if follows_impact(ints, requests, i) == 1:
            ints[ints[HEARD] + i] = 0
    status = impact(ints, numbers, waves)
    if status < 0:
        return status
    if ints[CHANGE_COUNT] == before:
        clear(numbers, LOST_NOW)
        return close_without_impact(ints, numbers, waves, requests)
    enter(ints, numbers, waves, AFTER)
    return OK


@compiled
def follows_impact(ints: Ints, requests: int, element: int) -> int:
    """7. Return 1 if a viscous contact requests to close or to open: the velocities after an impact decide on that."""
    requested, opened = ints[requests + element], ints[ints[ints[WORKED + LEVEL] + STATES] + element] == OPEN
    if requested == NO_REQUEST or ints[ints[KINDS] + element] != VISCOUS:
        return 0
    return 1 if opened or requested == OPEN else 0
