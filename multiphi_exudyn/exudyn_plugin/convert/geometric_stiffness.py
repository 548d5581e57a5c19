"""Geometric stiffness: what forces that do not change themselves add where their lever arms do.

    M a + C^T mu = f,   C a = 0,   K_g = d(C(q)^T mu)/dq - d(f_loads(q))/dq   at constant mu and constant loads

q (n_full,) the coordinates of the system, C (m, n_full) the Jacobian of its constraints, f all forces without them and
M the mass at the current state, mu (m,) [N, N m] what the constraints then carry, f_loads the generalised forces of the
loads. A pendulum has no other stiffness; the first term is that of a joint, the second one that of a weight which acts
beside a body's reference point. Exudyn's ComputeLinearizedSystem leaves both out. Constraints of coordinates and loads
on them have none; a load that turns with its body is taken in its present direction.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.advancedUtilities import NumericalJacobian

from multiphi_exudyn.exudyn_plugin.convert.directions import Directions
from multiphi_exudyn.exudyn_plugin.convert.items import is_curved

__all__ = ["constraint_jacobian", "generalised_forces", "geometric_stiffness", "static_solver"]

ROUND_OFF = 1e-12  # of the largest force: what solving for a constraint force of zero leaves of it
STRAIGHT = ("MassPoint", "Mass1D", "ANCF", "Ground")  # bodies whose points move linearly with the coordinates


@contextmanager
def static_solver(mbs: Any) -> Iterator[Any]:
    """A static solver at the initial state, for what it computes without a solution."""
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
    """K_g (n_full, n_full) at the initial state; only what can have one is looked at."""
    with static_solver(mbs) as solver:
        found = np.zeros((solver.GetODE2size(), solver.GetODE2size()))
        if any(is_curved(mbs.GetObject(exu.ObjectIndex(i))) for i in range(mbs.systemData.NumberOfObjects())):
            found += _of_constraints(mbs, solver)
        loads = {i: mbs.GetLoad(exu.LoadIndex(i)) for i in range(mbs.systemData.NumberOfLoads())}
        vectors = {i: load["loadVector"] for i, load in loads.items() if _may_turn(mbs, load)}
        return found + _of_loads(mbs, solver, vectors) if vectors else found


def _may_turn(mbs: Any, load: Mapping[str, Any]) -> bool:
    """Whether the generalised force of a load can depend on the coordinates."""
    if load.get("bodyFixed") or not np.any(load.get("loadVector", 0.0)):
        return False
    marker = mbs.GetMarker(exu.MarkerIndex(load["markerNumber"]))
    if "bodyNumber" not in marker or load["loadType"] == "TorqueVector":
        return bool(marker["markerType"] != "NodePosition")
    return not mbs.GetObject(marker["bodyNumber"])["objectType"].startswith(STRAIGHT)


def _of_constraints(mbs: Any, solver: Any) -> np.ndarray:
    count = solver.GetODE2size()
    solver.ComputeMassMatrix(mbs)
    mass = np.array(solver.GetSystemMassMatrix())[:count, :count]
    carried = _carried(mass, constraint_jacobian(mbs, solver), generalised_forces(mbs, solver))
    return np.asarray(NumericalJacobian(mbs, lambda: carried @ constraint_jacobian(mbs, solver), range(count)))


def constraint_jacobian(mbs: Any, solver: Any) -> np.ndarray:
    """C (m, n_full) at the current state, of constraints on velocities too, of which Exudyn fills C^T only."""
    count, size = solver.GetODE2size(), solver.GetODE2size() + solver.GetAEsize()
    solver.SetSystemJacobian(np.zeros((size, size)))
    solver.ComputeJacobianAE(mbs)
    return np.array(solver.GetSystemJacobian())[:count, count:].T


def _carried(mass: np.ndarray, jacobian: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """mu (m,); what is round-off of the forces is zero, and gives no stiffness."""
    found = Directions(jacobian, mass).carried(forces)
    pushed = np.max(np.abs(found[:, None] * jacobian), axis=1, initial=0.0)
    return np.where(pushed > ROUND_OFF * np.max(np.abs(forces), initial=0.0), found, 0.0)


def _of_loads(mbs: Any, solver: Any, vectors: Mapping[int, Any]) -> np.ndarray:
    count = range(solver.GetODE2size())
    loaded = NumericalJacobian(mbs, lambda: generalised_forces(mbs, solver), count)
    with _without(mbs, vectors):
        return np.asarray(NumericalJacobian(mbs, lambda: generalised_forces(mbs, solver), count) - loaded)


def generalised_forces(mbs: Any, solver: Any) -> np.ndarray:
    """Generalised forces at the current state, those of constraints left out, (n_full,)."""
    solver.ComputeODE2RHS(mbs)
    return np.array(solver.GetSystemResidual())[: solver.GetODE2size()]


@contextmanager
def _without(mbs: Any, vectors: Mapping[int, Any]) -> Iterator[None]:
    """Take loads off and, whatever happens, put them on again."""
    try:
        for i, vector in vectors.items():
            mbs.SetLoadParameter(exu.LoadIndex(i), "loadVector", 0 * np.array(vector))
        yield
    finally:
        for i, vector in vectors.items():
            mbs.SetLoadParameter(exu.LoadIndex(i), "loadVector", vector)
