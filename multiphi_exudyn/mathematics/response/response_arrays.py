"""Free and forced response of modal equations in flat buffers: free_response.py and forced_response.py, for the loop.

    eta'' + D eta' + S eta = p,   eta(t) = Re V (c phi(t)),   c = A eta(0) + B eta'(0) + P p

D and S (r, r) are whatever the rates, shapes and maps were made for; nothing is symmetric here.

A response is a record in the ints:

    ints[response + MODES]               r
    ints[response + FREE]                the basis of its p exponentials (basis_arrays.py)
    ints[response + REACHED]             where first and last + 1 of the modes that an exponential takes part in begin
                                         in the ints, (p, 2): elsewhere V, A, B and P are zero
    ints[response + FROM_DISPLACEMENT]   where A (p, r) begins in the waves
    ints[response + FROM_VELOCITY]       B (p, r)
    ints[response + FROM_FORCE]          P (p, r)
    ints[response + SHAPES]              V^T (p, r)
    ints[response + SQUARES]             where omega^2 (r,) begins in the numbers,
    ints[response + HALF_DAMPING]        and delta (r,)
    ints[response + UNCOUPLED]           where 1 for a mode with an equation of its own begins in the ints, (r,):
                                         eta'' + 2 delta eta' + omega^2 eta = p
    ints[response + POLES]               and 1 for an exponential of the other modes, (p,)
    ints[response + CHAINS]              where the chains begin in the ints: their number, and of each its m components
                                         and where T (m, m), V^T and B (m, r) begin in the waves, (number, 4)

Forced response, as forced_response.py has it, to p = Re( exp(mu t) sum_d p_d u^d ), u = t/T, T the horizon:

    eta = Re( exp(mu t) sum_k x_k u^k )

as the sum of equations of first order, z' = s z + exp(mu t) p(t), for every pole s; two poles that (nearly) coincide
are one equation of second order. On the carrier mu = 0 only the real parts count, and of a pole and its conjugate one
is solved: twice the real part of its response is that to both. Beside a motion the finite polynomials are taken nearer
to the poles than there, as long as they are not much larger than it: what cancels is round-off of the motion.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import RATES, SIZE, differentiate, exponentials, modulus
from multiphi_exudyn.mathematics.response.forced_orders import clear_rows, first_order, is_far, is_forced, second_order
from multiphi_exudyn.mathematics.response.forced_response import COINCIDING
from multiphi_exudyn.mathematics.round_off import SLOW

__all__ = [
    "CHAINS",
    "FREE",
    "FROM_DISPLACEMENT",
    "FROM_FORCE",
    "FROM_VELOCITY",
    "HALF_DAMPING",
    "MODES",
    "POLES",
    "REACHED",
    "RESPONSE",
    "SHAPES",
    "SQUARES",
    "UNCOUPLED",
    "coefficients_of",
    "forced_response",
    "reached_modes",
    "state_of",
]

MODES, FREE, REACHED, FROM_DISPLACEMENT, FROM_VELOCITY, FROM_FORCE, SHAPES = 0, 1, 2, 3, 4, 5, 6
SQUARES, HALF_DAMPING, UNCOUPLED, POLES, CHAINS = 7, 8, 9, 10, 11
RESPONSE = 12  # ints of the record
CHAIN = 4  # ints of a chain


def reached_modes(maps: Sequence[np.ndarray]) -> np.ndarray:
    """The modes (p, 2) of every exponential, first and one past the last of those where a map (p, r) is not 0."""
    p, r = maps[0].shape
    reached = np.zeros((p, 2), int)
    if any(part.all() for part in maps):
        reached[:, 1] = r
    elif r:
        part = functools.reduce(np.logical_or, maps)
        some = part.any(axis=1)
        reached[:, 0] = np.where(some, part.argmax(axis=1), r)
        reached[:, 1] = np.where(some, r - part[:, ::-1].argmax(axis=1), 0)
    return reached


@compiled
def coefficients_of(
    ints: Ints, numbers: Numbers, waves: Waves, response: int, eta: int, eta_t: int, force: int, result: int
) -> None:
    """c (p,) of the motion that starts at eta, eta' (r,) under the constant modal force p (r,), -1 for none."""
    r, p, reached = ints[response + MODES], ints[ints[response + FREE] + SIZE], ints[response + REACHED]
    for j in range(p):
        moved, pushed = ints[response + FROM_DISPLACEMENT] + j * r, ints[response + FROM_VELOCITY] + j * r
        c = 0j
        for i in range(ints[reached + 2 * j], ints[reached + 2 * j + 1]):
            c += waves[moved + i] * numbers[eta + i] + waves[pushed + i] * numbers[eta_t + i]
        if force >= 0:
            forced = ints[response + FROM_FORCE] + j * r
            for i in range(ints[reached + 2 * j], ints[reached + 2 * j + 1]):
                c += waves[forced + i] * numbers[force + i]
        waves[result + j] = c


@compiled
def state_of(
    ints: Ints, numbers: Numbers, waves: Waves, response: int, c: int, t: float, eta: int, eta_t: int, scratch: int
) -> None:
    """eta(t), eta'(t) (r,) of the motion with coefficients c (p,); scratch: 2p waves."""
    r, basis = ints[response + MODES], ints[response + FREE]
    p, reached, shapes = ints[basis + SIZE], ints[response + REACHED], ints[response + SHAPES]
    phi, rate = scratch, scratch + p
    exponentials(ints, numbers, waves, basis, t, t, phi)
    differentiate(ints, numbers, waves, basis, c, rate)
    for i in range(r):
        numbers[eta + i] = 0.0
        numbers[eta_t + i] = 0.0
    for j in range(p):
        value, slope = waves[c + j] * waves[phi + j], waves[rate + j] * waves[phi + j]
        for i in range(ints[reached + 2 * j], ints[reached + 2 * j + 1]):
            numbers[eta + i] += (waves[shapes + j * r + i] * value).real
            numbers[eta_t + i] += (waves[shapes + j * r + i] * slope).real


@compiled
def forced_response(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    response: int,
    carrier: int,
    forces: int,
    degree: int,
    horizon: float,
    eta: int,
    eta_t: int,
    most: int,
    scratch: int,
    result: int,
) -> int:
    """One response x (K + 1, r) to modal forces p (degree + 1, r) on a carrier, good for [0, horizon]: K + 1.

    eta, eta_t: where the motion (r,) that it becomes part of begins in the numbers, beside which it may be large.
    carrier: where its mu stands in the waves. most: rows that there is room for, more than the degree; where a larger
    number comes back, so many are needed, and x is nothing. scratch: (2 + m) ``most`` waves, m of the longest chain.
    """
    r, basis = ints[response + MODES], ints[response + FREE]
    rows = clear_rows(waves, result, r, 0, 1)
    for i in range(r):
        if ints[ints[response + UNCOUPLED] + i] == 1 and is_forced(waves, forces + i, r, degree) == 1:
            square, delta = numbers[ints[response + SQUARES] + i], numbers[ints[response + HALF_DAMPING] + i]
            place, speed = numbers[eta + i], numbers[eta_t + i]
            rows = force_mode(
                waves, square, delta, carrier, forces, degree, horizon, place, speed, i, r, rows, most, scratch, result
            )
    for j in range(ints[basis + SIZE]):
        if ints[ints[response + POLES] + j] == 1:
            for mirrored in range(1 if waves[carrier] == 0 else 2):
                rows = force_pole(
                    ints, numbers, waves, response, j, mirrored, carrier, forces, degree, horizon, eta, eta_t, rows,
                    most, scratch, result,
                )  # fmt: skip
    for k in range(ints[ints[response + CHAINS]]):
        chain = ints[response + CHAINS] + 1 + k * CHAIN
        for mirrored in range(2):
            rows = force_chain(
                ints, waves, chain, r, mirrored, carrier, forces, degree, horizon, rows, most, scratch, result
            )
    return rows


@compiled
def moving_at(ints: Ints, numbers: Numbers, waves: Waves, response: int, j: int, eta: int, eta_t: int) -> float:
    """|A eta + B eta'| of one exponential of coupled modes: how large it is in a motion."""
    r, reached, total = ints[response + MODES], ints[response + REACHED] + 2 * j, 0j
    moved, pushed = ints[response + FROM_DISPLACEMENT] + j * r, ints[response + FROM_VELOCITY] + j * r
    for i in range(ints[reached], ints[reached + 1]):
        total += waves[moved + i] * numbers[eta + i] + waves[pushed + i] * numbers[eta_t + i]
    return abs(total)


@compiled
def force_mode(
    waves: Waves,
    square: float,
    delta: float,
    carrier: int,
    forces: int,
    degree: int,
    horizon: float,
    place: float,
    speed: float,
    mode: int,
    r: int,
    rows: int,
    most: int,
    scratch: int,
    x: int,
) -> int:
    """Adds the response of one mode, eta'' + 2 delta eta' + omega^2 eta = p, to x (rows, r): its rows then.

    Poles -delta +- (delta^2 - omega^2)^(1/2), apart or together.
    """
    mu, difference, given = waves[carrier], delta * delta - square, scratch + most
    both = mu == 0 and difference < 0.0
    root, near = math.sqrt(abs(difference)), COINCIDING * math.sqrt(abs(square))
    if square == 0.0:
        near = SLOW * max(1.0 / horizon, math.hypot(mu.real, mu.imag))
    if 2 * root <= near:
        for d in range(degree + 1):
            waves[given + d] = waves[forces + d * r + mode]
        own = second_order(waves, square, delta, mu.real, mu.imag, given, degree, horizon, most, scratch)
        return add_mode(waves, scratch, own, mode, r, rows, most, x)
    fast = complex(-delta - root, 0.0) if difference > 0.0 else complex(-delta, -root)
    ratio = square / (fast.real * fast.real + fast.imag * fast.imag)
    moving = abs(place) + abs(speed) / root
    weight = complex(0.5 / root, 0.0) if difference > 0.0 else complex(0.0, -0.5 / root)
    for sign in range(1 if both else 2):
        pole = fast - mu if sign == 1 else complex(ratio * fast.real, -ratio * fast.imag) - mu
        for d in range(degree + 1):
            push = waves[forces + d * r + mode]
            waves[given + d] = weight * (complex(2.0 * push.real, 0.0) if both else push)
        size = modulus(pole.real, pole.imag)
        own = first_order(waves, pole.real, pole.imag, size, given, degree, horizon, moving, most, scratch)
        for k in range(min(own, most) if both else 0):
            waves[scratch + k] = complex(waves[scratch + k].real, 0.0)
        rows = add_mode(waves, scratch, own, mode, r, rows, most, x)
        weight = -weight
    return rows


@compiled
def add_mode(waves: Waves, w: int, own: int, mode: int, r: int, rows: int, most: int, x: int) -> int:
    """Adds w (own,) to a mode's column of x (rows, r), where there is room for it: its rows then."""
    if max(own, rows) > most:
        return max(own, rows)
    rows = clear_rows(waves, x, r, rows, own)
    for k in range(own):
        waves[x + k * r + mode] += waves[w + k]
    return rows


@compiled
def force_pole(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    response: int,
    j: int,
    mirrored: int,
    carrier: int,
    forces: int,
    degree: int,
    horizon: float,
    eta: int,
    eta_t: int,
    rows: int,
    most: int,
    scratch: int,
    x: int,
) -> int:
    """Adds the response of one exponential of coupled modes, or of its conjugate, to x (rows, r): its rows then.

    w' = (lambda - mu) w + B p / 2 along V, with conj(lambda), conj(B), conj(V) where ``mirrored`` is 1; of both where
    mu = 0.
    """
    r, reached, given = ints[response + MODES], ints[response + REACHED] + 2 * j, scratch + most
    maps, shapes = ints[response + FROM_VELOCITY] + j * r, ints[response + SHAPES] + j * r
    pole, mu, sign = waves[ints[ints[response + FREE] + RATES] + j], waves[carrier], 1.0 - 2.0 * mirrored
    both = mu == 0
    for d in range(degree + 1):
        push = 0j
        for i in range(ints[reached], ints[reached + 1]):
            weight, force = waves[maps + i], waves[forces + d * r + i]
            if both:
                push += weight * force.real
            else:
                push += complex(0.5 * weight.real, 0.5 * sign * weight.imag) * force
        waves[given + d] = push
    distance = complex(pole.real, sign * pole.imag) - mu
    size, moving = modulus(distance.real, distance.imag), 0.0
    if is_far(size, degree, horizon) == 0:
        moving = moving_at(ints, numbers, waves, response, j, eta, eta_t)
    own = first_order(waves, distance.real, distance.imag, size, given, degree, horizon, moving, most, scratch)
    if max(own, rows) > most:
        return max(own, rows)
    rows = clear_rows(waves, x, r, rows, own)
    for k in range(own):
        for i in range(ints[reached], ints[reached + 1]):
            shape = waves[shapes + i]
            moved = waves[scratch + k] * complex(shape.real, sign * shape.imag)
            waves[x + k * r + i] += complex(moved.real, 0.0) if both else moved
    return rows


@compiled
def force_chain(
    ints: Ints,
    waves: Waves,
    chain: int,
    r: int,
    mirrored: int,
    carrier: int,
    forces: int,
    degree: int,
    horizon: float,
    rows: int,
    most: int,
    scratch: int,
    x: int,
) -> int:
    """Adds the response of a chain, or of its conjugate, to x (rows, r), the last component first: its rows then."""
    m, mixing, shapes, pushes = ints[chain], ints[chain + 1], ints[chain + 2], ints[chain + 3]
    mu, sign, highest, given = waves[carrier], 1.0 - 2.0 * mirrored, degree, scratch + m * most
    for i in range(m - 1, -1, -1):
        for d in range(highest + 1):
            push = 0j
            for j in range(r if d <= degree else 0):
                weight = waves[pushes + i * r + j]
                push += complex(0.5 * weight.real, 0.5 * sign * weight.imag) * waves[forces + d * r + j]
            for k in range(i + 1, m):
                weight = waves[mixing + i * m + k]
                push += complex(weight.real, sign * weight.imag) * waves[scratch + k * most + d]
            waves[given + d] = push
        pole, w = waves[mixing + i * m + i], scratch + i * most
        distance = complex(pole.real, sign * pole.imag) - mu
        size = modulus(distance.real, distance.imag)
        own = first_order(waves, distance.real, distance.imag, size, given, highest, horizon, 0.0, most, w)
        if max(own, rows) > most:
            return max(own, rows)
        for d in range(own, most):
            waves[w + d] = 0j
        highest = max(highest, own - 1)
        rows = clear_rows(waves, x, r, rows, own)
        for d in range(own):
            for j in range(r):
                shape = waves[shapes + i * r + j]
                waves[x + d * r + j] += waves[w + d] * complex(shape.real, sign * shape.imag)
    return rows
