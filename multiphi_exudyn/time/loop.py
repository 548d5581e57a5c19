"""Loop: a run from event to event, in flat arrays (events/arrays.py). There is no time step.

Within a level the motion is a sum of exponentials; the next event is the certified first descent of a few of them
(zero_crossing.py); the event rule (flat_rule.py) gives the state that follows. Nothing of a segment is kept before it
is complete: where something is missing (NEED), or the record is full (FULL), the loop is called again, and the segment
is made again from its start.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    AGAIN,
    AGE,
    ALLOWED,
    ARMED,
    ASKED,
    ASKING,
    CARRIED,
    CAUSE,
    CHAIN_COUNT,
    CHAIN_MARKS,
    CHAINS,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    CHATTER,
    CONSTANTS,
    COORDINATE_COUNT,
    COORDINATE_NUMBERS,
    CURRENT,
    DECISIONS,
    DRIVE,
    DRIVE_NEXT,
    DRIVE_WAVES,
    ELEMENT,
    ELEMENTS,
    END_COUNT,
    END_REACHED,
    ENDS,
    EVENT,
    EVENT_COUNT,
    EVENT_INTS,
    EVENT_NUMBERS,
    EVENT_ROOM,
    EVENT_WIDTH,
    EVENT_WIDTH_NUMBERS,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FAILED,
    FALLEN,
    FLOW_BASIS,
    FLOW_COUNT,
    FORCED_ROOM,
    FORCED_WANTED,
    FOUND,
    FULL,
    GIVEN_UP,
    HIGHEST_FREQUENCY,
    HORIZON,
    INSTANT_TIME,
    LAST_DECISION,
    LEVEL,
    LOSSES,
    LOST,
    MODES,
    NEED,
    NEED_PIECES,
    NEED_ROOM,
    NEEDED,
    NOISES,
    NOT_FINITE,
    NUMBER,
    OK,
    PHASE_COUNT,
    PHASE_INTS,
    PHASES,
    PIECE,
    PIECE_COUNT,
    PIECE_TIMES,
    PIECES,
    PLACE,
    REACH,
    REACHED,
    RECOVERING,
    REFUSED,
    RING,
    ROW,
    SEARCH_NUMBERS,
    SEARCH_WAVES,
    SEGMENT_COUNT,
    SEGMENT_INTS,
    SEGMENT_NUMBERS,
    SEGMENT_ROOM,
    SEGMENT_WIDTH,
    SEGMENT_WIDTH_NUMBERS,
    SETTLED,
    SHARED,
    SIGNAL,
    SIGNALS,
    SPEED,
    STOP_AT_EVENT,
    SWING,
    TIME,
    TOLD,
    TOO_LONG,
    TRANSITIONS,
    TRANSITIONS_NOW,
    UNAVAILABLE,
    WAITING,
    WHOLE,
    WINDOW,
    WORK,
    WORK_WAVES,
    WORKED,
)
from multiphi_exudyn.events.flat_rule import NOBODY, decide, entered_signal, is_end, mark_chains
from multiphi_exudyn.events.flat_state import (
    accelerate,
    copy_state,
    kinetic,
    measure,
    pattern_work,
    potential,
    row_sign,
)
from multiphi_exudyn.events.flow import expand, keep_drive, load_piece, set_drive, signal_waves, state_at
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.flat_basis import SCALES, differentiate
from multiphi_exudyn.mathematics.round_off import CLEAR
from multiphi_exudyn.mathematics.zero_crossing import INSTANT, NONE, first_descent, simultaneous

__all__ = ["ACCUMULATED", "advance"]

ACCUMULATED = 1e-6  # of the time so far: a window of events within it is chatter, also where no mode oscillates
SEARCH_TOO_LONG = -3  # zero_crossing.TOO_LONG


@compiled
def advance(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """Carries the state CURRENT to ``end``, or to what stops it: END_REACHED, EVENT, NEED, FULL or FAILED."""
    while numbers[TIME] < end:
        if ints[SEGMENT_COUNT] >= ints[SEGMENT_ROOM]:
            return FULL
        known = ints[EVENT_COUNT]
        status = OK
        if ints[CHANNELS] > 0 and numbers[TIME] >= piece_end(ints, numbers):
            status = next_piece(ints, numbers, waves, end)
        if status >= 0:
            until = min(end, piece_end(ints, numbers)) if ints[CHANNELS] > 0 else end
            status = one_segment(ints, numbers, waves, until)
        status = given_up(ints, status)
        if status >= 0 and ints[EVENT_COUNT] > known:
            status = EVENT
        if status < 0 or (status == EVENT and ints[STOP_AT_EVENT] == 1):
            return status
    return END_REACHED


@compiled
def given_up(ints: Ints, status: int) -> int:
    """What is needed and cannot be had is a failure."""
    if status == NEED and ints[GIVEN_UP] == 1:
        ints[CAUSE] = UNAVAILABLE
        return FAILED
    return status


@compiled
def piece_end(ints: Ints, numbers: Numbers) -> float:
    """When [s] the present piece of the channels ends."""
    return numbers[ints[ints[ints[PIECES] + ints[PIECE]] + PIECE_TIMES] + 1]


@compiled
def next_piece(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """The same state on the piece that follows; a load that jumps may make elements ask; OK, NEED, FULL or FAILED."""
    r, q, level = ints[ints[CURRENT + LEVEL] + MODES], ints[CHANNELS], ints[CURRENT + LEVEL]
    if ints[PIECE] + 1 >= ints[PIECE_COUNT]:
        ints[NEEDED] = NEED_PIECES
        return NEED
    energy = kinetic(ints, numbers, CURRENT) + potential(ints, numbers, CURRENT) + pattern_work(ints, numbers, CURRENT)
    ints[PIECE] += 1
    load_piece(ints, waves)
    set_drive(ints, numbers, waves, ints[DRIVE_WAVES], 0.0, numbers[TIME], min(end, piece_end(ints, numbers)))
    copy_state(ints, numbers, CURRENT, REACHED)
    x, v, row = ints[REACHED + PLACE], ints[REACHED + SPEED], ints[level + CARRIED]
    for k in range(q):
        numbers[x + r + k] = numbers[ints[DRIVE] + k]
        jump = numbers[v + r + k] - numbers[ints[DRIVE] + q + k]
        numbers[v + r + k] -= jump
        for i in range(r if row >= 0 else 0):
            numbers[v + i] += numbers[row + k * (r + q) + i] * jump
    measure(ints, numbers, REACHED)
    status = given_up(ints, decide_jump(ints, numbers, waves))
    if status == NEED or ints[EVENT_COUNT] + ints[CHANGE_COUNT] > ints[EVENT_ROOM]:
        ints[PIECE] -= 1
        return NEED if status == NEED else FULL
    after = REACHED if status != EVENT else WORKED
    work = kinetic(ints, numbers, REACHED) + potential(ints, numbers, REACHED) - energy
    numbers[WORK] += work + pattern_work(ints, numbers, after)
    copy_state(ints, numbers, after, CURRENT)
    numbers[AGE] = 0.0
    if status == EVENT:
        ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
        keep_events(ints, numbers)
    return OK if status >= 0 else status


@compiled
def decide_jump(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """The decision after channels have jumped: OK where nobody asks, EVENT where somebody does; NEED or FAILED."""
    exits, asking = ints[ints[REACHED + LEVEL] + EXITS], 0
    for i in range(ints[ELEMENTS]):
        ints[ints[ASKING] + i] = NOBODY
        ints[ints[AGAIN] + i] = 0
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        exit_ = exits + k * EXIT_INTS
        if ints[ints[REACHED + PHASES] + k] == ARMED and row_sign(ints, numbers, REACHED, exit_ + SIGNAL) < 0:
            ints[ints[ASKING] + ints[exit_ + ELEMENT]] = ints[exit_ + ASKED]
            asking = 1
    ints[CHANGE_COUNT] = 0
    if asking == 0:
        return OK
    status = decide(ints, numbers, waves)
    return status if status < 0 else EVENT


@compiled
def one_segment(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """One level's motion up to the next decision, or to ``end``; OK, EVENT, NEED, FULL or FAILED.

    Exits are armed on the way: the state REACHED has their phases, and becomes the state of the instant.
    """
    level, started, samples = ints[CURRENT + LEVEL], numbers[TIME], numbers[ints[FOUND] + 1]
    horizon, reached, armed_at, asking = end - started, 0.0, 0.0, 0
    if ints[CHANNELS] > 0:
        set_drive(ints, numbers, waves, ints[DRIVE_WAVES], 0.0, started, end)
    expand(ints, numbers, waves, CURRENT)
    copy_state(ints, numbers, CURRENT, REACHED)
    while asking == 0:
        count = watch(ints, numbers, waves)
        if count < 0:
            numbers[ints[FOUND] + 1] = samples
            return count
        found = first_descent(
            ints, numbers, waves, ints[FLOW_BASIS], ints[SIGNALS], ints[CONSTANTS], ints[NOISES], count, reached,
            horizon, ints[SEARCH_NUMBERS], ints[SEARCH_WAVES], ints[FOUND],
        )  # fmt: skip
        if found < NONE:
            ints[CAUSE] = TOO_LONG if found == SEARCH_TOO_LONG else NOT_FINITE
            numbers[TOLD] = numbers[ints[ints[FLOW_BASIS] + SCALES] + 1]
            numbers[TOLD + 1] = numbers[ints[FOUND] + 2]
            numbers[TOLD + 2] = numbers[ints[FOUND] + 3]
            return FAILED
        if found == NONE:
            reached = horizon
            break
        reached = numbers[ints[FOUND]]
        asking = who_asks(ints, numbers, waves, count, found, reached)
        if asking == 0:
            arm(ints, ints[ints[WAITING] + 2 * found])
            armed_at = reached
    numbers[INSTANT_TIME] = end if reached == horizon else started + reached
    state_at(ints, numbers, waves, level, reached, ints[REACHED + PLACE], ints[REACHED + SPEED])
    unit = numbers[HORIZON]
    if ints[CHANNELS] > 0:
        set_drive(ints, numbers, waves, ints[DRIVE_NEXT], reached, numbers[INSTANT_TIME], end)
    measure(ints, numbers, REACHED)
    fastest = numbers[ints[ints[FLOW_BASIS] + SCALES] + 1]
    at_once = reached <= (INSTANT / fastest if fastest > 0.0 else 0.0)
    status = OK
    if asking > 0:
        flag_again(ints, 1 if at_once and ints[WHOLE] == 0 else 0)
        status = decide(ints, numbers, waves)
    else:
        ints[CHANGE_COUNT] = 0
    status = given_up(ints, status)
    if ints[FORCED_WANTED] > ints[FORCED_ROOM]:
        ints[NEEDED], status = NEED_ROOM, NEED
    if status == NEED or ints[EVENT_COUNT] + ints[CHANGE_COUNT] > ints[EVENT_ROOM]:
        numbers[ints[FOUND] + 1] = samples
        return NEED if status == NEED else FULL
    keep_segment(ints, numbers, armed_at, unit)
    if ints[CHANNELS] > 0:
        keep_drive(ints, waves)
        numbers[AGE] += reached
    if asking == 0:
        copy_state(ints, numbers, REACHED, CURRENT)
        return OK
    return carry_on(ints, numbers, level, status)


@compiled
def carry_on(ints: Ints, numbers: Numbers, level: int, status: int) -> int:
    """The state after a decision becomes the current one, with its events; OK, EVENT or FAILED."""
    window = ints[WINDOW]
    last = ints[RING] + 2 * (ints[DECISIONS] % (window + 1))
    numbers[last] = numbers[LAST_DECISION]
    numbers[last + 1] = numbers[ints[level + HIGHEST_FREQUENCY]]
    numbers[LAST_DECISION] = numbers[TIME]
    ints[DECISIONS] += 1
    ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
    if status < 0:
        copy_state(ints, numbers, REACHED, CURRENT)
        return status
    if ints[CHANNELS] > 0:
        numbers[WORK] += pattern_work(ints, numbers, WORKED) - pattern_work(ints, numbers, REACHED)
    copy_state(ints, numbers, WORKED, CURRENT)
    keep_events(ints, numbers)
    if is_chatter(ints, numbers) == 1:
        ints[CAUSE] = CHATTER
        return FAILED
    return EVENT if ints[CHANGE_COUNT] > 0 else OK


@compiled
def arm(ints: Ints, exit_number: int) -> None:
    """An exit of the state REACHED is armed."""
    phases, settled = ints[REACHED + PHASES], 1
    ints[phases + exit_number] = ARMED
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        if ints[phases + k] != ARMED:
            settled = 0
    ints[REACHED + SETTLED] = settled


@compiled
def flag_again(ints: Ints, at_once: int) -> None:
    """AGAIN: who asks at the instant at which it was refused before."""
    phases, exits = ints[REACHED + PHASES], ints[ints[REACHED + LEVEL] + EXITS]
    for i in range(ints[ELEMENTS]):
        ints[ints[AGAIN] + i] = 0
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        element = ints[exits + k * EXIT_INTS + ELEMENT]
        if at_once == 1 and ints[ints[ASKING] + element] != NOBODY and ints[phases + k] == REFUSED:
            ints[ints[AGAIN] + element] = 1


# ---------------------------------------------------------------------- signals that are waited for


@compiled
def watch(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Signals whose first descent is next, of the flow from CURRENT; how many, or NEED.

    Of each the exit, and whether that then asks or is armed, in WAITING. The phases are those of REACHED.
    """
    level, phases, count = ints[CURRENT + LEVEL], ints[REACHED + PHASES], 0
    if ints[REACHED + SETTLED] == 1:
        for e in range(ints[level + END_COUNT]):
            count = wait_for(ints, numbers, waves, count, ints[ints[level + ENDS] + e], 0, 1.0, 0, 1)
        return count
    if ints[CHAIN_COUNT] > 0:
        mark_chains(ints, REACHED)
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        chain = ints[ints[CHAINS] + ints[exit_ + ELEMENT]]
        if chain >= 0 and ints[ints[CHAIN_MARKS] + chain] == 0 and is_end(ints, level, k) == 0:
            continue
        phase = ints[phases + k]
        if phase == ARMED:
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
    """List the signal of an exit, or the one ``entered``, times ``sign``, or its rate; count + 1."""
    level = ints[CURRENT + LEVEL]
    signal = entered if entered > 0 else ints[level + EXITS] + exit_number * EXIT_INTS + SIGNAL
    n, p, row = ints[level + MODES] + ints[CHANNELS], ints[FLOW_COUNT], ints[signal + ROW]
    x, v, scale = ints[CURRENT + PLACE], ints[CURRENT + SPEED], ints[CURRENT + REACH]
    first = ints[SIGNALS] + count * p
    signal_waves(ints, numbers, waves, CURRENT, signal, first)
    constant, size = sign * numbers[row + 2 * n], abs(numbers[row + 2 * n])
    if rate == 1:
        differentiate(ints, numbers, waves, ints[FLOW_BASIS], first, first)
        accelerate(ints, numbers, CURRENT, ints[ACCELERATION])
        x, v, scale = ints[CURRENT + SPEED], ints[ACCELERATION], ints[CURRENT + SWING]
        constant, size = 0.0, 0.0
    for i in range(n):
        size += abs(numbers[row + i]) * (abs(numbers[x + i]) + numbers[scale + i])
        size += abs(numbers[row + n + i]) * abs(numbers[v + i])
    if sign < 0.0:
        for j in range(p):
            waves[first + j] = -waves[first + j]
    numbers[ints[CONSTANTS] + count] = constant
    numbers[ints[NOISES] + count] = CLEAR * size
    ints[ints[WAITING] + 2 * count] = exit_number
    ints[ints[WAITING] + 2 * count + 1] = asks
    return count + 1


@compiled
def who_asks(ints: Ints, numbers: Numbers, waves: Waves, count: int, found: int, reached: float) -> int:
    """ASKING: of the elements whose signals fall at an instant those that then ask; how many."""
    level, flags, waiting, asking = ints[CURRENT + LEVEL], ints[FALLEN], ints[WAITING], 0
    for i in range(ints[ELEMENTS]):
        ints[ints[ASKING] + i] = NOBODY
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


# ---------------------------------------------------------------------- record


@compiled
def keep_segment(ints: Ints, numbers: Numbers, armed_at: float, horizon: float) -> None:
    """Record the segment from CURRENT to the instant, which becomes the present time."""
    k, level = ints[SEGMENT_COUNT], ints[CURRENT + LEVEL]
    n, row = ints[level + MODES] + ints[CHANNELS], ints[SEGMENT_INTS] + k * SEGMENT_WIDTH
    ints[row] = ints[level + NUMBER]
    ints[row + 1] = ints[PIECE]
    ints[row + 2] = ints[EVENT_COUNT]
    ints[row + 3] = ints[COORDINATE_COUNT]
    ints[row + 4] = ints[PHASE_COUNT] if ints[CURRENT + SETTLED] == 0 else -1
    if ints[CURRENT + SETTLED] == 0:
        for e in range(ints[level + EXIT_COUNT]):
            ints[ints[PHASE_INTS] + ints[PHASE_COUNT] + e] = ints[ints[CURRENT + PHASES] + e]
        ints[PHASE_COUNT] += ints[level + EXIT_COUNT]
    given = ints[SEGMENT_NUMBERS] + k * SEGMENT_WIDTH_NUMBERS
    numbers[given] = numbers[TIME]
    numbers[given + 1] = numbers[INSTANT_TIME]
    numbers[given + 2] = armed_at
    numbers[given + 3] = horizon
    numbers[given + 4] = numbers[WORK]
    numbers[given + 5] = numbers[AGE]
    kept = ints[COORDINATE_NUMBERS] + ints[COORDINATE_COUNT]
    for i in range(n):
        numbers[kept + i] = numbers[ints[CURRENT + PLACE] + i]
        numbers[kept + n + i] = numbers[ints[CURRENT + SPEED] + i]
    ints[COORDINATE_COUNT] += 2 * n
    ints[SEGMENT_COUNT] = k + 1
    numbers[TIME] = numbers[INSTANT_TIME]
    numbers[WORK] = 0.0


@compiled
def keep_events(ints: Ints, numbers: Numbers) -> None:
    """Record the changes of a decision; the first carries the energy lost at the whole instant."""
    first = 1
    for k in range(ints[CHANGE_COUNT]):
        row = ints[EVENT_INTS] + (ints[EVENT_COUNT] + k) * EVENT_WIDTH
        given = ints[EVENT_NUMBERS] + (ints[EVENT_COUNT] + k) * EVENT_WIDTH_NUMBERS
        entered = ints[ints[CHANGES] + k * CHANGE_WIDTH + 1]
        ints[row] = ints[ints[CHANGES] + k * CHANGE_WIDTH]
        ints[row + 1] = entered
        numbers[given] = numbers[TIME]
        for part in range(LOSSES):
            numbers[given + 1 + part] = numbers[LOST + part] if first == 1 and entered != SHARED else 0.0
        numbers[given + 1 + LOSSES] = numbers[ints[CHANGE_IMPULSES] + k]
        if entered != SHARED:
            first = 0
    ints[EVENT_COUNT] += ints[CHANGE_COUNT]


@compiled
def is_chatter(ints: Ints, numbers: Numbers) -> int:
    """1 where the last window of decisions holds more than ALLOWED in a period of the highest mode, or no time."""
    window, decisions, ring = ints[WINDOW], ints[DECISIONS], ints[RING]
    if decisions <= window:
        return 0
    oldest = (decisions - window) % (window + 1)
    elapsed, limit = numbers[TIME] - numbers[ring + 2 * oldest], window / numbers[ALLOWED]
    last = (decisions - 1) % (window + 1)
    if elapsed > ACCUMULATED * numbers[TIME] and numbers[ring + 2 * last + 1] * elapsed >= limit:
        return 0
    highest = 0.0
    for k in range(window + 1):
        if k != (decisions - window - 1) % (window + 1):
            highest = max(highest, numbers[ring + 2 * k + 1])
    numbers[TOLD] = elapsed
    numbers[TOLD + 1] = highest
    return 1 if elapsed <= ACCUMULATED * numbers[TIME] or 0.0 < highest * elapsed < limit else 0
