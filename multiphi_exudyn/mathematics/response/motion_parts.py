"""Parts of a linear motion z' = A z that have nothing to do with each other: its eigenvalues, and clusters of them.

    z = Re V y,   y' = T y,   y(0) = W z(0)

T is diagonal where A has a complete set of eigenvectors that are told apart by more than round-off. Where some of them
(nearly) coincide, at a double root with one eigenvector, those of a cluster span one part, of which T is upper
triangular (Schur): it moves with powers of time,

    exp(T t) = exp(lambda t) sum_k N^k t^k / k!,   N = T - lambda I,   lambda the cluster's mean

A conjugate pair is kept once, with its weight doubled.
Source: G. H. Golub, C. F. Van Loan, Matrix Computations, 4th ed. 2013, ch. 7.6 and 9.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.round_off import DEFECTIVE, WORST_CONDITION

__all__ = ["Parts", "parts_of"]

STEP = 1e-3  # of an eigenvector: a larger step of its refinement is none of round-off
CLUSTERS = 10.0 ** np.arange(-12.0, -3.0)  # of the rates: distances up to which they make a cluster, tried in turn
BEYOND = 8  # powers that a cluster has beyond its size: its rates do not coincide to the last digit


@dataclass(frozen=True)
class Parts:
    """rates: lambda (k,). vectors: V (s, k). inverse: W (k, s). mixing: T (k, k). groups: first, end of each part."""

    rates: np.ndarray
    vectors: np.ndarray
    inverse: np.ndarray
    mixing: np.ndarray
    groups: tuple[tuple[int, int], ...]

    def powers(self, first: int, end: int) -> np.ndarray:
        """N^d / d! (d, m, m) of a part, d = 0, 1, ..."""
        size = end - first
        nilpotent = self.mixing[first:end, first:end] - self.rates[first] * np.eye(size)
        found = [np.eye(size, dtype=complex)]
        for d in range(1, size + BEYOND if size > 1 else 1):
            found.append(found[-1] @ nilpotent / d)
        return np.array(found)

    def only(self, kept: np.ndarray) -> Parts:
        """Some of the parts, by which of the components (k,) are kept."""
        place = np.cumsum(kept)
        groups = tuple((int(place[first]) - 1, int(place[end - 1])) for first, end in self.groups if kept[first])
        mixing = self.mixing[np.ix_(kept, kept)]
        return Parts(self.rates[kept], self.vectors[:, kept], self.inverse[kept], mixing, groups)


def parts_of(system: np.ndarray) -> Parts:
    """The parts of z' = A z, A (s, s) real. Raises NumericalFailure where round-off does not tell them apart."""
    rates, vectors = (found.astype(complex) for found in np.linalg.eig(system))  # eig gives real ones where all decay
    condition = float(np.linalg.cond(vectors))
    if condition < DEFECTIVE:
        return _single(system, *_refined(system, rates, vectors))
    turned = np.diagonal(scipy.linalg.schur(system, output="complex")[0])
    for distance in CLUSTERS * float(np.max(np.abs(turned))):
        found = _clustered(system, turned, _clusters(turned, distance), distance)
        if found is not None:
            return found
    if condition < WORST_CONDITION:
        return _single(system, *_refined(system, rates, vectors))
    raise NumericalFailure(
        "modes: two coupled modes of a level are critically damped alike, to round-off; change the damping a little"
    )


def _single(system: np.ndarray, rates: np.ndarray, vectors: np.ndarray) -> Parts:
    kept = rates.imag >= 0
    inverse = _real_part_inverse(vectors[:, kept], rates[kept].imag > 0)
    groups = tuple((i, i + 1) for i in range(int(np.sum(kept))))
    return Parts(rates[kept], vectors[:, kept], inverse, np.diag(rates[kept]), groups)


def _clusters(rates: np.ndarray, distance: float) -> list[np.ndarray]:
    """Positions of the rates in every cluster, in which each is within a distance of another."""
    near = np.abs(rates[:, None] - rates) <= distance
    for _ in rates:  # those near to one that is near are near
        near = near @ near
    first = np.argmax(near, axis=1)
    return [np.flatnonzero(first == i) for i in np.unique(first)]


def _clustered(system: np.ndarray, rates: np.ndarray, clusters: list[np.ndarray], distance: float) -> Parts | None:
    """The parts that clusters of rates make, None where they too are not told apart."""
    blocks, doubled = [], []
    for own in clusters:
        real = np.min(np.abs(rates[own][:, None] - rates[own].conj())) <= distance
        if np.mean(rates[own].imag) < 0 and not real:
            continue  # the conjugate of another
        blocks.append(_block(system, rates, own))
        doubled.append(not real)
    paired = [vectors for (vectors, _), twice in zip(blocks, doubled, strict=True) if twice]
    whole = np.hstack([*(vectors for vectors, _ in blocks), *(vectors.conj() for vectors in paired)])
    if whole.shape[0] != whole.shape[1] or not np.linalg.cond(whole) < DEFECTIVE:
        return None
    inverse, first, groups, centres, weights = np.linalg.inv(whole), 0, [], [], []
    mixing = scipy.linalg.block_diag(*(own for _, own in blocks))
    for (vectors, own), twice in zip(blocks, doubled, strict=True):
        count = vectors.shape[1]
        centre = complex(np.mean(np.diagonal(own)))
        centres += [centre if twice else complex(centre.real)] * count
        weights += [2.0 if twice else 1.0] * count
        groups.append((first, first + count))
        first += count
    weighted = np.array(weights)[:, None] * inverse[:first]
    return Parts(np.array(centres), whole[:, :first], weighted, mixing, tuple(groups))


def _block(system: np.ndarray, rates: np.ndarray, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal basis (s, m) of what a cluster's motions span, and T (m, m)."""

    def chosen(rate: complex) -> bool:
        return int(np.argmin(np.abs(rates - rate))) in own

    turned, basis, count = scipy.linalg.schur(system, output="complex", sort=chosen)
    assert count == len(own), "the same iteration finds the same rates"
    return basis[:, :count], turned[:count, :count]


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
