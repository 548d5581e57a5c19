"""Lanczos iterations for the lowest modes of sparse matrices, and the factors that they need."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.eigenproblems.massless_motions import not_definite
from multiphi_exudyn.mathematics.eigenproblems.modes import NEAR, ROUND_OFF

__all__ = ["check_mass", "definite_factor", "lanczos", "lanczos_iteration"]


def definite_factor(matrix: Any) -> Any | None:
    """Return sparse triangular factors of a symmetric matrix, None where it is not positive definite to round-off.

    Pivots are on the diagonal, so that the numbers of their signs are those of the eigenvalues (Sylvester).
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


def check_mass(mass: Any) -> None:
    """Raise MultiPhiValueError for a sparse mass that is not positive definite."""
    diagonal = scipy.sparse.diags_array(mass.diagonal())
    if (mass != diagonal).nnz and definite_factor(mass) is None:
        raise not_definite(mass)


def lanczos(
    mass: Any, stiffness: Any, count: int, shift: float, solve: Any, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ``count`` lowest omega^2, ascending, and their shapes, without a cluster that ``count`` would part.

    solve: A^-1 times a vector, or its part beside other modes. start: (n,), of the iteration.
    """
    values, vectors = lanczos_iteration(mass, stiffness, count + 1, shift, solve, start)
    gaps = np.flatnonzero(np.diff(values) > NEAR * np.abs(values[1:]))
    is_complete = count >= stiffness.shape[0] - 2  # no further modes to part them from
    size = count if is_complete and not gaps.size else (gaps[-1] + 1 if gaps.size else 0)
    return values[:size], vectors[:, :size]


def lanczos_iteration(
    mass: Any,
    stiffness: Any,
    count: int,
    shift: float,
    solve: Any,
    start: np.ndarray,
    tolerance: float = 0.0,
    vectors: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the ``count`` lowest omega^2 of a Lanczos iteration, ascending, and their shapes.

    Of modes of one frequency it finds the component of ``start`` (n,) in their space; others appear by round-off only.
    tolerance: of omega^2, zero for round-off. vectors: size of the Krylov space, None for twice ``count``.
    """
    n = stiffness.shape[0]
    operator = scipy.sparse.linalg.LinearOperator((n, n), solve, dtype=float)
    try:
        values, shapes = scipy.sparse.linalg.eigsh(
            stiffness,
            count,
            mass,
            sigma=-shift,
            OPinv=operator,
            v0=start,
            tol=tolerance,
            ncv=None if vectors is None else min(vectors, n),
        )
    except scipy.sparse.linalg.ArpackError as error:
        raise NumericalFailure(f"modes: Lanczos iteration for {count} of {n} modes failed: {error}") from error
    order = np.argsort(values)
    return values[order], shapes[:, order]
