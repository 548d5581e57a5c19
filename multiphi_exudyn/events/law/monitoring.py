"""Monitoring: the signals that a motion is searched for, and the requests when they fall (sentences 1, 5 to 7).

The first descent through zero of a signal, of its negative or of its rate (zero_crossing.py) makes an exit request a
change, or arms it.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    AGAIN,
    ARMED,
    ASKED,
    ASKING,
    CHANNELS,
    CONSTANTS,
    CURRENT,
    ELEMENT,
    ELEMENTS,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FALLEN,
    FLOW_BASIS,
    FLOW_COUNT,
    KINDS,
    LANDING,
    LEVEL,
    MODES,
    NOISES,
    OPEN,
    PHASES,
    PLACE,
    RATED,
    REACH,
    REACHED,
    RECOVERING,
    REFUSED,
    ROW,
    SETTLED,
    SIGNAL,
    SIGNALS,
    SPEED,
    STATES,
    SWING,
    UNMOVED,
    VISCOUS,
    WAITING,
    WORK_WAVES,
)
from multiphi_exudyn.events.law.changes import NO_REQUEST
from multiphi_exudyn.events.law.phases import entered_signal
from multiphi_exudyn.events.states.signal_flow import signal_waves
from multiphi_exudyn.events.states.signals import held_part, mapped_size
from multiphi_exudyn.events.states.state_arrays import accelerate
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import POWERS, differentiate
from multiphi_exudyn.mathematics.round_off import CLEAR, ZERO
from multiphi_exudyn.mathematics.search.zero_crossing import simultaneous

__all__ = ["arm", "collect_requests", "flag_repeated_requests", "watch"]


@compiled
def watch(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """1, 5, 6. List the signals of the flow from CURRENT whose first descent is searched; return their number, or NEED.

    WAITING holds the exit of each, and whether it then requests a change (1) or is armed (0). The phases are those of
    REACHED.
    """
    level, phases, count = ints[CURRENT + LEVEL], ints[REACHED + PHASES], 0
    for k in range(ints[level + EXIT_COUNT]):
        exit_, phase = ints[level + EXITS] + k * EXIT_INTS, ints[phases + k]
        if ints[ints[UNMOVED] + ints[exit_ + ELEMENT]] == 1:
            continue
        if phase in (ARMED, LANDING):
            count = wait_for(ints, numbers, waves, count, k, 0, 1.0, 0, 1)
            continue
        count = wait_for(ints, numbers, waves, count, k, 0, -1.0, 0, 0)
        if phase == RECOVERING:
            count = wait_for(ints, numbers, waves, count, k, 0, 1.0, 1, 1)
        if phase == REFUSED:
            signal = entered_signal(ints, level, exit_)
            if signal < 0:
                return signal
            count = wait_for(ints, numbers, waves, count, k, signal, -1.0, 0, 1)
    return count


@compiled
def wait_for(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    count: int,
    exit_number: int,
    entered: int,
    sign: float,
    rate: int,
    asks: int,
) -> int:
    """7. List the signal of an exit, or the one ``entered``, times ``sign``, or its rate; count + 1.

    A start value that is round-off, of its own terms or of the map that has made CURRENT, counts as zero. If the sum of
    the exponentials, which has a round-off of its own, is below zero there, the signal is shifted to start at zero. So
    is the force that truncation has left a viscous contact at its opening.
    """
    level = ints[CURRENT + LEVEL]
    signal = entered if entered > 0 else ints[level + EXITS] + exit_number * EXIT_INTS + SIGNAL
    n, p, row = ints[level + MODES] + ints[CHANNELS], ints[FLOW_COUNT], ints[signal + ROW]
    x, v, scale, first = ints[CURRENT + PLACE], ints[CURRENT + SPEED], ints[CURRENT + REACH], ints[SIGNALS] + count * p
    signal_waves(ints, numbers, waves, CURRENT, signal, first)
    begins, size = numbers[row + 2 * n], abs(numbers[row + 2 * n])
    constant = begins + held_part(ints, numbers, CURRENT, signal)
    if rate == 1:
        differentiate(ints, numbers, waves, ints[FLOW_BASIS], first, first)
        x, v, scale = v, ints[ACCELERATION], ints[CURRENT + SWING]
        constant, begins, size = 0.0, 0.0, 0.0
    for i in range(n):
        size += abs(numbers[row + i]) * (abs(numbers[x + i]) + numbers[scale + i])
        begins += numbers[row + i] * numbers[x + i]
    if ints[signal + RATED] == 1:
        swing = ints[CURRENT + SWING]
        if rate == 1:
            accelerate(ints, numbers, CURRENT, v)
        for i in range(n):
            size += abs(numbers[row + n + i]) * (abs(numbers[v + i]) + (numbers[swing + i] if rate == 0 else 0.0))
            begins += numbers[row + n + i] * numbers[v + i]
    may_be_zero = sign * begins <= ZERO * size
    is_round_off = abs(begins) <= ZERO * (size + mapped_size(ints, numbers, CURRENT, signal, rate))
    if may_be_zero and (is_round_off or (entered > 0 and is_open_viscous(ints, level, exit_number) == 1)):
        constant -= sign * min(sign * start_value(ints, waves, first, constant), 0.0)
    if sign < 0.0:
        for j in range(p):
            waves[first + j] = -waves[first + j]
    numbers[ints[CONSTANTS] + count] = sign * constant
    numbers[ints[NOISES] + count] = CLEAR * size
    ints[ints[WAITING] + 2 * count] = exit_number
    ints[ints[WAITING] + 2 * count + 1] = asks
    return count + 1


@compiled
def is_open_viscous(ints: Ints, level: int, exit_number: int) -> int:
    """Return 1 if an exit is the one by which a viscous contact closes."""
    exit_ = ints[level + EXITS] + exit_number * EXIT_INTS
    viscous = ints[ints[KINDS] + ints[exit_ + ELEMENT]] == VISCOUS
    return 1 if viscous and ints[ints[level + STATES] + ints[exit_ + ELEMENT]] == OPEN else 0


@compiled
def start_value(ints: Ints, waves: Waves, signal: int, constant: float) -> float:
    """Return the value of a signal (p,) at the start of the flow."""
    value, powers = constant, ints[ints[FLOW_BASIS] + POWERS]
    for j in range(ints[FLOW_COUNT]):
        value += waves[signal + j].real if ints[powers + j] == 0 else 0.0
    return value


@compiled
def collect_requests(ints: Ints, numbers: Numbers, waves: Waves, count: int, found: int, reached: float) -> int:
    """1. Set ASKING: the requests of elements whose signals fall through zero at an instant; return their number."""
    level, flags, waiting, asking = ints[CURRENT + LEVEL], ints[FALLEN], ints[WAITING], 0
    for i in range(ints[ELEMENTS]):
        ints[ints[ASKING] + i] = NO_REQUEST
    if ints[level + EXIT_COUNT] > 1:
        simultaneous(
            ints, numbers, waves, ints[FLOW_BASIS], ints[SIGNALS], ints[CONSTANTS], count, found, reached,
            ints[WORK_WAVES], flags,
        )  # fmt: skip
    else:  # one contact's signals exclude each other
        for s in range(count):
            ints[flags + s] = 1 if s == found else 0
    for s in range(count):
        if ints[flags + s] == 1 and ints[waiting + 2 * s + 1] == 1:
            exit_ = ints[level + EXITS] + ints[waiting + 2 * s] * EXIT_INTS
            ints[ints[ASKING] + ints[exit_ + ELEMENT]] = ints[exit_ + ASKED]
            asking += 1
    return asking


@compiled
def arm(ints: Ints, exit_number: int) -> None:
    """Arm an exit of the state REACHED."""
    phases, settled = ints[REACHED + PHASES], 1
    ints[phases + exit_number] = ARMED
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        if ints[phases + k] != ARMED:
            settled = 0
    ints[REACHED + SETTLED] = settled


@compiled
def flag_repeated_requests(ints: Ints, at_once: int) -> None:
    """6. Set AGAIN: elements that request a change at the same instant at which they were refused."""
    phases, exits = ints[REACHED + PHASES], ints[ints[REACHED + LEVEL] + EXITS]
    for i in range(ints[ELEMENTS]):
        ints[ints[AGAIN] + i] = 0
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        element = ints[exits + k * EXIT_INTS + ELEMENT]
        if at_once == 1 and ints[ints[ASKING] + element] != NO_REQUEST and ints[phases + k] == REFUSED:
            ints[ints[AGAIN] + element] = 1
