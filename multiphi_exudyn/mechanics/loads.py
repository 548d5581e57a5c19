"""Loads and moving supports: f(t) in M x'' + C x' + K x = f(t) (eq. 38.1), and the boundary values x_k(t) of (38.4).

A load is a place and a course (time_functions.py),

    f(t) = p u(t)

a moving stop adds its way to a gap, g = h.x + gap - z(t), and a moving base moves the whole structure, x being what
remains relative to it:

    M x'' + C x' + K x = f - M e z''(t)

A constant load belongs to the asymptotic configuration of every level, so that it is exact for any number of modes.
"""

from __future__ import annotations

import functools
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.structure import At, LinearStructure
from multiphi_exudyn.mechanics.time_functions import (
    Harmonic,
    Sampled,
    Smooth,
    Sweep,
    TimeFunction,
    check_numbers,
    check_time_function,
)

__all__ = [
    "BaseMotion",
    "ConstantLoad",
    "FunctionLoad",
    "Gravity",
    "HarmonicLoad",
    "Load",
    "SampledLoad",
    "StaticLoad",
    "StopMotion",
    "SweepLoad",
    "VaryingLoad",
    "patterns",
    "unchanging",
]


@dataclass(frozen=True)
class ConstantLoad:
    """f(t) = p force.

    at: where, a point name, {point: coefficient} or an (n,) row p. force: N (N m on a rotation).
    """

    at: At
    force: float

    def __post_init__(self) -> None:
        check_numbers("load", force=self.force)

    def row(self, structure: LinearStructure) -> np.ndarray:
        """The static force (n,)."""
        return self.force * structure.row(self.at)


@dataclass(frozen=True)
class Gravity:
    """f = M e acceleration: the weight of the whole structure.

    direction: e, what a unit of rigid-body motion along gravity moves every degree of freedom by, a row (n,),
    {point: coefficient} or a point's name. acceleration: m/s2.
    """

    direction: At
    acceleration: float = 9.81

    def __post_init__(self) -> None:
        if np.isscalar(self.direction) and not isinstance(self.direction, str):
            raise MultiPhiTypeError(
                f"gravity direction: got {self.direction!r}, need a point's name, {{point: coefficient}} or a row (n,) "
                "that moves every degree of freedom along gravity, as in Gravity(e, 9.81)"
            )
        check_numbers("gravity", acceleration=self.acceleration)

    def row(self, structure: LinearStructure) -> np.ndarray:
        """The static force (n,)."""
        return np.asarray(self.acceleration * (structure.mass @ structure.row(self.direction)))


@dataclass(frozen=True, eq=False)
class VaryingLoad(ABC):
    """f(t) = p u(t). at: where, as in ConstantLoad."""

    at: At

    def __post_init__(self) -> None:
        _ = self.course  # checked by being made

    @property
    @abstractmethod
    def course(self) -> TimeFunction:
        """u(t)."""


@dataclass(frozen=True, eq=False)
class HarmonicLoad(VaryingLoad):
    """f(t) = p amplitude cos(2 pi frequency_hz t + phase). at: as in ConstantLoad. amplitude: N. phase: rad.

    Several of them make a sum of harmonics.
    """

    amplitude: float
    frequency_hz: float
    phase: float = 0.0

    @property
    def course(self) -> Harmonic:
        """u(t)."""
        return Harmonic(self.amplitude, self.frequency_hz, self.phase)


@dataclass(frozen=True, eq=False)
class SampledLoad(VaryingLoad):
    """f(t) = p u(t), straight lines between samples: time (k,) [s], force (k,) [N]; zero outside them.

    at: as in ConstantLoad. ``Sampled.from_csv`` reads samples from a file.
    """

    time: np.ndarray
    force: np.ndarray

    def __post_init__(self) -> None:
        course = self.course
        object.__setattr__(self, "time", course.time)
        object.__setattr__(self, "force", course.values)

    @functools.cached_property
    def course(self) -> Sampled:
        """u(t)."""
        return Sampled(self.time, self.force)


@dataclass(frozen=True, eq=False)
class FunctionLoad(VaryingLoad):
    """f(t) = p function(t), a function of time [s]; tolerance: of the response; breaks: where it jumps; see Smooth."""

    function: Callable[[Any], Any]
    tolerance: float = 1e-9
    breaks: Sequence[float] = ()

    @property
    def course(self) -> Smooth:
        """u(t)."""
        return Smooth(self.function, self.tolerance, self.breaks)


@dataclass(frozen=True, eq=False)
class SweepLoad(VaryingLoad):
    """f(t) = p amplitude cos(phase(t)) from start_hz to end_hz in ``duration`` [s]; law, tolerance: see Sweep."""

    amplitude: float
    start_hz: float
    end_hz: float
    duration: float
    law: str = "linear"
    tolerance: float = 1e-9

    @property
    def course(self) -> Sweep:
        """u(t)."""
        return Sweep(self.amplitude, self.start_hz, self.end_hz, self.duration, self.law, self.tolerance)


@dataclass(frozen=True, eq=False)
class StopMotion:
    """A contact whose stop moves: g = h.x + gap - z(t). contact: its name. course: z(t) [m], away from the stop.

    The stop of a rigid contact may not jump in velocity, so its course is Harmonic, Smooth or Sweep.
    """

    contact: str
    course: TimeFunction

    def __post_init__(self) -> None:
        check_time_function("stop motion", self.course)
        _check_contacts("stop motion contact", [self.contact], "the name of a contact")


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """A base that moves by e z(t); x is then relative to it, x_absolute = x + e z.

    direction: e, as in Gravity. course: z(t) [m], twice differentiable: Harmonic, Smooth or Sweep.
    fixed_stops: names of the contacts whose stops stay where they are; all others move with the base.
    """

    direction: At
    course: Harmonic | Smooth | Sweep
    fixed_stops: Sequence[str] = ()

    def __post_init__(self) -> None:
        check_time_function("base motion", self.course)
        if isinstance(self.course, Sampled):
            raise MultiPhiTypeError("base motion: got Sampled, whose acceleration is infinite, need a smooth course")
        _check_contacts("base motion fixed_stops", self.fixed_stops, "a tuple of contact names")


def patterns(structure: LinearStructure, loads: Any) -> np.ndarray:
    """Rows (k, n) of loads that act elsewhere than at points of the structure: given as a row, or on all its mass."""
    found = [np.zeros((0, structure.n))]
    for load in loads if isinstance(loads, (tuple, list)) else ():
        if isinstance(load, (Gravity, BaseMotion)):
            found.append((structure.mass @ structure.row(load.direction))[None, :])
        elif isinstance(load, (ConstantLoad, VaryingLoad)) and not isinstance(load.at, (str, Mapping)):
            found.append(structure.row(load.at)[None, :])
    return np.vstack(found)


def unchanging(loads: Any) -> tuple[Any, ...] | None:
    """Loads as they are known by where nobody can change what they are; None where somebody can.

    A function may give another value tomorrow, a row or a mapping other numbers.
    """
    return tuple(loads) if isinstance(loads, (tuple, list)) and all(map(_unchanging, loads)) else None


def _unchanging(load: Any) -> bool:
    if isinstance(load, StopMotion):
        return isinstance(load.course, (Harmonic, Sampled, Sweep))
    place = load.direction if isinstance(load, Gravity) else getattr(load, "at", None)
    return isinstance(load, (ConstantLoad, Gravity, HarmonicLoad, SampledLoad, SweepLoad)) and isinstance(place, str)


StaticLoad: TypeAlias = "ConstantLoad | Gravity"
Load: TypeAlias = "StaticLoad | VaryingLoad | StopMotion | BaseMotion"


def _check_contacts(what: str, given: Any, needed: str) -> None:
    if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(name, str) for name in given):
        raise MultiPhiTypeError(f"{what}: got {given!r}, need {needed}")
    if not all(given):
        raise MultiPhiValueError(f"{what}: got an empty name, need {needed}")
