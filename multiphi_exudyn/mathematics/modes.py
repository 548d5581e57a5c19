"""Natural frequencies and M-orthonormal mode shapes, accurate at both ends of the spectrum.

    K phi = omega^2 M phi,   Phi^T M Phi = I

A fine beam mesh spans omega_max / omega_1 = 1e5 and more. An eigensolver applied to K and M loses the
lowest omega^2 to round-off of the largest (1e-16 omega_max^2). Here omega are singular values of
R L^-T, K = R^T R, M = L L^T, taken by a one-sided Jacobi method (LAPACK gejsv) that keeps relative
accuracy in all of them. Source: J. Demmel et al., Computing the singular value decomposition with high
relative accuracy, Linear Algebra Appl. 299 (1999) 21; Z. Drmac, K. Veselic, SIAM J. Matrix Anal. Appl.
29 (2008) 1322.

The sign of a mode, and the basis of a space of modes of one frequency, are arbitrary: an eigensolver chooses them by
round-off, which differs between processors. ``aligned_modes`` makes both unique.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.mathematics.massless_motions import not_definite
from multiphi_exudyn.mathematics.stiffness_digits import (
    digits_of,
    doubled_product,
    energy_noise,
    is_exact,
)

__all__ = [
    "NEAR",
    "ROUND_OFF",
    "Modes",
    "aligned_modes",
    "complete_modes",
    "first_shift",
    "indefinite",
    "modes_from_squares",
    "right_singular_vectors",
    "rigid_modes",
    "round_off_energy",
]

ROUND_OFF = 64 * np.finfo(float).eps  # of |phi|^T |K| |phi|: strain energy below it is round-off, not stiffness
FIRST_SHIFT = 1e-8  # of the largest K_ii / M_ii: regularises K until the first elastic mode is known
FEW_DIGITS_SHIFT = 1e-6  # the same for K of fewer than 53 bits
FEWEST_DIGITS = 1e-5  # of |phi|^T |K| |phi|: more than the digits of any K that can be told leave unknown
FAR = 0.05  # of the first elastic omega^2: what the digits leave open of rigid-body modes is at most this
NO_ENERGY = 1e-9  # of ROUND_OFF: exact strain energy of a rigid-body mode, which is round-off of its shape, squared
SOFT = 1e-10  # round-off of omega^2 above which a mode is soft beside its strain energies
ALONE = 0.5  # of omega^2 of the next mode: soft modes up to such a gap are made exact together
REFINEMENTS = 3  # each squares the error that other modes leave in soft ones
NEAR = 1e-6  # of omega^2: round-off mixes nearer modes by more than 1e-10, so they are kept together


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

    def aligned(self, rows: np.ndarray) -> Modes:
        """Return the same modes with signs and bases of clusters chosen by ``rows`` (k, n), then by the coordinates."""
        sizes = np.linalg.norm(np.vstack([rows @ self.shapes, self.shapes]), axis=1)
        squares, shapes, _ = aligned_modes(self.omega**2, self.shapes, rows, sizes)
        return Modes(np.sqrt(squares), shapes, self.rigid)


def complete_modes(mass: np.ndarray, stiffness: np.ndarray) -> Modes:
    """All n modes of dense (n, n) matrices. Raises MultiPhiValueError for an indefinite stiffness."""
    shift = 0.0
    modes = None
    for attempt in (0.0, first_shift(mass, stiffness)):
        shift = attempt
        modes = _shifted_modes(mass, stiffness, shift)
        if modes is not None and (shift > 0 or modes.rigid == 0):
            break
    if modes is None:
        lowest = scipy.linalg.eigh(stiffness, mass, eigvals_only=True, subset_by_index=[0, 0])[0]
        raise indefinite(stiffness, f"= {lowest:g}", lowest >= -FEWEST_DIGITS * _largest(mass, stiffness))
    if 0 < modes.rigid < modes.count:
        modes = _shifted_modes(mass, stiffness, modes.omega[modes.rigid] ** 2) or modes
    return _with_exact_soft_modes(mass, stiffness, modes)


def indefinite(stiffness: Any, lowest: str, is_small: bool) -> MultiPhiValueError:
    """Return the error for an indefinite K, with its digits where they may be the cause, as ``lowest`` is small."""
    digits, rounded = digits_of(stiffness), ""
    if is_small:
        rounded = ", with all its digits if this one was rounded"
        rounded = rounded if digits is None else f" with more than the {digits.name} of this one"
    return MultiPhiValueError(
        f"stiffness: indefinite, lowest eigenvalue omega^2 {lowest}; need a positive semidefinite matrix{rounded}"
    )


def _with_exact_soft_modes(mass: np.ndarray, stiffness: np.ndarray, modes: Modes) -> Modes:
    """Return the modes with soft ones, beside stiff springs, to the relative accuracy of the others.

    The factor of K has lost them to round-off of the stiff springs, which a K of exact numbers does not have.
    """
    if not is_exact(stiffness) or digits_of(stiffness) is not None:
        return modes
    modes = _with_soft_ones_among_rigid(stiffness, modes)
    squares, energies = modes.omega**2, round_off_energy(stiffness, modes.shapes)
    count = modes.rigid + int(np.sum(energies[modes.rigid :] > SOFT * squares[modes.rigid :]))
    while modes.rigid < count < modes.count and squares[count - 1] > ALONE * squares[count]:
        count += 1
    if count == modes.rigid:
        return modes
    own, further = slice(modes.rigid, count), slice(count, None)
    shapes = modes.shapes[:, own]
    for _ in range(REFINEMENTS):
        forces = modes.shapes.T @ doubled_product(stiffness, shapes)
        shapes = shapes - modes.shapes[:, further] @ (
            forces[further] / (squares[further, None] - np.diagonal(forces[own]))
        )
        upper = scipy.linalg.cholesky(shapes.T @ (mass @ shapes))
        shapes = scipy.linalg.solve_triangular(upper, shapes.T, trans="T").T
    projected = shapes.T @ doubled_product(stiffness, shapes)
    scales = np.sqrt(np.diagonal(projected))
    omega, rotation = right_singular_vectors(scipy.linalg.cholesky(projected / np.outer(scales, scales)) * scales)
    return Modes(
        np.concatenate([modes.omega[: modes.rigid], omega, modes.omega[further]]),
        np.hstack([modes.shapes[:, : modes.rigid], shapes @ rotation, modes.shapes[:, further]]),
        modes.rigid,
    )


def _with_soft_ones_among_rigid(stiffness: np.ndarray, modes: Modes) -> Modes:
    """Return the modes with a frequency for those without one whose exact strain energy is not zero."""
    own = modes.shapes[:, : modes.rigid]
    squares, rotation = scipy.linalg.eigh(own.T @ doubled_product(stiffness, own))
    highest = float(modes.omega[-1]) ** 2  # of the modes that the round-off of a shape consists of
    none = NO_ENERGY * max(ROUND_OFF * highest, np.max(round_off_energy(stiffness, own), initial=0.0))
    if np.any(squares < -none):
        raise indefinite(stiffness, f"= {squares[0]:g}", is_small=False)
    soft = squares > none
    omega, shapes = modes.omega.copy(), modes.shapes.copy()
    omega[: modes.rigid], shapes[:, : modes.rigid] = np.sqrt(np.where(soft, squares, 0.0)), own @ rotation
    return Modes(omega, shapes, modes.rigid - int(np.sum(soft)))


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


def aligned_modes(
    squares: np.ndarray, shapes: np.ndarray, rows: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return omega^2 (m,), modes (n, m) and the values of rows in them (k, m), the same on every processor.

    Signs, and bases of clusters of equal omega^2, are made unique. squares: ascending. rows: (k, n), followed by the
    coordinates themselves. sizes: (k + n,), their largest values in a mode of unit length. In a cluster the first row
    with a value has it in the first mode only; among the other modes the first row with a value has it in the first of
    these only, and so on; the omega^2 are replaced by their mean. The first row with a value in a mode has a positive
    one.
    """
    squares, modes, values = core.aligned_modes(squares, shapes.T, rows, sizes)
    return squares, np.ascontiguousarray(modes.T), values


def _shifted_modes(mass: np.ndarray, stiffness: np.ndarray, shift: float) -> Modes | None:
    """Return the modes from K + shift M; None where it is not positive definite."""
    try:
        lower = scipy.linalg.cholesky(mass, lower=True)
    except scipy.linalg.LinAlgError as error:
        raise not_definite(mass) from error
    try:
        upper = scipy.linalg.cholesky(stiffness + shift * mass)
    except scipy.linalg.LinAlgError:
        return None
    product = scipy.linalg.solve_triangular(lower, upper.T, lower=True).T
    singular, vectors = right_singular_vectors(product)
    shapes = scipy.linalg.solve_triangular(lower, vectors, lower=True, trans="T")
    return modes_from_squares(stiffness, singular**2 - shift, shapes, shift)


def modes_from_squares(stiffness: Any, omega_squared: np.ndarray, shapes: np.ndarray, shift: float) -> Modes:
    """Return modes from omega^2; those without strain energy become rigid-body modes with omega = 0.

    shift: subtracted before to get omega_squared, which has its round-off.
    """
    rigid = rigid_modes(stiffness, omega_squared, shapes, shift)
    order = np.argsort(np.where(rigid, 0.0, omega_squared), kind="stable")
    omega = np.sqrt(np.where(rigid, 0.0, omega_squared))[order]
    return Modes(omega, np.ascontiguousarray(shapes[:, order]), int(np.sum(rigid)))


def rigid_modes(stiffness: Any, squares: np.ndarray, shapes: np.ndarray, shift: float = 0.0) -> np.ndarray:
    """Return which modes (m,) are rigid-body modes: without strain energy, but for round-off and the digits of K.

    What few digits leave open of omega^2 has to lie far below the first elastic one. squares: omega^2 (m,), with the
    round-off of ``shift``.
    """
    sizes = round_off_energy(stiffness, shapes)
    rigid = np.asarray(squares <= sizes + ROUND_OFF * shift)
    digits = digits_of(stiffness)
    if digits is None:
        return rigid
    noise = np.zeros(len(squares))
    low = np.flatnonzero(squares <= FEWEST_DIGITS / ROUND_OFF * sizes)
    noise[low] = energy_noise(stiffness, shapes[:, low], digits)
    without = rigid | (squares <= noise)
    is_far = np.max(noise[without], initial=0.0) <= FAR * np.min(squares[~without], initial=np.inf)
    return without if is_far else rigid


def round_off_energy(stiffness: Any, shapes: np.ndarray) -> np.ndarray:
    magnitudes = np.abs(shapes)
    return ROUND_OFF * np.einsum("ij,ij->j", magnitudes, abs(stiffness) @ magnitudes)


def first_shift(mass: Any, stiffness: Any) -> float:
    """Return the shift s with which K + s M is definite where K is, but for rigid-body modes."""
    return _largest(mass, stiffness) * (FIRST_SHIFT if digits_of(stiffness) is None else FEW_DIGITS_SHIFT)


def _largest(mass: Any, stiffness: Any) -> float:
    """Return the largest K_ii / M_ii, 1 for zero stiffness, for which any shift is good."""
    return float(np.max(stiffness.diagonal() / mass.diagonal())) or 1.0
