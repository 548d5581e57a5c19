"""Forced response of modal equations in closed form: a load that is a polynomial on a carrier.

    eta'' + D eta' + diag(omega^2) eta = Re( exp(mu t) sum_d p_d u^d ),   eta = Re( exp(mu t) sum_k x_k u^k )

u = t/T, T the horizon, is solved mode by mode, D diagonal or not, as the sum of first-order equations of its poles s,

    z' = s z + exp(mu t) p(t),   z = exp(mu t) w,   w' = (s - mu) w + p(t)

z belongs to one pole, or to a chain of them (free_response.py), in which each is also forced by the later ones.
w is a polynomial of u. Far from the pole (|s - mu| T large) it is finite,

    w_k = ((k + 1) w_k+1 / T - p_k) / (s - mu),   k = D, ..., 0

and near to it, at resonance included, the Taylor series of the motion from rest, truncated at round-off:

    w_k+1 = T ((s - mu) w_k + p_k) / (k + 1),   w_0 = 0

Two poles that (nearly) coincide, of a critically damped mode or a rigid-body mode of slow damping or none, are solved
as one equation of second order in the same two ways. Nothing grows beyond the load's own size, whatever the distance
from a pole.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.mathematics.response.free_response import ModalResponse
from multiphi_exudyn.mathematics.round_off import SLOW

__all__ = ["particular"]

TAYLOR = 1e-18  # of a Taylor series: smaller terms are truncated
NEAREST_FAR = 0.5  # |s - mu| T from which the finite polynomial is taken for a constant p,
PER_DEGREE = 0.5  # and more for each degree of p: the finite polynomial loses D! / (|s - mu| T)^D by cancellation
OUTWEIGHED = 10.0  # times the motion: a finite polynomial up to this size costs at most one digit of the motion
COINCIDING = 2e-2  # of |s|: poles closer than this are solved together; where one is zero, SLOW of 1 / T or mu


def particular(
    squares: np.ndarray, damping: np.ndarray, response: ModalResponse, rate: complex, forces: np.ndarray, horizon: float
) -> np.ndarray:
    """Return a particular response x (K + 1, r) to modal forces p (D + 1, r) on the carrier ``rate``, for [0, horizon].

    Both are coefficients of powers of t / horizon.
    squares: omega^2 (r,). damping: D (r, r). response: the closed form of the free motion.
    """
    if not np.any(forces):
        return np.zeros((1, len(squares)), complex)
    if response.alone.all():
        return _uncoupled(squares, np.diagonal(damping) / 2, rate, forces, horizon)
    is_alone, poles = response.alone, response.poles
    free = np.zeros((1, len(squares)), complex)
    if np.any(is_alone):
        uncoupled = _uncoupled(squares[is_alone], np.zeros(int(np.sum(is_alone))), rate, forces[:, is_alone], horizon)
        free = _padded(free, len(uncoupled))
        free[:, is_alone] = uncoupled
    maps = response.from_velocity[poles] / 2
    shapes, rates = response.shapes[:, poles], response.basis.rates[poles]
    parts = [free]
    for variant in (np.asarray, np.conj):
        parts.append(_first_order(variant(rates) - rate, forces @ variant(maps).T, horizon) @ variant(shapes).T)
        for chain in response.chains:
            arguments = variant(chain.mixing), forces @ variant(chain.pushes).T / 2
            parts.append(_chained(*arguments, rate, horizon) @ variant(chain.shapes).T)
    longest = max(map(len, parts))
    return np.asarray(sum(_padded(part, longest) for part in parts))


def _chained(mixing: np.ndarray, forces: np.ndarray, rate: complex, horizon: float) -> np.ndarray:
    """Return w (K + 1, m) of w' = (T - mu) w + p(t), T (m, m) upper triangular, p (D + 1, m): the last one first."""
    solved: list[np.ndarray] = []
    for i in range(len(mixing) - 1, -1, -1):
        longest = max([len(forces), *map(len, solved)])
        input_ = _padded(forces[:, [i]], longest)
        for later, k in zip(solved, range(len(mixing) - 1, i, -1), strict=True):
            input_ = input_ + mixing[i, k] * _padded(later, longest)
        solved.append(_first_order(mixing[[i], [i]] - rate, input_, horizon))
    longest = max(map(len, solved))
    return np.hstack([_padded(w, longest) for w in reversed(solved)])


def _uncoupled(squares: np.ndarray, delta: np.ndarray, rate: complex, forces: np.ndarray, horizon: float) -> np.ndarray:
    """Return x (K + 1, r) of modes with poles -delta +- sqrt(delta^2 - omega^2)."""
    root = np.sqrt((delta**2 - squares).astype(complex))
    near = np.where(squares == 0, SLOW * max(1 / horizon, abs(rate)), COINCIDING * np.sqrt(np.abs(squares)))
    together = 2 * np.abs(root) <= near
    both = _second_order(squares[together], delta[together], rate, forces[:, together], horizon)
    apart = ~together
    fast = -(delta[apart] + root[apart])
    slow = squares[apart] / fast
    weighted = forces[:, apart] / (2 * root[apart])
    poles = np.concatenate([slow, fast]) - rate
    each = _first_order(poles, np.hstack([weighted, -weighted]), horizon)
    x = np.zeros((max(len(both), len(each)), len(squares)), complex)
    x[: len(both), together] = both
    x[: len(each), apart] = each[:, : len(fast)] + each[:, len(fast) :]
    return x


def _first_order(distance: np.ndarray, forces: np.ndarray, horizon: float) -> np.ndarray:
    """Return w (K + 1, q) of w' = distance w + p(t)."""
    degree = len(forces) - 1
    far = np.abs(distance) * horizon >= NEAREST_FAR + PER_DEGREE * degree
    near = ~far
    reach = float(np.max(np.abs(distance[near]), initial=0.0)) * horizon
    w = np.zeros((_terms(degree, reach, 1) if np.any(near) else degree + 1, len(distance)), complex)
    for k in range(degree, -1, -1):
        above = (k + 1) / horizon * w[k + 1, far] if k < degree else 0.0
        w[k, far] = (above - forces[k, far]) / distance[far]
    if np.any(near):
        for k in range(len(w) - 1):
            force = forces[k, near] if k <= degree else 0.0
            w[k + 1, near] = (distance[near] * w[k, near] + force) * horizon / (k + 1)
    return w


def _second_order(
    squares: np.ndarray, delta: np.ndarray, rate: complex, forces: np.ndarray, horizon: float
) -> np.ndarray:
    """Return w (K + 1, q) of w'' + 2 (delta + mu) w' + (omega^2 + 2 delta mu + mu^2) w = p(t), poles close together."""
    degree = len(forces) - 1
    slope, value = 2 * (delta + rate), squares + 2 * delta * rate + rate**2
    distance = np.sqrt(np.abs(value))
    far = distance * horizon >= NEAREST_FAR + PER_DEGREE * (degree + 1)
    near = ~far
    reach = float(np.max(np.maximum(distance, np.abs(slope))[near], initial=0.0)) * horizon
    w = np.zeros((_terms(degree, reach, 2) if np.any(near) else degree + 1, len(squares)), complex)
    for k in range(degree, -1, -1):
        first = (k + 1) / horizon * w[k + 1, far] if k < degree else 0.0
        second = (k + 2) * (k + 1) / horizon**2 * w[k + 2, far] if k < degree - 1 else 0.0
        w[k, far] = (forces[k, far] - slope[far] * first - second) / value[far]
    if np.any(near):
        for k in range(len(w) - 2):
            force = forces[k, near] if k <= degree else 0.0
            restoring = slope[near] * (k + 1) / horizon * w[k + 1, near] + value[near] * w[k, near]
            w[k + 2, near] = (force - restoring) * horizon**2 / ((k + 1) * (k + 2))
    return w


def _terms(degree: int, reach: float, order: int) -> int:
    """Return the number of Taylor coefficients up to round-off, reach = |distance| T."""
    term, count = 1.0, 0
    while term > TAYLOR:
        count += 1
        term *= reach / count
    return degree + 1 + order + count


def _padded(x: np.ndarray, rows: int) -> np.ndarray:
    """Return x with zero rows appended, up to at least ``rows``."""
    missing = max(0, rows - len(x))
    return np.pad(x, ((0, missing), (0, 0))) if missing else x
