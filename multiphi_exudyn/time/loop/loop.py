"""Loop: a run from event to event, in flat arrays (events/arrays.py). There is no time step.

Within a level the motion is a sum of exponentials; the next event is the certified first descent of a few of them
(zero_crossing.py); the event rule (events/law) gives the state that follows. Nothing of a segment is kept before it
is complete: where the arrays lack something (NEED), or the record is full (FULL), the caller supplies it and calls the
loop again, which computes the segment anew from its start.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AGE,
    BALANCED,
    CARRIED,
    CAUSE,
    CHANGE_COUNT,
    CHANNELS,
    CHATTER,
    CONSTANTS,
    CURRENT,
    DECISIONS,
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
    HIGHEST_FREQUENCY,
    HORIZON,
    INSTANT_TIME,
    ISOLATED,
    JUDGED,
    LAST_DECISION,
    LEFT_ENERGY,
    LEVEL,
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
    WAITING,
    WHOLE,
    WINDOW,
    WORK,
    WORKED,
    WORKING,
)
from multiphi_exudyn.events.law.bounces import is_rebound_only
from multiphi_exudyn.events.law.decision import decide, decide_jump
from multiphi_exudyn.events.law.monitoring import arm, collect_requests, flag_repeated_requests, watch
from multiphi_exudyn.events.states.channel_values import keep_drive, load_piece, piece_end, set_drive
from multiphi_exudyn.events.states.defect_sums import add_defect, lacks_struck_defects
from multiphi_exudyn.events.states.energies import energy, kinetic, pattern_work, potential, strain
from multiphi_exudyn.events.states.flow import expand, scale_by_terms, state_at
from multiphi_exudyn.events.states.state_arrays import copy_state, keep_scales, measure
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import SCALES
from multiphi_exudyn.mathematics.search.zero_crossing import INSTANT, NONE, first_descent
from multiphi_exudyn.time.loop.loop_record import is_chatter, keep_events, keep_segment
from multiphi_exudyn.time.loop.motion_size import INDICATOR, begin_size_samples, keep_size_samples, sample_motion_size
from multiphi_exudyn.time.loop.run_start import begin_run, continue_run, fail_if_unavailable
from multiphi_exudyn.time.loop.verdict import is_balanced, set_verdict
from multiphi_exudyn.time.loop.work_sums import work_of_segment

__all__ = ["advance"]

SEARCH_TOO_LONG = -3  # zero_crossing.TOO_LONG


@compiled
def advance(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """Advance the state CURRENT, or the start, to ``end`` [s] or to what stops the run before.

    Return END_REACHED, EVENT, NEED, FULL or FAILED. The energy of the final state, whether the ledger is closed, and
    the verdict are set on the way.
    """
    status = run_segments(ints, numbers, waves, end)
    numbers[LEFT_ENERGY], numbers[BALANCED] = math.nan, 0.0
    if ints[STARTING] == 0:
        numbers[LEFT_ENERGY] = kinetic(ints, numbers, CURRENT) + strain(ints, numbers, CURRENT)
        numbers[BALANCED] = is_balanced(numbers, energy(ints, numbers, CURRENT))
    if ints[JUDGED] == 1:
        set_verdict(numbers, ints[ISOLATED], INDICATOR, numbers[TIME])
    return status


@compiled
def run_segments(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """Advance the state as ``advance`` does, without its final energy and the verdict."""
    if ints[STARTING] > 0:
        fresh = ints[STARTING] == FRESH
        status = begin_run(ints, numbers, waves) if fresh else continue_run(ints, numbers, waves)
        if status < 0:
            return status
        begin_size_samples(ints, numbers, GIVEN if fresh else -1, end)
    while numbers[TIME] < end:
        if ints[SEGMENT_COUNT] >= ints[SEGMENT_ROOM]:
            return FULL
        events_before = ints[EVENT_COUNT]
        status = OK
        if ints[PRESCRIBED] > 0 and numbers[TIME] >= piece_end(ints, numbers):
            status = begin_next_piece(ints, numbers, waves, end)
        if status >= 0 and ints[WORKING] == 1 and ints[ints[CURRENT + LEVEL] + DISSIPATION] == 0:
            ints[NEEDED], ints[NEEDED_FROM], status = NEED_POWERS, ints[CURRENT + LEVEL], NEED
        if status >= 0:
            segment_end = min(end, piece_end(ints, numbers)) if ints[PRESCRIBED] > 0 else end
            status = advance_segment(ints, numbers, waves, segment_end)
        status = fail_if_unavailable(ints, status)
        if status >= 0 and ints[EVENT_COUNT] > events_before:
            status = EVENT
        if status < 0 or (status == EVENT and ints[STOP_AT_EVENT] == 1):
            return status
    if is_finite(ints, numbers) == 0:  # a growing mode that no exit watches
        ints[CAUSE] = NOT_FINITE
        return FAILED
    return END_REACHED


@compiled
def is_finite(ints: Ints, numbers: Numbers) -> int:
    """Return 1 where all coordinates of the present state are finite, else 0."""
    x = ints[CURRENT + PLACE]
    for i in range(ints[ints[CURRENT + LEVEL] + MODES] + ints[CHANNELS]):
        if numbers[x + i] - numbers[x + i] != 0.0:
            return 0
    return 1


@compiled
def begin_next_piece(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """Begin the next piece of the channels in the present state; return OK, NEED, FULL or FAILED.

    Where a load jumps, elements may change their states.
    """
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
    status = fail_if_unavailable(ints, decide_jump(ints, numbers, waves))
    if status == EVENT and lacks_struck_defects(ints, numbers, REACHED, WORKED) == 1:
        status = NEED
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
def advance_segment(ints: Ints, numbers: Numbers, waves: Waves, end: float) -> int:
    """Advance within one level to the next decision, or to ``end`` [s]; return OK, EVENT, NEED, FULL or FAILED.

    Exits are armed on the way: the state REACHED has their phases, and becomes the state of the instant.
    """
    level, start_time, samples = ints[CURRENT + LEVEL], numbers[TIME], numbers[ints[FOUND] + 1]
    horizon, elapsed, armed_at, decision_due = end - start_time, 0.0, 0.0, 0
    if ints[PRESCRIBED] > 0:
        set_drive(ints, numbers, waves, ints[DRIVE_WAVES], 0.0, start_time, end)
    expand(ints, numbers, waves, CURRENT)
    copy_state(ints, numbers, CURRENT, REACHED)
    while decision_due == 0:
        count = watch(ints, numbers, waves)
        if count < 0:
            numbers[ints[FOUND] + 1] = samples
            return count
        signal = first_descent(
            ints, numbers, waves, ints[FLOW_BASIS], ints[SIGNALS], ints[CONSTANTS], ints[NOISES], count, elapsed,
            horizon, ints[SEARCH_NUMBERS], ints[SEARCH_WAVES], ints[FOUND],
        )  # fmt: skip
        if signal < NONE:
            tell_failed_search(ints, numbers, signal)
            return FAILED
        if signal == NONE:
            elapsed = horizon
            break
        elapsed = numbers[ints[FOUND]]
        decision_due = collect_requests(ints, numbers, waves, count, signal, elapsed)
        if decision_due == 0:
            arm(ints, ints[ints[WAITING] + 2 * signal])
            armed_at = elapsed
    numbers[INSTANT_TIME] = end if elapsed == horizon else start_time + elapsed
    if elapsed > 0.0:  # at the start the state is exact, its terms would add round-off
        state_at(ints, numbers, waves, level, elapsed, ints[REACHED + PLACE], ints[REACHED + SPEED])
    unit = numbers[HORIZON]
    if ints[PRESCRIBED] > 0:
        set_drive(ints, numbers, waves, ints[DRIVE_NEXT], elapsed, numbers[INSTANT_TIME], end)
    measure(ints, numbers, REACHED)
    if elapsed > 0.0:
        scale_by_terms(ints, numbers, waves, REACHED)
    ints[SUMMED] = work_of_segment(ints, numbers, waves, elapsed) if ints[WORKING] == 1 else 0
    fastest = numbers[ints[ints[FLOW_BASIS] + SCALES] + 1]
    at_once = elapsed <= (INSTANT / fastest if fastest > 0.0 else 0.0)
    if at_once:
        keep_scales(ints, numbers, CURRENT, REACHED)
    sample_motion_size(ints, numbers, waves)
    status = OK
    if decision_due > 0:
        flag_repeated_requests(ints, 1 if at_once and ints[WHOLE] == 0 else 0)
        status = decide(ints, numbers, waves)
        if status >= 0 and lacks_struck_defects(ints, numbers, REACHED, WORKED) == 1:
            status = NEED
    else:
        ints[CHANGE_COUNT] = 0
    status = fail_if_unavailable(ints, status)
    if ints[FORCED_WANTED] > ints[FORCED_ROOM]:
        ints[NEEDED], status = NEED_ROOM, NEED
    if status == NEED or ints[EVENT_COUNT] + ints[CHANGE_COUNT] > ints[EVENT_ROOM]:
        numbers[ints[FOUND] + 1] = samples
        return NEED if status == NEED else FULL
    keep_segment(ints, numbers, armed_at, unit)
    keep_size_samples(numbers)
    if ints[PRESCRIBED] > 0:
        keep_drive(ints, waves)
        numbers[AGE] += elapsed
    if decision_due == 0:
        copy_state(ints, numbers, REACHED, CURRENT)
        return OK
    return apply_decision(ints, numbers, level, status)


@compiled
def tell_failed_search(ints: Ints, numbers: Numbers, answer: int) -> None:
    """Keep the cause of a search without an answer, and what its message tells (failures.py)."""
    ints[CAUSE] = TOO_LONG if answer == SEARCH_TOO_LONG else NOT_FINITE
    numbers[TOLD] = numbers[ints[ints[FLOW_BASIS] + SCALES] + 1]
    numbers[TOLD + 1] = numbers[ints[FOUND] + 2]
    numbers[TOLD + 2] = numbers[ints[FOUND] + 3]


@compiled
def apply_decision(ints: Ints, numbers: Numbers, level: int, status: int) -> int:
    """Make the state after a decision the current one, and record its events; return OK, EVENT or FAILED."""
    window = ints[WINDOW]
    last = ints[RING] + 2 * (ints[DECISIONS] % (window + 1))
    numbers[last] = numbers[LAST_DECISION]
    numbers[last + 1] = numbers[ints[level + HIGHEST_FREQUENCY]]
    numbers[LAST_DECISION] = numbers[TIME]
    ints[DECISIONS] += 1 - is_rebound_only(ints, numbers)  # a sequence of bounces ends by itself
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
