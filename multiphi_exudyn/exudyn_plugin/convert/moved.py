"""Directions in which a linearised system is moved by what pushes it; a model may be without the others, and says so.

    span Q = span (M^-1 P, A M^-1 P, A A M^-1 P, ...) for A = M^-1 K and A = M^-1 C

A mass on a compressed spring is unstable sideways, and a body that spins about one axis has gyroscopic forces about the
others; neither moves in these directions as long as nothing pushes it there, in Exudyn's own run too. Pushes P (n, k)
[N, N m] are what can: forces, momenta, contacts, loads. All in the coordinates z (n,) of the free directions.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

__all__ = ["moved_directions"]

IDLE = 1e-7  # of a vector: what differentiating leaves of it where there is none


def moved_directions(
    mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, pushes: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Q (n, m), orthonormal, and U (n, n - m) of unit mass, Q.M U = 0; None if every direction is moved, or none.

    pushes (k, n).
    """
    lower = np.linalg.cholesky(mass)

    def in_mass(matrix: np.ndarray) -> np.ndarray:
        return np.asarray(scipy.linalg.solve_triangular(lower, matrix, lower=True))

    systems = [in_mass(in_mass(matrix).T).T for matrix in (stiffness, damping)]
    found = np.zeros((len(mass), 0))
    tried = in_mass(pushes.T)
    while tried.shape[1]:
        new = _beside(found, tried)
        found = np.hstack([found, new])
        tried = np.hstack([system @ new for system in systems])
    if found.shape[1] in (0, len(mass)):
        return None
    others = np.linalg.solve(lower.T, scipy.linalg.null_space(found.T))
    return scipy.linalg.null_space((mass @ others).T), others


def _beside(found: np.ndarray, tried: np.ndarray) -> np.ndarray:
    """Orthonormal directions of the columns tried that those found, orthonormal too, lack; (n, k)."""
    new = found[:, :0]
    for column in tried.T:
        known = np.hstack([found, new])
        left = column - known @ (known.T @ column)
        left -= known @ (known.T @ left)
        size = np.linalg.norm(left)
        if size > IDLE * np.linalg.norm(column):
            left = np.where(np.abs(left) > IDLE * size, left, 0.0)
            new = np.hstack([new, (left / np.linalg.norm(left))[:, None]])
    return new
