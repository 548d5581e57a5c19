"""Reduction of an Exudyn system: its linearisation at the current state, its contacts and stops, as a model.

    q = q_0 + S z,   M z'' + C z' + K z = p + (contact forces),   p = S^T f(q_0, v_0) + C S^T v_0,   z'(0) = S^T v_0

q_0, v_0 are the current coordinates and velocities, f [N, N m] the forces there without contacts, limit stops,
friction and loads by user functions, S the directions the constraints leave free. Points are displacements from q_0. p
is a constant load: a state out of balance starts to move as the system does. K holds what constraint forces and weights
give (geometric_stiffness.py). A LoadCoordinate by a function of time is a FunctionLoad, t = 0 being the
system's current time. What is no part of the model is in ``left_out``, with the reason.

Exudyn's contact dampers pull at separation; those of the model do not (contact.py).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.contact import UnilateralContact
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.items import (
    Item,
    has_contact,
    has_stops,
    left_out_functions,
    left_out_objects,
    load_item,
    rough_parameters,
    taken_objects,
    user_function,
    value_key,
)
from multiphi_exudyn.exudyn_plugin.linearize import (
    LinearizedStructure,
    check_system,
    forces,
    initial_is_current,
    projected_matrices,
)
from multiphi_exudyn.exudyn_plugin.point_rows import coordinate_row, default_points, given_points
from multiphi_exudyn.loads import ConstantLoad, FunctionLoad, Load
from multiphi_exudyn.mode_choice import Tolerance, UpTo
from multiphi_exudyn.model import MultiPhiModel
from multiphi_exudyn.structure import Matrix, ModalDamping, RayleighDamping

__all__ = ["Item", "Reduction", "reduce"]

HELD = 1e-9  # of a row's largest entry before projection: a contact that moves less is held by constraints


@dataclass(frozen=True)
class Reduction:
    """What ``reduce`` made of a system.

    model: structure, contacts, modes. velocity: z'(0), (n,); the displacement z(0) is zero. loads: p, none if zero,
    and those by functions of time.
    taken: every item of the model. left_out: what is no part of it, with the reason.
    """

    model: MultiPhiModel
    velocity: np.ndarray
    loads: tuple[Load, ...]
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
    now = mbs.systemData.GetTime()  # [s]; the solvers below set it to zero
    with initial_is_current(mbs):
        gaps = {i: _distance(mbs, i, item) for i, item in enumerate(objects) if has_contact(item)}
        with _smooth(mbs, objects, loads):
            mass, stiffness, dampers, basis = projected_matrices(mbs)
            velocity = basis.T @ mbs.systemData.GetODE2Coordinates_t()
            static = basis.T @ forces(mbs) + dampers @ velocity
        rows = default_points(mbs, basis) if points is None else given_points(mbs, points, basis)
        contacts = [c for i in gaps for c in _contacts(mbs, i, objects[i], gaps[i], basis)]
        varying = {i: _varying(mbs, load, now, basis) for i, load in enumerate(loads) if user_function(load)}
    own = dampers if np.any(dampers) else None
    given = own if damping is None else damping
    structure = LinearizedStructure(mass, stiffness, given, rows, coordinates=basis)
    moving = [c for c in contacts if np.any(structure.row(c.direction))]
    names = {c.name for c in moving}
    return Reduction(
        MultiPhiModel(structure, moving, _modes(modes, structure.n - len(moving))),
        velocity,
        (*([ConstantLoad(static, 1.0)] if np.any(static) else []), *_taken_of(varying).values()),
        (*taken_objects(objects, names), *_taken_loads(loads, _taken_of(varying))),
        (*left_out_objects(objects, names), *_left_out_loads(loads, varying), *left_out_functions(mbs)),
    )


def _varying(mbs: Any, load: Mapping[str, Any], start: float, basis: np.ndarray) -> FunctionLoad | str:
    """A load by a user function as a function of time, or why it is none."""
    marker = exu.MarkerIndex(load["markerNumber"])
    if load["loadType"] != "Coordinate" or mbs.GetMarker(marker)["markerType"] != "NodeCoordinate":
        return "its user function gives no force on one coordinate"
    value, held = load["load"], load[user_function(load)]
    if held["type"] != "Python":
        return f"its user function is of type {held['type']}, need Python"
    function = held["function"]

    def force(t: float) -> float:
        return float(function(_NO_SYSTEM, start + float(t), value))

    try:
        force(0.0)
    except Exception as error:  # whatever the user's function raises
        return f"its user function is none of time alone ({' '.join(str(error).split())})"
    return FunctionLoad(coordinate_row(mbs, marker) @ basis, force)


class _NoSystem:
    """What a load's user function gets instead of the system, which is not there in the model's run."""

    def __getattr__(self, name: str) -> Any:
        raise MultiPhiValueError(f"it reads mbs.{name}")


_NO_SYSTEM = _NoSystem()


def _taken_of(varying: Mapping[int, FunctionLoad | str]) -> dict[int, FunctionLoad]:
    return {i: load for i, load in varying.items() if isinstance(load, FunctionLoad)}


def _taken_loads(loads: list[dict[str, Any]], functions: Collection[int]) -> Iterator[Item]:
    for i, load in enumerate(loads):
        if i in functions:
            yield load_item(i, load, "load by its function of time")
        elif not user_function(load):
            held = " in its present direction" if load.get("bodyFixed", False) else ""
            yield load_item(i, load, f"constant load{held}")


def _left_out_loads(
    loads: list[dict[str, Any]], varying: Mapping[int, FunctionLoad | str]
) -> Iterator[tuple[Item, str]]:
    for i, reason in varying.items():
        if isinstance(reason, str):
            yield load_item(i, loads[i]), reason


def _modes(modes: int | str | UpTo | Tolerance, most: int) -> int | str | UpTo | Tolerance:
    return "all" if isinstance(modes, int) and modes > most else modes


def _distance(mbs: Any, index: int, item: Mapping[str, Any]) -> float:
    """Gap [m] of a contact, or what the limits of a limit stop are compared with."""
    outputs = exu.OutputVariableType
    variable = outputs.Displacement if has_stops(item) else outputs.Distance
    return float(mbs.GetObjectOutput(exu.ObjectIndex(index), variable))


def _contacts(
    mbs: Any, index: int, item: Mapping[str, Any], distance: float, basis: np.ndarray
) -> Iterator[UnilateralContact]:
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
    if not has_stops(item):
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
    changes = [
        (exu.ObjectIndex(i), name, off) for i, item in enumerate(objects) for name, off in rough_parameters(item)
    ]
    timed = [exu.LoadIndex(i) for i, load in enumerate(loads) if user_function(load)]
    try:
        for index, name, off in changes:
            mbs.SetObjectParameter(index, name, off)
        for load in timed:
            key = user_function(loads[int(load)])
            value = loads[int(load)][value_key(loads[int(load)])]
            mbs.SetLoadParameter(load, key, 0)
            mbs.SetLoadParameter(load, value_key(loads[int(load)]), 0 * np.array(value) if np.ndim(value) else 0.0)
        yield
    finally:
        for index, name, _ in changes:
            mbs.SetObjectParameter(index, name, objects[int(index)][name])
        for load in timed:
            for key in (value_key(loads[int(load)]), user_function(loads[int(load)])):
                mbs.SetLoadParameter(load, key, loads[int(load)][key])
