"""Closed directions: the springs and rigid constraints that closed contacts make, one for each direction.

Closed springs of one direction p, the chain of a force law or compliant contacts at one place, are one spring
K q + G, q = p.y; beside a closed rigid contact of that direction they are a constant force.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

__all__ = ["ClosedDirections"]


@dataclass(frozen=True)
class ClosedDirections:
    """One spring or rigid constraint for each of the d directions p of closed contacts.

    members: the contacts of each direction. vectors: p (m, d). stiffness: K (d,) [N/m], inf where rigid.
    offsets: (d,) G / K [m], the gap of a single contact; G [N] where K is zero.
    """

    members: tuple[tuple[int, ...], ...]
    vectors: np.ndarray
    stiffness: np.ndarray
    offsets: np.ndarray

    @functools.cached_property
    def rigid(self) -> np.ndarray:
        """Whether each direction (d,) is rigid."""
        return np.isinf(self.stiffness)

    @functools.cached_property
    def pinned(self) -> np.ndarray:
        """Rigid directions (m, .)."""
        return self.vectors[:, self.rigid]

    @property
    def orthogonal(self) -> ClosedDirections:
        """The same with orthogonal directions Q of the rigid contacts, whose own directions are Q R.

        The small difference of nearly parallel directions would be lost in round-off. Q has their unit of length.
        """
        return self._orthogonalised[0] if self._has_several_rigid else self  # if kept, it would delay its own release

    def from_orthogonal(self, forces: np.ndarray) -> np.ndarray:
        """Return forces (d,) along these directions from those along the orthogonal ones."""
        if not self._has_several_rigid:
            return forces
        result = forces.copy()
        result[self.rigid] = np.linalg.solve(self._orthogonalised[1], forces[self.rigid])
        return result

    @property
    def _has_several_rigid(self) -> bool:
        return len(self.members) > 1 and int(np.count_nonzero(self.rigid)) > 1

    @functools.cached_property
    def _orthogonalised(self) -> tuple[ClosedDirections, np.ndarray]:
        """``orthogonal`` for two or more rigid directions, and R (k, k)."""
        rigid = self.rigid
        directions = self.pinned
        length = float(np.max(np.linalg.norm(directions, axis=0))) or 1.0
        q, r = np.linalg.qr(directions / length)
        vectors, offsets = self.vectors.copy(), self.offsets.copy()
        vectors[:, rigid] = length * q
        offsets[rigid] = np.linalg.solve(r.T, offsets[rigid])
        return ClosedDirections(self.members, vectors, self.stiffness, offsets), r

    @property
    def resisting(self) -> np.ndarray:
        """Directions (m, .) with a stiffness that is not zero."""
        return self.vectors[:, self.stiffness != 0]

    @property
    def size(self) -> float:
        """Largest norm of the resisting directions."""
        return float(np.linalg.norm(self.resisting, axis=0).max(initial=0.0))

    @property
    def constants(self) -> np.ndarray:
        """G (d,) [N], zero where rigid."""
        finite = np.where(self.rigid | (self.stiffness == 0), 1.0, self.stiffness)
        return np.where(self.rigid, 0.0, finite * self.offsets)
