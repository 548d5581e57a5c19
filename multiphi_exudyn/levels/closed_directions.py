"""Closed directions: what closed contacts are along each of their directions.

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
    """What closed contacts are along each of their d directions p.

    members: the contacts of each. vectors: p (m, d). stiffness: K (d,) [N/m], inf where rigid.
    offsets: (d,) G / K [m], the gap of a single contact; G [N] where K is zero.
    """

    members: tuple[tuple[int, ...], ...]
    vectors: np.ndarray
    stiffness: np.ndarray
    offsets: np.ndarray

    @property
    def rigid(self) -> np.ndarray:
        """(d,) bool."""
        return np.isinf(self.stiffness)

    @property
    def orthogonal(self) -> tuple[ClosedDirections, np.ndarray]:
        """The same with the directions of rigid contacts orthogonal to each other, Q, and R (k, k): they are Q R.

        Nearly parallel ones would leave the difference of their small difference to round-off. Q keeps their unit.
        """
        count = int(np.count_nonzero(self.rigid))
        return (self, np.eye(count)) if count < 2 else self._turned  # not kept: what keeps itself is let go late

    @functools.cached_property
    def _turned(self) -> tuple[ClosedDirections, np.ndarray]:
        """``orthogonal`` where there is something to turn."""
        rigid = self.rigid
        own = self.vectors[:, rigid]
        length = float(np.max(np.linalg.norm(own, axis=0))) or 1.0
        q, r = np.linalg.qr(own / length)
        vectors, offsets = self.vectors.copy(), self.offsets.copy()
        vectors[:, rigid] = length * q
        offsets[rigid] = np.linalg.solve(r.T, offsets[rigid])
        return ClosedDirections(self.members, vectors, self.stiffness, offsets), r

    @property
    def resisting(self) -> np.ndarray:
        """Directions (m, .) in which there is a stiffness."""
        return self.vectors[:, self.stiffness != 0]

    @property
    def size(self) -> float:
        """The largest norm of these."""
        return float(np.linalg.norm(self.resisting, axis=0).max(initial=0.0))

    @property
    def constants(self) -> np.ndarray:
        """G (d,) [N], zero where rigid."""
        finite = np.where(self.rigid | (self.stiffness == 0), 1.0, self.stiffness)
        return np.where(self.rigid, 0.0, finite * self.offsets)
