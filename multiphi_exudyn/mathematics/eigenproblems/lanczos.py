"""Lanczos iterations for the lowest modes of sparse matrices, and the factors that they need."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse
import scipy.sparse.linalg

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.mathematics.eigenproblems.modes import NEAR, ROUND_OFF

__all__ = ["check_mass", "definite_factor", "iterated", "lanczos"]


def definite_factor(matrix: Any) -> Any | None:
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


def check_mass(mass: Any) -> None:
    diagonal = scipy.sparse.diags_array(mass.diagonal())
    if (mass != diagonal).nnz and definite_factor(mass) is None:
        raise MultiPhiValueError("mass: indefinite, need a positive definite matrix")


def lanczos(
    mass: Any, stiffness: Any, count: int, shift: float, answer: Any, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` lowest omega^2, ascending, and their shapes, without a cluster that ``count`` would part.

    answer: to a force, A^-1, or what other modes leave of it. start: (n,), of the iteration.
    """
    values, vectors = iterated(mass, stiffness, count + 1, shift, answer, start)
    apart = np.flatnonzero(np.diff(values) > NEAR * np.abs(values[1:]))
    whole = count >= stiffness.shape[0] - 2  # there is no more to part them from
    kept = count if whole and not apart.size else (apart[-1] + 1 if apart.size else 0)
    return values[:kept], vectors[:, :kept]


def iterated(
    mass: Any,
    stiffness: Any,
    count: int,
    shift: float,
    answer: Any,
    start: np.ndarray,
    tolerance: float = 0.0,
    vectors: int | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` lowest omega^2 that a Lanczos iteration sees, ascending, and their shapes.

    Of modes of one frequency it sees the part of ``start`` (n,) among them; any further one comes of round-off alone.
    tolerance: of omega^2, zero for round-off. vectors: at a time, None for twice as many as are looked for.
    """
    n = stiffness.shape[0]
    operator = scipy.sparse.linalg.LinearOperator((n, n), answer, dtype=float)
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
