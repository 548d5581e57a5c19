"""Compliant contacts change, rigid ones open, by sentences 3, 4 and 7 of the law (events/law)."""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ASKED,
    DENIED,
    ELEMENTS,
    ENTERED_STATE,
    EXIT_INTS,
    EXITS,
    FIRMNESS,
    FIRST_EXITS,
    IMPULSES,
    KEY,
    KINDS,
    LEVEL,
    LOST_NOW,
    OK,
    OPEN,
    PUSHED,
    RIGID,
    SINGLES,
    STATES,
    STRUCK,
    TOUCHING,
    VISCOUS,
    WISHES,
    WORKED,
)
from multiphi_exudyn.events.law.changes import NO_REQUEST, enter, flag_requests, record_change, transfer
from multiphi_exudyn.events.law.impact import collide
from multiphi_exudyn.events.law.phases import becomes, entered_signal, first_exit, is_denied, update_phases
from multiphi_exudyn.events.law.redundancy import drop_redundant_stick
from multiphi_exudyn.events.law.resting import same_speed
from multiphi_exudyn.events.states.signals import mapped_size, rate_sign, row_sign
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mechanics.elements.element import ALWAYS_TAKEN

__all__ = ["open_and_enter", "switch"]


@compiled
def switch(ints: Ints, numbers: Numbers, waves: Waves, requests: int) -> int:
    """4. Let compliant contacts change if the level entered admits it, and rigid ones open; return OK, NEED or FAILED.

    If the level admits none of several changes together, the first change that is admitted alone is made.
    """
    c, targets, singles, position = ints[ELEMENTS], ints[WISHES], ints[SINGLES], -1
    for i in range(c):
        ints[targets + i] = ints[requests + i]
    drop_redundant_stick(ints, numbers, targets)
    while True:
        target_count = 0
        for i in range(c):
            target_count += 1 if ints[targets + i] != NO_REQUEST else 0
        denied = try_targets(ints, numbers, waves)
        if denied < 0:
            return denied
        if denied == 0:
            return open_and_enter(ints, numbers, waves)
        if denied < target_count:
            for i in range(c):
                ints[targets + i] = NO_REQUEST if ints[ints[DENIED] + i] == 1 else ints[targets + i]
            continue
        if target_count > 1:
            for i in range(c):
                ints[singles + i] = ints[targets + i]
            position = 0
        while 0 <= position < c and ints[singles + position] == NO_REQUEST:
            position += 1
        if position < 0 or position >= c:
            break
        for i in range(c):
            ints[targets + i] = ints[singles + i] if i == position else NO_REQUEST
        position += 1
    flag_requests(ints, requests, ints[DENIED])
    update_phases(ints, numbers, waves, WORKED, ints[DENIED])
    return OK


@compiled
def try_targets(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """4. Try the changes to the states in WISHES: return how many the level entered refuses (flags in DENIED), or NEED.

    ENTERED_STATE becomes the state in that level.
    """
    states, targets, key, denied = ints[ints[WORKED + LEVEL] + STATES], ints[WISHES], ints[KEY], 0
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[states + i] if ints[targets + i] == NO_REQUEST else ints[targets + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    update_phases(ints, numbers, waves, ENTERED_STATE, -1)
    for i in range(ints[ELEMENTS]):
        ints[ints[DENIED] + i] = 0
        target = ints[targets + i]
        if target != NO_REQUEST and is_unconditional(ints, i, target) == 0 and is_denied(ints, ENTERED_STATE, i) == 1:
            relaxes = would_pull_if_closed(ints, numbers, waves, ENTERED_STATE, i)
            if relaxes < 0:
                return relaxes
            ints[ints[DENIED] + i] = 1 - relaxes
            denied += 1 - relaxes
    return denied


@compiled
def is_unconditional(ints: Ints, element: int, requested: int) -> int:
    """3, 8. Return 1 if an element of WORKED takes its exit into a state unconditionally."""
    level = ints[WORKED + LEVEL]
    first = ints[level + FIRST_EXITS] + element
    for k in range(ints[first], ints[first + 1]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        if ints[exit_ + ASKED] == requested and ints[exit_ + FIRMNESS] >= ALWAYS_TAKEN:
            return 1
    return 0


@compiled
def would_pull_if_closed(ints: Ints, numbers: Numbers, waves: Waves, state: int, element: int) -> int:
    """7. Return 1 if a viscous contact is open and would pull if it were closed, now or by a falling force; or NEED."""
    level = ints[state + LEVEL]
    if ints[ints[KINDS] + element] != VISCOUS or ints[ints[level + STATES] + element] != OPEN:
        return 0
    exit_ = first_exit(ints, level, element)
    signal = entered_signal(ints, level, exit_)
    if signal < 0:
        return signal
    sign = row_sign(ints, numbers, state, signal, mapped_size(ints, numbers, state, signal, 0))
    if sign == 0:
        sign = becomes(ints, numbers, waves, state, signal, 0)
    if sign > 0:
        sign = rate_sign(ints, numbers, state, signal)
    return 1 if sign <= 0 else 0


@compiled
def open_and_enter(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """3. Enter ENTERED_STATE with the changes in WISHES; return OK or FAILED.

    A rigid contact that opens loses its velocity towards its stop by an impulse.
    """
    targets, opened, entered = ints[WISHES], 0, ENTERED_STATE
    for i in range(ints[ELEMENTS]):
        numbers[ints[PUSHED] + i] = 0.0
        if ints[targets + i] == OPEN and ints[ints[KINDS] + i] == RIGID:
            ints[ints[TOUCHING] + opened] = i
            opened += 1
    if opened > 0:
        touching = ints[TOUCHING]
        status = collide(ints, numbers, ENTERED_STATE, touching, opened, 0, -1, -1, STRUCK, ints[IMPULSES], LOST_NOW)
        if status < 0:
            return status
        if same_speed(ints, numbers, ENTERED_STATE, STRUCK) == 0:
            for k in range(opened):
                numbers[ints[PUSHED] + ints[touching + k]] = numbers[ints[IMPULSES] + k]
        entered = STRUCK
    for i in range(ints[ELEMENTS]):
        if ints[targets + i] != NO_REQUEST:
            record_change(ints, numbers, i, ints[targets + i], numbers[ints[PUSHED] + i])
    enter(ints, numbers, waves, entered)
    return OK
