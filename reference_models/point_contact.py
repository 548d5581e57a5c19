"""A unilateral contact of a point of a beam with the ground or with another point, in the Exudyn model's coordinates.

    g = c w + gap,   lambda = k max(0, -g) along c:   a spring c^2 k behind a distance gap / |c|

w is the deflection of the point, less that of the other one.

With damping d, lambda = max(0, -k g - d g') where g < 0: it never pulls. A stop that moves adds its way to the gap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.structure import At
from reference_models.beams import Beams

__all__ = ["PointContact", "Tangent", "point_and_coefficient", "point_and_other", "point_contacts"]


@dataclass(frozen=True)
class Tangent:
    """How a contact rubs: y = c u - v_t t, u of a point, less that of another, mu, mu_s >= mu, k_t [N/m], v_t [m/s]."""

    point: str
    coefficient: float
    friction: float
    static_friction: float
    stiffness: float
    velocity: float = 0.0
    other: str | None = None

    def travel(self, of_points: Mapping[str, np.ndarray], time: np.ndarray) -> np.ndarray:
        """y (s,) [m] of deflections of points by name at times, (s,) each."""
        own = of_points[self.point]
        between = own if self.other is None else own - of_points[self.other]
        return self.coefficient * between - self.velocity * time


@dataclass(frozen=True)
class PointContact:
    """name; point; c; gap [m], k [N/m], damping d [N s/m] of the contact as given; other: point it meets, or None.

    tangent: of a contact with friction, else None.
    """

    name: str
    point: str
    coefficient: float
    gap: float
    stiffness: float
    damping: float = 0.0
    other: str | None = None
    tangent: Tangent | None = None

    @property
    def direction(self) -> dict[str, float]:
        """h as coefficients of points."""
        opposite = {} if self.other is None else {self.other: -self.coefficient}
        return {self.point: self.coefficient} | opposite

    def between(self, of_points: Mapping[str, np.ndarray]) -> np.ndarray:
        """w, or its rate, from those of the points by name."""
        own = of_points[self.point]
        return own if self.other is None else own - of_points[self.other]

    @property
    def distance(self) -> float:
        """Distance [m] that w may grow towards the other before they touch."""
        return self.gap / abs(self.coefficient)

    @property
    def spring(self) -> float:
        """Stiffness [N/m] against w."""
        return self.stiffness * self.coefficient**2

    @property
    def above(self) -> bool:
        """True for a stop, or another point, on the +z side."""
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


def point_contacts(beams: Beams, contacts: Sequence[UnilateralContact]) -> tuple[PointContact, ...]:
    """The contacts as point contacts; raises MultiPhiValueError where a full beam cannot have them."""
    names = [contact.name for contact in contacts]
    if len(set(names)) < len(names):
        raise MultiPhiValueError(f"contacts: got the names {names}, need each name once")
    return tuple(_point_contact(beams, contact) for contact in contacts)


def _point_contact(beams: Beams, contact: UnilateralContact) -> PointContact:
    if contact.rigid:
        raise MultiPhiValueError(f"contact {contact.name!r} stiffness: got inf, need a finite one (a penalty spring)")
    what = f"contact {contact.name!r} direction"
    point, coefficient, other = point_and_other(what, contact.direction)
    for name in (point,) if other is None else (point, other):
        beams.check_point(what, name)
    given = contact.name, point, coefficient, contact.gap, contact.stiffness, contact.damping, other
    return PointContact(*given, _tangent(beams, contact) if contact.friction else None)


def _tangent(beams: Beams, contact: UnilateralContact) -> Tangent:
    assert contact.tangential is not None, "needed where there is friction"
    if math.isinf(contact.tangential_stiffness):
        received = f"contact {contact.name!r} tangential_stiffness: got inf"
        raise MultiPhiValueError(f"{received}, need a finite one (a bristle)")
    what = f"contact {contact.name!r} tangential"
    point, coefficient, other = point_and_other(what, contact.tangential)
    for name in (point,) if other is None else (point, other):
        beams.check_point(what, name)
    most = contact.friction if contact.static_friction is None else contact.static_friction
    law = contact.friction, most, contact.tangential_stiffness, contact.tangential_velocity
    return Tangent(point, coefficient, *law, other)


def point_and_other(what: str, direction: At) -> tuple[str, float, str | None]:
    """Point and coefficient of a direction, and the point of the opposite coefficient, if it has two."""
    if not isinstance(direction, Mapping) or len(direction) != 2:
        return *point_and_coefficient(what, direction), None
    (point, coefficient), (other, opposite) = direction.items()
    if not (np.isfinite(coefficient) and coefficient != 0 and opposite == -coefficient):
        raise MultiPhiValueError(f"{what}: got {direction!r}, need two points with opposite coefficients, not zero")
    return point, float(coefficient), other


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
