"""Loop: a run from event to event, in flat arrays (events/arrays.py). There is no time step.

Within a level the motion is a sum of exponentials; the next event is the certified first descent of a few of them
(zero_crossing.py); the event rule (decision.py) gives the state that follows. Nothing of a segment is kept before it
is complete: where something is missing (NEED), or the record is full (FULL), the loop is called again, and the segment
is made again from its start.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AGE,
    CARRIED,
    CAUSE,
    CHANGE_COUNT,
    CHANNELS,
    CHATTER,
    CONSTANTS,
    CURRENT,
    DECISIONS,
    DEFECTS,
    DISSIPATION,
    DRIVE,
    DRIVE_NEXT,
    DRIVE_WAVES,
    END_REACHED,
    EVENT,
    EVENT_COUNT,
    EVENT_ROOM,
    FAILED,
    FLOW_BASIS,
    FORCED_ROOM,
    FORCED_WANTED,
    FOUND,
    FRESH,
    FULL,
    GIVEN,
    GIVEN_ENERGY,
    GIVEN_SPRINGS,
    GIVEN_UP,
    HIGHEST_FREQUENCY,
    HORIZON,
    INSTANT_TIME,
    ISOLATED,
    JUDGED,
    LAST_DECISION,
    LEFT_ENERGY,
    LEVEL,
    LOSSES,
    LOST,
    LOST_AT_START,
    MODES,
    NEED,
    NEED_PIECES,
    NEED_POWERS,
    NEED_ROOM,
    NEEDED,
    NEEDED_FROM,
    NOISES,
    NOT_FINITE,
    OK,
    PIECE,
    PIECE_COUNT,
    PLACE,
    PRESCRIBED,
    REACHED,
    RING,
    SEARCH_NUMBERS,
    SEARCH_WAVES,
    SEGMENT_COUNT,
    SEGMENT_ROOM,
    SIGNALS,
    SPEED,
    STARTING,
    STOP_AT_EVENT,
    SUMMED,
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
    WORKED,
    WORKING,
)
from multiphi_exudyn.events.law.bounces import only_bounces
from multiphi_exudyn.events.law.changes import clear
from multiphi_exudyn.events.law.decision import decide, decide_jump
from multiphi_exudyn.events.law.first_state import begin
from multiphi_exudyn.events.law.monitoring import arm, flag_again, watch, who_asks
from multiphi_exudyn.events.states.channel_values import keep_drive, load_piece, piece_end, set_drive
from multiphi_exudyn.events.states.defect_sums import add_defect, add_start_defect
from multiphi_exudyn.events.states.energies import energy, kinetic, pattern_work, potential, strain
from multiphi_exudyn.events.states.flow import expand, state_at
from multiphi_exudyn.events.states.maps import find_map
from multiphi_exudyn.events.states.state_arrays import copy_state, measure
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import SCALES
from multiphi_exudyn.mathematics.search.zero_crossing import INSTANT, NONE, first_descent
from multiphi_exudyn.time.loop.loop_record import is_chatter, keep_events, keep_segment
from multiphi_exudyn.time.loop.motion_size import INDICATOR, begin_look, keep_look, look
from multiphi_exudyn.time.loop.verdict import judge
from multiphi_exudyn.time.loop.work_sums import work_of_segment

__all__ = ["advance"]

SEARCH_TOO_LONG = -3  # zero_crossing.TOO_LONG


@compiled
def advance(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """Carries the state CURRENT, or the start, to ``end``, or to what stops it.

    END_REACHED, EVENT, NEED, FULL or FAILED.
    """
    status = travel(ints, numbers, waves, end)
    left = kinetic(ints, numbers, CURRENT) + strain(ints, numbers, CURRENT) if ints[STARTING] == 0 else math.nan
    numbers[LEFT_ENERGY] = left
    if ints[JUDGED] == 1:
        judge(numbers, ints[ISOLATED], INDICATOR, numbers[TIME])
    return status


@compiled
def travel(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """The same, without what is told of the state that it comes to, and of what truncation has taken so far."""
    if ints[STARTING] > 0:
        fresh = ints[STARTING] == FRESH
        status = set_out(ints, numbers, waves) if fresh else go_on(ints, numbers, waves)
        if status < 0:
            return status
        begin_look(ints, numbers, GIVEN if fresh else -1, end)
    while numbers[TIME] < end:
        if ints[SEGMENT_COUNT] >= ints[SEGMENT_ROOM]:
            return FULL
        known = ints[EVENT_COUNT]
        status = OK
        if ints[PRESCRIBED] > 0 and numbers[TIME] >= piece_end(ints, numbers):
            status = next_piece(ints, numbers, waves, end)
        if status >= 0 and ints[WORKING] == 1 and ints[ints[CURRENT + LEVEL] + DISSIPATION] == 0:
            ints[NEEDED], ints[NEEDED_FROM], status = NEED_POWERS, ints[CURRENT + LEVEL], NEED
        if status >= 0:
            until = min(end, piece_end(ints, numbers)) if ints[PRESCRIBED] > 0 else end
            status = one_segment(ints, numbers, waves, until)
        status = given_up(ints, status)
        if status >= 0 and ints[EVENT_COUNT] > known:
            status = EVENT
        if status < 0 or (status == EVENT and ints[STOP_AT_EVENT] == 1):
            return status
    if is_finite(ints, numbers) == 0:  # a growing mode that no exit watches
        ints[CAUSE] = NOT_FINITE
        return FAILED
    return END_REACHED


@compiled
def is_finite(ints: Ints, numbers: Numbers) -> int:
    """1 where all coordinates of the present state are finite."""
    x = ints[CURRENT + PLACE]
    for i in range(ints[ints[CURRENT + LEVEL] + MODES] + ints[CHANNELS]):
        if numbers[x + i] - numbers[x + i] != 0.0:
            return 0
    return 1


@compiled
def set_out(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """The first state of the run becomes the current one, with the events of the start; OK, NEED or FAILED."""
    status = given_up(ints, begin(ints, numbers, waves))
    if ints[FORCED_WANTED] > ints[FORCED_ROOM]:
        ints[NEEDED], status = NEED_ROOM, NEED
    if status >= 0 and ints[JUDGED] == 1 and find_map(ints, ints[GIVEN + LEVEL], ints[WORKED + LEVEL]) < 0:
        status = given_up(ints, NEED)
    if status < 0:
        return status
    ints[STARTING] = 0
    for k in range(LOSSES):  # what no event carries
        numbers[LOST_AT_START + k] = numbers[LOST + k] if ints[CHANGE_COUNT] == 0 else 0.0
    numbers[WORK] = pattern_work(ints, numbers, WORKED) - pattern_work(ints, numbers, GIVEN)
    numbers[GIVEN_ENERGY] = energy(ints, numbers, GIVEN) + numbers[GIVEN_SPRINGS]
    copy_state(ints, numbers, WORKED, CURRENT)
    add_start_defect(ints, numbers)
    ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
    keep_events(ints, numbers)
    return OK


@compiled
def go_on(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """The state that another run has come to is the first one; where loads have changed, elements may ask.

    OK, NEED or FAILED.
    """
    numbers[GIVEN_ENERGY] = energy(ints, numbers, CURRENT)
    copy_state(ints, numbers, CURRENT, REACHED)
    status = given_up(ints, decide_jump(ints, numbers, waves))
    if status < 0:
        return status
    ints[STARTING] = 0
    clear(numbers, LOST_AT_START)
    if status == EVENT:
        copy_state(ints, numbers, WORKED, CURRENT)
        numbers[DEFECTS] = math.nan
        ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
        keep_events(ints, numbers)
    return OK


@compiled
def given_up(ints: Ints, status: int) -> int:
    """What is needed and cannot be had is a failure."""
    if status == NEED and ints[GIVEN_UP] == 1:
        ints[CAUSE] = UNAVAILABLE
        return FAILED
    return status


@compiled
def next_piece(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """The same state on the piece that follows; a load that jumps may make elements ask; OK, NEED, FULL or FAILED."""
    r, q, level = ints[ints[CURRENT + LEVEL] + MODES], ints[CHANNELS], ints[CURRENT + LEVEL]
    if ints[PIECE] + 1 >= ints[PIECE_COUNT]:
        ints[NEEDED] = NEED_PIECES
        return NEED
    before = energy(ints, numbers, CURRENT)
    ints[PIECE] += 1
    load_piece(ints, waves)
    set_drive(ints, numbers, waves, ints[DRIVE_WAVES], 0.0, numbers[TIME], min(end, piece_end(ints, numbers)))
    copy_state(ints, numbers, CURRENT, REACHED)
    x, v, row = ints[REACHED + PLACE], ints[REACHED + SPEED], ints[level + CARRIED]
    for k in range(ints[PRESCRIBED]):
        numbers[x + r + k] = numbers[ints[DRIVE] + k]
        jump = numbers[v + r + k] - numbers[ints[DRIVE] + ints[PRESCRIBED] + k]
        numbers[v + r + k] -= jump
        for i in range(r if row >= 0 else 0):
            numbers[v + i] += numbers[row + k * (r + q) + i] * jump
    measure(ints, numbers, REACHED)
    status = given_up(ints, decide_jump(ints, numbers, waves))
    if status == NEED or ints[EVENT_COUNT] + ints[CHANGE_COUNT] > ints[EVENT_ROOM]:
        ints[PIECE] -= 1
        return NEED if status == NEED else FULL
    after = REACHED if status != EVENT else WORKED
    work = kinetic(ints, numbers, REACHED) + potential(ints, numbers, REACHED) - before
    numbers[WORK] += work + pattern_work(ints, numbers, after)
    copy_state(ints, numbers, after, CURRENT)
    numbers[AGE] = 0.0
    if status == EVENT:
        add_defect(ints, numbers, REACHED, WORKED)
        ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
        keep_events(ints, numbers)
    return OK if status >= 0 else status


@compiled
def one_segment(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """One level's motion up to the next decision, or to ``end``; OK, EVENT, NEED, FULL or FAILED.

    Exits are armed on the way: the state REACHED has their phases, and becomes the state of the instant.
    """
    level, started, samples = ints[CURRENT + LEVEL], numbers[TIME], numbers[ints[FOUND] + 1]
    horizon, reached, armed_at, asking = end - started, 0.0, 0.0, 0
    if ints[PRESCRIBED] > 0:
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
    if reached > 0.0:  # at its start the state is what it was, without the round-off of its terms
        state_at(ints, numbers, waves, level, reached, ints[REACHED + PLACE], ints[REACHED + SPEED])
    unit = numbers[HORIZON]
    if ints[PRESCRIBED] > 0:
        set_drive(ints, numbers, waves, ints[DRIVE_NEXT], reached, numbers[INSTANT_TIME], end)
    measure(ints, numbers, REACHED)
    ints[SUMMED] = work_of_segment(ints, numbers, waves, reached) if ints[WORKING] == 1 else 0
    fastest = numbers[ints[ints[FLOW_BASIS] + SCALES] + 1]
    at_once = reached <= (INSTANT / fastest if fastest > 0.0 else 0.0)
    look(ints, numbers, waves)
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
    keep_look(numbers)
    if ints[PRESCRIBED] > 0:
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
    ints[DECISIONS] += 1 - only_bounces(ints, numbers)  # a sequence of bounces ends by itself
    ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
    if status < 0:
        copy_state(ints, numbers, REACHED, CURRENT)
        return status
    if ints[PRESCRIBED] > 0:
        numbers[WORK] += pattern_work(ints, numbers, WORKED) - pattern_work(ints, numbers, REACHED)
    copy_state(ints, numbers, WORKED, CURRENT)
    add_defect(ints, numbers, REACHED, WORKED)
    keep_events(ints, numbers)
    if is_chatter(ints, numbers) == 1:
        ints[CAUSE] = CHATTER
        return FAILED
    return EVENT if ints[CHANGE_COUNT] > 0 else OK
