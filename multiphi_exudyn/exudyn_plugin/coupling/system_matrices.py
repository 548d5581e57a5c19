"""System matrices: the rest of an Exudyn system, as the interface of a body meets it at an event.

    M a + C^T mu = f(q, v, t),   C a = -d(C v + c_t)/dt at constant v

q, v, a the coordinates of the whole system, C the Jacobian of all its constraints, ties of interfaces among them. The
derivative is a difference along the motion. The matrices are full ones: an event takes a few solutions of the system.

Given changes of the points y move what is connected to them with the least kinetic energy that constraints allow,

    dx = S dy,   M_a = S^T M S                                        (attached_inertia.py)

the body's own coordinates and ties left out of it. So an impact on the body is one on everything that hangs on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import lapack

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.coupling.attached_inertia import AttachedInertia

__all__ = ["Hanging", "SystemMatrices"]

APART = 1e-3  # of a step: between the states of a difference along the motion
SCALED = 3  # times rows and columns are divided by the root of their largest entry (D. Ruiz 2001)
ROUND_OFF = 1e-15  # of the largest eigenvalue: below it one is zero
NEGLIGIBLE = 1e-10  # of the largest mobility: below it constraints hold a point, and of the largest singular value


@dataclass(frozen=True)
class Hanging:
    """What hangs on the points of a body: its inertia, and S (n, m), how it follows them.

    only_forces: whether nothing but forces acts on the body, neither masses nor constraints. mass: M (n, n);
    jacobian: C (k, n) but for the ties.
    """

    attached: AttachedInertia
    follow: np.ndarray
    only_forces: bool
    mass: np.ndarray
    jacobian: np.ndarray


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
        self._free = _others(len(self._state["AECoords"]), self._ties)  # constraints beside the ties
        count, m = len(self.coordinates[0]), len(self._points)
        self._nothing = AttachedInertia(np.zeros((m, m)), np.eye(m)), np.zeros((count, m))
        self._others = _others(count, [*self._own, *self._points])

    @property
    def coordinates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Views of q, v, a (n,) in the system's current state."""
        state = self._state
        return state["ODE2Coords"], state["ODE2Coords_t"], state["ODE2Coords_tt"]

    def on_body(self, inertia: np.ndarray) -> bool:
        """Whether a mass or a constraint beside the ties acts on the body's own coordinates; inertia: its M (s, s)."""
        return self._on_body(inertia, self._mass(), self._constraints())

    def _on_body(self, inertia: np.ndarray, mass: np.ndarray, jacobian: np.ndarray) -> bool:
        first, last = int(self._own[0]), int(self._own[-1]) + 1  # a node's coordinates stand together
        own = mass[first:last]
        alone = np.count_nonzero(own) == np.count_nonzero(inertia) and bool((own[:, first:last] == inertia).all())
        return not alone or bool(jacobian[:, first:last].any())

    def present(self) -> np.ndarray:
        """A copy of q, v (2, n)."""
        return np.array(self.coordinates[:2])

    def forces(self) -> np.ndarray:
        """f (n,) at the current state, without those of constraints."""
        solver = self._mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(self._mbs)
        return np.array(solver.GetSystemResidual())[: len(self.coordinates[0])]

    def hanging(self, unmoved: np.ndarray, inertia: np.ndarray, ago: float = 0.0) -> Hanging:
        """What hangs on the points some time [s] before the others are at q, v (2, n); inertia: the body's M (s, s)."""
        if ago == 0:
            return self._hanging(inertia, self._mass(), self._constraints())
        q, v = unmoved
        here = self.coordinates[0].copy()
        self.coordinates[0][self._others] = (q - ago * v)[self._others]
        found = self._hanging(inertia, self._mass(), self._constraints())
        self.coordinates[0][:] = here
        return found

    def follow(self, hanging: Hanging, unmoved: np.ndarray) -> None:
        """Move all but the body from q, v (2, n), where they would be without it, as the points have moved."""
        for view, there in zip(self.coordinates, unmoved, strict=False):
            moved = hanging.follow @ (view - there)[self._points]
            view[self._others] = (there + moved)[self._others]

    def spread(self, hanging: Hanging, step: float, elapsed: float, jump: np.ndarray) -> None:
        """The others, on which nothing of the body hangs but forces, which have jumped by (n,) a time [s] ago."""
        others, free = self._others, self._free
        if not len(others):
            return
        mass, jacobian, none = hanging.mass[others[:, None], others], hanging.jacobian[:, others], np.zeros(len(free))
        if jump[others].any():
            change = _balanced(mass, jacobian, np.concatenate([jump[others], none]))
            self.coordinates[1][others] += elapsed * change[: len(others)]
        turning = self._along_the_motion(APART * step)[free] if len(free) else none
        found = _balanced(mass, jacobian, np.concatenate([self.forces()[others], turning]))
        self.coordinates[2][others] = found[: len(others)]
        self._state["AECoords"][free] = found[len(others) :]

    def accelerations(self, step: float) -> np.ndarray:
        """a (n,) at the current state, which gets mu and, beside the body, a; step [s]: that of the solver."""
        mass, jacobian = self._mass(), self._jacobian()
        forces, turning = self.forces(), np.zeros(len(jacobian))
        if len(jacobian) > len(self._ties):
            turning = self._along_the_motion(APART * step)
        found = _balanced(mass, jacobian, np.concatenate([forces, turning]))
        self._state["AECoords"][:] = found[len(mass) :]
        self.coordinates[2][self._others] = found[self._others]
        return found[: len(mass)]

    def _hanging(self, inertia: np.ndarray, mass: np.ndarray, jacobian: np.ndarray) -> Hanging:
        """What hangs on the points at the current state; jacobian: C but for the ties."""
        given = mass, jacobian
        if not (mass[self._points].any() or jacobian[:, self._points].any()):
            return Hanging(*self._nothing, not self._on_body(inertia, mass, jacobian), *given)
        jacobian = jacobian.copy()
        jacobian[:, self._own] = 0.0
        moving = _connected(mass, jacobian, self._points)
        for place in sorted(self.apart.keys() & set(moving.tolist())):
            raise MultiPhiValueError(
                f"interface: got constraints that tie body {self.apart[place]!r} to another, both with rigid contacts, "
                "need contacts of finite stiffness, a spring between, or both structures in one model (assemble)"
            )
        jacobian = jacobian[:, moving]
        jacobian = jacobian[np.any(jacobian, axis=1)]
        mass, at = mass[np.ix_(moving, moving)], np.searchsorted(moving, self._points)
        follow = np.zeros((len(given[0]), len(at)))
        ways = _null_space(jacobian)
        shown = ways[at]  # y of the ways that are left
        heaviest = float(np.max(np.diagonal(mass)))
        flexible, _ = _inverted(ways.T @ mass @ ways + (heaviest or 1.0) * shown.T @ shown, ROUND_OFF)
        inverse, free = _inverted(shown @ flexible @ shown.T, NEGLIGIBLE)
        carried = ways @ flexible @ shown.T @ inverse
        follow[moving] = carried
        attached = AttachedInertia(carried.T @ mass @ carried, free)
        return Hanging(attached, follow, False, *given)

    def _mass(self) -> np.ndarray:
        """M (n, n) at the current state."""
        solver, count = self._mbs.sys["dynamicSolver"], len(self.coordinates[0])
        solver.ComputeMassMatrix(self._mbs)
        return np.array(solver.GetSystemMassMatrix())[:count, :count]

    def _constraints(self) -> np.ndarray:
        """C (k, n) at the current state but for the ties; mostly there are none."""
        return self._jacobian()[self._free] if len(self._free) else np.zeros((0, len(self.coordinates[0])))

    def _jacobian(self) -> np.ndarray:
        """C (k, n) at the current state."""
        solver, mbs = self._mbs.sys["dynamicSolver"], self._mbs
        count, first = solver.GetODE2size(), solver.GetODE2size() + solver.GetODE1size()
        size = first + solver.GetAEsize()
        solver.SetSystemJacobian(np.zeros((size, size)))
        solver.ComputeJacobianAE(mbs, scalarFactor_ODE2=1.0, scalarFactor_ODE2_t=1.0)
        mbs.solverSignalJacobianUpdate = True  # the solver's own is overwritten
        return np.array(solver.GetSystemJacobian())[first:, :count]

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


def _others(count: int, places: Sequence[int]) -> np.ndarray:
    """Positions among so many that are none of these, ascending."""
    left = np.ones(count, bool)
    left[list(places)] = False
    return np.flatnonzero(left)


def _connected(mass: np.ndarray, jacobian: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Positions of these coordinates and of all that mass and constraints connect with them, ascending."""
    holds = (jacobian != 0).astype(float)
    linked = (mass != 0) | (holds.T.dot(holds) > 0)
    found, count = np.zeros(len(mass), bool), 0
    found[points] = True
    while np.count_nonzero(found) > count:
        count = int(np.count_nonzero(found))
        found |= linked[found].any(axis=0)
    return np.flatnonzero(found)


def _balanced(mass: np.ndarray, jacobian: np.ndarray, given: np.ndarray) -> np.ndarray:
    """(a, mu) (n + k,) of M a + C^T mu = f, C a = g, (f, g) given; redundant constraints share mu."""
    n, count = len(mass), len(mass) + len(jacobian)
    if n == count and np.count_nonzero(mass) == np.count_nonzero(np.diagonal(mass)) == n:
        return np.asarray(given / np.diagonal(mass))
    system = np.zeros((count, count))
    system[:n, :n], system[n:, :n], system[:n, n:] = mass, jacobian, jacobian.T
    if not count:
        return np.zeros(0)
    scale, sizes = np.ones(count), np.abs(system)
    for _ in range(SCALED):
        largest = np.sqrt(np.maximum.reduce(sizes * scale, axis=1) * scale)
        largest[largest == 0] = 1.0
        scale /= largest
    system *= scale[:, None] * scale
    factors, pivots, singular = lapack.dgetrf(system)
    if not singular and lapack.dgecon(factors, np.max(np.sum(np.abs(system), axis=0)))[0] > np.finfo(float).eps:
        return np.asarray(scale * lapack.dgetrs(factors, pivots, scale * given)[0])
    return np.asarray(scale * np.linalg.lstsq(system, scale * given, rcond=None)[0])


def _inverted(matrix: np.ndarray, negligible: float) -> tuple[np.ndarray, np.ndarray]:
    """Pseudo-inverse (k, k) of a symmetric matrix without negative eigenvalues, and its range, orthonormal."""
    values, ways = np.linalg.eigh(matrix)
    kept = values > negligible * np.max(values, initial=0.0)
    found = ways[:, kept]
    return found / values[kept] @ found.T, found


def _null_space(jacobian: np.ndarray) -> np.ndarray:
    """Orthonormal basis (n, f) of what constraints (k, n) leave free."""
    if not np.any(jacobian):
        return np.eye(jacobian.shape[1])
    _, singular, ways = np.linalg.svd(jacobian)
    return np.asarray(ways[int(np.sum(singular > NEGLIGIBLE * np.max(singular))) :].T)
