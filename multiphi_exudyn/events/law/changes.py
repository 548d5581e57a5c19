"""Changes of an instant: who asks, which levels are entered, what is lost on the way.

Sets of elements are flags (c,) in the ints; who asks, the state that each asks for, or NOBODY.
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
    "NOBODY",
    "bears_nothing",
    "clear",
    "enter",
    "flag_asking",
    "is_held",
    "note",
    "segment_at",
    "transfer",
    "turn_wishes",
    "without_stick",
]

NOBODY = -1  # in place of the state that an element asks for


@compiled
def flag_asking(ints: Ints, asking: int, flags: int) -> None:
    """Flags (c,) of those that ask."""
    for i in range(ints[ELEMENTS]):
        ints[flags + i] = 1 if ints[asking + i] != NOBODY else 0


@compiled
def turn_wishes(ints: Ints, numbers: Numbers, asking: int) -> None:
    """8, 10. Where the state that an element of WORKED asks for hangs on a speed or a place, the one that it says."""
    level = ints[WORKED + LEVEL]
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        element = ints[exit_ + ELEMENT]
        if ints[exit_ + TURN] >= 0 and ints[asking + element] == ints[exit_ + ASKED]:
            along = ints[exit_ + TURN + ROW] + ints[level + MODES] + ints[CHANNELS]
            sign = row_sign(ints, numbers, WORKED, exit_ + TURN, speed_size(ints, numbers, WORKED, along))
            if sign != 0:
                ints[asking + element] = ints[exit_ + (FORWARD if sign > 0 else BACKWARD)]
    for i in range(ints[ELEMENTS]):
        if ints[asking + i] != NOBODY and ints[ints[SEGMENTS] + 3 * i] > 0:
            segment = segment_at(ints, numbers, WORKED, i)
            if segment != ints[ints[level + STATES] + i]:
                ints[asking + i] = segment


@compiled
def segment_at(ints: Ints, numbers: Numbers, state: int, element: int) -> int:
    """8. The segment of a force law in which its place lies."""
    given, passed = ints[SEGMENTS] + 3 * element, 0
    first, above, below = ints[given], ints[given + 1], ints[given + 2]
    while passed < above and gap(ints, numbers, state, first + passed) < 0.0:
        passed += 1
    if passed > 0:
        return passed
    while passed < below and gap(ints, numbers, state, first + above + passed) < 0.0:
        passed += 1
    return above + passed if passed > 0 else 0


@compiled
def is_held(ints: Ints, state: int, element: int) -> int:
    """1 where a rigid contact is closed."""
    closed = ints[ints[ints[state + LEVEL] + STATES] + element] != OPEN
    return 1 if closed and ints[ints[KINDS] + element] == RIGID else 0


@compiled
def bears_nothing(ints: Ints, numbers: Numbers, element: int) -> int:
    """12. 1 where friction without a spring bears no impulse: its pressure is no reaction."""
    rigid = ints[ints[STICKS] + element] >= 0 and numbers[ints[SPRINGS] + element] == 0.0
    return 1 if rigid and ints[ints[KINDS] + element] != RIGID else 0


@compiled
def without_stick(ints: Ints, element: int, before: int) -> int:
    """12. The state of friction that does not stick where it could: idle at a contact that gives way, else in slip.

    There the slip that it is in ``before``, or forward.
    """
    sticks = ints[ints[STICKS] + element]
    gives_way = ints[ints[KINDS] + element] in (COMPLIANT, VISCOUS)
    return sticks + IDLE if gives_way else max(before, sticks + SLIP_FORWARD)


@compiled
def note(ints: Ints, numbers: Numbers, element: int, entered: int, impulse: float) -> None:
    """List a change: the state entered, or SHARED; shared impulses stand before the change that they belong to."""
    k = ints[CHANGE_COUNT]
    ints[ints[CHANGES] + k * CHANGE_WIDTH] = element
    ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] = entered
    ints[ints[CHANGES] + k * CHANGE_WIDTH + 2] = ints[ints[ints[WORKED + LEVEL] + STATES] + element]
    numbers[ints[CHANGE_IMPULSES] + k] = impulse
    ints[CHANGE_COUNT] = k + 1


@compiled
def enter(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """A state becomes WORKED, with its phases, and what was lost on the way is added up."""
    copy_state(ints, numbers, state, WORKED)
    update_phases(ints, numbers, waves, WORKED, -1)
    ints[TRANSITIONS_NOW] += 1
    if ints[TRANSITIONS_NOW] > 1:
        ints[MAPPED_AGAIN] = 1
    for k in range(LOSSES):
        numbers[LOST + k] += numbers[LOST_NOW + k]


@compiled
def transfer(ints: Ints, numbers: Numbers, state: int, key: int, result: int) -> int:
    """A state in the level with a key (eq. 38.6), and what truncation took in LOST_NOW; OK or NEED."""
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
    """Nothing is lost."""
    for k in range(LOSSES):
        numbers[losses + k] = 0.0
