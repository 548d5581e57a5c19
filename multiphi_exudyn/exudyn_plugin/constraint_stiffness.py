"""Stiffness that constraint forces give a system whose constraints are curved: a pendulum has no other.

    M a + C^T mu = f,   C a = 0,   K_c = d(C(q)^T mu)/dq at constant mu

q (n_full,) the coordinates of the system, C (m, n_full) the Jacobian of its constraints, f the forces without them and
M the mass at the current state, mu (m,) [N, N m] what the constraints then carry. K_c is added to -df/dq; in the
directions that the constraints leave free both together are the stiffness. Constraints of coordinates are linear in
them and have none.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np
from exudyn.advancedUtilities import NumericalJacobian

__all__ = ["constraint_stiffness", "static_solver"]


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


def constraint_stiffness(mbs: Any, mass: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """K_c (n_full, n_full) at the initial state, from M and f in all coordinates."""
    count = len(forces)
    with static_solver(mbs) as solver:

        def jacobian() -> np.ndarray:
            size = count + solver.GetAEsize()
            solver.SetSystemJacobian(np.zeros((size, size)))
            solver.ComputeJacobianAE(mbs)
            return np.array(solver.GetSystemJacobian())[count:, :count]

        carried = _carried(mass, jacobian(), forces)
        return np.asarray(NumericalJacobian(mbs, lambda: carried @ jacobian(), range(count)))


def _carried(mass: np.ndarray, jacobian: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """mu (m,); redundant constraints share it."""
    held = len(jacobian)
    system = np.block([[mass, jacobian.T], [jacobian, np.zeros((held, held))]])
    found = np.linalg.lstsq(system, np.concatenate([forces, np.zeros(held)]), rcond=None)[0]
    return np.asarray(found[len(forces) :])
