"""A unilateral contact of one point of the beam, in the coordinates of the Exudyn model.

g = c w + gap,   lambda = k max(0, -g) along c:   a spring c^2 k behind a distance gap / |c|
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.beam import Beam
from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["PointContact", "point_contacts"]


@dataclass(frozen=True)
class PointContact:
    """name; point of the beam; c; gap [m] and k [N/m] of the contact as given."""

    name: str
    point: str
    coefficient: float
    gap: float
    stiffness: float

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

    def force(self, gap: np.ndarray) -> np.ndarray:
        """Contact force lambda [N] of gaps g [m]."""
        return self.stiffness * np.maximum(0.0, -gap)

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
    point, coefficient = _point_and_coefficient(contact)
    if point not in beam.points:
        known = ", ".join(sorted(beam.points)) or "none"
        raise MultiPhiValueError(f"contact {contact.name!r} direction: got {point!r}, need one of: {known}")
    return PointContact(contact.name, point, coefficient, float(contact.gap), float(contact.stiffness))


def _point_and_coefficient(contact: UnilateralContact) -> tuple[str, float]:
    direction = contact.direction
    if isinstance(direction, str):
        return direction, 1.0
    if isinstance(direction, Mapping) and len(direction) == 1:
        ((point, coefficient),) = direction.items()
        if np.isfinite(coefficient) and coefficient != 0:
            return point, float(coefficient)
    raise MultiPhiValueError(
        f"contact {contact.name!r} direction: got {direction!r}, need a point name or "
        "{point: coefficient} with one point and a coefficient that is finite and not zero"
    )
