"""Reduction of an Exudyn system: its linearisation at the current state, its contacts and stops, as a model.

    q = q_0 + S z,   M z'' + C z' + K z = p + (contact forces),   p = S^T f(q_0, v_0) + C S^T v_0,   z'(0) = S^T v_0

q_0, v_0 are the current coordinates and velocities, f [N, N m] the forces there without contacts, limit stops,
friction and loads by user functions, S the directions the constraints leave free. p is a constant load: a state out of
balance starts to move as the system does. What is no part of the model is in ``left_out``, with the reason.

Exudyn's contact dampers pull at separation; those of the model do not (contact.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.exudyn_plugin.linearize import (
    LinearizedStructure,
    check_system,
    coordinate_row,
    default_points,
    forces,
    given_points,
    initial_is_current,
    projected_matrices,
)
from multiphi_exudyn.loads import ConstantLoad
from multiphi_exudyn.model import MultiPhiModel, Tolerance, UpTo
from multiphi_exudyn.structure import Matrix, ModalDamping, RayleighDamping

__all__ = ["Item", "Reduction", "reduce"]

HELD = 1e-9  # of a row's largest entry before projection: a contact that moves less is held by constraints

_EXT = "ConnectorCoordinateSpringDamperExt"
_FRICTION = ("dynamicFrictionForce", "staticFrictionOffsetForce", "viscousFrictionFactor", "stickingStiffness")
_LINEAR = {"Mass1D", "RotationalMass1D", "MassPoint", "MassPoint2D", "ConnectorCoordinateSpringDamper", _EXT}
_LINEAR |= {"GenericODE2"}
_CONSTRAINTS = ("Joint", "ConnectorDistance")
_COORDINATE_CONSTRAINTS = {"ConnectorCoordinate", "ConnectorCoordinateVector"}


@dataclass(frozen=True)
class Item:
    """One item of the system: its name, index among objects or loads, type, and what it became."""

    name: str
    index: int
    type: str
    became: str = ""


@dataclass(frozen=True)
class Reduction:
    """What ``reduce`` made of a system.

    model: structure, contacts, modes. velocity: z'(0), (n,); the displacement z(0) is zero. loads: p, none if zero.
    taken: every item of the model. left_out: what is no part of it, with the reason.
    """

    model: MultiPhiModel
    velocity: np.ndarray
    loads: tuple[ConstantLoad, ...]
    taken: tuple[Item, ...]
    left_out: tuple[tuple[Item, str], ...]

    @property
    def structure(self) -> LinearizedStructure:
        """M, C, K, the points and S."""
        structure = self.model.structure
        assert isinstance(structure, LinearizedStructure)
        return structure

    @property
    def report(self) -> str:
        """What was taken and what was left out, one item a line."""
        size = f"{self.structure.n} degrees of freedom, {len(self.model.contacts)} contacts, modes: {self.model.modes}"
        taken = [f"  {item.type} {item.name!r}: {item.became}" for item in self.taken]
        left = [f"  {item.type} {item.name!r}: {reason}" for item, reason in self.left_out]
        return "\n".join([size, "taken", *taken, "left out", *(left or ["  nothing"])])


def reduce(
    mbs: Any,
    modes: int | str | UpTo | Tolerance = 12,
    points: Mapping[str, Any] | None = None,
    damping: Matrix | ModalDamping | RayleighDamping | None = None,
) -> Reduction:
    """Reduce an assembled Exudyn system at its current state; the system is left as it was.

    modes: of every level, as in MultiPhiModel; a number the system does not have means all of them.
    points, damping: as in ``linear_structure_from``. Contacts are ObjectContactCoordinate and the limit stops of
    ObjectConnectorCoordinateSpringDamperExt, with names ``<object>.upper`` and ``<object>.lower``.

    Raises MultiPhiValueError for a system without a symmetric linearisation of second order.
    """
    check_system(mbs)
    objects = [mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())]
    loads = [mbs.GetLoad(exu.LoadIndex(i)) for i in range(mbs.systemData.NumberOfLoads())]
    with initial_is_current(mbs):
        gaps = {i: _distance(mbs, i, item) for i, item in enumerate(objects) if _has_contact(item)}
        with _smooth(mbs, objects, loads):
            mass, stiffness, dampers, basis = projected_matrices(mbs)
            velocity = basis.T @ mbs.systemData.GetODE2Coordinates_t()
            static = basis.T @ forces(mbs) + dampers @ velocity
        rows = default_points(mbs, basis) if points is None else given_points(mbs, points, basis)
        contacts = [c for i in gaps for c in _contacts(mbs, i, objects[i], gaps[i], basis)]
    own = dampers if np.any(dampers) else None
    given = own if damping is None else damping
    structure = LinearizedStructure(mass, stiffness, given, rows, coordinates=basis)
    moving = [c for c in contacts if np.any(structure.row(c.direction))]
    names = {c.name for c in moving}
    return Reduction(
        MultiPhiModel(structure, moving, _modes(modes, structure.n - len(moving))),
        velocity,
        (ConstantLoad(static, 1.0),) if np.any(static) else (),
        tuple(_taken(objects, loads, names)),
        tuple(_left_out(objects, loads, names)),
    )


def _modes(modes: int | str | UpTo | Tolerance, most: int) -> int | str | UpTo | Tolerance:
    return "all" if isinstance(modes, int) and modes > most else modes


def _is_active(item: Mapping[str, Any]) -> bool:
    return bool(item.get("activeConnector", True))


def _refusal(item: Mapping[str, Any]) -> str:
    """Why an active contact object is no unilateral spring; empty if it is one."""
    if item["objectType"] != "ContactCoordinate":
        return "its gap is no linear function of coordinates"
    if item["impactModel"] != 0:
        return f"impact model {item['impactModel']}, need 0"
    if item["contactStiffnessExponent"] != 1.0:
        return f"stiffness exponent {item['contactStiffnessExponent']:g}, need 1"
    if not item["contactStiffness"] > 0:
        return f"contact stiffness {item['contactStiffness']:g}, need a value > 0"
    return ""


def _is_contact_object(item: Mapping[str, Any]) -> bool:
    return str(item["objectType"]).startswith("Contact")


def _has_stops(item: Mapping[str, Any]) -> bool:
    return item["objectType"] == _EXT and item["useLimitStops"] and item["limitStopsStiffness"] > 0


def _has_contact(item: Mapping[str, Any]) -> bool:
    return _is_active(item) and (_has_stops(item) or (_is_contact_object(item) and not _refusal(item)))


def _has_friction(item: Mapping[str, Any]) -> bool:
    return item["objectType"] == _EXT and any(float(item[name]) for name in _FRICTION)


def _distance(mbs: Any, index: int, item: Mapping[str, Any]) -> float:
    """Gap [m] of a contact, or what the limits of a limit stop are compared with."""
    outputs = exu.OutputVariableType
    variable = outputs.Displacement if _has_stops(item) else outputs.Distance
    return float(mbs.GetObjectOutput(exu.ObjectIndex(index), variable))


def _contacts(
    mbs: Any, index: int, item: Mapping[str, Any], distance: float, basis: np.ndarray
) -> Iterator[UnilateralContact]:
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    if not _has_stops(item):
        law = float(item["contactStiffness"]), float(item["contactDamping"])
        yield UnilateralContact(item["name"], _projected(second - first, basis), distance, *law)
        return
    row = _projected(item["factor1"] * second - item["factor0"] * first, basis)
    law = float(item["limitStopsStiffness"]), float(item["limitStopsDamping"])
    yield UnilateralContact(f"{item['name']}.upper", -row, item["limitStopsUpper"] - distance, *law)
    yield UnilateralContact(f"{item['name']}.lower", row, distance - item["limitStopsLower"], *law)


def _projected(row: np.ndarray, basis: np.ndarray) -> np.ndarray:
    """A row in z; zero if constraints hold it."""
    projected: np.ndarray = row @ basis
    return projected if np.max(np.abs(projected)) > HELD * np.max(np.abs(row), initial=1.0) else 0 * projected


@contextmanager
def _smooth(mbs: Any, objects: list[dict[str, Any]], loads: list[dict[str, Any]]) -> Iterator[None]:
    """Switch off contacts, limit stops, friction and loads by user functions; on again whatever happens."""
    changes = [(exu.ObjectIndex(i), name, off) for i, item in enumerate(objects) for name, off in _rough(item)]
    timed = [exu.LoadIndex(i) for i, load in enumerate(loads) if _user_function(load)]
    try:
        for index, name, off in changes:
            mbs.SetObjectParameter(index, name, off)
        for load in timed:
            key = _user_function(loads[int(load)])
            value = loads[int(load)][_value(loads[int(load)])]
            mbs.SetLoadParameter(load, key, 0)
            mbs.SetLoadParameter(load, _value(loads[int(load)]), 0 * np.array(value) if np.ndim(value) else 0.0)
        yield
    finally:
        for index, name, _ in changes:
            mbs.SetObjectParameter(index, name, objects[int(index)][name])
        for load in timed:
            for key in (_value(loads[int(load)]), _user_function(loads[int(load)])):
                mbs.SetLoadParameter(load, key, loads[int(load)][key])


def _rough(item: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """Parameters that take the contact or friction out of an object, and their values without."""
    if _is_contact_object(item) and _is_active(item):
        return [("activeConnector", False)]
    if item["objectType"] != _EXT:
        return []
    return [("useLimitStops", False), *((name, 0.0) for name in _FRICTION)]


def _user_function(load: Mapping[str, Any]) -> str:
    """Key of a load's user function, empty without one."""
    return next((key for key, value in load.items() if key.endswith("UserFunction") and value), "")


def _value(load: Mapping[str, Any]) -> str:
    return "load" if "load" in load else "loadVector"


def _taken(objects: list[dict[str, Any]], loads: list[dict[str, Any]], contacts: set[str]) -> Iterator[Item]:
    for i, item in enumerate(objects):
        if not _is_active(item) or (_is_contact_object(item) and item["name"] not in contacts):
            continue
        yield Item(item["name"], i, f"Object{item['objectType']}", _became(item, contacts))
    for i, load in enumerate(loads):
        if not _user_function(load):
            yield Item(load["name"], i, f"Load{load['loadType']}", "constant load")


def _became(item: Mapping[str, Any], contacts: set[str]) -> str:
    kind = str(item["objectType"])
    if _is_contact_object(item):
        return f"contact, {item['contactStiffness']:g} N/m{_damper(item['contactDamping'])}"
    if kind == "Ground":
        return "ground"
    if kind.startswith(_CONSTRAINTS) or kind in _COORDINATE_CONSTRAINTS:
        return "constraint, its directions taken out"
    custom = any(key.endswith("UserFunction") and value for key, value in item.items())
    linear = kind in _LINEAR and not custom
    matrices = "its matrices" if linear else "linearised at the current state"
    stops = [name for name in (f"{item['name']}.upper", f"{item['name']}.lower") if name in contacts]
    if not stops or not _has_stops(item):
        return matrices
    return f"{matrices}; contacts {', '.join(stops)}, {item['limitStopsStiffness']:g} N/m" + _damper(
        item["limitStopsDamping"]
    )


def _damper(damping: float) -> str:
    return f" and {damping:g} N s/m, which does not pull" if damping else ""


def _left_out(
    objects: list[dict[str, Any]], loads: list[dict[str, Any]], contacts: set[str]
) -> Iterator[tuple[Item, str]]:
    for i, item in enumerate(objects):
        for reason in _reasons(item, contacts):
            yield Item(item["name"], i, f"Object{item['objectType']}"), reason
    for i, load in enumerate(loads):
        if _user_function(load):
            yield Item(load["name"], i, f"Load{load['loadType']}"), "load by a user function"


def _reasons(item: Mapping[str, Any], contacts: set[str]) -> Iterable[str]:
    if not _is_active(item):
        yield "not active"
    elif _is_contact_object(item) and item["name"] not in contacts:
        yield _refusal(item) or "constraints hold its gap"
    elif _has_friction(item):
        yield "friction"
