"""The tables ``[[force_laws]]`` of a scene file: local nonlinear springs by their shape; SI units.

    force on the structure -F(q) along the row p of ``at``, a point name or {point: coefficient};   q = p.x [m]

A positive slope of F is a spring that pulls back. A shape is followed by straight segments on its ``span``, to a
``tolerance`` or by so many ``segments`` (multiphi_exudyn.mechanics.force_law); the full beam has the shape
itself.
Every table gives its law of multiphi_exudyn.mechanics.force_law, and itself in words.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.study.scene.fields import Finite, Name, NotZero, Place, Positive, Table, place_phrase

__all__ = ["CubicLawSpec", "HertzLawSpec", "LawSpec", "MagnetLawSpec", "TableLawSpec"]


class _Law(Table):
    """What every law has."""

    name: Name
    at: Place  # a point, or {point = coefficient, ...}

    def phrase(self) -> str:
        """The law as part of a sentence."""
        return f"the force law {self.name} at {place_phrase(self.at)} ({self._parameters_phrase()})"

    def _parameters_phrase(self) -> str:
        raise NotImplementedError


class _FollowedLaw(_Law):
    """A shape that is followed by segments, given by exactly one of tolerance and segments."""

    span: tuple[Finite, Finite]  # m, of q; beyond it the last segments go on
    tolerance: float | None = None  # of the largest force on the span
    segments: int | None = None  # number of straight segments; either this or a tolerance

    def _shape(self, q: Any) -> Any:
        raise NotImplementedError

    def build(self) -> ForceLaw:
        """Its shape followed by segments; raises the errors of ForceLaw."""
        return ForceLaw(self.at, self._shape, self.tolerance, self.name, self.span, self.segments)


class TableLawSpec(_Law):
    """Straight lines between places; the first and the last go on. Its lines are the segments."""

    kind: Literal["table"]
    q: tuple[Finite, ...]  # m, ascending
    force: tuple[Finite, ...]  # F, N

    def build(self) -> ForceLaw:
        """Its lines; raises the errors of ForceLaw."""
        return ForceLaw(self.at, (self.q, self.force), name=self.name)

    def _parameters_phrase(self) -> str:
        return f"a table of {len(self.q)} places"


class CubicLawSpec(_FollowedLaw):
    """F = k1 q + k3 q^3: k3 > 0 hardens, k3 < 0 softens."""

    kind: Literal["cubic"]
    k1: Finite  # N/m
    k3: Finite  # N/m^3

    def _shape(self, q: Any) -> Any:
        return self.k1 * q + self.k3 * q**3

    def _parameters_phrase(self) -> str:
        return f"{self.k1:g} N/m q {self.k3:+g} N/m³ q³"


class HertzLawSpec(_FollowedLaw):
    """F = -stiffness (-q - gap)^exponent where -q > gap, else 0: a round stop at a ``gap`` on the side of negative q.

    It presses along +q, as a contact of the same direction and gap does; a stop on the other side has {point: -1}.
    """

    kind: Literal["hertz"]
    stiffness: Positive  # N/m^exponent
    gap: Finite  # m
    exponent: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 1.5

    def _shape(self, q: Any) -> Any:
        return -self.stiffness * np.maximum(-q - self.gap, 0.0) ** self.exponent

    def _parameters_phrase(self) -> str:
        return f"{self.stiffness:g} N/m^{self.exponent:g} beyond a gap of {1e3 * self.gap:g} mm"


class MagnetLawSpec(_FollowedLaw):
    """F = -strength s / d^2, d = |distance - q|, s its sign: a magnet at q = distance attracts; strength < 0 repels."""

    kind: Literal["magnet"]
    strength: NotZero  # N m^2
    distance: NotZero  # m, along the row; negative: on the other side

    @model_validator(mode="after")
    def _magnet_outside_the_span(self) -> MagnetLawSpec:
        if min(self.span) <= self.distance <= max(self.span):
            raise PydanticCustomError("span", "a span that does not contain q = distance, where the magnet is")
        return self

    def _shape(self, q: Any) -> Any:
        return -self.strength * np.sign(self.distance - q) / (self.distance - q) ** 2

    def _parameters_phrase(self) -> str:
        return f"a magnet of {self.strength:g} N m² at {1e3 * self.distance:+g} mm"


LawSpec = Annotated[
    TableLawSpec | CubicLawSpec | HertzLawSpec | MagnetLawSpec,
    Field(discriminator="kind"),
]
