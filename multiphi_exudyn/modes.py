"""Natural frequencies and M-orthonormal mode shapes, accurate at both ends of the spectrum.

    K phi = omega^2 M phi,   Phi^T M Phi = I

A fine beam mesh spans omega_max / omega_1 = 1e5 and more. An eigensolver applied to K and M loses the
lowest omega^2 to round-off of the largest (1e-16 omega_max^2). Here omega are singular values of
R L^-T, K = R^T R, M = L L^T, taken by a one-sided Jacobi method (LAPACK gejsv) that keeps relative
accuracy in all of them. Source: J. Demmel et al., Computing the singular value decomposition with high
relative accuracy, Linear Algebra Appl. 299 (1999) 21; Z. Drmac, K. Veselic, SIAM J. Matrix Anal. Appl.
29 (2008) 1322.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure

__all__ = ["Modes", "complete_modes", "lowest_modes", "right_singular_vectors"]

ROUND_OFF = 64 * np.finfo(float).eps  # of |phi|^T |K| |phi|: strain energy below it is round-off, not stiffness
FIRST_SHIFT = 1e-8  # of the largest K_ii / M_ii: regularises K until the first elastic mode is known


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


def complete_modes(mass: np.ndarray, stiffness: np.ndarray) -> Modes:
    """All n modes of dense (n, n) matrices. Raises MultiPhiValueError for an indefinite stiffness."""
    shift = 0.0
    modes = None
    for attempt in (0.0, FIRST_SHIFT * _largest_ratio(mass, stiffness)):
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


def lowest_modes(mass: Any, stiffness: Any, count: int, rows: np.ndarray) -> Modes:
    """Basis of the ``count`` lowest modes and the static shapes of ``rows`` (k, n), for sparse matrices.

    A Rayleigh-Ritz basis: the lowest modes by shift-invert Lanczos, completed by the static response to a
    unit force on each row, so that a contact or a load there has its exact static flexibility.
    """
    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    shift = FIRST_SHIFT * _largest_ratio(mass, stiffness)
    for _ in range(2):  # the second pass shifts by the first elastic omega^2, so that low modes stay accurate
        shifted = scipy.sparse.csc_array(stiffness + shift * mass)
        factor = scipy.sparse.linalg.splu(shifted)
        operator = scipy.sparse.linalg.LinearOperator(shifted.shape, factor.solve)
        values, vectors = scipy.sparse.linalg.eigsh(
            stiffness, count, mass, sigma=-shift, OPinv=operator, v0=np.ones(shifted.shape[0])
        )
        elastic = values > _round_off_energy(stiffness, vectors)
        if np.all(elastic) or not np.any(elastic):
            break
        shift = float(np.min(values[elastic]))
    statics = factor.solve(rows.T) if len(rows) else np.zeros((mass.shape[0], 0))
    basis = _orthonormal(mass, np.column_stack([vectors, statics]))
    reduced = basis.T @ (stiffness @ basis)
    omega_squared, rotation = scipy.linalg.eigh((reduced + reduced.T) / 2)
    return _classified(stiffness, omega_squared, basis @ rotation, 0.0)


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


def _shifted_modes(mass: np.ndarray, stiffness: np.ndarray, shift: float) -> Modes | None:
    """Modes by way of K + shift M; None where that is not positive definite."""
    lower = scipy.linalg.cholesky(mass, lower=True)
    try:
        upper = scipy.linalg.cholesky(stiffness + shift * mass)
    except scipy.linalg.LinAlgError:
        return None
    product = scipy.linalg.solve_triangular(lower, upper.T, lower=True).T
    singular, vectors = right_singular_vectors(product)
    shapes = scipy.linalg.solve_triangular(lower, vectors, lower=True, trans="T")
    return _classified(stiffness, singular**2 - shift, shapes, shift)


def _classified(stiffness: Any, omega_squared: np.ndarray, shapes: np.ndarray, shift: float) -> Modes:
    """Modes with those of no strain energy named rigid-body modes and given omega = 0.

    shift: what has been subtracted to get omega_squared; its round-off is left in it.
    """
    rigid = omega_squared <= _round_off_energy(stiffness, shapes) + ROUND_OFF * shift
    order = np.argsort(np.where(rigid, 0.0, omega_squared), kind="stable")
    omega = np.sqrt(np.where(rigid, 0.0, omega_squared))[order]
    return Modes(omega, np.ascontiguousarray(shapes[:, order]), int(np.sum(rigid)))


def _round_off_energy(stiffness: Any, shapes: np.ndarray) -> np.ndarray:
    magnitudes = np.abs(shapes)
    return ROUND_OFF * np.einsum("ij,ij->j", magnitudes, abs(stiffness) @ magnitudes)


def _largest_ratio(mass: Any, stiffness: Any) -> float:
    return float(np.max(stiffness.diagonal() / mass.diagonal())) or 1.0  # any shift serves where nothing is stiff


def _orthonormal(mass: Any, basis: np.ndarray) -> np.ndarray:
    """M-orthonormal basis of the same span, dependent directions left out."""
    scaled = basis / np.sqrt(np.einsum("ij,ij->j", basis, mass @ basis))
    values, vectors = scipy.linalg.eigh(scaled.T @ (mass @ scaled))
    kept = values > 1e-12  # squared sine of the angle to the others: below it a direction is round-off
    basis = scaled @ (vectors[:, kept] / np.sqrt(values[kept]))
    upper = scipy.linalg.cholesky(basis.T @ (mass @ basis))  # once more: orthonormal to round-off
    return scipy.linalg.solve_triangular(upper, basis.T, trans="T").T
