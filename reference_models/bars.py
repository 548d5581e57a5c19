"""Linear finite elements of an elastic bar: EA u_xx = rho A u_tt, consistent mass.

The bars of ``exact``, discretised, as structures: their DoFs are the displacements u of the nodes, ascending
from x = 0.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.mechanics.structure import LinearStructure
from reference_models.exact import BouncingBar

__all__ = ["clamped_bar", "elastic_bar", "free_bar", "nodes"]


def nodes(elements: int, length: float) -> np.ndarray:
    """Positions of all nodes, (elements + 1,)."""
    return np.linspace(0.0, length, elements + 1)


def clamped_bar(elements: int) -> LinearStructure:
    """The bar of ``exact.ClampedBar``: EA = rho A = L = 1, the node at x = 1 held and left out.

    Point ``contact``: u(0), whose gap is zero.
    """
    mass, stiffness = _matrices(elements, 1 / elements, stiffness=1.0, density=1.0)
    return LinearStructure(mass[:-1, :-1], stiffness[:-1, :-1], points={"contact": 0})


def free_bar(elements: int) -> LinearStructure:
    """The bar of ``exact.BouncingBar``, free at both ends; see ``elastic_bar``."""
    bar = BouncingBar()
    return elastic_bar(elements, bar.length, stiffness=bar.modulus, density=bar.density)


def elastic_bar(elements: int, length: float, *, stiffness: float, density: float) -> LinearStructure:
    """A bar free at both ends: EA [N], rho A [kg/m].

    Points ``bottom``, ``top`` and ``centre``, the centre of mass: the force -rho A L g there is the weight.
    """
    mass, stiffnesses = _matrices(elements, length / elements, stiffness=stiffness, density=density)
    centre = mass.sum(axis=0) / mass.sum()
    return LinearStructure(mass, stiffnesses, points={"bottom": 0, "top": elements, "centre": centre})


def _matrices(elements: int, size: float, *, stiffness: float, density: float) -> tuple[np.ndarray, np.ndarray]:
    """Assembled rho A h/6 [2 1; 1 2] and EA/h [1 -1; -1 1]."""
    ends = np.r_[1.0, np.full(elements - 1, 2.0), 1.0]
    beside = np.eye(elements + 1, k=1) + np.eye(elements + 1, k=-1)
    mass = density * size / 6 * (2 * np.diag(ends) + beside)
    return mass, stiffness / size * (np.diag(ends) - beside)
