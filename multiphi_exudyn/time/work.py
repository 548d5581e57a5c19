"""Work of damping, of what varies in time and of friction over recorded segments, in closed form.

    damping   integral of xi'.D xi'
    varying   integral of sum_k  w_k a_k.xi' + w_k' (b_k.xi + c_k.xi' + d_k.xi'' + e_k)
    friction  integral of f.xi' + sum_e T_e (s_e.xi'): limits times ways slipped, and forces that go with others

f(t) = Re sum_j F_j phi_j and g alike are sums of the flow's exponentials, so that f g is one of their products,

    f g = 1/2 Re sum_jk F_j G_k phi_j phi_k + F_j conj(G_k phi_k) phi_j

and needs no exponentials but those at the end. Where no power of time is in the free response, its own share of damping
is what a form that its level keeps has changed by (level_parts.primitive). A chain is a rate with its powers of time:
the products of two chains are (t/T)^d exp(s t), s the sum of their rates, and d goes up to the sum of their degrees.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANNELS,
    DISSIPATED,
    DISSIPATION,
    FLOW_BASIS,
    FLOW_COUNT,
    FLOW_FORCED,
    FLOW_FREE,
    FLOW_WAVES,
    FREQUENCIES,
    HORIZON,
    LEVEL,
    MODES,
    NEED,
    OK,
    PLACE,
    POWER,
    PRESCRIBED,
    RESPONSE,
    RUBBING,
    RUBBINGS,
    SEGMENT_WIDTH,
    SEGMENT_WIDTH_NUMBERS,
    SPEED,
    SWINGS,
    WORK_WAVES,
)
from multiphi_exudyn.mathematics.basis_arrays import POWERS, RATES, SCALES, exponentials
from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response_arrays import REACHED, SHAPES
from multiphi_exudyn.time.sampling import resume

__all__ = ["integrate_works", "work_waves"]

WIDEST = 1024.0  # times a segment's horizon, for a tenth of the terms
INFLATED = 100.0  # times the largest energy of the motion, that of a free response: so much their difference loses
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
    rows: Ints,
    spans: Numbers,
    coordinates: Numbers,
    offsets: Ints,
    segments: int,
    scratch: Waves,
    works: Numbers,
) -> int:
    """Adds the works (3,) [J] of damping, of what varies with what jumped at the starts, and of friction; OK or NEED.

    scratch: ``work_waves`` of them.
    """
    largest = 0.0
    for i in range(segments):
        level, given = offsets[rows[i * SEGMENT_WIDTH]], i * SEGMENT_WIDTH_NUMBERS
        if level == 0:
            continue
        status = resume(ints, numbers, waves, rows, spans, coordinates, offsets, i, WIDEST)
        if status != NEED and ints[PRESCRIBED] > 0 and numbers[HORIZON] > spans[given + 3]:
            largest = max(largest, swinging(ints, numbers))
            if swinging_alone(ints, waves) > INFLATED * largest:
                status = resume(ints, numbers, waves, rows, spans, coordinates, offsets, i, 1.0)
        if status == NEED:
            return NEED
        q, duration = ints[CHANNELS], spans[given + 1] - spans[given]
        n, p = ints[level + MODES] + q, ints[FLOW_COUNT]
        place, sums = 0, 4 * n * p + 2 * q * p + 2 * ints[level + RUBBINGS] * p
        exponentials(ints, numbers, waves, ints[FLOW_BASIS], duration, duration, ints[WORK_WAVES])
        works[1] += spans[given + 4]
        apart = 0  # terms whose products need no integral
        if ints[level + DISSIPATED] >= 0:
            apart = ints[FLOW_FREE]
            works[0] += dissipated(ints, numbers, waves, scratch)
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
def swinging(ints: Ints, numbers: Numbers) -> float:
    """|eta'|^2 + |omega eta|^2 at the start of the flow."""
    level, total = ints[AFTER + LEVEL], 0.0
    for i in range(ints[level + MODES]):
        speed = numbers[ints[AFTER + SPEED] + i]
        swing = numbers[ints[level + FREQUENCIES] + i] * numbers[ints[AFTER + PLACE] + i]
        total += speed * speed + swing * swing
    return total


@compiled
def swinging_alone(ints: Ints, waves: Waves) -> float:
    """The same of the free response alone: the sum of |V c lambda|^2."""
    level, rates, total = ints[AFTER + LEVEL], ints[ints[FLOW_BASIS] + RATES], 0.0
    r = ints[level + MODES]
    for j in range(ints[FLOW_FREE]):
        rate, shape = waves[ints[FLOW_WAVES] + j] * waves[rates + j], ints[ints[level + RESPONSE] + SHAPES] + j * r
        for i in range(r):
            speed = rate * waves[shape + i]
            total += speed.real * speed.real + speed.imag * speed.imag
    return total


@compiled
def chain(ints: Ints, first: int) -> int:
    """How many exponentials with the rate of the ``first`` one follow it as its powers, itself included."""
    basis, end = ints[FLOW_BASIS], first + 1
    while end < ints[FLOW_COUNT] and ints[ints[basis + POWERS] + end] > 0:
        end += 1
    return end - first


@compiled
def list_terms(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, first: int) -> None:
    """Coefficients of xi, xi', xi'' (3, p, n) of the flow, from its ``first`` term on."""
    level, basis, p, free = ints[AFTER + LEVEL], ints[FLOW_BASIS], ints[FLOW_COUNT], ints[FLOW_FREE]
    r, c, unit = ints[level + MODES], ints[FLOW_WAVES], numbers[ints[ints[FLOW_BASIS] + SCALES]]
    n, moving = r + ints[CHANNELS], r + ints[PRESCRIBED]
    for j in range(first, p):
        shape, size = ints[ints[level + RESPONSE] + SHAPES] + j * r, r
        if j >= free:
            shape, size = ints[FLOW_FORCED] + (j - free) * moving, moving
        for i in range(n):
            scratch[j * n + i] = waves[shape + i] * waves[c + j] if i < size else 0j
    for j in range(p, 3 * p if n > r else 2 * p):
        if j % p < first:
            continue
        rate, power = waves[ints[basis + RATES] + j % p], 0
        if j % p + 1 < p:
            power = ints[ints[basis + POWERS] + j % p + 1]
        for i in range(n):
            scratch[j * n + i] = rate * scratch[(j - p) * n + i]
            if power > 0:
                scratch[j * n + i] += power / unit * scratch[(j - p + 1) * n + i]


@compiled
def dissipated(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves) -> float:
    """(u + u_0).F (u - u_0) / 2 of the free response at the end u and at the start u_0 of the flow."""
    p, c, phi, total = ints[FLOW_FREE], ints[FLOW_WAVES], ints[WORK_WAVES], 0.0
    real = ints[ints[AFTER + LEVEL] + DISSIPATED]
    imaginary = real + 2 * p * p
    for j in range(p):
        end = waves[c + j] * waves[phi + j]
        scratch[j] = end - waves[c + j]
        scratch[p + j] = end + waves[c + j]
    for j in range(p):  # four sums that do not wait for each other
        first, second, third, fourth = 0.0, 0.0, 0.0, 0.0
        for k in range(p):
            change = scratch[k]
            first += numbers[real + k] * change.real
            second += numbers[real + p + k] * change.imag
            third += numbers[imaginary + k] * change.real
            fourth += numbers[imaginary + p + k] * change.imag
        total += (first + second) * scratch[p + j].real + (third + fourth) * scratch[p + j].imag
        real += 2 * p
        imaginary += 2 * p
    return 0.5 * total


@compiled
def weigh_terms(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, apart: int) -> None:
    """Coefficients of D xi' (p, n), of what w_k, w_k' are multiplied by (p, 2 q), but e_k, and of T_e, s_e.xi'.

    apart: the first terms, whose D xi' nobody needs, and of which the level knows the others.
    """
    level, p, q, r = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], ints[ints[AFTER + LEVEL] + MODES]
    n = r + q
    for j in range(apart):
        for k in range(2 * q):
            swing = ints[level + SWINGS] + j * (r + 2 * q) + r + k
            scratch[4 * p * n + 2 * q * j + k] = waves[ints[FLOW_WAVES] + j] * waves[swing]
    for j in range(apart, p):
        for i in range(n):
            row, total = ints[level + DISSIPATION] + i * n, 0j
            for k in range(n):
                total += numbers[row + k] * scratch[(p + j) * n + k]
            scratch[(3 * p + j) * n + i] = total
        for k in range(q):
            row, held, moved = ints[level + POWER] + k * (4 * n + 1), 0j, 0j
            for i in range(n):
                x, v, a = scratch[j * n + i], scratch[(p + j) * n + i], scratch[(2 * p + j) * n + i]
                held += numbers[row + i] * v
                moved += numbers[row + n + i] * x + numbers[row + 2 * n + i] * v + numbers[row + 3 * n + i] * a
            scratch[4 * p * n + 2 * q * j + k] = held
            scratch[4 * p * n + 2 * q * j + q + k] = moved
        for e in range(ints[level + RUBBINGS]):
            row, tension, speed = ints[level + RUBBING] + n + e * (4 * n + 1), 0j, 0j
            for i in range(n):
                v = scratch[(p + j) * n + i]
                tension += numbers[row + i] * scratch[j * n + i] + numbers[row + n + i] * v
                speed += numbers[row + 2 * n + i] * v
            at = 4 * p * n + 2 * q * p + 2 * (e * p + j)
            scratch[at] = tension
            scratch[at + 1] = speed


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


@compiled
def add_constants(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, works: Numbers) -> None:
    """Adds e_k, and b_k times what is held, times what w_k has changed by to the work of what varies."""
    level, p, q, basis = ints[AFTER + LEVEL], ints[FLOW_COUNT], ints[CHANNELS], ints[FLOW_BASIS]
    n = ints[level + MODES] + q
    for k in range(ints[PRESCRIBED]):
        row = ints[level + POWER] + k * (4 * n + 1)
        constant = numbers[row + 4 * n]
        for held in range(n - q + ints[PRESCRIBED], n):
            constant += numbers[row + n + held] * numbers[ints[AFTER + PLACE] + held]
        for j in range(ints[FLOW_FREE], p):
            began = 1.0 if ints[ints[basis + POWERS] + j] == 0 else 0.0
            works[1] += constant * (scratch[j * n + n - q + k] * (waves[ints[WORK_WAVES] + j] - began)).real


@compiled
def add_friction(ints: Ints, numbers: Numbers, waves: Waves, scratch: Waves, works: Numbers) -> None:
    """Adds the limits times the ways slipped, f times what xi has changed by, and what is constant of T_e likewise."""
    level, row = ints[AFTER + LEVEL], ints[ints[AFTER + LEVEL] + RUBBING]
    n = ints[level + MODES] + ints[CHANNELS]
    for j in range(ints[FLOW_COUNT]):
        pushed = 0j
        for i in range(n):
            pushed += numbers[row + i] * scratch[j * n + i]
        for e in range(ints[level + RUBBINGS]):
            pair = row + n + e * (4 * n + 1)
            constant, moved = numbers[pair + 4 * n], 0j
            for held in range(n - ints[CHANNELS] + ints[PRESCRIBED], n):
                constant += numbers[pair + held] * numbers[ints[AFTER + PLACE] + held]
            for i in range(n):
                moved += numbers[pair + 3 * n + i] * scratch[j * n + i]
            pushed += constant * moved
        began = 1.0 if ints[ints[ints[FLOW_BASIS] + POWERS] + j] == 0 else 0.0
        works[2] += (pushed * (waves[ints[WORK_WAVES] + j] - began)).real
