"""Points of an Exudyn system as rows: derivatives of its markers and nodes by its coordinates.

    displacement of a point = row . (q - q_0) = row S . z

q (n_full,) the ODE2 coordinates, S (n_full, n) the basis of linearize.py, z (n,) those of the linear structure.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.advancedUtilities import NumericalJacobian

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError

__all__ = ["coordinate_row", "default_points", "gap_row", "moved_by", "requested_points"]

HELD = 1e-9  # of a row's largest entry before projection: a smaller row is a point that constraints fix

_AXES = ("x", "y", "z")
_VELOCITIES = {"initialVelocities", "initialCoordinates_t"}  # parameters of nodes with ODE2 coordinates only


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
