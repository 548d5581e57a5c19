"""Modes of a level: omega^2 and shapes of the base's stiffness with closed contacts added.

The omega of springs K > 0 are singular values of [diag(Omega) Z; sqrt(K) P^T Z], Z an orthonormal null space of the
rigid contacts: as accurate as those of the base (modes.py). Springs K < 0 follow on these modes,
w = sqrt|K| Phi^T p, as

    omega^2 + mu - W W^T = (R B)^T R B,   B = diag(omega^2 + mu)^1/2,   R^T R = I - (B^-1 W)(B^-1 W)^T

again by singular values; mu = 0 unless the level is indefinite or nearly so.

Where one direction alone is closed, with K > 0, the lowest modes are those of a rank-one change, roots of its secular
equation (core/secular_equation.hpp); a few directions are as many such changes. Otherwise, for a quarter of the modes
or fewer, in a base without rigid-body modes and with no K < 0, they are the largest eigenvectors of the level's
compliance, which differs from that of the base by a matrix of rank d,

    A = Omega^-2 - Omega^-2 P (1/K + P^T Omega^-2 P)^-1 P^T Omega^-2            (rigid: 1/K = 0)

and their omega the singular values in the space of these few: the cost is that of a few vectors, the accuracy stays. In
a large base they come from Lanczos iterations, and Sylvester's law of inertia shows whether one is missing: below sigma
a level has

    #(Omega^2 < sigma) - #(eigenvalues <= 0 of 1/K + P^T (Omega^2 - sigma)^-1 P)

modes.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import scipy.linalg
import scipy.sparse.linalg

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.closed_directions import ClosedDirections
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.modes import right_singular_vectors
from multiphi_exudyn.mathematics.orthonormal import product_error, without

__all__ = ["level_modes"]

NEARLY_INDEFINITE = 0.5  # share of a stiffness that negative springs may take before mu is needed
FEW = 4  # modes of the base for each requested mode, from which the compliance matrix is cheaper
CHANGES = 130_000  # (d - 1) m^2, up to which d rank-one changes in a base of m modes cost less than iterations
SECULAR = 50  # modes of a base from which roots of the secular equation are cheaper than all singular values
LARGE = 150  # modes of a base, from which Lanczos iterations of the compliance matrix are cheaper
ORTHOGONAL = 1e-12  # product of two modes, above which they are recomputed in the space that they span
ORTHONORMAL = 1e-10  # largest allowed |Phi^T M Phi - I| of a level
APART = 1e-6  # least relative distance of two compliances between which modes can be counted reliably


def level_modes(
    base: ModalBase, closed_directions: ClosedDirections, modes: int | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return omega^2 ascending, modes (m, r), the lowest ``modes`` at least or all, and mu, which limits the accuracy.

    Raises NumericalFailure where the modes are not orthogonal.
    """
    if not closed_directions.members:
        return base.squares[:modes].copy(), np.eye(modes or base.modes.count, base.modes.count).T, 0.0
    solution = _cheapest(base, closed_directions, modes)
    error = product_error(solution[1])
    if error > ORTHOGONAL:
        solution = _singular_value_modes(base, closed_directions, np.linalg.qr(solution[1])[0])
        error = product_error(solution[1])
    if not error <= ORTHONORMAL:
        raise NumericalFailure(
            f"level: its modes are not accurate (mass normalisation off by {error:g}); are units and magnitudes of "
            "mass and stiffness right?"
        )
    return solution


def _cheapest(
    base: ModalBase, closed_directions: ClosedDirections, modes: int | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return ``level_modes`` by the cheapest method."""
    if modes is not None and base.modes.count >= SECULAR:
        solution = _rank_one_changes(base, closed_directions, modes)
        if solution is not None:
            return solution
    if modes is not None and _is_compliance_cheaper(base, closed_directions, modes):
        return _compliance_modes(base, closed_directions, modes)
    return _singular_value_modes(base, closed_directions, _null_space(closed_directions.pinned))


def _rank_one_changes(
    base: ModalBase, closed_directions: ClosedDirections, modes: int
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """``_singular_value_modes``, the lowest only, of a few springs and rigid directions, else None.

    Each direction changes the modes that those before it have left, all of which are needed until the last one.
    """
    stiffness = closed_directions.stiffness.tolist()
    sprung = [j for j, k in enumerate(stiffness) if k]
    if not sprung or min(stiffness) < 0 or (len(sprung) - 1) * base.modes.count**2 > CHANGES:
        return None
    squares, changes = base.squares, list[np.ndarray]()
    for j in sprung:
        direction = closed_directions.vectors[:, j]
        for change in changes:
            direction = direction @ change
        count = modes if j == sprung[-1] else len(squares) - math.isinf(stiffness[j])
        solution = core.rank_one_modes(squares, direction, stiffness[j], count)
        if solution is None:
            return None
        squares = solution[0]
        changes.append(solution[1].T)
    if len(changes) == 1:
        return squares, changes[0], 0.0
    vectors = functools.reduce(lambda later, change: change @ later, reversed(changes))
    return squares, without(closed_directions.pinned, vectors) if math.inf in stiffness else vectors, 0.0


def _singular_value_modes(
    base: ModalBase, closed_directions: ClosedDirections, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Return omega^2 ascending, modes (m, r) in the space ``free`` (m, r), and the mu that limits their accuracy."""
    directions, stiffness = closed_directions.vectors, closed_directions.stiffness
    stiffening, softening = (stiffness > 0) & ~closed_directions.rigid, stiffness < 0
    springs = np.sqrt(stiffness[stiffening])[:, None] * (directions[:, stiffening].T @ free)
    omega, rotation = right_singular_vectors(np.vstack([base.modes.omega[:, None] * free, springs]))
    squares, vectors = omega**2, free @ rotation
    if not np.any(softening):
        return squares, vectors, 0.0
    return _softened(squares, vectors, (vectors.T @ directions[:, softening]) * np.sqrt(-stiffness[softening]))


def _is_compliance_cheaper(base: ModalBase, closed_directions: ClosedDirections, modes: int) -> bool:
    """Return whether the compliance matrix is the cheaper way to so many modes."""
    available = base.modes.count - int(np.sum(closed_directions.rigid))
    few = modes <= available and FEW * modes <= base.modes.count
    return few and not base.modes.rigid and bool(np.all(closed_directions.stiffness >= 0))


def _compliance_modes(
    base: ModalBase, closed_directions: ClosedDirections, modes: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """``_singular_value_modes``, the lowest only, from the compliance matrix of the level."""
    sprung = closed_directions.stiffness != 0
    directions, stiffness = closed_directions.vectors[:, sprung], closed_directions.stiffness[sprung]
    compliance = base.modes.omega**-2.0
    lengths = np.linalg.norm(directions / base.modes.omega[:, None], axis=0)
    deflections = compliance[:, None] * directions / lengths
    flexibility = directions.T @ deflections / lengths[:, None] + np.diag(1 / stiffness / lengths**2)
    removed = scipy.linalg.solve_triangular(np.linalg.cholesky(flexibility), deflections.T, lower=True)
    vectors = None
    if base.modes.count >= LARGE:
        scaled, compliances = directions / lengths, 1 / stiffness / lengths**2
        vectors = _lanczos_eigenvectors(base.squares, scaled, compliances, removed, modes)
    if vectors is None:
        vectors = _dense_eigenvectors(compliance, removed, modes)
    pinned = directions[:, np.isinf(stiffness)]
    if pinned.shape[1]:
        vectors = without(pinned, vectors)
    return _singular_value_modes(base, closed_directions, np.linalg.qr(vectors)[0])


def _dense_eigenvectors(compliance: np.ndarray, removed: np.ndarray, modes: int) -> np.ndarray:
    """The largest eigenvectors (m, modes) of A = diag(compliance) - removed^T removed, by a dense solver.

    Divide and conquer, which gives all eigenvectors, costs less than iterations for a quarter of them.
    """
    matrix = -(removed.T @ removed)
    matrix.flat[:: len(matrix) + 1] += compliance
    return np.linalg.eigh(matrix)[1][:, len(matrix) - modes :]


def _lanczos_eigenvectors(
    squares: np.ndarray, directions: np.ndarray, compliances: np.ndarray, removed: np.ndarray, modes: int
) -> np.ndarray | None:
    """``_dense_eigenvectors`` by Lanczos iterations, or None where one may be missing.

    squares: Omega^2 (m,). directions, compliances: P (m, d) and 1/K (d,), scaled such that the
    diagonal of P^T Omega^-2 P is one.
    """
    count = len(squares)
    operator = scipy.sparse.linalg.LinearOperator(
        (count, count), lambda x: x / squares - removed.T @ (removed @ x), dtype=float
    )
    start = np.random.default_rng(0).uniform(-1, 1, count)  # a symmetric start would miss modes
    try:
        values, vectors = scipy.sparse.linalg.eigsh(operator, modes + 1, which="LA", v0=start)
    except scipy.sparse.linalg.ArpackError:
        return None
    if not values[0] < (1 - APART) * values[1]:
        return None
    shifted = squares - 2 / (values[0] + values[1])
    shifted_up = np.linalg.eigvalsh(directions.T @ (directions / shifted[:, None]) + np.diag(compliances)) <= 0
    return vectors[:, 1:] if np.sum(shifted < 0) - np.sum(shifted_up) == modes else None


def _softened(squares: np.ndarray, vectors: np.ndarray, softening: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """``_singular_value_modes`` of diag(squares) - W W^T, W = ``softening`` (r, s)."""
    shift = 0.0 if _share(squares, softening) <= NEARLY_INDEFINITE else 2 * float(np.linalg.norm(softening, 2)) ** 2
    while shift and _share(squares + shift / 2, softening) <= NEARLY_INDEFINITE:
        shift /= 2
    root = np.sqrt(squares + shift)
    directions, singular, _ = np.linalg.svd(_divided(softening, root), full_matrices=False)
    factor = np.diag(root) - (directions * (1 - np.sqrt(1 - singular**2))) @ (directions.T * root)
    omega, rotation = right_singular_vectors(factor)
    return (omega - math.sqrt(shift)) * (omega + math.sqrt(shift)), vectors @ rotation, shift


def _share(squares: np.ndarray, softening: np.ndarray) -> float:
    """Return the largest eigenvalue of B^-1 W W^T B^-1, B^2 = diag(squares): above 1 the stiffness is indefinite."""
    if np.any((squares <= 0)[:, None] & (softening != 0)):
        return math.inf
    return float(np.linalg.norm(_divided(softening, np.sqrt(squares)), 2)) ** 2


def _divided(softening: np.ndarray, root: np.ndarray) -> np.ndarray:
    return softening / np.where(root > 0, root, 1.0)[:, None]


def _null_space(pinned: np.ndarray) -> np.ndarray:
    """Orthonormal basis (m, m - c) of the motions that leave the gaps of rigid contacts (m, c) unchanged."""
    if pinned.shape[1] == 0:
        return np.eye(len(pinned))
    return np.asarray(scipy.linalg.qr(pinned)[0][:, pinned.shape[1] :])
