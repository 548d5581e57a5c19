"""The format of a scene file: structure, contacts, force laws, friction, start, loads, damping, outputs, and models.

SI units, angles in radians. Every field is typed and none may be unknown; what the names in a file
refer to is checked where the scene is loaded (:mod:`multiphi_exudyn.study.scene.scenes`).
"""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, Tag

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.study.scene.fields import (
    Finite,
    Name,
    NotNegative,
    NotZero,
    Place,
    Positive,
    Stiffness,
    Table,
    by_key,
    numbered,
    place_phrase,
)
from multiphi_exudyn.study.scene.law_tables import LawSpec
from multiphi_exudyn.study.scene.load_tables import LoadSpec
from multiphi_exudyn.study.scene.model_kinds import ModelSpec
from multiphi_exudyn.study.scene.structure_tables import StructureSpec

__all__ = ["DisplacedStart", "LoadedStart", "SceneFile"]


class ContactSpec(Table):
    """A contact, g = direction . x + gap, or ``count`` of them: "{i}" in the names stands for 1, 2, ... count."""

    name: Name
    direction: Place  # a point, or {point = coefficient, ...}
    gap: Finite  # m, at x = 0
    stiffness: Stiffness  # N/m, or "rigid"
    damping: NotNegative = 0.0  # N s/m, of a compliant contact; it never pulls
    restitution: NotNegative = 0.0  # of a rigid contact, up to 1
    friction: NotNegative = 0.0  # mu, along ``tangential``, where it slides
    tangential: Place | None = None  # a point, or {point = coefficient, ...}; needed with friction
    static_friction: Positive | None = None  # up to which it sticks; none given: the same
    tangential_stiffness: Stiffness = math.inf  # N/m; "rigid", or not given: without a spring
    tangential_velocity: Finite = 0.0  # m/s, of the counter-surface along it
    count: Annotated[int, Field(ge=1)] = 1  # how many contacts of this kind

    def build(self) -> UnilateralContact:
        """The contact; raises the errors of UnilateralContact."""
        return UnilateralContact(**self.model_dump(exclude_defaults=True))

    @property
    def row(self) -> tuple[ContactSpec, ...]:
        """The contacts one by one."""
        return tuple(self._numbered(i) for i in range(1, self.count + 1))

    def _numbered(self, i: int) -> ContactSpec:
        places = {part: _numbered(at, i) for part in ("direction", "tangential") if (at := getattr(self, part))}
        return self.model_copy(update={"name": numbered(self.name, i), "count": 1} | places)


def _numbered(at: Place, i: int) -> Place:
    return numbered(at, i) if isinstance(at, str) else {numbered(name, i): c for name, c in at.items()}


class FrictionSpec(Table):
    """Dry friction along a direction: |T| <= limit, T = stiffness times the stretch of a spring in series."""

    name: Name
    direction: Place  # a point, or {point = coefficient, ...}
    limit: Positive  # N, while it slips
    static_limit: Positive | None = None  # N, at which it begins to; none given: the same
    stiffness: Stiffness = math.inf  # N/m; "rigid", or not given: without a spring
    velocity: Finite = 0.0  # m/s, of the counter-surface along the direction

    def build(self) -> Friction:
        """The friction; raises the errors of Friction."""
        return Friction(**self.model_dump())

    def phrase(self) -> str:
        """The friction as part of a sentence."""
        spring = "without a spring" if math.isinf(self.stiffness) else f"a spring of {self.stiffness:g} N/m in series"
        place = place_phrase(self.direction)
        return f"the friction {self.name} at {place} (at most {self.limit:g} N, {spring})"


class DisplacedStart(Table):
    """Static load at ``load_at``, as large as moves ``measured_at`` by ``displacement`` [m]."""

    load_at: Name  # a point
    measured_at: Name  # a point
    displacement: NotZero  # m

    def phrase(self) -> str:
        """How far, as part of a sentence."""
        return f"{1e3 * self.displacement:+g} mm at {self.measured_at}"


class LoadedStart(Table):
    """Static load ``force`` [N] at ``load_at``."""

    load_at: Name  # a point
    force: NotZero  # N

    def phrase(self) -> str:
        """How strong, as part of a sentence."""
        return f"{self.force:+g} N"


StartSpec = Annotated[
    Annotated[DisplacedStart, Tag("<displacement>")] | Annotated[LoadedStart, Tag("<force>")],
    by_key("displacement", "force"),
]


class ModalDampingSpec(Table):
    """Damping ratios of the open level's modes, lowest first, as fractions."""

    modal_ratios: tuple[NotNegative, ...]  # 0.01 is 1 %
    beyond: NotNegative | None = None  # of all further modes; none given: undamped

    def build(self) -> ModalDamping:
        """The damping."""
        return ModalDamping(self.modal_ratios, self.beyond)


class RayleighDampingSpec(Table):
    """C = alpha M + beta K."""

    alpha: NotNegative  # 1/s
    beta: NotNegative  # s

    def build(self) -> RayleighDamping:
        """The damping."""
        return RayleighDamping(self.alpha, self.beta)


DampingSpec = Annotated[
    Annotated[ModalDampingSpec, Tag("<modal_ratios>")] | Annotated[RayleighDampingSpec, Tag("<alpha>")],
    by_key("modal_ratios", "alpha"),
]


class OutputSpec(Table):
    """What is recorded and how it is judged."""

    t_end: Positive = 1.0  # s
    interval: Positive = 1e-4  # s, between the samples of the common time grid
    points: tuple[Name, ...] = ()  # none named: all of the structure
    judged_points: tuple[Name, ...] = ()  # those the report's headline figures speak of; none named: all
    windows: tuple[Positive, ...] = (0.1, 0.3)  # s, from 0; t_end is added
    tolerances: tuple[Positive, ...] = (0.01, 0.05)  # of the agreement horizon


class ComparisonSpec(Table):
    """Which model plays which part."""

    reference: Name  # the model that all others are measured against
    coarser: Name | None = None  # its difference to the reference is the reference's own uncertainty
    cheapest: tuple[Name, ...] = ()  # the full model at its cheapest fair setting, at nearby steps


class SceneFile(Table):
    """A whole scene file."""

    title: Annotated[str, Field(min_length=1)]  # the heading of its report
    modes: Annotated[int, Field(ge=1)] = 6  # of each reduced model that has no number of its own
    structure: StructureSpec
    contacts: tuple[ContactSpec, ...] = ()
    force_laws: tuple[LawSpec, ...] = ()
    friction: tuple[FrictionSpec, ...] = ()
    start: StartSpec | None = None  # none, with loads: at rest, undeformed
    loads: tuple[LoadSpec, ...] = ()
    damping: DampingSpec | None = None
    outputs: OutputSpec = OutputSpec()
    models: Annotated[tuple[Annotated[ModelSpec, Field(discriminator="kind")], ...], Field(min_length=1)]
    comparison: ComparisonSpec
