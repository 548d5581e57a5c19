"""The tables ``[[loads]]`` of a scene file: courses in time, forces, weight, moving stops and bases; SI units."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from multiphi_exudyn.study.scene.fields import Finite, Name, NotNegative, Place, Positive, Table

__all__ = [
    "AccelerogramCourse",
    "BaseMotionSpec",
    "ConstantLoadSpec",
    "CourseSpec",
    "GravitySpec",
    "HarmonicCourse",
    "HarmonicLoadSpec",
    "LoadSpec",
    "SampledCourse",
    "SampledLoadSpec",
    "Samples",
    "StopMotionSpec",
    "SweepCourse",
    "SweepLoadSpec",
]


class HarmonicCourse(Table):
    """amplitude cos(2 pi frequency_hz t + phase)."""

    kind: Literal["harmonic"]
    amplitude: Finite
    frequency_hz: NotNegative  # Hz
    phase: Finite = 0.0  # rad


class Samples(Table):
    """Samples from columns of a CSV file, or as they stand here."""

    csv: str | None = None  # path, relative to the scene file; time [s] is its first column
    column: Annotated[int, Field(ge=1)] = 1
    time: tuple[Finite, ...] | None = None  # s
    values: tuple[Finite, ...] | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Samples:
        inline = self.time is not None and self.values is not None
        if (self.csv is None) != inline or (self.time is None) != (self.values is None):
            raise PydanticCustomError("samples", "either csv, or time and values")
        return self


class SampledCourse(Samples):
    """Straight lines between samples, zero outside them; from columns of a CSV file, or as they stand here."""

    kind: Literal["sampled"]


class AccelerogramCourse(Samples):
    """Motion whose acceleration is factor times samples, in straight lines, zero outside them; at rest before."""

    kind: Literal["accelerogram"]
    factor: Finite = 1.0  # m/s2 in a unit of the record: 9.81 for a record in g, 0.01 for one in cm/s2


class SweepCourse(Table):
    """amplitude cos(phase(t)) whose frequency goes from start_hz to end_hz in ``duration`` [s], then zero."""

    kind: Literal["sweep"]
    amplitude: Finite
    start_hz: Positive  # Hz
    end_hz: Positive  # Hz
    duration: Positive  # s
    law: Literal["linear", "logarithmic"] = "linear"
    tolerance: Annotated[float, Field(ge=1e-12, lt=1)] = 1e-6  # of a reduced model's response, of its largest value


CourseSpec = Annotated[HarmonicCourse | SampledCourse | SweepCourse | AccelerogramCourse, Field(discriminator="kind")]
SmoothCourse = Annotated[HarmonicCourse | SweepCourse | AccelerogramCourse, Field(discriminator="kind")]


class ConstantLoadSpec(Table):
    """A constant force [N] from t = 0 on."""

    kind: Literal["constant"]
    at: Place  # a point, or {point = coefficient, ...}
    force: Finite  # N


class HarmonicLoadSpec(HarmonicCourse):
    """A harmonic force; amplitude in N."""

    at: Place  # a point, or {point = coefficient, ...}


class SampledLoadSpec(SampledCourse):
    """A sampled force; values in N."""

    at: Place  # a point, or {point = coefficient, ...}


class SweepLoadSpec(SweepCourse):
    """A swept force; amplitude in N."""

    at: Place  # a point, or {point = coefficient, ...}


class GravitySpec(Table):
    """Weight of the whole structure along +z, from t = 0 on; a beam knows its direction."""

    kind: Literal["gravity"]
    acceleration: Finite  # m/s2, negative where it pulls down
    direction: Annotated[dict[Name, Finite], Field(min_length=1)] | None = None  # unit rigid-body motion along gravity


class StopMotionSpec(Table):
    """A contact whose stop moves: its way [m] is taken from the gap."""

    kind: Literal["stop-motion"]
    contact: Name  # its name
    course: CourseSpec  # z(t) [m], as a load is given


class BaseMotionSpec(Table):
    """A base that moves; displacements are then relative to it, stops move with it unless they are named."""

    kind: Literal["base-motion"]
    course: SmoothCourse  # z(t) [m]: harmonic, sweep or accelerogram
    fixed_stops: tuple[Name, ...] = ()  # contacts whose stops do not move with the base
    direction: Place | None = None  # unit rigid-body motion of the base; a beam knows its own


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
