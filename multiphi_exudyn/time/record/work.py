"""Work of damping, of varying loads and of friction over segments that the loop has left out, in closed form.

    damping   integral of xi'.D xi'
    varying   integral of sum_k  w_k a_k.xi' + w_k' (b_k.xi + c_k.xi' + d_k.xi'' + e_k)
    friction  integral of f.xi' + sum_e T_e (s_e.xi'): constant limits times slip, and forces that follow others

f(t) = Re sum_j F_j phi_j and g alike are sums of the flow's exponentials, so that f g is one of their products,

    f g = 1/2 Re sum_jk F_j G_k phi_j phi_k + F_j conj(G_k phi_k) phi_j

and needs no exponentials but those at the end. Where the free response has no powers of time, its own share of damping
is the change of a form that its level keeps (work_forms.primitive). A chain is a rate with its powers of time: the
products of two chains are (t/T)^d exp(s t), s the sum of their rates, and d goes up to the sum of their degrees.
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
from multiphi_exudyn.time.loop.work_sums import LARGE_FREE_RESPONSE
from multiphi_exudyn.time.record.segment_restart import restart_segment
from multiphi_exudyn.time.record.work_terms import (
    add_constants,
    add_friction,
    free_damping_work,
    free_motion_square,
    list_factors,
    list_terms,
    motion_square,
)

__all__ = ["integrate_works", "work_waves"]

LARGEST_FACTOR = 1024.0  # times a segment's horizon, for a tenth of the terms
UPWARDS_ABOVE = 0.5  # |s t| - d above which I_d follows from I_d-1: below it that loses d! / |s t|^d
SERIES_ROUND_OFF = 1e-18  # of the first term of a power series: terms below it are left out


def work_waves(n: int, p: int, q: int, s: int) -> int:
    """Number of waves of scratch memory for n coordinates, p exponentials, q channels and s friction forces."""
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
    """Add the works [J] of damping, of varying loads, jumps at the starts included, and of friction to ``works`` (3,).

    Of the segments ``places`` (count,) whose levels have offsets. scratch: ``work_waves`` of them. Return OK or NEED.
    """
    largest = 0.0
    for k in range(count):
        i = places[k]
        level = offsets[rows[i * SEGMENT_WIDTH]]
        if level == 0:
            continue
        q = ints[CHANNELS]
        n, duration = ints[level + MODES] + q, instants[i + 1] - instants[i]
        driven_place = rows[i * SEGMENT_WIDTH + 2] + 2 * n  # place of its horizon and of the work at its start
        status = restart_segment(ints, numbers, waves, rows, coordinates, offsets, i, LARGEST_FACTOR)
        if status != NEED and ints[PRESCRIBED] > 0 and numbers[HORIZON] > coordinates[driven_place]:
            largest = max(largest, motion_square(ints, numbers))
            if free_motion_square(ints, waves) > LARGE_FREE_RESPONSE * largest:
                status = restart_segment(ints, numbers, waves, rows, coordinates, offsets, i, 1.0)
        if status == NEED:
            return NEED
        p = ints[FLOW_COUNT]
        place, sums = 0, 4 * n * p + 2 * q * p + 2 * ints[level + RUBBINGS] * p
        exponentials(ints, numbers, waves, ints[FLOW_BASIS], duration, duration, ints[WORK_WAVES])
        if ints[PRESCRIBED] > 0:
            works[1] += coordinates[driven_place + 1]
        closed_count = 0  # number of first terms whose products need no integral
        if ints[level + DISSIPATED] >= 0:
            closed_count = ints[FLOW_FREE]
            works[0] += free_damping_work(ints, numbers, waves, duration)
        if closed_count == p and q == 0:
            continue
        list_terms(ints, numbers, waves, scratch, closed_count if ints[level + RUBBING] < 0 else 0)
        list_factors(ints, numbers, waves, scratch, closed_count)
        end_powers = sums + 12 * p  # powers of t / T at the end
        scratch[end_powers] = 1.0 + 0j
        for d in range(1, 2 * p):
            scratch[end_powers + d] = scratch[end_powers + d - 1] * (
                duration / numbers[ints[ints[FLOW_BASIS] + SCALES]]
            )
        add_constants(ints, numbers, waves, scratch, works)
        if ints[level + RUBBING] >= 0:
            add_friction(ints, numbers, waves, scratch, works)
        while place < p:
            other, length = max(place, closed_count), chain_length(ints, place)
            while other < p:
                further = chain_length(ints, other)
                for conjugate in range(
                    multiply_chains(ints, waves, scratch, closed_count, place, length, other, further, sums)
                ):
                    add_chain_integrals(
                        ints, numbers, waves, scratch, place, other, length + further - 1, conjugate, duration, sums,
                        works,
                    )  # fmt: skip
                other += further
            place += length
    return OK


@compiled
def chain_length(ints: Ints, first: int) -> int:
    """Number of exponentials of the chain that begins with the ``first`` one."""
    basis, end = ints[FLOW_BASIS], first + 1
    while end < ints[FLOW_COUNT] and ints[ints[basis + POWERS] + end] > 0:
        end += 1
    return end - first


@compiled
def multiply_chains(
    ints: Ints, waves: Waves, scratch: Waves, closed_count: int, a: int, length: int, b: int, further: int, sums: int
) -> int:
    """Sum F_j G_k and F_j conj(G_k) over two chains, in both orders, by degree; return how many are not zero.

    Into the scratch memory from ``sums`` on, (6, 2 p): damping, varying loads and friction, then all with conj(G_k);
    where both have the same integral they are added up. closed_count: the first terms, which have no chain; the level
    keeps their speeds.
    """
    level, p, q, sum_count = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], 0
    n, reached = ints[level + MODES] + q, ints[ints[level + RESPONSE] + REACHED]
    real = waves[ints[ints[FLOW_BASIS] + RATES] + b].imag == 0.0
    for m in range(6):
        for d in range(length + further - 1):
            scratch[sums + m * 2 * p + d] = 0j
    for j in range(a, a + length):
        first_mode, last_mode, speed = 0, n, ints[level + SWINGS] + j * (n + q)
        if j < ints[FLOW_FREE]:
            first_mode, last_mode = ints[reached + 2 * j], ints[reached + 2 * j + 1]
        for k in range(j if a == b else b, b + further):
            damping, damping_conj, varying, varying_conj = 0j, 0j, 0j, 0j
            for i in range(first_mode, last_mode):
                f, g = waves[speed + i] if j < closed_count else scratch[(p + j) * n + i], scratch[(3 * p + k) * n + i]
                damping += f * g
                damping_conj += f * g.conjugate()
            if j < closed_count:
                damping, damping_conj = (
                    waves[ints[FLOW_WAVES] + j] * damping,
                    waves[ints[FLOW_WAVES] + j] * damping_conj,
                )
            if j != k:  # both orders; D is symmetric
                damping, damping_conj = 2.0 * damping, 2.0 * damping_conj
            for i in range(2 * q):
                part = (i // q * p) * n + n - q + i % q
                if j >= ints[FLOW_FREE]:
                    f, g = scratch[part + j * n], scratch[4 * p * n + 2 * q * k + i]
                    varying += f * g
                    varying_conj += f * g.conjugate()
                if j != k:
                    f, g = scratch[part + k * n], scratch[4 * p * n + 2 * q * j + i]
                    varying += f * g
                    varying_conj += f.conjugate() * g
            friction, friction_conj = 0j, 0j
            for e in range(ints[level + RUBBINGS]):
                one, other = 4 * p * n + 2 * q * p + 2 * (e * p + j), 4 * p * n + 2 * q * p + 2 * (e * p + k)
                friction += scratch[one] * scratch[other + 1]
                friction_conj += scratch[one] * scratch[other + 1].conjugate()
                if j != k:
                    friction += scratch[other] * scratch[one + 1]
                    friction_conj += scratch[other].conjugate() * scratch[one + 1]
            if real:
                damping, varying, friction = damping + damping_conj, varying + varying_conj, friction + friction_conj
            if (
                damping != 0
                or damping_conj != 0
                or varying != 0
                or varying_conj != 0
                or friction != 0
                or friction_conj != 0
            ):
                sum_count, at = 1 if real else 2, sums + j - a + k - b
                scratch[at] += damping
                scratch[at + 2 * p] += varying
                scratch[at + 4 * p] += friction
                scratch[at + 6 * p] += damping_conj
                scratch[at + 8 * p] += varying_conj
                scratch[at + 10 * p] += friction_conj
    return sum_count


@compiled
def add_chain_integrals(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    scratch: Waves,
    a: int,
    b: int,
    count: int,
    conjugate: int,
    duration: float,
    sums: int,
    works: Numbers,
) -> None:
    """Add the integrals of the products of two chains to the works (3,), in powers d < ``count`` of t / T.

    I_d = (u^d exp(s t) - d / T I_d-1) / s, u = t / T, upwards while d is below |s t|; the others downwards from

    I_d = t u^d exp(s t) sum_n (-s t)^n / ((d + 1) (d + 2) ... (d + n + 1))
    """
    basis, phi, p = ints[FLOW_BASIS], ints[WORK_WAVES], ints[FLOW_COUNT]
    rate, end, unit = waves[ints[basis + RATES] + b], waves[phi + b], numbers[ints[basis + SCALES]]
    if conjugate == 1:
        rate, end = complex(rate.real, -rate.imag), complex(end.real, -end.imag)
    s, end, first = waves[ints[basis + RATES] + a] + rate, waves[phi + a] * end, sums + 6 * p * conjugate
    x, size, end_powers = s * duration, math.sqrt(s.real * s.real + s.imag * s.imag), sums + 12 * p
    upwards = min(max(math.floor(size * duration - UPWARDS_ABOVE) + 1, 0), count)
    integral, inverse = end - 1.0, complex(s.real / size / size, -s.imag / size / size) if upwards > 0 else 0j
    for d in range(upwards):
        if d > 0:
            integral = scratch[end_powers + d] * end - d / unit * integral
        integral *= inverse
        for part in range(3):
            works[part] += 0.5 * (scratch[first + 2 * p * part + d] * integral).real
    if upwards == count:
        return
    term, integral, n = duration / count * scratch[end_powers + count - 1] * end, 0j, count
    least = SERIES_ROUND_OFF * (abs(term.real) + abs(term.imag))
    while abs(term.real) + abs(term.imag) > least:
        integral += term
        n += 1
        term *= x * (-1.0 / n)
    for d in range(count - 1, upwards - 1, -1):
        for part in range(3):
            works[part] += 0.5 * (scratch[first + 2 * p * part + d] * integral).real
        if d > 0:
            integral = (scratch[end_powers + d] * end - s * integral) * (unit / d)
