"""Directions that constraints fix, and directions that they leave free.

    M a = force - C^T mu,   C a = prescribed

a (n,) accelerations or any other motion, C (m, n) the Jacobian of the constraints, which may be redundant, mu (m,)
their multipliers, M (n, n) positive definite in the directions that the constraints leave free.
"""

from __future__ import annotations

import functools

import numpy as np
import scipy.linalg

__all__ = ["Directions"]

REDUNDANT = 1e-9  # of a constraint's row: a smaller part that is independent of other constraints is round-off


class Directions:
    """A QR decomposition of C^T, its rows at unit length.

    mass: M (n, n). free (n, k): orthonormal basis of the directions that the constraints leave free. Raises
    numpy.linalg.LinAlgError for matrices that are not finite, and solves for a mass that is not positive definite.
    """

    def __init__(self, jacobian: np.ndarray, mass: np.ndarray) -> None:
        if not (np.all(np.isfinite(jacobian)) and np.all(np.isfinite(mass))):
            raise np.linalg.LinAlgError("got a Jacobian or a mass that is not finite")
        self._count = len(jacobian)
        moving = np.any(jacobian, axis=1)  # an inactive constraint has no row
        self._independent, self.mass = np.flatnonzero(moving), mass
        fixed, free = np.zeros((len(mass), 0)), np.eye(len(mass))
        self._triangle = np.zeros((0, 0))
        if len(self._independent):
            rows = jacobian[self._independent] / np.linalg.norm(jacobian[self._independent], axis=1)[:, None]
            q, r, order = scipy.linalg.qr(rows.T, pivoting=True)
            rank = int(np.sum(np.abs(np.diag(r)) > REDUNDANT))
            self._lengths = np.linalg.norm(jacobian[self._independent], axis=1)[order[:rank]]
            self._independent, self._triangle = self._independent[order[:rank]], r[:rank, :rank]
            fixed, free = q[:, :rank], q[:, rank:]
        self._fixed, self.free = fixed, free

    @functools.cached_property
    def _factor(self) -> tuple[np.ndarray, bool]:
        """Cholesky factor of the mass in the free directions."""
        factor: tuple[np.ndarray, bool] = scipy.linalg.cho_factor(self.free.T @ self.mass @ self.free)
        return factor

    def size(self, vector: np.ndarray) -> float:
        """|vector|_M."""
        return float(np.sqrt(max(vector @ self.mass @ vector, 0.0)))

    def solve(self, force: np.ndarray, prescribed: np.ndarray) -> np.ndarray:
        """Solution a (n,) of M a = force - C^T mu, C a = prescribed."""
        particular = np.zeros(len(force))
        if len(self._independent):
            values = prescribed[self._independent] / self._lengths
            particular = self._fixed @ scipy.linalg.solve_triangular(self._triangle, values, trans="T")
        momenta = self.free.T @ (force - self.mass @ particular)
        if not np.all(np.isfinite(momenta)):
            raise np.linalg.LinAlgError("got forces that are not finite")
        return np.asarray(particular + self.free @ scipy.linalg.cho_solve(self._factor, momenta))

    def multipliers(self, force: np.ndarray) -> np.ndarray:
        """mu (m,) for prescribed = 0; redundant constraints have mu = 0."""
        mu = np.zeros(self._count)
        if len(self._independent):
            reaction = force - self.mass @ self.solve(force, mu)
            values = scipy.linalg.solve_triangular(self._triangle, self._fixed.T @ reaction)
            mu[self._independent] = values / self._lengths
        return mu
