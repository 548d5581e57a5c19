"""A unilateral contact of one point of the beam, in the coordinates of the Exudyn model.

    g = c w + gap,   lambda = k max(0, -g) along c:   a spring c^2 k behind a distance gap / |c|

With damping d, lambda = max(0, -k g - d g') where g < 0: it never pulls. A stop that moves adds its way to the gap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.beam import Beam
from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.structure import At

__all__ = ["PointContact", "point_and_coefficient", "point_contacts"]


@dataclass(frozen=True)
class PointContact:
    """name; point of the beam; c; gap [m], k [N/m] and damping d [N s/m] of the contact as given."""

    name: str
    point: str
    coefficient: float
    gap: float
    stiffness: float
    damping: float = 0.0

    @property
    def distance(self) -> float:
        """Distance [m] the point may travel before it touches."""
        return self.gap / abs(self.coefficient)

    @property
    def spring(self) -> float:
        """Stiffness [N/m] against the point's own travel."""
        return self.stiffness * self.coefficient**2

    @property
    def above(self) -> bool:
        """True for a stop on the +z side."""
        return self.coefficient < 0

    def of_distance(self, distance: np.ndarray) -> np.ndarray:
        """Gap g [m] of the point's distances from the stop [m]."""
        return abs(self.coefficient) * distance

    def force(self, gap: np.ndarray, rate: np.ndarray | float = 0.0) -> np.ndarray:
        """Contact force lambda [N] of gaps g [m] and their rates g' [m/s]."""
        return np.where(gap < 0, np.maximum(0.0, -self.stiffness * gap - self.damping * rate), 0.0)

    def spring_force(self, deflection: float, speed: float, way: float, way_rate: float) -> float:
        """Force [N] against the deflection w [m] of the point, moving with ``speed`` [m/s]; way: z of the stop [m]."""
        gap = self.coefficient * deflection + self.gap - way
        if gap >= 0:
            return 0.0
        pushing = -self.stiffness * gap - self.damping * (self.coefficient * speed - way_rate)
        return -self.coefficient * max(0.0, pushing)

    def energy(self, gap: np.ndarray) -> np.ndarray:
        """Energy [J] in the contact spring at gaps g [m]."""
        return self.stiffness * np.minimum(0.0, gap) ** 2 / 2


def point_contacts(beam: Beam, contacts: Sequence[UnilateralContact]) -> tuple[PointContact, ...]:
    """The contacts as point contacts; raises MultiPhiValueError where a full beam cannot have them."""
    names = [contact.name for contact in contacts]
    if len(set(names)) < len(names):
        raise MultiPhiValueError(f"contacts: got the names {names}, need each name once")
    return tuple(_point_contact(beam, contact) for contact in contacts)


def _point_contact(beam: Beam, contact: UnilateralContact) -> PointContact:
    if contact.rigid:
        raise MultiPhiValueError(f"contact {contact.name!r} stiffness: got inf, need a finite one (a penalty spring)")
    point, coefficient = point_and_coefficient(f"contact {contact.name!r} direction", contact.direction)
    if point not in beam.points:
        known = ", ".join(sorted(beam.points)) or "none"
        raise MultiPhiValueError(f"contact {contact.name!r} direction: got {point!r}, need one of: {known}")
    return PointContact(contact.name, point, coefficient, contact.gap, contact.stiffness, contact.damping)


def point_and_coefficient(what: str, direction: At) -> tuple[str, float]:
    """Point and coefficient of a direction on one point; ``what``: how the error calls it."""
    if isinstance(direction, str):
        return direction, 1.0
    if isinstance(direction, Mapping) and len(direction) == 1:
        ((point, coefficient),) = direction.items()
        if np.isfinite(coefficient) and coefficient != 0:
            return point, float(coefficient)
    raise MultiPhiValueError(
        f"{what}: got {direction!r}, need a point name or "
        "{point: coefficient} with one point and a coefficient that is finite and not zero"
    )
