"""Sensors of a Multi-Phi body, and histories rebuilt from them after a run (eq. 38.4).

    x_p(t) = p.(Phi_l eta(t) + x_inf,l),   g_i(t) = h_i.x + gap_i,   lambda_i(t) from eta, eta' (level.py), and L f

Exudyn's own node sensors record eta, its derivatives and the level, and cost next to nothing during a run.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorNode

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.state import Event
from multiphi_exudyn.exudyn_plugin.body.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of

__all__ = ["BodyHistories", "add_sensors", "body_histories", "rebuilt"]

RECORDED = {
    "sCoordinates": exu.OutputVariableType.Coordinates,
    "sCoordinates_t": exu.OutputVariableType.Coordinates_t,
    "sCoordinates_tt": exu.OutputVariableType.Coordinates_tt,
}


@dataclass(frozen=True)
class BodyHistories:
    """What a body's sensors recorded: k samples at ``sensors.writePeriod``; for an event list exact times.

    time (k,) [s]; points: name -> displacement (k,) [m]; velocities: name -> (k,) [m/s]; gaps: contact -> (k,) [m];
    contact_force: contact -> lambda (k,) [N]; contact_intervals: contact -> [(closed at, opened at), ...] [s];
    closed: contact -> (k,) bool; events and warnings as in a Trajectory.
    """

    time: np.ndarray
    points: Mapping[str, np.ndarray]
    velocities: Mapping[str, np.ndarray]
    gaps: Mapping[str, np.ndarray]
    contact_force: Mapping[str, np.ndarray]
    contact_intervals: Mapping[str, list[tuple[float, float]]]
    closed: Mapping[str, np.ndarray]
    events: tuple[Event, ...]
    warnings: tuple[str, ...]


def add_sensors(mbs: Any, body: MultiPhiBody) -> dict[str, Any]:
    """Sensors of the node's coordinates and of the level; all are kept in memory, none is written to a file."""
    items = {key: _sensor(mbs, body, key, "nGenericODE2", kind) for key, kind in RECORDED.items()}
    if "nGenericData" in body.items:
        items["sLevel"] = _sensor(mbs, body, "sLevel", "nGenericData", exu.OutputVariableType.Coordinates)
    return items


def _sensor(mbs: Any, body: MultiPhiBody, key: str, node: str, kind: Any) -> Any:
    return mbs.AddSensor(
        SensorNode(
            name=f"Sensor:{body.name}.{key}",
            nodeNumber=body.items[node],
            outputVariableType=kind,
            storeInternal=True,
            writeToFile=False,
        )
    )


def body_histories(mbs: Any, items: Mapping[str, Any], points: Iterable[str] | None = None) -> BodyHistories:
    """Histories of a body from the sensors of the last run; ``items`` as returned when it was created.

    points: names to rebuild, None for all of the structure.
    """
    body = _body_of(mbs, items)
    on_points = [mbs.GetSensorStoredData(sensor)[:, 1] for sensor in items.get("sInterface", {}).values()]
    table = {key: mbs.GetSensorStoredData(items[key]) for key in (*RECORDED, "sLevel") if key in items}
    time = table["sCoordinates"][:, 0]
    if len(time) == 0:
        raise MultiPhiValueError("sensors: got no stored data, need a run of SolveDynamic before")
    bodies_of(mbs).check_called(float(time[-1]))
    contacts = [contact.name for contact in body.model.contacts]
    flags = table["sLevel"][:, 1 : 1 + len(contacts)] > 0.5 if contacts else np.zeros((len(time), 0), bool)
    names = body.model.structure.points if points is None else list(points)
    rows = np.array([body.model.structure.row(name) for name in names]).reshape(-1, body.model.structure.n)
    stored = np.hstack([table[key][:, 1:] for key in RECORDED])
    values = rebuilt(body, rows, flags, time, stored, np.reshape(on_points, (len(on_points), len(time))))
    return BodyHistories(
        time=time,
        points=dict(zip(names, values[0], strict=True)),
        velocities=dict(zip(names, values[1], strict=True)),
        gaps=dict(zip(contacts, values[2], strict=True)),
        contact_force=dict(zip(contacts, values[3], strict=True)),
        contact_intervals={
            c: _intervals(body.events, c, bool(f[0]), time) for c, f in zip(contacts, flags.T, strict=True)
        },
        closed=dict(zip(contacts, flags.T, strict=True)),
        events=tuple(body.events),
        warnings=body.warnings,
    )


def _body_of(mbs: Any, items: Mapping[str, Any]) -> MultiPhiBody:
    for body in bodies_of(mbs).values():
        if isinstance(body, MultiPhiBody) and items.get("nGenericODE2") == body.items["nGenericODE2"]:
            return body
    raise MultiPhiValueError("items: got a dict of no Multi-Phi body of this system, need one it returned")


def rebuilt(
    body: MultiPhiBody,
    rows: np.ndarray,
    flags: np.ndarray,
    time: np.ndarray,
    stored: np.ndarray,
    on_points: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Displacements and velocities of points, gaps and contact forces, each (.., k), level by level.

    on_points: f (m, k).
    """
    k, contacts = len(stored), flags.shape[1]
    moved, rates = np.zeros((2, len(rows), k))
    gaps, forces = np.zeros((2, contacts, k))
    in_base = rows @ body.model.base.modes.shapes
    for closed in np.unique(flags, axis=0):
        here = np.flatnonzero(np.all(flags == closed, axis=1))
        stepped = body.stepped_level(np.flatnonzero(closed).tolist())
        r, physical = stepped.loaded.level.modes, stepped.physical @ stored[here].T
        eta, eta_t = physical[:r], physical[stepped.size : stepped.size + r]
        loaded, xi, xi_t = body.shown(stepped, eta, eta_t, time[here])
        own, rest = loaded.level, loaded.asymptotic
        moved[:, here] = in_base @ (own.vectors @ xi + rest.configuration[:, None])
        rates[:, here] = in_base @ own.vectors @ xi_t
        gaps[:, here] = own.gap_rows @ xi + loaded.gap_constants[:, None]
        pushed = own.force_rows @ xi + own.force_rate_rows @ xi_t + rest.forces[:, None]
        pushed += body.coordinates.direct(stepped) @ on_points[:, here]
        forces[np.array(own.indices, dtype=int)[:, None], here] = pushed
    return moved, rates, gaps, forces


def _intervals(events: list[Event], contact: str, closed: bool, time: np.ndarray) -> list[tuple[float, float]]:
    """[(closed at, opened at), ...] [s] from events; ``closed``: how it starts; instants are left out."""
    changes = [event.time for event in events if event.contact == contact]
    if closed and not (changes and changes[0] <= time[0]):
        changes.insert(0, float(time[0]))
    if len(changes) % 2:
        changes.append(float(time[-1]))
    return [(a, b) for a, b in zip(changes[::2], changes[1::2], strict=True) if b > a]
