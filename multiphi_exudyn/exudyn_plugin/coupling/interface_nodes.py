"""Interface nodes: nodes of an Exudyn system that represent points of a body.

    y = R q + c,   y the coordinates of the node: displacements [m] from its position, and angles [rad]

One coordinate is a NodeGenericODE2. A position is a NodePoint2D or a NodePoint, whose coordinates are displacements in
global directions; it takes markers of positions, and with them springs, distance and spherical joints. A rigid
interface is a NodeRigidBody2D or a NodeRigidBodyRxyz; it takes markers of rigid bodies, and with them every joint. The
nodes have no mass, and their coordinates are linear in q; the system around them may move by large displacements.

The angles of a NodeRigidBodyRxyz are successive rotations about the node's x, y and z axis. Small ones are the
components of one rotation, as in a linear structure; at 5 degrees about two axes the difference is 0.004 rad. At any
angle, forces on the node have the same power as their modal forces p = R^T f.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from exudyn.itemInterface import NodeGenericODE2, NodePoint, NodePoint2D, NodeRigidBody2D, NodeRigidBodyRxyz

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.mechanics.structures.arguments import real_array
from multiphi_exudyn.mechanics.structures.structure import At, LinearStructure

__all__ = ["InterfaceNode", "InterfacePoint", "PositionInterface", "RigidInterface", "interface_nodes", "long_lines"]

TURN = math.radians(5.0)  # rad: limit of the rotation of an interface, as the body is linear
ROTATIONS = {2: 1, 3: 3}  # by the number of directions: about z in a plane, about x, y and z in space


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


_KINDS = {(2, 0): NodePoint2D, (3, 0): NodePoint, (2, 1): NodeRigidBody2D, (3, 3): NodeRigidBodyRxyz}


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
