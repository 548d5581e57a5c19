"""Work of damping, of what varies in time and of friction over segments that the loop has left out, in closed form.

    damping   integral of xi'.D xi'
    varying   integral of sum_k  w_k a_k.xi' + w_k' (b_k.xi + c_k.xi' + d_k.xi'' + e_k)
    friction  integral of f.xi' + sum_e T_e (s_e.xi'): limits times ways slipped, and forces that go with others

f(t) = Re sum_j F_j phi_j and g alike are sums of the flow's exponentials, so that f g is one of their products,

    f g = 1/2 Re sum_jk F_j G_k phi_j phi_k + F_j conj(G_k phi_k) phi_j

and needs no exponentials but those at the end. Where no power of time is in the free response, its own share of damping
is what a form that its level keeps has changed by (work_forms.primitive). A chain is a rate with its powers of time:
the products of two chains are (t/T)^d exp(s t), s the sum of their rates, and d goes up to the sum of their degrees.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANNELS,
    DISSIPATED,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FREE,
    FLOW_WAVES,
    HORIZON,
    LEVEL,
    MODES,
    NEED,
    OK,
    PRESCRIBED,
    RESPONSE,
    RUBBING,
    RUBBINGS,
    SEGMENT_WIDTH,
    SWINGS,
    WORK_WAVES,
)
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Shorts, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import POWERS, RATES, SCALES, exponentials
from multiphi_exudyn.mathematics.response.response_arrays import REACHED
from multiphi_exudyn.time.loop.work_sums import INFLATED
from multiphi_exudyn.time.record.segment_restart import resume
from multiphi_exudyn.time.record.work_terms import (
    add_constants,
    add_friction,
    dissipated_freely,
    list_terms,
    swinging,
    swinging_alone,
    weigh_terms,
)

__all__ = ["integrate_works", "work_waves"]

WIDEST = 1024.0  # times a segment's horizon, for a tenth of the terms
UPWARDS_ABOVE = 0.5  # |s t| - d from which I_d follows from I_d-1: below, that loses d! / |s t|^d
SERIES_ROUND_OFF = 1e-18  # of the first term of a power series: terms below it are left out


def work_waves(n: int, p: int, q: int, s: int) -> int:
    """Waves that the work of a segment takes, of n coordinates, p exponentials and q channels."""
    return 4 * n * p + 2 * q * p + 2 * s * p + 14 * p


@compiled
def integrate_works(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    rows: Shorts,
    coordinates: Numbers,
    offsets: Ints,
    instants: Numbers,
    places: Ints,
    count: int,
    scratch: Waves,
    works: Numbers,
) -> int:
    """Adds the works (3,) [J] of damping, of what varies with what jumped at the starts, and of friction; OK or NEED.

    Of the segments ``places`` (count,), as far as their levels have offsets.
    scratch: ``work_waves`` of them.
    """
    largest = 0.0
    for which in range(count):
        i = places[which]
        level = offsets[rows[i * SEGMENT_WIDTH]]
        if level == 0:
            continue
        q = ints[CHANNELS]
        n, duration = ints[level + MODES] + q, instants[i + 1] - instants[i]
        driven = rows[i * SEGMENT_WIDTH + 2] + 2 * n  # where its horizon and the work at its start stand
        status = resume(ints, numbers, waves, rows, coordinates, offsets, i, WIDEST)
        if status != NEED and ints[PRESCRIBED] > 0 and numbers[HORIZON] > coordinates[driven]:
            largest = max(largest, swinging(ints, numbers))
            if swinging_alone(ints, waves) > INFLATED * largest:
                status = resume(ints, numbers, waves, rows, coordinates, offsets, i, 1.0)
        if status == NEED:
            return NEED
        p = ints[FLOW_COUNT]
        place, sums = 0, 4 * n * p + 2 * q * p + 2 * ints[level + RUBBINGS] * p
        exponentials(ints, numbers, waves, ints[FLOW_BASIS], duration, duration, ints[WORK_WAVES])
        if ints[PRESCRIBED] > 0:
            works[1] += coordinates[driven + 1]
        apart = 0  # terms whose products need no integral
        if ints[level + DISSIPATED] >= 0:
            apart = ints[FLOW_FREE]
            works[0] += dissipated_freely(ints, numbers, waves, duration)
        if apart == p and q == 0:
            continue
        list_terms(ints, numbers, waves, scratch, apart if ints[level + RUBBING] < 0 else 0)
        weigh_terms(ints, numbers, waves, scratch, apart)
        raised = sums + 12 * p  # powers of t / T at the end
        scratch[raised] = 1.0 + 0j
        for d in range(1, 2 * p):
            scratch[raised + d] = scratch[raised + d - 1] * (duration / numbers[ints[ints[FLOW_BASIS] + SCALES]])
        add_constants(ints, numbers, waves, scratch, works)
        if ints[level + RUBBING] >= 0:
            add_friction(ints, numbers, waves, scratch, works)
        while place < p:
            other, length = max(place, apart), chain(ints, place)
            while other < p:
                further = chain(ints, other)
                for mirrored in range(multiply(ints, waves, scratch, apart, place, length, other, further, sums)):
                    integrate(
                        ints, numbers, waves, scratch, place, other, length + further - 1, mirrored, duration, sums,
                        works,
                    )  # fmt: skip
                other += further
            place += length
    return OK


@compiled
def chain(ints: Ints, first: int) -> int:
    """How many exponentials with the rate of the ``first`` one follow it as its powers, itself included."""
    basis, end = ints[FLOW_BASIS], first + 1
    while end < ints[FLOW_COUNT] and ints[ints[basis + POWERS] + end] > 0:
        end += 1
    return end - first


@compiled
def multiply(
    ints: Ints, waves: Waves, scratch: Waves, apart: int, a: int, length: int, b: int, further: int, sums: int
) -> int:
    """Sums of F_j G_k and of F_j conj(G_k) over two chains, either way round, by degree: how many are not zero.

    In the scratch memory from ``sums`` on, (6, 2 p): of damping, what varies and friction, then all with conj(G_k);
    where that has the same integral it is added to the first ones.
    apart: the first terms, which have no chain, and of which the level knows the speeds.
    """
    level, p, q, some = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], 0
    n, reached = ints[level + MODES] + q, ints[ints[level + RESPONSE] + REACHED]
    real = waves[ints[ints[FLOW_BASIS] + RATES] + b].imag == 0.0
    for m in range(6):
        for d in range(length + further - 1):
            scratch[sums + m * 2 * p + d] = 0j
    for j in range(a, a + length):
        lowest, highest, swing = 0, n, ints[level + SWINGS] + j * (n + q)
        if j < ints[FLOW_FREE]:
            lowest, highest = ints[reached + 2 * j], ints[reached + 2 * j + 1]
        for k in range(j if a == b else b, b + further):
            same, crossed, varying, mirrored = 0j, 0j, 0j, 0j
            for i in range(lowest, highest):
                f, g = waves[swing + i] if j < apart else scratch[(p + j) * n + i], scratch[(3 * p + k) * n + i]
                same += f * g
                crossed += f * g.conjugate()
            if j < apart:
                same, crossed = waves[ints[FLOW_WAVES] + j] * same, waves[ints[FLOW_WAVES] + j] * crossed
            if j != k:  # either way round; D is symmetric
                same, crossed = 2.0 * same, 2.0 * crossed
            for i in range(2 * q):
                part = (i // q * p) * n + n - q + i % q
                if j >= ints[FLOW_FREE]:
                    f, g = scratch[part + j * n], scratch[4 * p * n + 2 * q * k + i]
                    varying += f * g
                    mirrored += f * g.conjugate()
                if j != k:
                    f, g = scratch[part + k * n], scratch[4 * p * n + 2 * q * j + i]
                    varying += f * g
                    mirrored += f.conjugate() * g
            rubbed, opposed = 0j, 0j
            for e in range(ints[level + RUBBINGS]):
                one, other = 4 * p * n + 2 * q * p + 2 * (e * p + j), 4 * p * n + 2 * q * p + 2 * (e * p + k)
                rubbed += scratch[one] * scratch[other + 1]
                opposed += scratch[one] * scratch[other + 1].conjugate()
                if j != k:
                    rubbed += scratch[other] * scratch[one + 1]
                    opposed += scratch[other].conjugate() * scratch[one + 1]
            if real:
                same, varying, rubbed = same + crossed, varying + mirrored, rubbed + opposed
            if same != 0 or crossed != 0 or varying != 0 or mirrored != 0 or rubbed != 0 or opposed != 0:
                some, at = 1 if real else 2, sums + j - a + k - b
                scratch[at] += same
                scratch[at + 2 * p] += varying
                scratch[at + 4 * p] += rubbed
                scratch[at + 6 * p] += crossed
                scratch[at + 8 * p] += mirrored
                scratch[at + 10 * p] += opposed
    return some


@compiled
def integrate(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    scratch: Waves,
    a: int,
    b: int,
    count: int,
    mirrored: int,
    duration: float,
    sums: int,
    works: Numbers,
) -> None:
    """Adds what the products of two chains make of the works (3,), in powers d < ``count`` of t / T.

    I_d = (u^d exp(s t) - d / T I_d-1) / s, u = t / T, upwards while d is below |s t|; the others downwards from

    I_d = t u^d exp(s t) sum_n (-s t)^n / ((d + 1) (d + 2) ... (d + n + 1))
    """
    basis, phi, p = ints[FLOW_BASIS], ints[WORK_WAVES], ints[FLOW_COUNT]
    rate, end, unit = waves[ints[basis + RATES] + b], waves[phi + b], numbers[ints[basis + SCALES]]
    if mirrored == 1:
        rate, end = complex(rate.real, -rate.imag), complex(end.real, -end.imag)
    s, end, first = waves[ints[basis + RATES] + a] + rate, waves[phi + a] * end, sums + 6 * p * mirrored
    x, size, raised = s * duration, math.sqrt(s.real * s.real + s.imag * s.imag), sums + 12 * p
    upwards = min(max(math.floor(size * duration - UPWARDS_ABOVE) + 1, 0), count)
    integral, inverse = end - 1.0, complex(s.real / size / size, -s.imag / size / size) if upwards > 0 else 0j
    for d in range(upwards):
        if d > 0:
            integral = scratch[raised + d] * end - d / unit * integral
        integral *= inverse
        for part in range(3):
            works[part] += 0.5 * (scratch[first + 2 * p * part + d] * integral).real
    if upwards == count:
        return
    term, integral, n = duration / count * scratch[raised + count - 1] * end, 0j, count
    least = SERIES_ROUND_OFF * (abs(term.real) + abs(term.imag))
    while abs(term.real) + abs(term.imag) > least:
        integral += term
        n += 1
        term *= x * (-1.0 / n)
    for d in range(count - 1, upwards - 1, -1):
        for part in range(3):
            works[part] += 0.5 * (scratch[first + 2 * p * part + d] * integral).real
        if d > 0:
            integral = (scratch[raised + d] * end - s * integral) * (unit / d)
