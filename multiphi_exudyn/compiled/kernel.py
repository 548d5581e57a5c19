"""The event loop, compiled: from event to event as in simulate.py, as long as every decision is a plain one.

Plain is an instant at which one contact asks, alone, and which no other contact has to answer: a compliant contact
changes or is denied, a rigid one opens, or strikes while no other is closed and then stays or rebounds. Sentences of
the rule are those of event_rule.py. In any other case the loop ends before the segment it cannot finish, and the
NumPy loop takes that one.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from multiphi_exudyn.compiled.pack import Levels
from multiphi_exudyn.compiled.search import (
    BOUNDS,
    FOUND,
    UNDECIDED,
    exponentials,
    first_descent,
    jit,
    meets_another,
)
from multiphi_exudyn.event_rule import RESTING
from multiphi_exudyn.first_root import DERIVATIVES, ZERO

__all__ = ["CHATTER", "DONE", "FULL", "LEFT", "run"]

DONE, LEFT, FULL, CHATTER = 0, 1, 2, 3
ARMED, RECOVERING, REFUSED = 0, 1, 2
CLOSE, OPEN = 0, 1
PLAIN, DENIED, REBOUND, NOT_PLAIN = 0, 1, 2, 3  # answers


@jit
def sign_of(value: float, size: float) -> int:
    """Sign of a sum of terms of this size, zero where it is round-off of them."""
    if abs(value) <= ZERO * size:
        return 0
    return 1 if value > 0 else -1


@jit
def row_sign(row: np.ndarray, constant: float, x: np.ndarray, v: np.ndarray, r: int) -> int:
    """Sign of row . (x, v) + constant, a mode's two terms taken for one."""
    value, size = 0.0, abs(constant)
    for i in range(r):
        term = row[0, i] * x[i] + row[1, i] * v[i]
        value += term
        size += abs(term)
    return sign_of(value + constant, size)


@jit
def reaction_sign(row: np.ndarray, constant: float, x: np.ndarray, v: np.ndarray, r: int) -> int:
    """The same, every term taken for itself."""
    value, size = 0.0, abs(constant)
    for i in range(r):
        pushed, damped = row[0, i] * x[i], row[1, i] * v[i]
        value += pushed + damped
        size += abs(pushed) + abs(damped)
    return sign_of(value + constant, size)


@jit
def accelerate(k: Levels, a: int, x: np.ndarray, v: np.ndarray, result: np.ndarray) -> None:
    """eta'' in level a."""
    r = k.sizes[a, 0]
    for i in range(r):
        result[i] = -k.squared[a, i] * x[i]
    for j in range(r):
        for i in range(r):
            result[i] -= k.damping[a, j, i] * v[j]


@jit
def expand(k: Levels, a: int, x: np.ndarray, v: np.ndarray, c: np.ndarray) -> None:
    """Coefficients (2, p) of the motion in level a that starts at x, v."""
    r, p = k.sizes[a, 0], k.sizes[a, 1]
    c[:] = 0.0
    for i in range(r):
        for j in range(p):
            c[0, j] += x[i] * k.from_state[a, i, 0, j] + v[i] * k.from_state[a, r + i, 0, j]
            c[1, j] += x[i] * k.from_state[a, i, 1, j] + v[i] * k.from_state[a, r + i, 1, j]


@jit
def collapse(k: Levels, a: int, c: np.ndarray, phi: np.ndarray, x: np.ndarray, v: np.ndarray) -> None:
    """The state in level a where the exponentials are phi."""
    r, p = k.sizes[a, 0], k.sizes[a, 1]
    x[:r] = 0.0
    v[:r] = 0.0
    for j in range(p):
        re = c[0, j] * phi[0, j] - c[1, j] * phi[1, j]
        im = c[0, j] * phi[1, j] + c[1, j] * phi[0, j]
        for i in range(r):
            x[i] += re * k.to_state[a, j, 0, i] + im * k.to_state[a, j, 1, i]
        for i in range(r):
            v[i] += re * k.to_state[a, j, 0, r + i] + im * k.to_state[a, j, 1, r + i]


@jit
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


@jit
def potential(k: Levels, a: int, x: np.ndarray) -> float:
    """Strain energy less the potential of the load [J]."""
    total = 0.0
    for i in range(k.sizes[a, 0]):
        total += k.squared[a, i] * x[i] * x[i]
    return 0.5 * total + k.scales[a, 4]


@jit
def first_sign(k: Levels, a: int, contact: int, c: np.ndarray, skipped: int) -> int:
    """Sign of the first derivative of s that is not round-off, from the one of order ``skipped`` on."""
    p = k.sizes[a, 1]
    for order in range(skipped, DERIVATIVES + skipped):
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


@jit
def standing(k: Levels, a: int, contact: int, x: np.ndarray, v: np.ndarray, c: np.ndarray, work: np.ndarray) -> int:
    """The phase in which a contact stands; c: coefficients of the motion from here."""
    r, row = k.sizes[a, 0], k.own[a, contact]
    value = row_sign(row, k.own_constant[a, contact], x, v, r)
    if value > 0:
        return ARMED
    if k.rated[a]:
        accelerate(k, a, x, v, work)
        rate = row_sign(row, 0.0, v, work, r)
    else:
        rate = row_sign(row, 0.0, v, v, r)  # its second part is zero
    if value == 0 or rate == 0:
        value = first_sign(k, a, contact, c, 0)
        rate = first_sign(k, a, contact, c, 1)
    if value >= 0:
        return ARMED
    pulls = k.rigid[contact] and k.closed[a, contact]
    return RECOVERING if rate > 0 and not pulls else REFUSED


@jit
def stand(k: Levels, a: int, x: np.ndarray, v: np.ndarray, c: np.ndarray, work: np.ndarray, phases: np.ndarray) -> None:
    """The phases of all contacts, and the coefficients of the motion from here."""
    expand(k, a, x, v, c)
    for contact in range(len(phases)):
        phases[contact] = standing(k, a, contact, x, v, c, work)


@jit
def watch(
    k: Levels, a: int, c: np.ndarray, phases: np.ndarray, signals: np.ndarray, constants: np.ndarray, waits: np.ndarray
) -> int:
    """Signals whose first descent is next, and for each its contact and whether that then asks; -1: one is unknown."""
    count, p = 0, k.sizes[a, 1]
    for contact in range(len(phases)):
        phase = phases[contact]
        if phase == REFUSED and k.target[a, contact] < 0:
            return -1
        for part in range(1 if phase == ARMED else 2):
            other = phase == REFUSED and part == 1
            row = k.entered_signal[a, contact] if other else k.own_signal[a, contact]
            constant = k.entered_constant[a, contact] if other else k.own_constant[a, contact]
            rate = phase == RECOVERING and part == 1
            sign = 1.0 if phase == ARMED or rate else -1.0
            for j in range(p):
                re = sign * (row[0, j] * c[0, j] - row[1, j] * c[1, j])
                im = sign * (row[0, j] * c[1, j] + row[1, j] * c[0, j])
                if rate:
                    re, im = (
                        re * k.rates[a, 0, j] - im * k.rates[a, 1, j],
                        re * k.rates[a, 1, j] + im * k.rates[a, 0, j],
                    )
                signals[count, 0, j], signals[count, 1, j] = re, im
            constants[count] = 0.0 if rate else sign * constant
            waits[count, 0], waits[count, 1] = contact, phase == ARMED or part == 1
            count += 1
    return count


@jit
def push(row: np.ndarray, v: np.ndarray, r: int) -> tuple[float, float, float]:
    """row . v, row . row, |row| . |v|."""
    value = square = size = 0.0
    for i in range(r):
        value += row[0, i] * v[i]
        square += row[0, i] * row[0, i]
        size += abs(row[0, i]) * abs(v[i])
    return value, square, size


@jit
def strike(
    k: Levels, a: int, contact: int, x: np.ndarray, v: np.ndarray, c: np.ndarray, work: np.ndarray
) -> tuple[int, float]:
    """A rigid contact strikes in level a, alone: (PLAIN: it stays, REBOUND, or NOT_PLAIN), impulse; v becomes v+."""
    r, row = k.sizes[a, 0], k.own[a, contact]
    for other in range(len(k.rigid)):
        if k.rigid[other] and k.closed[a, other]:
            return NOT_PLAIN, 0.0
    speed, square, size = push(row, v, r)
    if not speed < 0:
        return NOT_PLAIN, 0.0
    impulse = -speed / square
    for i in range(r):
        v[i] += impulse * row[0, i]
    left, _, more = push(row, v, r)
    accelerate(k, a, x, v, work)
    pressing, _, noise = push(row, work, r)
    if abs(left) > RESTING * (size + more) or abs(pressing) <= ZERO * noise:
        return NOT_PLAIN, 0.0
    if pressing > 0:
        expand(k, a, x, v, c)
        return (NOT_PLAIN if standing(k, a, contact, x, v, c, work) == REFUSED else REBOUND), impulse
    if k.target[a, contact] < 0:
        return NOT_PLAIN, 0.0
    sign = reaction_sign(k.entered[a, contact], k.entered_constant[a, contact], x, v, r)
    return (REBOUND if sign < 0 else PLAIN), impulse


@jit
def switch(
    k: Levels, a: int, contact: int, x: np.ndarray, v: np.ndarray, after: np.ndarray, c: np.ndarray, work: np.ndarray
) -> int:
    """A contact changes state into the level after it, whose state is put into ``after``; or it is denied."""
    b = k.target[a, contact]
    if b < 0:
        return NOT_PLAIN
    move(k, a, contact, x, after[0], True)
    move(k, a, contact, v, after[1], False)
    if not k.rigid[contact]:
        expand(k, b, after[0], after[1], c)
        return DENIED if standing(k, b, contact, after[0], after[1], c, work) == REFUSED else PLAIN
    return PLAIN


@jit
def part_with(k: Levels, b: int, contact: int, v: np.ndarray) -> float:
    """A rigid contact that has opened keeps no velocity into its stop; returns the kinetic energy that takes."""
    r, row = k.sizes[b, 0], k.own[b, contact]
    speed, square, _ = push(row, v, r)
    if speed >= 0:
        return 0.0
    before = kinetic(v, r)
    for i in range(r):
        v[i] -= speed / square * row[0, i]
    return before - kinetic(v, r)


@jit
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
    """(answer, level) right after a contact has asked; x, v become the state in it, c and phases follow.

    amounts: losses [J] by impact, kinetic and strain truncation, and the impulse [N s].
    """
    r, before, strained = k.sizes[a, 0], kinetic(v, k.sizes[a, 0]), potential(k, a, x)
    amounts[:] = 0.0
    striking = k.rigid[contact] and not k.closed[a, contact]
    if striking:
        answer, amounts[3] = strike(k, a, contact, x, v, c, work)
        amounts[0] = before - kinetic(v, r)
        if answer == PLAIN:
            switch(k, a, contact, x, v, after, c, work)
    else:
        answer = switch(k, a, contact, x, v, after, c, work)
    if answer == NOT_PLAIN:
        return answer, a
    b = a
    if answer == PLAIN:
        b = k.target[a, contact]
        x[:], v[:] = after[0], after[1]
        amounts[1] = before - kinetic(v, k.sizes[b, 0]) - amounts[0]
        amounts[2] = strained - potential(k, b, x)
        if k.rigid[contact] and not striking:
            amounts[0] = part_with(k, b, contact, v)
    stand(k, b, x, v, c, work, phases)
    if answer == DENIED and phases[contact] != ARMED:
        phases[contact] = REFUSED
    for other in range(len(phases)):
        if phases[other] == REFUSED and other != contact:
            return NOT_PLAIN, a
    return answer, b


@jit
def crowded(spans: np.ndarray, n: int, time: float, window: int, period: float) -> bool:
    """Whether the last ``window`` segments, of n, are more than ``period`` in a period of the highest kept mode."""
    if n <= window:
        return False
    elapsed, highest = time - spans[n - window, 0], 0.0
    for i in range(n - window, n):
        highest = max(highest, spans[i, 3])
    return elapsed == 0 or 0 < highest * elapsed < window / period


@numba.njit(cache=True, nogil=True, error_model="numpy")
def run(
    k: Levels,
    a: int,
    x: np.ndarray,
    v: np.ndarray,
    phases: np.ndarray,
    time: float,
    end: float,
    n: int,
    m: int,
    spans: np.ndarray,
    levels: np.ndarray,
    coefficients: np.ndarray,
    standings: np.ndarray,
    events: np.ndarray,
    kinds: np.ndarray,
    window: int,
    period: float,
) -> tuple[int, int, float, int, int, int, int]:
    """(DONE | LEFT | FULL | CHATTER, level, time [s], segments, events, samples, transitions) from a state to ``end``.

    x, v, phases: the state in level a, replaced. n, m: rows taken so far of spans (n, 4): start, end, armed at,
    highest frequency; levels (n,), coefficients (n, 2, p), standings (n, c); events (m, 5): time, losses, impulse;
    kinds (m, 2): contact, CLOSE | OPEN. window, period: of the chatter check.
    """
    p_most, r_most, c_count = k.rates.shape[2], k.squared.shape[1], len(phases)
    signals, slopes = np.empty((2 * c_count, 2, p_most)), np.empty((2 * c_count, 2, p_most))
    bounds, values = np.empty((2 * c_count, BOUNDS)), np.empty((2, 2 * c_count, 2))
    constants, waits = np.empty(2 * c_count), np.empty((2 * c_count, 2), np.int64)
    phi, c, after = np.empty((3, 2, p_most)), np.empty((2, p_most)), np.empty((2, r_most))
    work, amounts, follow = np.empty(r_most), np.empty(4), np.empty(c_count, np.int8)
    at_x, at_v, next_c = np.empty(r_most), np.empty(r_most), np.empty((2, p_most))
    samples = transitions = 0
    expand(k, a, x, v, c)
    while time < end:
        if n >= len(spans) or m + 2 > len(events):
            return FULL, a, time, n, m, samples, transitions
        p, horizon = k.sizes[a, 1], end - time
        reached = armed_at = 0.0
        asking = -1
        follow[:] = phases
        phi[2, 0], phi[2, 1] = 1.0, 0.0
        while asking < 0:
            count = watch(k, a, c, follow, signals, constants, waits)
            if count < 0:
                return LEFT, a, time, n, m, samples, transitions
            status, found, signal, taken = first_descent(
                signals,
                constants,
                count,
                k.rates[a],
                k.factors[a],
                k.magnitudes[a],
                k.scales[a, 0],
                k.scales[a, 1],
                k.scales[a, 2],
                p,
                reached,
                horizon,
                slopes,
                bounds,
                values,
                phi,
            )
            samples += taken
            if status == UNDECIDED:
                return LEFT, a, time, n, m, samples, transitions
            if status != FOUND:
                reached = horizon
                exponentials(k.rates[a], reached, p, phi[2])
                break
            reached = found
            if c_count > 1 and meets_another(signal, signals, slopes, constants, count, phi[2], p):
                return LEFT, a, time, n, m, samples, transitions
            if waits[signal, 1] == 1:
                asking = waits[signal, 0]
            else:
                follow[waits[signal, 0]] = ARMED
                armed_at = reached
        collapse(k, a, c, phi[2], at_x, at_v)
        answer, b = DENIED, a
        if asking >= 0:
            answer, b = decide(k, a, asking, at_x, at_v, after, next_c, work, follow, amounts)
            if answer == NOT_PLAIN:
                return LEFT, a, time, n, m, samples, transitions
        started, time = time, end if reached == horizon else time + reached
        spans[n, 0], spans[n, 1], spans[n, 2], spans[n, 3] = started, time, armed_at, k.scales[a, 3]
        levels[n] = a
        coefficients[n] = c
        standings[n] = phases
        n += 1
        if answer != DENIED:
            transitions += 1
            events[m, 0] = time
            events[m, 1:] = amounts
            kinds[m, 0], kinds[m, 1] = asking, OPEN if k.closed[a, asking] else CLOSE
            m += 1
        if answer == REBOUND:
            events[m, 0] = time
            events[m, 1:] = 0.0
            kinds[m, 0], kinds[m, 1] = asking, OPEN
            m += 1
        x[:], v[:] = at_x, at_v
        phases[:] = follow
        c[:] = next_c
        a = b
        if asking >= 0 and crowded(spans, n, time, window, period):
            return CHATTER, a, time, n, m, samples, transitions
    return DONE, a, time, n, m, samples, transitions
