"""Plain decisions of the event rule, compiled: the state after an instant at which one contact asks, alone.

Plain is what no other contact has to answer: a compliant contact changes or is denied, a rigid one opens, or strikes
while no other is closed and then stays or rebounds. The sentences of the rule are those of events/rule.py.
"""

from __future__ import annotations

import math

import numpy as np

from multiphi_exudyn.events.rule import RESTING
from multiphi_exudyn.mathematics.first_descent import DERIVATIVES
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.time.compiled.pack import Levels
from multiphi_exudyn.time.compiled.waves import copy, inlined, jit

__all__ = ["ARMED", "DENIED", "LIFTED", "NOT_PLAIN", "PULLED", "RECOVERING", "REFUSED", "collapse", "decide", "expand"]

ARMED, RECOVERING, REFUSED = 0, 1, 2
PLAIN, DENIED, PULLED, LIFTED, NOT_PLAIN = 0, 1, 2, 3, 4  # answers; PULLED and LIFTED are rebounds


@jit
def sign_of(value: float, size: float) -> int:
    """Sign of a sum of terms of this size, zero where it is round-off of them."""
    if abs(value) <= ZERO * size:
        return 0
    return 1 if value > 0 else -1


@inlined
def row_sign(k: Levels, a: int, row: np.ndarray, constant: float, x: np.ndarray, v: np.ndarray) -> int:
    """Sign of row . (x, v) + constant, a mode's two terms taken for one; see Row.sign."""
    value, size = 0.0, abs(constant)
    for i in range(k.sizes[a, 0]):
        term = row[0, i] * x[i] + row[1, i] * v[i]
        value += term
        size += abs(term)
        if k.squared[a, i] != 0:
            size += abs(row[0, i] * v[i]) / math.sqrt(abs(k.squared[a, i]))
    return sign_of(value + constant, size)


@inlined
def reaction_sign(k: Levels, a: int, row: np.ndarray, constant: float, x: np.ndarray, v: np.ndarray) -> int:
    """The same, every term taken for itself."""
    value, size = 0.0, abs(constant)
    for i in range(k.sizes[a, 0]):
        pushed, damped = row[0, i] * x[i], row[1, i] * v[i]
        value += pushed + damped
        size += abs(pushed) + abs(damped)
        if k.squared[a, i] != 0:
            size += abs(row[0, i] * v[i]) / math.sqrt(abs(k.squared[a, i]))
    return sign_of(value + constant, size)


@inlined
def rate_sign(k: Levels, a: int, row: np.ndarray, x: np.ndarray, v: np.ndarray, acceleration: np.ndarray) -> int:
    """Sign of the time derivative of row . (x, v); see Row.rate_sign."""
    value = size = 0.0
    for i in range(k.sizes[a, 0]):
        term = row[0, i] * v[i]
        if k.rated[a]:
            term += row[1, i] * acceleration[i]
        value += term
        size += abs(term) + abs(row[0, i] * x[i]) * math.sqrt(abs(k.squared[a, i]))
    return sign_of(value, size)


@inlined
def accelerate(k: Levels, a: int, x: np.ndarray, v: np.ndarray, result: np.ndarray) -> None:
    """eta'' in level a."""
    r = k.sizes[a, 0]
    for i in range(r):
        result[i] = -k.squared[a, i] * x[i]
    for j in range(r):
        for i in range(r):
            result[i] -= k.damping[a, j, i] * v[j]


@inlined
def accelerating(k: Levels, a: int, row: np.ndarray, x: np.ndarray, v: np.ndarray) -> float:
    """Of which terms row . eta'' is the sum; see State.accelerating."""
    total = 0.0
    for i in range(k.sizes[a, 0]):
        square = abs(k.squared[a, i])
        terms = square * abs(x[i]) + math.sqrt(square) * abs(v[i])
        for j in range(k.sizes[a, 0]):
            terms += abs(k.damping[a, j, i] * v[j])
        total += abs(row[0, i]) * terms
    return total


@inlined
def expand(k: Levels, a: int, x: np.ndarray, v: np.ndarray, c: np.ndarray) -> None:
    """Coefficients (2, p) of the motion in level a that starts at x, v."""
    r, p = k.sizes[a, 0], k.sizes[a, 1]
    for j in range(p):
        c[0, j] = c[1, j] = 0.0
    for i in range(r):
        for j in range(p):
            c[0, j] += x[i] * k.from_state[a, i, 0, j] + v[i] * k.from_state[a, r + i, 0, j]
            c[1, j] += x[i] * k.from_state[a, i, 1, j] + v[i] * k.from_state[a, r + i, 1, j]


@inlined
def collapse(k: Levels, a: int, c: np.ndarray, phi: np.ndarray, x: np.ndarray, v: np.ndarray) -> None:
    """The state in level a where the exponentials are phi."""
    r, p = k.sizes[a, 0], k.sizes[a, 1]
    for i in range(r):
        x[i] = v[i] = 0.0
    for j in range(p):
        re = c[0, j] * phi[0, j] - c[1, j] * phi[1, j]
        im = c[0, j] * phi[1, j] + c[1, j] * phi[0, j]
        for i in range(r):
            x[i] += re * k.to_state[a, j, 0, i] + im * k.to_state[a, j, 1, i]
        for i in range(r):
            v[i] += re * k.to_state[a, j, 0, r + i] + im * k.to_state[a, j, 1, r + i]


@inlined
def move(k: Levels, a: int, contact: int, given: np.ndarray, result: np.ndarray, place: bool) -> None:
    """A displacement (``place``) or velocity of level a in the level after the contact's change."""
    r = k.sizes[k.target[a, contact], 0]
    for i in range(r):
        result[i] = k.offset[a, contact, i] if place else 0.0
    for j in range(k.sizes[a, 0]):
        for i in range(r):
            result[i] += k.matrix[a, contact, j, i] * given[j]


@jit
def kinetic(v: np.ndarray, r: int) -> float:
    """Kinetic energy [J]."""
    total = 0.0
    for i in range(r):
        total += v[i] * v[i]
    return 0.5 * total


@inlined
def potential(k: Levels, a: int, x: np.ndarray) -> float:
    """Strain energy less the potential of the load [J]."""
    total = 0.0
    for i in range(k.sizes[a, 0]):
        total += k.squared[a, i] * x[i] * x[i]
    return 0.5 * total + k.scales[a, 4]


@inlined
def first_sign(k: Levels, a: int, contact: int, c: np.ndarray, since: int) -> int:
    """Sign of the first derivative of s that is not round-off, from the one of order ``since`` on."""
    p = k.sizes[a, 1]
    for order in range(since, DERIVATIVES):
        value = size = 0.0
        for j in range(p):
            re = k.own_signal[a, contact, 0, j] * c[0, j] - k.own_signal[a, contact, 1, j] * c[1, j]
            im = k.own_signal[a, contact, 0, j] * c[1, j] + k.own_signal[a, contact, 1, j] * c[0, j]
            for _ in range(order):
                re, im = (
                    re * k.rates[a, 0, j] - im * k.rates[a, 1, j],
                    re * k.rates[a, 1, j] + im * k.rates[a, 0, j],
                )
            value += re
            size += math.sqrt(re * re + im * im)
        constant = k.own_constant[a, contact] if order == 0 else 0.0
        sign = sign_of(value + constant, size + abs(constant))
        if sign != 0:
            return sign
    return 0


@inlined
def standing(k: Levels, a: int, contact: int, x: np.ndarray, v: np.ndarray, c: np.ndarray, work: np.ndarray) -> int:
    """The phase in which a contact stands; c: coefficients of the motion from here."""
    row = k.own[a, contact]
    value = row_sign(k, a, row, k.own_constant[a, contact], x, v)
    if value > 0:
        return ARMED
    if k.rated[a]:
        accelerate(k, a, x, v, work)
    rate = rate_sign(k, a, row, x, v, work)
    if rate == 0:
        rate = first_sign(k, a, contact, c, 2)
    if value == 0 and rate >= 0:
        return ARMED
    pulls = k.rigid[contact] and k.closed[a, contact]
    return RECOVERING if rate > 0 and not pulls else REFUSED


@inlined
def stand(k: Levels, a: int, x: np.ndarray, v: np.ndarray, c: np.ndarray, work: np.ndarray, phases: np.ndarray) -> None:
    """The phases of all contacts, and the coefficients of the motion from here."""
    expand(k, a, x, v, c)
    for contact in range(len(phases)):
        phases[contact] = standing(k, a, contact, x, v, c, work)


@jit
def push(row: np.ndarray, v: np.ndarray, r: int) -> tuple[float, float, float]:
    """row . v, row . row, |row| . |v|."""
    value = square = size = 0.0
    for i in range(r):
        value += row[0, i] * v[i]
        square += row[0, i] * row[0, i]
        size += abs(row[0, i]) * abs(v[i])
    return value, square, size


@inlined
def strike(k: Levels, a: int, contact: int, x: np.ndarray, v: np.ndarray, work: np.ndarray) -> tuple[int, float]:
    """A rigid contact strikes in level a: (PLAIN: it stays, PULLED or LIFTED off, NOT_PLAIN), impulse; v becomes v+."""
    r, row = k.sizes[a, 0], k.own[a, contact]
    for other in range(len(k.rigid)):
        if k.rigid[other] and k.closed[a, other]:
            return NOT_PLAIN, 0.0
    speed, square, size = push(row, v, r)
    if not speed < 0:
        return NOT_PLAIN, 0.0
    impulse = -speed / square
    for i in range(r):
        before = abs(v[i])
        v[i] += impulse * row[0, i]
        if abs(v[i]) <= RESTING * before:
            v[i] = 0.0
    left, _, more = push(row, v, r)
    accelerate(k, a, x, v, work)
    pressing, _, _ = push(row, work, r)
    noise = accelerating(k, a, row, x, v)
    if abs(left) > RESTING * (size + more) or abs(pressing) <= ZERO * noise:
        return NOT_PLAIN, 0.0
    if pressing > 0:
        return LIFTED, impulse
    if k.target[a, contact] < 0:
        return NOT_PLAIN, 0.0
    sign = reaction_sign(k, a, k.entered[a, contact], k.entered_constant[a, contact], x, v)
    return (PULLED if sign < 0 else PLAIN), impulse


@inlined
def part_with(k: Levels, b: int, contact: int, v: np.ndarray) -> tuple[float, float]:
    """A rigid contact that has opened keeps no velocity into its stop; kinetic energy lost, and impulse."""
    r, row = k.sizes[b, 0], k.own[b, contact]
    speed, square, size = push(row, v, r)
    if speed >= 0:
        return 0.0, 0.0
    before = kinetic(v, r)
    for i in range(r):
        v[i] -= speed / square * row[0, i]
    return before - kinetic(v, r), -speed / square if -speed > RESTING * size else 0.0


@inlined
def decide(
    k: Levels,
    a: int,
    contact: int,
    x: np.ndarray,
    v: np.ndarray,
    after: np.ndarray,
    c: np.ndarray,
    work: np.ndarray,
    phases: np.ndarray,
    amounts: np.ndarray,
) -> tuple[int, int]:
    """(answer, level) right after a contact has asked; ``after`` is the state in it, c and phases follow.

    amounts: losses [J] by impact, kinetic and strain truncation, and the impulse [N s].
    """
    before, strained, rigid = kinetic(v, k.sizes[a, 0]), potential(k, a, x), k.rigid[contact]
    amounts[0] = amounts[1] = amounts[2] = amounts[3] = 0.0
    answer = PLAIN
    if rigid and not k.closed[a, contact]:
        answer, amounts[3] = strike(k, a, contact, x, v, work)
        amounts[0] = before - kinetic(v, k.sizes[a, 0])
    if answer == NOT_PLAIN or (answer == PLAIN and k.target[a, contact] < 0):
        return NOT_PLAIN, a
    copy(x, k.sizes[a, 0], after[0])
    copy(v, k.sizes[a, 0], after[1])
    b = a
    if answer == PLAIN:
        b = k.target[a, contact]
        move(k, a, contact, x, after[0], True)
        move(k, a, contact, v, after[1], False)
        amounts[1] = before - kinetic(after[1], k.sizes[b, 0]) - amounts[0]
        amounts[2] = strained - potential(k, b, after[0])
        if rigid and k.closed[a, contact]:
            amounts[0], amounts[3] = part_with(k, b, contact, after[1])
    for _ in range(2):
        stand(k, b, after[0], after[1], c, work, phases)
        if answer != PLAIN or rigid or phases[contact] != REFUSED:
            break
        answer, b = DENIED, a
        copy(x, k.sizes[a, 0], after[0])
        copy(v, k.sizes[a, 0], after[1])
    if answer == DENIED and phases[contact] != ARMED:
        phases[contact] = REFUSED
    for other in range(len(phases)):
        held = rigid and k.closed[b, other]
        if phases[other] == REFUSED and (other != contact or answer == LIFTED or held):
            return NOT_PLAIN, a
    return answer, b
