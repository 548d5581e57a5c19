"""The loads of a scene file as loads of multiphi_exudyn.mechanics.loads, and as phrases.

Weight and base motion act along a unit rigid-body motion of the structure; a beam's is its transverse one, which
depends on its mesh and is an argument here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

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
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.mechanics.time_functions import Accelerogram, Harmonic, Sampled, Sweep, TimeFunction
from multiphi_exudyn.study.scene.fields import inside, place_phrase
from multiphi_exudyn.study.scene.load_tables import (
    AccelerogramCourse,
    BaseMotionSpec,
    ConstantLoadSpec,
    CourseSpec,
    GravitySpec,
    HarmonicCourse,
    LoadSpec,
    SampledCourse,
    SampledLoadSpec,
    Samples,
    StopMotionSpec,
    SweepCourse,
)
from multiphi_exudyn.study.scene.scenes import Scene, refuse

__all__ = ["load_phrases", "loads_of"]

FORCES: dict[str, Callable[..., Load]] = {"constant": ConstantLoad, "harmonic": HarmonicLoad, "sweep": SweepLoad}
COURSES: dict[str, Callable[..., TimeFunction]] = {"harmonic": Harmonic, "sweep": Sweep}
Direction = TypeVar("Direction", bound=At)  # direction of a scene file


def loads_of(scene: Scene, transverse: np.ndarray | None) -> tuple[Load, ...]:
    """Build the loads in the order of the file; raises MultiPhiValueError with file and field.

    transverse: unit rigid-body motion along +z, None for a structure that has none.
    """
    return tuple(_load(scene, f"loads[{i}]", spec, transverse) for i, spec in enumerate(scene.file.loads))


def load_phrases(loads: Sequence[LoadSpec]) -> tuple[str, ...]:
    """A phrase for each load."""
    return tuple(map(_phrase, loads))


def _load(scene: Scene, field: str, spec: LoadSpec, transverse: np.ndarray | None) -> Load:
    if isinstance(spec, GravitySpec):
        return Gravity(_along(scene, field, spec.direction, transverse), spec.acceleration)
    if isinstance(spec, BaseMotionSpec):
        course = _course(scene, f"{field}.course", spec.course)
        return BaseMotion(_along(scene, field, spec.direction, transverse), course, spec.fixed_stops)
    if isinstance(spec, StopMotionSpec):
        return StopMotion(spec.contact, _course(scene, f"{field}.course", spec.course))
    if isinstance(spec, SampledLoadSpec):
        samples = _samples(scene, field, spec)
        return SampledLoad(spec.at, samples.time, samples.values)
    return FORCES[spec.kind](**spec.model_dump(exclude={"kind"}))


def _along(scene: Scene, field: str, own: Direction | None, transverse: np.ndarray | None) -> Direction | np.ndarray:
    direction = transverse if own is None else own
    if direction is None:
        refuse(scene, f"{field}.direction", None, "a direction: only a structure of beams has one of its own")
    return direction


def _course(scene: Scene, field: str, spec: CourseSpec) -> Any:
    if isinstance(spec, SampledCourse):
        return _samples(scene, field, spec)
    if isinstance(spec, AccelerogramCourse):
        samples = _samples(scene, field, spec)
        return Accelerogram(samples.time, samples.values, spec.factor)
    return COURSES[spec.kind](**spec.model_dump(exclude={"kind"}))


def _samples(scene: Scene, field: str, spec: Samples) -> Sampled:
    if spec.csv is None:
        return inside(f"{scene.path}: {field}", lambda: Sampled(spec.time, spec.values))  # type: ignore[arg-type]
    return inside(f"{scene.path}: {field}", lambda: Sampled.from_csv(scene.path.parent / str(spec.csv), spec.column))


def _phrase(spec: LoadSpec) -> str:
    if isinstance(spec, GravitySpec):
        return f"a weight of {spec.acceleration:+g} m/s²"
    if isinstance(spec, BaseMotionSpec):
        exceptions = f", which {' and '.join(spec.fixed_stops)} does not follow" if spec.fixed_stops else ""
        return f"a base {_motion_phrase(spec.course)}{exceptions}"
    if isinstance(spec, StopMotionSpec):
        return f"a stop of {spec.contact} {_motion_phrase(spec.course)}"
    if isinstance(spec, ConstantLoadSpec):
        return f"a constant force of {spec.force:+g} N at {place_phrase(spec.at)}"
    return f"a force at {place_phrase(spec.at)} of {_course_phrase(spec, 'N')}"


def _course_phrase(spec: HarmonicCourse | SampledCourse | SweepCourse, unit: str) -> str:
    if isinstance(spec, HarmonicCourse):
        return f"{spec.amplitude:g} {unit}, harmonic at {spec.frequency_hz:g} Hz"
    if isinstance(spec, SweepCourse):
        span = f"{spec.start_hz:g} to {spec.end_hz:g} Hz in {spec.duration:g} s"
        return f"{spec.amplitude:g} {unit}, swept from {span} ({spec.law})"
    return _sample_phrase(spec)


def _motion_phrase(spec: CourseSpec) -> str:
    """How a base or a stop moves."""
    if isinstance(spec, AccelerogramCourse):
        return f"that accelerates by {spec.factor:g} m/s² times {_sample_phrase(spec)}"
    return f"that moves by {_course_phrase(spec, 'm')}"


def _sample_phrase(spec: Samples) -> str:
    return f"samples from {spec.csv}" if spec.csv else f"{len(spec.time or ())} samples"
