"""Free response of modal equations that damping or friction couple (free_response.py).

    eta'' + D eta' + S eta = p,   S = diag(omega^2) + coupling by friction, D and S not symmetric

The motions are those of z' = A z, z = (|omega| eta_e, eta') with the elastic modes e, with the unit of a velocity
(motion_parts.py). Zero-frequency modes are added. Damped ones have no other forces: eta_f' is part of z, and eta_f its
integral. Undamped ones, a, are driven by the others and drive none,

    eta_a'' = R y + p_a,   eta_a = R T^-2 y + a + b t + p_a t^2 / 2

p is constant on zero-frequency modes, and zero on the others. With B the columns of W for eta', the parts tend to
y = -T^-1 B p, with which the damped zero-frequency modes drift.

Of a part y' = lambda y that is slow compared with the duration of a motion, the integrals y / lambda and y / lambda^2
would be large terms with small differences: q' = y, and u' = q that drives undamped modes, are motions of their own, in
powers of time. So are those of a part with lambda = 0, where friction cancels the damping of a zero-frequency mode.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.response.exponentials import Exponentials
from multiphi_exudyn.mathematics.response.free_response import (
    Chain,
    ModalResponse,
    is_slow,
    lightly_coupled,
    slow_powers,
)
from multiphi_exudyn.mathematics.response.motion_parts import Parts, parts_of
from multiphi_exudyn.mathematics.round_off import all_finite

__all__ = ["modal_response"]


def modal_response(
    squares: np.ndarray, damping: np.ndarray, coupling: np.ndarray | None = None, duration: float = math.inf
) -> ModalResponse:
    """Return the closed form for omega^2 (r,) [rad2/s2], damping D [1/s] and coupling S - diag(omega^2) (r, r).

    duration: of the longest motion [s]. Raises NumericalFailure where rates are not distinct by more than round-off,
    and for coupled modes whose matrices are not finite.
    """
    if coupling is not None and np.count_nonzero(coupling):
        return _coupled(squares, np.diag(squares) + coupling, damping, duration)
    return lightly_coupled(squares, damping, duration) or _coupled(squares, np.diag(squares), damping, duration)


def _coupled(squares: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, duration: float) -> ModalResponse:
    if not (all_finite(stiffness.ravel()) and all_finite(damping.ravel())):
        raise NumericalFailure("modes: stiffness or damping of a level is not finite")
    moving = np.flatnonzero(np.any(stiffness, axis=0) | np.any(damping, axis=0))
    elastic = moving[squares[moving] != 0]
    scale = np.sqrt(np.abs(squares[elastic]))
    upper = scale[:, None] * (elastic[:, None] == moving)
    lower = -stiffness[np.ix_(moving, elastic)] / scale
    system = np.block([[np.zeros((len(elastic),) * 2), upper], [lower, -damping[np.ix_(moving, moving)]]])
    parts, r, e = parts_of(system), len(squares), len(elastic)
    shapes, speeds = np.zeros((2, r, len(parts.rates)), complex)
    maps = np.zeros((2, len(parts.rates), r), complex)
    shapes[elastic], speeds[moving] = parts.vectors[:e] / scale[:, None], parts.vectors[e:]
    maps[0][:, elastic], maps[1][:, moving] = parts.inverse[:, :e] * scale, parts.inverse[:, e:]
    free, alone = moving[squares[moving] == 0], np.setdiff1d(np.arange(r), moving)
    driven = np.zeros((r, len(parts.rates)), complex)
    driven[alone] = -(stiffness[alone] @ shapes + damping[alone] @ speeds)
    slow = _slow(parts, speeds[free], driven, duration)
    fast, is_alone = ~slow, np.isin(np.arange(r), alone) & ~np.any(driven, axis=1)
    fast_columns = parts.only(fast), shapes[:, fast], speeds[:, fast], maps[:, fast], driven[:, fast]
    response = _of_parts(*fast_columns, stiffness, damping, free, alone, is_alone)
    if not slow.any():
        return response
    slow_columns = shapes[:, slow], speeds[:, slow], maps[:, slow], driven[:, slow]
    return _sum(response, _slow_motion(parts.rates[slow], *slow_columns, free, duration))


def _of_parts(
    parts: Parts,
    shapes: np.ndarray,
    speeds: np.ndarray,
    maps: np.ndarray,
    driven: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    free: np.ndarray,
    alone: np.ndarray,
    is_alone: np.ndarray,
) -> ModalResponse:
    """Return the motion of the parts and of zero-frequency modes; shapes (r, k) are set for elastic modes before."""
    if len(free):
        shapes[free] = _integral(speeds[free], parts)
    if np.any(driven):
        shapes[alone] = _integral(_integral(driven[alone], parts), parts)
    response = _sum(_motion_of_parts(parts, shapes, maps), _initial_drift(parts, shapes, maps, free, alone, is_alone))
    if not len(free):
        return response
    return _with_drift(response, parts, shapes, speeds, maps, stiffness, damping, free, alone)


def _slow(parts: Parts, speeds: np.ndarray, driven: np.ndarray, duration: float) -> np.ndarray:
    """Return which components (k,) are slow; none if no zero-frequency mode moves with the components.

    speeds (f, k) of damped zero-frequency modes, driven: accelerations (r, k) of undamped ones.
    """
    is_slow_component = np.zeros(len(parts.rates), bool)
    if np.any(speeds) or np.any(driven):
        for first, end in parts.groups:
            is_slow_component[first] = end - first == 1 and bool(is_slow(parts.rates[first], duration))
    return is_slow_component


def _slow_motion(
    rates: np.ndarray,
    shapes: np.ndarray,
    speeds: np.ndarray,
    maps: np.ndarray,
    driven: np.ndarray,
    free: np.ndarray,
    duration: float,
) -> ModalResponse:
    """Return the motion of slow parts (s,) in powers of time: V y, X q on free modes and R u on driven ones.

    u' = q, q' = y, y' = lambda y + p: u = y(0) t^2 / 2 + ..., q = y(0) t + ..., y = y(0) + ... and the other terms are
    a exp(lambda t) integrated three times, twice and once, a = lambda y(0) + p. shapes, speeds, driven (r, s): V of
    elastic modes, and eta', X of damped and R of undamped others. maps (2, s, r): y(0) from eta and eta'.
    """
    r, powers, columns, rows, chains = len(shapes), list[int](), list[np.ndarray](), list[np.ndarray](), list[Chain]()
    for k, rate in enumerate(rates.tolist()):
        drift, weights = np.zeros(r, complex), slow_powers(rate, duration)
        drift[free] = speeds[free, k]
        start = np.stack([maps[0, k], maps[1, k], np.zeros(r)])
        acceleration = rate * start
        acceleration[2, free] = maps[1, k, free]
        powers += 2 * [*range(len(weights) + 2)]
        columns += [drift] * (len(weights) + 2) + [shapes[:, k]] * (len(weights) + 2)
        rows += [0 * start, start, *(weight * acceleration for weight in weights)]
        rows += [start, acceleration, *(weight * rate * acceleration for weight in weights)]
        mixing, places = np.array([[0.0, 1.0], [0.0, rate]]), [drift, shapes[:, k]]
        if np.any(driven[:, k]):
            powers += range(len(weights) + 3)
            columns += [driven[:, k]] * (len(weights) + 3)
            rows += [0 * start, 0 * start, start / 2]
            rows += [weight / power * acceleration for power, weight in enumerate(weights, start=3)]
            mixing = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, rate]])
            places = [driven[:, k], *places]
        pushes = np.zeros((len(places), r), complex)
        pushes[-1] = maps[1, k]
        chains.append(Chain(mixing, np.column_stack(places), pushes))
    basis = Exponentials(np.zeros(len(powers), complex), np.array(powers))
    maps_of_terms = np.concatenate([np.stack(rows, axis=1), np.array(columns)[None]])
    return ModalResponse(basis, maps_of_terms, np.zeros(r, bool), np.zeros(len(powers), bool), tuple(chains))


def _integral(rows: np.ndarray, parts: Parts) -> np.ndarray:
    """Return X (n, k) of X y' = rows y."""
    if np.any(np.diagonal(parts.mixing) == 0):
        raise NumericalFailure("modes: friction cancels the stiffness of a mode beside a zero-frequency mode")
    return np.asarray(scipy.linalg.solve_triangular(parts.mixing, rows.T, trans="T").T)


def _motion_of_parts(parts: Parts, shapes: np.ndarray, maps: np.ndarray) -> ModalResponse:
    """Return the motion of the parts: their exponentials, each with the powers of its part."""
    r, rates, powers, columns, rows = len(shapes), list[complex](), list[int](), list[int](), []
    poles, chains = list[bool](), list[Chain]()
    for first, end in parts.groups:
        part = slice(first, end)
        if end - first == 1:
            rates.append(complex(parts.rates[first]))
            powers.append(0)
            columns.append(first)
            rows.append(maps[:, part])
            poles.append(True)
            continue
        raised = parts.powers(first, end)
        for i in range(end - first):
            rates += [complex(parts.rates[first])] * len(raised)
            powers += range(len(raised))
            columns += [first + i] * len(raised)
            rows.append(np.einsum("dj,mjr->mdr", raised[:, i], maps[:, part]))
        poles += [False] * (len(raised) * (end - first))
        chains.append(Chain(parts.mixing[part, part], shapes[:, part], maps[1][part]))
    maps_of_terms = np.zeros((4, len(rates), r), complex)
    maps_of_terms[:2], maps_of_terms[3] = np.concatenate(rows, axis=1) if rows else 0.0, shapes[:, columns].T
    basis = Exponentials(np.array(rates, complex), np.array(powers, int))
    return ModalResponse(basis, maps_of_terms, np.zeros(r, bool), np.array(poles, bool), tuple(chains))


def _initial_drift(
    parts: Parts, shapes: np.ndarray, maps: np.ndarray, free: np.ndarray, alone: np.ndarray, is_alone: np.ndarray
) -> ModalResponse:
    """Return the further motion of zero-frequency modes: a of damped ones, a + b t + p t^2 / 2 of undamped ones.

    is_alone (r,): undamped ones that nothing drives.
    """
    r, f, a = len(shapes), len(free), len(alone)
    rate_shapes = shapes @ parts.mixing
    modes, unit = np.concatenate([free, np.repeat(alone, 3)]), np.eye(r)
    maps_of_terms = np.zeros((4, f + 3 * a, r), complex)
    maps_of_terms[3] = unit[modes]
    maps_of_terms[0][:f] = unit[free] - (shapes[free] @ maps[0]).real
    maps_of_terms[1][:f] = -(shapes[free] @ maps[1]).real
    starts = f + 3 * np.arange(a)
    maps_of_terms[0][starts], maps_of_terms[1][starts] = (
        unit[alone] - (shapes[alone] @ maps[0]).real,
        -(shapes[alone] @ maps[1]).real,
    )
    maps_of_terms[0][starts + 1] = -(rate_shapes[alone] @ maps[0]).real
    maps_of_terms[1][starts + 1] = unit[alone] - (rate_shapes[alone] @ maps[1]).real
    maps_of_terms[2][starts + 2] = 0.5 * unit[alone]
    powers = np.concatenate([np.zeros(f, int), np.tile([0, 1, 2], a)])
    basis = Exponentials(np.zeros(len(powers), complex), powers)
    poles, chains = np.arange(len(powers)) < f, list[Chain]()
    for mode, start in zip(alone.tolist(), starts.tolist(), strict=True):
        if not is_alone[mode]:
            column = np.column_stack([unit[mode], np.zeros(r)]).astype(complex)
            chains.append(Chain(np.eye(2, k=1, dtype=complex), column, maps_of_terms[1][start : start + 2]))
    return ModalResponse(basis, maps_of_terms, is_alone, poles, tuple(chains))


def _sum(one: ModalResponse, other: ModalResponse) -> ModalResponse:
    """Return the sum of two motions of the same modes."""
    basis = Exponentials(
        np.concatenate([one.basis.rates, other.basis.rates]), np.concatenate([one.basis.powers, other.basis.powers])
    )
    maps, poles = np.concatenate([one.maps, other.maps], axis=1), np.concatenate([one.poles, other.poles])
    return ModalResponse(basis, maps, one.alone | other.alone, poles, one.chains + other.chains)


def _with_drift(
    response: ModalResponse,
    parts: Parts,
    shapes: np.ndarray,
    speeds: np.ndarray,
    maps: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    free: np.ndarray,
    alone: np.ndarray,
) -> ModalResponse:
    """Add the motion u + w t of damped zero-frequency modes under a constant force, with the parts that it moves."""
    r, count = len(stiffness), len(free)
    steady = -scipy.linalg.solve_triangular(parts.mixing, maps[1][:, free])  # constant y of the parts under a force
    offset, drift_speed, drift = (shapes @ steady).real, (speeds @ steady).real, np.zeros((r, count))
    drift[free], offset[free], offset[alone] = drift_speed[free], 0.0, 0.0
    powers = np.tile([0, 0, 1], count)  # u, then w t with its derivative w
    basis = Exponentials(np.zeros(3 * count, complex), powers)
    columns = np.stack([offset, drift, drift], axis=2).reshape(r, 3 * count)
    maps = np.zeros((4, 3 * count, r), complex)
    maps[2][::3, free] = maps[2][2::3, free] = np.eye(count)
    maps[3] = columns.T
    driven = response.maps.copy()
    driven[2][:, free] -= response.from_displacement @ offset + response.from_velocity @ drift_speed
    driving = -(stiffness[alone] @ offset + damping[alone] @ drift)  # acceleration of driven modes by the drift
    driven[2][:, free] += response.from_force[:, alone] @ driving
    drift_response = ModalResponse(basis, maps, np.zeros(r, bool), np.zeros(3 * count, bool))
    return _sum(replace(response, maps=driven), drift_response)
