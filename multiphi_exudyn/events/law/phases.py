"""Phases: what every exit of a state waits for, by sentences 1, 5 and 6 of the law (events/law).

An exit is ARMED, RECOVERING, REFUSED or HELD_BACK. s is its signal.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    AGAIN,
    ARMED,
    ASKED,
    CHANNELS,
    ELEMENT,
    ENTERED,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FIRMNESS,
    FIRST_EXITS,
    FLOW_BASIS,
    FLOW_COUNT,
    HEARD,
    HELD_BACK,
    KINDS,
    LEVEL,
    MODES,
    NEED,
    NEED_ENTERED,
    NEEDED,
    NEEDED_FROM,
    NEEDED_KEY,
    OPEN,
    PHASES,
    REACHED,
    RECOVERING,
    REFUSED,
    RIGID,
    ROW,
    SEARCH_NUMBERS,
    SEARCH_WAVES,
    SETTLED,
    SIGNAL,
    STATES,
    UNMOVED,
    WORK_WAVES,
    WORKED,
)
from multiphi_exudyn.events.states.flow import expand
from multiphi_exudyn.events.states.signal_flow import signal_sizes, signal_waves
from multiphi_exudyn.events.states.signals import held_part, held_size, mapped_size, rate_sign, row_sign
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.search.zero_crossing import first_sign
from multiphi_exudyn.mechanics.elements.element import ALWAYS_TAKEN, MAY_RECOVER, NEVER_RECOVERS, TAKEN_ONCE

__all__ = [
    "arm_return_exits",
    "becomes",
    "entered_signal",
    "first_exit",
    "hold_back",
    "is_denied",
    "is_pulled",
    "is_refused",
    "opening",
    "phase_of",
    "update_phases",
]


@compiled
def phase_of(ints: Ints, numbers: Numbers, waves: Waves, state: int, exit_: int) -> int:
    """1, 5. ARMED where s is or becomes positive, RECOVERING where it is negative and may rise, else REFUSED."""
    signal, mapped, firmness = exit_ + SIGNAL, 0.0, ints[exit_ + FIRMNESS]
    if firmness in (ALWAYS_TAKEN, NEVER_RECOVERS):  # a reaction, or what may not be negative by round-off
        mapped = mapped_size(ints, numbers, state, signal, 0)
    value = row_sign(ints, numbers, state, signal, mapped)
    if value > 0:
        return ARMED
    rate = rate_sign(ints, numbers, state, signal)
    if rate == 0:
        rate = becomes(ints, numbers, waves, state, signal, 2)
    if value == 0 and rate >= 0:
        return ARMED
    recovers = firmness == MAY_RECOVER or firmness >= TAKEN_ONCE
    return RECOVERING if rate > 0 and recovers else REFUSED


@compiled
def becomes(ints: Ints, numbers: Numbers, waves: Waves, state: int, signal: int, since: int) -> int:
    """9. Sign of a signal's first derivative, of order ``since`` or higher, that is not round-off."""
    n = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS]
    expand(ints, numbers, waves, state)
    signal_waves(ints, numbers, waves, state, signal, ints[WORK_WAVES])
    signal_sizes(ints, numbers, waves, state, signal, ints[SEARCH_NUMBERS])
    own, held = numbers[ints[signal + ROW] + 2 * n], held_part(ints, numbers, state, signal)
    size = abs(own) + held_size(ints, numbers, state, signal)
    return first_sign(
        ints, numbers, waves, ints[FLOW_BASIS], ints[WORK_WAVES], own + held, size, ints[SEARCH_NUMBERS], since,
        ints[SEARCH_NUMBERS] + ints[FLOW_COUNT], ints[SEARCH_WAVES],
    )  # fmt: skip


@compiled
def update_phases(ints: Ints, numbers: Numbers, waves: Waves, state: int, refused: int) -> None:
    """6. Set the phase of every exit of a state; refused: flags of elements with refused requests, -1 for none."""
    level, phases = ints[state + LEVEL], ints[state + PHASES]
    count, exits, settled = ints[level + EXIT_COUNT], ints[level + EXITS], 1
    for k in range(count):
        exit_, ints[phases + k] = exits + k * EXIT_INTS, ARMED
        if ints[ints[UNMOVED] + ints[exit_ + ELEMENT]] == 0:
            ints[phases + k] = phase_of(ints, numbers, waves, state, exit_)
        if ints[phases + k] != ARMED:
            settled = 0
    if refused >= 0:
        for k in range(count):
            if ints[refused + ints[exits + k * EXIT_INTS + ELEMENT]] == 1 and ints[phases + k] != ARMED:
                ints[phases + k] = REFUSED
    ints[state + SETTLED] = settled


@compiled
def is_denied(ints: Ints, state: int, element: int) -> int:
    """4, 10. Return 1 if an exit of an element is refused, unless it is always taken: such exits follow at once."""
    level = ints[state + LEVEL]
    first = ints[level + FIRST_EXITS] + element
    for k in range(ints[first], ints[first + 1]):
        firm = ints[ints[level + EXITS] + k * EXIT_INTS + FIRMNESS] >= ALWAYS_TAKEN
        if ints[ints[state + PHASES] + k] == REFUSED and not firm:
            return 1
    return 0


@compiled
def is_refused(ints: Ints, state: int, element: int) -> int:
    """Return 1 if an exit of an element is refused."""
    first = ints[ints[state + LEVEL] + FIRST_EXITS] + element
    for k in range(ints[first], ints[first + 1]):
        if ints[ints[state + PHASES] + k] == REFUSED:
            return 1
    return 0


@compiled
def is_pulled(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> int:
    """3. Return 1 if the motion from a state would pull a rigid contact."""
    level = ints[state + LEVEL]
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        opens = ints[exit_ + ASKED] == OPEN and ints[ints[KINDS] + ints[exit_ + ELEMENT]] == RIGID
        if opens and phase_of(ints, numbers, waves, state, exit_) == REFUSED:
            return 1
    return 0


@compiled
def hold_back(ints: Ints, state: int) -> None:
    """6. Hold back refused exits of elements that were refused before at this instant, until s rises to zero."""
    level = ints[state + LEVEL]
    for k in range(ints[level + EXIT_COUNT]):
        element = ints[ints[level + EXITS] + k * EXIT_INTS + ELEMENT]
        if ints[ints[AGAIN] + element] == 1 and ints[ints[state + PHASES] + k] == REFUSED:
            ints[ints[state + PHASES] + k] = HELD_BACK
            ints[state + SETTLED] = 0


@compiled
def arm_return_exits(ints: Ints, numbers: Numbers) -> None:
    """Arm exits that are always taken, have a zero signal and lead back to the state before the instant.

    The signal by which the element came here was zero too: what either signal says beyond that is round-off. This does
    not concern a rigid contact that is left without a reaction, which opens, nor an element that other elements
    changed.
    """
    level, before = ints[WORKED + LEVEL], ints[ints[REACHED + LEVEL] + STATES]
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        element, phase = ints[exit_ + ELEMENT], ints[WORKED + PHASES] + k
        back = ints[exit_ + FIRMNESS] >= ALWAYS_TAKEN and ints[exit_ + ASKED] == ints[before + element]
        pulls = ints[ints[KINDS] + element] == RIGID and ints[exit_ + ASKED] == OPEN
        back = back and ints[phase] == REFUSED and not pulls
        back = back and ints[ints[HEARD] + element] == 1
        if back and row_sign(ints, numbers, WORKED, exit_ + SIGNAL, 0.0) == 0:
            ints[phase] = ARMED


@compiled
def first_exit(ints: Ints, level: int, element: int) -> int:
    """Return the record of the first exit of an element in a level."""
    return ints[level + EXITS] + ints[ints[level + FIRST_EXITS] + element] * EXIT_INTS


@compiled
def opening(ints: Ints, level: int, element: int) -> int:
    """Return the record of the exit by which a closed contact opens."""
    k = ints[ints[level + FIRST_EXITS] + element]
    while ints[ints[level + EXITS] + k * EXIT_INTS + ASKED] != OPEN:
        k += 1
    return ints[level + EXITS] + k * EXIT_INTS


@compiled
def entered_signal(ints: Ints, level: int, exit_: int) -> int:
    """Return the signal that an element would have in the level that its exit alone enters; or NEED."""
    if ints[exit_ + ENTERED] < 0:
        ints[NEEDED] = NEED_ENTERED
        ints[NEEDED_FROM] = level
        ints[ints[NEEDED_KEY]] = (exit_ - ints[level + EXITS]) // EXIT_INTS
        return NEED
    return ints[exit_ + ENTERED]
