"""Directions that constraints hold, and those that they leave free.

    M a = force - C^T mu,   C a = held

a (n,) accelerations or any other motion, C (m, n) the Jacobian of the constraints, some of which may say the same, mu
(m,) what they carry, M (n, n) positive definite where the constraints leave the system free.
"""

from __future__ import annotations

import numpy as np
import scipy.linalg

__all__ = ["Directions"]

REDUNDANT = 1e-9  # of a constraint's row: what another constraint leaves of it, if it says the same


class Directions:
    """A QR decomposition of C^T, its rows at unit length."""

    def __init__(self, jacobian: np.ndarray, mass: np.ndarray) -> None:
        self._count = len(jacobian)
        moving = np.any(jacobian, axis=1)  # an inactive constraint has no row
        self._used, self._mass = np.flatnonzero(moving), mass
        held, free = np.zeros((len(mass), 0)), np.eye(len(mass))
        self._triangle = np.zeros((0, 0))
        if len(self._used):
            rows = jacobian[self._used] / np.linalg.norm(jacobian[self._used], axis=1)[:, None]
            q, r, order = scipy.linalg.qr(rows.T, pivoting=True)
            rank = int(np.sum(np.abs(np.diag(r)) > REDUNDANT))
            self._lengths = np.linalg.norm(jacobian[self._used], axis=1)[order[:rank]]
            self._used, self._triangle = self._used[order[:rank]], r[:rank, :rank]
            held, free = q[:, :rank], q[:, rank:]
        self._held, self._free = held, free
        self._own = free.T @ mass @ free

    def size(self, vector: np.ndarray) -> float:
        """|vector|_M."""
        return float(np.sqrt(max(vector @ self._mass @ vector, 0.0)))

    def solved(self, force: np.ndarray, held: np.ndarray) -> np.ndarray:
        """a (n_full,) of M a = force - C^T mu, C a = held."""
        given = np.zeros(len(force))
        if len(self._used):
            values = held[self._used] / self._lengths
            given = self._held @ scipy.linalg.solve_triangular(self._triangle, values, trans="T")
        return np.asarray(given + self._free @ np.linalg.solve(self._own, self._free.T @ (force - self._mass @ given)))

    def carried(self, force: np.ndarray) -> np.ndarray:
        """mu (m,) for held = 0; of constraints that say the same one carries all."""
        found = np.zeros(self._count)
        if len(self._used):
            left = force - self._mass @ self.solved(force, found)
            found[self._used] = scipy.linalg.solve_triangular(self._triangle, self._held.T @ left) / self._lengths
        return found
