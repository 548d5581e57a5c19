"""Start of a run in the loop: the first state, or the final one of another run, with the events there."""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    CAUSE,
    CHANGE_COUNT,
    CURRENT,
    DECISIONS,
    DEFECTS,
    EVENT,
    FAILED,
    FORCED_ROOM,
    FORCED_WANTED,
    FOUND,
    GIVEN,
    GIVEN_ENERGY,
    GIVEN_SPRINGS,
    GIVEN_UP,
    JUDGED,
    LEVEL,
    LOSSES,
    LOST,
    LOST_AT_START,
    NEED,
    NEED_ROOM,
    NEEDED,
    OK,
    REACHED,
    STARTING,
    TRANSITIONS,
    TRANSITIONS_NOW,
    UNAVAILABLE,
    WORK,
    WORKED,
)
from multiphi_exudyn.events.law.changes import clear
from multiphi_exudyn.events.law.decision import decide_jump
from multiphi_exudyn.events.law.first_state import begin
from multiphi_exudyn.events.states.defect_sums import add_start_defect
from multiphi_exudyn.events.states.energies import energy, pattern_work
from multiphi_exudyn.events.states.maps import find_map
from multiphi_exudyn.events.states.state_arrays import copy_state
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.time.loop.loop_record import keep_events

__all__ = ["begin_run", "continue_run", "fail_if_unavailable"]


@compiled
def begin_run(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Make the first state of the run the current one, with the events of the start; return OK, NEED or FAILED."""
    ints[DECISIONS], ints[TRANSITIONS], numbers[ints[FOUND] + 1] = 0, 0, 0.0
    status = fail_if_unavailable(ints, begin(ints, numbers, waves))
    if ints[FORCED_WANTED] > ints[FORCED_ROOM]:
        ints[NEEDED], status = NEED_ROOM, NEED
    if status >= 0 and ints[JUDGED] == 1 and find_map(ints, ints[GIVEN + LEVEL], ints[WORKED + LEVEL]) < 0:
        status = fail_if_unavailable(ints, NEED)
    if status < 0:
        return status
    ints[STARTING] = 0
    for k in range(LOSSES):  # losses of the start that no event records
        numbers[LOST_AT_START + k] = numbers[LOST + k] if ints[CHANGE_COUNT] == 0 else 0.0
    numbers[WORK] = pattern_work(ints, numbers, WORKED) - pattern_work(ints, numbers, GIVEN)
    numbers[GIVEN_ENERGY] = energy(ints, numbers, GIVEN) + numbers[GIVEN_SPRINGS]
    copy_state(ints, numbers, WORKED, CURRENT)
    add_start_defect(ints, numbers)
    ints[TRANSITIONS] += ints[TRANSITIONS_NOW]
    keep_events(ints, numbers)
    return OK


@compiled
def continue_run(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Begin at the final state of another run; return OK, NEED or FAILED.

    Where the loads differ from those before, elements may change their states at once.
    """
    numbers[GIVEN_ENERGY] = energy(ints, numbers, CURRENT)
    copy_state(ints, numbers, CURRENT, REACHED)
    status = fail_if_unavailable(ints, decide_jump(ints, numbers, waves))
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
def fail_if_unavailable(ints: Ints, status: int) -> int:
    """Return the status, FAILED where the loop needs (NEED) what cannot be supplied."""
    if status == NEED and ints[GIVEN_UP] == 1:
        ints[CAUSE] = UNAVAILABLE
        return FAILED
    return status
