"""Moved directions: those in which forces can move a linearised system; a model may leave out the others.

    span Q = span (P, A P, A A P, ...) for A = K and A = C, in coordinates of unit mass

A mass on a compressed spring is unstable sideways, and a body that spins about one axis has gyroscopic forces about the
others. Neither moves in these directions without a force there, in Exudyn's own run too. P (n, k) [N, N m] are all
possible forces: present forces, momenta, contacts and loads, in the coordinates z (n,) of the free directions. The
Krylov space is computed in the modes of the symmetric part of K, where round-off of a stiff mode does not affect a soft
one.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

__all__ = ["moved_directions"]

NEGLIGIBLE = 1e-7  # of a vector, or of the largest of C or omega^2: error of numerical differentiation
RIGID = 1e-12  # of the largest omega^2: a smaller one is round-off
ROUND_OFF = 1e-12  # of a unit direction


def moved_directions(
    mass: np.ndarray, stiffness: np.ndarray, damping: np.ndarray, forces: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Q (n, m), orthonormal, and U (n, n - m) of unit mass, Q.M U = 0; None if all directions are moved, or none.

    forces (k, n): P^T.
    """
    squares, shapes = scipy.linalg.eigh((stiffness + stiffness.T) / 2, mass)
    fastest = float(np.max(np.abs(squares)))
    squares = np.where(np.abs(squares) <= RIGID * fastest, 0.0, squares)
    skew, modal_damping = shapes.T @ (stiffness - stiffness.T) @ shapes / 2, shapes.T @ damping @ shapes
    systems = [
        np.diag(squares) + _drop_small(skew, NEGLIGIBLE * fastest),
        _drop_small(modal_damping, NEGLIGIBLE * float(np.max(np.abs(modal_damping), initial=0.0))),
    ]
    moved, candidates = np.zeros((len(mass), 0)), shapes.T @ forces.T
    while candidates.shape[1] and moved.shape[1] < len(mass):
        new = _new_directions(moved, candidates)
        moved, candidates = np.hstack([moved, new]), np.hstack([system @ new for system in systems])
    if moved.shape[1] in (0, len(mass)):
        return None
    others = shapes @ scipy.linalg.null_space(moved.T)
    return _drop_small(scipy.linalg.null_space((mass @ others).T), ROUND_OFF), others


def _drop_small(values: np.ndarray, smallest: float) -> np.ndarray:
    return np.where(np.abs(values) > smallest, values, 0.0)


def _new_directions(basis: np.ndarray, candidates: np.ndarray) -> np.ndarray:
    """Orthonormal directions (n, k) of the candidates' columns that are independent of an orthonormal basis."""
    new = basis[:, :0]
    for candidate in candidates.T:
        present, size = np.hstack([basis, new]), float(np.linalg.norm(candidate))
        column = _drop_small(candidate, NEGLIGIBLE * size)
        independent = column - present @ (present.T @ column)
        independent -= present @ (present.T @ independent)
        length = float(np.linalg.norm(independent))
        if length > NEGLIGIBLE * size:
            new = np.hstack([new, _drop_small(independent / length, ROUND_OFF)[:, None]])
    return new
