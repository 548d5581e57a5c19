"""The tables of a scene file beside its structure: contacts, friction, force laws, start, loads; SI units.

    a force law acts with -F(q) along the row p of ``at``, a point or {point: coefficient}, where q = p.x [m]

A positive slope of F is a spring that pulls back. A shape F(q) is followed by straight segments on its ``span``, to a
``tolerance`` or by so many ``segments`` (multiphi_exudyn.mechanics.elements.force_law); the full beam has the shape
itself. ``build`` of a load takes the scene file's folder and the unit rigid-body motion of beams along +z, or None.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, Tag, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.mechanics.friction import Friction
from multiphi_exudyn.mechanics.loads import (
    BaseMotion,
    ConstantLoad,
    Gravity,
    HarmonicLoad,
    Load,
    SampledLoad,
    StopMotion,
    SweepLoad,
)
from multiphi_exudyn.mechanics.time_functions import Accelerogram, Harmonic, Sampled, Sweep
from multiphi_exudyn.study.scene_tables import (
    Count,
    Finite,
    Name,
    NotNegative,
    NotZero,
    Place,
    Positive,
    Stiffness,
    Table,
    by_key,
    inside,
    numbered,
)

__all__ = [
    "BaseMotionSpec",
    "ContactSpec",
    "DisplacedStart",
    "FrictionSpec",
    "LawSpec",
    "LoadSpec",
    "LoadedStart",
    "StartSpec",
    "StopMotionSpec",
]


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
    count: Count = 1  # how many contacts of this kind

    def build(self) -> UnilateralContact:
        """The contact; raises the errors of UnilateralContact."""
        return UnilateralContact(**self.model_dump(exclude_defaults=True))

    @property
    def row(self) -> tuple[ContactSpec, ...]:
        """The contacts one by one."""
        named = ("name", "direction", "tangential")
        rows = ({part: numbered(getattr(self, part), i) for part in named} for i in range(1, self.count + 1))
        return tuple(self.model_copy(update={**parts, "count": 1}) for parts in rows)


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


class TableLawSpec(Table):
    """F(q) by straight lines between places, the first and the last going on; q = p.x of the row ``at``."""

    kind: Literal["table"]
    name: Name
    at: Place  # a point, or {point = coefficient, ...}
    q: tuple[Finite, ...]  # m, ascending
    force: tuple[Finite, ...]  # F, N: on the structure acts -F along ``at``

    def build(self) -> ForceLaw:
        """Its lines; raises the errors of ForceLaw."""
        return ForceLaw(self.at, (self.q, self.force), name=self.name)


class _ShapedLaw(Table):
    """A shape F(q), followed by straight segments on its span, to a tolerance or by so many segments."""

    name: Name
    at: Place  # a point, or {point = coefficient, ...}; on the structure acts -F along it
    span: tuple[Finite, Finite]  # m, of q; beyond it the last segments go on
    tolerance: float | None = None  # of the largest force on the span
    segments: int | None = None  # number of straight segments; either this or a tolerance

    def shape(self, q: Any) -> Any:
        raise NotImplementedError

    def build(self) -> ForceLaw:
        """Its shape followed by segments; raises the errors of ForceLaw."""
        return ForceLaw(self.at, self.shape, self.tolerance, self.name, self.span, self.segments)


class CubicLawSpec(_ShapedLaw):
    """F = k1 q + k3 q^3: k3 > 0 hardens, k3 < 0 softens."""

    kind: Literal["cubic"]
    k1: Finite  # N/m
    k3: Finite  # N/m^3

    def shape(self, q: Any) -> Any:
        return self.k1 * q + self.k3 * q**3


class HertzLawSpec(_ShapedLaw):
    """F = -stiffness (-q - gap)^exponent where -q > gap, else 0: a round stop at a ``gap`` on the side of negative q.

    It presses along +q, as a contact of the same direction and gap does; a stop on the other side has {point: -1}.
    """

    kind: Literal["hertz"]
    stiffness: Positive  # N/m^exponent
    gap: Finite  # m
    exponent: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 1.5

    def shape(self, q: Any) -> Any:
        return -self.stiffness * np.maximum(-q - self.gap, 0.0) ** self.exponent


class MagnetLawSpec(_ShapedLaw):
    """F = -strength s / d^2, d = |distance - q|, s its sign: a magnet at q = distance attracts; strength < 0 repels."""

    kind: Literal["magnet"]
    strength: NotZero  # N m^2
    distance: NotZero  # m, along the row; negative: on the other side

    @model_validator(mode="after")
    def _magnet_outside_the_span(self) -> MagnetLawSpec:
        if min(self.span) <= self.distance <= max(self.span):
            raise PydanticCustomError("span", "a span that does not contain q = distance, where the magnet is")
        return self

    def shape(self, q: Any) -> Any:
        return -self.strength * np.sign(self.distance - q) / (self.distance - q) ** 2


LawSpec = Annotated[TableLawSpec | CubicLawSpec | HertzLawSpec | MagnetLawSpec, Field(discriminator="kind")]


# start and loads


class DisplacedStart(Table):
    """Static load at ``load_at``, as large as moves ``measured_at`` by ``displacement`` [m]."""

    load_at: Name  # a point
    measured_at: Name  # a point
    displacement: NotZero  # m


class LoadedStart(Table):
    """Static load ``force`` [N] at ``load_at``."""

    load_at: Name  # a point
    force: NotZero  # N


StartSpec = Annotated[
    Annotated[DisplacedStart, Tag("<displacement>")] | Annotated[LoadedStart, Tag("<force>")],
    by_key("displacement", "force"),
]


class HarmonicCourse(Table):
    """amplitude cos(2 pi frequency_hz t + phase)."""

    kind: Literal["harmonic"]
    amplitude: Finite
    frequency_hz: NotNegative  # Hz
    phase: Finite = 0.0  # rad

    def course(self, folder: Path) -> Harmonic:
        return Harmonic(self.amplitude, self.frequency_hz, self.phase)


class _Samples(Table):
    """Samples from columns of a CSV file, or as they stand here."""

    csv: str | None = None  # path, relative to the scene file; time [s] is its first column
    column: Count = 1
    time: tuple[Finite, ...] | None = None  # s
    values: tuple[Finite, ...] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> _Samples:
        inline = self.time is not None and self.values is not None
        if (self.csv is None) != inline or (self.time is None) != (self.values is None):
            raise PydanticCustomError("samples", "either csv, or time and values")
        return self

    def samples(self, folder: Path) -> Sampled:
        """Straight lines between the samples, zero outside them; ``folder``: of the scene file."""
        if self.csv is None:
            return Sampled(self.time, self.values)  # type: ignore[arg-type]
        return Sampled.from_csv(folder / self.csv, self.column)


class SampledCourse(_Samples):
    """Straight lines between samples, zero outside them; from columns of a CSV file, or as they stand here."""

    kind: Literal["sampled"]

    def course(self, folder: Path) -> Sampled:
        return self.samples(folder)


class AccelerogramCourse(_Samples):
    """Motion whose acceleration is factor times samples, in straight lines, zero outside them; at rest before."""

    kind: Literal["accelerogram"]
    factor: Finite = 1.0  # m/s2 in a unit of the record: 9.81 for a record in g, 0.01 for one in cm/s2

    def course(self, folder: Path) -> Accelerogram:
        samples = self.samples(folder)
        return Accelerogram(samples.time, samples.values, self.factor)


class SweepCourse(Table):
    """amplitude cos(phase(t)) whose frequency goes from start_hz to end_hz in ``duration`` [s], then zero."""

    kind: Literal["sweep"]
    amplitude: Finite
    start_hz: Positive  # Hz
    end_hz: Positive  # Hz
    duration: Positive  # s
    law: Literal["linear", "logarithmic"] = "linear"
    tolerance: Annotated[float, Field(ge=1e-12, lt=1)] = 1e-6  # of a reduced model's response, of its largest value

    def course(self, folder: Path) -> Sweep:
        return Sweep(**self.model_dump(exclude={"kind"}))


CourseSpec = Annotated[HarmonicCourse | SampledCourse | SweepCourse | AccelerogramCourse, Field(discriminator="kind")]
SmoothCourse = Annotated[HarmonicCourse | SweepCourse | AccelerogramCourse, Field(discriminator="kind")]


class ConstantLoadSpec(Table):
    """A constant force [N] from t = 0 on."""

    kind: Literal["constant"]
    at: Place  # a point, or {point = coefficient, ...}
    force: Finite  # N

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        return ConstantLoad(self.at, self.force)


class HarmonicLoadSpec(HarmonicCourse):
    """A harmonic force; amplitude in N."""

    at: Place  # a point, or {point = coefficient, ...}

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        return HarmonicLoad(self.at, self.amplitude, self.frequency_hz, self.phase)


class SampledLoadSpec(SampledCourse):
    """A sampled force; values in N."""

    at: Place  # a point, or {point = coefficient, ...}

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        samples = self.samples(folder)
        return SampledLoad(self.at, samples.time, samples.values)


class SweepLoadSpec(SweepCourse):
    """A swept force; amplitude in N."""

    at: Place  # a point, or {point = coefficient, ...}

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        return SweepLoad(**self.model_dump(exclude={"kind"}))


class GravitySpec(Table):
    """Weight of the whole structure along +z, from t = 0 on; a beam knows its direction."""

    kind: Literal["gravity"]
    acceleration: Finite  # m/s2, negative where it pulls down
    direction: Annotated[dict[Name, Finite], Field(min_length=1)] | None = None  # unit rigid-body motion along gravity

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        return Gravity(_along(self.direction, transverse), self.acceleration)


class StopMotionSpec(Table):
    """A contact whose stop moves: its way [m] is taken from the gap."""

    kind: Literal["stop-motion"]
    contact: Name  # its name
    course: CourseSpec  # z(t) [m], as a load is given

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        return StopMotion(self.contact, inside(".course", lambda: self.course.course(folder)))


class BaseMotionSpec(Table):
    """A base that moves; displacements are then relative to it, stops move with it unless they are named."""

    kind: Literal["base-motion"]
    course: SmoothCourse  # z(t) [m]: harmonic, sweep or accelerogram
    fixed_stops: tuple[Name, ...] = ()  # contacts whose stops do not move with the base
    direction: Place | None = None  # unit rigid-body motion of the base; a beam knows its own

    def build(self, folder: Path, transverse: np.ndarray | None) -> Load:
        course = inside(".course", lambda: self.course.course(folder))
        return BaseMotion(_along(self.direction, transverse), course, self.fixed_stops)


def _along(own: Any, transverse: np.ndarray | None) -> Any:
    if own is None and transverse is None:
        raise MultiPhiValueError(".direction: got None, need a direction: only a structure of beams has one of its own")
    return transverse if own is None else own


LoadSpec = Annotated[
    ConstantLoadSpec
    | HarmonicLoadSpec
    | SampledLoadSpec
    | SweepLoadSpec
    | GravitySpec
    | StopMotionSpec
    | BaseMotionSpec,
    Field(discriminator="kind"),
]
