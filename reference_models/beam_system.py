"""The Exudyn system of a planar beam with contact elements: Exudyn's y is the beam's z.

Elements are ANCFCable2D or ObjectBeamGeometricallyExact2D, point masses and the damping matrix are
ObjectGenericODE2 items on the beam's own nodes, contacts are penalty elements on the node at their point.
The beam's start is always held along its axis; a finite clamp stiffness acts through coordinate springs
(on the slope y' in the ANCF beam, which is the sine of the rotation).

A viscous contact and a force law are springs with a user function, ObjectConnectorCoordinateSpringDamper: the
damping of ObjectContactCoordinate pulls at the end of a contact, and no element has a force law of one's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np

from multiphi_exudyn.beam import Beam, Section, beam_nodes
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.point_contact import PointContact
from reference_models.point_law import PointLaw

__all__ = ["AXIAL", "DEFLECTION", "BeamSystem", "Stop", "build_beam_system"]

AXIAL, DEFLECTION = 0, 1  # coordinates of a node of either kind
_ROTATION = {"ancf": 3, "geometrically-exact": 2}  # the slope y', or the angle
_CIRCLE_SEGMENTS = 3  # straight pieces an element is divided into where it meets a round support


@dataclass
class Stop:
    """The stop of a contact, which may move: way [m], rate [m/s]. item: its ObjectContactCoordinate, or None."""

    contact: PointContact
    item: Any = None
    way: float = 0.0
    rate: float = 0.0

    def move(self, mbs: Any, way: float, rate: float) -> None:
        """Put it where it is now."""
        self.way, self.rate = way, rate
        if self.item is not None:
            mbs.SetObjectParameter(self.item, "offset", way / abs(self.contact.coefficient) - self.contact.distance)

    def spring_force(
        self, mbs: Any, t: float, item: int, u: float, v: float, k: float, d: float, offset: float
    ) -> float:
        """User function of a spring between ground and point."""
        return self.contact.spring_force(u, v, self.way, self.rate)


@dataclass(frozen=True)
class BeamSystem:
    """An assembled Exudyn system and where its items are.

    container owns mbs and must live as long. positions: (nodes,) [m], of nodes and first_coordinates
    (index of each node's first ODE2 coordinate). load: a LoadCoordinate along +z, zero, or None. driver: an
    ObjectGenericODE2 on all nodes whose forceVector is zero, or None. stops: of the contacts, by name.
    """

    container: Any
    mbs: Any
    positions: np.ndarray
    nodes: tuple[Any, ...]
    first_coordinates: np.ndarray
    load: Any
    driver: Any
    stops: Mapping[str, Stop]

    def node_at(self, x: float) -> int:
        """Number along the beam of the node at x [m]."""
        return _nearest(self.positions, x)

    def coordinate(self, x: float, component: int = DEFLECTION) -> int:
        """Index of a coordinate of the node at x [m] among the system's ODE2 coordinates."""
        return int(self.first_coordinates[self.node_at(x)]) + component


def build_beam_system(
    beam: Beam,
    settings: FullBeamSettings,
    contacts: Sequence[PointContact] = (),
    damping: np.ndarray | None = None,
    load_at: float | None = None,
    laws: Sequence[PointLaw] = (),
    driven: bool = False,
) -> BeamSystem:
    """Build and assemble; damping: (n_full, n_full) on all coordinates; load_at: position [m] of a load.

    driven: whether there is a driver.
    """
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    positions = beam_nodes(beam, settings.elements)
    nodes = tuple(_add_node(mbs, settings.kind, x) for x in positions)
    elements = [
        _add_element(mbs, settings.kind, beam.section_at((left + right) / 2), right - left, nodes[i : i + 2])
        for i, (left, right) in enumerate(pairwise(positions))
    ]
    ground = _marker(mbs, mbs.AddNode(eii.NodePointGround()), AXIAL)
    _add_point_masses(mbs, beam, settings.kind, positions, nodes)
    _add_clamp(mbs, beam, settings.kind, ground, nodes[0])
    stops = {contact.name: Stop(contact) for contact in contacts}
    for contact in contacts:
        node = _nearest(positions, beam.points[contact.point])
        if settings.contact == "circle":
            near = elements[max(node - 1, 0) : node + 1]
            _add_circle_contact(mbs, contact, settings.circle_radius, positions[node], near)
        elif contact.damping:
            _add_viscous_contact(mbs, stops[contact.name], ground, nodes[node])
        else:
            stops[contact.name].item = _add_coordinate_contact(mbs, contact, ground, nodes[node])
    for law in laws:
        _add_law(mbs, law, ground, nodes[_nearest(positions, beam.points[law.point])])
    if damping is not None:
        mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=list(nodes), dampingMatrix=damping))
    driver = mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=list(nodes))) if driven else None
    load = None
    if load_at is not None:
        marker = _marker(mbs, nodes[_nearest(positions, load_at)], DEFLECTION)
        load = mbs.AddLoad(eii.LoadCoordinate(markerNumber=marker, load=0.0))
    mbs.Assemble()
    first = np.array([mbs.GetNodeODE2Index(node) for node in nodes])
    return BeamSystem(container, mbs, positions, nodes, first, load, driver, stops)


def _nearest(positions: np.ndarray, x: float) -> int:
    return int(np.argmin(np.abs(positions - x)))


def _marker(mbs: Any, node: Any, coordinate: int) -> Any:
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
        markers = [ground, _marker(mbs, node, coordinate)]
        if math.isinf(stiffness):
            mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=markers))
        elif stiffness > 0:
            mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, stiffness=stiffness))


def _add_coordinate_contact(mbs: Any, contact: PointContact, ground: Any, node: Any) -> Any:
    """Exudyn's gap is q(marker 1) - q(marker 0) - offset, its force acts along +q of marker 1."""
    point = _marker(mbs, node, DEFLECTION)
    return mbs.AddObject(
        eii.ObjectContactCoordinate(
            markerNumbers=[point, ground] if contact.above else [ground, point],
            nodeNumber=_data_node(mbs, [contact.distance]),
            contactStiffness=contact.spring,
            offset=-contact.distance,
        )
    )


def _add_viscous_contact(mbs: Any, stop: Stop, ground: Any, node: Any) -> None:
    """A spring whose user function is the contact's law."""
    mbs.AddObject(
        eii.ObjectConnectorCoordinateSpringDamper(
            markerNumbers=[ground, _marker(mbs, node, DEFLECTION)], springForceUserFunction=stop.spring_force
        )
    )


def _add_law(mbs: Any, law: PointLaw, ground: Any, node: Any) -> None:
    def force(mbs: Any, t: float, item: int, u: float, v: float, k: float, d: float, offset: float) -> float:
        return law.spring_force(u)

    markers = [ground, _marker(mbs, node, DEFLECTION)]
    mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, springForceUserFunction=force))


def _add_circle_contact(mbs: Any, contact: PointContact, radius: float, x: float, elements: list[Any]) -> None:
    """A circle under (over) the node; every element that ends there meets it and takes its share."""
    side = 1.0 if contact.above else -1.0
    centre = [x, side * (contact.distance + radius), 0.0]
    marker = mbs.AddMarker(
        eii.MarkerNodePosition(nodeNumber=mbs.AddNode(eii.NodePointGround(referenceCoordinates=centre)))
    )
    for element in elements:
        shape = mbs.AddMarker(eii.MarkerBodyCable2DShape(bodyNumber=element, numberOfSegments=_CIRCLE_SEGMENTS))
        mbs.AddObject(
            eii.ObjectContactCircleCable2D(
                markerNumbers=[marker, shape],
                nodeNumber=_data_node(mbs, _CIRCLE_SEGMENTS * [contact.distance]),
                numberOfContactSegments=_CIRCLE_SEGMENTS,
                contactStiffness=contact.spring / len(elements),
                circleRadius=radius,
            )
        )


def _data_node(mbs: Any, gaps: list[float]) -> Any:
    return mbs.AddNode(eii.NodeGenericData(initialCoordinates=gaps, numberOfDataCoordinates=len(gaps)))
