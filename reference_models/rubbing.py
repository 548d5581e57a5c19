"""Friction of a penalty contact, |T| <= mu N with a bristle, on a tangential coordinate: a user function.

    N = k_n max(0, -g),   trial = k_t (y - s),   T = trial while |trial| <= mu_s N (sticks), mu N (slips), else +-mu N

y = c u - v_t t is the tangential way of the contact's point on its counter-surface, s the bristle's foot, y - T / k_t
at the end of every step; where the contact closes, y at that instant, which is taken from a straight line through the
step. A step's own force is that of its end, so that T and N of one step belong together. No connector of Exudyn has a
friction force that goes with another coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from reference_models.point_contact import PointContact, Tangent

__all__ = ["Rub"]


class Rub:
    """A contact's friction in one run; silent until its first step ends, at the start.

    stop: it has the way z [m] that the contact's stop has moved.
    """

    def __init__(self, contact: PointContact, tangent: Tangent, stop: Any) -> None:
        self.contact, self.tangent, self._stop = contact, tangent, stop
        self._normal: list[int] = []
        self._tangential: list[int] = []
        self._gap = self._way = self._place = math.nan
        self._slips = self._runs = False

    def place(self, coordinate: Callable[[str], int]) -> None:
        """Tell it the index of a point's deflection among the system's coordinates."""
        contact, tangent = self.contact, self.tangent
        self._normal = [coordinate(name) for name in (contact.point, contact.other) if name is not None]
        self._tangential = [coordinate(name) for name in (tangent.point, tangent.other) if name is not None]

    def force(self, mbs: Any, t: float, item: int, u: float, v: float, k: float, d: float, offset: float) -> float:
        """User function of a spring on the tangential deflection u [m]."""
        if not self._runs:
            return 0.0
        way = self.tangent.coefficient * u - self.tangent.velocity * t
        gap = self._gap_of(mbs.systemData.GetODE2Coordinates(copy=False))
        return self.tangent.coefficient * self._bristle(gap, way)[0]

    def end_step(self, coordinates: Any, t: float) -> float:
        """T [N] at the end of a step, t [s], from which the next one goes on."""
        tangent, gap = self.tangent, self._gap_of(coordinates)
        way = tangent.coefficient * _difference(coordinates, self._tangential) - tangent.velocity * t
        if not self._runs:
            self._gap, self._way, self._place, self._runs = gap, way, way, True
        force, self._slips = self._bristle(gap, way)
        self._gap, self._way, self._place = gap, way, way - force / tangent.stiffness
        return force

    def _gap_of(self, coordinates: Any) -> float:
        contact = self.contact
        return contact.coefficient * _difference(coordinates, self._normal) + contact.gap - self._stop.way

    def _bristle(self, gap: float, way: float) -> tuple[float, bool]:
        """T [N] and whether it slips, at a gap and a tangential way [m] of the step under way."""
        if gap >= 0:
            return 0.0, False
        place, slips = self._place, self._slips
        if self._gap > 0:
            place, slips = self._way + self._gap / (self._gap - gap) * (way - self._way), False
        pressure, tangent = -self.contact.stiffness * gap, self.tangent
        trial = tangent.stiffness * (way - place)
        if abs(trial) <= (tangent.friction if slips else tangent.static_friction) * pressure:
            return trial, False
        return math.copysign(tangent.friction * pressure, trial), True


def _difference(coordinates: Any, indices: Sequence[int]) -> float:
    own, *other = indices
    return float(coordinates[own] - coordinates[other[0]] if other else coordinates[own])
