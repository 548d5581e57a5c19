"""The tables ``[[force_laws]]`` of a scene file: local nonlinear springs by their shape; SI units.

    force on the structure -F(q) along the row p of ``at``, a point name or {point: coefficient};   q = p.x [m]

A positive slope of F is a spring that pulls back. A shape is followed by straight segments on its ``span``, to a
``tolerance`` or by so many ``segments`` (multiphi_exudyn.mechanics.force_law); the full beam has the shape itself.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.study.scene.fields import Finite, Name, NotZero, Place, Positive, Table

__all__ = ["CubicLawSpec", "HertzLawSpec", "LawSpec", "MagnetLawSpec", "TableLawSpec"]


class _Law(Table):
    """What every law has."""

    name: Name
    at: Place  # a point, or {point = coefficient, ...}


class _FollowedLaw(_Law):
    """A shape that is followed by segments, given by exactly one of tolerance and segments."""

    span: tuple[Finite, Finite]  # m, of q; beyond it the last segments go on
    tolerance: float | None = None  # of the largest force on the span
    segments: int | None = None  # number of straight segments; either this or a tolerance


class TableLawSpec(_Law):
    """Straight lines between places; the first and the last go on. Its lines are the segments."""

    kind: Literal["table"]
    q: tuple[Finite, ...]  # m, ascending
    force: tuple[Finite, ...]  # F, N


class CubicLawSpec(_FollowedLaw):
    """F = k1 q + k3 q^3: k3 > 0 hardens, k3 < 0 softens."""

    kind: Literal["cubic"]
    k1: Finite  # N/m
    k3: Finite  # N/m^3


class HertzLawSpec(_FollowedLaw):
    """F = -stiffness (-q - gap)^exponent where -q > gap, else 0: a round stop at a ``gap`` on the side of negative q.

    It presses along +q, as a contact of the same direction and gap does; a stop on the other side has {point: -1}.
    """

    kind: Literal["hertz"]
    stiffness: Positive  # N/m^exponent
    gap: Finite  # m
    exponent: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 1.5


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


LawSpec = Annotated[
    TableLawSpec | CubicLawSpec | HertzLawSpec | MagnetLawSpec,
    Field(discriminator="kind"),
]
