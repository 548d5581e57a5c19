"""A few directions: an orthonormal basis of them, and what they have in vectors. Of a single one both are quotients."""

from __future__ import annotations

import numpy as np

__all__ = ["least_squares", "orthonormal"]


def orthonormal(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Q (m, k) and R (k, k), upper triangular, of directions Q R (m, k); one that is zero stays."""
    if directions.shape[1] != 1:
        q, r = np.linalg.qr(directions)
        return q, r
    length = np.linalg.norm(directions)
    return directions / (length or 1.0), np.array([[length]])


def least_squares(directions: np.ndarray, given: np.ndarray) -> np.ndarray:
    """X (k, j), the smallest, for which directions X is nearest to what is given; directions: (m, k), given: (m, j)."""
    if directions.shape[1] != 1:
        return np.asarray(np.linalg.lstsq(directions, given, rcond=None)[0])
    square = float(directions[:, 0] @ directions[:, 0])
    return np.asarray(directions.T @ given / (square or np.inf))
