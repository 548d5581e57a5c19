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
DEPENDENT = 1e-12  # of a row's flexibility: what the other shapes leave of it is round-off below


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

    A Rayleigh-Ritz basis: the lowest modes V by shift-invert Lanczos, completed by the static response to a
    unit force on each row, so that a contact or a load there has its exact static flexibility. With
    A = K + s M and S = A^-1 R^T, what V leaves of the static shapes, S - V (Lambda + s)^-1 V^T R^T, is
    orthogonal to V in M and in K, so the frequencies of V stay as accurate as Lanczos gives them.

    The stiffness is factorised once (s = 0); for a structure with rigid-body modes three times: it is singular,
    then s is small, then the first elastic omega^2. A mass that is not diagonal is factorised for its definiteness.

    Raises MultiPhiValueError for an indefinite mass or stiffness, NumericalFailure if Lanczos does not converge.
    """
    mass, stiffness = scipy.sparse.csc_array(mass), scipy.sparse.csc_array(stiffness)
    _check_mass(mass)
    rows = rows[np.any(rows, axis=1)]
    shift = 0.0
    factor = _definite_factor(stiffness)
    if factor is not None:
        values, vectors = _lanczos(mass, stiffness, count, shift, factor)
    if factor is None or np.any(values <= _round_off_energy(stiffness, vectors)):
        shift = FIRST_SHIFT * _largest_ratio(mass, stiffness)
        factor = _shifted_factor(mass, stiffness, shift)
        values, vectors = _lanczos(mass, stiffness, count, shift, factor)
        elastic = values > _round_off_energy(stiffness, vectors)
        if np.any(elastic):
            shift = float(np.min(values[elastic]))
            factor = _shifted_factor(mass, stiffness, shift)
            values, vectors = _lanczos(mass, stiffness, count, shift, factor)
    added, residual = _residual_shapes(mass, rows, values + shift, vectors, factor)
    return _classified(stiffness, np.r_[values, added - shift], np.column_stack([vectors, residual]), shift)


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


def _definite_factor(matrix: Any) -> Any | None:
    """Sparse triangular factors of a symmetric matrix; None where it is not positive definite to round-off.

    Pivots are taken from the diagonal, so that their signs are those of the eigenvalues (Sylvester).
    """
    try:
        factor = scipy.sparse.linalg.splu(
            matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
    except RuntimeError:  # "Factor is exactly singular"
        return None
    pivots = factor.U.diagonal()[factor.perm_c]
    definite = np.array_equal(factor.perm_r, factor.perm_c) and np.all(pivots > ROUND_OFF * matrix.diagonal())
    return factor if definite else None


def _shifted_factor(mass: Any, stiffness: Any, shift: float) -> Any:
    factor = _definite_factor(scipy.sparse.csc_array(stiffness + shift * mass))
    if factor is None:
        raise MultiPhiValueError(
            f"stiffness: indefinite, lowest eigenvalue omega^2 below {-shift:g}; need a positive semidefinite matrix"
        )
    return factor


def _check_mass(mass: Any) -> None:
    diagonal = scipy.sparse.diags_array(mass.diagonal())
    if (mass != diagonal).nnz and _definite_factor(mass) is None:
        raise MultiPhiValueError("mass: indefinite, need a positive definite matrix")


def _lanczos(mass: Any, stiffness: Any, count: int, shift: float, factor: Any) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` lowest omega^2, ascending, and their shapes; factor: of K + shift M."""
    n = stiffness.shape[0]
    start = np.random.default_rng(0).uniform(-1, 1, n)  # a start with a symmetry would not see all modes
    operator = scipy.sparse.linalg.LinearOperator((n, n), factor.solve)
    try:
        values, vectors = scipy.sparse.linalg.eigsh(stiffness, count, mass, sigma=-shift, OPinv=operator, v0=start)
    except scipy.sparse.linalg.ArpackError as error:
        raise NumericalFailure(f"modes: Lanczos iteration for {count} of {n} modes failed: {error}") from error
    order = np.argsort(values)
    return values[order], vectors[:, order]


def _residual_shapes(
    mass: Any, rows: np.ndarray, values: np.ndarray, modes: np.ndarray, factor: Any
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues (m,) of A and shapes (n, m) of what ``modes``, eigenvalues ``values`` of A, leave of A^-1 rows^T."""
    if not len(rows):
        return np.zeros(0), np.zeros((mass.shape[0], 0))
    statics = factor.solve(np.ascontiguousarray(rows.T))
    size = np.sqrt(np.einsum("ij,ji->i", rows, statics))  # each row's own flexibility becomes 1
    residual = (statics - modes @ ((rows @ modes).T / values[:, None])) / size
    residual -= modes @ (modes.T @ (mass @ residual))
    flexibility = (rows / size[:, None]) @ residual
    kept, turn = scipy.linalg.eigh((flexibility + flexibility.T) / 2)
    turn, kept = turn[:, kept > DEPENDENT], kept[kept > DEPENDENT]
    residual = residual @ (turn / np.sqrt(kept))  # A-orthonormal
    inverse, rotation = scipy.linalg.eigh(residual.T @ (mass @ residual))
    residual = residual @ (rotation / np.sqrt(inverse))
    upper = scipy.linalg.cholesky(residual.T @ (mass @ residual))  # once more: orthonormal to round-off
    return 1 / inverse, scipy.linalg.solve_triangular(upper, residual.T, trans="T").T
