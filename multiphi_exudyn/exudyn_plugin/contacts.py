"""Points, contacts and friction of an Exudyn system as rows: derivatives by its coordinates.

    displacement of a point = row . (q - q_0) = row S . z,      gap = gap_0 + row . (q - q_0)

q (n_full,) the ODE2 coordinates, q_0 those of the current state, S (n_full, n) the basis of linearize.py, z (n,) the
coordinates of the linear structure. Gaps are exact for ObjectContactCoordinate and limit stops. A contact of spheres
keeps the direction of the current state: n (d x_1 / d q - d x_0 / d q), n the normal and x_0, x_1 the centres; its
rotation is checked after every run (linear_range.py).

Friction is that of ObjectConnectorCoordinateSpringDamperExt with a bristle,

    q = factor1 q_1 - factor0 q_0,   stick: T = k_s (q - s), |T| <= F,   slip: T = F sign(q')

s the bristle's position, k_s stickingStiffness, F dynamicFrictionForce: Friction(limit=F, stiffness=k_s), if the
bristle sticks without stretch in the state of the reduction, s = q. The connector may have a spring, a damper and limit
stops as well. Other friction of it has another law, and is left out with its name. (velocityOffset belongs to the
damper.) A very small staticFrictionOffsetForce is allowed: without one, Exudyn's own runs may slip in the wrong
direction when stick ends.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.advancedUtilities import NumericalJacobian

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.items import has_friction, has_limit_stops, is_sphere_contact
from multiphi_exudyn.exudyn_plugin.system import sphere_gap
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.friction import Friction

__all__ = [
    "Sphere",
    "contact_distance",
    "contacts_of",
    "coordinate_row",
    "default_points",
    "frictions_of",
    "moved_by",
    "requested_points",
    "spheres_of",
]

HELD = 1e-9  # of a row's largest entry before projection: a smaller row is a point that constraints fix
_AXES = ("x", "y", "z")
_VELOCITIES = {"initialVelocities", "initialCoordinates_t"}  # parameters of nodes with ODE2 coordinates only
SMALL_OFFSET = 1e-3  # of the limit: a smaller static offset is part of the static limit, at any speed
UNSTRETCHED = 1e-9  # of the limit: a smaller bristle force is round-off


@dataclass(frozen=True, eq=False)
class Sphere:
    """A contact of a sphere at q_0: index of its object, gap [m], unit normal (3,)."""

    index: int
    gap: float
    normal: np.ndarray


def coordinate_row(mbs: Any, marker: Any) -> np.ndarray:
    """Row (n_full,) of a marker of one coordinate."""
    return next(iter(_marker_rows(mbs, "marker", marker).values()))


def gap_row(mbs: Any, index: Any) -> np.ndarray:
    """Row (n_full,) of the gap of a contact of spheres, its derivative at the current state."""
    indices = range(len(mbs.systemData.GetODE2Coordinates()))
    gap = exu.OutputVariableType.DisplacementLocal
    return np.asarray(NumericalJacobian(mbs, lambda: np.atleast_1d(mbs.GetObjectOutput(index, gap)), indices)[0])


def default_points(mbs: Any, basis: np.ndarray, prescribed: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Rows (n,) of all markers and node coordinates that can move, by their own names.

    prescribed (k, n_full): directions of prescribed motions; what they move is not determined by z alone, and no point.
    """
    rows: dict[str, np.ndarray] = {}
    for i in range(mbs.systemData.NumberOfMarkers()):
        marker = exu.MarkerIndex(i)
        try:
            marker_rows = _marker_rows(mbs, mbs.GetMarker(marker)["name"], marker)
        except MultiPhiError:  # a marker without position or coordinates names no point
            continue
        _add(rows, marker_rows)
    for i in range(mbs.systemData.NumberOfNodes()):
        _add(rows, _node_rows(mbs, exu.NodeIndex(i)))
    return {name: row @ basis for name, row in rows.items() if _moves(row, basis) and not moved_by(row, prescribed)}


def moved_by(row: np.ndarray, prescribed: np.ndarray | None) -> bool:
    """Whether prescribed motions in directions (k, n_full) move a row (n_full,) beyond round-off."""
    if prescribed is None or not prescribed.size:
        return False
    return bool(np.max(np.abs(prescribed @ row)) > HELD * np.max(np.abs(prescribed)) * np.max(np.abs(row)))


def _add(rows: dict[str, np.ndarray], new: Mapping[str, np.ndarray]) -> None:
    for name, row in new.items():
        if name in rows:
            raise MultiPhiValueError(
                f"points: got two markers or nodes that give a point {name!r}, need names of your own, points={{...}}"
            )
        rows[name] = row


def requested_points(
    mbs: Any, points: Mapping[str, Any], basis: np.ndarray, prescribed: np.ndarray | None = None
) -> dict[str, np.ndarray]:
    """Rows (n,) of requested points; raise MultiPhiValueError or MultiPhiTypeError for one that does not exist.

    prescribed (k, n_full): directions of prescribed motions, which may not move a point.
    """
    if not isinstance(points, Mapping):
        needed = "{name: marker index or (node index, coordinate number)}"
        raise MultiPhiTypeError(f"points: got {type(points).__name__}, need {needed}")
    rows: dict[str, np.ndarray] = {}
    for name, place in points.items():
        _add(rows, _requested_rows(mbs, name, place))
    for name, row in rows.items():
        if moved_by(row, prescribed):
            raise MultiPhiValueError(
                f"points[{name!r}]: got a place that a prescribed motion moves, need others; the displacement of all "
                "coordinates is Reduction.displacement"
            )
    return {name: row @ basis for name, row in rows.items()}


def _requested_rows(mbs: Any, name: str, place: Any) -> dict[str, np.ndarray]:
    if isinstance(place, tuple):
        return {name: _node_coordinate_row(mbs, name, *place)}
    if not isinstance(place, (int, np.integer, exu.MarkerIndex)):
        raise MultiPhiTypeError(
            f"points[{name!r}]: got {place!r}, need a marker index or (node index, coordinate number)"
        )
    if not 0 <= int(place) < mbs.systemData.NumberOfMarkers():
        raise MultiPhiValueError(f"points[{name!r}]: got marker {int(place)}, need one that exists")
    return _marker_rows(mbs, name, exu.MarkerIndex(int(place)))


def _node_coordinate_row(mbs: Any, name: str, node: Any, coordinate: int) -> np.ndarray:
    rows = list(_node_rows(mbs, exu.NodeIndex(int(node))).values())
    if not 0 <= coordinate < len(rows):
        raise MultiPhiValueError(f"points[{name!r}]: got coordinate {coordinate}, need 0 <= coordinate < {len(rows)}")
    return rows[coordinate]


def _node_rows(mbs: Any, node: Any) -> dict[str, np.ndarray]:
    """Row of every coordinate of a node, (n_full,) each; none for ground and data nodes."""
    item, coordinates = mbs.GetNode(node), np.eye(len(mbs.systemData.GetODE2Coordinates()))
    if not _VELOCITIES & item.keys():
        return {}
    first, count = mbs.GetNodeODE2Index(node), len(item["initialCoordinates"])
    return {f"{item['name']}.{c}": coordinates[first + c] for c in range(count)}


def _marker_rows(mbs: Any, name: str, marker: Any) -> dict[str, np.ndarray]:
    """Rows (n_full,) of a marker's coordinates, or else of its position."""
    if mbs.GetMarker(marker)["markerType"] == "NodeCoordinate":
        return {name: _node_coordinate_marker_row(mbs, marker)}
    outputs = exu.OutputVariableType
    for variable, labels in ((outputs.Coordinates, None), (outputs.Position, _AXES)):
        try:
            values = np.atleast_1d(mbs.GetMarkerOutput(marker, variable))
        except (exu.ExudynError, ValueError):  # not an output of this type of marker
            continue
        rows = _derivative(mbs, marker, variable)
        if len(values) == 1:
            return {name: rows[0]}
        return {f"{name}.{label}": row for label, row in zip(labels or range(len(values)), rows, strict=True)}
    raise MultiPhiValueError(f"points[{name!r}]: got a marker without coordinates or position, need one")


def _node_coordinate_marker_row(mbs: Any, marker: Any) -> np.ndarray:
    item = mbs.GetMarker(marker)
    rows = list(_node_rows(mbs, exu.NodeIndex(item["nodeNumber"])).values())
    return rows[item["coordinate"]] if rows else np.zeros(len(mbs.systemData.GetODE2Coordinates()))


def _derivative(mbs: Any, marker: Any, variable: Any) -> np.ndarray:
    """Derivatives (values, n_full) of a marker's output by the ODE2 coordinates, by central differences."""
    indices = range(len(mbs.systemData.GetODE2Coordinates()))
    return NumericalJacobian(mbs, lambda: mbs.GetMarkerOutput(marker, variable), indices)


def _moves(row: np.ndarray, basis: np.ndarray) -> bool:
    return bool(np.max(np.abs(row @ basis)) > HELD * np.max(np.abs(row), initial=1.0))


def contact_distance(mbs: Any, index: int, item: Mapping[str, Any]) -> float:
    """Gap [m] of a contact, or the displacement [m] of a limit stop."""
    outputs = exu.OutputVariableType
    variable = outputs.Displacement if has_limit_stops(item) else outputs.Distance
    variable = outputs.DisplacementLocal if is_sphere_contact(item) else variable
    return float(mbs.GetObjectOutput(exu.ObjectIndex(index), variable))


def contacts_of(mbs: Any, index: int, item: Mapping[str, Any], distance: float) -> Iterator[UnilateralContact]:
    """Contacts of an object, their directions as rows (n_full,)."""
    if not has_limit_stops(item):
        law = float(item["contactStiffness"]), float(item["contactDamping"])
        yield UnilateralContact(item["name"], _direction(mbs, index, item), distance, *law)
        return
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    row = item["factor1"] * second - item["factor0"] * first
    law = float(item["limitStopsStiffness"]), float(item["limitStopsDamping"])
    yield UnilateralContact(f"{item['name']}.upper", -row, item["limitStopsUpper"] - distance, *law)
    yield UnilateralContact(f"{item['name']}.lower", row, distance - item["limitStopsLower"], *law)


def _direction(mbs: Any, index: int, item: Mapping[str, Any]) -> np.ndarray:
    """Row (n_full,) of the gap of a contact."""
    if is_sphere_contact(item):
        return gap_row(mbs, exu.ObjectIndex(index))
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    return second - first


def spheres_of(mbs: Any, objects: Sequence[Mapping[str, Any]], contacts: Collection[str]) -> dict[str, Sphere]:
    """Contacts of spheres that are part of the model, by name, at the current state."""
    indices = {
        item["name"]: i for i, item in enumerate(objects) if is_sphere_contact(item) and item["name"] in contacts
    }
    return {name: Sphere(i, *sphere_gap(mbs, i)) for name, i in indices.items()}


def frictions_of(mbs: Any, objects: Sequence[Mapping[str, Any]]) -> dict[int, Friction | str]:
    """Frictions of active connectors by index, directions as rows (n_full,), or the reason why one has another law."""
    return {i: _friction(mbs, i, item) for i, item in enumerate(objects) if has_friction(item)}


def _friction(mbs: Any, index: int, item: Mapping[str, Any]) -> Friction | str:
    refusal = _law(item) or _state(mbs, index, item)
    if refusal:
        return refusal
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    row = item["factor1"] * second - item["factor0"] * first
    limit = item["dynamicFrictionForce"]
    return Friction(item["name"], row, limit, limit + item["staticFrictionOffsetForce"], item["stickingStiffness"])


def _law(item: Mapping[str, Any]) -> str:
    """Reason why the law differs from that of Friction; empty if it does not."""
    if item["frictionProportionalZone"] != 0:
        return "friction in proportion to slow speeds (frictionProportionalZone), which creeps where it should stick"
    if item["staticFrictionOffsetForce"] > SMALL_OFFSET * item["dynamicFrictionForce"]:
        return "friction that falls with the speed (staticFrictionOffsetForce, exponentialDecayStatic)"
    if item["viscousFrictionFactor"] != 0:
        return "friction that grows with the speed of slip (viscousFrictionFactor)"
    if item["stickingDamping"] != 0:
        return "friction with a damped bristle (stickingDamping)"
    return ""


def _state(mbs: Any, index: int, item: Mapping[str, Any]) -> str:
    """Reason why the bristle slips or is stretched in the current state; empty if it does not."""
    state, position, _ = mbs.systemData.GetDataCoordinates()[mbs.systemData.GetObjectLTGData(index)]
    if state != 0:
        return f"friction that slips already (data coordinate 0: {state:g}), need a bristle that sticks: 0"
    travel = mbs.GetObjectOutput(exu.ObjectIndex(index), exu.OutputVariableType.Displacement)
    if abs(item["stickingStiffness"] * (travel - position)) > UNSTRETCHED * item["dynamicFrictionForce"]:
        return f"friction with a stretched bristle (data coordinate 1: {position:g}), need its coordinate: {travel:g}"
    return ""
