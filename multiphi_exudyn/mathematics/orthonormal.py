"""Orthonormal bases of a few directions: a QR factorisation, which of a single direction is a matter of its length."""

from __future__ import annotations

import numpy as np

__all__ = ["orthonormal"]


def orthonormal(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Q (..., m, k) and R (..., k, k), upper triangular, of directions Q R (..., m, k); one that is zero stays."""
    if directions.shape[-1] != 1:
        q, r = np.linalg.qr(directions)
        return q, r
    length = np.sqrt(np.sum(directions * directions, axis=-2, keepdims=True))
    return directions / np.where(length > 0, length, 1.0), length
