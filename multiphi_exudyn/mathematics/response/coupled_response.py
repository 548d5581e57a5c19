"""Free response of modal equations that damping or friction couple (free_response.py).

    eta'' + D eta' + S eta = p,   S = diag(omega^2) + what couples places (friction), D and S no symmetric matrices

The motions are those of z' = A z, z = (|omega| eta_e, eta') with the elastic modes e, every entry of it a velocity,
whatever the units (motion_parts.py). Zero-frequency modes follow. On those that are damped nothing acts but damping:
eta_f' is part of z, and eta_f its integral. Those that are not, a, are moved by the others and move none,

    eta_a'' = R y + p_a,   eta_a = R T^-2 y + a + b t + p_a t^2 / 2

p is constant on zero-frequency modes, and zero on the others. With B the columns of W for eta', it brings the parts to
y = -T^-1 B p, at which the damped ones of these modes drift.

Of a part y' = lambda y that is slow beside the time that a motion lasts at most, the integral y / lambda would be a
large term with small differences: q' = y stays a motion of its own, in powers of time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.response.exponentials import Exponentials
from multiphi_exudyn.mathematics.response.free_response import Chain, ModalResponse, is_slow, slow_powers, uncoupled
from multiphi_exudyn.mathematics.response.light_damping import lightly_damped
from multiphi_exudyn.mathematics.response.motion_parts import Parts, parts_of

__all__ = ["modal_response"]

DIAGONAL = 1e-13  # of sqrt(D_ii D_jj): off-diagonal damping below it is round-off of a diagonal matrix


def modal_response(
    squares: np.ndarray, damping: np.ndarray, coupling: np.ndarray | None = None, lasting: float = math.inf
) -> ModalResponse:
    """Closed form for omega^2 (r,) [rad2/s2], negative for growing modes, damping D [1/s] and S - diag(omega^2) (r, r).

    lasting: for motions of that time [s] at most. Raises NumericalFailure where the rates are not told apart by more
    than round-off.
    """
    alone = coupling is None or not coupling.any()
    if alone and _uncoupled(damping):
        return uncoupled(squares, np.diagonal(damping), lasting)
    found = lightly_damped(squares, damping) if alone else None
    return found or _coupled(squares, np.diag(squares) + (0.0 if coupling is None else coupling), damping, lasting)


def _uncoupled(damping: np.ndarray) -> bool:
    """Whether what damping (r, r) has beside its diagonal is round-off."""
    diagonal, beside = np.abs(damping.diagonal()), np.abs(damping)
    beside.flat[:: len(beside) + 1] = 0.0
    largest = diagonal.max(initial=0.0)
    if beside.max(initial=0.0) > DIAGONAL * largest:
        return False
    scale = np.sqrt(np.outer(diagonal, diagonal))
    return bool((beside <= DIAGONAL * np.maximum(scale, largest * DIAGONAL)).all())


def _coupled(squares: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, lasting: float) -> ModalResponse:
    own = np.flatnonzero(np.any(stiffness, axis=0) | np.any(damping, axis=0))
    elastic = own[squares[own] != 0]
    scale = np.sqrt(np.abs(squares[elastic]))
    upper = scale[:, None] * (elastic[:, None] == own)
    lower = -stiffness[np.ix_(own, elastic)] / scale
    system = np.block([[np.zeros((len(elastic),) * 2), upper], [lower, -damping[np.ix_(own, own)]]])
    parts, r, e = parts_of(system), len(squares), len(elastic)
    shapes, speeds = np.zeros((2, r, len(parts.rates)), complex)
    maps = np.zeros((2, len(parts.rates), r), complex)
    shapes[elastic], speeds[own] = parts.vectors[:e] / scale[:, None], parts.vectors[e:]
    maps[0][:, elastic], maps[1][:, own] = parts.inverse[:, :e] * scale, parts.inverse[:, e:]
    free, alone = own[squares[own] == 0], np.setdiff1d(np.arange(r), own)
    driven = -(stiffness[alone] @ shapes + damping[alone] @ speeds)
    slow = _slow(parts, speeds[free], driven, lasting)
    if not slow.any():
        return _of_parts(parts, shapes, speeds, maps, driven, stiffness, damping, free, alone)
    given, fast = (shapes[:, slow], speeds[:, slow], maps[:, slow]), ~slow
    still = np.zeros((len(alone), int(fast.sum())))
    others = parts.only(fast), shapes[:, fast], speeds[:, fast], maps[:, fast], still
    beside = _slow_motion(parts.rates[slow], *given, free, lasting)
    return _joined(_of_parts(*others, stiffness, damping, free, alone), beside)


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
) -> ModalResponse:
    """What moves by the parts, and what the zero-frequency modes have beside; shapes (r, k) of elastic modes so far."""
    if len(free):
        shapes[free] = _integrated(speeds[free], parts)
    if np.any(driven):
        shapes[alone] = _integrated(_integrated(driven, parts), parts)
    response = _joined(_moving(parts, shapes, maps), _following(parts, shapes, maps, free, alone))
    if not len(free):
        return response
    return _with_drift(response, parts, shapes, speeds, maps, stiffness, damping, free, alone)


def _slow(parts: Parts, speeds: np.ndarray, driven: np.ndarray, lasting: float) -> np.ndarray:
    """Which components (k,) are slow; none where none moves damped zero-frequency modes, by the speeds (f, k).

    driven: accelerations (a, k) of modes that others drive; where there are any, all is integrated as it is.
    """
    found = np.zeros(len(parts.rates), bool)
    if not np.any(driven) and np.any(speeds):
        for first, end in parts.groups:
            found[first] = end - first == 1 and bool(is_slow(parts.rates[first], lasting))
    return found


def _slow_motion(
    rates: np.ndarray, shapes: np.ndarray, speeds: np.ndarray, maps: np.ndarray, free: np.ndarray, lasting: float
) -> ModalResponse:
    """What moves by slow parts (s,): V y, on zero-frequency modes X q, q' = y, y' = lambda y + p; by powers of time.

    q = y(0) t + ..., y = y(0) + ... and what follows is a exp(lambda t) integrated twice and once, a = lambda y(0) + p.
    shapes, speeds (r, s): V of elastic modes, and eta', X of the others. maps (2, s, r): y(0) from eta and eta'.
    """
    r, powers, columns, rows, chains = len(shapes), list[int](), list[np.ndarray](), list[np.ndarray](), list[Chain]()
    for k, rate in enumerate(rates.tolist()):
        drawn, weights = np.zeros(r, complex), slow_powers(rate, lasting)
        drawn[free] = speeds[free, k]
        start = np.stack([maps[0, k], maps[1, k], np.zeros(r)])
        pushed = rate * start
        pushed[2, free] = maps[1, k, free]
        powers += 2 * [*range(len(weights) + 2)]
        columns += [drawn] * (len(weights) + 2) + [shapes[:, k]] * (len(weights) + 2)
        rows += [0 * start, start, *(weight * pushed for weight in weights)]
        rows += [start, pushed, *(weight * rate * pushed for weight in weights)]
        mixing = np.array([[0.0, 1.0], [0.0, rate]])
        chains.append(Chain(mixing, np.column_stack([drawn, shapes[:, k]]), np.stack([np.zeros(r), maps[1, k]])))
    found, still = np.stack(rows, axis=1), (np.zeros(r, bool), np.zeros(len(powers), bool))
    basis = Exponentials(np.zeros(len(powers), complex), np.array(powers))
    return ModalResponse(basis, np.column_stack(columns), found[0], found[1], found[2], False, *still, tuple(chains))


def _integrated(rows: np.ndarray, parts: Parts) -> np.ndarray:
    """X (n, k), X y' = rows y."""
    if np.any(np.diagonal(parts.mixing) == 0):
        raise NumericalFailure("modes: friction cancels the stiffness of a mode beside a zero-frequency mode")
    return np.asarray(scipy.linalg.solve_triangular(parts.mixing, rows.T, trans="T").T)


def _moving(parts: Parts, shapes: np.ndarray, maps: np.ndarray) -> ModalResponse:
    """What moves by the parts: their exponentials, each with the powers of its part."""
    r, rates, powers, columns, rows = len(shapes), list[complex](), list[int](), list[int](), []
    poles, chains = list[bool](), list[Chain]()
    for first, end in parts.groups:
        own = slice(first, end)
        if end - first == 1:
            rates.append(complex(parts.rates[first]))
            powers.append(0)
            columns.append(first)
            rows.append(maps[:, own])
            poles.append(True)
            continue
        raised = parts.powers(first, end)
        for i in range(end - first):
            rates += [complex(parts.rates[first])] * len(raised)
            powers += range(len(raised))
            columns += [first + i] * len(raised)
            rows.append(np.einsum("dj,mjr->mdr", raised[:, i], maps[:, own]))
        poles += [False] * (len(raised) * (end - first))
        chains.append(Chain(parts.mixing[own, own], shapes[:, own], maps[1][own]))
    found = np.concatenate(rows, axis=1) if rows else np.zeros((2, 0, r), complex)
    basis = Exponentials(np.array(rates, complex), np.array(powers, int))
    nothing = np.zeros_like(found[0])
    return ModalResponse(
        basis=basis,
        shapes=shapes[:, columns],
        from_displacement=found[0],
        from_velocity=found[1],
        from_force=nothing,
        diagonal=False,
        alone=np.zeros(r, bool),
        poles=np.array(poles, bool),
        chains=tuple(chains),
    )


def _following(
    parts: Parts, shapes: np.ndarray, maps: np.ndarray, free: np.ndarray, alone: np.ndarray
) -> ModalResponse:
    """What the zero-frequency modes, damped or alone, have beside that: a, and a + b t + p t^2 / 2."""
    r, f, a = len(shapes), len(free), len(alone)
    rate_shapes = shapes @ parts.mixing
    here, unit = np.concatenate([free, np.repeat(alone, 3)]), np.eye(r)
    found = np.zeros((3, f + 3 * a, r), complex)
    found[0][:f] = unit[free] - (shapes[free] @ maps[0]).real
    found[1][:f] = -(shapes[free] @ maps[1]).real
    starts = f + 3 * np.arange(a)
    found[0][starts], found[1][starts] = unit[alone] - (shapes[alone] @ maps[0]).real, -(shapes[alone] @ maps[1]).real
    found[0][starts + 1] = -(rate_shapes[alone] @ maps[0]).real
    found[1][starts + 1] = unit[alone] - (rate_shapes[alone] @ maps[1]).real
    found[2][starts + 2] = 0.5 * unit[alone]
    powers = np.concatenate([np.zeros(f, int), np.tile([0, 1, 2], a)])
    basis = Exponentials(np.zeros(len(powers), complex), powers)
    poles, itself = np.arange(len(powers)) < f, np.zeros(r, bool)
    chains = list[Chain]()
    for mode, start in zip(alone.tolist(), starts.tolist(), strict=True):
        if np.any(shapes[mode]):
            along = np.column_stack([unit[mode], np.zeros(r)]).astype(complex)
            chains.append(Chain(np.eye(2, k=1, dtype=complex), along, found[1][start : start + 2]))
        else:
            itself[mode] = True
    beside = unit[:, here].astype(complex)
    return ModalResponse(basis, beside, found[0], found[1], found[2], False, itself, poles, tuple(chains))


def _joined(one: ModalResponse, other: ModalResponse) -> ModalResponse:
    """The sum of two motions of the same modes."""
    basis = Exponentials(
        np.concatenate([one.basis.rates, other.basis.rates]), np.concatenate([one.basis.powers, other.basis.powers])
    )
    return ModalResponse(
        basis,
        np.hstack([one.shapes, other.shapes]),
        np.vstack([one.from_displacement, other.from_displacement]),
        np.vstack([one.from_velocity, other.from_velocity]),
        np.vstack([one.from_force, other.from_force]),
        False,
        one.alone | other.alone,
        np.concatenate([one.poles, other.poles]),
        one.chains + other.chains,
    )


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
    """Adds the motion u + w t of damped zero-frequency modes under a constant force, as far as it moves the parts."""
    r, count = len(stiffness), len(free)
    steady = -scipy.linalg.solve_triangular(parts.mixing, maps[1][:, free])  # y of the parts, at rest under a force
    offset, moving, drift = (shapes @ steady).real, (speeds @ steady).real, np.zeros((r, count))
    drift[free], offset[free], offset[alone] = moving[free], 0.0, 0.0
    powers = np.tile([0, 0, 1], count)  # u, then w t with its derivative w
    basis = Exponentials(np.zeros(3 * count, complex), powers)
    added = np.stack([offset, drift, drift], axis=2).reshape(r, 3 * count).astype(complex)
    maps = np.zeros((3, 3 * count, r), complex)
    maps[2][::3, free] = maps[2][2::3, free] = np.eye(count)
    forced = response.from_force.copy()
    forced[:, free] -= response.from_displacement @ offset + response.from_velocity @ moving
    carried = -(stiffness[alone] @ offset + damping[alone] @ drift)  # what that does to the modes that others move
    forced[:, free] += response.from_force[:, alone] @ carried
    still = np.zeros(r, bool), np.zeros(3 * count, bool)
    own = ModalResponse(basis, added, maps[0], maps[1], maps[2], False, *still)
    return _joined(replace(response, from_force=forced), own)
