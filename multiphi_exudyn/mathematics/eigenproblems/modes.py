"""Natural frequencies and M-orthonormal mode shapes, accurate at both ends of the spectrum.

    K phi = omega^2 M phi,   Phi^T M Phi = I

A fine beam mesh spans omega_max / omega_1 = 1e5 and more. An eigensolver applied to K and M loses the
lowest omega^2 to round-off of the largest (1e-16 omega_max^2). Here omega are singular values of
R L^-T, K = R^T R, M = L L^T, taken by a one-sided Jacobi method (LAPACK gejsv) that keeps relative
accuracy in all of them. Source: J. Demmel et al., Computing the singular value decomposition with high
relative accuracy, Linear Algebra Appl. 299 (1999) 21; Z. Drmac, K. Veselic, SIAM J. Matrix Anal. Appl.
29 (2008) 1322.

An eigensolver leaves the sign of a mode open, and the basis of what modes of one frequency span; round-off then
chooses, and it differs between processors. ``turned`` makes both definite.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure

__all__ = [
    "FIRST_SHIFT",
    "NEAR",
    "ROUND_OFF",
    "Modes",
    "classified",
    "complete_modes",
    "largest_ratio",
    "right_singular_vectors",
    "round_off_energy",
    "turned",
]

ROUND_OFF = 64 * np.finfo(float).eps  # of |phi|^T |K| |phi|: strain energy below it is round-off, not stiffness
FIRST_SHIFT = 1e-8  # of the largest K_ii / M_ii: regularises K until the first elastic mode is known
EQUAL = 1e-11  # of omega^2: nearer ones are equal up to the round-off of matrices and eigenvalues
NEAR = 1e-6  # of omega^2: round-off turns nearer modes into each other by more than 1e-10, so they are kept together
MOVES = 1e-5  # of what modes can move a row by: with less, the round-off of a mode could choose its sign
TURNED = 1e-14  # of what a coordinate moves in a cluster: what a rotation leaves of less in one mode is its round-off


@dataclass(frozen=True)
class Modes:
    """Modes of (M, K), lowest first.

    omega: (m,) rad/s, zero for rigid-body modes. shapes: (n, m), mass-normalised.
    rigid: number of rigid-body modes, which come first.
    """

    omega: np.ndarray
    shapes: np.ndarray
    rigid: int

    @property
    def count(self) -> int:
        """Number of modes m."""
        return len(self.omega)

    def turned(self, rows: np.ndarray) -> Modes:
        """The same modes with what an eigensolver leaves open chosen by ``rows`` (k, n), then by the coordinates."""
        sizes = np.linalg.norm(np.vstack([rows @ self.shapes, self.shapes]), axis=1)
        squares, shapes, _ = turned(self.omega**2, self.shapes, rows, sizes)
        return Modes(np.sqrt(squares), shapes, self.rigid)


def complete_modes(mass: np.ndarray, stiffness: np.ndarray) -> Modes:
    """All n modes of dense (n, n) matrices. Raises MultiPhiValueError for an indefinite stiffness."""
    shift = 0.0
    modes = None
    for attempt in (0.0, FIRST_SHIFT * largest_ratio(mass, stiffness)):
        shift = attempt
        modes = _shifted_modes(mass, stiffness, shift)
        if modes is not None and (shift > 0 or modes.rigid == 0):
            break
    if modes is None:
        lowest = scipy.linalg.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[0, 0])[0]
        raise MultiPhiValueError(
            f"stiffness: indefinite, lowest eigenvalue omega^2 = {lowest:g}; need a positive semidefinite matrix"
        )
    if 0 < modes.rigid < modes.count:
        modes = _shifted_modes(mass, stiffness, modes.omega[modes.rigid] ** 2) or modes
    return modes


def right_singular_vectors(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Singular values ascending (m,) and right singular vectors (n, m) of a (k, n) matrix, k >= n."""
    if matrix.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0))
    # joba=2 ('F'): row pivoting, full accuracy also for row-graded matrices; jobv=0: V wanted; jobu=3: no U
    values, _, vectors, work, _, info = scipy.linalg.lapack.dgejsv(
        matrix, joba=2, jobu=3, jobv=0, jobr=0, jobt=0, jobp=0
    )
    if info != 0:
        raise NumericalFailure(f"singular values: the Jacobi iteration did not converge (info {info})")
    return (values * (work[0] / work[1]))[::-1], vectors[:, ::-1]


def turned(
    squares: np.ndarray, shapes: np.ndarray, rows: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """omega^2 (m,), modes (n, m) and what rows see of them (k, m), the same on every processor.

    What an eigensolver leaves open are signs, and bases of clusters of equal omega^2. squares: ascending. rows: (k, n),
    followed by the coordinates themselves. sizes: (k + n,), what modes of unit length can move each of these by. Of a
    cluster the first row that moves in it sees the first mode only, of the others the first row that moves in one of
    them sees the first of these only, and so on; its omega^2 become their mean. The first row that moves in a mode
    moves forward.
    """
    clusters, seen = _clusters(squares), rows @ shapes
    if clusters:
        squares, shapes = squares.copy(), shapes.copy()
    for first, last in clusters:
        squares[first:last] = np.mean(squares[first:last])
        turn = _turn(np.vstack([seen[:, first:last], shapes[:, first:last]]), sizes)
        lengths = np.linalg.norm(shapes[:, first:last], axis=1, keepdims=True)
        cluster = shapes[:, first:last] @ turn
        shapes[:, first:last] = np.where(np.abs(cluster) <= TURNED * lengths, 0.0, cluster)
        seen[:, first:last] = seen[:, first:last] @ turn
    signs = _signs(seen, shapes, sizes)
    return squares, shapes * signs, seen * signs


def _signs(seen: np.ndarray, shapes: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Of every mode the sign (m,) with which the first row or coordinate moves that moves in it."""
    if len(seen) and (np.abs(seen[0]) > MOVES * sizes[0]).all():
        return np.copysign(1.0, seen[0])
    seen = np.vstack([seen, shapes])
    first = _first_moved(np.abs(seen), sizes[: len(seen), None])
    return np.where(seen[first, np.arange(seen.shape[1])] >= 0, 1.0, -1.0)


def _clusters(squares: np.ndarray) -> list[tuple[int, int]]:
    """First and one past the last mode of every cluster of two or more equal omega^2, ascending."""
    steps = enumerate(itertools.pairwise(squares.tolist()), start=1)
    ends = [k for k, (below, above) in steps if above - below > EQUAL * max(abs(below), abs(above))]
    if len(ends) == len(squares) - 1:
        return []
    return [(first, last) for first, last in itertools.pairwise([0, *ends, len(squares)]) if last - first > 1]


def _turn(seen: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Rotation (d, d) of d modes after which each is seen by its own row first; seen: (k, d) of all rows."""
    turn = np.eye(seen.shape[1])
    for j in range(len(turn) - 1):
        left = seen @ turn[:, j:]
        row = int(_first_moved(np.linalg.norm(left, axis=1), sizes))
        towards = left[row] / (np.linalg.norm(left[row]) or 1.0)  # the mode that it sees comes first
        towards[0] += np.copysign(1.0, towards[0])
        turn[:, j:] -= np.outer(turn[:, j:] @ towards, towards) * (2 / (towards @ towards))
    return turn


def _first_moved(moved: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """First row that moves, by ``moved`` (k,) or in every column of (k, m), or else the one nearest to moving."""
    moves = moved > MOVES * sizes
    first = moves.argmax(axis=0)
    if moves.any(axis=0).all():
        return np.asarray(first)
    share = np.divide(moved, sizes, out=np.zeros_like(moved), where=sizes > 0)
    return np.where(moves.any(axis=0), first, share.argmax(axis=0))


def _shifted_modes(mass: np.ndarray, stiffness: np.ndarray, shift: float) -> Modes | None:
    """Modes by way of K + shift M; None where that is not positive definite."""
    try:
        lower = scipy.linalg.cholesky(mass, lower=True)
    except scipy.linalg.LinAlgError as error:
        raise MultiPhiValueError("mass: indefinite, need a positive definite matrix") from error
    try:
        upper = scipy.linalg.cholesky(stiffness + shift * mass)
    except scipy.linalg.LinAlgError:
        return None
    product = scipy.linalg.solve_triangular(lower, upper.T, lower=True).T
    singular, vectors = right_singular_vectors(product)
    shapes = scipy.linalg.solve_triangular(lower, vectors, lower=True, trans="T")
    return classified(stiffness, singular**2 - shift, shapes, shift)


def classified(stiffness: Any, omega_squared: np.ndarray, shapes: np.ndarray, shift: float) -> Modes:
    """Modes with those of no strain energy named rigid-body modes and given omega = 0.

    shift: what has been subtracted to get omega_squared; its round-off is left in it.
    """
    rigid = omega_squared <= round_off_energy(stiffness, shapes) + ROUND_OFF * shift
    order = np.argsort(np.where(rigid, 0.0, omega_squared), kind="stable")
    omega = np.sqrt(np.where(rigid, 0.0, omega_squared))[order]
    return Modes(omega, np.ascontiguousarray(shapes[:, order]), int(np.sum(rigid)))


def round_off_energy(stiffness: Any, shapes: np.ndarray) -> np.ndarray:
    magnitudes = np.abs(shapes)
    return ROUND_OFF * np.einsum("ij,ij->j", magnitudes, abs(stiffness) @ magnitudes)


def largest_ratio(mass: Any, stiffness: Any) -> float:
    return float(np.max(stiffness.diagonal() / mass.diagonal())) or 1.0  # any shift serves where nothing is stiff
