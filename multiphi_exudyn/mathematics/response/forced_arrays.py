"""Forced response of modal equations in flat buffers: forced_response.py, for the loop.

To p = Re( exp(mu t) sum_d p_d u^d ), u = t/T, T the horizon, it is

    eta = Re( exp(mu t) sum_k x_k u^k )

as the sum of equations of first order, z' = s z + exp(mu t) p(t), for every pole s; two poles that (nearly) coincide
are one equation of second order. On the carrier mu = 0 only the real parts count, and of a pole and its conjugate one
is solved: twice the real part of its response is that to both. Beside a free motion the finite polynomials are
used nearer to the poles, as long as they are not much larger: their cancellation is then round-off of the motion.
"""

from __future__ import annotations

import math

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import RATES, SIZE, modulus
from multiphi_exudyn.mathematics.response.forced_orders import clear_rows, first_order, is_far, is_forced, second_order
from multiphi_exudyn.mathematics.response.forced_response import COINCIDING
from multiphi_exudyn.mathematics.response.response_arrays import (
    CHAIN,
    CHAINS,
    FREE,
    FROM_DISPLACEMENT,
    FROM_VELOCITY,
    HALF_DAMPING,
    MODES,
    POLES,
    REACHED,
    SHAPES,
    SQUARES,
    UNCOUPLED,
)
from multiphi_exudyn.mathematics.round_off import SLOW

__all__ = ["forced_response"]


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
    """Set one response x (K + 1, r) to modal forces p (degree + 1, r) on a carrier, for [0, horizon]; return K + 1.

    eta, eta_t: offsets of the total motion (r,) in the numbers; the response may have its size. carrier: offset of mu
    in the waves. most: number of rows with memory, more than the degree; a larger result is the number needed, without
    x. scratch: (2 + m) ``most`` waves, m of the longest chain.
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
def motion_of_exponential(
    ints: Ints, numbers: Numbers, waves: Waves, response: int, j: int, eta: int, eta_t: int
) -> float:
    """Return |A eta + B eta'| of one exponential of coupled modes: its size in a motion."""
    r, reached, total = ints[response + MODES], ints[response + REACHED] + 2 * j, 0j
    from_displacement, from_velocity = (
        ints[response + FROM_DISPLACEMENT] + j * r,
        ints[response + FROM_VELOCITY] + j * r,
    )
    for i in range(ints[reached], ints[reached + 1]):
        total += waves[from_displacement + i] * numbers[eta + i] + waves[from_velocity + i] * numbers[eta_t + i]
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
    displacement: float,
    velocity: float,
    mode: int,
    r: int,
    rows: int,
    most: int,
    scratch: int,
    x: int,
) -> int:
    """Add the response of one mode, eta'' + 2 delta eta' + omega^2 eta = p, to x; return its number of rows.

    Poles -delta +- (delta^2 - omega^2)^(1/2), apart or together.
    """
    mu, difference, input_ = waves[carrier], delta * delta - square, scratch + most
    is_real = mu == 0 and difference < 0.0
    root, near = math.sqrt(abs(difference)), COINCIDING * math.sqrt(abs(square))
    if square == 0.0:
        near = SLOW * max(1.0 / horizon, math.hypot(mu.real, mu.imag))
    if 2 * root <= near:
        for d in range(degree + 1):
            waves[input_ + d] = waves[forces + d * r + mode]
        count = second_order(waves, square, delta, mu.real, mu.imag, input_, degree, horizon, most, scratch)
        return add_mode(waves, scratch, count, mode, r, rows, most, x)
    fast = complex(-delta - root, 0.0) if difference > 0.0 else complex(-delta, -root)
    ratio = square / (fast.real * fast.real + fast.imag * fast.imag)
    motion = abs(displacement) + abs(velocity) / root
    weight = complex(0.5 / root, 0.0) if difference > 0.0 else complex(0.0, -0.5 / root)
    for sign in range(1 if is_real else 2):
        pole = fast - mu if sign == 1 else complex(ratio * fast.real, -ratio * fast.imag) - mu
        for d in range(degree + 1):
            force = waves[forces + d * r + mode]
            waves[input_ + d] = weight * (complex(2.0 * force.real, 0.0) if is_real else force)
        size = modulus(pole.real, pole.imag)
        count = first_order(waves, pole.real, pole.imag, size, input_, degree, horizon, motion, most, scratch)
        for k in range(min(count, most) if is_real else 0):
            waves[scratch + k] = complex(waves[scratch + k].real, 0.0)
        rows = add_mode(waves, scratch, count, mode, r, rows, most, x)
        weight = -weight
    return rows


@compiled
def add_mode(waves: Waves, w: int, count: int, mode: int, r: int, rows: int, most: int, x: int) -> int:
    """Add w (own,) to a mode's column of x (rows, r) if memory suffices; return its number of rows."""
    if max(count, rows) > most:
        return max(count, rows)
    rows = clear_rows(waves, x, r, rows, count)
    for k in range(count):
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
    """Add the response of one exponential of coupled modes, or of its conjugate, to x; return its number of rows.

    w' = (lambda - mu) w + B p / 2 along V, with conj(lambda), conj(B), conj(V) where ``mirrored`` is 1; of both where
    mu = 0.
    """
    r, reached, input_ = ints[response + MODES], ints[response + REACHED] + 2 * j, scratch + most
    maps, shapes = ints[response + FROM_VELOCITY] + j * r, ints[response + SHAPES] + j * r
    pole, mu, sign = waves[ints[ints[response + FREE] + RATES] + j], waves[carrier], 1.0 - 2.0 * mirrored
    is_real = mu == 0
    for d in range(degree + 1):
        push = 0j
        for i in range(ints[reached], ints[reached + 1]):
            weight, force = waves[maps + i], waves[forces + d * r + i]
            if is_real:
                push += weight * force.real
            else:
                push += complex(0.5 * weight.real, 0.5 * sign * weight.imag) * force
        waves[input_ + d] = push
    distance = complex(pole.real, sign * pole.imag) - mu
    size, motion = modulus(distance.real, distance.imag), 0.0
    if is_far(size, degree, horizon) == 0:
        motion = motion_of_exponential(ints, numbers, waves, response, j, eta, eta_t)
    count = first_order(waves, distance.real, distance.imag, size, input_, degree, horizon, motion, most, scratch)
    if max(count, rows) > most:
        return max(count, rows)
    rows = clear_rows(waves, x, r, rows, count)
    for k in range(count):
        for i in range(ints[reached], ints[reached + 1]):
            shape = waves[shapes + i]
            term = waves[scratch + k] * complex(shape.real, sign * shape.imag)
            waves[x + k * r + i] += complex(term.real, 0.0) if is_real else term
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
    """Add the response of a chain, or of its conjugate, to x, the last component first; return its number of rows."""
    m, mixing, shapes, pushes = ints[chain], ints[chain + 1], ints[chain + 2], ints[chain + 3]
    mu, sign, highest, input_ = waves[carrier], 1.0 - 2.0 * mirrored, degree, scratch + m * most
    for i in range(m - 1, -1, -1):
        for d in range(highest + 1):
            push = 0j
            for j in range(r if d <= degree else 0):
                weight = waves[pushes + i * r + j]
                push += complex(0.5 * weight.real, 0.5 * sign * weight.imag) * waves[forces + d * r + j]
            for k in range(i + 1, m):
                weight = waves[mixing + i * m + k]
                push += complex(weight.real, sign * weight.imag) * waves[scratch + k * most + d]
            waves[input_ + d] = push
        pole, w = waves[mixing + i * m + i], scratch + i * most
        distance = complex(pole.real, sign * pole.imag) - mu
        size = modulus(distance.real, distance.imag)
        count = first_order(waves, distance.real, distance.imag, size, input_, highest, horizon, 0.0, most, w)
        if max(count, rows) > most:
            return max(count, rows)
        for d in range(count, most):
            waves[w + d] = 0j
        highest = max(highest, count - 1)
        rows = clear_rows(waves, x, r, rows, count)
        for d in range(count):
            for j in range(r):
                shape = waves[shapes + i * r + j]
                waves[x + d * r + j] += waves[w + d] * complex(shape.real, sign * shape.imag)
    return rows
