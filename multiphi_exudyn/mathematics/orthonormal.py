"""Orthonormal vectors, and what a few directions leave of others."""

from __future__ import annotations

import numpy as np

import multiphi_exudyn._core as core

__all__ = ["product_error", "without"]


def without(directions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the part of vectors (m, ...) that is orthogonal to directions (m, k), column by column in memory."""
    columns = vectors.T if vectors.ndim == 2 else vectors[None]
    result = core.without(directions.T, columns).T
    return result if vectors.ndim == 2 else result[:, 0]


def product_error(vectors: np.ndarray) -> float:
    """Return the largest element of |V^T V - I|, V (m, r)."""
    return float(core.largest_product_error(vectors.T))
