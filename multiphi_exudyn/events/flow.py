"""Flow in flat arrays: the motion from a state, as long as one piece of every channel lasts.

    xi(t) = Re V (c phi(t)) + Re sum_j exp(mu_j t) sum_k x_jk (t/T)^k

xi = (eta, w); phi the p exponentials of the free response, x (n,) its response to the channels' pieces and these
themselves, T the horizon, a power of two. What is made of a state stands in the scratch memory of the flow: its basis, the
coefficients c of its exponentials (one for each x), of which terms they are the sums, and the x.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    CHANNELS,
    DRIVE,
    DRIVE_WAVES,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FORCED,
    FLOW_FREE,
    FLOW_TERMS,
    FLOW_WAVES,
    FORCE,
    HORIZON,
    LEVEL,
    MODES,
    PIECE_TERMS,
    PIECE_TIMES,
    PLACE,
    RATED,
    RESPONSE,
    ROW,
    SPEED,
    TERM_INTS,
    WAVE,
    WORK_WAVES,
)
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.flat_basis import (
    POWERS,
    RATES,
    SCALES,
    SIZE,
    differentiate,
    exponential_size,
    exponentials,
)
from multiphi_exudyn.mathematics.flat_response import FREE, REACHED, SHAPES, coefficients_of

__all__ = ["expand", "set_drive", "signal_sizes", "signal_waves", "state_at"]


@compiled
def set_drive(ints: Ints, numbers: Numbers, waves: Waves, piece: int, time: float, end: float) -> None:
    """The channels at a time on a piece: w, w', w'' (3, q), the sizes of their terms (3, q), and its terms from then on.

    The terms are moved on by synthetic division. The horizon of motions that begin there is the power of two above what
    is left of the piece, or of the run: bases are shared among pieces of about the same length.
    """
    q, drive, moved = ints[CHANNELS], ints[DRIVE], ints[DRIVE_WAVES]
    start, until = numbers[ints[piece + PIECE_TIMES]], min(numbers[ints[piece + PIECE_TIMES] + 1], end)
    numbers[HORIZON] = math.ldexp(1.0, math.frexp(until - time if until > time else until)[1])
    for k in range(6 * q):
        numbers[drive + k] = 0.0
    for term in range(ints[piece + PIECE_TERMS]):
        count, given = ints[piece + TERM_INTS + 2 * term], ints[piece + TERM_INTS + 2 * term + 1]
        rate, delay = waves[given], time - start
        size, angle = exponential_size(rate.real * delay), rate.imag * delay
        factor = complex(size * math.cos(angle), size * math.sin(angle))
        for k in range(count * q):
            waves[moved + k] = waves[given + 1 + k] * factor
        for k in range(q):
            for lowest in range(count - 1):
                for d in range(count - 2, lowest - 1, -1):
                    waves[moved + d * q + k] += delay * waves[moved + (d + 1) * q + k]
            first = rate * waves[moved + k]
            second = rate * first
            if count > 1:
                first += waves[moved + q + k]
                second += 2.0 * rate * waves[moved + q + k]
            if count > 2:
                second += 2.0 * waves[moved + 2 * q + k]
            numbers[drive + k] += waves[moved + k].real
            numbers[drive + q + k] += first.real
            numbers[drive + 2 * q + k] += second.real
            numbers[drive + 3 * q + k] += abs(waves[moved + k])
            numbers[drive + 4 * q + k] += abs(first)
            numbers[drive + 5 * q + k] += abs(second)
        moved += count * q


@compiled
def expand(ints: Ints, numbers: Numbers, waves: Waves, state: int) -> None:
    """Fill in the flow from a state."""
    level, c = ints[state + LEVEL], ints[FLOW_WAVES]
    response = ints[level + RESPONSE]
    p = ints[ints[response + FREE] + SIZE]
    ints[FLOW_FREE] = p
    coefficients_of(ints, numbers, waves, response, ints[state + PLACE], ints[state + SPEED], ints[level + FORCE], c)
    ints[FLOW_BASIS] = ints[response + FREE]
    ints[FLOW_COUNT] = p
    for j in range(p):
        numbers[ints[FLOW_TERMS] + j] = abs(waves[c + j])


@compiled
def signal_waves(ints: Ints, numbers: Numbers, waves: Waves, state: int, signal: int, result: int) -> None:
    """Coefficients (p,) of a signal on the flow from a state, without its constant."""
    n, row, c = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW], ints[FLOW_WAVES]
    free, count, rate = ints[FLOW_FREE], ints[FLOW_COUNT], ints[WORK_WAVES] + ints[FLOW_COUNT]
    for j in range(free):
        waves[result + j] = waves[ints[signal + WAVE] + j] * waves[c + j]
        waves[rate + j] = waves[ints[signal + WAVE] + free + j] * waves[c + j]
    for j in range(free, count):
        forced = ints[FLOW_FORCED] + (j - free) * n
        value = 0j
        slope = 0j
        for i in range(n):
            value += numbers[row + i] * waves[forced + i]
            slope += numbers[row + n + i] * waves[forced + i]
        waves[result + j] = value
        waves[rate + j] = slope
    if ints[signal + RATED] == 1:
        differentiate(ints, numbers, waves, ints[FLOW_BASIS], rate, rate)
        for j in range(count):
            waves[result + j] += waves[rate + j]


@compiled
def signal_sizes(ints: Ints, numbers: Numbers, waves: Waves, state: int, signal: int, result: int) -> None:
    """Of which terms (p,) the coefficients of a signal are the sums.

    |row.V| |c| + |row'.V| |c| |lambda|, and of a power d > 0 its derivative d / T at the one before.
    """
    n, row, basis = ints[ints[state + LEVEL] + MODES] + ints[CHANNELS], ints[signal + ROW], ints[FLOW_BASIS]
    free, count, unit = ints[FLOW_FREE], ints[FLOW_COUNT], numbers[ints[ints[FLOW_BASIS] + SCALES]]
    for j in range(count):
        value = 0.0
        slope = 0.0
        if j < free:
            value, slope = abs(waves[ints[signal + WAVE] + j]), abs(waves[ints[signal + WAVE] + free + j])
        else:
            forced = ints[FLOW_FORCED] + (j - free) * n
            whole = 0j
            changed = 0j
            for i in range(n):
                whole += numbers[row + i] * waves[forced + i]
                changed += numbers[row + n + i] * waves[forced + i]
            value, slope = abs(whole), abs(changed)
        terms = numbers[ints[FLOW_TERMS] + j]
        numbers[result + j] = value * terms
        if ints[signal + RATED] == 1:
            numbers[result + j] += slope * terms * abs(waves[ints[basis + RATES] + j])
            if ints[ints[basis + POWERS] + j] > 0:
                numbers[result + j - 1] += ints[ints[basis + POWERS] + j] / unit * slope * terms


@compiled
def state_at(ints: Ints, numbers: Numbers, waves: Waves, level: int, t: float, x: int, v: int) -> None:
    """xi, xi' (n,) of the flow a time t after its state."""
    r, basis, response = ints[level + MODES], ints[FLOW_BASIS], ints[level + RESPONSE]
    n, free, count, c = r + ints[CHANNELS], ints[FLOW_FREE], ints[FLOW_COUNT], ints[FLOW_WAVES]
    phi, rate = ints[WORK_WAVES], ints[WORK_WAVES] + ints[FLOW_COUNT]
    exponentials(ints, numbers, waves, basis, t, t, phi)
    differentiate(ints, numbers, waves, basis, c, rate)
    for i in range(n):
        numbers[x + i] = 0.0
        numbers[v + i] = 0.0
    for j in range(count):
        value, slope = waves[c + j] * waves[phi + j], waves[rate + j] * waves[phi + j]
        first, end, row = 0, n, ints[FLOW_FORCED] + (j - free) * n
        if j < free:
            first, end = ints[ints[response + REACHED] + 2 * j], ints[ints[response + REACHED] + 2 * j + 1]
            row = ints[response + SHAPES] + j * r
        for i in range(first, end):
            numbers[x + i] += (waves[row + i] * value).real
            numbers[v + i] += (waves[row + i] * slope).real
