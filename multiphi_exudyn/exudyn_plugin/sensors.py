"""Sensors of a Multi-Phi body, and histories that are computed from them after a run (eq. 38.4).

    x_p(t) = p.(Phi_l eta(t) + x_inf,l),   g_i(t) = h_i.x + gap_i,   lambda_i(t) from eta, eta', and L f

Exudyn's own node sensors record eta, its derivatives and the level with its stick positions, at hardly any cost during
a run. Friction forces T and the positions of friction patches follow in the same way. L f are reactions of closed
contacts to forces f on points (interface.py).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.itemInterface import SensorNode

from multiphi_exudyn.display import Shown, kinds, names
from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.solver import bodies_of
from multiphi_exudyn.mechanics.arguments import no_text
from multiphi_exudyn.mechanics.element import links_of
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.segments import force_row, patch_row, pressing_row
from multiphi_exudyn.time.state import Event

__all__ = ["BodyHistories", "add_sensors", "body_histories", "reconstruct"]

RECORDED = {
    "sCoordinates": exu.OutputVariableType.Coordinates,
    "sCoordinates_t": exu.OutputVariableType.Coordinates_t,
    "sCoordinates_tt": exu.OutputVariableType.Coordinates_tt,
}


def reconstruct(
    body: MultiPhiBody,
    rows: np.ndarray,
    data: np.ndarray,
    time: np.ndarray,
    stored: np.ndarray,
    on_points: np.ndarray,
) -> tuple[np.ndarray, ...]:
    """Displacements and velocities of points, gaps, lambda, T and patch positions of elements, each (.., k).

    rows (p, n): of the points. data (k, width): level data. stored (k, 3 s): q, q', q''. on_points: f (m, k) [N].
    """
    layout, elements = body.coordinates.layout, body.model.contacts
    k, all_states = len(stored), layout.states(data)
    displacements, velocities = np.zeros((2, len(rows), k))
    gaps, forces, friction_forces, patches = np.zeros((4, len(elements), k))
    in_base = rows @ body.model.base.modes.shapes
    for states in np.unique(all_states, axis=0):
        samples = np.flatnonzero(np.all(all_states == states, axis=1))
        discretised, held = body.discretised_level(states.tolist()), layout.held(data[samples]).T
        r, physical = discretised.modes, discretised.to_physical @ stored[samples].T
        eta, eta_t = physical[:r], physical[discretised.size : discretised.size + r]
        loaded, xi, xi_t = body.own_loads.level_coordinates(discretised, eta, eta_t, held, time[samples])
        level, asymptotic = loaded.level, loaded.asymptotic
        displacements[:, samples] = in_base @ (level.vectors @ xi + asymptotic.configuration[:, None])
        velocities[:, samples] = in_base @ level.vectors @ xi_t
        gaps[:, samples] = (level.gap_rows @ xi + loaded.gap_constants[:, None])[: len(elements)]
        state = np.vstack([xi, xi_t, np.ones(len(samples))])
        direct_reactions = body.coordinates.direct_reactions(discretised) @ on_points[:, samples]
        for i in range(len(elements)):
            forces[i, samples] = pressing_row(i, loaded) @ state + _direct_share(
                loaded, i, direct_reactions, held=False
            )
        for i in body.model.rubbing:
            friction_forces[i, samples] = force_row(i, loaded) @ state - _direct_share(
                loaded, i, direct_reactions, held=True
            )
            patches[i, samples] = patch_row(i, loaded) @ state
    return displacements, velocities, gaps, forces, friction_forces, patches


def _direct_share(loaded: LoadedLevel, element: int, direct_reactions: np.ndarray, held: bool) -> np.ndarray:
    """Sum of the reactions L f (k, ..) of the links of an element with (``held``) or without stick position."""
    base, indices = loaded.level.base, loaded.level.indices
    signs = {k: 1 for k in base.link_indices[element] if base.links[k].held} if held else base.pressing(element)
    shares = [sign * direct_reactions[indices.index(link)] for link, sign in signs.items() if link in indices]
    return np.asarray(sum(shares, np.zeros(direct_reactions.shape[1])))


@dataclass(frozen=True, repr=False)
class BodyHistories(Shown):
    """Histories from a body's sensors: k samples at ``sensors.writePeriod``; the list of events has exact times.

    Returned by ``body_histories``.

    Attributes
    ----------
    time : array (k,)
        [s].
    points : mapping of str to array (k,)
        Point to displacement [m].
    velocities : mapping of str to array (k,)
        Point to velocity [m/s].
    gaps : mapping of str to array (k,)
        Contact to gap [m].
    contact_force : mapping of str to array (k,)
        Contact to lambda [N].
    contact_intervals : mapping of str to list of (float, float)
        Contact to (closed at, opened at) [s].
    closed : mapping of str to array (k,)
        Contact to whether it is closed.
    friction_force : mapping of str to array (k,)
        Friction, or contact that has friction, to T [N].
    slip : mapping of str to array (k,)
        Friction, or contact that has friction, to the slip distance [m].
    stick_intervals : mapping of str to array (m, 2)
        Friction, or contact that has friction, to (start, end) of each interval of stick [s].
    events : tuple of Event
        In order of time, with times inside steps.
    warnings : tuple of str
        Warnings about the accuracy of the run.
    """

    time: np.ndarray
    points: Mapping[str, np.ndarray]
    velocities: Mapping[str, np.ndarray]
    gaps: Mapping[str, np.ndarray]
    contact_force: Mapping[str, np.ndarray]
    contact_intervals: Mapping[str, list[tuple[float, float]]]
    closed: Mapping[str, np.ndarray]
    friction_force: Mapping[str, np.ndarray]
    slip: Mapping[str, np.ndarray]
    stick_intervals: Mapping[str, np.ndarray]
    events: tuple[Event, ...]
    warnings: tuple[str, ...]

    def _facts(self) -> Iterator[tuple[str, str]]:
        span = f", {self.time[0]:.4g} to {self.time[-1]:.4g} s" if len(self.time) else ""
        yield "samples", f"{len(self.time)}{span}"
        yield "points", names(list(self.points))
        yield "contacts", names(list(self.gaps))
        yield "events", str(len(self.events))
        yield "warnings", kinds(self.warnings)


def add_sensors(mbs: Any, body: MultiPhiBody) -> dict[str, Any]:
    """Add sensors of the node's coordinates and of the level, which record in memory; return their indices by key."""
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
    """Histories of a body from its sensors of the last run.

        x_p(t) = p.(Phi_l eta(t) + x_inf,l),   g_i(t) = h_i.x + gap_i

    Parameters
    ----------
    mbs : exudyn.MainSystem
        After SolveDynamic.
    items : mapping
        As ``CreateMultiPhiBody`` returned it.
    points : iterable of str, default None
        Names of points whose histories are returned, None for all points of the structure.

    Returns
    -------
    BodyHistories
        Displacements, velocities, gaps, forces, events and warnings.

    Raises
    ------
    MultiPhiValueError
        For items of no body of this system, a system that has not run, and points that do not exist.

    Examples
    --------
    >>> import numpy as np
    >>> import exudyn as exu
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> given = {"displacement": pulled, "matchedStepSize": 1e-3}
    >>> items = CreateMultiPhiBody(mbs, model, name="chain", **given)
    >>> mbs.Assemble()
    >>> settings = exu.SimulationSettings()
    >>> settings.solution.file.write = False
    >>> settings.timeIntegration.endTime = 0.1
    >>> settings.timeIntegration.numberOfSteps = 100
    >>> solver = exu.DynamicSolverType.TrapezoidalIndex2
    >>> done = mbs.SolveDynamic(settings, solverType=solver)
    >>> histories = body_histories(mbs, items)
    >>> print(1e3 * histories.points["tip"][:1].round(6))  # mm
    [7.5]
    """
    no_text("points", points)
    body = _body_of(mbs, items)
    on_points = [mbs.GetSensorStoredData(sensor)[:, 1:] for sensor in items.get("sInterface", {}).values()]
    table = {key: mbs.GetSensorStoredData(items[key]) for key in (*RECORDED, "sLevel") if key in items}
    time = table["sCoordinates"][:, 0]
    if len(time) == 0:
        raise MultiPhiValueError("sensors: got no stored data, need a run of mbs.SolveDynamic first")
    bodies_of(mbs).check_called(float(time[-1]))
    data = table["sLevel"][:, 1:] if "sLevel" in table else np.zeros((len(time), 0))
    names = body.model.structure.points if points is None else list(points)
    rows = np.array([body.model.structure.row(name) for name in names]).reshape(-1, body.model.structure.n)
    stored = np.hstack([table[key][:, 1:] for key in RECORDED])
    values = reconstruct(body, rows, data, time, stored, np.hstack([data[:, :0], *on_points]).T)
    displacements, velocities, gaps, forces, friction_forces, patch_positions = values
    model = body.model
    contacts = {c.name: i for i, c in enumerate(model.contacts) if not c.held}
    frictions = {model.contacts[i].name: i for i in model.rubbing}
    return BodyHistories(
        time=time,
        points=dict(zip(names, displacements, strict=True)),
        velocities=dict(zip(names, velocities, strict=True)),
        gaps={name: gaps[i] for name, i in contacts.items()},
        contact_force={name: forces[i] for name, i in contacts.items()},
        contact_intervals={name: _intervals(body, i, data, time, held=False) for name, i in contacts.items()},
        closed={name: _is_acting(body, i, data, held=False) for name, i in contacts.items()},
        friction_force={name: friction_forces[i] for name, i in frictions.items()},
        slip={name: patch_positions[i] - patch_positions[i, 0] for name, i in frictions.items()},
        stick_intervals={
            name: np.array(_intervals(body, i, data, time, held=True)).reshape(-1, 2) for name, i in frictions.items()
        },
        events=tuple(body.events),
        warnings=body.warnings,
    )


def _body_of(mbs: Any, items: Mapping[str, Any]) -> MultiPhiBody:
    if not isinstance(items, Mapping):
        raise MultiPhiTypeError(f"items: got {items!r}, need the dict that CreateMultiPhiBody returned")
    for body in bodies_of(mbs).values():
        if isinstance(body, MultiPhiBody) and items.get("nGenericODE2") == body.items["nGenericODE2"]:
            return body
    raise MultiPhiValueError(
        "items: got a dict of no Multi-Phi body in this system, need the one that CreateMultiPhiBody returned"
    )


def _acting_states(body: MultiPhiBody, element: int, held: bool) -> np.ndarray:
    """In which of an element's states (n,) a link with (``held``) or without stick position acts."""
    contact = body.model.contacts[element]
    links = links_of([contact])
    return np.array([any(links[k].held == held for k in state.holds) for state in contact.states])


def _is_acting(body: MultiPhiBody, element: int, data: np.ndarray, held: bool) -> np.ndarray:
    """At which samples (k,) a link of an element with (``held``) or without stick position acts."""
    return np.asarray(_acting_states(body, element, held)[body.coordinates.layout.states(data)[:, element]])


def _intervals(
    body: MultiPhiBody, element: int, data: np.ndarray, time: np.ndarray, held: bool
) -> list[tuple[float, float]]:
    """Intervals [(start, end), ...] [s] in which such a link acts, from the events; those of no length are left out."""
    contact, end = body.model.contacts[element], float(time[-1])
    acts_in = dict(
        zip((state.name for state in contact.states), _acting_states(body, element, held).tolist(), strict=True)
    )
    changes = [(e.time, acts_in[e.state]) for e in body.events if e.contact == contact.name]
    changes = [(float(time[0]), bool(_is_acting(body, element, data, held)[0])), *changes, (end, False)]
    intervals = list[tuple[float, float]]()
    for (start, acts), (until, _) in itertools.pairwise(changes):
        if acts and until > start:
            joins = bool(intervals) and intervals[-1][1] == start
            intervals[-1:] = [(intervals[-1][0], until)] if joins else [*intervals[-1:], (start, until)]
    return intervals
