"""Moving supports: stops and bases that move, the boundary values x_k(t) of (38.4).

A moving stop changes a gap, g = h.x + gap - z(t). A moving base moves the whole structure, and x is the displacement
relative to it:

    M x'' + C x' + K x = f - M e z''(t)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.loads.samples import Accelerogram, Sampled
from multiphi_exudyn.mechanics.loads.time_functions import Harmonic, Smooth, Sweep, TimeFunction, check_time_function
from multiphi_exudyn.mechanics.structures.structure import At

__all__ = ["BaseMotion", "StopMotion", "StopsMotion"]


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
