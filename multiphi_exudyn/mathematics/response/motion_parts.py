"""Independent parts of a linear motion z' = A z: its eigenvalues, and clusters of them.

    z = Re V y,   y' = T y,   y(0) = W z(0)

T is diagonal where A has a complete set of eigenvectors, independent by more than round-off. Where some of them
(nearly) coincide, at a double root with one eigenvector, those of a cluster span one part, with an upper triangular T
(Schur): its motion has powers of time,

    exp(T t) = exp(lambda t) sum_k N^k t^k / k!,   N = T - lambda I,   lambda the cluster's mean

A conjugate pair is kept once, with its weight doubled. A rate that is round-off of its terms W A V is zero: so it is
where friction cancels damping.
Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed. 2013, ch. 7.6 and 9.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.round_off import DEFECTIVE, WORST_CONDITION, drop_round_off

__all__ = ["Parts", "parts_of"]

STEP = 1e-3  # of an eigenvector: a larger step of its refinement is not round-off
CLUSTERS = 10.0 ** np.arange(-12.0, -3.0)  # of the rates: largest distances in a cluster, in the order of trials
BEYOND = 8  # powers of a cluster beyond its size, as its rates do not coincide exactly


@dataclass(frozen=True)
class Parts:
    """rates: lambda (k,). vectors: V (s, k). inverse: W (k, s). mixing: T (k, k). groups: first, end of each part."""

    rates: np.ndarray
    vectors: np.ndarray
    inverse: np.ndarray
    mixing: np.ndarray
    groups: tuple[tuple[int, int], ...]

    def powers(self, first: int, end: int) -> np.ndarray:
        """Return N^d / d! (d, m, m) of a part, d = 0, 1, ..."""
        size = end - first
        nilpotent = self.mixing[first:end, first:end] - self.rates[first] * np.eye(size)
        result = [np.eye(size, dtype=complex)]
        for d in range(1, size + BEYOND if size > 1 else 1):
            result.append(result[-1] @ nilpotent / d)
        return np.array(result)

    def only(self, kept: np.ndarray) -> Parts:
        """Return the parts of the components (k,) that are kept."""
        place = np.cumsum(kept)
        groups = tuple((int(place[first]) - 1, int(place[end - 1])) for first, end in self.groups if kept[first])
        mixing = self.mixing[np.ix_(kept, kept)]
        return Parts(self.rates[kept], self.vectors[:, kept], self.inverse[kept], mixing, groups)


def parts_of(system: np.ndarray) -> Parts:
    """Return the parts of z' = A z, A (s, s) real. Raises NumericalFailure where round-off makes them indistinct."""
    rates, vectors = (
        part.astype(complex) for part in np.linalg.eig(system)
    )  # eig returns real arrays if all rates are real
    condition = float(np.linalg.cond(vectors))
    if condition < DEFECTIVE:
        return _single(system, *_refined(system, rates, vectors))
    schur_rates = np.diagonal(scipy.linalg.schur(system, output="complex")[0])
    for distance in CLUSTERS * float(np.max(np.abs(schur_rates))):
        parts = _clustered(system, schur_rates, _clusters(schur_rates, distance), distance)
        if parts is not None:
            return parts
    if condition < WORST_CONDITION:
        return _single(system, *_refined(system, rates, vectors))
    raise NumericalFailure(
        "modes: two coupled modes of a level are critically damped alike, to round-off; change the damping a little"
    )


def _single(system: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> Parts:
    is_upper = rates.imag >= 0
    rates, vectors = rates[is_upper], vectors[:, is_upper]
    inverse = _real_part_inverse(vectors, rates.imag > 0)
    terms = np.sum(np.abs(inverse) * (np.abs(system) @ np.abs(vectors)).T, axis=1)
    rates = drop_round_off(rates, terms)
    groups = tuple((i, i + 1) for i in range(len(rates)))
    return Parts(rates, vectors, inverse, np.diag(rates), groups)


def _clusters(rates: np.ndarray, distance: float) -> list[np.ndarray]:
    """Return the positions of the rates in every cluster, in which each is within a distance of another."""
    near = np.abs(rates[:, None] - rates) <= distance
    for _ in rates:  # neighbours of neighbours
        near = near @ near
    first = np.argmax(near, axis=1)
    return [np.flatnonzero(first == i) for i in np.unique(first)]


def _clustered(system: np.ndarray, rates: np.ndarray, clusters: list[np.ndarray], distance: float) -> Parts | None:
    """Return the parts of clusters of rates, None where these are not distinct either."""
    blocks, doubled = [], []
    for members in clusters:
        real = np.min(np.abs(rates[members][:, None] - rates[members].conj())) <= distance
        if np.mean(rates[members].imag) < 0 and not real:
            continue  # the conjugate of another
        blocks.append(_block(system, rates, members))
        doubled.append(not real)
    paired = [vectors for (vectors, _), is_doubled in zip(blocks, doubled, strict=True) if is_doubled]
    basis = np.hstack([*(vectors for vectors, _ in blocks), *(vectors.conj() for vectors in paired)])
    if basis.shape[0] != basis.shape[1] or not np.linalg.cond(basis) < DEFECTIVE:
        return None
    inverse, first, groups, centres, weights = np.linalg.inv(basis), 0, [], [], []
    mixing = scipy.linalg.block_diag(*(members for _, members in blocks))
    for (vectors, members), is_doubled in zip(blocks, doubled, strict=True):
        count = vectors.shape[1]
        centre = complex(np.mean(np.diagonal(members)))
        centres += [centre if is_doubled else complex(centre.real)] * count
        weights += [2.0 if is_doubled else 1.0] * count
        groups.append((first, first + count))
        first += count
    weighted = np.array(weights)[:, None] * inverse[:first]
    return Parts(np.array(centres), basis[:, :first], weighted, mixing, tuple(groups))


def _block(system: np.ndarray, rates: np.ndarray, members: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return an orthonormal basis (s, m) of the motions of a cluster, and T (m, m)."""

    def chosen(rate: complex) -> bool:
        return int(np.argmin(np.abs(rates - rate))) in members

    triangle, basis, count = scipy.linalg.schur(system, output="complex", sort=chosen)
    assert count == len(members), "the same iteration finds the same rates"
    mixing = triangle[:count, :count].copy()
    np.fill_diagonal(mixing, drop_round_off(np.diagonal(mixing), np.linalg.norm(system)))
    return basis[:, :count], mixing


def _refined(system: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return lambda and V after a Newton step for all pairs: V (I + F), F_ij = E_ij / (lambda_j - lambda_i).

    E = V^-1 (S V - V Lambda). An eigenvalue solver has an error of round-off of the largest rate in every pair; after
    the step it is round-off of the pair's own rate. Pairs too close for a step are not changed.
    """
    residual = np.linalg.solve(vectors, system @ vectors - vectors * rates)
    differences = rates - rates[:, None]
    near = np.abs(residual) >= STEP * np.abs(differences)
    corrected = vectors @ np.where(near, 0.0, residual / np.where(near, 1.0, differences))
    changes, real = np.diagonal(residual), rates.imag == 0
    return rates + np.where(real, changes.real, changes), vectors + np.where(real, corrected.real, corrected)


def _real_part_inverse(vectors: np.ndarray, paired: np.ndarray) -> np.ndarray:
    """Return c (k, s) of z = Re sum_j v_j c_j from the k vectors (s, k), of which those not ``paired`` are real.

    It is solved as a real system and refined once: an inverse of the complex vectors would give an error of their
    condition squared in z, this one of their condition.
    """
    system = np.hstack([vectors.real, -vectors[:, paired].imag])
    inverse = np.linalg.inv(system)
    inverse = inverse + inverse @ (np.eye(len(system)) - system @ inverse)
    coefficients = inverse[: len(paired)].astype(complex)
    coefficients[paired] += 1j * inverse[len(paired) :]
    return coefficients
