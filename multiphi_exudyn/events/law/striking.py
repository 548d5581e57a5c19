"""Rigid contacts that close, with or without an impact, by sentence 2 of the law (events/law)."""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANGE_COUNT,
    CHANNELS,
    CLOSE,
    CLOSED,
    COMPLIANT_KEY,
    DENIED,
    ELEMENTS,
    ENTERED_STATE,
    FAILED,
    FURTHER,
    HELD,
    HELD_LINKS,
    IMPULSES,
    KEY,
    LEVEL,
    LOSSES,
    LOST_IN_IMPACT,
    LOST_NOW,
    LOST_STILLED,
    MAPPED_AGAIN,
    MODES,
    NEED,
    OK,
    OPEN,
    PUSHED,
    RELEASED,
    ROUGHEST_FIRST,
    SHARED,
    SLIP_BACKWARD,
    SLIP_FORWARD,
    SPEED,
    SPEEDS,
    SPEEDS_CHANGED,
    STATES,
    STICKS,
    STILL,
    STRIKING,
    STRUCK,
    TOUCHING,
    WORKED,
)
from multiphi_exudyn.events.law.bounces import last_bounce
from multiphi_exudyn.events.law.changes import (
    NO_REQUEST,
    bears_no_impulse,
    clear,
    enter,
    is_closed_rigid,
    record_change,
    transfer,
)
from multiphi_exudyn.events.law.impact import RESTING
from multiphi_exudyn.events.law.impact_round_off import speed_size
from multiphi_exudyn.events.law.phases import update_phases
from multiphi_exudyn.events.law.rebounds import collide_and_rebound, repeat_impacts, set_rebound_speeds
from multiphi_exudyn.events.law.redundancy import held_links, is_redundant_stick, keep_independent
from multiphi_exudyn.events.law.resting import drop_pulled, find_pressed, reaction_sign, same_speed
from multiphi_exudyn.events.states.energies import kinetic, lose
from multiphi_exudyn.events.states.maps import find_level, move
from multiphi_exudyn.events.states.state_arrays import copy_state
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.orthonormal import scalar_product

__all__ = ["close_without_impact", "impact", "record_impact_changes"]


@compiled
def impact(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """2. Compute an impact of rigid contacts: the velocities, the contacts that stay closed, and AFTER in their level.

    STRIKING flags the contacts that strike. COMPLIANT_KEY is the level in which all touching contacts are open. A
    contact of FREED, whose reaction has just fallen to zero, stays closed only with a reaction clearly above zero, and
    not in the level and at the speed at which it fell to zero. Changes and losses (LOST_NOW) are those of the whole
    impact. OK, NEED or FAILED.
    """
    c, touching, count = ints[ELEMENTS], ints[TOUCHING], 0
    for k in range(c):
        i = ints[ints[ROUGHEST_FIRST] + k]
        if ints[ints[STRIKING] + i] == 1 or is_closed_rigid(ints, WORKED, i) == 1:
            ints[touching + count] = i
            count += 1
    status = transfer(ints, numbers, WORKED, ints[COMPLIANT_KEY], RELEASED)
    if status < 0:
        return status
    ints[SPEEDS_CHANGED] = 1
    clear(numbers, LOST_IN_IMPACT)
    bouncing = set_rebound_speeds(ints, numbers, RELEASED, count)
    if bouncing < 0:
        return FAILED
    if collide_and_rebound(ints, numbers, RELEASED, count, bouncing, STRUCK, LOST_IN_IMPACT) < 0:
        return FAILED
    if bouncing > 0 and repeat_impacts(ints, numbers, STRUCK, count, LOST_IN_IMPACT) < 0:
        return FAILED
    same = same_speed(ints, numbers, RELEASED, STRUCK)
    if same == 1:
        for k in range(count):
            numbers[ints[IMPULSES] + k] = 0.0  # round-off: no contact was struck
    closed = find_pressed(ints, numbers, waves, count)
    last = last_bounce(ints, numbers, count) if bouncing > 0 and closed >= 0 else 0
    if last < 0:
        return FAILED
    if last > 0:
        closed = find_pressed(ints, numbers, waves, count)
    if closed < 0:
        return closed
    copy_state(ints, numbers, STRUCK, AFTER)
    while closed > 0:
        pulled = drop_pulled(ints, numbers, count, same)
        if pulled < 0:
            return pulled
        if pulled == 0:
            clear(numbers, LOST_NOW)
            collided = kinetic(ints, numbers, RELEASED) - kinetic(ints, numbers, STILL)
            lose(ints, numbers, WORKED, AFTER, collided, LOST_NOW)
            for k in range(LOSSES):
                numbers[LOST_NOW + k] += numbers[LOST_STILLED + k]
            for k in range(count):
                numbers[ints[IMPULSES] + k] += numbers[ints[FURTHER] + k]
            break
        closed -= pulled
        copy_state(ints, numbers, STRUCK, AFTER)
    for k in range(LOSSES):
        numbers[LOST_NOW + k] += numbers[LOST_IN_IMPACT + k]
    status = slip_after_impact(ints, numbers)
    if status >= 0:
        record_impact_changes(ints, numbers, count)
    return status


@compiled
def slip_after_impact(ints: Ints, numbers: Numbers) -> int:
    """12. Let rigid friction that bears no impulse slip in AFTER with its velocity, or stay; return OK or NEED.

    Friction that would stick, but is redundant beside the links that hold, goes on slipping: the closed contact bears
    its force.
    """
    level, key, turned = ints[AFTER + LEVEL], ints[KEY], 0
    n, before = ints[level + MODES] + ints[CHANNELS], ints[ints[WORKED + LEVEL] + STATES]
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[ints[level + STATES] + i]
        sticks = ints[ints[STICKS] + i]
        if bears_no_impulse(ints, numbers, i) == 1 and ints[key + i] >= sticks:
            row = ints[level + SPEEDS] + ints[ints[HELD_LINKS] + i] * (n + 1)
            speed = scalar_product(numbers, row, numbers, ints[AFTER + SPEED], n)
            rests = abs(speed) <= RESTING * speed_size(ints, numbers, AFTER, row)
            slips = sticks + (SLIP_FORWARD if speed > 0.0 else SLIP_BACKWARD)
            ints[key + i] = max(ints[before + i], sticks) if rests else slips
            if rests and is_redundant_stick(ints, numbers, key, i) == 1:
                ints[key + i] = ints[ints[level + STATES] + i]
            turned += 1 if ints[key + i] != ints[ints[level + STATES] + i] else 0
    if turned == 0:
        return OK
    level = find_level(ints, key)
    status = level if level < 0 else move(ints, numbers, AFTER, AFTER, level, ENTERED_STATE)
    if status < 0:
        return status
    ints[MAPPED_AGAIN] = 1
    lose(ints, numbers, AFTER, ENTERED_STATE, 0.0, LOST_NOW)
    copy_state(ints, numbers, ENTERED_STATE, AFTER)
    return OK


@compiled
def close_without_impact(ints: Ints, numbers: Numbers, waves: Waves, requests: int) -> int:
    """2. Close rigid contacts without an impact if the level entered gives them a reaction, else refuse them."""
    c, states, closing, key = ints[ELEMENTS], ints[ints[WORKED + LEVEL] + STATES], ints[CLOSED], ints[KEY]
    for i in range(c):
        ints[ints[HELD] + i] = held_links(ints, numbers, i, ints[states + i])
        ints[closing + i] = 1 if ints[ints[STRIKING] + i] == 1 and ints[requests + i] != NO_REQUEST else 0
        ints[ints[DENIED] + i] = ints[closing + i]
    keep_independent(ints, numbers, closing)
    admissible_count = 0
    for i in range(c):
        if ints[closing + i] == 0:
            continue
        for k in range(c):
            ints[key + k] = ints[requests + k] if k == i else ints[states + k]
        level = find_level(ints, key)
        if level < 0:
            return level
        sign = reaction_sign(ints, numbers, WORKED, WORKED, level, i)
        if sign <= NEED:
            return sign
        ints[closing + i] = 1 if sign >= 0 else 0
        admissible_count += ints[closing + i]
    if admissible_count == 0:
        update_phases(ints, numbers, waves, WORKED, ints[DENIED])
        return OK
    for i in range(c):
        ints[key + i] = ints[requests + i] if ints[closing + i] == 1 else ints[states + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    for i in range(c):
        if ints[closing + i] == 1:
            record_change(ints, numbers, i, ints[requests + i], 0.0)
    enter(ints, numbers, waves, ENTERED_STATE)
    return OK


@compiled
def record_impact_changes(ints: Ints, numbers: Numbers, count: int) -> None:
    """List all changes of an impact.

    A contact that strikes and does not stay closed has closed and opened at one instant.
    """
    c, pushed, striking, first = ints[ELEMENTS], ints[PUSHED], ints[STRIKING], ints[CHANGE_COUNT]
    before, after = ints[ints[WORKED + LEVEL] + STATES], ints[ints[AFTER + LEVEL] + STATES]
    for i in range(c):
        numbers[pushed + i] = 0.0
    for k in range(count):
        numbers[pushed + ints[ints[TOUCHING] + k]] = numbers[ints[IMPULSES] + k]
    for i in range(c):
        stays = ints[before + i] == ints[after + i] and ints[before + i] != OPEN
        if stays and numbers[pushed + i] > 0.0:
            record_change(ints, numbers, i, SHARED, numbers[pushed + i])
    unchanged = ints[CHANGE_COUNT]
    for i in range(c):
        if ints[striking + i] == 1 and (ints[after + i] != OPEN or numbers[pushed + i] > 0.0):
            record_change(ints, numbers, i, max(ints[after + i], CLOSE), numbers[pushed + i])
    for i in range(c):
        if ints[striking + i] == 0 and ints[after + i] != ints[before + i] and ints[after + i] != OPEN:
            record_change(ints, numbers, i, ints[after + i], numbers[pushed + i])
    for i in range(c):
        if ints[striking + i] == 1 and ints[after + i] == OPEN and numbers[pushed + i] > 0.0:
            record_change(ints, numbers, i, OPEN, 0.0)
        if ints[before + i] != OPEN and ints[after + i] == OPEN:
            record_change(ints, numbers, i, OPEN, numbers[pushed + i])
    if ints[CHANGE_COUNT] == unchanged:
        ints[CHANGE_COUNT] = first
