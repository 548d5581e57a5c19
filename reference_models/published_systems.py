"""Systems with contacts and stops that Exudyn publishes among its own examples and tests, built from their data.

Source: the directories Examples and TestModels of Exudyn's public repository; each function names its model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    CoordinateConstraint,
    LoadCoordinate,
    LoadForceVector,
    MarkerBodyCable2DShape,
    MarkerBodyPosition,
    MarkerNodeCoordinate,
    MarkerNodePosition,
    Node1D,
    NodeGenericData,
    NodePoint,
    NodePoint2DSlope1,
    NodePointGround,
    ObjectANCFCable2D,
    ObjectConnectorCoordinateSpringDamper,
    ObjectConnectorCoordinateSpringDamperExt,
    ObjectContactCircleCable2D,
    ObjectContactCoordinate,
    ObjectGround,
    ObjectMass1D,
    ObjectMassPoint,
    ObjectRotationalMass1D,
)

__all__ = [
    "PUBLISHED",
    "OwnRun",
    "PublishedSystem",
    "bouncing_ball",
    "bouncing_ball_by_user_function",
    "cable_on_circles",
    "cable_on_nodal_stops",
    "friction_stops_and_gears",
    "mass_on_a_stop",
]

GRAVITY = 9.81  # m/s^2
NEWTON = 1e-7  # of the residual: below lies the round-off of the cable's axial stiffness, where steps collapse


@dataclass(frozen=True)
class PublishedSystem:
    """An assembled system. point: a coordinate of it to look at, as reduce names it; end, step: of its run [s].

    container: Exudyn's, which has to live as long as the system.
    """

    container: Any
    mbs: Any
    point: str
    end: float
    step: float


@dataclass(frozen=True)
class OwnRun:
    """Exudyn's own run: time (k,) [s], coordinates (k, n_full) from those at the start."""

    time: np.ndarray
    coordinates: np.ndarray

    @classmethod
    def of(cls, system: PublishedSystem, step: float | None = None) -> OwnRun:
        """The system integrated by the trapezoidal rule with fixed steps, every step kept."""
        times, coordinates = [], []

        def keep(mbs: Any, t: float) -> bool:
            times.append(t)
            coordinates.append(mbs.systemData.GetODE2Coordinates())
            return True

        system.mbs.SetPostStepUserFunction(keep)
        try:
            system.mbs.SolveDynamic(
                _settings(system.end, step or system.step), solverType=exu.DynamicSolverType.TrapezoidalIndex2
            )
        finally:
            system.mbs.SetPostStepUserFunction(0)
        found = np.array(coordinates)
        return cls(np.array(times), found - found[0])

    def of_row(self, row: np.ndarray) -> np.ndarray:
        """row (n_full,) of the coordinates, (k,)."""
        return np.asarray(self.coordinates @ row)

    def negative(self, values: np.ndarray) -> list[tuple[float, float]]:
        """Intervals [s] in which values (k,) are negative, ends between steps by straight lines."""
        at = np.flatnonzero(np.diff(np.signbit(values)))
        t, v = self.time, values
        ends = t[at] - v[at] * (t[at + 1] - t[at]) / (v[at + 1] - v[at])
        ends = np.concatenate([t[:1] if v[0] < 0 else [], ends, t[-1:] if v[-1] < 0 else []])
        return [(float(a), float(b)) for a, b in ends.reshape(-1, 2)]


def _settings(end: float, step: float) -> Any:
    found = exu.SimulationSettings()
    found.solution.file.write = False
    integration = found.timeIntegration
    integration.endTime, integration.numberOfSteps = end, round(end / step)
    integration.verboseMode = 0
    integration.newton.relativeTolerance = integration.newton.absoluteTolerance = NEWTON
    integration.discontinuous.useRecommendedStepSize = False
    integration.discontinuous.ignoreMaxIterations = True
    return found


def bouncing_ball() -> PublishedSystem:
    """contactCoordinateTest: a ball falls on a stiff damped stop."""
    container, mbs, markers = _ball(0.0, 0.1, 0.0)
    data = mbs.AddNode(NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
    law = {"contactStiffness": 2e6, "contactDamping": 200.0, "offset": 0.05}
    mbs.AddObject(ObjectContactCoordinate(name="floor", markerNumbers=markers, nodeNumber=data, **law))
    return _assembled(container, mbs, "height", 0.25, 1e-5)


def bouncing_ball_by_user_function() -> PublishedSystem:
    """postNewtonStepContactTest: the stop is in the user function of a spring, where nothing can find it."""
    container, mbs, markers = _ball(0.5, -0.44, -1.0)

    def force(_mbs: Any, _t: float, _item: int, u: float, _v: float, stiffness: float, *_: float) -> float:
        return stiffness * min(0.0, 0.5 + u - 0.05)

    mbs.AddObject(
        ObjectConnectorCoordinateSpringDamper(
            name="floor", markerNumbers=markers, stiffness=2e4, springForceUserFunction=force
        )
    )
    return _assembled(container, mbs, "height", 0.5, 1e-5)


def _ball(reference: float, displacement: float, velocity: float) -> tuple[Any, Any, list[Any]]:
    """0.25 kg above ground under gravity; the markers of ground and of its height."""
    container, mbs = _system()
    node = mbs.AddNode(
        NodePoint(
            referenceCoordinates=[0.0, reference, 0.0],
            initialCoordinates=[0.0, displacement, 0.0],
            initialVelocities=[0.0, velocity, 0.0],
        )
    )
    mbs.AddObject(ObjectMassPoint(name="ball", mass=0.25, nodeNumber=node))
    markers = [_ground(mbs), _coordinate(mbs, node, 1, "height")]
    mbs.AddLoad(LoadCoordinate(name="weight", markerNumber=markers[1], load=-0.25 * GRAVITY))
    return container, mbs, markers


def mass_on_a_stop() -> PublishedSystem:
    """The small example of ObjectContactCoordinate: a mass falls on a stop and comes to rest 1 mm inside."""
    container, mbs = _system()
    node = mbs.AddNode(Node1D(referenceCoordinates=[0.0], initialCoordinates=[0.1]))
    mbs.AddObject(ObjectMass1D(name="mass", mass=1.0, nodeNumber=node))
    markers = [_ground(mbs), _coordinate(mbs, node, 0, "height")]
    data = mbs.AddNode(NodeGenericData(initialCoordinates=[0.1], numberOfDataCoordinates=1))
    law = {"contactStiffness": 1e4, "contactDamping": 100.0}
    mbs.AddObject(ObjectContactCoordinate(name="stop", markerNumbers=markers, nodeNumber=data, **law))
    mbs.AddLoad(LoadCoordinate(name="weight", markerNumber=markers[1], load=-10.0))
    return _assembled(container, mbs, "height", 1.0, 1e-5)


def friction_stops_and_gears() -> PublishedSystem:
    """coordinateSpringDamperExt: two masses with friction, one between limit stops, and a pair of gears."""
    container, mbs = _system()
    spring = {"stiffness": 100.0, "damping": 0.2 * np.sqrt(100.0 / 0.5)}
    friction = {"dynamicFrictionForce": 0.3 * 0.5 * GRAVITY, "staticFrictionOffsetForce": 0.15 * 0.5 * GRAVITY}
    friction |= {"exponentialDecayStatic": 0.2}
    _slider(mbs, "regularised", [], **spring, **friction, frictionProportionalZone=1e-3)
    bristle = {"stickingStiffness": 1e4, "stickingDamping": 100.0}
    _slider(mbs, "bristle", [1.0, 0.0, 0.0], **spring, **friction, **bristle)
    stops = {"limitStopsUpper": 0.95, "limitStopsLower": -0.95, "limitStopsStiffness": 1e4, "limitStopsDamping": 10.0}
    _slider(mbs, "stopped", [0.0, 0.0, 0.0], **stops, useLimitStops=True)
    _gears(mbs)
    return _assembled(container, mbs, "stopped position", 2.0, 2e-5)


def _slider(mbs: Any, name: str, data: list[float], **parameters: Any) -> None:
    """0.5 kg at 10 m/s, held to ground by one connector."""
    node = mbs.AddNode(NodePoint(initialVelocities=[10.0, 0.0, 0.0]))
    mbs.AddObject(ObjectMassPoint(name=f"{name} mass", mass=0.5, nodeNumber=node))
    if data:
        parameters["nodeNumber"] = mbs.AddNode(NodeGenericData(initialCoordinates=data, numberOfDataCoordinates=3))
    markers = [_ground(mbs), _coordinate(mbs, node, 0, f"{name} position")]
    mbs.AddObject(ObjectConnectorCoordinateSpringDamperExt(name=name, markerNumbers=markers, **parameters))


def _gears(mbs: Any) -> None:
    """Two rotors of 1 kg m^2, ratio -1/3, the second one driven at constant speed, a torque of -10 N m on the first."""
    speed, ratio = 2 * np.pi, -1 / 3
    markers = []
    for name, initial in (("first gear", speed), ("second gear", ratio * speed)):
        node = mbs.AddNode(Node1D(referenceCoordinates=[0.0], initialCoordinates=[0.0], initialVelocities=[initial]))
        mbs.AddObject(ObjectRotationalMass1D(name=name, inertia=1.0, nodeNumber=node))
        markers.append(_coordinate(mbs, node, 0, f"{name} angle"))
    mesh = {"stiffness": 1e5, "damping": 1e3, "factor1": ratio, "frictionProportionalZone": 1e-16}
    mbs.AddObject(ObjectConnectorCoordinateSpringDamperExt(name="mesh", markerNumbers=markers[::-1], **mesh))
    drive = {"offset": ratio * speed, "velocityLevel": True}
    mbs.AddObject(CoordinateConstraint(name="drive", markerNumbers=[markers[1], _ground(mbs)], **drive))
    mbs.AddLoad(LoadCoordinate(name="brake", markerNumber=markers[0], load=-10.0))


def cable_on_circles() -> PublishedSystem:
    """ANCFcontactCircleTest: a soft cantilever of 2 m sinks on two circles."""
    container, mbs, nodes, cables = _cantilever(load=80.0)
    ground = mbs.AddObject(ObjectGround(name="circles"))
    for x, y, radius in ((1.5, -0.5, 0.2), (0.5, -0.15, 0.1)):
        centre = mbs.AddMarker(MarkerBodyPosition(bodyNumber=ground, localPosition=[x, y, 0.0]))
        for cable in cables:
            shape = mbs.AddMarker(MarkerBodyCable2DShape(bodyNumber=cable, numberOfSegments=4))
            data = mbs.AddNode(NodeGenericData(initialCoordinates=4 * [0.1], numberOfDataCoordinates=4))
            law = {"numberOfContactSegments": 4, "contactStiffness": 1e3, "circleRadius": radius}
            mbs.AddObject(ObjectContactCircleCable2D(markerNumbers=[centre, shape], nodeNumber=data, **law))
    _coordinate(mbs, nodes[-1], 1, "tip")
    return _assembled(container, mbs, "tip", 0.05, 1e-4)


def cable_on_nodal_stops(smaller: float = 1e-3) -> PublishedSystem:
    """ANCFcontactCircleTest with the stops at nodes that it has as a choice, 1 m below, 1e3 N/m each.

    smaller: factor of the load and of the distance of the stops; with 1 the cable moves by half its length.
    """
    container, mbs, nodes, _ = _cantilever(load=80.0 * smaller)
    ground = _ground(mbs)
    for i, node in enumerate(nodes):
        name = "tip" if node == nodes[-1] else f"y{i}"
        markers = [ground, _coordinate(mbs, node, 1, name)]
        data = mbs.AddNode(NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
        law = {"contactStiffness": 1e3, "offset": -smaller}
        mbs.AddObject(ObjectContactCoordinate(name=f"stop at {name}", markerNumbers=markers, nodeNumber=data, **law))
    return _assembled(container, mbs, "tip", 0.25, 5e-5)


def _cantilever(load: float) -> tuple[Any, Any, list[Any], list[Any]]:
    """8 cable elements of 2 m and 1 mm x 1 mm of steel, clamped, load [m/s^2] times its mass downwards."""
    container, mbs = _system()
    area, density, young, elements = 1e-6, 7800.0, 2.07e11, 8
    length = 2.0 / elements
    nodes = [
        mbs.AddNode(NodePoint2DSlope1(referenceCoordinates=[length * i, 0.0, 1.0, 0.0])) for i in range(elements + 1)
    ]
    section = {"massPerLength": density * area, "bendingStiffness": young * area**2 / 12}
    section |= {"axialStiffness": young * area, "length": length}
    cables = [
        mbs.AddObject(ObjectANCFCable2D(name=f"cable{i}", nodeNumbers=nodes[i : i + 2], **section))
        for i in range(elements)
    ]
    ground = _ground(mbs)
    for c in (0, 1, 3):
        mbs.AddObject(CoordinateConstraint(markerNumbers=[ground, _coordinate(mbs, nodes[0], c, f"clamp{c}")]))
    for i, node in enumerate(nodes):
        part = density * area * length * (0.5 if i in (0, elements) else 1.0)
        marker = mbs.AddMarker(MarkerNodePosition(nodeNumber=node, name=f"n{i}"))
        mbs.AddLoad(LoadForceVector(name=f"weight{i}", markerNumber=marker, loadVector=[0.0, -load * part, 0.0]))
    return container, mbs, nodes, cables


def _system() -> tuple[Any, Any]:
    container = exu.SystemContainer()
    return container, container.AddSystem()


def _ground(mbs: Any) -> Any:
    return mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=mbs.AddNode(NodePointGround()), coordinate=0))


def _coordinate(mbs: Any, node: Any, coordinate: int, name: str) -> Any:
    return mbs.AddMarker(MarkerNodeCoordinate(name=name, nodeNumber=node, coordinate=coordinate))


def _assembled(container: Any, mbs: Any, point: str, end: float, step: float) -> PublishedSystem:
    mbs.Assemble()
    return PublishedSystem(container, mbs, point, end, step)


PUBLISHED: dict[str, Callable[[], PublishedSystem]] = {
    "contactCoordinateTest": bouncing_ball,
    "ObjectContactCoordinate": mass_on_a_stop,
    "coordinateSpringDamperExt": friction_stops_and_gears,
    "postNewtonStepContactTest": bouncing_ball_by_user_function,
    "ANCFcontactCircleTest": cable_on_circles,
    "ANCFcontactCircleTest, stops at nodes, load and distance / 1000": cable_on_nodal_stops,
}
