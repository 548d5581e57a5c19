"""Interface coordinates: points of a body that connectors, loads and sensors of an Exudyn system can act on.

    y = R q + c,   0 = f + reaction of the tie,   p = R^T f

y displacements and rotations of the points, the coordinates of massless nodes (interface_nodes.py). R (m, s) rows of
the points in the modes of the present level, c (m,) its asymptotic configuration there [m, rad]; f (m,) what acts on y
[N, N m], p its modal force. One ObjectConnectorCoordinateVector per node holds the equation. At a transition R and c
are exchanged and y, y', y'' are written, so y is the displacement of the body at every step. With modes matched to the
step, y' = R q' is the solver's velocity (stepped_level.py).

f comes from the multipliers of the ties, so points may depend on each other, and a rigid contact may hold one. Within
the step of an event the f of its mean acts before the event, and after it with what the event changes in reactions,
loads, connectors and inertia (exact_step.py): exact for a force that is constant, of second order for one that varies
(single halvings of the step scatter about it, as the place of an event in its step changes too). The modes are those of
free points: one whose motion is prescribed takes more of them.

An impact on a rigid contact is one of the body with all that masses and constraints tie to its points
(attached_inertia.py); springs and dampers are no part of it, being finite. What they do within the step of an event has
to be resolved by it, stiff ones by a short step; a run in which it is not ends with an error (exact_step.py). A point
that a closed rigid
contact holds may carry anything but a further constraint: Exudyn then has two for one coordinate.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import exudyn as exu
import numpy as np
from exudyn.itemInterface import MarkerNodeCoordinates, ObjectConnectorCoordinateVector, SensorObject

from multiphi_exudyn.exudyn_plugin.coupling.interface_nodes import TURN, InterfaceNode
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import shift
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["Interface", "Look"]

Look: TypeAlias = Mapping[str, Any]  # show and color of items in the renderer


@dataclass(frozen=True)
class _Reading:
    """y = R q + c in one level. rows: R (m, s). offset: c (m,), at places that links hold (h,), constant + moved . w.

    direct: L (k, m), what f adds to the forces of the closed contacts beside its modes' share.
    """

    rows: np.ndarray
    constant: np.ndarray
    moved: np.ndarray
    direct: np.ndarray

    def offset(self, held: np.ndarray) -> np.ndarray:
        """c (m,)."""
        return self.constant + self.moved @ held if len(held) else self.constant


class Interface:
    """The interface coordinates of one body in one system.

    count: m. nodes: NodeIndex by name. sensors: of f, by name. ties: the objects that hold the equation. turned: by how
    much rigid nodes have turned at most [rad], by name. most: levels of which R and c are kept.
    """

    def __init__(self, mbs: Any, name: str, given: Sequence[InterfaceNode], most: int) -> None:
        self.nodes: dict[str, Any] = {}
        self.sensors: dict[str, Any] = {}
        self.turned: dict[str, float] = {}
        self._name = name
        self._given = tuple(given)
        self._rows = np.concatenate([node.rows for node in given])
        self.count = len(self._rows)
        self._last: tuple[ModalBase | None, np.ndarray] = None, np.zeros(0)
        ends = np.cumsum([len(node.rows) for node in given])
        self._parts = [slice(int(end) - len(node.rows), int(end)) for node, end in zip(given, ends, strict=True)]
        self.ties: list[Any] = []
        self._known: BoundedCache[tuple[int, ...], _Reading] = BoundedCache(most)
        self._mbs = mbs

    def add(
        self,
        node: Any,
        stepped: SteppedLevel,
        held: np.ndarray,
        q: np.ndarray,
        q_t: np.ndarray,
        look: Mapping[str, Any],
    ) -> None:
        """Add nodes and ties for a body whose node holds q, q' (s,) in a level, with places that links hold (h,)."""
        found, mbs = self.of(stepped), self._mbs
        own, offsets = mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=node)), found.offset(held)
        for given, part in zip(self._given, self._parts, strict=True):
            rows, offset, called = found.rows[part], offsets[part], f"{self._name}.{given.name}"
            point = mbs.AddNode(given.item(f"Node:{called}", rows @ q + offset, rows @ q_t, look))
            tie = ObjectConnectorCoordinateVector(
                name=called,
                markerNumbers=[own, mbs.AddMarker(MarkerNodeCoordinates(nodeNumber=point))],
                scalingMarker0=rows,
                scalingMarker1=np.eye(len(rows)),
                offset=offset,
            )
            self.nodes[given.name] = point
            self.ties.append(mbs.AddObject(tie))
            self.sensors[given.name] = mbs.AddSensor(
                SensorObject(
                    name=f"Sensor:{called}",
                    objectNumber=self.ties[-1],
                    outputVariableType=exu.OutputVariableType.Force,
                    storeInternal=True,
                    writeToFile=False,
                )
            )

    def of(self, stepped: SteppedLevel) -> _Reading:
        """R and c of a level."""
        return self._known.get_or_build(stepped.states, lambda: self._read(stepped))

    def _read(self, stepped: SteppedLevel) -> _Reading:
        loaded = stepped.loaded
        level = loaded.modal
        rows = np.zeros((len(self._rows), stepped.size))
        in_base = self.in_base(level.base)
        rows[:, : level.modes] = drop_round_off(in_base @ level.vectors, np.abs(in_base) @ np.abs(level.vectors))
        direct = _reactions(level, in_base, rows[:, : level.modes])
        return _Reading(rows, in_base @ loaded.asymptotic.configuration, in_base @ loaded.channels.shapes, direct)

    def in_base(self, base: ModalBase) -> np.ndarray:
        """The points (m, b) in base coordinates; of the last base they are kept."""
        if self._last[0] is not base:
            self._last = base, np.asarray(self._rows @ base.modes.shapes)
        return self._last[1]

    def attach(self, state: Mapping[str, np.ndarray]) -> None:
        """Views of the interface coordinates in the system's current state; they hold for one run."""
        first = [self._mbs.GetNodeODE2Index(node) for node in self.nodes.values()]
        sizes = [len(node.rows) for node in self._given]
        self.places = np.concatenate([np.arange(k, k + size) for k, size in zip(first, sizes, strict=True)])
        self._angles = {
            node.name: self.places[part][-node.angles :]
            for node, part in zip(self._given, self._parts, strict=True)
            if node.angles
        }
        self.turned = dict.fromkeys(self._angles, 0.0)
        self._views = tuple(state[key] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        rows = [self._mbs.systemData.GetObjectLTGAE(tie) for tie in self.ties]
        self.multipliers = np.concatenate(rows).astype(int)
        self._forces = state["AECoords"]

    @property
    def forces(self) -> np.ndarray:
        """f (m,) in the system's current state."""
        return np.asarray(self._forces[self.multipliers])

    @property
    def turns(self) -> bool:
        """Whether it has rigid nodes."""
        return any(node.angles for node in self._given)

    def look(self) -> None:
        """See how far rigid nodes are turned in the system's current state."""
        for name, places in self._angles.items():
            self.turned[name] = max(self.turned[name], float(np.linalg.norm(self._views[0][places])))

    @property
    def warnings(self) -> Iterator[str]:
        """Of rigid nodes that turned further than a linear body can, a sentence each."""
        for name, angle in self.turned.items():
            if angle > TURN:
                yield (
                    f"rigid interface {name!r}: turned by {math.degrees(angle):.3g} degrees; the body is linear, do "
                    f"not trust it beyond {math.degrees(TURN):g} degrees: make the motion smaller"
                )

    def load(self, stepped: SteppedLevel, held: np.ndarray) -> None:
        """Give the ties R and c of a level, with places that links hold (h,)."""
        found = self.of(stepped)
        offsets = found.offset(held)
        for tie, part in zip(self.ties, self._parts, strict=True):
            self._mbs.SetObjectParameter(tie, "scalingMarker0", found.rows[part])
            self._mbs.SetObjectParameter(tie, "offset", offsets[part])

    def write(self, stepped: SteppedLevel, held: np.ndarray, coordinates: Iterable[np.ndarray]) -> None:
        """Write y, y', y'' of q, q', q'' (s,), with places that links hold (h,)."""
        found = self.of(stepped)
        for view, values in zip(self._views, coordinates, strict=True):
            view[self.places] = found.rows.dot(values)
        self._views[0][self.places] += found.offset(held)

    def carried(self, force: np.ndarray, given: SteppedLevel, wanted: SteppedLevel) -> np.ndarray:
        """(p, f) (s + m,) of one level in another: f is the same, what else acts does so mode by mode."""
        if given.states == wanted.states:
            return force
        modal, points = force[: given.size], force[given.size :]
        return np.concatenate([modal + points @ (self.of(wanted).rows - self.of(given).rows), points])


def _reactions(level: Level, in_base: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Reactions (k, m) of closed rigid contacts to unit forces on points, less those to the forces on the modes.

    in_base, rows: the points in base coordinates (m, b) and in the level's modes (m, r).
    """
    gaps, found = np.zeros(len(level.indices)), np.zeros((len(level.indices), len(rows)))
    rigid = np.isinf(level.base.stiffnesses[list(level.indices)])
    if np.any(rigid):
        whole = np.array([level.static_response(load, gaps)[0] for load in in_base]).T
        modal = level.force_rows @ np.array([shift(level, row) for row in rows]).T
        found[rigid] = (whole - modal)[rigid]
    return found
