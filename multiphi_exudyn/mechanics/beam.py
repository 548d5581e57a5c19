"""Straight planar Timoshenko beam bending in x-z: its sections, point masses, clamp and points, and its matrices.

Two-node elements: the exact static stiffness of the Timoshenko beam, with the shear flexibility Phi = 12 EI / (k G A
l^2), and the consistent mass of its cubic shape functions, rotary inertia included, in (w, theta) of the element's two
ends (J. S. Przemieniecki, Theory of Matrix Structural Analysis, 1968, 11.5).

Each node has the deflection w [m], positive along +z, and the rotation theta [rad], positive if w increases with x
(theta = dw/dx without shear).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix, is_real
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = [
    "Beam",
    "Clamp",
    "PointMass",
    "Section",
    "beam_deflections",
    "beam_nodes",
    "check_numbers",
    "element_mass",
    "element_stiffness",
    "planar_beam",
]


COINCIDENT = 1e-9  # of the beam's length: positions closer than this are one node


@dataclass(frozen=True)
class Section:
    """A prismatic piece of a Timoshenko beam, from ``start`` to ``end``.

    Parameters
    ----------
    start, end : float
        Positions along the beam [m], start < end. The following arguments are given by name.
    youngs_modulus : float
        E [Pa].
    density : float
        rho [kg/m3].
    area : float
        A [m2].
    second_moment : float
        I [m4].
    shear_modulus : float
        G [Pa].
    shear_factor : float, default 5/6
        k in the shear stiffness k G A.

    Raises
    ------
    MultiPhiTypeError
        For values that are not numbers.
    MultiPhiValueError
        For start >= end, and for a property that is not finite and > 0.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> steel = {"youngs_modulus": 2.1e11, "density": 7850.0, "shear_modulus": 8.1e10}
    >>> strip = mp.Section(0.0, 0.3, area=1e-4, second_moment=2.08e-10, **steel)
    >>> round(strip.shear_factor, 3)
    0.833
    """

    start: float
    end: float
    _: KW_ONLY
    youngs_modulus: float
    density: float
    area: float
    second_moment: float
    shear_modulus: float
    shear_factor: float = 5 / 6

    def __post_init__(self) -> None:
        check_numbers("section", start=self.start, end=self.end)
        if not (math.isfinite(self.start) and math.isfinite(self.end) and self.start < self.end):
            raise MultiPhiValueError(f"section: got start {self.start!r}, end {self.end!r}, need start < end")
        for name in ("youngs_modulus", "density", "area", "second_moment", "shear_modulus", "shear_factor"):
            _positive(f"section {name}", getattr(self, name))

    @classmethod
    def rectangle(
        cls,
        start: float,
        end: float,
        *,
        width: float,
        height: float,
        youngs_modulus: float,
        density: float,
        poisson_ratio: float = 0.3,
    ) -> Section:
        """A section with a rectangular area, whose shear modulus follows from the Poisson ratio: G = E / (2 (1 + nu)).

        Parameters
        ----------
        start, end : float
            Positions along the beam [m].
        width, height : float
            Sides of the rectangle [m], height along z, in which the beam bends.
        youngs_modulus : float
            E [Pa].
        density : float
            rho [kg/m3].
        poisson_ratio : float, default 0.3
            nu, -1 < nu <= 0.5.

        Examples
        --------
        >>> import multiphi_exudyn as mp
        >>> steel = {"youngs_modulus": 2.1e11, "density": 7850.0}
        >>> strip = mp.Section.rectangle(0.0, 0.3, width=0.02, height=0.005, **steel)
        >>> print(f"{strip.second_moment:.3g} m4")
        2.08e-10 m4
        """
        check_numbers("rectangle", poisson_ratio=poisson_ratio)
        if not -1 < poisson_ratio <= 0.5:
            raise MultiPhiValueError(f"poisson_ratio: got {poisson_ratio!r}, need -1 < poisson_ratio <= 0.5")
        return cls(
            start,
            end,
            youngs_modulus=youngs_modulus,
            density=density,
            area=_positive("width", width) * _positive("height", height),
            second_moment=width * height**3 / 12,
            shear_modulus=_positive("youngs_modulus", youngs_modulus) / (2 * (1 + poisson_ratio)),
        )


def element_stiffness(section: Section, length: float) -> np.ndarray:
    """K (4, 4) of an element of this length [m]."""
    bending = section.youngs_modulus * section.second_moment
    phi = _shear_flexibility(section, length)
    a, b = 6 * length, length**2
    return (
        bending
        / (length**3 * (1 + phi))
        * np.array(
            [
                [12, a, -12, a],
                [a, (4 + phi) * b, -a, (2 - phi) * b],
                [-12, -a, 12, -a],
                [a, (2 - phi) * b, -a, (4 + phi) * b],
            ]
        )
    )


def element_mass(section: Section, length: float) -> np.ndarray:
    """M (4, 4), the integral of N^T rho A N + S^T rho I S over the element, by an exact Gauss quadrature."""
    phi = _shear_flexibility(section, length)
    abscissae, weights = np.polynomial.legendre.leggauss(4)  # exact to degree 7; the integrand has degree 6
    matrix = np.zeros((4, 4))
    for s, weight in zip((abscissae + 1) / 2, weights * length / 2, strict=True):
        deflection, rotation = _shape_functions(s, phi, length)
        matrix += weight * section.density * section.area * np.outer(deflection, deflection)
        matrix += weight * section.density * section.second_moment * np.outer(rotation, rotation)
    return matrix


def _shape_functions(s: float, phi: float, length: float) -> tuple[np.ndarray, np.ndarray]:
    deflection = np.array(
        [
            1 - 3 * s**2 + 2 * s**3 + phi * (1 - s),
            length * (s - 2 * s**2 + s**3 + phi * (s - s**2) / 2),
            3 * s**2 - 2 * s**3 + phi * s,
            length * (-(s**2) + s**3 - phi * (s - s**2) / 2),
        ]
    )
    rotation = np.array(
        [
            6 * (s**2 - s) / length,
            1 - 4 * s + 3 * s**2 + phi * (1 - s),
            6 * (s - s**2) / length,
            -2 * s + 3 * s**2 + phi * s,
        ]
    )
    return deflection / (1 + phi), rotation / (1 + phi)


def _shear_flexibility(section: Section, length: float) -> float:
    shear = section.shear_factor * section.shear_modulus * section.area
    return 12 * section.youngs_modulus * section.second_moment / (shear * length**2)


def _positive(name: str, value: float) -> float:
    if not is_real(value):
        raise MultiPhiTypeError(f"{name}: got {value!r}, need a number")
    if not (math.isfinite(value) and value > 0):
        raise MultiPhiValueError(f"{name}: got {value!r}, need a finite value > 0")
    return float(value)


def check_numbers(of: str, **values: Any) -> None:
    """Raise MultiPhiTypeError for a value that is not a number."""
    for name, value in values.items():
        if not is_real(value):
            raise MultiPhiTypeError(f"{of} {name}: got {value!r}, need a number")


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


def beam_nodes(beam: Beam, elements: int) -> np.ndarray:
    """Node positions [m], ascending: a node at every named point, mass and section end.

    elements: desired number of elements; the intervals between these positions are divided into equal elements not
    longer than length / elements, so there may be a few more.
    """
    if not isinstance(beam, Beam):
        raise MultiPhiTypeError(f"beam: got {type(beam).__name__}, need a Beam")
    if isinstance(elements, bool) or not isinstance(elements, (int, np.integer)):
        raise MultiPhiTypeError(f"elements: got {elements!r}, need an integer >= 1")
    if elements < 1:
        raise MultiPhiValueError(f"elements: got {elements}, need an integer >= 1")
    positions = np.sort(
        np.array(
            [beam.start]
            + [s.end for s in beam.sections]
            + list(beam.points.values())
            + [mass.at for mass in beam.masses]
        )
    )
    positions = positions[np.concatenate(([True], np.diff(positions) > COINCIDENT * beam.length))]
    longest = beam.length / elements
    pieces = [
        np.linspace(left, right, math.ceil((right - left) / longest - 1e-9) + 1)[:-1]
        for left, right in pairwise(positions)
    ]
    return np.concatenate([*pieces, [beam.end]])


def planar_beam(
    beam: Beam, elements: int = 57, damping: Matrix | ModalDamping | RayleighDamping | None = None
) -> LinearStructure:
    """A straight planar Timoshenko beam, bending in x-z, as a linear structure.

    Two-node elements with the exact static stiffness of the Timoshenko beam and the consistent mass of its cubic shape
    functions, rotary inertia included (J. S. Przemieniecki, Theory of Matrix Structural Analysis, 1968, 11.5). Degrees
    of freedom: deflection w [m], positive along +z, and rotation theta [rad], positive if w increases with x, of every
    node from the clamped end, without those that a rigid clamp fixes.

    Parameters
    ----------
    beam : Beam
        Sections, points, masses and clamp.
    elements : int, default 57
        Desired number; there is a node at every point, mass and section end, so there may be a few more.
    damping : array (n, n), ModalDamping, RayleighDamping or None, default None
        As of a LinearStructure.

    Returns
    -------
    LinearStructure
        Its points are the deflections w [m] at ``beam.points``.

    Raises
    ------
    MultiPhiTypeError
        For an argument that is not a Beam, and a number of elements that is not an integer.
    MultiPhiValueError
        For elements < 1, and for arguments that LinearStructure refuses.

    Examples
    --------
    >>> import multiphi_exudyn as mp
    >>> steel = {"youngs_modulus": 2.1e11, "density": 7850.0}
    >>> strip = mp.Section.rectangle(0.0, 0.3, width=0.02, height=0.005, **steel)
    >>> cantilever = mp.planar_beam(mp.Beam([strip], points={"tip": 0.3}), elements=20)
    >>> print(mp.MultiPhiModel(cantilever, modes=3).level(()).frequencies.round(0))  # Hz
    [ 46. 290. 812.]
    """
    if not isinstance(beam, Beam):
        raise MultiPhiTypeError(f"beam: got {type(beam).__name__}, need a Beam")
    nodes = beam_nodes(beam, elements)
    mass = np.zeros((2 * len(nodes), 2 * len(nodes)))
    stiffness = np.zeros_like(mass)
    for i, (left, right) in enumerate(pairwise(nodes)):
        dofs = slice(2 * i, 2 * i + 4)
        section = beam.section_at((left + right) / 2)
        mass[dofs, dofs] += element_mass(section, right - left)
        stiffness[dofs, dofs] += element_stiffness(section, right - left)
    for point_mass in beam.masses:
        dof = 2 * _node_at(nodes, point_mass.at)
        mass[dof, dof] += point_mass.mass
        mass[dof + 1, dof + 1] += point_mass.inertia
    for dof, spring in enumerate((beam.clamp.translation, beam.clamp.rotation)):
        if not math.isinf(spring):
            stiffness[dof, dof] += spring
    rows = _dof_rows(beam, nodes)
    free = np.flatnonzero(np.any(rows, axis=1))
    points = {name: rows[2 * _node_at(nodes, x)] for name, x in beam.points.items()}
    return LinearStructure(mass[np.ix_(free, free)], stiffness[np.ix_(free, free)], damping, points)


def beam_deflections(beam: Beam, elements: int = 57) -> tuple[np.ndarray, np.ndarray]:
    """Node positions x (k,) [m] and the rows (k, n) of their deflections w in ``planar_beam(beam, elements)``."""
    nodes = beam_nodes(beam, elements)
    return nodes, _dof_rows(beam, nodes)[::2]


def _dof_rows(beam: Beam, nodes: np.ndarray) -> np.ndarray:
    """Rows (2 k, n) of (w, theta) of every node in the free DoFs; zero for those that a rigid clamp fixes."""
    fixed = [dof for dof, spring in enumerate((beam.clamp.translation, beam.clamp.rotation)) if math.isinf(spring)]
    return np.delete(np.eye(2 * len(nodes)), fixed, axis=1)


def _node_at(nodes: np.ndarray, x: float) -> int:
    return int(np.argmin(np.abs(nodes - x)))
