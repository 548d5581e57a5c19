"""An Exudyn system seen through its static solver: forces, mass, constraints, and the directions they leave free.

    M a = f - C^T mu,   C a = prescribed
    g(q, t) = 0,   C = dg/dq          h(q, v, t) = 0,   C = dh/dv

q, v, a (n,) coordinates [m, rad], velocities and accelerations, f [N, N m] all forces but those of constraints, g or h
(m,) the residuals of constraints on positions or on velocities (velocityLevel, rolling without slip), C (m, n) their
Jacobian, mu (m,) their multipliers, M (n, n) positive definite in the directions that the constraints leave free.
Constraints may be redundant.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np
import scipy.linalg

from multiphi_exudyn.exudyn_plugin.items import contact_parameters, user_function, value_key

__all__ = [
    "Change",
    "Directions",
    "changed",
    "constraint_jacobian",
    "coordinate_name",
    "generalised_forces",
    "initial_is_current",
    "items_of",
    "largest_coordinate_name",
    "mass_matrix",
    "object_name",
    "on_velocities",
    "residuals",
    "sphere_gap",
    "static_solver",
    "without_contacts",
]

REDUNDANT = 1e-9  # of a constraint's row: a smaller part that is independent of other constraints is round-off

Change = tuple[Any, str, Any, Any]  # of a parameter: index of its item, key, value, present value


class Directions:
    """A QR decomposition of C^T, its rows at unit length.

    mass: M (n, n). free (n, k): orthonormal basis of the directions that the constraints leave free. Raises
    numpy.linalg.LinAlgError for matrices that are not finite, and solves for a mass that is not positive definite.
    """

    def __init__(self, jacobian: np.ndarray, mass: np.ndarray) -> None:
        if not (np.all(np.isfinite(jacobian)) and np.all(np.isfinite(mass))):
            raise np.linalg.LinAlgError("got a Jacobian or a mass that is not finite")
        self._count = len(jacobian)
        moving = np.any(jacobian, axis=1)  # an inactive constraint has no row
        self._independent, self.mass = np.flatnonzero(moving), mass
        fixed, free = np.zeros((len(mass), 0)), np.eye(len(mass))
        self._triangle = np.zeros((0, 0))
        if len(self._independent):
            rows = jacobian[self._independent] / np.linalg.norm(jacobian[self._independent], axis=1)[:, None]
            q, r, order = scipy.linalg.qr(rows.T, pivoting=True)
            rank = int(np.sum(np.abs(np.diag(r)) > REDUNDANT))
            self._lengths = np.linalg.norm(jacobian[self._independent], axis=1)[order[:rank]]
            self._independent, self._triangle = self._independent[order[:rank]], r[:rank, :rank]
            fixed, free = q[:, :rank], q[:, rank:]
        self._fixed, self.free = fixed, free

    @functools.cached_property
    def _factor(self) -> tuple[np.ndarray, bool]:
        """Cholesky factor of the mass in the free directions."""
        factor: tuple[np.ndarray, bool] = scipy.linalg.cho_factor(self.free.T @ self.mass @ self.free)
        return factor

    def size(self, vector: np.ndarray) -> float:
        """|vector|_M."""
        return float(np.sqrt(max(vector @ self.mass @ vector, 0.0)))

    def solve(self, force: np.ndarray, prescribed: np.ndarray) -> np.ndarray:
        """Solution a (n,) of M a = force - C^T mu, C a = prescribed."""
        particular = np.zeros(len(force))
        if len(self._independent):
            values = prescribed[self._independent] / self._lengths
            particular = self._fixed @ scipy.linalg.solve_triangular(self._triangle, values, trans="T")
        momenta = self.free.T @ (force - self.mass @ particular)
        if not np.all(np.isfinite(momenta)):
            raise np.linalg.LinAlgError("got forces that are not finite")
        return np.asarray(particular + self.free @ scipy.linalg.cho_solve(self._factor, momenta))

    def multipliers(self, force: np.ndarray) -> np.ndarray:
        """mu (m,) for prescribed = 0; redundant constraints have mu = 0."""
        mu = np.zeros(self._count)
        if len(self._independent):
            reaction = force - self.mass @ self.solve(force, mu)
            values = scipy.linalg.solve_triangular(self._triangle, self._fixed.T @ reaction)
            mu[self._independent] = values / self._lengths
        return mu


def residuals(mbs: Any, solver: Any) -> np.ndarray:
    """g or h (m,) at the current state and time."""
    solver.ComputeAlgebraicEquations(mbs, False)
    return np.array(solver.GetSystemResidual())[solver.GetODE2size() :]


def on_velocities(mbs: Any, solver: Any, jacobian: np.ndarray) -> np.ndarray:
    """Whether each constraint is one on velocities, (m,) bool: whether its residual depends on them."""
    data = mbs.systemData
    velocity = data.GetODE2Coordinates_t()
    change = np.random.default_rng(0).uniform(1.0, 2.0, len(velocity))  # across no row but by chance
    before = residuals(mbs, solver)
    data.SetODE2Coordinates_t(velocity + change)
    after = residuals(mbs, solver)
    data.SetODE2Coordinates_t(velocity)
    return np.asarray(np.abs(after - before) > np.abs(jacobian @ change) / 2)


@contextmanager
def static_solver(mbs: Any) -> Iterator[Any]:
    """A static solver at the initial state, for its functions that evaluate forces, masses and Jacobians."""
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.active = False
    settings.staticSolver.verboseMode = 0
    solver = exu.MainSolverStatic()
    solver.InitializeSolver(mbs, settings)
    try:
        yield solver
    finally:
        solver.FinalizeSolver(mbs, settings)


def mass_matrix(mbs: Any, solver: Any) -> np.ndarray:
    """M (n_full, n_full) at the current state."""
    count = solver.GetODE2size()
    solver.ComputeMassMatrix(mbs)
    return np.array(solver.GetSystemMassMatrix())[:count, :count]


def constraint_jacobian(mbs: Any, solver: Any) -> np.ndarray:
    """C (m, n_full) at the current state, from C^T, which Exudyn also fills for constraints on velocities."""
    count, size = solver.GetODE2size(), solver.GetODE2size() + solver.GetAEsize()
    solver.SetSystemJacobian(np.zeros((size, size)))
    solver.ComputeJacobianAE(mbs)
    return np.array(solver.GetSystemJacobian())[:count, count:].T


def generalised_forces(mbs: Any, solver: Any) -> np.ndarray:
    """Generalised forces (n_full,) at the current state, without those of constraints."""
    solver.ComputeODE2RHS(mbs)
    return np.array(solver.GetSystemResidual())[: solver.GetODE2size()]


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
def changed(mbs: Any, changes: Sequence[Change]) -> Iterator[None]:
    """Change parameters of objects and loads; they are restored in any case."""
    try:
        for index, key, value, _ in changes:
            _set_parameter(mbs, index, key, value)
        yield
    finally:
        for index, key, _, present in changes:
            _set_parameter(mbs, index, key, present)


def _set_parameter(mbs: Any, index: Any, key: str, value: Any) -> None:
    setter = mbs.SetLoadParameter if isinstance(index, exu.LoadIndex) else mbs.SetObjectParameter
    setter(index, key, value)


def without_contacts(
    mbs: Any, objects: Mapping[int, Mapping[str, Any]], loads: Sequence[Mapping[str, Any]] = ()
) -> Any:
    """Switch off contacts, limit stops, friction and loads by user functions; objects: by index."""
    changes: list[Change] = [
        (exu.ObjectIndex(i), key, off, item[key])
        for i, item in objects.items()
        for key, off in contact_parameters(item)
    ]
    for i, load in enumerate(loads):
        if user := user_function(load):
            key = value_key(load)
            zero = 0 * np.array(load[key]) if np.ndim(load[key]) else 0.0
            changes += [(exu.LoadIndex(i), key, zero, load[key]), (exu.LoadIndex(i), user, 0, load[user])]
    return changed(mbs, changes)


def object_name(item: Any) -> str:
    return f"Object{item['objectType']} {item['name']!r}"


def largest_coordinate_name(mbs: Any, vector: np.ndarray) -> str:
    return coordinate_name(mbs, int(np.argmax(np.abs(vector))))


def coordinate_name(mbs: Any, index: int) -> str:
    """Name of an ODE2 coordinate of the system: "coordinate 1 of node 'n' (ObjectMassPoint2D 'bob')"."""
    for i in range(mbs.systemData.NumberOfNodes()):
        node = mbs.GetNode(exu.NodeIndex(i))
        if not {"initialVelocities", "initialCoordinates_t"} & node.keys():  # no node with ODE2 coordinates
            continue
        first, count = mbs.GetNodeODE2Index(exu.NodeIndex(i)), len(node["initialCoordinates"])
        if first <= index < first + count:
            bodies = ", ".join(_bodies(mbs, i))
            return f"coordinate {index - first} of node {node['name']!r}" + (f" ({bodies})" if bodies else "")
    return f"coordinate {index} of the system"


def _bodies(mbs: Any, node: int) -> list[str]:
    items = [mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())]
    bodies = [item for item in items if node in [int(n) for n in item.get("nodeNumbers", [item.get("nodeNumber", -1)])]]
    return [object_name(item) for item in bodies]
