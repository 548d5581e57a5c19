"""Orthonormal basis of a few directions, and least squares in them; for a single direction both are quotients."""

from __future__ import annotations

import numpy as np

__all__ = ["least_squares", "orthonormal", "without"]


def orthonormal(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return Q (m, k) and R (k, k), upper triangular, of directions Q R (m, k); a single zero direction stays zero."""
    if directions.shape[1] != 1:
        q, r = np.linalg.qr(directions)
        return q, r
    length = np.linalg.norm(directions)
    return directions / (length or 1.0), np.array([[length]])


def least_squares(directions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the smallest X (k, j) that minimises |directions X - vectors|; directions: (m, k), vectors: (m, j)."""
    if directions.shape[1] != 1:
        return np.asarray(np.linalg.lstsq(directions, vectors, rcond=None)[0])
    square = float(directions[:, 0] @ directions[:, 0])
    return np.asarray(directions.T @ vectors / (square or np.inf))


def without(directions: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the part of vectors (m, ...) that is orthogonal to directions (m, k), column by column in memory."""
    shares = least_squares(directions, vectors)
    removed = np.multiply.outer(shares[0], directions[:, 0]) if len(shares) == 1 else shares.T @ directions.T
    return np.subtract(vectors.T, removed, out=removed).T
