"""Rebounds: rigid contacts with restitution leave their stops again, by sentence 11 of the law (decision.py).

    H v+ + e H v- >= 0,  p >= 0, complementary;  WANTED = -e H v-                                            (Moreau)

Beside friction that would make energy where sliding turns (T. R. Kane). There all are struck without restitution
first, with impulses p, and then once more with at least e p (Poisson), H v+ >= 0, in Coulomb's cone both times. With
W = H^T M^-1 H that takes (1 - e^2) p W p / 2 at least, as u+ q <= e u+ p of the second impulses q, e the same of all.

A sequence of ever smaller bounces, s the speed of the present one and a the gap's acceleration back to the stop, takes
2 s/(a (1 - e)) more: as long as one bounce of speed s/(1 - e).
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    ACCELERATION,
    ARMED,
    BY_IMPACT,
    CAUSE,
    CAUSED_BY,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_WIDTH,
    CHANGES,
    CHANNELS,
    COMPRESSED,
    ELEMENTS,
    EXIT_COUNT,
    FAILED,
    FIRST_CHANGE,
    FIRST_EXITS,
    FURTHER,
    GAINING,
    GROUPS,
    HEARD,
    IMPULSES,
    INSTANT_TIME,
    KINDS,
    LANDING,
    LASTS,
    LEVEL,
    LOST_IN_IMPACT,
    MIXED,
    MOBILITY,
    MODES,
    OK,
    OPEN,
    PHASES,
    REACHED,
    RECOVERING,
    RESTITUTIONS,
    RIGID,
    ROWS,
    SETTLED,
    SIGNAL,
    SPEED,
    SPEEDS,
    STATES,
    STATIC_FRICTIONS,
    STILL,
    STRUCK,
    TOUCHING,
    UNSETTLED,
    WANTED,
    WORKED,
)
from multiphi_exudyn.events.changes import NOBODY
from multiphi_exudyn.events.energies import kinetic
from multiphi_exudyn.events.impact import RESTING, collide, fill_rows, speed_size, unseen_speed
from multiphi_exudyn.events.phases import first_exit
from multiphi_exudyn.events.signals import gap, rate_sign, row_sign
from multiphi_exudyn.events.state_arrays import copy_state, same_level
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.free_rows import norm, product
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = [
    "bounce",
    "collide_and_rebound",
    "forget_bounces",
    "has_rebounded",
    "hear_touching",
    "keep_landing",
    "last_bounce",
    "only_bounces",
    "rebound",
]

BRIEF = 1e-12  # of the time so far: a shorter bounce is the last
BLOWS = 100  # at one instant, of contacts that drive each other back to their stops


@compiled
def lands(ints: Ints, state: int, element: int) -> int:
    """1 where an open contact comes down from its last bounce."""
    level = ints[state + LEVEL]
    if ints[ints[level + STATES] + element] != OPEN:
        return 0
    return 1 if ints[ints[state + PHASES] + ints[ints[level + FIRST_EXITS] + element]] == LANDING else 0


@compiled
def hear_touching(ints: Ints, numbers: Numbers, asking: int) -> None:
    """10, 11. HEARD: with one that strikes and rebounds are all rigid contacts that touch without a speed, or come in.

    And all that touch where any rubs: an impact of all is then another one than impacts in turn.
    """
    level, struck, rebounds, rubs = ints[WORKED + LEVEL], 0, 0, 0
    for i in range(ints[ELEMENTS]):
        rubs = 1 if numbers[ints[STATIC_FRICTIONS] + i] > 0.0 else rubs
        opened = ints[ints[level + STATES] + i] == OPEN and ints[ints[KINDS] + i] == RIGID
        if opened and ints[asking + i] != NOBODY:
            struck = 1
            rebounds = 1 if numbers[ints[RESTITUTIONS] + i] > 0.0 else rebounds
    for i in range(ints[ELEMENTS] if struck * max(rebounds, rubs) == 1 else 0):
        if ints[ints[level + STATES] + i] == OPEN and ints[ints[KINDS] + i] == RIGID and ints[ints[HEARD] + i] == 0:
            signal, leaves = first_exit(ints, level, i) + SIGNAL, 0
            if rebounds == 1 or numbers[ints[RESTITUTIONS] + i] > 0.0:
                leaves = rate_sign(ints, numbers, WORKED, signal)
            ints[ints[HEARD] + i] = 1 if leaves <= 0 and row_sign(ints, numbers, WORKED, signal, 0.0) == 0 else 0


@compiled
def forget_bounces(ints: Ints) -> None:
    """No contact begins its last bounce."""
    for i in range(ints[ELEMENTS]):
        ints[ints[LASTS] + i] = 0


@compiled
def row_speed(ints: Ints, numbers: Numbers, state: int, k: int) -> float:
    """Gap velocity of one of those that touch, zero where it is round-off; their rows have been filled."""
    n = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS]
    row = ints[ROWS] + k * n
    speed = product(numbers, row, ints[state + SPEED], n)
    return 0.0 if abs(speed) <= RESTING * speed_size(ints, numbers, state, row) else speed


@compiled
def rebound(ints: Ints, numbers: Numbers, state: int, count: int) -> int:
    """11. WANTED: gap velocities (count,) that those that touch are to have, of a state before their impact.

    How many are to leave their stops, or FAILED where of those struck together not all have one restitution.
    """
    bouncing = 0
    fill_rows(ints, numbers, ints[state + LEVEL], ints[TOUCHING], count, 0)
    for k in range(count):
        contact = ints[ints[TOUCHING] + k]
        restitution = 0.0 if lands(ints, WORKED, contact) == 1 else numbers[ints[RESTITUTIONS] + contact]
        speed = 0.0 if restitution == 0.0 else row_speed(ints, numbers, state, k)
        numbers[ints[WANTED] + k] = -restitution * speed if speed != 0.0 else 0.0
        bouncing += 1 if numbers[ints[WANTED] + k] > 0.0 else 0
    return same_restitution(ints, numbers, state, count) if bouncing > 0 else 0


@compiled
def collide_and_rebound(
    ints: Ints, numbers: Numbers, state: int, count: int, bouncing: int, result: int, losses: int
) -> int:
    """11. The state after an impact of those that touch, with its IMPULSES, and as many as are to leave their stops.

    Where any of them rubs, by e times their impulses. Adds its losses; OK or FAILED.
    """
    touching, impulses, least, rubs = ints[TOUCHING], ints[IMPULSES], ints[WANTED], 0
    for k in range(count if bouncing > 0 else 0):
        rubs = 1 if numbers[ints[STATIC_FRICTIONS] + ints[touching + k]] > 0.0 else rubs
    if rubs == 0:
        wanted = ints[WANTED] if bouncing > 0 else -1
        return collide(ints, numbers, state, touching, count, 0, wanted, -1, result, impulses, losses)
    before = numbers[losses + BY_IMPACT]
    if collide(ints, numbers, state, touching, count, 0, -1, -1, COMPRESSED, ints[FURTHER], losses) < 0:
        return FAILED
    taken = numbers[losses + BY_IMPACT] - before
    for k in range(count):
        landing = lands(ints, WORKED, ints[touching + k]) == 1
        restitution = 0.0 if landing else numbers[ints[RESTITUTIONS] + ints[touching + k]]
        numbers[ints[FURTHER] + k] = max(numbers[ints[FURTHER] + k], 0.0)
        numbers[least + k] = restitution * numbers[ints[FURTHER] + k]
    if collide(ints, numbers, COMPRESSED, touching, count, 0, -1, least, result, impulses, losses) < 0:
        return FAILED
    for k in range(count):
        numbers[impulses + k] += numbers[ints[FURTHER] + k]
    if numbers[losses + BY_IMPACT] - before >= -RESTING * (taken + kinetic(ints, numbers, state)):
        return OK
    ints[CAUSE] = GAINING
    for i in range(ints[ELEMENTS]):
        ints[ints[CAUSED_BY] + i] = 0
    for k in range(count):
        ints[ints[CAUSED_BY] + ints[touching + k]] = 1
    return FAILED


@compiled
def same_restitution(ints: Ints, numbers: Numbers, state: int, count: int) -> int:
    """How many of those that touch are to leave their stops; FAILED where of coupled ones not all rebound alike."""
    level, groups, bouncing = ints[state + LEVEL], ints[GROUPS], 0
    r = ints[level + MODES]
    n = r + ints[CHANNELS]
    for k in range(count):
        ints[groups + k] = k
        bouncing += 1 if numbers[ints[WANTED] + k] > 0.0 else 0
    for k in range(count):
        for j in range(k):
            one, other = ints[ROWS] + k * n, ints[ROWS] + j * n
            shared = abs(product(numbers, one, other, r))
            if ints[level + MOBILITY] >= 0 or shared > INDEPENDENT * norm(numbers, one, r) * norm(numbers, other, r):
                joined, kept = ints[groups + k], ints[groups + j]
                for i in range(count):
                    ints[groups + i] = kept if ints[groups + i] == joined else ints[groups + i]
    for i in range(ints[ELEMENTS]):
        ints[ints[CAUSED_BY] + i] = 0
    mixed = 0
    for k in range(count):
        contact, speed = ints[ints[TOUCHING] + k], row_speed(ints, numbers, state, k)
        for j in range(k):
            beside = ints[ints[TOUCHING] + j]
            alike = numbers[ints[RESTITUTIONS] + contact] == numbers[ints[RESTITUTIONS] + beside]
            landing = lands(ints, WORKED, contact) == 1 or lands(ints, WORKED, beside) == 1
            struck = speed < 0.0 and row_speed(ints, numbers, state, j) < 0.0
            if struck and not alike and not landing and ints[groups + k] == ints[groups + j]:
                ints[ints[CAUSED_BY] + contact] = 1
                ints[ints[CAUSED_BY] + beside] = 1
                mixed = 1
    ints[CAUSE] = MIXED if mixed == 1 else ints[CAUSE]
    return FAILED if mixed == 1 else bouncing


@compiled
def bounce(ints: Ints, numbers: Numbers, count: int) -> int:
    """11. STRUCK: those that others drive back to their stops in an impact are struck again, at once; OK or FAILED."""
    for _ in range(BLOWS):
        coming = 0
        fill_rows(ints, numbers, ints[STRUCK + LEVEL], ints[TOUCHING], count, 0)
        for k in range(count):
            coming += 1 if row_speed(ints, numbers, STRUCK, k) < 0.0 else 0
        if coming == 0:
            return OK
        if rebound(ints, numbers, STRUCK, count) < 0 or push_on(ints, numbers, count) < 0:
            return FAILED
    ints[CAUSE] = UNSETTLED
    return FAILED


@compiled
def push_on(ints: Ints, numbers: Numbers, count: int) -> int:
    """STRUCK becomes the state after one more impact, to the speeds WANTED; OK or FAILED."""
    touching, further = ints[TOUCHING], ints[FURTHER]
    if collide(ints, numbers, STRUCK, touching, count, 0, ints[WANTED], -1, STILL, further, LOST_IN_IMPACT) < 0:
        return FAILED
    copy_state(ints, numbers, STILL, STRUCK)
    for k in range(count):
        numbers[ints[IMPULSES] + k] += numbers[further + k]
    return OK


@compiled
def has_rebounded(ints: Ints, numbers: Numbers, k: int) -> int:
    """1 where one of those that touch has been struck, and rebounds."""
    contact = ints[ints[TOUCHING] + k]
    rebounds = numbers[ints[RESTITUTIONS] + contact] > 0.0 and lands(ints, WORKED, contact) == 0
    return 1 if rebounds and numbers[ints[IMPULSES] + k] > 0.0 else 0


@compiled
def last_bounce(ints: Ints, numbers: Numbers, count: int) -> int:
    """11. How many leave their stops for the last time, after an impact: a bounce is too low to be seen, or too short.

    It becomes as long as all that would follow. xi'' of STRUCK stands in the accelerations. Or FAILED.
    """
    level, last = ints[STRUCK + LEVEL], 0
    n = ints[level + MODES] + ints[CHANNELS]
    fill_rows(ints, numbers, level, ints[TOUCHING], count, 0)
    for k in range(count):
        contact, row, wanted = ints[ints[TOUCHING] + k], ints[ROWS] + k * n, ints[WANTED] + k
        restitution, speed = numbers[ints[RESTITUTIONS] + contact], row_speed(ints, numbers, STRUCK, k)
        ends = has_rebounded(ints, numbers, k) == 1 and restitution < 1.0 and ints[ints[LASTS] + contact] == 0
        numbers[wanted] = 0.0
        falling = -product(numbers, row, ints[ACCELERATION], n)
        unseen = max(unseen_speed(ints, numbers, STRUCK, contact, row), 0.5 * BRIEF * numbers[INSTANT_TIME] * falling)
        if ends and 0.0 < speed <= unseen:
            numbers[wanted] = speed / (1.0 - restitution)
            ints[ints[LASTS] + contact] = 1
            last += 1
    return last if last == 0 or push_on(ints, numbers, count) == OK else FAILED


@compiled
def only_bounces(ints: Ints, numbers: Numbers) -> int:
    """1 where at an instant contacts of restitution below 1 have rebounded, and nothing else has changed."""
    for k in range(ints[CHANGE_COUNT]):
        restitution = numbers[ints[RESTITUTIONS] + ints[ints[CHANGES] + k * CHANGE_WIDTH]]
        if not 0.0 < restitution < 1.0:
            return 0
    return 1 if ints[CHANGE_COUNT] > 0 and same_level(ints, REACHED, WORKED) == 1 else 0


@compiled
def keep_landing(ints: Ints, numbers: Numbers) -> None:
    """11. Phases of WORKED: contacts on their last bounce, since this instant or before it without a blow since.

    Who has been struck was at its stop: a gap that is the round-off of the instant, at its speed, is armed.
    """
    level, armed = ints[WORKED + LEVEL], 1
    n = ints[level + MODES] + ints[CHANNELS]
    for i in range(ints[ELEMENTS]):
        if ints[ints[KINDS] + i] == RIGID and ints[ints[level + STATES] + i] == OPEN:
            struck = 0
            for k in range(ints[FIRST_CHANGE], ints[CHANGE_COUNT]):
                if ints[ints[CHANGES] + k * CHANGE_WIDTH] == i and numbers[ints[CHANGE_IMPULSES] + k] != 0.0:
                    struck = 1
            phase = ints[WORKED + PHASES] + ints[ints[level + FIRST_EXITS] + i]
            speed = product(numbers, ints[level + SPEEDS] + i * (n + 1), ints[WORKED + SPEED], n)
            blurred = ZERO * numbers[INSTANT_TIME] * speed
            if struck == 1 and ints[phase] == RECOVERING and -gap(ints, numbers, WORKED, i) <= blurred:
                ints[phase] = ARMED
            last = ints[ints[LASTS] + i] == 1 or (struck == 0 and lands(ints, REACHED, i) == 1)
            if last and ints[phase] == ARMED:
                ints[phase] = LANDING
    for k in range(ints[level + EXIT_COUNT]):
        armed = armed if ints[ints[WORKED + PHASES] + k] == ARMED else 0
    ints[WORKED + SETTLED] = armed
