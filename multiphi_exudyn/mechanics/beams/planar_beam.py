"""Straight planar Timoshenko beam bending in x-z, as a linear structure.

Two-node elements (section.py). Each node has the deflection w [m], positive along +z, and the rotation theta [rad],
positive if w increases with x (theta = dw/dx without shear).
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.beams.beam import COINCIDENT, Beam
from multiphi_exudyn.mechanics.beams.section import element_mass, element_stiffness
from multiphi_exudyn.mechanics.structures.arguments import Matrix
from multiphi_exudyn.mechanics.structures.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.structures.structure import LinearStructure

__all__ = ["beam_deflections", "beam_nodes", "planar_beam"]


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
