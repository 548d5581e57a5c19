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
    BY_IMPACT,
    CAUSE,
    CAUSED_BY,
    CHANNELS,
    COMPRESSED,
    ELEMENTS,
    FAILED,
    FURTHER,
    GAINING,
    GROUPS,
    HEARD,
    IMPULSES,
    KINDS,
    LASTS,
    LEVEL,
    MIXED,
    MOBILITY,
    MODES,
    OK,
    OPEN,
    RESTITUTIONS,
    RIGID,
    ROWS,
    SIGNAL,
    STATES,
    STATIC_FRICTIONS,
    STRUCK,
    TOUCHING,
    UNSETTLED,
    WANTED,
    WORKED,
)
from multiphi_exudyn.events.law.bounces import lands, push_on, row_speed
from multiphi_exudyn.events.law.changes import NOBODY
from multiphi_exudyn.events.law.impact import RESTING, collide, fill_rows
from multiphi_exudyn.events.law.phases import first_exit
from multiphi_exudyn.events.states.energies import kinetic
from multiphi_exudyn.events.states.signals import rate_sign, row_sign
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.complementarity.free_rows import norm, product
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT

__all__ = ["bounce", "collide_and_rebound", "forget_bounces", "hear_touching", "rebound"]

BLOWS = 100  # at one instant, of contacts that drive each other back to their stops


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
