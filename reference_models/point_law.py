"""A local force law on one point of the beam, in the coordinates of the Exudyn model.

The structure feels the force -F(q) along the row of its point, q = c w:   -c F(c w) on the deflection w.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from reference_models.beams import Beams
from reference_models.point_contact import point_and_coefficient

__all__ = ["Law", "PointLaw", "point_laws"]


class Law(Protocol):
    """What a force law says of itself: its place, its name, and F [N] of q [m], a function or a table (q, F)."""

    @property
    def at(self) -> Any:
        """A point name or {point: coefficient}."""

    @property
    def name(self) -> str:
        """How results refer to it."""

    @property
    def law(self) -> Any:
        """F as it was given."""

    def force(self, q: Any) -> Any:
        """F(q) by straight segments; of a table, F itself."""


@dataclass(frozen=True)
class PointLaw:
    """point of the beam; c; law."""

    point: str
    coefficient: float
    law: Law

    def spring_force(self, deflection: float) -> float:
        """c F(c w) [N], against the deflection w [m]: the law itself, not its segments."""
        exact = self.law.law if callable(self.law.law) else self.law.force
        return float(self.coefficient * exact(self.coefficient * deflection))

    def forces(self, deflection: np.ndarray) -> np.ndarray:
        """The same of (k,) deflections."""
        return np.array([self.spring_force(w) for w in deflection.tolist()])


def point_laws(beams: Beams, laws: Sequence[Law]) -> tuple[PointLaw, ...]:
    """The laws on points; raises MultiPhiValueError where a full beam cannot have them."""
    return tuple(_point_law(beams, law) for law in laws)


def _point_law(beams: Beams, law: Law) -> PointLaw:
    what = f"force law {law.name!r} at"
    point, coefficient = point_and_coefficient(what, law.at)
    return PointLaw(beams.check_point(what, point), coefficient, law)
