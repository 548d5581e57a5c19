"""Free and forced response of modal equations in flat buffers: free_response.py and forced_response.py, for the loop.

    eta'' + D eta' + S eta = p,   eta(t) = Re V (c phi(t)),   c = A eta(0) + B eta'(0) + P p

D and S (r, r) are whatever the rates, shapes and maps were made for; nothing is symmetric here.

A response is a record in the ints:

    ints[response + MODES]               r
    ints[response + FREE]                the basis of its p exponentials (flat_basis.py)
    ints[response + REACHED]             where first and last + 1 of the modes that an exponential takes part in begin
                                         in the ints, (p, 2): elsewhere V, A, B and P are zero
    ints[response + FROM_DISPLACEMENT]   where A (p, r) begins in the waves
    ints[response + FROM_VELOCITY]       B (p, r)
    ints[response + FROM_FORCE]          P (p, r)
    ints[response + SHAPES]              V^T (p, r)
"""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.flat_basis import SIZE, differentiate, exponentials

__all__ = [
    "FREE",
    "FROM_DISPLACEMENT",
    "FROM_FORCE",
    "FROM_VELOCITY",
    "MODES",
    "REACHED",
    "RESPONSE",
    "SHAPES",
    "coefficients_of",
    "reached_modes",
    "state_of",
]

MODES, FREE, REACHED, FROM_DISPLACEMENT, FROM_VELOCITY, FROM_FORCE, SHAPES = 0, 1, 2, 3, 4, 5, 6
RESPONSE = 7  # ints of the record


@compiled
def reached_modes(ints: Ints, waves: Waves, response: int) -> None:
    """Fill in the modes that every exponential takes part in: where V, A, B or P is not zero."""
    r, p, reached = ints[response + MODES], ints[ints[response + FREE] + SIZE], ints[response + REACHED]
    for j in range(p):
        first, end = r, 0
        for k in range(FROM_DISPLACEMENT, SHAPES + 1):
            row = ints[response + k] + j * r
            for i in range(r):
                if waves[row + i] != 0:
                    first, end = min(first, i), max(end, i + 1)
        ints[reached + 2 * j], ints[reached + 2 * j + 1] = first, end


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
