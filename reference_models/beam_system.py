"""The Exudyn system of planar beams with contact elements: Exudyn's y is the beams' z.

The beams are laid by laid_beam.py. The damping matrix is an ObjectGenericODE2 item on the beams' own nodes, contacts
are penalty elements on the node at their point.

A viscous contact and a force law are springs with a user function, ObjectConnectorCoordinateSpringDamper: the
damping of ObjectContactCoordinate pulls at the end of a contact, and no element has a force law of one's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np

from multiphi_exudyn.mechanics.assembly import Tie
from reference_models.beams import Beams
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.laid_beam import AXIAL, DEFLECTION, Place, coordinate_marker, lay_beam
from reference_models.point_contact import PointContact
from reference_models.point_friction import FrictionConnector, PointFriction, add_friction, connector_of
from reference_models.point_law import PointLaw
from reference_models.rubbing import Rub

__all__ = ["BeamSystem", "Stop", "build_beam_system"]

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
        """User function of a spring between the point and what it meets."""
        return self.contact.spring_force(u, v, self.way, self.rate)


@dataclass(frozen=True)
class BeamSystem:
    """An assembled Exudyn system and where its items are.

    container owns mbs and must live as long. nodes of all beams, one beam after the other, and first_coordinates
    (index of each node's first ODE2 coordinate). points: name -> number of its node. load: a LoadCoordinate along +z,
    zero, or None. driver: an ObjectGenericODE2 on all nodes whose forceVector is zero, or None. stops: of the
    contacts, by name. frictions: their connectors. rubs: of contacts with
    friction.
    """

    container: Any
    mbs: Any
    nodes: tuple[Any, ...]
    first_coordinates: np.ndarray
    points: Mapping[str, int]
    load: Any
    driver: Any
    stops: Mapping[str, Stop]
    frictions: tuple[FrictionConnector, ...]
    rubs: tuple[Rub, ...]

    def coordinate(self, point: str, component: int = DEFLECTION) -> int:
        """Index of a coordinate of the node at a point among the system's ODE2 coordinates."""
        return int(self.first_coordinates[self.points[point]]) + component


def build_beam_system(
    beams: Beams,
    settings: FullBeamSettings,
    contacts: Sequence[PointContact] = (),
    damping: np.ndarray | None = None,
    load_at: str | None = None,
    laws: Sequence[PointLaw] = (),
    driven: bool = False,
    frictions: Sequence[PointFriction] = (),
) -> BeamSystem:
    """Build and assemble; damping: (n_full, n_full) on all coordinates; load_at: point of a load.

    driven: whether there is a driver.
    """
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = coordinate_marker(mbs, mbs.AddNode(eii.NodePointGround()), AXIAL)
    laid = {name: lay_beam(mbs, beam, settings, ground) for name, beam in beams.parts.items()}
    places = {point: Place(laid[name], x) for point, (name, x) in beams.points.items()}
    for tie in beams.ties:
        _add_tie(mbs, tie, ground, places)
    stops = {contact.name: Stop(contact) for contact in contacts}
    for contact in contacts:
        _add_contact(mbs, stops[contact.name], settings, ground, places)
    for law in laws:
        _add_law(mbs, law, ground, places[law.point].node)
    rubs = [Rub(contact, contact.tangent, stops[contact.name]) for contact in contacts if contact.tangent]
    for rub in rubs:
        _add_rub(mbs, rub, ground, places)
    connectors = [_add_friction(mbs, friction, ground, places) for friction in frictions]
    nodes = tuple(node for beam in laid.values() for node in beam.nodes)
    if damping is not None:
        mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=list(nodes), dampingMatrix=damping))
    driver = mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=list(nodes))) if driven else None
    load = None
    if load_at is not None:
        load = mbs.AddLoad(
            eii.LoadCoordinate(markerNumber=coordinate_marker(mbs, places[load_at].node, DEFLECTION), load=0.0)
        )
    mbs.Assemble()
    first = np.array([mbs.GetNodeODE2Index(node) for node in nodes])
    points = {point: nodes.index(place.node) for point, place in places.items()}
    placed = tuple(connector_of(mbs, *given) for given in zip(frictions, connectors, strict=True))
    system = BeamSystem(container, mbs, nodes, first, points, load, driver, stops, placed, tuple(rubs))
    for rub in rubs:
        rub.place(system.coordinate)
    return system


def _add_tie(mbs: Any, tie: Tie, ground: Any, places: Mapping[str, Place]) -> None:
    """Exudyn holds factor1 q(marker 1) - q(marker 0) at zero."""
    (tied, coefficient), *rest = tie.items()
    markers = [coordinate_marker(mbs, places[point].node, DEFLECTION) for point, _ in rest] or [ground]
    factor = -rest[0][1] / coefficient if rest else 1.0
    mbs.AddObject(
        eii.ObjectConnectorCoordinate(
            markerNumbers=[coordinate_marker(mbs, places[tied].node, DEFLECTION), *markers], factor1=factor
        )
    )


def _add_contact(mbs: Any, stop: Stop, settings: FullBeamSettings, ground: Any, places: Mapping[str, Place]) -> None:
    contact, place = stop.contact, places[stop.contact.point]
    if settings.contact == "circle":
        near = place.beam.elements[max(place.number - 1, 0) : place.number + 1]
        _add_circle_contact(mbs, contact, settings.circle_radius, place.beam.positions[place.number], near)
        return
    other = ground if contact.other is None else coordinate_marker(mbs, places[contact.other].node, DEFLECTION)
    if contact.damping:
        _add_viscous_contact(mbs, stop, other, place.node)
    else:
        stop.item = _add_coordinate_contact(mbs, contact, other, place.node)


def _add_coordinate_contact(mbs: Any, contact: PointContact, other: Any, node: Any) -> Any:
    """Exudyn's gap is q(marker 1) - q(marker 0) - offset, its force acts along +q of marker 1."""
    point = coordinate_marker(mbs, node, DEFLECTION)
    return mbs.AddObject(
        eii.ObjectContactCoordinate(
            markerNumbers=[point, other] if contact.above else [other, point],
            nodeNumber=_data_node(mbs, [contact.distance]),
            contactStiffness=contact.spring,
            offset=-contact.distance,
        )
    )


def _add_viscous_contact(mbs: Any, stop: Stop, other: Any, node: Any) -> None:
    """A spring whose user function is the contact's law."""
    mbs.AddObject(
        eii.ObjectConnectorCoordinateSpringDamper(
            markerNumbers=[other, coordinate_marker(mbs, node, DEFLECTION)], springForceUserFunction=stop.spring_force
        )
    )


def _add_law(mbs: Any, law: PointLaw, ground: Any, node: Any) -> None:
    def force(mbs: Any, t: float, item: int, u: float, v: float, k: float, d: float, offset: float) -> float:
        return law.spring_force(u)

    markers = [ground, coordinate_marker(mbs, node, DEFLECTION)]
    mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, springForceUserFunction=force))


def _add_rub(mbs: Any, rub: Rub, ground: Any, places: Mapping[str, Place]) -> None:
    """A spring on the tangential deflection whose user function is the contact's friction."""
    tangent = rub.tangent
    other = ground if tangent.other is None else coordinate_marker(mbs, places[tangent.other].node, DEFLECTION)
    markers = [other, coordinate_marker(mbs, places[tangent.point].node, DEFLECTION)]
    mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, springForceUserFunction=rub.force))


def _add_friction(mbs: Any, friction: PointFriction, ground: Any, places: Mapping[str, Place]) -> Any:
    other = ground if friction.other is None else coordinate_marker(mbs, places[friction.other].node, DEFLECTION)
    return add_friction(mbs, friction, ground, coordinate_marker(mbs, places[friction.point].node, DEFLECTION), other)


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
