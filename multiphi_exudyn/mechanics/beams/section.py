"""Section: a prismatic piece of a Timoshenko beam, and the matrices of an element of it.

The exact static stiffness of the Timoshenko beam, with the shear flexibility Phi = 12 EI / (k G A l^2), and the
consistent mass of its cubic shape functions, rotary inertia included, in (w, theta) of the element's two ends
(J. S. Przemieniecki, Theory of Matrix Structural Analysis, 1968, 11.5).
"""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.structures.arguments import is_real

__all__ = ["Section", "check_numbers", "element_mass", "element_stiffness"]


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
