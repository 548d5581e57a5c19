"""Loads: forces at points that vary or not, weight, and supports that move (eqs. 38.1, 38.4).

A load that varies has a point, with the row p, and a function of time (time_functions.py),

    f(t) = p u(t)

Static loads,

    f = p F,   f = M e g

are part of the asymptotic configuration of every level, so they are exact for any number of modes.

A moving stop changes a gap, g = h.x + gap - z(t). A moving base moves the whole structure, and x is the displacement
relative to it:

    M x'' + C x' + K x = f - M e z''(t)
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
    Accelerogram,
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
    "StopsMotion",
    "SweepLoad",
    "VaryingLoad",
    "patterns",
    "unchanging",
]


@dataclass(frozen=True, eq=False)
class VaryingLoad(ABC):
    """A load f(t) = p u(t); at: its point, as in ConstantLoad."""

    at: At

    def __post_init__(self) -> None:
        _ = self.course  # its constructor checks the arguments

    @property
    @abstractmethod
    def course(self) -> TimeFunction:
        """u(t)."""


@dataclass(frozen=True, eq=False)
class HarmonicLoad(VaryingLoad):
    """A harmonic force at a point, f(t) = p amplitude cos(2 pi frequency_hz t + phase).

    Several of them make a sum of harmonics.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, point of the force: a point name, {point: coefficient} or a row.
    amplitude : float
        [N], [N m] on a rotation.
    frequency_hz : float
        [Hz], >= 0.
    phase : float, default 0.0
        [rad].

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For values that are not finite, and a frequency < 0.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> shaker = mp.HarmonicLoad("tip", amplitude=20.0, frequency_hz=12.0)
    >>> tr = mp.simulate(model, 0.5, loads=[shaker])
    >>> tr.status
    'ok'
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
    """A force at a point with straight lines between samples, zero outside them: f(t) = p u(t).

    ``Sampled.from_csv`` reads samples from a file.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, point of the force: a point name, {point: coefficient} or a row.
    time : array (k,)
        Ascending times [s], two or more.
    force : array (k,)
        u [N], [N m] on a rotation.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers.
    MultiPhiValueError
        For fewer than two samples, unequal numbers of times and forces, times that do not ascend, and values that are
        not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> pulse = mp.SampledLoad("tip", time=[0.0, 0.01, 0.02], force=[0.0, -50.0, 0.0])
    >>> tr = mp.simulate(model, 0.5, loads=[pulse])
    >>> tr.events[0].kind
    'close'
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
    """A force at a point that is a function of time, f(t) = p function(t).

    It is sampled: a feature shorter than 4.2e-5 of a run's length may be missed (1.1e-4 for a function of single
    times), unless ``breaks`` enclose it.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, point of the force: a point name, {point: coefficient} or a row.
    function : callable
        Force [N] as a function of time [s], of (k,) times or of single ones.
    tolerance : float, default 1e-9
        Tolerance of the response, relative to its largest value; 1e-12 <= tolerance < 1.
    breaks : sequence of float, default ()
        Times [s] at which the function or a derivative jumps; jumps that show in the samples are found without.

    Raises
    ------
    MultiPhiTypeError
        For arguments that are not a function, a number, or a sequence of times.
    MultiPhiValueError
        For a tolerance out of range; in a run, for a function that does not give finite numbers.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> burst = mp.FunctionLoad("tip", lambda t: 50.0 * np.exp(-20 * t) * np.sin(80 * t))
    >>> mp.simulate(model, 0.5, loads=[burst]).status
    'ok'
    """

    function: Callable[[Any], Any]
    tolerance: float = 1e-9
    breaks: Sequence[float] = ()

    @property
    def course(self) -> Smooth:
        """u(t)."""
        return Smooth(self.function, self.tolerance, self.breaks)


@dataclass(frozen=True, eq=False)
class SweepLoad(VaryingLoad):
    """A swept sine at a point, f(t) = p amplitude cos(phase(t)), from start_hz to end_hz, then zero.

        linear        f = start + (end - start) t / T
        logarithmic   f = start (end / start)^(t / T)

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, point of the force: a point name, {point: coefficient} or a row.
    amplitude : float
        [N], [N m] on a rotation.
    start_hz, end_hz : float
        Frequencies [Hz] at the start and the end, > 0.
    duration : float
        T [s], > 0.
    law : str, default "linear"
        "linear" or "logarithmic".
    tolerance : float, default 1e-9
        Tolerance of the response, relative to its largest value; 1e-12 <= tolerance < 1.

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For numbers out of these ranges, and another law.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> sweep = mp.SweepLoad("tip", 20.0, start_hz=5.0, end_hz=25.0, duration=1.0)
    >>> mp.simulate(model, 1.0, loads=[sweep]).status
    'ok'
    """

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


def patterns(structure: LinearStructure, loads: Any) -> np.ndarray:
    """Rows (k, n) of loads that do not act at a named point: those given as a row, or on the whole mass."""
    rows = [np.zeros((0, structure.n))]
    for load in loads if isinstance(loads, (tuple, list)) else ():
        if isinstance(load, (Gravity, BaseMotion)):
            rows.append((structure.mass @ structure.row(load.direction))[None, :])
        elif isinstance(load, (ConstantLoad, VaryingLoad)) and not isinstance(load.at, (str, Mapping)):
            rows.append(structure.row(load.at)[None, :])
    return np.vstack(rows)


def unchanging(loads: Any) -> tuple[Any, ...] | None:
    """Loads as a key of a cache if their values cannot change; else None.

    A function may return other values later, and a row or a mapping may be modified.
    """
    return tuple(loads) if isinstance(loads, (tuple, list)) and all(map(_unchanging, loads)) else None


def _unchanging(load: Any) -> bool:
    if isinstance(load, StopMotion):
        return isinstance(load.course, (Accelerogram, Harmonic, Sampled, Sweep))
    point = load.direction if isinstance(load, Gravity) else getattr(load, "at", None)
    return isinstance(load, (ConstantLoad, Gravity, HarmonicLoad, SampledLoad, SweepLoad)) and isinstance(point, str)


Load: TypeAlias = "StaticLoad | VaryingLoad | StopMotion | StopsMotion | BaseMotion"


@dataclass(frozen=True)
class ConstantLoad:
    """A constant force at a point, f(t) = p force.

    It is part of the asymptotic configuration of every level, so it is exact for any number of modes.

    Parameters
    ----------
    at : str, mapping or array (n,)
        p, point of the force: a point name, {point: coefficient} or a row.
    force : float
        [N], [N m] on a rotation.

    Raises
    ------
    MultiPhiTypeError
        For a force that is not a number.
    MultiPhiValueError
        For a force that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> tr = mp.simulate(model, 0.5, loads=[mp.ConstantLoad("tip", -50.0)])
    >>> tr.events[0].kind
    'close'
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
    """The weight of the whole structure, f = M e acceleration.

    Parameters
    ----------
    direction : array (n,) or mapping
        e (n,): 1 at every translation along gravity, -1 at those against it, 0 at the others; or {point: coefficient}.
    acceleration : float, default 9.81
        [m/s2].

    Raises
    ------
    MultiPhiTypeError
        For a direction that is one point or one number, and an acceleration that is not a number.
    MultiPhiValueError
        For an acceleration that is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> mp.Gravity(-np.ones(3)).row(chain).tolist()
    [-9.81, -9.81, -9.81]
    """

    direction: Mapping[str, float] | np.ndarray
    acceleration: float = 9.81

    def __post_init__(self) -> None:
        if np.isscalar(self.direction):
            raise MultiPhiTypeError(
                f"gravity direction: got {self.direction!r}, need a row (n,): 1 at every degree of freedom that is a "
                "translation along gravity, 0 at the others, as in Gravity(e, 9.81); the weight of a mass at a point "
                "is ConstantLoad(point, -m * 9.81)"
            )
        check_numbers("gravity", acceleration=self.acceleration)

    def row(self, structure: LinearStructure) -> np.ndarray:
        """The static force (n,)."""
        return np.asarray(self.acceleration * (structure.mass @ structure.row(self.direction)))


StaticLoad: TypeAlias = "ConstantLoad | Gravity"


@dataclass(frozen=True, eq=False)
class StopMotion:
    """A contact whose stop moves, g = h.x + gap - z(t).

    The velocity of a rigid contact's stop may not jump: its course is anything but Sampled.

    Parameters
    ----------
    contact : str
        Name of the contact.
    course : Accelerogram, Harmonic, Sampled, Smooth or Sweep
        z(t) [m] along +h, which closes the gap.

    Raises
    ------
    MultiPhiTypeError
        For a name that is not a string, and a course of another kind.
    MultiPhiValueError
        For an empty name.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> tr = mp.simulate(model, 0.5, loads=[mp.StopMotion("stop", mp.Harmonic(2e-3, 8.0))])
    >>> tr.events[0].contact
    'stop'
    """

    contact: str
    course: TimeFunction

    def __post_init__(self) -> None:
        check_time_function("stop motion", self.course)
        _check_contacts("stop motion contact", [self.contact], "the name of a contact")


@dataclass(frozen=True, eq=False)
class StopsMotion:
    """Several contacts whose stops move alike, g_i = h_i.x + gap_i - a_i z(t); amounts: a_i by their names."""

    amounts: Mapping[str, float]
    course: Harmonic


@dataclass(frozen=True, eq=False)
class BaseMotion:
    """A base that moves by e z(t) under the whole structure; x is then relative to it, x_absolute = x + e z.

        M x'' + C x' + K x = f - M e z''(t)

    Parameters
    ----------
    direction : str, mapping or array (n,)
        e, displacement of every degree of freedom in a unit rigid-body motion along that of the base: a row, {point:
        coefficient} or a point name.
    course : Accelerogram, Harmonic, Smooth or Sweep
        z(t) [m], twice differentiable; an Accelerogram is given by samples of z'', in g or in any other unit.
    fixed_stops : sequence of str, default ()
        Names of the contacts whose stops do not move; all others move with the base.

    Raises
    ------
    MultiPhiTypeError
        For a course of another kind, and names that are not a sequence of strings.
    MultiPhiValueError
        For an empty name.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> shaken = mp.BaseMotion(np.ones(3), mp.Harmonic(1e-3, 12.0))
    >>> mp.simulate(model, 0.5, loads=[shaken]).status
    'ok'
    """

    direction: At
    course: Accelerogram | Harmonic | Smooth | Sweep
    fixed_stops: Sequence[str] = ()

    def __post_init__(self) -> None:
        check_time_function("base motion", self.course, twice=True)
        if isinstance(self.course, Sampled):
            raise MultiPhiTypeError(
                "base motion course: got Sampled, a displacement whose acceleration is infinite at its samples, need "
                "Harmonic, Smooth, Sweep, or for samples of an acceleration Accelerogram(time, values, factor=9.81)"
            )
        _check_contacts("base motion fixed_stops", self.fixed_stops, "a tuple of contact names")


def _check_contacts(what: str, given: Any, needed: str) -> None:
    if isinstance(given, str) or not isinstance(given, Sequence) or not all(isinstance(name, str) for name in given):
        raise MultiPhiTypeError(f"{what}: got {given!r}, need {needed}")
    if not all(given):
        raise MultiPhiValueError(f"{what}: got an empty name, need {needed}")
