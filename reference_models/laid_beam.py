"""One planar beam in an Exudyn system: nodes, elements, point masses and clamp, and where its points are.

Elements are ANCFCable2D or ObjectBeamGeometricallyExact2D, point masses are ObjectGenericODE2 items on the beam's own
nodes. A beam's start is always held along its axis; a finite clamp stiffness acts through coordinate springs (on the
slope y' in the ANCF beam, which is the sine of the rotation).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import exudyn.itemInterface as eii
import numpy as np

from multiphi_exudyn.mechanics.beam import Beam, Section, beam_nodes
from reference_models.full_beam_settings import FullBeamSettings

__all__ = ["AXIAL", "DEFLECTION", "LaidBeam", "Place", "bending_coordinates", "coordinate_marker", "lay_beam"]

AXIAL, DEFLECTION = 0, 1  # coordinates of a node of either kind


_ROTATION = {"ancf": 3, "geometrically-exact": 2}  # the slope y', or the angle


_BENDS = {
    "ancf": (False, True, False, True),
    "geometrically-exact": (False, True, True),
}  # of (x, y, x', y'), (x, y, phi)


def bending_coordinates(kind: str, count: int) -> np.ndarray:
    """Which of the ``count`` coordinates of beams, node after node, are deflections or rotations, (count,)."""
    bends = _BENDS[kind]
    return np.tile(bends, count // len(bends))


@dataclass(frozen=True)
class LaidBeam:
    """positions: (nodes,) [m]; elements between its nodes."""

    positions: np.ndarray
    nodes: tuple[Any, ...]
    elements: list[Any]


@dataclass(frozen=True)
class Place:
    """Of a point: its beam and x [m]."""

    beam: LaidBeam
    x: float

    @property
    def number(self) -> int:
        """Number of its node along its beam."""
        return _nearest(self.beam.positions, self.x)

    @property
    def node(self) -> Any:
        """Its node."""
        return self.beam.nodes[self.number]


def lay_beam(mbs: Any, beam: Beam, settings: FullBeamSettings, ground: Any) -> LaidBeam:
    """Nodes and elements of a beam, with its point masses and its clamp."""
    positions = beam_nodes(beam, settings.elements)
    nodes = tuple(_add_node(mbs, settings.kind, x) for x in positions)
    elements = [
        _add_element(mbs, settings.kind, beam.section_at((left + right) / 2), right - left, nodes[i : i + 2])
        for i, (left, right) in enumerate(pairwise(positions))
    ]
    _add_point_masses(mbs, beam, settings.kind, positions, nodes)
    _add_clamp(mbs, beam, settings.kind, ground, nodes[0])
    return LaidBeam(positions, nodes, elements)


def _nearest(positions: np.ndarray, x: float) -> int:
    return int(np.argmin(np.abs(positions - x)))


def coordinate_marker(mbs: Any, node: Any, coordinate: int) -> Any:
    """A marker on one coordinate of a node."""
    return mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))


def _add_node(mbs: Any, kind: str, x: float) -> Any:
    if kind == "ancf":
        return mbs.AddNode(eii.NodePoint2DSlope1(referenceCoordinates=[x, 0.0, 1.0, 0.0]))
    return mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[x, 0.0, 0.0]))


def _add_element(mbs: Any, kind: str, section: Section, length: float, nodes: Sequence[Any]) -> Any:
    common: dict[str, Any] = {
        "nodeNumbers": list(nodes),
        "length": length,
        "massPerLength": section.density * section.area,
        "bendingStiffness": section.youngs_modulus * section.second_moment,
        "axialStiffness": section.youngs_modulus * section.area,
    }
    if kind == "ancf":  # the lower Gauss order changes nothing that can be seen and costs a tenth less
        return mbs.AddObject(eii.ObjectANCFCable2D(**common, useReducedOrderIntegration=1))
    return mbs.AddObject(
        eii.ObjectBeamGeometricallyExact2D(
            **common,
            crossSectionInertia=section.density * section.second_moment,
            shearStiffness=section.shear_factor * section.shear_modulus * section.area,
        )
    )


def _add_point_masses(mbs: Any, beam: Beam, kind: str, positions: np.ndarray, nodes: Sequence[Any]) -> None:
    rotations = 2 if kind == "ancf" else 1  # both slope components carry J: their rates make up theta'
    for mass in beam.masses:
        matrix = np.diag([mass.mass, mass.mass] + rotations * [mass.inertia])
        node = nodes[_nearest(positions, mass.at)]
        mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=[node], massMatrix=matrix))


def _add_clamp(mbs: Any, beam: Beam, kind: str, ground: Any, node: Any) -> None:
    springs = (
        (AXIAL, math.inf),
        (DEFLECTION, beam.clamp.translation),
        (_ROTATION[kind], beam.clamp.rotation),
    )
    for coordinate, stiffness in springs:
        markers = [ground, coordinate_marker(mbs, node, coordinate)]
        if math.isinf(stiffness):
            mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=markers))
        elif stiffness > 0:
            mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, stiffness=stiffness))
