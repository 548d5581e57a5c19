"""Interface: points of a body on which connectors, loads and sensors of an Exudyn system can act.

    y = R q + c,   0 = f + reaction of the tie,   p = R^T f

y (m,) displacements [m] and rotations [rad] of the points, the coordinates of massless nodes. R (m, s) rows of the
points in the modes of the present level, c (m,) its asymptotic configuration there; f (m,) external forces on y [N, N
m], p their modal force. The equation is a constraint, the tie, by one ObjectConnectorCoordinateVector per node. At a
transition R and c are exchanged and y, y', y'' are written, so y is the displacement of the body at every step. With
modes matched to the step, y' = R q' is the solver's velocity (discretised_level.py).

One coordinate is a NodeGenericODE2. A position is a NodePoint2D or a NodePoint, whose coordinates are displacements in
global directions; it takes markers of positions, and with them springs, distance and spherical joints. A rigid
interface is a NodeRigidBody2D or a NodeRigidBodyRxyz; it takes markers of rigid bodies, and with them every joint. The
system around the nodes may move by large displacements. The angles of a NodeRigidBodyRxyz are successive rotations
about the node's x, y and z axis. Small ones are the components of one rotation, as in a linear structure; at 5 degrees
about two axes the difference is 0.004 rad. At any angle, forces on the node have the same power as p.

f comes from the multipliers of the ties, so points may depend on each other, and a closed rigid contact may fix one.
Within the step of an event, the mean of f acts before the event; after it, the change of reactions, loads, connectors
and inertia at the event is added (coupled.py). This is exact for a constant force, and of second order for one that
varies (halving the step once may give another ratio, as the time of the event within its step changes too). The modes
are those of free points; a point with prescribed motion needs more of them.

In an impact on a rigid contact, all masses and constraints tied to the points take part. Springs and dampers do not, as
their forces are finite. The step must be short enough to resolve their forces after an event; otherwise the run ends
with an error. At a point that a closed rigid contact fixes, a further constraint is not allowed: Exudyn would have two
constraints for one coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import exudyn as exu
import numpy as np
from exudyn.itemInterface import (
    MarkerNodeCoordinates,
    NodeGenericODE2,
    NodePoint,
    NodePoint2D,
    NodeRigidBody2D,
    NodeRigidBodyRxyz,
    ObjectConnectorCoordinateVector,
    SensorObject,
)

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.arguments import real_array
from multiphi_exudyn.mechanics.structure import At, LinearStructure

__all__ = [
    "Interface",
    "InterfaceNode",
    "InterfacePoint",
    "PositionInterface",
    "RigidInterface",
    "direct_reactions",
    "interface_nodes",
]

TURN = math.radians(5.0)  # rad: limit of the rotation of an interface, as the body is linear
ROTATIONS = {2: 1, 3: 3}  # by the number of directions: about z in a plane, about x, y and z in space
_KINDS = {(2, 0): NodePoint2D, (3, 0): NodePoint, (2, 1): NodeRigidBody2D, (3, 3): NodeRigidBodyRxyz}
STATIC = 0.02  # of the largest displacement of the points: what the modes may leave out of a static solution


@dataclass(frozen=True)
class PositionInterface:
    """A point of a body as a position of the Exudyn system, to which markers of positions attach.

    A body takes it by name, ``items = CreateMultiPhiBody(mbs, model, interface={"tip": PositionInterface(...)})``; the
    node is then ``items["nInterface"]["tip"]``, for MarkerNodePosition.

    A body is linear: a run in which the line between two positions turns by more than 5 degrees issues a warning, and
    so does every run of a body that is free to move as a whole and has only one position, which does not show it.

    Parameters
    ----------
    position : sequence of float
        Position without displacement [m]: two numbers in a plane system, three in space.
    displacements : sequence of str, mapping, array (n,) or None
        Displacement in each of these directions: a point name, {point: coefficient} or a row; None for a direction in
        which it does not move.

    Raises
    ------
    MultiPhiTypeError
        By ``CreateMultiPhiBody``, for arguments of another kind.
    MultiPhiValueError
        By ``CreateMultiPhiBody``, for another number of directions, and points that do not exist.

    Examples
    --------
    >>> from multiphi_exudyn.exudyn_plugin import PositionInterface
    >>> tip = PositionInterface(position=[0.3, 0.0, 0.0], displacements=[None, "tip", None])
    >>> tip.displacements
    [None, 'tip', None]
    """

    position: Sequence[float]
    displacements: Sequence[At | None]


@dataclass(frozen=True)
class RigidInterface:
    """A point of a body as a rigid frame of the Exudyn system, to which every joint attaches.

    A body takes it by name, ``items = CreateMultiPhiBody(mbs, model, interface={"tip": RigidInterface(...)})``; the
    node is then ``items["nInterface"]["tip"]``, for MarkerNodeRigid.

    A body is linear: a run in which a rigid interface rotates by more than 5 degrees, or the line between two of them,
    issues a warning.

    Parameters
    ----------
    position : sequence of float
        Position without displacement [m]: two numbers in a plane system, three in space.
    displacements : sequence of str, mapping, array (n,) or None
        Displacement in each of these directions: a point name, {point: coefficient} or a row; None for a direction in
        which it does not move.
    rotations : sequence of str, mapping, array (n,) or None
        Rotations [rad]: about z in a plane system, about x, y and z in space.

    Raises
    ------
    MultiPhiTypeError
        By ``CreateMultiPhiBody``, for arguments of another kind.
    MultiPhiValueError
        By ``CreateMultiPhiBody``, for another number of directions, and points that do not exist.

    Examples
    --------
    >>> from multiphi_exudyn.exudyn_plugin import RigidInterface
    >>> end = RigidInterface([0.3, 0.0], displacements=[None, "tip"], rotations=["slope"])
    >>> end.rotations
    ['slope']
    """

    position: Sequence[float]
    displacements: Sequence[At | None]
    rotations: Sequence[At | None]


InterfacePoint: TypeAlias = "At | PositionInterface | RigidInterface"


@dataclass(frozen=True)
class InterfaceNode:
    """Node of an interface, with rows (k, n) of its coordinates, of which the last ``angles`` are rotations.

    position: (2 or 3,) [m], empty for a single coordinate.
    """

    name: str
    rows: np.ndarray
    position: tuple[float, ...] = ()
    angles: int = 0

    @property
    def turns(self) -> bool:
        """Whether it has rotations that move with the body."""
        return self.angles > 0 and bool(np.any(self.rows[-self.angles :]))

    def item(self, name: str, start: np.ndarray, start_t: np.ndarray, visualization: Mapping[str, Any]) -> Any:
        """Exudyn's node with initial coordinates and velocities (k,); visualization: show and color."""
        reference = [*self.position, *[0.0] * self.angles]
        if not reference:
            return NodeGenericODE2(
                name=name,
                referenceCoordinates=[0.0],
                initialCoordinates=start,
                initialCoordinates_t=start_t,
                numberOfODE2Coordinates=1,
            )
        kind: Any = _KINDS[len(self.position), self.angles]
        node = kind(name=name, referenceCoordinates=reference, initialCoordinates=start, initialVelocities=start_t)
        node.visualization = {**node.visualization, **visualization}
        return node


def interface_nodes(
    structure: LinearStructure, interface: Iterable[str] | Mapping[str, InterfacePoint]
) -> tuple[InterfaceNode, ...]:
    """Interface nodes from names of points, or {name: point, row, PositionInterface or RigidInterface}."""
    if isinstance(interface, str) or not isinstance(interface, Iterable):
        raise MultiPhiTypeError(f"interface: got {interface!r}, need names of points, or {{name: point or row}}")
    points = dict(interface) if isinstance(interface, Mapping) else {name: name for name in interface}
    for name in points:
        if not isinstance(name, str):
            raise MultiPhiTypeError(f"interface: got {name!r}, need a name")
    return tuple(_node(structure, name, point) for name, point in points.items())


def long_lines(nodes: Sequence[InterfaceNode]) -> list[tuple[int, int]]:
    """Pairs of nodes, each with a position and the one farthest from it; their lines show how a body turns."""
    pairs = set[tuple[int, int]]()
    for i, node in enumerate(nodes):
        distances = [_distance(node.position, other.position) for other in nodes]
        j = int(np.argmax(distances))
        if distances[j] > 0:
            pairs.add((min(i, j), max(i, j)))
    return sorted(pairs)


def _distance(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    """Distance of two places of one dimension [m], zero if it is round-off of their coordinates or one has no place."""
    if len(first) != len(second):
        return 0.0
    a, b = np.array(first), np.array(second)
    return float(np.linalg.norm(drop_round_off(b - a, np.max(np.abs([a, b]), initial=0.0))))


def _node(structure: LinearStructure, name: str, point: InterfacePoint) -> InterfaceNode:
    if not isinstance(point, (PositionInterface, RigidInterface)):
        if isinstance(point, (tuple, list)) and len(point) != structure.n:
            needed = f"a point, a row ({structure.n},), PositionInterface or RigidInterface"
            raise MultiPhiValueError(f"interface {name!r}: got {point!r}, need {needed}")
        row = structure.row(point)
        if not np.any(row):
            raise MultiPhiValueError(f"interface: got a row of zeros for {name!r}, need one that moves")
        return InterfaceNode(name, row[None, :])
    position = _position(name, point)
    count = ROTATIONS[len(position)] if isinstance(point, RigidInterface) else 0
    directions = _entries(f"interface {name!r}: displacements", point.displacements, len(position))
    if isinstance(point, RigidInterface):
        directions += _entries(f"interface {name!r}: rotations", point.rotations, count)
    rows = np.array([np.zeros(structure.n) if at is None else structure.row(at) for at in directions])
    if not np.any(rows):
        raise MultiPhiValueError(f"interface: got rows of zeros for {name!r}, need one that moves")
    return InterfaceNode(name, rows, position, count)


def _position(name: str, point: PositionInterface | RigidInterface) -> tuple[float, ...]:
    place = real_array(f"interface {name!r}: position", point.position, "two or three numbers in m")
    if place.shape not in ((2,), (3,)) or not np.all(np.isfinite(place)):
        raise MultiPhiValueError(f"interface {name!r}: position: got {place}, need two or three numbers in m")
    return tuple(place.tolist())


def _entries(name: str, entries: Any, count: int) -> list[At | None]:
    if isinstance(entries, (str, Mapping)) or not isinstance(entries, Sequence):
        raise MultiPhiTypeError(f"{name}: got {entries!r}, need a sequence of points, rows or None")
    if len(entries) != count:
        raise MultiPhiValueError(f"{name}: got {len(entries)} entries, need {count} for its position")
    return list(entries)


def static_shift(level: Level, force: np.ndarray) -> np.ndarray:
    """Static shift d (r,) under a modal force (s,), s >= r."""
    elastic, shift = np.flatnonzero(level.squares), np.zeros(level.modes)
    stiffness = np.diag(level.squares[elastic]) + level.coupling[np.ix_(elastic, elastic)]
    shift[elastic] = np.linalg.solve(stiffness, force[elastic])
    return shift


Visualization: TypeAlias = Mapping[str, Any]  # show and color of items in the renderer


@dataclass(frozen=True)
class _PointMap:
    """y = R q + c in one level, with rows R (m, s) and c = constant + held_columns . w at stick positions w (h,) [m].

    direct_reactions: L (k, m); L f are reactions of the closed contacts to f that the modes do not contain.
    """

    rows: np.ndarray
    constant: np.ndarray
    held_columns: np.ndarray
    direct_reactions: np.ndarray

    def offset(self, held: np.ndarray) -> np.ndarray:
        """c (m,) at stick positions (h,) [m]."""
        return self.constant + self.held_columns @ held if len(held) else self.constant


class Interface:
    """The interface coordinates of one body in one system.

    count: m. nodes: NodeIndex by name. sensors: of f, by name. ties: objects of the constraint y = R q + c.
    largest_angles: in the run [rad], of rigid nodes and of lines between two positions, by their names. static_error:
    of a static solution, largest share of a displacement that the modes leave out, its node and the number of modes.
    max_levels: number of levels of which R and c are kept.
    """

    def __init__(self, mbs: Any, name: str, nodes: Sequence[InterfaceNode], max_levels: int) -> None:
        self.nodes: dict[str, Any] = {}
        self.sensors: dict[str, Any] = {}
        self.largest_angles: dict[tuple[str, ...], float] = {}
        self.static_error: tuple[float, str, int] = (0.0, "", 0)
        self._name = name
        self._interface_nodes = tuple(nodes)
        self._rows = np.concatenate([node.rows for node in nodes])
        self.count = len(self._rows)
        self._base_rows: tuple[ModalBase | None, np.ndarray] = None, np.zeros(0)
        ends = np.cumsum([len(node.rows) for node in nodes])
        self._lines = long_lines(self._interface_nodes)
        self._slices = [slice(int(end) - len(node.rows), int(end)) for node, end in zip(nodes, ends, strict=True)]
        self.ties: list[Any] = []
        self._maps: BoundedCache[tuple[int, ...], _PointMap] = BoundedCache(max_levels)
        self._mbs = mbs

    def add(
        self,
        node: Any,
        discretised: DiscretisedLevel,
        held: np.ndarray,
        q: np.ndarray,
        q_t: np.ndarray,
        visualization: Mapping[str, Any],
    ) -> None:
        """Add nodes and ties for a body whose node has q, q' (s,) in a level with stick positions (h,) [m]."""
        point_map, mbs = self.map_in(discretised), self._mbs
        marker, offsets = mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=node)), point_map.offset(held)
        for interface_node, part in zip(self._interface_nodes, self._slices, strict=True):
            rows, offset, label = point_map.rows[part], offsets[part], f"{self._name}.{interface_node.name}"
            point = mbs.AddNode(interface_node.item(f"Node:{label}", rows @ q + offset, rows @ q_t, visualization))
            tie = ObjectConnectorCoordinateVector(
                name=label,
                markerNumbers=[marker, mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=point))],
                scalingMarker0=rows,
                scalingMarker1=np.eye(len(rows)),
                offset=offset,
            )
            self.nodes[interface_node.name] = point
            self.ties.append(mbs.AddObject(tie))
            self.sensors[interface_node.name] = mbs.AddSensor(
                SensorObject(
                    name=f"Sensor:{label}",
                    objectNumber=self.ties[-1],
                    outputVariableType=exu.OutputVariableType.Force,
                    storeInternal=True,
                    writeToFile=False,
                )
            )

    def map_in(self, discretised: DiscretisedLevel) -> _PointMap:
        """The map y = R q + c of a level."""
        return self._maps.get_or_build(discretised.states, lambda: self._build_map(discretised))

    def _build_map(self, discretised: DiscretisedLevel) -> _PointMap:
        loaded = discretised.loaded
        level = loaded.modal
        rows = np.zeros((len(self._rows), discretised.size))
        in_base = self.in_base(level.base)
        rows[:, : level.modes] = drop_round_off(in_base @ level.vectors, np.abs(in_base) @ np.abs(level.vectors))
        reactions = direct_reactions(level, in_base, rows[:, : level.modes])
        return _PointMap(rows, in_base @ loaded.asymptotic.configuration, in_base @ loaded.channels.shapes, reactions)

    def in_base(self, base: ModalBase) -> np.ndarray:
        """Rows (m, b) of the points in base coordinates; those of the last base are kept."""
        if self._base_rows[0] is not base:
            self._base_rows = base, np.asarray(self._rows @ base.modes.shapes)
        return self._base_rows[1]

    def attach(self, state: Mapping[str, np.ndarray]) -> None:
        """Take views of the interface coordinates in the system's current state; they are valid for one run."""
        first = [self._mbs.GetNodeODE2Index(node) for node in self.nodes.values()]
        sizes = [len(node.rows) for node in self._interface_nodes]
        self.indices = np.concatenate([np.arange(k, k + size) for k, size in zip(first, sizes, strict=True)])
        self._views = tuple(state[key] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        parts = [self._views[0][k : k + size] for k, size in zip(first, sizes, strict=True)]
        nodes = self._interface_nodes
        self._angles = {
            (node.name,): part[-node.angles :] for node, part in zip(nodes, parts, strict=True) if node.turns
        }
        moved = [part[: len(node.position)] for node, part in zip(nodes, parts, strict=True)]
        self._vectors = {
            (nodes[i].name, nodes[j].name): (np.subtract(nodes[j].position, nodes[i].position), moved[i], moved[j])
            for i, j in self._lines
        }
        self.largest_angles, self.static_error = dict.fromkeys([*self._angles, *self._vectors], 0.0), (0.0, "", 0)
        rows = [self._mbs.systemData.GetObjectLTGAE(tie) for tie in self.ties]
        self.multipliers = np.concatenate(rows).astype(int)
        self._forces = state["AECoords"]

    @property
    def forces(self) -> np.ndarray:
        """f (m,) in the system's current state."""
        return np.asarray(self._forces[self.multipliers])

    @property
    def shows_rotations(self) -> bool:
        """Whether the interface has rigid nodes, which have rotations, or two positions, whose line may turn."""
        return bool(self._lines) or any(node.turns for node in self._interface_nodes)

    def record_angles(self) -> None:
        """Update the largest angles of rigid nodes and lines with the system's current state."""
        largest = self.largest_angles
        for name, angles in self._angles.items():
            largest[name] = max(largest[name], float(np.linalg.norm(angles)))
        for names, (line, start, end) in self._vectors.items():
            largest[names] = max(largest[names], _angle(line, line + end - start))

    def record_static_error(self, discretised: DiscretisedLevel) -> None:
        """Keep what the modes leave out of the static response to the forces on the points, f of SolveStatic.

            d = R_0 (y(f) - Psi S^-1 R^T f),   error = max |d_i / l_i| / max |y_i / l_i|,   l_i^2 = R_0i Omega^-2 R_0i^T

        R_0 (m, b) are rows of the points in base coordinates, y(f) (b,) the response of the level without truncation.
        """
        level, force = discretised.loaded.modal, -self.forces  # SolveStatic has the other sign of multipliers
        in_base, modal = self.in_base(level.base), self.map_in(discretised).rows[:, : level.modes]
        _, whole = level.static_response(force @ in_base, np.zeros(len(level.indices)))
        left_out = np.abs(in_base @ (whole - level.vectors @ static_shift(level, force @ modal)))
        lengths = np.linalg.norm(in_base * level.base.periods, axis=1)
        moved = np.abs(self._views[0][self.indices])
        flexible = lengths > 0
        largest = float(np.max(moved[flexible] / lengths[flexible], initial=0.0))
        if not largest > 0:
            return
        shares = np.divide(left_out, lengths * largest, out=np.zeros(len(lengths)), where=flexible)
        worst = int(np.argmax(shares))
        node = next(n for n, part in zip(self._interface_nodes, self._slices, strict=True) if worst < part.stop)
        self.static_error = float(shares[worst]), node.name, level.modes

    def warnings(self, is_free: bool) -> Iterator[str]:
        """Warnings of an interface that turns beyond the linear range, or may do so unseen, a sentence each.

        And of what the modes leave out of a static solution. is_free: whether the body can move as a whole.
        """
        share, name, modes = self.static_error
        if share > STATIC:
            yield (
                f"truncated statics: {modes} modes leave out {per_cent(share)} of the static displacement at {name!r} "
                f"under the forces on the interface; give the model more modes"
            )
        limit = f"the body is linear, do not trust it beyond {math.degrees(TURN):g} degrees: make the motion smaller"
        for names, angle in self.largest_angles.items():
            if angle > TURN:
                turned = f"turned by {math.degrees(angle):.3g} degrees; {limit}"
                if len(names) == 1:
                    yield f"rigid interface {names[0]!r}: {turned}"
                else:
                    yield f"turning: the line between {names[0]!r} and {names[1]!r} {turned}"
        positions = [node.name for node in self._interface_nodes if node.position]
        if positions and is_free and not self.shows_rotations:
            yield (
                f"turning: the body is free to move as a whole and {positions[0]!r} is the only position of its "
                f"interface, so how far it turns is not known; {limit}, and add a second PositionInterface to watch it"
            )

    def set_level(self, discretised: DiscretisedLevel, held: np.ndarray) -> None:
        """Set R and c of a level in the ties, at stick positions (h,) [m]."""
        point_map = self.map_in(discretised)
        offsets = point_map.offset(held)
        for tie, part in zip(self.ties, self._slices, strict=True):
            self._mbs.SetObjectParameter(tie, "scalingMarker0", point_map.rows[part])
            self._mbs.SetObjectParameter(tie, "offset", offsets[part])

    def write(self, discretised: DiscretisedLevel, held: np.ndarray, coordinates: Iterable[np.ndarray]) -> None:
        """Write y, y', y'' for coordinates q, q', q'' (s,) and stick positions (h,) [m]."""
        point_map = self.map_in(discretised)
        for view, values in zip(self._views, coordinates, strict=True):
            view[self.indices] = point_map.rows.dot(values)
        self._views[0][self.indices] += point_map.offset(held)


def _angle(first: np.ndarray, second: np.ndarray) -> float:
    """Angle between two vectors [rad]."""
    along = first.dot(second)
    return math.atan2(math.sqrt(max(0.0, first.dot(first) * second.dot(second) - along * along)), along)


def direct_reactions(level: Level, in_base: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Reactions L (k, m) of closed rigid contacts to unit forces on points, without those to their modal forces.

    in_base, rows: rows of the points in base coordinates (m, b) and in the level's modes (m, r).
    """
    gaps, reactions = np.zeros(len(level.indices)), np.zeros((len(level.indices), len(rows)))
    rigid = np.isinf(level.base.stiffnesses[list(level.indices)])
    if np.any(rigid):
        total = np.array([level.static_response(load, gaps)[0] for load in in_base]).T
        modal = level.force_rows @ np.array([static_shift(level, row) for row in rows]).T
        reactions[rigid] = (total - modal)[rigid]
    return reactions
