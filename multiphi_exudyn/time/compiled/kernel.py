"""The event loop, compiled: from event to event as in simulate.py, as long as every decision is a plain one.

Where one is not (decision.py), or a root stays undecided (search.py), the loop ends before the segment that it cannot
finish, and the NumPy loop takes that one. Of this package numba's cache watches this file alone: a change of the
others is seen when the cache (``__pycache__``) has been removed.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.mathematics.first_descent import INSTANT
from multiphi_exudyn.time.compiled.decision import (
    ARMED,
    DENIED,
    LIFTED,
    NOT_PLAIN,
    PULLED,
    RECOVERING,
    REFUSED,
    collapse,
    decide,
    expand,
)
from multiphi_exudyn.time.compiled.pack import Levels
from multiphi_exudyn.time.compiled.search import FOUND, UNDECIDED, first_descent, meets_another
from multiphi_exudyn.time.compiled.waves import BOUNDS, cached, copy, exponentials, inlined, jit

__all__ = ["CHATTER", "CLOSE", "DONE", "FULL", "LEFT", "OPEN", "run"]

DONE, LEFT, FULL, CHATTER = 0, 1, 2, 3
CLOSE, OPEN = 0, 1


@inlined
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
def crowded(spans: np.ndarray, n: int, time: float, window: int, period: float, within: float) -> bool:
    """Whether the last ``window`` segments, of n, are chatter.

    They are where they lie ``within`` a share of the time so far, or are more than ``period`` in a period of the
    highest kept mode.
    """
    if n <= window:
        return False
    elapsed, highest = time - spans[n - window, 0], 0.0
    for i in range(n - window, n):
        highest = max(highest, spans[i, 3])
    return elapsed <= within * time or 0 < highest * elapsed < window / period


@jit
def note(event: np.ndarray, kind: np.ndarray, time: float, amounts: np.ndarray, contact: int, change: int) -> None:
    """Write an event."""
    event[0] = time
    copy(amounts, 4, event[1:])
    kind[0], kind[1] = contact, change


@cached
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
    within: float,
) -> tuple[int, int, float, int, int, int, int]:
    """(DONE | LEFT | FULL | CHATTER, level, time [s], segments, events, samples, transitions) from a state to ``end``.

    x, v, phases: the state in level a, replaced. n, m: rows taken so far of spans (n, 4): start, end, armed at,
    highest frequency; levels (n,), coefficients (n, 2, p), standings (n, c); events (m, 5): time, losses, impulse;
    kinds (m, 2): contact, CLOSE | OPEN. window, period, within: of the chatter check.
    """
    p_most, r_most, c_count = k.rates.shape[2], k.squared.shape[1], len(phases)
    signals, slopes = np.empty((2 * c_count, 2, p_most)), np.empty((2 * c_count, 2, p_most))
    bounds, values = np.empty((2 * c_count, BOUNDS)), np.empty((2, 2 * c_count, 2))
    constants, waits = np.empty(2 * c_count), np.empty((2 * c_count, 2), np.int64)
    phi, c, after = np.empty((3, 2, p_most)), np.empty((2, p_most)), np.empty((2, r_most))
    work, amounts, nothing, follow = np.empty(r_most), np.empty(4), np.zeros(4), np.empty(c_count, np.int8)
    at_x, at_v, next_c = np.empty(r_most), np.empty(r_most), np.zeros((2, p_most))
    samples = transitions = 0
    expand(k, a, x, v, c)
    while time < end:
        if n >= len(spans) or m + 2 > len(events):
            return FULL, a, time, n, m, samples, transitions
        p, horizon = k.sizes[a, 1], end - time
        reached = armed_at = 0.0
        asking = -1
        copy(phases, c_count, follow)
        for j in range(p):
            phi[2, 0, j], phi[2, 1, j] = 1.0, 0.0
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
            again = reached * k.scales[a, 3] <= INSTANT and phases[asking] == REFUSED and follow[asking] == REFUSED
            if answer == NOT_PLAIN or again:
                return LEFT, a, time, n, m, samples, transitions
        started, time = time, end if reached == horizon else time + reached
        spans[n, 0], spans[n, 1], spans[n, 2], spans[n, 3] = started, time, armed_at, k.scales[a, 3]
        levels[n] = a
        copy(c[0], p, coefficients[n, 0])
        copy(c[1], p, coefficients[n, 1])
        copy(phases, c_count, standings[n])
        n += 1
        if answer != DENIED:
            transitions += 1
            note(events[m], kinds[m], time, amounts, asking, OPEN if k.closed[a, asking] else CLOSE)
            m += 1
        if answer in (PULLED, LIFTED):
            note(events[m], kinds[m], time, nothing, asking, OPEN)
            m += 1
        a = b
        copy(after[0] if asking >= 0 else at_x, k.sizes[a, 0], x)
        copy(after[1] if asking >= 0 else at_v, k.sizes[a, 0], v)
        copy(follow, c_count, phases)
        copy(next_c[0], k.sizes[a, 1], c[0])
        copy(next_c[1], k.sizes[a, 1], c[1])
        if asking >= 0 and crowded(spans, n, time, window, period, within):
            return CHATTER, a, time, n, m, samples, transitions
    return DONE, a, time, n, m, samples, transitions
