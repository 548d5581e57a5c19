"""Description of a straight planar beam: sections, point masses, a clamp and named points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.beams.section import Section, check_numbers
from multiphi_exudyn.mechanics.structures.arguments import is_real

__all__ = ["Beam", "Clamp", "PointMass"]

COINCIDENT = 1e-9  # of the beam's length: positions closer than this are one node


@dataclass(frozen=True)
class PointMass:
    """A mass with rotary inertia that is fixed to the beam.

    Parameters
    ----------
    at : float
        Position along the beam [m].
    mass : float
        m [kg], >= 0.
    inertia : float, default 0.0
        J [kg m2], >= 0.

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For values that are negative or not finite.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> mp.PointMass(at=0.3, mass=0.05)
    PointMass(at=0.3, mass=0.05, inertia=0.0)
    """

    at: float
    mass: float
    inertia: float = 0.0

    def __post_init__(self) -> None:
        check_numbers("point mass", at=self.at, mass=self.mass, inertia=self.inertia)
        if not (math.isfinite(self.mass + self.inertia) and min(self.mass, self.inertia) >= 0):
            raise MultiPhiValueError(f"point mass: got mass {self.mass!r}, inertia {self.inertia!r}, need values >= 0")
        if not math.isfinite(self.at):
            raise MultiPhiValueError(f"point mass: got at {self.at!r}, need a place on the beam in m")


@dataclass(frozen=True)
class Clamp:
    """The support of the beam's first end.

    Parameters
    ----------
    translation : float, default inf
        Stiffness [N/m] against the deflection w, >= 0; infinite for a rigid support, zero for none.
    rotation : float, default inf
        Stiffness [N m/rad] against the rotation theta, >= 0; infinite for a rigid clamp, zero for a hinge.

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For negative values.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> mp.Clamp(rotation=5e3)
    Clamp(translation=inf, rotation=5000.0)
    """

    translation: float = math.inf
    rotation: float = math.inf

    def __post_init__(self) -> None:
        check_numbers("clamp", translation=self.translation, rotation=self.rotation)
        if not (self.translation >= 0 and self.rotation >= 0):
            raise MultiPhiValueError(
                f"clamp: got translation {self.translation!r}, rotation {self.rotation!r}, need values >= 0"
            )


@dataclass(frozen=True)
class Beam:
    """Description of a straight planar beam; every model of it is built from this one object.

    Parameters
    ----------
    sections : sequence of Section
        Adjacent sections, without a gap between them.
    points : mapping of str to float, default empty
        Name to position x [m] along the beam.
    masses : sequence of PointMass, default ()
        Masses fixed to the beam.
    clamp : Clamp, default rigid
        Support of the first end.

    Raises
    ------
    MultiPhiTypeError
        For items of another kind.
    MultiPhiValueError
        For no section, sections with a gap between them, and points or masses beyond the ends.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> steel = {"youngs_modulus": 2.1e11, "density": 7850.0}
    >>> strip = mp.Section.rectangle(0.0, 0.3, width=0.02, height=0.005, **steel)
    >>> beam = mp.Beam([strip], {"tip": 0.3}, [mp.PointMass(at=0.3, mass=0.05)])
    >>> beam.length
    0.3
    """

    sections: Sequence[Section]
    points: Mapping[str, float] = field(default_factory=dict)
    masses: Sequence[PointMass] = ()
    clamp: Clamp = field(default_factory=Clamp)

    def __post_init__(self) -> None:
        object.__setattr__(self, "sections", _each_a("sections", self.sections, Section))
        object.__setattr__(self, "masses", _each_a("masses", self.masses, PointMass))
        object.__setattr__(self, "points", _positions(self.points))
        if not isinstance(self.clamp, Clamp):
            raise MultiPhiTypeError(f"clamp: got {type(self.clamp).__name__}, need a Clamp")
        if not self.sections:
            raise MultiPhiValueError("sections: got none, need at least one Section")
        for left, right in pairwise(self.sections):
            if abs(left.end - right.start) > COINCIDENT * self.length:
                raise MultiPhiValueError(
                    f"sections: one ends at {left.end:g} m, the next starts at {right.start:g} m; need no gap"
                )
        positions = {f"points[{name!r}]": x for name, x in self.points.items()}
        positions |= {f"point mass {i}": mass.at for i, mass in enumerate(self.masses)}
        for name, x in positions.items():
            if not self.start <= x <= self.end:
                raise MultiPhiValueError(f"{name}: got x = {x!r} m, need {self.start:g} <= x <= {self.end:g}")

    @property
    def start(self) -> float:
        """Position of the clamped end [m]."""
        return self.sections[0].start

    @property
    def end(self) -> float:
        """Position of the far end [m]."""
        return self.sections[-1].end

    @property
    def length(self) -> float:
        """Length [m]."""
        return self.end - self.start

    def section_at(self, x: float) -> Section:
        """Section at x [m]; at a boundary the section that begins there."""
        return next((s for s in self.sections if x < s.end), self.sections[-1])


def _each_a(name: str, given: Any, kind: type) -> tuple[Any, ...]:
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"{name}: got {type(given).__name__}, need a sequence of {kind.__name__}")
    items = tuple(given)
    for i, item in enumerate(items):
        if not isinstance(item, kind):
            raise MultiPhiTypeError(f"{name}[{i}]: got {type(item).__name__}, need a {kind.__name__}")
    return items


def _positions(points: Any) -> dict[str, float]:
    if not isinstance(points, Mapping):
        raise MultiPhiTypeError(f"points: got {type(points).__name__}, need {{name: position in m}}")
    for name, x in points.items():
        if not isinstance(name, str) or not name:
            raise MultiPhiTypeError(f"points: got the name {name!r}, need a non-empty string")
        if not is_real(x):
            raise MultiPhiTypeError(f"points[{name!r}]: got {x!r}, need a position in m")
    return dict(points)
