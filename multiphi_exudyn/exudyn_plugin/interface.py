"""Interface coordinates: points of a body that connectors, loads and sensors of an Exudyn system can act on.

    y = R q + c,   0 = f + reaction of the tie,   p = R^T f

y displacements (or rotations) of the points, each the coordinate of a massless NodeGenericODE2, so that
MarkerNodeCoordinate(node, 0) works as for any other item. R (m, s) rows of the points in the modes of the present
level, c (m,) its asymptotic configuration there [m]; f (m,) what acts on y [N], p its modal force. One
ObjectConnectorCoordinateVector per point holds the equation. At a transition R and c are exchanged and y, y', y'' are
written, so y is the displacement of the body at every step. With modes matched to the step, y' = R q' is the solver's
velocity (stepped_level.py).

Within the step of an event the f of its mean acts before the event, and after it with what the event changed in loads
and connectors: exact for a force that is constant, of second order for one that varies (single halvings of the step
scatter about it, as the place of an event in its step changes too), of first order where a contact damper makes the
force of a constraint or of a mass on y jump. f comes from p, so the rows must be independent in
every level; a point that rigid contacts hold has no p there and is refused, while its neighbours and compliant contacts
are not. The modes are those of free points: one whose motion is prescribed takes more of them.

An impact on a rigid contact is one of the body alone: springs and dampers on y are no part of it, being finite, but a
mass on y or a constraint would be, and is refused beside rigid contacts. Compliant ones have no impacts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import MarkerNodeCoordinates, NodeGenericODE2, ObjectConnectorCoordinateVector

from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.items import is_constraint
from multiphi_exudyn.exudyn_plugin.modal_force import shift
from multiphi_exudyn.exudyn_plugin.stepped_level import SteppedLevel
from multiphi_exudyn.level import Level
from multiphi_exudyn.recent import Recent
from multiphi_exudyn.structure import At, LinearStructure

__all__ = ["Interface", "interface_rows"]

INDEPENDENT = 1e-9  # of the largest singular value of rows of unit length: less is rounding of their coefficients


def interface_rows(
    structure: LinearStructure, contacts: Iterable[UnilateralContact], given: Iterable[str] | Mapping[str, At]
) -> dict[str, np.ndarray]:
    """Rows (n,) by the names of interface coordinates, from names of points or {name: point or row}."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"interface: got {given!r}, need names of points, or {{name: point or row}}")
    points = dict(given) if isinstance(given, Mapping) else {name: name for name in given}
    for name in points:
        if not isinstance(name, str):
            raise MultiPhiTypeError(f"interface: got {name!r}, need a name")
    rows = {name: structure.row(at) for name, at in points.items()}
    for name, row in rows.items():
        if not np.any(row):
            raise MultiPhiValueError(f"interface: got a row of zeros for {name!r}, need one that moves")
    rigid = {c.name: structure.row(c.direction) for c in contacts if c.rigid}
    known = list(rigid.values())
    for name, row in rows.items():
        if _rank([*known, row]) == _rank(known):
            raise MultiPhiValueError(_dependent(name, row, {n: r for n, r in rows.items() if n != name}, rigid))
        known.append(row)
    return rows


def _dependent(name: str, row: np.ndarray, others: Mapping[str, np.ndarray], rigid: Mapping[str, np.ndarray]) -> str:
    """What to say of a point that depends on others and rigid contacts."""
    held = _rank([*rigid.values(), row]) == _rank(list(rigid.values()))
    by = f"which rigid contacts hold ({_listed(rigid)})" if held else f"which moves with {_listed([*others, *rigid])}"
    return f"interface: got {name!r}, {by}, need a point that depends on no other and on no rigid contact"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(map(repr, names))


def _rank(rows: Sequence[np.ndarray] | np.ndarray) -> int:
    """How many rows (n,) are independent."""
    if len(rows) == 0:
        return 0
    lengths = np.linalg.norm(rows, axis=1, keepdims=True)
    return int(np.linalg.matrix_rank(rows / np.where(lengths > 0, lengths, 1), rtol=INDEPENDENT))


@dataclass(frozen=True)
class _Reading:
    """y = R q + c in one level. rows: R (m, s). offset: c (m,). inverse: the pseudo-inverse of R^T (m, s).

    direct: L (k, s), what p adds to the forces of the closed contacts beside its modes' share.
    """

    rows: np.ndarray
    offset: np.ndarray
    inverse: np.ndarray
    direct: np.ndarray


class Interface:
    """The interface coordinates of one body in one system.

    nodes: NodeIndex by name. most: levels of which R and c are kept.
    """

    def __init__(self, mbs: Any, name: str, rows: Mapping[str, np.ndarray], most: int) -> None:
        self.nodes: dict[str, Any] = {}
        self._name = name
        self._rows = np.array(list(rows.values()))
        self._names = tuple(rows)
        self._ties: list[Any] = []
        self._known: Recent[tuple[int, ...], _Reading] = Recent(most)
        self._mbs = mbs

    def add(self, node: Any, stepped: SteppedLevel, q: np.ndarray, q_t: np.ndarray) -> None:
        """Add nodes and ties for a body whose node holds q, q' (s,) in a level."""
        found, mbs = self.of(stepped), self._mbs
        own = mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=node))
        for name, row, constant in zip(self._names, found.rows, found.offset, strict=True):
            point = mbs.AddNode(
                NodeGenericODE2(
                    name=f"Node:{self._name}.{name}",
                    referenceCoordinates=[0.0],
                    initialCoordinates=[row @ q + constant],
                    initialCoordinates_t=[row @ q_t],
                    numberOfODE2Coordinates=1,
                )
            )
            marker = mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=point))
            tie = ObjectConnectorCoordinateVector(
                name=f"{self._name}.{name}",
                markerNumbers=[own, marker],
                scalingMarker0=row[None, :],
                scalingMarker1=np.eye(1),
                offset=[constant],
            )
            self.nodes[name] = point
            self._ties.append(mbs.AddObject(tie))

    def of(self, stepped: SteppedLevel) -> _Reading:
        """R and c of a level."""
        return self._known.made(stepped.closed, lambda: self._read(stepped))

    def _read(self, stepped: SteppedLevel) -> _Reading:
        level = stepped.loaded.level
        rows = np.zeros((len(self._rows), stepped.size))
        rows[:, : level.modes] = self._rows @ level.shapes
        if _rank(rows) < len(rows):
            raise MultiPhiValueError(
                f"interface of {self._name!r}: got {len(rows)} points that {level.modes} modes do not tell "
                f"apart, need fewer points or more modes with {', '.join(level.closed) or 'no contact'} closed"
            )
        in_base = self._rows @ level.base.modes.shapes
        inverse = np.linalg.pinv(rows.T)
        direct = _reactions(level, in_base, rows[:, : level.modes]) @ inverse
        return _Reading(rows, in_base @ stepped.loaded.asymptotic.configuration, inverse, direct)

    def attach(self, state: Mapping[str, np.ndarray]) -> None:
        """Views of the interface coordinates in the system's current state; they hold for one run."""
        self.places = np.array([self._mbs.GetNodeODE2Index(node) for node in self.nodes.values()])
        self._views = tuple(state[key] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))

    def check_impacts(self) -> None:
        """Raises for a mass or a constraint on y, which would take part in impacts."""
        data, own = self._mbs.systemData, {int(tie) for tie in self._ties}
        markers = (self._mbs.GetMarker(exu.MarkerIndex(i)) for i in range(data.NumberOfMarkers()))
        on_y = {i for i, marker in enumerate(markers) if self._acted_on([marker.get("nodeNumber")])}
        for i in set(range(data.NumberOfObjects())) - own:
            item = self._mbs.GetObject(exu.ObjectIndex(i))
            tied = (
                is_constraint(item) and item["activeConnector"] and on_y.intersection(map(int, item["markerNumbers"]))
            )
            if tied or (self._acted_on(item.get("nodeNumbers", ())) and np.any(item.get("massMatrix", 0.0))):
                raise MultiPhiValueError(
                    f"interface of {self._name!r}: got Object{item['objectType']} {item['name']!r} on it beside rigid "
                    "contacts, need compliant contacts, the mass as part of the structure, or a spring between"
                )

    def _acted_on(self, nodes: Iterable[Any]) -> bool:
        """Whether one of some nodes is an interface coordinate."""
        return any(node is not None and int(node) in map(int, self.nodes.values()) for node in nodes)

    def load(self, stepped: SteppedLevel) -> None:
        """Give the ties R and c of a level."""
        found = self.of(stepped)
        for tie, row, constant in zip(self._ties, found.rows, found.offset, strict=True):
            self._mbs.SetObjectParameter(tie, "scalingMarker0", row[None, :])
            self._mbs.SetObjectParameter(tie, "offset", [constant])

    def write(self, stepped: SteppedLevel, coordinates: Iterable[np.ndarray]) -> None:
        """Write y, y', y'' of q, q', q'' (s,)."""
        found = self.of(stepped)
        for view, values, constant in zip(self._views, coordinates, (found.offset, 0.0, 0.0), strict=True):
            view[self.places] = found.rows @ values + constant

    def modal(self, stepped: SteppedLevel, residual: np.ndarray) -> np.ndarray:
        """Modal force (s,) of what acts on y, from the forces on all coordinates of the system."""
        return np.asarray(residual[self.places] @ self.of(stepped).rows)

    def direct(self, stepped: SteppedLevel) -> np.ndarray:
        """L (k, s) of a level, see ``_Reading``."""
        return self.of(stepped).direct

    def carried(self, force: np.ndarray, given: SteppedLevel, wanted: SteppedLevel) -> np.ndarray:
        """A modal force (s,) of one level in another: f by least squares, its rest mode by mode."""
        old, new = self.of(given), self.of(wanted)
        return np.asarray(force + (old.inverse @ force) @ (new.rows - old.rows))


def _reactions(level: Level, in_base: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Reactions (k, m) of closed rigid contacts to unit forces on points, less those to the forces on the modes.

    in_base, rows: the points in base coordinates (m, b) and in the level's modes (m, r).
    """
    gaps, found = np.zeros(len(level.indices)), np.zeros((len(level.indices), len(rows)))
    rigid = np.isinf(level.base.stiffnesses[list(level.indices)])
    if np.any(rigid):
        whole = np.array([level.rest(load, gaps)[0] for load in in_base]).T
        modal = level.force_rows @ np.array([shift(level, row) for row in rows]).T
        found[rigid] = (whole - modal)[rigid]
    return found
