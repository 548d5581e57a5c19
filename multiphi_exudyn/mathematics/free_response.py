"""Exact free response of modal equations, as sums of exponentials.

    eta'' + D eta' + diag(omega^2) eta = p,   p constant on modes with omega = 0, zero on the others
    eta(t) = Re sum_j V_j c_j t^d_j exp(lambda_j t),   c = A eta(0) + B eta'(0) + P p

omega^2 < 0 is a growing mode. D [1/s] is diagonal for proportional damping: then each mode has its own closed
form (underdamped, overdamped, nearly critical by a Taylor polynomial, zero frequency, growing). Where D couples the
modes, the lambda_j are the complex eigenvalues of the 2r x 2r first-order system. A conjugate pair is kept once,
with its weight doubled. Constant forces on modes of non-zero frequency belong to the asymptotic
configuration, not here.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.exponentials import Exponentials

__all__ = ["ModalResponse", "modal_response"]

DIAGONAL = 1e-13  # of sqrt(D_ii D_jj): off-diagonal damping below it is round-off of a diagonal matrix
NEARLY_CRITICAL = 1e-2  # |zeta^2 - 1|^(1/2) under which the Taylor polynomial of degree 5 is the more exact form
STEP = 1e-3  # of an eigenvector: a larger step of its refinement is none of round-off
WORST_CONDITION = 1e7  # of the scaled eigenvectors; times round-off it is the motion's error (a double root has 1e8)


@dataclass(frozen=True)
class ModalResponse:
    """The closed form of the module's equation.

    basis: the p exponentials. shapes: V (r, p) complex. from_displacement, from_velocity, from_force:
    A, B, P (p, r) complex. diagonal: whether D was diagonal to round-off.
    """

    basis: Exponentials
    shapes: np.ndarray
    from_displacement: np.ndarray
    from_velocity: np.ndarray
    from_force: np.ndarray
    diagonal: bool

    def coefficients(
        self, displacement: np.ndarray, velocity: np.ndarray, force: np.ndarray | None = None
    ) -> np.ndarray:
        """c (p,) of the motion that starts at eta(0), eta'(0), both (r,)."""
        c: np.ndarray = (self._from_state @ np.concatenate([displacement, velocity])).view(complex)
        return c if force is None else c + self.from_force @ force

    def sizes(self, displacement: np.ndarray, velocity: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Of which terms (p,) the coefficients are the sums, from the sizes (r,) of eta(0), eta'(0) and p."""
        maps = np.abs(self.from_displacement), np.abs(self.from_velocity), np.abs(self.from_force)
        return np.asarray(maps[0] @ displacement + maps[1] @ velocity + maps[2] @ force)

    def state(self, coefficients: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """eta(t), eta'(t), both (r,)."""
        r, values = len(self.shapes), self.basis.at(t)
        if not self.basis.pure:
            rate = self.basis.derivative(coefficients)
            return (self.shapes @ (coefficients * values)).real, (self.shapes @ (rate * values)).real
        both = self._to_state @ (coefficients * values).view(float)
        return both[:r], both[r:]

    @functools.cached_property
    def _from_state(self) -> np.ndarray:
        """[A, B] on real and imaginary parts, (2p, 2r): one real product where two complex ones stood."""
        both = np.hstack([self.from_displacement, self.from_velocity])
        return np.stack([both.real, both.imag], axis=1).reshape(2 * both.shape[0], both.shape[1])

    @functools.cached_property
    def _to_state(self) -> np.ndarray:
        """(eta, eta') from real and imaginary parts of c phi, (2r, 2p), where every power is zero."""
        both = np.vstack([self.shapes, self.shapes * self.basis.rates])
        return np.stack([both.real, -both.imag], axis=2).reshape(both.shape[0], 2 * both.shape[1])


def modal_response(squares: np.ndarray, damping: np.ndarray) -> ModalResponse:
    """Closed form for omega^2 (r,) [rad2/s2], negative for growing modes, and damping D (r, r) [1/s].

    Raises NumericalFailure where coupled damping leaves no complete set of complex modes.
    """
    diagonal = np.diagonal(damping)
    scale = np.sqrt(np.abs(np.outer(diagonal, diagonal)))
    off_diagonal = damping - np.diag(diagonal)
    if np.all(np.abs(off_diagonal) <= DIAGONAL * np.maximum(scale, np.max(scale, initial=0.0) * DIAGONAL)):
        return _uncoupled(squares, diagonal)
    return _coupled(squares, damping)


def _uncoupled(squares: np.ndarray, damping: np.ndarray) -> ModalResponse:
    terms = [term for k in range(len(squares)) for term in _mode_terms(k, squares[k], damping[k] / 2)]
    p, r = len(terms), len(squares)
    shapes, maps = np.zeros((r, p), complex), np.zeros((3, p, r), complex)
    for j, (k, _, _, weights) in enumerate(terms):
        shapes[k, j] = 1.0
        maps[:, j, k] = weights
    basis = Exponentials(np.array([t[1] for t in terms], complex), np.array([t[2] for t in terms], int))
    return ModalResponse(basis, shapes, maps[0], maps[1], maps[2], diagonal=True)


Term = tuple[int, complex, int, tuple[complex, complex, complex]]  # mode, rate, power, weights of eta, eta', p


def _mode_terms(k: int, square: float, delta: float) -> list[Term]:
    """Terms of one mode eta'' + 2 delta eta' + omega^2 eta = p, omega^2 = ``square``."""
    if square == 0.0:
        return _free_terms(k, delta)
    if square < 0:
        return _growing_terms(k, square, delta)
    omega = np.sqrt(square)
    difference = (delta - omega) * (delta + omega)
    root = np.sqrt(abs(difference))
    if root <= NEARLY_CRITICAL * omega:
        s = difference  # cosh, sinh(s t)/s of small s t, to t^5
        even, odd = (1.0, 0.0, s / 2, 0.0, s**2 / 24, 0.0), (0.0, 1.0, 0.0, s / 6, 0.0, s**2 / 120)
        return [(k, -delta, d, (e + delta * o, o, 0.0)) for d, (e, o) in enumerate(zip(even, odd, strict=True))]
    if difference < 0:
        return [(k, complex(-delta, root), 0, (1 - 1j * delta / root, -1j / root, 0.0))]
    fast = -(delta + root)
    slow = omega**2 / fast
    return [
        (k, slow, 0, (-fast / (slow - fast), 1 / (slow - fast), 0.0)),
        (k, fast, 0, (slow / (slow - fast), -1 / (slow - fast), 0.0)),
    ]


def _growing_terms(k: int, square: float, delta: float) -> list[Term]:
    """Terms of omega^2 < 0, delta >= 0: one rate grows and one decays, the smaller of them from their product."""
    decaying = -(delta + np.sqrt(delta**2 - square))
    growing = square / decaying
    difference = growing - decaying
    return [
        (k, growing, 0, (-decaying / difference, 1 / difference, 0.0)),
        (k, decaying, 0, (growing / difference, -1 / difference, 0.0)),
    ]


def _free_terms(k: int, delta: float) -> list[Term]:
    """Terms of eta'' + 2 delta eta' = p."""
    if delta == 0.0:
        return [(k, 0.0, 0, (1.0, 0.0, 0.0)), (k, 0.0, 1, (0.0, 1.0, 0.0)), (k, 0.0, 2, (0.0, 0.0, 0.5))]
    rate = 2 * delta
    return [
        (k, 0.0, 0, (1.0, 1 / rate, -1 / rate**2)),
        (k, 0.0, 1, (0.0, 0.0, 1 / rate)),
        (k, -rate, 0, (0.0, -1 / rate, 1 / rate**2)),
    ]


def _coupled(squares: np.ndarray, damping: np.ndarray) -> ModalResponse:
    """Undamped rigid-body modes on their own, all others by their complex modes."""
    alone = (squares == 0) & ~np.any(damping, axis=1)
    if not np.any(alone):
        return _complex_modes(squares, damping)
    together = ~alone
    parts = (
        _uncoupled(squares[alone], np.zeros(int(np.sum(alone)))),
        _complex_modes(squares[together], damping[np.ix_(together, together)]),
    )
    return _side_by_side(parts, (np.flatnonzero(alone), np.flatnonzero(together)), len(squares))


def _complex_modes(squares: np.ndarray, damping: np.ndarray) -> ModalResponse:
    """Complex modes of z' = S z, z = (|omega| eta_e, eta') with the elastic modes e; zero-frequency modes follow.

    Every entry of z is a velocity, whatever the units. On zero-frequency modes f nothing acts but damping:
    eta_f(t) = eta_f(0) + Re sum_j v_fj / lambda_j c_j (exp(lambda_j t) - 1).
    """
    r = len(squares)
    elastic, free = np.flatnonzero(squares), np.flatnonzero(squares == 0)
    scale = np.sqrt(np.abs(squares[elastic]))
    upper, lower = np.zeros((len(elastic), r)), np.zeros((r, len(elastic)))
    upper[np.arange(len(elastic)), elastic] = scale
    lower[elastic, np.arange(len(elastic))] = -squares[elastic] / scale
    system = np.block([[np.zeros((len(elastic),) * 2), upper], [lower, -damping]])
    rates, vectors = (found.astype(complex) for found in np.linalg.eig(system))  # eig gives real ones where all decay
    if not np.linalg.cond(vectors) < WORST_CONDITION:
        raise NumericalFailure(
            "damping: the damped modes of a level are defective (coupled modes critically damped alike), "
            "so its motion is no sum of exponentials"
        )
    rates, vectors = _refined(system, rates, vectors)
    kept = rates.imag >= 0
    inverse = _real_part_inverse(vectors[:, kept], rates[kept].imag > 0)
    count = int(np.sum(kept))
    shapes, maps = np.zeros((r, count + len(free)), complex), np.zeros((2, count + len(free), r), complex)
    shapes[elastic, :count] = vectors[: len(elastic), kept] / scale[:, None]
    shapes[free, :count] = vectors[len(elastic) + free][:, kept] / rates[kept]
    shapes[free, count + np.arange(len(free))] = 1.0
    maps[0][:count, elastic], maps[1][:count] = inverse[:, : len(elastic)] * scale, inverse[:, len(elastic) :]
    maps[:, count:] = -(shapes[free, :count] @ maps[:, :count]).real
    maps[0][count + np.arange(len(free)), free] += 1.0
    basis = Exponentials(np.concatenate([rates[kept], np.zeros(len(free))]), np.zeros(count + len(free), int))
    response = ModalResponse(basis, shapes, maps[0], maps[1], np.zeros_like(maps[1]), False)
    return _with_drift(response, squares, damping) if len(free) else response


def _refined(system: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A step of Newton's method for all eigenpairs at once: V (I + F), F_ij = E_ij / (lambda_j - lambda_i).

    E = V^-1 (S V - V Lambda). An eigenvalue solver leaves round-off of the largest rate in every pair; after the step
    it is round-off of the pair's own rate. Pairs too near each other for a step stay as they are.
    """
    left = np.linalg.solve(vectors, system @ vectors - vectors * rates)
    apart = rates - rates[:, None]
    near = np.abs(left) >= STEP * np.abs(apart)
    turned = vectors @ np.where(near, 0.0, left / np.where(near, 1.0, apart))
    moved, real = np.diagonal(left), rates.imag == 0
    return rates + np.where(real, moved.real, moved), vectors + np.where(real, turned.real, turned)


def _real_part_inverse(vectors: np.ndarray, paired: np.ndarray) -> np.ndarray:
    """c (k, s) of z = Re sum_j v_j c_j from the k vectors (s, k), of which those not ``paired`` are real.

    Solved as the real system it is and refined once: an inverse of the complex vectors leaves an error of
    their condition squared in z, this one of their condition.
    """
    system = np.hstack([vectors.real, -vectors[:, paired].imag])
    inverse = np.linalg.inv(system)
    inverse = inverse + inverse @ (np.eye(len(system)) - system @ inverse)
    coefficients = inverse[: len(paired)].astype(complex)
    coefficients[paired] += 1j * inverse[len(paired) :]
    return coefficients


def _with_drift(response: ModalResponse, squares: np.ndarray, damping: np.ndarray) -> ModalResponse:
    """Adds the motion u + w t of damped zero-frequency modes under a constant force: diag(omega^2) u + D w = p."""
    free = np.flatnonzero(squares == 0)
    unknowns = np.diag(squares)
    unknowns[:, free] = damping[:, free]
    solution = np.linalg.solve(unknowns, np.eye(len(squares))[:, free])
    drift = np.zeros_like(solution)
    drift[free] = solution[free]
    offset = solution - drift
    count, p = len(free), len(response.basis.rates)
    rates = np.concatenate([response.basis.rates, np.zeros(3 * count)])
    powers = np.concatenate([response.basis.powers, np.tile([0, 0, 1], count)])  # u, then w t with its derivative w
    added = np.stack([offset, drift, drift], axis=2).reshape(len(squares), 3 * count)
    maps = [np.vstack([m, np.zeros((3 * count, len(squares)))]) for m in _maps(response)]
    maps[2][:p, free] = -(response.from_displacement @ offset + response.from_velocity @ drift)
    maps[2][p : p + 3 * count : 3, free] = maps[2][p + 2 : p + 3 * count : 3, free] = np.eye(count)
    shapes = np.hstack([response.shapes, added])
    return ModalResponse(Exponentials(rates, powers), shapes, maps[0], maps[1], maps[2], False)


def _side_by_side(parts: tuple[ModalResponse, ...], modes: tuple[np.ndarray, ...], r: int) -> ModalResponse:
    p = sum(len(part.basis.rates) for part in parts)
    shapes, maps, first = np.zeros((r, p), complex), np.zeros((3, p, r), complex), 0
    for part, index in zip(parts, modes, strict=True):
        rows = np.arange(first, first + len(part.basis.rates))
        shapes[np.ix_(index, rows)] = part.shapes
        for whole, own in zip(maps, _maps(part), strict=True):
            whole[np.ix_(rows, index)] = own
        first += len(rows)
    basis = Exponentials(
        np.concatenate([part.basis.rates for part in parts]), np.concatenate([part.basis.powers for part in parts])
    )
    return ModalResponse(basis, shapes, maps[0], maps[1], maps[2], False)


def _maps(response: ModalResponse) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return response.from_displacement, response.from_velocity, response.from_force
