"""What a run is given as functions of time, from the definitions of loads and courses, not from what the loop makes.

f(t) = sum p u(t) - M e z''(t)   (n,)       z(t), z'(t) of the stop of a contact, seen from the base
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import (
    BaseMotion,
    ConstantLoad,
    FunctionLoad,
    Gravity,
    Load,
    StopMotion,
    StopsMotion,
    SweepLoad,
)
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.mechanics.time_functions import Accelerogram, Harmonic, Sampled, Smooth, Sweep, TimeFunction

__all__ = ["approximated", "forces_at", "stop_motion", "value_at"]


def forces_at(structure: LinearStructure, loads: Sequence[Load], times: np.ndarray, end: float) -> list[np.ndarray]:
    """The forces (n, k) [N] of every load at times (k,) [s]; end [s]: of the run."""
    return [force for load in loads if (force := _force(structure, load, times, end)) is not None]


def _force(structure: LinearStructure, load: Load, times: np.ndarray, end: float) -> np.ndarray | None:
    if isinstance(load, (ConstantLoad, Gravity)):
        return np.outer(load.row(structure), np.ones(len(times)))
    if isinstance(load, (StopMotion, StopsMotion)):
        return None
    if isinstance(load, BaseMotion):
        carried = structure.mass @ structure.row(load.direction)
        return -np.outer(carried, _acceleration(load.course, times, end))
    return np.outer(structure.row(load.at), value_at(load.course, times))


def value_at(course: TimeFunction, times: np.ndarray) -> np.ndarray:
    """u (k,) at times (k,) [s]."""
    if isinstance(course, Harmonic):
        return np.asarray(course.amplitude * np.cos(2 * np.pi * course.frequency_hz * times + course.phase))
    if isinstance(course, Accelerogram):
        return course.displacement(times)
    if isinstance(course, Sampled):
        return np.interp(times, course.time, course.values, left=0.0, right=0.0)
    if isinstance(course, Sweep):
        return np.where(times <= course.duration, course.amplitude * np.cos(course.phase(times)), 0.0)
    return np.array([course.function(t) for t in times.tolist()], float)


def _acceleration(course: TimeFunction, times: np.ndarray, end: float) -> np.ndarray:
    """u'' (k,) at times (k,) [s]."""
    if isinstance(course, Harmonic):
        return -((2 * np.pi * course.frequency_hz) ** 2) * value_at(course, times)
    return course.acceleration(end).at(times)  # type: ignore[union-attr]


def stop_motion(
    structure: LinearStructure, contact: UnilateralContact, loads: Sequence[Load], times: np.ndarray, end: float
) -> tuple[np.ndarray, np.ndarray]:
    """z, z' (k,) [m, m/s] of a contact's stop along +h at times (k,) [s], seen from the base."""
    way, speed = np.zeros(len(times)), np.zeros(len(times))
    for load in loads:
        if isinstance(load, StopMotion) and load.contact == contact.name:
            sign = 1.0
        elif isinstance(load, BaseMotion) and contact.name in load.fixed_stops:
            sign = -float(structure.row(contact.direction) @ structure.row(load.direction))
        else:
            continue
        way += sign * value_at(load.course, times)
        speed += sign * _rate(load.course, times, end)
    return way, speed


def _rate(course: TimeFunction, times: np.ndarray, end: float) -> np.ndarray:
    """u' (k,) at times (k,) [s]."""
    if isinstance(course, Harmonic):
        omega = 2 * np.pi * course.frequency_hz
        return np.asarray(-course.amplitude * omega * np.sin(omega * times + course.phase))
    return course.history(end).derivative.at(times)


def approximated(loads: Sequence[Load]) -> bool:
    """Whether a load or a motion is interpolated to a tolerance, so that its forces are not exact."""
    courses = [load.course for load in loads if not isinstance(load, (ConstantLoad, Gravity))]
    return any(isinstance(load, (FunctionLoad, SweepLoad)) for load in loads) or any(
        isinstance(course, (Smooth, Sweep)) for course in courses
    )
