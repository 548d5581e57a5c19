"""Compliant contacts change, rigid ones open, by sentences 3, 4 and 7 of the law (decision.py)."""

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
from multiphi_exudyn.events.law.changes import NOBODY, enter, flag_asking, note, transfer
from multiphi_exudyn.events.law.impact import collide
from multiphi_exudyn.events.law.phases import becomes, entered_signal, first_exit, is_denied, update_phases
from multiphi_exudyn.events.law.redundancy import thin_out
from multiphi_exudyn.events.law.resting import same_speed
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mechanics.element import ALWAYS_TAKEN

__all__ = ["open_and_enter", "switch"]


@compiled
def switch(ints: Ints, numbers: Numbers, waves: Waves, asking: int) -> int:
    """4. Compliant contacts change where the level they enter admits it, rigid ones open; OK, NEED or FAILED.

    Where it admits none of several together, the first that it admits alone.
    """
    c, wishes, singles, at = ints[ELEMENTS], ints[WISHES], ints[SINGLES], -1
    for i in range(c):
        ints[wishes + i] = ints[asking + i]
    thin_out(ints, numbers, wishes)
    while True:
        wished = 0
        for i in range(c):
            wished += 1 if ints[wishes + i] != NOBODY else 0
        denied = try_wishes(ints, numbers, waves)
        if denied < 0:
            return denied
        if denied == 0:
            return open_and_enter(ints, numbers, waves)
        if denied < wished:
            for i in range(c):
                ints[wishes + i] = NOBODY if ints[ints[DENIED] + i] == 1 else ints[wishes + i]
            continue
        if wished > 1:
            for i in range(c):
                ints[singles + i] = ints[wishes + i]
            at = 0
        while 0 <= at < c and ints[singles + at] == NOBODY:
            at += 1
        if at < 0 or at >= c:
            break
        for i in range(c):
            ints[wishes + i] = ints[singles + i] if i == at else NOBODY
        at += 1
    flag_asking(ints, asking, ints[DENIED])
    update_phases(ints, numbers, waves, WORKED, ints[DENIED])
    return OK


@compiled
def try_wishes(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """4. How many of WISHES the level they enter denies, and which: DENIED; or NEED. ENTERED_STATE: the state in it."""
    states, wishes, key, denied = ints[ints[WORKED + LEVEL] + STATES], ints[WISHES], ints[KEY], 0
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[states + i] if ints[wishes + i] == NOBODY else ints[wishes + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    update_phases(ints, numbers, waves, ENTERED_STATE, -1)
    for i in range(ints[ELEMENTS]):
        ints[ints[DENIED] + i] = 0
        wished = ints[wishes + i]
        if wished != NOBODY and is_firm(ints, i, wished) == 0 and is_denied(ints, ENTERED_STATE, i) == 1:
            relaxes = is_relaxing(ints, numbers, waves, ENTERED_STATE, i)
            if relaxes < 0:
                return relaxes
            ints[ints[DENIED] + i] = 1 - relaxes
            denied += 1 - relaxes
    return denied


@compiled
def is_firm(ints: Ints, element: int, asked: int) -> int:
    """3, 8. 1 where an element of WORKED takes its exit into a state whatever that state says."""
    level = ints[WORKED + LEVEL]
    first = ints[level + FIRST_EXITS] + element
    for k in range(ints[first], ints[first + 1]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        if ints[exit_ + ASKED] == asked and ints[exit_ + FIRMNESS] >= ALWAYS_TAKEN:
            return 1
    return 0


@compiled
def is_relaxing(ints: Ints, numbers: Numbers, waves: Waves, state: int, element: int) -> int:
    """7. 1 where a viscous contact is open where closed it would pull; or NEED."""
    level = ints[state + LEVEL]
    if ints[ints[KINDS] + element] != VISCOUS or ints[ints[level + STATES] + element] != OPEN:
        return 0
    exit_ = first_exit(ints, level, element)
    signal = entered_signal(ints, level, exit_)
    if signal < 0:
        return signal
    sign = row_sign(ints, numbers, state, signal, 0.0)
    if sign == 0:
        sign = becomes(ints, numbers, waves, state, signal, 0)
    return 1 if sign <= 0 else 0


@compiled
def open_and_enter(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """3. ENTERED_STATE is entered by WISHES: a rigid contact that opens keeps no speed into its stop; OK or FAILED."""
    wishes, opened, entered = ints[WISHES], 0, ENTERED_STATE
    for i in range(ints[ELEMENTS]):
        numbers[ints[PUSHED] + i] = 0.0
        if ints[wishes + i] == OPEN and ints[ints[KINDS] + i] == RIGID:
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
        if ints[wishes + i] != NOBODY:
            note(ints, numbers, i, ints[wishes + i], numbers[ints[PUSHED] + i])
    enter(ints, numbers, waves, entered)
    return OK
