"""Event rule in flat arrays: when an element changes state, and which level follows; its sentences are in rule.py.

Sets of elements are flags (c,) in the ints; who asks, the state that each asks for, or NOBODY. The decision of an
instant works on the state WORKED, which begins as the one REACHED, and leaves that one as it was: where something is
missing (NEED) it is made again from the start.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    ACCELERATION_TERMS,
    AFTER,
    AGAIN,
    ARMED,
    ASKED,
    ASKING,
    CAUSE,
    CAUSED_BY,
    CHAIN_COUNT,
    CHAIN_MARKS,
    CHAINS,
    CHANGE,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_ROOM,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    CLOSE,
    CLOSED,
    COMPLIANT_KEY,
    DENIED,
    ELEMENT,
    ELEMENTS,
    END_COUNT,
    ENDS,
    ENTERED,
    ENTERED_STATE,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FAILED,
    FIRST_EXITS,
    FLOW_BASIS,
    FLOW_COUNT,
    FREED,
    FURTHER,
    HEARD,
    HELD,
    HELD_BACK,
    IMPULSES,
    JOINED,
    KEY,
    KINDS,
    LEVEL,
    LOSSES,
    LOST,
    LOST_IN_IMPACT,
    LOST_NOW,
    LOST_STILLED,
    MATRIX,
    MODES,
    NEED,
    NEED_ENTERED,
    NEEDED,
    NEEDED_FROM,
    NEEDED_KEY,
    NOT_ADMISSIBLE,
    OFFSET,
    OK,
    OPEN,
    PENDING,
    PHASES,
    PLACE,
    PULLING,
    PUSHED,
    RATE_MATRIX,
    REACH,
    REACHED,
    RECOVERING,
    REFUSED,
    RELEASED,
    RELEASED_TERMS,
    RESTING_LIST,
    RESTING_SIZES,
    RIGID,
    ROW,
    ROWS,
    SEARCH_NUMBERS,
    SEARCH_WAVES,
    SETTLED,
    SHARED,
    SIGNAL,
    SINGLES,
    SPEED,
    STATES,
    STAYS,
    STILL,
    STRIKING,
    STRUCK,
    TOUCHING,
    TRANSITIONS_NOW,
    UNION,
    VISCOUS,
    WISHES,
    WORK_WAVES,
    WORKED,
)
from multiphi_exudyn.events.flat_state import (
    accelerate,
    acceleration_sizes,
    copy_state,
    find_level,
    find_map,
    kinetic,
    lose,
    move,
    rate_sign,
    row_sign,
    same_level,
    sign_of,
)
from multiphi_exudyn.events.flow import expand, signal_sizes, signal_waves
from multiphi_exudyn.events.impact import (
    RESTING,
    collide,
    fill_rows,
    independent,
    nearest,
    resting_size,
    speed_size,
    unseen_speed,
)
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.flat_least_distance import norm
from multiphi_exudyn.mathematics.zero_crossing import first_sign

__all__ = ["NOBODY", "ROUNDS", "decide", "update_phases"]

ROUNDS = 20  # of decisions at one instant: above it the contacts exclude each other's states for ever
NOBODY = -1  # in place of the state that an element asks for


# ---------------------------------------------------------------------- 1, 5, 6: the phase of an exit


@compiled
def phase_of(ints: Ints, numbers: Numbers, waves: Waves, state: int, exit_: int) -> int:
    """ARMED where s is or becomes positive, RECOVERING where it is negative and may rise, else REFUSED."""
    signal = exit_ + SIGNAL
    value = row_sign(ints, numbers, state, signal)
    if value > 0:
        return ARMED
    rate = rate_sign(ints, numbers, state, signal)
    if rate == 0:
        rate = becomes(ints, numbers, waves, state, signal, 2)
    if value == 0 and rate >= 0:
        return ARMED
    return RECOVERING if rate > 0 and ints[exit_ + STAYS] == 0 else REFUSED


@compiled
def becomes(ints: Ints, numbers: Numbers, waves: Waves, state: int, signal: int, since: int) -> int:
    """Sign of a signal's first derivative, of order ``since`` or higher, that is not round-off."""
    n = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS]
    expand(ints, numbers, waves, state)
    signal_waves(ints, numbers, waves, state, signal, ints[WORK_WAVES])
    signal_sizes(ints, numbers, waves, state, signal, ints[SEARCH_NUMBERS])
    constant, basis = numbers[ints[signal + ROW] + 2 * n], ints[FLOW_BASIS]
    return first_sign(
        ints, numbers, waves, basis, ints[WORK_WAVES], constant, ints[SEARCH_NUMBERS], since,
        ints[SEARCH_NUMBERS] + ints[FLOW_COUNT], ints[SEARCH_WAVES],
    )  # fmt: skip


@compiled
def update_phases(ints: Ints, numbers: Numbers, waves: Waves, state: int, refused: int) -> None:
    """The phase in which every exit of a state stands; ``refused``: flags of those that asked in vain, -1 for none.

    8. While all springs of a law's chains are armed only the ends of the chains can ask, and only they are looked at.
    """
    level, phases = ints[state + LEVEL], ints[state + PHASES]
    count, exits, settled = ints[level + EXIT_COUNT], ints[level + EXITS], 1
    for k in range(count):
        ints[phases + k] = ARMED
    for e in range(ints[level + END_COUNT]):
        k = ints[ints[level + ENDS] + e]
        ints[phases + k] = phase_of(ints, numbers, waves, state, exits + k * EXIT_INTS)
        if ints[phases + k] != ARMED:
            settled = 0
    if settled == 0 and ints[CHAIN_COUNT] > 0:
        mark_chains(ints, state)
        for k in range(count):
            chain = ints[ints[CHAINS] + ints[exits + k * EXIT_INTS + ELEMENT]]
            if chain >= 0 and ints[ints[CHAIN_MARKS] + chain] == 1 and is_end(ints, level, k) == 0:
                ints[phases + k] = phase_of(ints, numbers, waves, state, exits + k * EXIT_INTS)
    if refused >= 0:
        for k in range(count):
            if ints[refused + ints[exits + k * EXIT_INTS + ELEMENT]] == 1 and ints[phases + k] != ARMED:
                ints[phases + k] = REFUSED
    ints[state + SETTLED] = settled


@compiled
def mark_chains(ints: Ints, state: int) -> None:
    """Flags (chains,) of the chains with an exit that is not armed."""
    exits, phases = ints[ints[state + LEVEL] + EXITS], ints[state + PHASES]
    for chain in range(ints[CHAIN_COUNT]):
        ints[ints[CHAIN_MARKS] + chain] = 0
    for k in range(ints[ints[state + LEVEL] + EXIT_COUNT]):
        chain = ints[ints[CHAINS] + ints[exits + k * EXIT_INTS + ELEMENT]]
        if chain >= 0 and ints[phases + k] != ARMED:
            ints[ints[CHAIN_MARKS] + chain] = 1


@compiled
def is_end(ints: Ints, level: int, exit_number: int) -> int:
    """1 where an exit is among those that are always looked at."""
    for e in range(ints[level + END_COUNT]):
        if ints[ints[level + ENDS] + e] == exit_number:
            return 1
    return 0


@compiled
def is_refused(ints: Ints, state: int, element: int) -> int:
    """1 where an exit of an element is refused."""
    first = ints[ints[state + LEVEL] + FIRST_EXITS] + element
    for k in range(ints[first], ints[first + 1]):
        if ints[ints[state + PHASES] + k] == REFUSED:
            return 1
    return 0


@compiled
def hold_back(ints: Ints, state: int) -> None:
    """Those that were refused at this instant before, and are once more, wait until s has risen to zero."""
    level = ints[state + LEVEL]
    for k in range(ints[level + EXIT_COUNT]):
        element = ints[ints[level + EXITS] + k * EXIT_INTS + ELEMENT]
        if ints[ints[AGAIN] + element] == 1 and ints[ints[state + PHASES] + k] == REFUSED:
            ints[ints[state + PHASES] + k] = HELD_BACK
            ints[state + SETTLED] = 0


# ---------------------------------------------------------------------- an instant


@compiled
def decide(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """WORKED becomes the state right after an instant at which the elements in ASKING ask; OK, NEED or FAILED.

    AGAIN: those refused at it before. Energies lost are added up in LOST, changes listed. Where in the end all elements
    are as before, and none was struck, nothing has happened at it.
    """
    clear(numbers, LOST)
    ints[CHANGE_COUNT] = 0
    ints[TRANSITIONS_NOW] = 0
    copy_state(ints, numbers, REACHED, WORKED)
    status = settle(ints, numbers, waves)
    if status < 0:
        return status
    struck = 0
    for k in range(ints[CHANGE_COUNT]):
        shared = ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] == SHARED
        if shared or numbers[ints[CHANGE_IMPULSES] + k] != 0.0:
            struck = 1
    if ints[CHANGE_COUNT] > 0 and struck == 0 and same_level(ints, REACHED, WORKED) == 1:
        copy_state(ints, numbers, REACHED, WORKED)
        flag_asking(ints, ints[ASKING], ints[DENIED])
        update_phases(ints, numbers, waves, WORKED, ints[DENIED])
        hold_back(ints, WORKED)
        clear(numbers, LOST)
        ints[CHANGE_COUNT] = 0
    return OK


@compiled
def settle(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Decisions at one instant until nobody is refused who has not been heard; OK, NEED or FAILED."""
    c, asking, heard, freed, pending = ints[ELEMENTS], ints[ASKING], ints[HEARD], ints[FREED], ints[PENDING]
    flag_asking(ints, asking, heard)
    asked = 0
    for i in range(c):
        ints[freed + i] = ints[heard + i] * is_held(ints, WORKED, i)
        asked += ints[heard + i]
    if asked > 0:
        status = answer(ints, numbers, waves, asking)
        if status < 0:
            return status
    else:
        update_phases(ints, numbers, waves, WORKED, -1)
    for _ in range(ROUNDS + c):
        left = find_refused(ints)
        if left == 0:
            return OK
        if ints[CHANGE_COUNT] + 3 * c > ints[CHANGE_ROOM]:
            break
        status = OK
        if left == 1:
            for i in range(c):
                if ints[pending + i] != NOBODY:
                    ints[heard + i] = 1
                    ints[freed + i] = max(ints[freed + i], is_held(ints, WORKED, i))
            status = answer(ints, numbers, waves, pending)
        elif left == 2:  # heard before: what others did at this instant took its reaction away
            status = switch(ints, numbers, waves, ints[PULLING])
        else:
            hold_back(ints, WORKED)
            return OK
        if status < 0:
            return status
    ints[CAUSE] = NOT_ADMISSIBLE
    flag_asking(ints, pending, ints[CAUSED_BY])
    return FAILED


@compiled
def find_refused(ints: Ints) -> int:
    """0: no exit of WORKED is refused; 1: those of elements not heard yet, PENDING; 2: of closed rigid ones, PULLING.

    3: of others only. Who has changed has been heard.
    """
    level, heard, pending, pulling = ints[WORKED + LEVEL], ints[HEARD], ints[PENDING], ints[PULLING]
    for k in range(ints[CHANGE_COUNT]):
        if ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] != SHARED:
            ints[heard + ints[ints[CHANGES] + k * CHANGE_WIDTH]] = 1
    for i in range(ints[ELEMENTS]):
        ints[pending + i] = NOBODY
        ints[pulling + i] = NOBODY
    refused, unheard, pulled = 0, 0, 0
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        element = ints[exit_ + ELEMENT]
        if ints[ints[WORKED + PHASES] + k] == REFUSED:
            refused = 1
            if ints[heard + element] == 0:
                ints[pending + element] = ints[exit_ + ASKED]
                unheard = 1
            if is_held(ints, WORKED, element) == 1:
                ints[pulling + element] = ints[exit_ + ASKED]
                pulled = 1
    if refused == 0:
        return 0
    if unheard == 1:
        return 1
    return 2 if pulled == 1 else 3


@compiled
def clear(numbers: Numbers, losses: int) -> None:
    """Nothing is lost."""
    for k in range(LOSSES):
        numbers[losses + k] = 0.0


@compiled
def flag_asking(ints: Ints, asking: int, flags: int) -> None:
    """Flags (c,) of those that ask."""
    for i in range(ints[ELEMENTS]):
        ints[flags + i] = 1 if ints[asking + i] != NOBODY else 0


@compiled
def is_held(ints: Ints, state: int, element: int) -> int:
    """1 where a rigid contact is closed."""
    closed = ints[ints[ints[state + LEVEL] + STATES] + element] == CLOSE
    return 1 if closed and ints[ints[KINDS] + element] == RIGID else 0


@compiled
def note(ints: Ints, numbers: Numbers, element: int, entered: int, impulse: float) -> None:
    """List a change: the state entered, or SHARED; shared impulses stand before the change that they belong to."""
    k = ints[CHANGE_COUNT]
    ints[ints[CHANGES] + k * CHANGE_WIDTH] = element
    ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] = entered
    numbers[ints[CHANGE_IMPULSES] + k] = impulse
    ints[CHANGE_COUNT] = k + 1


@compiled
def answer(ints: Ints, numbers: Numbers, waves: Waves, asking: int) -> int:
    """WORKED with its phases after those in ``asking`` (c,) have been heard; OK, NEED or FAILED.

    HEARD: all that touch at this instant. FREED: those of them whose reaction has fallen to zero at it.
    """
    c, striking, states = ints[ELEMENTS], ints[STRIKING], ints[ints[WORKED + LEVEL] + STATES]
    strikes, before = 0, ints[CHANGE_COUNT]
    clear(numbers, LOST_NOW)
    for i in range(c):
        rigid = ints[ints[KINDS] + i] == RIGID
        ints[striking + i] = 1 if rigid and ints[ints[HEARD] + i] == 1 and ints[states + i] == OPEN else 0
        strikes += 1 if ints[striking + i] == 1 and ints[asking + i] != NOBODY else 0
        asked = ints[states + i] if ints[asking + i] == NOBODY else ints[asking + i]
        ints[ints[COMPLIANT_KEY] + i] = OPEN if rigid else asked
    if strikes == 0:
        return switch(ints, numbers, waves, asking)
    status = impact(ints, numbers, waves)
    if status < 0:
        return status
    if ints[CHANGE_COUNT] == before:
        clear(numbers, LOST_NOW)
        return close_without_impact(ints, numbers, waves, asking)
    enter(ints, numbers, waves, AFTER)
    return OK


@compiled
def enter(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """A state becomes WORKED, with its phases, and what was lost on the way is added up."""
    copy_state(ints, numbers, state, WORKED)
    update_phases(ints, numbers, waves, WORKED, -1)
    ints[TRANSITIONS_NOW] += 1
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


# ---------------------------------------------------------------------- 2: rigid contacts strike


@compiled
def impact(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Rigid contacts strike: velocities, then which of all that touch stay closed, then their level: AFTER.

    STRIKING: who strikes. COMPLIANT_KEY: the level in which all that touch are open. One of FREED stays closed only
    with a reaction that is more than round-off of zero, and not in the level and at the speed at which it fell to zero.
    Changes and losses (LOST_NOW) are of the whole impact. OK, NEED or FAILED.
    """
    c, touching, count = ints[ELEMENTS], ints[TOUCHING], 0
    for i in range(c):
        if ints[ints[STRIKING] + i] == 1 or is_held(ints, WORKED, i) == 1:
            ints[touching + count] = i
            count += 1
    status = transfer(ints, numbers, WORKED, ints[COMPLIANT_KEY], RELEASED)
    if status < 0:
        return status
    clear(numbers, LOST_IN_IMPACT)
    status = collide(ints, numbers, RELEASED, touching, count, 0, STRUCK, ints[IMPULSES], LOST_IN_IMPACT)
    if status < 0:
        return status
    same = same_speed(ints, numbers, RELEASED, STRUCK)
    if same == 1:
        for k in range(count):
            numbers[ints[IMPULSES] + k] = 0.0  # round-off of them: nothing was struck
    closed = press(ints, numbers, waves, count)
    if closed < 0:
        return closed
    copy_state(ints, numbers, STRUCK, AFTER)
    while closed > 0:
        pulled = stay_closed(ints, numbers, count, same)
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
    list_changes(ints, numbers, count)
    return OK


@compiled
def same_speed(ints: Ints, numbers: Numbers, before: int, after: int) -> int:
    """1 where an impact has changed no speed by more than round-off."""
    r, changed = ints[ints[before + LEVEL] + MODES], 0.0
    for i in range(r):
        difference = numbers[ints[after + SPEED] + i] - numbers[ints[before + SPEED] + i]
        changed += difference * difference
    return 1 if math.sqrt(changed) <= RESTING * norm(numbers, ints[before + SPEED], r) else 0


@compiled
def list_resting(ints: Ints, numbers: Numbers, count: int, unseen: int) -> int:
    """How many of those that touch are at rest relative to their stop after an impact; they stand in the resting list.

    unseen: 1 where at rest is also what the accelerations would turn back before its gap is more than round-off.
    """
    level, rest, v = ints[STRUCK + LEVEL], 0, ints[STRUCK + SPEED]
    n = ints[level + MODES] + ints[CHANNELS]
    fill_rows(ints, numbers, level, ints[TOUCHING], count, 0)
    for k in range(count):
        row, speed = ints[ROWS] + k * n, 0.0
        for i in range(n):
            speed += numbers[row + i] * numbers[v + i]
        size = RESTING * (speed_size(ints, numbers, RELEASED, row) + speed_size(ints, numbers, STRUCK, row))
        if unseen == 1:
            size = max(size, unseen_speed(ints, numbers, STRUCK, ints[ints[TOUCHING] + k], row))
        if abs(speed) <= size:
            ints[ints[RESTING_LIST] + rest] = ints[ints[TOUCHING] + k]
            rest += 1
    return rest


@compiled
def hold_resting(ints: Ints, numbers: Numbers, rest: int) -> int:
    """The accelerations that contacts at rest leave of the free ones, and their forces (rest,); OK or FAILED."""
    level = ints[STRUCK + LEVEL]
    n = ints[level + MODES] + ints[CHANNELS]
    accelerate(ints, numbers, STRUCK, ints[ACCELERATION])
    if rest == 0:
        return OK
    acceleration_sizes(ints, numbers, STRUCK, ints[ACCELERATION_TERMS])
    acceleration_sizes(ints, numbers, RELEASED, ints[RELEASED_TERMS])
    fill_rows(ints, numbers, level, ints[RESTING_LIST], rest, 0)
    for k in range(rest):
        size = resting_size(numbers, ints[ACCELERATION_TERMS], ints[RELEASED_TERMS], ints[ROWS] + k * n, n)
        numbers[ints[RESTING_SIZES] + k] = size
    sizes, forces = ints[RESTING_SIZES], ints[FURTHER]
    if nearest(ints, numbers, level, ints[RESTING_LIST], rest, ints[ACCELERATION], sizes, forces) < 0:
        return FAILED
    for i in range(ints[level + MODES]):
        numbers[ints[ACCELERATION] + i] += numbers[ints[CHANGE] + i]
    return OK


@compiled
def press(ints: Ints, numbers: Numbers, waves: Waves, count: int) -> int:
    """CLOSED: contacts at rest relative to their stop after an impact whose free motion would close them further.

    Motion is acceleration, or where that presses none of them the first derivative that counts. At rest is also what
    would be back at its stop, those at rest held, before its gap is more than round-off. How many they are, or FAILED.
    """
    level, resting, multipliers = ints[STRUCK + LEVEL], ints[RESTING_LIST], ints[FURTHER]
    strictly = list_resting(ints, numbers, count, 0)
    if hold_resting(ints, numbers, strictly) < 0:
        return FAILED
    rest = list_resting(ints, numbers, count, 1)
    if rest > strictly and hold_resting(ints, numbers, rest) < 0:
        return FAILED
    for i in range(ints[ELEMENTS]):
        ints[ints[CLOSED] + i] = 0
    pressed = 0
    for k in range(rest):
        if numbers[multipliers + k] > 0.0:
            ints[ints[CLOSED] + ints[resting + k]] = 1
            pressed += 1
    if pressed == 0:
        for k in range(rest):
            exit_ = first_exit(ints, level, ints[resting + k])
            if phase_of(ints, numbers, waves, STRUCK, exit_) == REFUSED:
                ints[ints[CLOSED] + ints[resting + k]] = 1
                pressed += 1
    for i in range(ints[ELEMENTS]):
        ints[ints[HELD] + i] = 0
    return join(ints, numbers, ints[CLOSED]) if pressed > 0 else 0


@compiled
def first_exit(ints: Ints, level: int, element: int) -> int:
    """The first exit of an element in a level."""
    return ints[level + EXITS] + ints[ints[level + FIRST_EXITS] + element] * EXIT_INTS


@compiled
def join(ints: Ints, numbers: Numbers, closing: int) -> int:
    """Leave in ``closing`` (c,) those that can close beside HELD and each other, penetrating ones first; how many.

    Of redundant contacts a set that is independent carries all. Between two stops without clearance the one on which
    nothing presses would keep the other out.
    """
    c, union, joined, left, together = ints[ELEMENTS], ints[UNION], ints[JOINED], 0, 0
    for i in range(c):
        ints[union + i] = max(ints[ints[HELD] + i], ints[closing + i])
        together += ints[union + i]
        left += ints[closing + i]
    if together == 1 or independent(ints, numbers, union) == 1:
        return left
    for i in range(c):
        ints[union + i] = ints[ints[HELD] + i]
        ints[joined + i] = 0
    left = 0
    for penetrating in range(1, -1, -1):
        for i in range(c):
            if ints[closing + i] == 1 and is_refused(ints, WORKED, i) == penetrating:
                taken = ints[union + i]
                ints[union + i] = 1
                if independent(ints, numbers, union) == 1:
                    ints[joined + i] = 1
                    left += 1
                else:
                    ints[union + i] = taken
    for i in range(c):
        ints[closing + i] = ints[joined + i]
    return left


@compiled
def stay_closed(ints: Ints, numbers: Numbers, count: int, same: int) -> int:
    """How many of CLOSED the level in which they are closed would pull, and takes out of it; NEED or FAILED.

    AFTER: the state in that level, the displacement straight from the level before the impact, the velocity from STILL.
    """
    status = calm(ints, numbers, count)
    if status < 0:
        return status
    key, closed, pulled = ints[KEY], ints[CLOSED], 0
    for i in range(ints[ELEMENTS]):
        ints[key + i] = CLOSE if ints[closed + i] == 1 else ints[ints[COMPLIANT_KEY] + i]
    level = find_level(ints, key)
    if level < 0:
        return level
    status = move(ints, numbers, WORKED, STILL, level, AFTER)
    if status < 0:
        return status
    for i in range(ints[ELEMENTS]):
        if ints[closed + i] == 1:
            sign = reaction_sign(ints, numbers, WORKED, STILL, level, i)
            if sign <= NEED:
                return sign
            freed = ints[ints[FREED] + i]
            if sign < freed or (freed == 1 and same == 1 and level == ints[WORKED + LEVEL]):
                pulled += 1
                ints[closed + i] = 2
    for i in range(ints[ELEMENTS]):
        ints[closed + i] = 1 if ints[closed + i] == 1 else 0
    return pulled


@compiled
def calm(ints: Ints, numbers: Numbers, count: int) -> int:
    """STILL: after an impact, contacts that stay closed lose a speed too small to be seen, and give it to no other.

    FURTHER: impulses (count,) on those that touch. OK or FAILED.
    """
    level, touching, held, moving = ints[STRUCK + LEVEL], ints[TOUCHING], 0, 0
    n, v = ints[level + MODES] + ints[CHANNELS], ints[STRUCK + SPEED]
    for i in range(ints[ELEMENTS]):
        if ints[ints[CLOSED] + i] == 1:
            ints[touching + count + held] = i
            held += 1
    clear(numbers, LOST_STILLED)
    fill_rows(ints, numbers, level, touching + count, held, 0)
    for k in range(held):
        row, speed = ints[ROWS] + k * n, 0.0
        for i in range(n):
            speed += numbers[row + i] * numbers[v + i]
        if not abs(speed) <= RESTING * speed_size(ints, numbers, STRUCK, row):
            moving = 1
    for k in range(count):
        numbers[ints[FURTHER] + k] = 0.0
    if moving == 0:
        copy_state(ints, numbers, STRUCK, STILL)
        return OK
    status = collide(ints, numbers, STRUCK, touching, count, held, STILL, ints[FURTHER], LOST_STILLED)
    if status < 0:
        return status
    for h in range(held):
        for k in range(count):
            if ints[touching + k] == ints[touching + count + h]:
                numbers[ints[FURTHER] + k] -= numbers[ints[FURTHER] + count + h]
    return OK


@compiled
def reaction_sign(ints: Ints, numbers: Numbers, places: int, speeds: int, level: int, contact: int) -> int:
    """Sign of the reaction a contact would get in a level, zero where it is round-off of the way there; or NEED.

    xi of the state ``places``, xi' of ``speeds``. The same function as the signal after its change alone: a refused
    contact asks where that one says it may.
    """
    row, n = ints[first_exit(ints, level, contact) + SIGNAL + ROW], ints[level + MODES] + ints[CHANNELS]
    way, there = find_map(ints, ints[places + LEVEL], level), find_map(ints, ints[speeds + LEVEL], level)
    if way < 0 or there < 0:
        return min(way, there)
    value = numbers[row + 2 * n]
    for i in range(n):
        value += numbers[row + i] * numbers[ints[way + OFFSET] + i]
    size, width = abs(value), ints[ints[places + LEVEL] + MODES] + ints[CHANNELS]
    for j in range(width):
        factor = 0.0
        for i in range(n):
            factor += numbers[row + i] * numbers[ints[way + MATRIX] + i * width + j]
        factor *= numbers[ints[places + PLACE] + j]
        value += factor
        size += abs(factor)
    width = ints[ints[speeds + LEVEL] + MODES] + ints[CHANNELS]
    for j in range(width):
        damped, reached = 0.0, 0.0
        for i in range(n):
            damped += numbers[row + n + i] * numbers[ints[there + RATE_MATRIX] + i * width + j]
            reached += numbers[row + i] * numbers[ints[there + MATRIX] + i * width + j]
        damped *= numbers[ints[speeds + SPEED] + j]
        value += damped
        size += abs(damped) + abs(reached) * numbers[ints[speeds + REACH] + j]
    return sign_of(value, size)


@compiled
def list_changes(ints: Ints, numbers: Numbers, count: int) -> None:
    """All changes of an impact; who strikes and does not stay closed has closed and opened at one instant."""
    c, pushed, striking, first = ints[ELEMENTS], ints[PUSHED], ints[STRIKING], ints[CHANGE_COUNT]
    before, after = ints[ints[WORKED + LEVEL] + STATES], ints[ints[AFTER + LEVEL] + STATES]
    for i in range(c):
        numbers[pushed + i] = 0.0
    for k in range(count):
        numbers[pushed + ints[ints[TOUCHING] + k]] = numbers[ints[IMPULSES] + k]
    for i in range(c):
        stays = ints[before + i] == CLOSE and ints[after + i] == CLOSE
        if stays and numbers[pushed + i] > 0.0:
            note(ints, numbers, i, SHARED, numbers[pushed + i])
    unchanged = ints[CHANGE_COUNT]
    for i in range(c):
        if ints[striking + i] == 1 and (ints[after + i] == CLOSE or numbers[pushed + i] > 0.0):
            note(ints, numbers, i, CLOSE, numbers[pushed + i])
    for i in range(c):
        sprung = ints[ints[KINDS] + i] != RIGID and ints[ints[COMPLIANT_KEY] + i] == CLOSE
        if sprung and ints[before + i] == OPEN:
            note(ints, numbers, i, CLOSE, 0.0)
    for i in range(c):
        if ints[striking + i] == 1 and ints[after + i] == OPEN and numbers[pushed + i] > 0.0:
            note(ints, numbers, i, OPEN, 0.0)
        if ints[before + i] == CLOSE and ints[after + i] == OPEN:
            note(ints, numbers, i, OPEN, numbers[pushed + i])
    if ints[CHANGE_COUNT] == unchanged:
        ints[CHANGE_COUNT] = first


@compiled
def close_without_impact(ints: Ints, numbers: Numbers, waves: Waves, asking: int) -> int:
    """Rigid contacts that no impact closes: into the level that gives them a reaction, or they are refused."""
    c, states, closing, key = ints[ELEMENTS], ints[ints[WORKED + LEVEL] + STATES], ints[CLOSED], ints[KEY]
    for i in range(c):
        ints[ints[HELD] + i] = is_held(ints, WORKED, i)
        ints[closing + i] = 1 if ints[ints[STRIKING] + i] == 1 and ints[asking + i] != NOBODY else 0
        ints[ints[DENIED] + i] = ints[closing + i]
    join(ints, numbers, closing)
    willing = 0
    for i in range(c):
        if ints[closing + i] == 0:
            continue
        for k in range(c):
            ints[key + k] = CLOSE if k == i else ints[states + k]
        level = find_level(ints, key)
        if level < 0:
            return level
        sign = reaction_sign(ints, numbers, WORKED, WORKED, level, i)
        if sign <= NEED:
            return sign
        ints[closing + i] = 1 if sign >= 0 else 0
        willing += ints[closing + i]
    if willing == 0:
        update_phases(ints, numbers, waves, WORKED, ints[DENIED])
        return OK
    for i in range(c):
        ints[key + i] = CLOSE if ints[closing + i] == 1 else ints[states + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    for i in range(c):
        if ints[closing + i] == 1:
            note(ints, numbers, i, CLOSE, 0.0)
    enter(ints, numbers, waves, ENTERED_STATE)
    return OK


# ---------------------------------------------------------------------- 3, 4, 7: rigid ones open, compliant ones change


@compiled
def switch(ints: Ints, numbers: Numbers, waves: Waves, asking: int) -> int:
    """Compliant contacts change where the level they enter admits it, rigid ones open; OK, NEED or FAILED.

    Where it admits none of several together, the first that it admits alone.
    """
    c, wishes, singles, at = ints[ELEMENTS], ints[WISHES], ints[SINGLES], -1
    for i in range(c):
        ints[wishes + i] = ints[asking + i]
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
    """How many of WISHES the level they enter denies, and which (DENIED); ENTERED_STATE: the state in it; or NEED."""
    states, wishes, key, denied = ints[ints[WORKED + LEVEL] + STATES], ints[WISHES], ints[KEY], 0
    for i in range(ints[ELEMENTS]):
        ints[key + i] = ints[states + i] if ints[wishes + i] == NOBODY else ints[wishes + i]
    status = transfer(ints, numbers, WORKED, key, ENTERED_STATE)
    if status < 0:
        return status
    update_phases(ints, numbers, waves, ENTERED_STATE, -1)
    for i in range(ints[ELEMENTS]):
        ints[ints[DENIED] + i] = 0
        compliant = ints[ints[KINDS] + i] != RIGID
        if ints[wishes + i] != NOBODY and compliant and is_refused(ints, ENTERED_STATE, i) == 1:
            relaxes = is_relaxing(ints, numbers, waves, ENTERED_STATE, i)
            if relaxes < 0:
                return relaxes
            ints[ints[DENIED] + i] = 1 - relaxes
            denied += 1 - relaxes
    return denied


@compiled
def is_relaxing(ints: Ints, numbers: Numbers, waves: Waves, state: int, element: int) -> int:
    """1 where a viscous contact is open where closed it would pull; or NEED."""
    level = ints[state + LEVEL]
    if ints[ints[KINDS] + element] != VISCOUS or ints[ints[level + STATES] + element] == CLOSE:
        return 0
    exit_ = first_exit(ints, level, element)
    signal = entered_signal(ints, level, exit_)
    if signal < 0:
        return signal
    sign = row_sign(ints, numbers, state, signal)
    if sign == 0:
        sign = becomes(ints, numbers, waves, state, signal, 0)
    return 1 if sign <= 0 else 0


@compiled
def entered_signal(ints: Ints, level: int, exit_: int) -> int:
    """The signal that an exit's element would have in the level entered alone; or NEED."""
    if ints[exit_ + ENTERED] < 0:
        ints[NEEDED] = NEED_ENTERED
        ints[NEEDED_FROM] = level
        ints[ints[NEEDED_KEY]] = (exit_ - ints[level + EXITS]) // EXIT_INTS
        return NEED
    return ints[exit_ + ENTERED]


@compiled
def open_and_enter(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """ENTERED_STATE is entered by WISHES: a rigid contact that opens keeps no speed into its stop; OK or FAILED."""
    wishes, opened, entered = ints[WISHES], 0, ENTERED_STATE
    for i in range(ints[ELEMENTS]):
        numbers[ints[PUSHED] + i] = 0.0
        if ints[wishes + i] != NOBODY and ints[ints[KINDS] + i] == RIGID:
            ints[ints[TOUCHING] + opened] = i
            opened += 1
    if opened > 0:
        touching = ints[TOUCHING]
        status = collide(ints, numbers, ENTERED_STATE, touching, opened, 0, STRUCK, ints[IMPULSES], LOST_NOW)
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
