"""Directions in which a linearised system is moved by what pushes it; a model may be without the others, and says so.

    span Q = span (P, A P, A A P, ...) for A = K and A = C, in coordinates of unit mass

A mass on a compressed spring is unstable sideways, and a body that spins about one axis has gyroscopic forces about the
others; neither moves in these directions as long as nothing pushes it there, in Exudyn's own run too. Pushes P (n, k)
[N, N m] are what can: forces, momenta, contacts, loads. All in the coordinates z (n,) of the free directions; the
search is one in the modes of the symmetric part of K, in which round-off of a stiff mode does not reach a soft one.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

__all__ = ["moved_directions"]

IDLE = 1e-7  # of a vector, or of the largest of C or of omega^2: what differentiating leaves of it where there is none
RIGID = 1e-12  # of the largest omega^2: one that is round-off
ROUND_OFF = 1e-12  # of a unit direction


def moved_directions(
    mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, pushes: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Q (n, m), orthonormal, and U (n, n - m) of unit mass, Q.M U = 0; None if every direction is moved, or none.

    pushes (k, n).
    """
    squares, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    fastest = float(np.max(np.abs(squares)))
    squares = np.where(np.abs(squares) <= RIGID * fastest, 0.0, squares)
    turning, damped = shapes.T @ (stiffness - stiffness.T) @ shapes / 2, shapes.T @ damping @ shapes
    systems = [
        np.diag(squares) + _without(turning, IDLE * fastest),
        _without(damped, IDLE * float(np.max(np.abs(damped), initial=0.0))),
    ]
    found, tried = np.zeros((len(mass), 0)), shapes.T @ pushes.T
    while tried.shape[1] and found.shape[1] < len(mass):
        new = _beside(found, tried)
        found, tried = np.hstack([found, new]), np.hstack([system @ new for system in systems])
    if found.shape[1] in (0, len(mass)):
        return None
    others = shapes @ scipy.linalg.null_space(found.T)
    return scipy.linalg.null_space((mass @ others).T), others


def _without(values: np.ndarray, smallest: float) -> np.ndarray:
    return np.where(np.abs(values) > smallest, values, 0.0)


def _beside(found: np.ndarray, tried: np.ndarray) -> np.ndarray:
    """Orthonormal directions (n, k) of the columns tried that those found, orthonormal too, lack."""
    new = found[:, :0]
    for given in tried.T:
        known, size = np.hstack([found, new]), float(np.linalg.norm(given))
        column = _without(given, IDLE * size)
        left = column - known @ (known.T @ column)
        left -= known @ (known.T @ left)
        rest = float(np.linalg.norm(left))
        if rest > IDLE * size:
            new = np.hstack([new, _without(left / rest, ROUND_OFF)[:, None]])
    return new
