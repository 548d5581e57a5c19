"""Dry friction of a point of a beam on the ground, or on another point, as Exudyn's own friction connector.

    q = c w - v t,   stick: T = k (q - s), |T| <= static limit,   slip: T = +-limit,   force on w: -c T

w is the deflection of the point, less that of the other one, v the speed of the counter-surface, s the place where the
bristle stands, q - T / k at any time. ObjectConnectorCoordinateSpringDamperExt says the same of its bristle if its data
node [T where it slips else 0, s, limit stop] begins with [0, q - T / k, 0]: stuck, T = 0 where the beam is straight.
Its static limit ends with the speed; here it ends where slip begins.

Where both limits are the same, stick that sets in at the limit is at once beyond it by round-off, and slip then goes by
the sign of a speed that is round-off too: at some turns the force jumps to the other side, and a run is 4 to 16 % off,
at fine steps as at coarse ones. A hair between the limits ends that.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.friction import Friction
from reference_models.beams import Beams
from reference_models.point_contact import point_and_other

__all__ = ["FrictionConnector", "PointFriction", "add_friction", "connector_of", "point_frictions"]

STANDSTILL = 1e-12  # m/s, over which the static limit falls to the other one: nothing that slips is as slow
HAIR = 1e-5  # of the limit, by which the static one is above it at least: stick sets in at the limit, not to end there


@dataclass(frozen=True)
class PointFriction:
    """name; point; c; limit and static limit [N], k [N/m], v [m/s] as given; other: point it rubs on, or None."""

    name: str
    point: str
    coefficient: float
    limit: float
    static_limit: float
    stiffness: float
    velocity: float = 0.0
    other: str | None = None

    def travel(self, deflections: Mapping[str, np.ndarray], time: np.ndarray) -> np.ndarray:
        """q (s,) [m] of deflections of points by name, (s,) each, at times (s,) [s]."""
        own = deflections[self.point]
        relative = own if self.other is None else own - deflections[self.other]
        return np.asarray(self.coefficient * relative - self.velocity * time)

    def force(self, travel: np.ndarray, data: np.ndarray) -> np.ndarray:
        """T (s,) [N] of q (s,) and the data node's coordinates (s, 2), friction state and place of the bristle."""
        state, place = data.T
        return np.where(state == 0, self.stiffness * (travel - place), state)

    def slow_force(self, travel: float) -> float:
        """T [N] after a slow way q [m] from zero."""
        sticking = self.stiffness * travel
        return sticking if abs(sticking) <= self.static_limit else math.copysign(self.limit, travel)


@dataclass(frozen=True)
class FrictionConnector:
    """item: the connector. data: indices of its friction state and the bristle's place among the data coordinates."""

    friction: PointFriction
    item: Any
    data: tuple[int, int]

    def pull_slowly(self, mbs: Any) -> None:
        """Take what follows as slow: a static solution has no velocities, by which Exudyn tells which way slip goes."""
        mbs.SetObjectParameter(self.item, "springForceUserFunction", self._slow_force)

    def let_go(self, mbs: Any) -> None:
        """End of that, in the solution: the bristle sticks in the initial state, under the force it carries."""
        travel = mbs.GetObjectOutput(self.item, exu.OutputVariableType.Displacement)
        mbs.SetObjectParameter(self.item, "springForceUserFunction", 0)
        data = mbs.systemData.GetDataCoordinates()
        data[list(self.data)] = 0.0, travel - self.friction.slow_force(travel) / self.friction.stiffness
        mbs.systemData.SetDataCoordinates(data, exu.ConfigurationType.Initial)

    def _slow_force(self, mbs: Any, t: float, item: int, u: float, *parameters: float) -> float:
        return self.friction.slow_force(u)


def point_frictions(beams: Beams, frictions: Sequence[Friction]) -> tuple[PointFriction, ...]:
    """The frictions on points; raises MultiPhiValueError where a full beam cannot have them."""
    names = [friction.name for friction in frictions]
    if len(set(names)) < len(names):
        raise MultiPhiValueError(f"frictions: got the names {names}, need each name once")
    return tuple(_point_friction(beams, friction) for friction in frictions)


def _point_friction(beams: Beams, friction: Friction) -> PointFriction:
    if friction.rigid:
        raise MultiPhiValueError(f"friction {friction.name!r} stiffness: got inf, need a finite one (a bristle)")
    what = f"friction {friction.name!r} direction"
    point, coefficient, other = point_and_other(what, friction.direction)
    for name in (point,) if other is None else (point, other):
        beams.check_point(what, name)
    if other is not None and friction.velocity:
        received = f"friction {friction.name!r} velocity: got {friction.velocity!r} between two points"
        raise MultiPhiValueError(f"{received}, need a single point on a counter-surface that moves")
    limits = friction.limit, friction.most
    return PointFriction(friction.name, point, coefficient, *limits, friction.stiffness, friction.velocity, other)


def add_friction(mbs: Any, friction: PointFriction, ground: Any, marker: Any, other: Any) -> Any:
    """Add the connector between two markers of deflections, ground and ``marker`` on a surface that moves."""
    if friction.velocity:
        other = _surface(mbs, friction.velocity, ground)
    return mbs.AddObject(
        eii.ObjectConnectorCoordinateSpringDamperExt(
            name=friction.name,
            markerNumbers=[other, marker],
            nodeNumber=mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0.0, 0.0, 0.0], numberOfDataCoordinates=3)),
            factor0=1.0 if friction.velocity else friction.coefficient,
            factor1=friction.coefficient,
            dynamicFrictionForce=friction.limit,
            staticFrictionOffsetForce=max(friction.static_limit - friction.limit, HAIR * friction.limit),
            exponentialDecayStatic=STANDSTILL,
            stickingStiffness=friction.stiffness,
        )
    )


def connector_of(mbs: Any, friction: PointFriction, item: Any) -> FrictionConnector:
    """The connector of an assembled system."""
    state, place, _ = mbs.systemData.GetObjectLTGData(int(item))
    return FrictionConnector(friction, item, (int(state), int(place)))


def _surface(mbs: Any, velocity: float, ground: Any) -> Any:
    """Marker of a massless coordinate that moves with a constant velocity [m/s]."""
    node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialVelocities=[velocity]))
    marker = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=[ground, marker], velocityLevel=True, offset=velocity))
    return marker
