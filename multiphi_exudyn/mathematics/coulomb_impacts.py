"""All solutions of Coulomb's law for an impact of k contacts, each with one tangential direction.

    u+ = u + W p,   0 <= p_n, u_n+ >= 0, complementary;   |p_t| <= mu p_n, against u_t+;   W = A A^T

A (2k, r): two rows of every contact, normal to its stop and tangential. A contact opens, slides in either direction or
sticks, each with two linear equations: there are 4^k pieces. W is positive definite, so that the solution without
friction is unique, and for u = 0 p = 0 is the only solution for any mu: as mu grows, the signs of the determinants of
all solutions for one u still add up to one. So if no piece has a negative determinant the solution is unique for every
u, and if one has, there are three or more for some u. For one contact that is h.M^-1 (h - s mu h_t) < 0.

Source: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 6 (degree).
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.round_off import INDEPENDENT

__all__ = ["CoulombImpact"]

MOST = 4096  # pieces that are checked: six contacts with friction
ADMITTED = 1e-9  # of the largest speed: allowed violation of the law by a solution
APART = 1e-6  # of the largest speed: closer solutions are the same


@dataclass(frozen=True)
class CoulombImpact:
    """Closed contacts: normal and tangential rows (k, 2, r), friction coefficients mu (k,), zero without friction."""

    rows: np.ndarray
    ratios: np.ndarray

    @property
    def tried(self) -> bool:
        """Whether there are few enough pieces to check all of them."""
        rough = np.count_nonzero(self.ratios)
        return bool(4**rough * 2 ** (len(self.ratios) - rough) <= MOST)

    @functools.cached_property
    def is_unique(self) -> bool:
        """Whether the solution is unique for all speeds; with too many pieces, whether a sufficient condition holds.

        It is |A_t^T mu z| < |A^T z| for all z: then W is positive definite for all sliding contacts.
        """
        if self.tried:
            return bool(np.min(np.linalg.det(self._pieces)) >= -INDEPENDENT)
        along = np.linalg.norm(self._limits[:, None] * self._units[1::2], 2)
        return bool(along**2 < np.linalg.eigvalsh(self._mobility)[0])

    def answers(self, speeds: np.ndarray) -> int:
        """Return the number of solutions for speeds (k, 2), without those of redundant contacts."""
        before = (speeds / self._lengths).ravel()
        size, solutions = float(np.max(np.abs(before))), list[np.ndarray]()
        solvable = np.abs(np.linalg.det(self._pieces)) > INDEPENDENT
        pieces, is_speed = self._pieces[solvable], self._is_speed[solvable]
        impulses = np.linalg.solve(pieces, np.where(is_speed, -before, 0.0)[..., None])[..., 0]
        after = before + impulses @ self._mobility
        (p, q), (u, v) = ((values[:, 0::2], values[:, 1::2]) for values in (impulses, after))
        worst = np.minimum(np.minimum(p, u), self._limits * p - np.abs(q))
        worst = np.minimum(worst, np.where(self._shares[solvable] != 0, np.sign(self._shares[solvable]) * v, 0.0))
        for speeds_after in after[np.min(worst, axis=1) >= -ADMITTED * size]:
            if all(np.max(np.abs(speeds_after - other)) > APART * size for other in solutions):
                solutions.append(speeds_after)
        return len(solutions)

    @functools.cached_property
    def _lengths(self) -> np.ndarray:
        """Lengths (k, 2) of the rows, 1 for zero rows."""
        lengths = np.linalg.norm(self.rows, axis=2)
        return np.where(lengths > 0, lengths, 1.0)

    @functools.cached_property
    def _units(self) -> np.ndarray:
        """The rows (2k, r) as unit vectors."""
        return (self.rows / self._lengths[..., None]).reshape(2 * len(self.ratios), -1)

    @functools.cached_property
    def _limits(self) -> np.ndarray:
        """Friction coefficients (k,) between impulses along unit vectors."""
        return np.asarray(self.ratios * self._lengths[:, 1] / self._lengths[:, 0])

    @functools.cached_property
    def _mobility(self) -> np.ndarray:
        return self._units @ self._units.T

    @functools.cached_property
    def _options(self) -> list[list[tuple[bool, bool, float]]]:
        """For every contact its states: whether its two speeds are zero, and s mu where it slides with s."""
        smooth = [(False, False, 0.0), (True, False, 0.0)]
        rough = [[(False, False, 0.0), (True, False, mu), (True, False, -mu), (True, True, 0.0)] for mu in self._limits]
        return [own if mu else smooth for own, mu in zip(rough, self._limits, strict=True)]

    @functools.cached_property
    def _is_speed(self) -> np.ndarray:
        """Whether an equation of a piece prescribes a speed (m, 2k)."""
        return np.array([[given for own in piece for given in own[:2]] for piece in itertools.product(*self._options)])

    @functools.cached_property
    def _shares(self) -> np.ndarray:
        """s mu (m, k) of sliding contacts in every piece, zero for others."""
        return np.array([[own[2] for own in piece] for piece in itertools.product(*self._options)])

    @functools.cached_property
    def _pieces(self) -> np.ndarray:
        """Equations of impulses (m, 2k, 2k) of every piece: a speed of zero, or p_t + s mu p_n = 0, or p = 0."""
        equations = np.tile(np.eye(2 * len(self.ratios)), (len(self._is_speed), 1, 1))
        places = 2 * np.arange(len(self.ratios))
        equations[:, places + 1, places] = self._shares
        return np.where(self._is_speed[..., None], self._mobility, equations)
