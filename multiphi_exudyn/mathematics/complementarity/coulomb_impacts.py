"""All answers of Coulomb's law to an impact of k contacts, each with one direction along which it rubs.

    u+ = u + W p,   0 <= p_n, u_n+ >= 0, complementary;   |p_t| <= mu p_n, against u_t+;   W = A A^T

A (2k, r): two rows of every contact, away from its stop and along it. A contact is left open, slides either way or
sticks, each with two linear equations. W is positive definite, so that there is one answer without friction, and to
u = 0 none but p = 0 whatever mu is: as mu grows, the signs of the determinants of all answers to one u go on adding up
to one. So if the determinant of no piece of the 4^k is negative there is one answer to every u, and if one is, three or
more to some. Of one contact that is h.M^-1 (h - s mu h_t) < 0.

Source: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem, 1992, ch. 6 (degree).
"""

from __future__ import annotations

import functools
import itertools
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT

__all__ = ["CoulombImpact"]

MOST = 4096  # pieces that are tried: of six contacts that rub
ADMITTED = 1e-9  # of the largest speed: by which an answer may violate the law
APART = 1e-6  # of the largest speed: closer answers are one


@dataclass(frozen=True)
class CoulombImpact:
    """Contacts that touch: rows (k, 2, r) away from their stops and along them, ratios mu (k,), zero of smooth ones."""

    rows: np.ndarray
    ratios: np.ndarray

    @property
    def tried(self) -> bool:
        """Whether there are few enough pieces to try them."""
        rough = np.count_nonzero(self.ratios)
        return bool(4**rough * 2 ** (len(self.ratios) - rough) <= MOST)

    @functools.cached_property
    def is_unique(self) -> bool:
        """Whether there is one answer to all speeds; of more pieces than are tried, whether that is sure.

        It is where |A_t^T mu z| < |A^T z| for all z: whatever slides, W is positive definite then.
        """
        if self.tried:
            return bool(np.min(np.linalg.det(self._pieces)) >= -INDEPENDENT)
        along = np.linalg.norm(self._limits[:, None] * self._units[1::2], 2)
        return bool(along**2 < np.linalg.eigvalsh(self._mobility)[0])

    def answers(self, speeds: np.ndarray) -> int:
        """How many there are to speeds (k, 2), those of redundant contacts not counted."""
        before = (speeds / self._lengths).ravel()
        size, found = float(np.max(np.abs(before))), list[np.ndarray]()
        solvable = np.abs(np.linalg.det(self._pieces)) > INDEPENDENT
        pieces, moved = self._pieces[solvable], self._moved[solvable]
        impulses = np.linalg.solve(pieces, np.where(moved, -before, 0.0)[..., None])[..., 0]
        after = before + impulses @ self._mobility
        (p, q), (u, v) = ((given[:, 0::2], given[:, 1::2]) for given in (impulses, after))
        worst = np.minimum(np.minimum(p, u), self._limits * p - np.abs(q))
        worst = np.minimum(worst, np.where(self._shares[solvable] != 0, np.sign(self._shares[solvable]) * v, 0.0))
        for speeds_after in after[np.min(worst, axis=1) >= -ADMITTED * size]:
            if all(np.max(np.abs(speeds_after - other)) > APART * size for other in found):
                found.append(speeds_after)
        return len(found)

    @functools.cached_property
    def _lengths(self) -> np.ndarray:
        """Of the rows (k, 2); one where no mode moves a contact."""
        lengths = np.linalg.norm(self.rows, axis=2)
        return np.where(lengths > 0, lengths, 1.0)

    @functools.cached_property
    def _units(self) -> np.ndarray:
        """The rows (2k, r) as unit vectors."""
        return (self.rows / self._lengths[..., None]).reshape(2 * len(self.ratios), -1)

    @functools.cached_property
    def _limits(self) -> np.ndarray:
        """mu (k,) between impulses along unit vectors."""
        return np.asarray(self.ratios * self._lengths[:, 1] / self._lengths[:, 0])

    @functools.cached_property
    def _mobility(self) -> np.ndarray:
        return self._units @ self._units.T

    @functools.cached_property
    def _options(self) -> list[list[tuple[bool, bool, float]]]:
        """Of every contact: whether its two speeds are zero, and s mu where it slides with s."""
        smooth = [(False, False, 0.0), (True, False, 0.0)]
        rough = [[(False, False, 0.0), (True, False, mu), (True, False, -mu), (True, True, 0.0)] for mu in self._limits]
        return [own if mu else smooth for own, mu in zip(rough, self._limits, strict=True)]

    @functools.cached_property
    def _moved(self) -> np.ndarray:
        """Of every piece (m, 2k): whether an equation is one of speeds."""
        return np.array([[given for own in piece for given in own[:2]] for piece in itertools.product(*self._options)])

    @functools.cached_property
    def _shares(self) -> np.ndarray:
        """Of every piece s mu (m, k) of those that slide with s, zero of others."""
        return np.array([[own[2] for own in piece] for piece in itertools.product(*self._options)])

    @functools.cached_property
    def _pieces(self) -> np.ndarray:
        """Equations of impulses (m, 2k, 2k) of every piece: a speed of zero, or p_t + s mu p_n = 0, or p = 0."""
        equations = np.tile(np.eye(2 * len(self.ratios)), (len(self._moved), 1, 1))
        places = 2 * np.arange(len(self.ratios))
        equations[:, places + 1, places] = self._shares
        return np.where(self._moved[..., None], self._mobility, equations)
