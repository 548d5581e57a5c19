"""System matrices: the rest of an Exudyn system, as the interface of a body meets it at an event.

    M a + C^T mu = f(q, v, t),   C a = -d(C v + c_t)/dt at constant v

q, v, a the coordinates of the whole system, C the Jacobian of all its constraints, ties of interfaces among them. The
derivative is a difference along the motion. The matrices are full ones: an event takes a few solutions of the system.

Given changes of the points y move what is connected to them with the least kinetic energy that constraints allow,

    dx = S dy,   M_a = S^T M S                                        (attached_inertia.py)

the body's own coordinates and ties left out of it. So an impact on the body is one on everything that hangs on it.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from typing import Any

import numpy as np
import scipy.linalg

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.coupling.attached_inertia import AttachedInertia

__all__ = ["SystemMatrices"]

APART = 1e-3  # of a step: between the states of a difference along the motion
SCALED = 5  # times rows and columns are divided by the root of their largest entry (D. Ruiz 2001)
NEGLIGIBLE = 1e-10  # of the largest mobility: below it constraints hold a point, and of the largest singular value


class SystemMatrices:
    """The system around one body during a run. apart: names of bodies that may not hang on it, by their first position.

    own, points: positions of the body's coordinates and of its interface coordinates among those of the system.
    ties: objects that tie them.
    """

    def __init__(self, mbs: Any, own: Iterable[int], points: Iterable[int], ties: Iterable[Any]) -> None:
        self._mbs = mbs
        self.apart: dict[int, str] = {}
        self._state = mbs.systemData.GetSystemStateDict(reference=True)
        self._points = np.array(list(points), dtype=int)
        self._own = np.array(list(own), dtype=int)
        self._ties = [row for tie in ties for row in mbs.systemData.GetObjectLTGAE(tie)]
        self._others = np.setdiff1d(np.arange(len(self.coordinates[0])), [*self._own, *self._points])

    @property
    def coordinates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Views of q, v, a (n,) in the system's current state."""
        state = self._state
        return state["ODE2Coords"], state["ODE2Coords_t"], state["ODE2Coords_tt"]

    def on_body(self, inertia: np.ndarray) -> bool:
        """Whether a mass or a constraint beside the ties acts on the body's own coordinates; inertia: its M (s, s)."""
        mass, jacobian = self._matrices()
        added = mass[self._own].copy()
        added[:, self._own] -= inertia
        return bool(np.any(added) or np.any(np.delete(jacobian, self._ties, axis=0)[:, self._own]))

    def mark(self) -> AttachedInertia:
        """Take the current state as that of a step without event; what hangs on the points."""
        self._unstruck = self._present()
        return self.hanging(0.0)

    def hanging(self, ago: float) -> AttachedInertia:
        """What hung on the points some time [s] before the state that was marked."""
        q, v = self._unstruck
        here = self.coordinates[0].copy()
        self.coordinates[0][self._others] = (q - ago * v)[self._others]
        attached, self._follow = self._attached()
        self.coordinates[0][:] = here
        return attached

    def leave(self, step: float) -> np.ndarray:
        """a (n,) right before an event of the body."""
        self._left, self._before = self._present(), self.accelerations(step)
        return self._before

    def arrive(self, step: float) -> np.ndarray:
        """a (n,) right after it, where what hangs on the points has followed them."""
        self._move(self._left)
        found = self.accelerations(step)
        self._change = found - self._before
        return found

    def settle(self, elapsed: float, step: float) -> np.ndarray:
        """a (n,) at the end of the step, where everything has followed the body for the time ``elapsed`` [s]."""
        q, v = self._unstruck
        self._move(np.array([q, v + elapsed * self._change]))
        return self.accelerations(step)

    def accelerations(self, step: float) -> np.ndarray:
        """a (n,) at the current state, which gets mu and, beside the body, a; step [s]: that of the solver."""
        mass, jacobian = self._matrices()
        solver = self._mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(self._mbs)
        forces = np.array(solver.GetSystemResidual())[: len(mass)]
        turning = np.zeros(len(jacobian))
        if len(jacobian) > len(self._ties):
            turning = self._along_the_motion(APART * step)
        found = _balanced(mass, jacobian, np.concatenate([forces, turning]))
        self._state["AECoords"][:] = found[len(mass) :]
        self.coordinates[2][self._others] = found[self._others]
        return found[: len(mass)]

    def _attached(self) -> tuple[AttachedInertia, np.ndarray]:
        """What hangs on the points at the current state, and S (n, m)."""
        mass, jacobian = self._matrices()
        jacobian = np.delete(jacobian, self._ties, axis=0)
        jacobian[:, self._own] = 0.0
        moving = _connected(mass, jacobian, self._points)
        for place in sorted(self.apart.keys() & set(moving.tolist())):
            raise MultiPhiValueError(
                f"interface: got constraints that tie body {self.apart[place]!r} to another, both with rigid contacts, "
                "need compliant ones, a spring between, or both structures in one model (assemble)"
            )
        jacobian = jacobian[:, moving]
        jacobian = jacobian[np.any(jacobian, axis=1)]
        mass, at = mass[np.ix_(moving, moving)], np.searchsorted(moving, self._points)
        follow = np.zeros((len(self.coordinates[0]), len(at)))
        if not (np.any(mass) or np.any(jacobian)):
            return AttachedInertia(np.zeros((len(at), len(at))), np.eye(len(at))), follow  # nothing hangs there
        ways = _null_space(jacobian)
        shown = ways[at]  # y of the ways that are left
        inertia, heaviest = ways.T @ mass @ ways, float(np.max(np.diagonal(mass)))
        flexible = np.linalg.pinv(inertia + (heaviest or 1.0) * shown.T @ shown, hermitian=True)
        mobility, directions = np.linalg.eigh(shown @ flexible @ shown.T)
        free = directions[:, mobility > NEGLIGIBLE * np.max(mobility, initial=0.0)]
        carried = ways @ flexible @ shown.T @ np.linalg.pinv(shown @ flexible @ shown.T, NEGLIGIBLE, hermitian=True)
        follow[moving] = carried
        return AttachedInertia(carried.T @ mass @ carried, free), follow

    def _present(self) -> np.ndarray:
        """A copy of q, v (2, n)."""
        return np.array(self.coordinates[:2])

    def _move(self, free: np.ndarray) -> None:
        """Move all but the body from q, v (2, n), where they would be without it, as the points have moved."""
        for view, unmoved in zip(self.coordinates, free, strict=False):
            view[self._others] = (unmoved + self._follow @ (view - unmoved)[self._points])[self._others]

    def _matrices(self) -> tuple[np.ndarray, np.ndarray]:
        """M (n, n) and C (k, n) at the current state."""
        solver, mbs = self._mbs.sys["dynamicSolver"], self._mbs
        count, first = solver.GetODE2size(), solver.GetODE2size() + solver.GetODE1size()
        size = first + solver.GetAEsize()
        solver.ComputeMassMatrix(mbs)
        mass = np.array(solver.GetSystemMassMatrix())[:count, :count]
        solver.SetSystemJacobian(np.zeros((size, size)))
        solver.ComputeJacobianAE(mbs, scalarFactor_ODE2=1.0, scalarFactor_ODE2_t=1.0)
        jacobian = np.array(solver.GetSystemJacobian())[first:, :count]
        mbs.solverSignalJacobianUpdate = True  # the solver's own has been overwritten
        return mass, jacobian

    def _along_the_motion(self, apart: float) -> np.ndarray:
        """-d(C v + c_t)/dt (k,) at constant v; apart [s]: half the distance of the states compared."""
        mbs, solver = self._mbs, self._mbs.sys["dynamicSolver"]
        q, v, _ = self.coordinates
        here, t, found = q.copy(), mbs.systemData.GetTime(), []
        try:
            for way in (-apart, apart):
                q[:] = here + way * v
                mbs.systemData.SetTime(t + way)
                solver.ComputeAlgebraicEquations(mbs, velocityLevel=True)
                found.append(np.array(solver.GetSystemResidual())[len(q) + solver.GetODE1size() :])
        finally:
            q[:] = here
            mbs.systemData.SetTime(t)
        return np.asarray((found[0] - found[1]) / (2 * apart))


def _connected(mass: np.ndarray, jacobian: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Positions of these coordinates and of all that mass and constraints connect with them, ascending."""
    masses, holds = mass != 0, jacobian != 0
    found, count = np.zeros(len(mass), bool), 0
    found[points] = True
    while np.sum(found) > count:
        count = np.sum(found)
        found |= np.any(masses[found], axis=0) | np.any(holds[np.any(holds[:, found], axis=1)], axis=0)
    return np.flatnonzero(found)


def _balanced(mass: np.ndarray, jacobian: np.ndarray, given: np.ndarray) -> np.ndarray:
    """(a, mu) (n + k,) of M a + C^T mu = f, C a = g, (f, g) given; redundant constraints share mu."""
    system = np.block([[mass, jacobian.T], [jacobian, np.zeros((len(jacobian),) * 2)]])
    scale = np.ones(len(system))
    for _ in range(SCALED):
        largest = np.max(np.abs(system) * np.outer(scale, scale), axis=1, initial=0.0)
        scale /= np.sqrt(np.where(largest > 0, largest, 1.0))
    system = system * np.outer(scale, scale)
    with warnings.catch_warnings():
        warnings.simplefilter("error", scipy.linalg.LinAlgWarning)
        try:
            return np.asarray(scale * scipy.linalg.solve(system, scale * given, check_finite=False))
        except (scipy.linalg.LinAlgError, scipy.linalg.LinAlgWarning):
            return np.asarray(scale * np.linalg.lstsq(system, scale * given, rcond=None)[0])


def _null_space(jacobian: np.ndarray) -> np.ndarray:
    """Orthonormal basis (n, f) of what constraints (k, n) leave free."""
    if not np.any(jacobian):
        return np.eye(jacobian.shape[1])
    _, singular, ways = np.linalg.svd(jacobian)
    return np.asarray(ways[int(np.sum(singular > NEGLIGIBLE * np.max(singular))) :].T)
