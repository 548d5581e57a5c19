"""Accelerations of an Exudyn system without its contacts, at any coordinates and velocities.

    M(q) a = f(q, v) + force - C(q)^T mu,   C(q) a = -(d C(q)/dt) v + C(q_0) s''
    g(q, t) = g(q_0, t_0),   C(q) v = C(q_0) (v_0 + s' - s'_0)

q, v, a (n_full,) coordinates [m, rad], velocities and accelerations, f [N, N m] all forces but those of constraints,
contacts, limit stops and friction, g (m,) the constraints on positions, C (m, n_full) the Jacobian of all, mu their
multipliers, s (n_full,) the motion that they prescribe. Coordinates that violate the constraints are first moved onto
them by the shift of least norm in M.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.exudyn_plugin.convert.items.directions import Directions
from multiphi_exudyn.exudyn_plugin.convert.items.items import contact_parameters, user_function, value_key
from multiphi_exudyn.exudyn_plugin.convert.linearisation.constraints import on_velocities, residuals
from multiphi_exudyn.exudyn_plugin.convert.linearisation.geometric_stiffness import (
    constraint_jacobian,
    generalised_forces,
    mass_matrix,
    static_solver,
)

__all__ = ["FullSystem", "initial_is_current", "items_of", "sphere_gap", "without_contacts"]

STEP = 1e-4  # of the largest displacement: step of the derivative of C, with an error of 1e-8 and round-off of 1e-12


def items_of(mbs: Any) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Objects and loads of a system, as dictionaries."""
    objects = [mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())]
    return objects, [mbs.GetLoad(exu.LoadIndex(i)) for i in range(mbs.systemData.NumberOfLoads())]


@contextmanager
def initial_is_current(mbs: Any) -> Iterator[None]:
    """Make the current state the initial one, about which Exudyn linearises; all states are restored afterwards."""
    data, kinds = mbs.systemData, exu.ConfigurationType
    stored = {
        kind: (data.GetSystemState(kind), data.GetODE2Coordinates_tt(kind), data.GetTime(kind))
        for kind in (kinds.Initial, kinds.StartOfStep, kinds.Visualization, kinds.Current)
    }
    data.SetSystemState(stored[kinds.Current][0], kinds.Initial)
    try:
        yield
    finally:
        for kind, (state, accelerations, time) in stored.items():
            data.SetSystemState(state, kind)
            data.SetODE2Coordinates_tt(accelerations, kind)
            data.SetTime(time, kind)


def sphere_gap(mbs: Any, index: int) -> tuple[float, np.ndarray]:
    """Gap [m] and unit normal (3,) of a contact of spheres at the current state."""
    item, outputs = exu.ObjectIndex(index), exu.OutputVariableType
    gap, normal = (mbs.GetObjectOutput(item, each) for each in (outputs.DisplacementLocal, outputs.Director1))
    return float(gap), np.array(normal)


@contextmanager
def without_contacts(
    mbs: Any, objects: Sequence[Mapping[str, Any]], loads: Sequence[Mapping[str, Any]]
) -> Iterator[None]:
    """Switch off contacts, limit stops, friction and loads by user functions; they are restored in any case."""
    changes = [
        (exu.ObjectIndex(i), name, off) for i, item in enumerate(objects) for name, off in contact_parameters(item)
    ]
    timed = {exu.LoadIndex(i): load for i, load in enumerate(loads) if user_function(load)}
    try:
        for index, name, off in changes:
            mbs.SetObjectParameter(index, name, off)
        for i, load in timed.items():
            value = load[value_key(load)]
            mbs.SetLoadParameter(i, user_function(load), 0)
            mbs.SetLoadParameter(i, value_key(load), 0 * np.array(value) if np.ndim(value) else 0.0)
        yield
    finally:
        for index, name, _ in changes:
            mbs.SetObjectParameter(index, name, objects[int(index)][name])
        for i, load in timed.items():
            for key in (value_key(load), user_function(load)):
                mbs.SetLoadParameter(i, key, load[key])


@dataclass(frozen=True)
class ConstrainedState:
    """A state that meets the constraints: norm |shift|_M of its correction, and the accelerations (n_full,)."""

    shift: float
    accelerations: np.ndarray


class FullSystem:
    """A system inside the context of ``opened``, without contacts, whose state may be changed."""

    def __init__(self, mbs: Any, solver: Any, displacement: np.ndarray, velocity: np.ndarray) -> None:
        self._mbs, self._solver = mbs, solver
        self._set(displacement, velocity)
        self._start = displacement, velocity
        self._start_jacobian = constraint_jacobian(mbs, solver)
        self._of_velocity = on_velocities(mbs, solver, self._start_jacobian)
        self._constraints = residuals(mbs, solver)

    @classmethod
    @contextmanager
    def opened(cls, mbs: Any, displacement: np.ndarray, velocity: np.ndarray, time: float) -> Iterator[FullSystem]:
        """The system with q_0, v_0, (n_full,), at a time [s]; it is restored in any case."""
        with initial_is_current(mbs), without_contacts(mbs, *items_of(mbs)), static_solver(mbs) as solver:
            mbs.systemData.SetTime(time)
            yield cls(mbs, solver, displacement, velocity)

    def set_time(self, time: float) -> None:
        """Set the time [s] of user functions."""
        self._mbs.systemData.SetTime(time)

    def load(self, index: int, value: np.ndarray) -> None:
        """Set the present value (k,) of a load by a user function."""
        load = exu.LoadIndex(index)
        key = value_key(self._mbs.GetLoad(load))
        self._mbs.SetLoadParameter(load, key, float(value[0]) if key == "load" else value)

    def gap_and_normal(self, index: int) -> tuple[float, np.ndarray]:
        """Gap [m] and unit normal (3,) of a contact of spheres, in the present state."""
        return sphere_gap(self._mbs, index)

    def accelerations_at(
        self,
        displacement: np.ndarray,
        velocity: np.ndarray,
        force: np.ndarray,
        scale: float,
        prescribed: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> ConstrainedState:
        """The system at q, v, (n_full,), under an additional force; scale: largest |q - q_0| of the motion.

        prescribed: s' - s'_0 and s'' (n_full,), None for zero.
        """
        zero = np.zeros(len(displacement))
        speed_change, driven = (zero, zero) if prescribed is None else prescribed
        self._set(displacement, self._start[1])
        directions = Directions(self._jacobian(), self._mass())
        left = np.where(self._of_velocity, 0.0, self._constraints - residuals(self._mbs, self._solver))
        shift = directions.solve(zero, left)
        self._set(displacement + shift, velocity)
        jacobian = self._jacobian()
        directions = Directions(jacobian, self._mass())
        needed = self._start_jacobian @ (self._start[1] + speed_change)
        velocity = velocity + directions.solve(zero, needed - jacobian @ velocity)
        rate = self._jacobian_rate(displacement + shift, velocity, scale)
        self._set(displacement + shift, velocity)
        forces = generalised_forces(self._mbs, self._solver) + force
        accelerations = directions.solve(forces, self._start_jacobian @ driven - rate)
        return ConstrainedState(directions.size(shift), accelerations)

    def _jacobian_rate(self, displacement: np.ndarray, velocity: np.ndarray, scale: float) -> np.ndarray:
        """(d C/dt) v by central differences."""
        fastest = np.max(np.abs(velocity))
        count = len(self._start_jacobian)
        if not fastest * scale > 0 or not count:
            return np.zeros(count)
        step = STEP * scale / fastest
        products = []
        for sign in (1, -1):
            self._set(displacement + sign * step * velocity, velocity)
            products.append(self._jacobian() @ velocity)
        return (products[0] - products[1]) / (2 * step)

    def _set(self, displacement: np.ndarray, velocity: np.ndarray) -> None:
        self._mbs.systemData.SetODE2Coordinates(displacement)
        self._mbs.systemData.SetODE2Coordinates_t(velocity)

    def _jacobian(self) -> np.ndarray:
        return constraint_jacobian(self._mbs, self._solver)

    def _mass(self) -> np.ndarray:
        return mass_matrix(self._mbs, self._solver)
