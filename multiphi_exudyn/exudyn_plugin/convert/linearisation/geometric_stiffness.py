"""Geometric stiffness: stiffness by constant forces whose lever arms change with the coordinates.

    M a + C^T mu = f,   C a = 0,   K_g = d(C(q)^T mu)/dq - d(f_loads(q))/dq   at constant mu and constant loads

q (n_full,) the coordinates of the system, C (m, n_full) the Jacobian of its constraints, f all forces without them and
M the mass at the current state, mu (m,) [N, N m] the multipliers of the constraints, f_loads the generalised forces of
the loads. A pendulum has no other stiffness. The first term is that of a joint, the second one that of a weight which
acts at another point than a body's reference point. Exudyn's ComputeLinearizedSystem contains neither. Constraints of
coordinates and loads on them have none; a load that turns with its body is taken in its present direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.advancedUtilities import NumericalJacobian

from multiphi_exudyn.exudyn_plugin.convert.items.directions import Directions
from multiphi_exudyn.exudyn_plugin.convert.items.items import is_nonlinear_constraint

__all__ = ["constraint_jacobian", "generalised_forces", "geometric_stiffness", "mass_matrix", "static_solver"]

ROUND_OFF = 1e-12  # of the largest force: a smaller constraint force is round-off
STRAIGHT = ("MassPoint", "Mass1D", "ANCF", "Ground")  # bodies whose points move linearly with the coordinates


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


def geometric_stiffness(mbs: Any) -> np.ndarray:
    """K_g (n_full, n_full) at the initial state, of the constraints and loads that can have one."""
    with static_solver(mbs) as solver:
        stiffness = np.zeros((solver.GetODE2size(), solver.GetODE2size()))
        if any(
            is_nonlinear_constraint(mbs.GetObject(exu.ObjectIndex(i))) for i in range(mbs.systemData.NumberOfObjects())
        ):
            stiffness += _of_constraints(mbs, solver)
        loads = {i: mbs.GetLoad(exu.LoadIndex(i)) for i in range(mbs.systemData.NumberOfLoads())}
        vectors = {i: load["loadVector"] for i, load in loads.items() if _may_turn(mbs, load)}
        return stiffness + _of_loads(mbs, solver, vectors) if vectors else stiffness


def _may_turn(mbs: Any, load: Mapping[str, Any]) -> bool:
    """Whether the generalised force of a load can depend on the coordinates."""
    if load.get("bodyFixed") or not np.any(load.get("loadVector", 0.0)):
        return False
    marker = mbs.GetMarker(exu.MarkerIndex(load["markerNumber"]))
    if "bodyNumber" not in marker or load["loadType"] == "TorqueVector":
        return bool(marker["markerType"] != "NodePosition")
    return not mbs.GetObject(marker["bodyNumber"])["objectType"].startswith(STRAIGHT)


def _of_constraints(mbs: Any, solver: Any) -> np.ndarray:
    mass = mass_matrix(mbs, solver)
    multipliers = _multipliers(mass, constraint_jacobian(mbs, solver), generalised_forces(mbs, solver))
    coordinates = range(len(mass))
    return np.asarray(NumericalJacobian(mbs, lambda: multipliers @ constraint_jacobian(mbs, solver), coordinates))


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


def _multipliers(mass: np.ndarray, jacobian: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """mu (m,); round-off is set to zero, so that it gives no stiffness."""
    multipliers = Directions(jacobian, mass).multipliers(forces)
    sizes = np.max(np.abs(multipliers[:, None] * jacobian), axis=1, initial=0.0)
    return np.where(sizes > ROUND_OFF * np.max(np.abs(forces), initial=0.0), multipliers, 0.0)


def _of_loads(mbs: Any, solver: Any, vectors: Mapping[int, Any]) -> np.ndarray:
    count = range(solver.GetODE2size())
    with_loads = NumericalJacobian(mbs, lambda: generalised_forces(mbs, solver), count)
    with _without(mbs, vectors):
        return np.asarray(NumericalJacobian(mbs, lambda: generalised_forces(mbs, solver), count) - with_loads)


def generalised_forces(mbs: Any, solver: Any) -> np.ndarray:
    """Generalised forces (n_full,) at the current state, without those of constraints."""
    solver.ComputeODE2RHS(mbs)
    return np.array(solver.GetSystemResidual())[: solver.GetODE2size()]


@contextmanager
def _without(mbs: Any, vectors: Mapping[int, Any]) -> Iterator[None]:
    """Set loads to zero; they are restored in any case."""
    try:
        for i, vector in vectors.items():
            mbs.SetLoadParameter(exu.LoadIndex(i), "loadVector", 0 * np.array(vector))
        yield
    finally:
        for i, vector in vectors.items():
            mbs.SetLoadParameter(exu.LoadIndex(i), "loadVector", vector)
