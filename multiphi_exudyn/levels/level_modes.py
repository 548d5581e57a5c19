"""Modes of a level: omega^2 and shapes of the base's stiffness with closed contacts added.

The omega of springs K > 0 are singular values of [diag(Omega) Z; sqrt(K) P^T Z], Z an orthonormal null space of the
rigid contacts: as accurate as the base's own (see modes.py). Springs K < 0 follow on these modes,
w = sqrt|K| Phi^T p, as

    omega^2 + mu - W W^T = (R B)^T R B,   B = diag(omega^2 + mu)^1/2,   R^T R = I - (B^-1 W)(B^-1 W)^T

again by singular values; mu = 0 unless the level is indefinite or nearly so.

Where one direction alone is closed, with K > 0, the lowest modes are those of a rank-one change, roots of its secular
equation (secular_equation.py). Where a quarter of the modes or fewer are asked for otherwise, in a base without
rigid-body modes and with no K < 0, they are the largest eigenvectors of the level's compliance, a matrix of rank d away
from the base's,

    A = Omega^-2 - Omega^-2 P (1/K + P^T Omega^-2 P)^-1 P^T Omega^-2            (rigid: 1/K = 0)

and their omega the singular values in the space of these few: the cost is that of a few vectors, the accuracy stays. In
a large base they come from Lanczos iterations, and Sylvester's law of inertia says whether none is missing: below sigma
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

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.closed_directions import ClosedDirections
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.eigenproblems.modes import right_singular_vectors
from multiphi_exudyn.mathematics.eigenproblems.secular_equation import rank_one_modes

__all__ = ["level_modes"]

NEARLY_INDEFINITE = 0.5  # share of a stiffness that negative springs may take before mu is needed
FEW = 4  # modes of the base for each mode asked for: from there on the compliance is the cheaper way to them
ROOTED = 50  # modes of a base from which roots of the secular equation are cheaper than all singular values
LARGE = 150  # modes of a base from which iterations are the cheaper way to the few
ORTHOGONAL = 1e-12  # product of two modes, above which they are taken anew from what they span
ORTHONORMAL = 1e-10  # |Phi^T M Phi - I| a level may show
APART = 1e-6  # relative distance of two compliances at least, to count what lies beyond the middle between them


def level_modes(
    base: ModalBase, closed_directions: ClosedDirections, modes: int | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """omega^2 ascending, modes (m, r), the lowest ``modes`` at least or all, and the mu that limits their accuracy.

    Raises NumericalFailure where they are not orthogonal.
    """
    if not closed_directions.members:
        return base.squares[:modes].copy(), np.eye(modes or base.modes.count, base.modes.count).T, 0.0
    found = _found(base, closed_directions, modes)
    error = _error(found[1])
    if error > ORTHOGONAL:
        found = _modes(base, closed_directions, np.linalg.qr(found[1])[0])
        error = _error(found[1])
    if not error <= ORTHONORMAL:
        raise NumericalFailure(
            f"level: its modes are not accurate (mass normalisation off by {error:g}); are units and magnitudes of "
            "mass and stiffness right?"
        )
    return found


def _found(
    base: ModalBase, closed_directions: ClosedDirections, modes: int | None
) -> tuple[np.ndarray, np.ndarray, float]:
    """``level_modes`` of closed directions by the way that costs least."""
    if modes is not None and base.modes.count >= ROOTED:
        found = _rank_one(base, closed_directions, modes)
        if found is not None:
            return found
    if modes is not None and _few(base, closed_directions, modes):
        return _lowest(base, closed_directions, modes)
    return _modes(base, closed_directions, _null_space(closed_directions.vectors[:, closed_directions.rigid]))


def _error(vectors: np.ndarray) -> float:
    """The largest number in Phi^T Phi - 1."""
    products = vectors.T @ vectors
    products -= _one(len(products))
    return float(np.abs(products, out=products).max(initial=0.0))


@functools.lru_cache(maxsize=64)
def _one(count: int) -> np.ndarray:
    return np.eye(count)


def _rank_one(
    base: ModalBase, closed_directions: ClosedDirections, modes: int
) -> tuple[np.ndarray, np.ndarray, float] | None:
    """``_modes``, the lowest ones only, where they are those of a rank-one change."""
    sprung = [(j, k) for j, k in enumerate(closed_directions.stiffness.tolist()) if k]
    if len(sprung) != 1 or sprung[0][1] < 0:
        return None
    j, stiffness = sprung[0]
    along = closed_directions.vectors[:, j]
    found = rank_one_modes(base.squares, along, stiffness, modes)
    if found is None:
        return None
    squares, vectors = found
    if math.isinf(stiffness):
        vectors -= np.outer(along @ vectors, along / (along @ along)).T  # as the vectors stand in memory
    return squares, vectors, 0.0


def _modes(
    base: ModalBase, closed_directions: ClosedDirections, free: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """omega^2 ascending, modes (m, r) in the motions ``free`` (m, r), and the mu that limits their accuracy."""
    directions, stiffness = closed_directions.vectors, closed_directions.stiffness
    stiffening, softening = (stiffness > 0) & ~closed_directions.rigid, stiffness < 0
    springs = np.sqrt(stiffness[stiffening])[:, None] * (directions[:, stiffening].T @ free)
    omega, rotation = right_singular_vectors(np.vstack([base.modes.omega[:, None] * free, springs]))
    squares, vectors = omega**2, free @ rotation
    if not np.any(softening):
        return squares, vectors, 0.0
    return _softened(squares, vectors, (vectors.T @ directions[:, softening]) * np.sqrt(-stiffness[softening]))


def _few(base: ModalBase, closed_directions: ClosedDirections, modes: int) -> bool:
    """Whether the compliance gives that many modes cheaply."""
    left = base.modes.count - int(np.sum(closed_directions.rigid))
    few = modes <= left and FEW * modes <= base.modes.count
    return few and not base.modes.rigid and bool(np.all(closed_directions.stiffness >= 0))


def _lowest(base: ModalBase, closed_directions: ClosedDirections, modes: int) -> tuple[np.ndarray, np.ndarray, float]:
    """``_modes``, the lowest ones only, by way of the level's compliance."""
    sprung = closed_directions.stiffness != 0
    directions, stiffness = closed_directions.vectors[:, sprung], closed_directions.stiffness[sprung]
    compliance = base.modes.omega**-2.0
    lengths = np.linalg.norm(directions / base.modes.omega[:, None], axis=0)
    bent = compliance[:, None] * directions / lengths
    flexibility = directions.T @ bent / lengths[:, None] + np.diag(1 / stiffness / lengths**2)
    taken = scipy.linalg.solve_triangular(np.linalg.cholesky(flexibility), bent.T, lower=True)
    vectors = None
    if base.modes.count >= LARGE:
        scaled, yielding = directions / lengths, 1 / stiffness / lengths**2
        vectors = _iterated(base.squares, scaled, yielding, taken, modes)
    if vectors is None:
        vectors = _of_all(compliance, taken, modes)
    pinned = directions[:, np.isinf(stiffness)]
    if pinned.shape[1]:
        held = np.linalg.qr(pinned)[0]
        vectors = vectors - held @ (held.T @ vectors)
    return _modes(base, closed_directions, np.linalg.qr(vectors)[0])


def _of_all(compliance: np.ndarray, taken: np.ndarray, modes: int) -> np.ndarray:
    """The largest eigenvectors (m, modes) of A = diag(compliance) - taken^T taken, from all of A.

    To divide and conquer, which gives them all, costs less than to iterate for a quarter of them.
    """
    own = -(taken.T @ taken)
    own.flat[:: len(own) + 1] += compliance
    return np.linalg.eigh(own)[1][:, len(own) - modes :]


def _iterated(
    squares: np.ndarray, directions: np.ndarray, yielding: np.ndarray, taken: np.ndarray, modes: int
) -> np.ndarray | None:
    """``_of_all`` by Lanczos iterations, None where some may be missing.

    squares: Omega^2 (m,). directions, yielding: P (m, d) and 1/K (d,), both in units that make P^T Omega^-2 P one.
    """
    count = len(squares)
    operator = scipy.sparse.linalg.LinearOperator(
        (count, count), lambda x: x / squares - taken.T @ (taken @ x), dtype=float
    )
    start = np.random.default_rng(0).uniform(-1, 1, count)  # a start with a symmetry would not see all modes
    try:
        found, vectors = scipy.sparse.linalg.eigsh(operator, modes + 1, which="LA", v0=start)
    except scipy.sparse.linalg.ArpackError:
        return None
    if not found[0] < (1 - APART) * found[1]:
        return None
    shifted = squares - 2 / (found[0] + found[1])
    lifted = np.linalg.eigvalsh(directions.T @ (directions / shifted[:, None]) + np.diag(yielding)) <= 0
    return vectors[:, 1:] if np.sum(shifted < 0) - np.sum(lifted) == modes else None


def _softened(squares: np.ndarray, vectors: np.ndarray, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """``_modes`` of diag(squares) - W W^T, W = ``pull`` (r, s)."""
    shift = 0.0 if _share(squares, pull) <= NEARLY_INDEFINITE else 2 * float(np.linalg.norm(pull, 2)) ** 2
    while shift and _share(squares + shift / 2, pull) <= NEARLY_INDEFINITE:
        shift /= 2
    root = np.sqrt(squares + shift)
    left, taken, _ = np.linalg.svd(_divided(pull, root), full_matrices=False)
    factor = np.diag(root) - (left * (1 - np.sqrt(1 - taken**2))) @ (left.T * root)
    omega, rotation = right_singular_vectors(factor)
    return (omega - math.sqrt(shift)) * (omega + math.sqrt(shift)), vectors @ rotation, shift


def _share(squares: np.ndarray, pull: np.ndarray) -> float:
    """Largest eigenvalue of B^-1 W W^T B^-1, B^2 = diag(squares): above 1 negative springs win."""
    if np.any((squares <= 0)[:, None] & (pull != 0)):
        return math.inf
    return float(np.linalg.norm(_divided(pull, np.sqrt(squares)), 2)) ** 2


def _divided(pull: np.ndarray, root: np.ndarray) -> np.ndarray:
    return pull / np.where(root > 0, root, 1.0)[:, None]


def _null_space(pinned: np.ndarray) -> np.ndarray:
    """Orthonormal basis (m, m - c) of the motions that leave the gaps of rigid contacts (m, c) unchanged."""
    if pinned.shape[1] == 0:
        return np.eye(len(pinned))
    return np.asarray(scipy.linalg.qr(pinned)[0][:, pinned.shape[1] :])
