"""Vectors that are orthonormal in the inner product of a matrix A, and Ritz modes in their space."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import scipy.linalg

__all__ = ["Vectors", "orthonormal_complement", "ritz"]

DEPENDENT = 1e-12  # of a vector's square: a smaller remainder beside others is round-off
Vectors: TypeAlias = tuple[np.ndarray, np.ndarray]  # shapes C (n, k), C^T A C = I, and A C


def orthonormal_complement(block: Vectors, others: Vectors) -> Vectors:
    """Return A-orthonormal vectors of the space of a block, orthogonal to others; dependent ones are dropped."""
    shapes, images = block
    for _ in range(2):
        components = others[1].T @ shapes
        shapes, images = shapes - others[0] @ components, images - others[1] @ components
    for _ in range(2):  # once more: orthonormal to round-off
        products = shapes.T @ images
        squares, rotation = scipy.linalg.eigh((products + products.T) / 2)
        rotation = rotation[:, squares > DEPENDENT] / np.sqrt(squares[squares > DEPENDENT])
        shapes, images = shapes @ rotation, images @ rotation
    return shapes, images


def ritz(mass: Any, shapes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the eigenvalues of A (k,) in the space of A-orthonormal shapes, and the rotation (k, k) to its modes."""
    inverse, rotation = scipy.linalg.eigh(shapes.T @ (mass @ shapes))
    return 1 / inverse, rotation / np.sqrt(inverse)
