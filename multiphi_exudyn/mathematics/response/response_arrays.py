"""Free response of modal equations in flat buffers: free_response.py for the loop.

    eta'' + D eta' + S eta = p,   eta(t) = Re V (c phi(t)),   c = A eta(0) + B eta'(0) + P p

D and S (r, r) need not be symmetric; rates, shapes and maps follow from them.

A response is a record in the ints:

    ints[response + MODES]               r
    ints[response + FREE]                the basis of its p exponentials (basis_arrays.py)
    ints[response + REACHED]             where first and last + 1 of the modes of every exponential begin in the ints,
                                         (p, 2): V, A, B and P are zero for the other modes
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
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled, entry
from multiphi_exudyn.mathematics.response.basis_arrays import (
    BASIS,
    POWERS,
    RATES,
    SCALES,
    SIZE,
    describe_basis,
    differentiate,
    exponentials,
)

__all__ = [
    "CHAIN",
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
    "reached_modes",
    "response_ints",
    "state_of",
    "write_response",
]

MODES, FREE, REACHED, FROM_DISPLACEMENT, FROM_VELOCITY, FROM_FORCE, SHAPES = 0, 1, 2, 3, 4, 5, 6
SQUARES, HALF_DAMPING, UNCOUPLED, POLES, CHAINS = 7, 8, 9, 10, 11
RESPONSE = 12  # ints of the record
CHAIN = 4  # ints of a chain


def reached_modes(maps: Sequence[np.ndarray]) -> np.ndarray:
    """Return first and last + 1 (p, 2) of the modes of every exponential, for which a map (p, r) is not zero."""
    (p, r), waves = maps[0].shape, np.array(maps, complex).ravel()
    reached = np.zeros((p, 2), int)
    find_reached(reached.ravel(), 0, waves, 0, len(maps), p, r)
    return reached


@compiled
def set_reached(ints: Ints, reached: int, waves: Waves, maps: int, count: int, p: int, r: int) -> None:
    """Set REACHED of ``count`` maps (p, r), one after the other in the waves; r and 0 where all are zero."""
    for j in range(p):
        first, end = r, 0
        for i in range(r):
            for k in range(count):
                if waves[maps + (k * p + j) * r + i] != 0j:
                    first, end = min(first, i), i + 1
        ints[reached + 2 * j], ints[reached + 2 * j + 1] = first, end


find_reached = entry(set_reached)


@compiled
def write_response(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    response: int,
    squares: int,
    half_damping: int,
    scales: int,
    rates: int,
    given: Ints,
    described: int,
    chains: int,
    r: int,
    p: int,
) -> None:
    """Write the record of a response and of its basis, with all their ints, ``response_ints(r, p)``.

    The numbers from squares, half_damping and scales on, the chains, -1 for none, and the waves are there: the rates,
    A, B, P and V^T. given: d (p,), UNCOUPLED (r,) and POLES (p,), from ``described`` on.
    """
    basis, maps = response + RESPONSE, rates + p
    powers, reached = basis + BASIS, basis + BASIS + 2 * p + r
    if chains < 0:
        chains = reached + 2 * p
        ints[chains] = 0
    ints[response + MODES], ints[response + FREE], ints[response + REACHED] = r, basis, reached
    ints[response + FROM_DISPLACEMENT], ints[response + FROM_VELOCITY] = maps, maps + p * r
    ints[response + FROM_FORCE], ints[response + SHAPES] = maps + 2 * p * r, maps + 3 * p * r
    ints[response + SQUARES], ints[response + HALF_DAMPING] = squares, half_damping
    ints[response + UNCOUPLED], ints[response + POLES], ints[response + CHAINS] = powers + p, powers + p + r, chains
    ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES], ints[basis + SCALES] = p, powers, rates, scales
    for k in range(2 * p + r):
        ints[powers + k] = given[described + k]
    set_reached(ints, reached, waves, maps, 4, p, r)
    describe_basis(ints, numbers, waves, basis)


def response_ints(r: int, p: int) -> int:
    """Return the number of ints of a response's record."""
    return RESPONSE + BASIS + 4 * p + r + 1


@compiled
def coefficients_of(
    ints: Ints, numbers: Numbers, waves: Waves, response: int, eta: int, eta_t: int, force: int, result: int
) -> None:
    """Set c (p,) of the motion that starts at eta, eta' (r,) under the constant modal force p (r,), -1 for none."""
    r, p, reached = ints[response + MODES], ints[ints[response + FREE] + SIZE], ints[response + REACHED]
    for j in range(p):
        from_displacement, from_velocity = (
            ints[response + FROM_DISPLACEMENT] + j * r,
            ints[response + FROM_VELOCITY] + j * r,
        )
        c = 0j
        for i in range(ints[reached + 2 * j], ints[reached + 2 * j + 1]):
            c += waves[from_displacement + i] * numbers[eta + i] + waves[from_velocity + i] * numbers[eta_t + i]
        if force >= 0:
            from_force = ints[response + FROM_FORCE] + j * r
            for i in range(ints[reached + 2 * j], ints[reached + 2 * j + 1]):
                c += waves[from_force + i] * numbers[force + i]
        waves[result + j] = c


@compiled
def state_of(
    ints: Ints, numbers: Numbers, waves: Waves, response: int, c: int, t: float, eta: int, eta_t: int, scratch: int
) -> None:
    """Set eta(t), eta'(t) (r,) of the motion with coefficients c (p,); scratch: 2p waves."""
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
