"""Vectors that are orthonormal in the inner product of a matrix A, and the modes in the space of such."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import scipy.linalg

__all__ = ["Vectors", "orthonormal_beside", "ritz"]

DEPENDENT = 1e-12  # of a vector's square: what the others leave of it is round-off below
Vectors: TypeAlias = tuple[np.ndarray, np.ndarray]  # shapes C (n, k), C^T A C = I, and A C


def orthonormal_beside(block: Vectors, others: Vectors) -> Vectors:
    """A-orthonormal vectors of a block beside others; what is round-off of one, or of another, is left out."""
    own, pushed = block
    for _ in range(2):
        taken = others[1].T @ own
        own, pushed = own - others[0] @ taken, pushed - others[1] @ taken
    for _ in range(2):  # once more: orthonormal to round-off
        products = own.T @ pushed
        kept, turn = scipy.linalg.eigh((products + products.T) / 2)
        turn = turn[:, kept > DEPENDENT] / np.sqrt(kept[kept > DEPENDENT])
        own, pushed = own @ turn, pushed @ turn
    return own, pushed


def ritz(mass: Any, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues of A (k,) in the space of A-orthonormal shapes, and the rotation (k, k) to its M-normalised modes."""
    inverse, rotation = scipy.linalg.eigh(shapes.T @ (mass @ shapes))
    return 1 / inverse, rotation / np.sqrt(inverse)
