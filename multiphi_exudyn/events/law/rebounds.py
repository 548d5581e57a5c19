"""Rebounds: rigid contacts with restitution leave their stops after an impact, by sentence 11 of the law (events/law).

    H v+ + E H v- >= 0,  p >= 0, complementary;  WANTED = -E H v-                                            (Moreau)

It changes the kinetic energy by p (1 - E) H v-/2. E = diag(e) of the contacts that are struck, H v- < 0. A touching
contact that leaves its stop, H v- > 0, has the largest of its own e and of theirs, e_s: then p (1 - E) H v- is at most
(1 - e_s) p H v-, and that is not positive.

Beside friction that would generate energy if the direction of slip turns (T. R. Kane). There all contacts are struck
without restitution first, with impulses p, and then once more with at least e p (Poisson), H v+ >= 0, both times within
Coulomb's cone. With W = H^T M^-1 H this takes at least (1 - e^2) p W p / 2, as u+ q <= e u+ p holds for the second
impulses q, with the same e for all.

A sequence of ever smaller bounces, with s the speed of the present one and a the acceleration of the gap back to the
stop, takes another 2 s/(a (1 - e)): as long as one bounce of speed s/(1 - e).
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
    SPEED,
    STATES,
    STATIC_FRICTIONS,
    TOUCHING,
    UNSETTLED,
    WANTED,
    WORKED,
)
from multiphi_exudyn.events.law.bounces import apply_further_impact, is_on_last_bounce, row_speed
from multiphi_exudyn.events.law.changes import NO_REQUEST
from multiphi_exudyn.events.law.impact import RESTING, collide, fill_rows
from multiphi_exudyn.events.law.phases import first_exit
from multiphi_exudyn.events.states.energies import kinetic
from multiphi_exudyn.events.states.signals import rate_sign, row_sign
from multiphi_exudyn.events.states.state_arrays import measure
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled
from multiphi_exudyn.mathematics.orthonormal import norm, scalar_product
from multiphi_exudyn.mathematics.round_off import INDEPENDENT

__all__ = ["clear_last_bounces", "collide_and_rebound", "flag_touching", "repeat_impacts", "set_rebound_speeds"]

BLOWS = 10_000  # impacts at one instant of contacts that drive each other back; 2750 take all at two e of 0.99


@compiled
def flag_touching(ints: Ints, numbers: Numbers, requests: int) -> None:
    """10, 11. Set HEARD for all rigid contacts that take part in an impact because they touch, or move into their stop.

    They take part if a contact that strikes has restitution. If any contact has friction all that touch take part, as
    one impact of all then differs from impacts in turn.
    """
    level, any_strikes, any_rebounds, any_friction = ints[WORKED + LEVEL], 0, 0, 0
    for i in range(ints[ELEMENTS]):
        any_friction = 1 if numbers[ints[STATIC_FRICTIONS] + i] > 0.0 else any_friction
        opened = ints[ints[level + STATES] + i] == OPEN and ints[ints[KINDS] + i] == RIGID
        if opened and ints[requests + i] != NO_REQUEST:
            any_strikes = 1
            any_rebounds = 1 if numbers[ints[RESTITUTIONS] + i] > 0.0 else any_rebounds
    for i in range(ints[ELEMENTS] if any_strikes * max(any_rebounds, any_friction) == 1 else 0):
        if ints[ints[level + STATES] + i] == OPEN and ints[ints[KINDS] + i] == RIGID and ints[ints[HEARD] + i] == 0:
            signal, rate = first_exit(ints, level, i) + SIGNAL, 0
            if any_rebounds == 1 or numbers[ints[RESTITUTIONS] + i] > 0.0:
                rate = rate_sign(ints, numbers, WORKED, signal)
            ints[ints[HEARD] + i] = 1 if rate <= 0 and row_sign(ints, numbers, WORKED, signal, 0.0) == 0 else 0


@compiled
def clear_last_bounces(ints: Ints) -> None:
    """Set the flags of contacts that begin their last bounce to zero."""
    for i in range(ints[ELEMENTS]):
        ints[ints[LASTS] + i] = 0


@compiled
def set_rebound_speeds(ints: Ints, numbers: Numbers, state: int, count: int) -> int:
    """11. Set WANTED: gap velocities (count,) of the touching contacts after an impact, from a state before it.

    Return how many are to leave their stops, or FAILED if coupled contacts that are struck have different restitution.
    """
    bouncing = 0
    fill_rows(ints, numbers, ints[state + LEVEL], ints[TOUCHING], count, 0)
    for k in range(count):
        contact = ints[ints[TOUCHING] + k]
        restitution = 0.0 if is_on_last_bounce(ints, contact) == 1 else numbers[ints[RESTITUTIONS] + contact]
        speed = 0.0 if restitution == 0.0 else row_speed(ints, numbers, state, k)
        numbers[ints[WANTED] + k] = -restitution * speed if speed != 0.0 else 0.0
        bouncing += 1 if numbers[ints[WANTED] + k] > 0.0 else 0
    if bouncing == 0:
        return 0
    find_coupled(ints, numbers, ints[state + LEVEL], count)
    if check_restitutions(ints, numbers, state, count) < 0:
        return FAILED
    lend_restitutions(ints, numbers, state, count)
    return bouncing


@compiled
def collide_and_rebound(
    ints: Ints, numbers: Numbers, state: int, count: int, bouncing: int, result: int, losses: int
) -> int:
    """11. Compute the state after an impact with restitution, its IMPULSES and losses; return OK or FAILED.

    If any touching contact has friction, restitution is that of impulses (Poisson), else that of velocities (Moreau).
    """
    touching, impulses, least, any_friction = ints[TOUCHING], ints[IMPULSES], ints[WANTED], 0
    for k in range(count if bouncing > 0 else 0):
        any_friction = 1 if numbers[ints[STATIC_FRICTIONS] + ints[touching + k]] > 0.0 else any_friction
    if any_friction == 0:
        wanted = ints[WANTED] if bouncing > 0 else -1
        return collide(ints, numbers, state, touching, count, 0, wanted, -1, result, impulses, losses)
    loss_before = numbers[losses + BY_IMPACT]
    if collide(ints, numbers, state, touching, count, 0, -1, -1, COMPRESSED, ints[FURTHER], losses) < 0:
        return FAILED
    loss_compression = numbers[losses + BY_IMPACT] - loss_before
    for k in range(count):
        last = is_on_last_bounce(ints, ints[touching + k]) == 1
        restitution = 0.0 if last else numbers[ints[RESTITUTIONS] + ints[touching + k]]
        numbers[ints[FURTHER] + k] = max(numbers[ints[FURTHER] + k], 0.0)
        numbers[least + k] = restitution * numbers[ints[FURTHER] + k]
    if collide(ints, numbers, COMPRESSED, touching, count, 0, -1, least, result, impulses, losses) < 0:
        return FAILED
    for k in range(count):
        numbers[impulses + k] += numbers[ints[FURTHER] + k]
    if numbers[losses + BY_IMPACT] - loss_before >= -RESTING * (loss_compression + kinetic(ints, numbers, state)):
        return OK
    ints[CAUSE] = GAINING
    for i in range(ints[ELEMENTS]):
        ints[ints[CAUSED_BY] + i] = 0
    for k in range(count):
        ints[ints[CAUSED_BY] + ints[touching + k]] = 1
    return FAILED


@compiled
def find_coupled(ints: Ints, numbers: Numbers, level: int, count: int) -> None:
    """Set GROUPS (count,): equal numbers of touching contacts that impulses couple; ROWS must have been filled."""
    groups, r = ints[GROUPS], ints[level + MODES]
    n = r + ints[CHANNELS]
    for k in range(count):
        ints[groups + k] = k
    for k in range(count):
        for j in range(k):
            one, other = ints[ROWS] + k * n, ints[ROWS] + j * n
            coupling = abs(scalar_product(numbers, one, numbers, other, r))
            if ints[level + MOBILITY] >= 0 or coupling > INDEPENDENT * norm(numbers, one, r) * norm(numbers, other, r):
                joined, group = ints[groups + k], ints[groups + j]
                for i in range(count):
                    ints[groups + i] = group if ints[groups + i] == joined else ints[groups + i]


@compiled
def check_restitutions(ints: Ints, numbers: Numbers, state: int, count: int) -> int:
    """Return OK, or FAILED if coupled contacts (GROUPS) that are struck together have different restitution."""
    for i in range(ints[ELEMENTS]):
        ints[ints[CAUSED_BY] + i] = 0
    groups, mixed = ints[GROUPS], 0
    for k in range(count):
        contact, speed = ints[ints[TOUCHING] + k], row_speed(ints, numbers, state, k)
        for j in range(k):
            other_contact = ints[ints[TOUCHING] + j]
            same = numbers[ints[RESTITUTIONS] + contact] == numbers[ints[RESTITUTIONS] + other_contact]
            last = is_on_last_bounce(ints, contact) == 1 or is_on_last_bounce(ints, other_contact) == 1
            struck = speed < 0.0 and row_speed(ints, numbers, state, j) < 0.0
            if struck and not same and not last and ints[groups + k] == ints[groups + j]:
                ints[ints[CAUSED_BY] + contact] = 1
                ints[ints[CAUSED_BY] + other_contact] = 1
                mixed = 1
    ints[CAUSE] = MIXED if mixed == 1 else ints[CAUSE]
    return FAILED if mixed == 1 else OK


@compiled
def lend_restitutions(ints: Ints, numbers: Numbers, state: int, count: int) -> None:
    """11. Let contacts that leave their stops have at least the e of those that are struck and coupled with them.

    With a smaller e it would gain more energy than the others lose. ROWS and GROUPS must have been filled.
    """
    groups, wanted = ints[GROUPS], ints[WANTED]
    for k in range(count):
        speed = row_speed(ints, numbers, state, k)
        for j in range(count if speed > 0.0 else 0):
            struck_speed = row_speed(ints, numbers, state, j)
            if struck_speed < 0.0 and ints[groups + k] == ints[groups + j]:
                lent = numbers[wanted + j] / struck_speed * speed
                numbers[wanted + k] = min(numbers[wanted + k], lent)


@compiled
def repeat_impacts(ints: Ints, numbers: Numbers, state: int, count: int, losses: int) -> int:
    """11. Repeat impacts on a struck state until no contact is driven back to its stop by others; return OK or FAILED.

    ``losses`` sums what they lose. Between two stops that both touch it, a mass loses its velocity in blows without
    end: what is round-off of the velocity before them is zero.
    """
    v, r, first = ints[state + SPEED], ints[ints[state + LEVEL] + MODES], 0.0
    for blow in range(BLOWS):
        approaching, size = 0, norm(numbers, v, r)
        first = size if blow == 0 else first
        if size <= RESTING * first:
            for i in range(r):
                numbers[v + i] = 0.0
            measure(ints, numbers, state)
        fill_rows(ints, numbers, ints[state + LEVEL], ints[TOUCHING], count, 0)
        for k in range(count):
            approaching += 1 if row_speed(ints, numbers, state, k) < 0.0 else 0
        if approaching == 0:
            return OK
        if set_rebound_speeds(ints, numbers, state, count) < 0:
            return FAILED
        if apply_further_impact(ints, numbers, state, count, losses) < 0:
            return FAILED
    ints[CAUSE] = UNSETTLED
    return FAILED
