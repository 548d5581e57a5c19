"""Attached inertia: masses and constraints of the system at points of a body, which take part in its impacts.

    min |dv|^2 + dw.M_a dw,   dw = R dv = U u,   H (v + dv) >= 0

v (r,) is the modal velocity of the body, R v (m,) that of its points, M_a (m, m) the inertia attached to them, the
columns of U (m, k) the velocities that constraints leave them (attached.py), H the contacts that touch. An
impulse i on the body then changes its velocity by

    dv = B i,   B = 1 - R^T X R,   X (R R^T + M_a^-1) = 1 without constraints,

and -X R i is the impulse on it at the points. If R v in a new level's modes has an error e (m,), its velocity changes
by -R^T X e. The accelerations of contacts at rest follow the same equation. A contact that attached parts leave no
mobility stays open at its stop without a force, as does one that closed contacts leave none (core/law).

System matrices: accelerations of a whole Exudyn system, and the inertia that is attached to the points of a body.

    M a + C^T mu = f(q, v, t),   C a = -d(C v + c_t)/dt at constant v

q, v, a are coordinates, velocities and accelerations of the whole system, C is the Jacobian of all its constraints, the
ties of interfaces included. The derivative is a difference along the motion. The matrices are dense: an event needs a
few solutions of the system.

A change dy of the points' velocities changes those of the parts connected to them by the least kinetic energy that
constraints allow,

    dx = S dy,   M_a = S^T M S                                        (attached.py)

without the body's own coordinates and the ties. So all attached parts take part in an impact on the body.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.linalg import lapack

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.loaded_level import LoadedLevel

KEPT = 16  # impedances: in base coordinates, and in the levels between which a body changes
ROUND_OFF = 1e-15  # of the largest singular value: smaller ones count as zero
DIFFERENCE = 1e-3  # of a step: half the interval of the difference along the motion
SCALED = 3  # number of times that rows and columns are divided by the root of their largest entry (D. Ruiz 2001)
MOBILITY_ROUND_OFF = 1e-15  # of the largest eigenvalue: smaller ones count as zero
NEGLIGIBLE = 1e-10  # of the largest mobility of a point or singular value: smaller ones count as zero

RowsIn = Callable[[tuple[int, ...]], np.ndarray]  # R (m, r) by the states of a level


@dataclass(frozen=True)
class AttachedInertia:
    """Inertia attached to points: mass M_a (m, m), and free, the orthonormal columns U (m, k)."""

    mass: np.ndarray
    free: np.ndarray
    _impedances: BoundedCache[tuple[int, bytes], np.ndarray] = field(
        default_factory=lambda: BoundedCache(KEPT), init=False, repr=False, compare=False
    )

    def impedance(self, rows: np.ndarray) -> np.ndarray:
        """X (m, m) for a body whose points have the rows R (m, r); kept, as every force in a step asks for it."""
        return self._impedances.get_or_build((rows.shape[1], rows.tobytes()), lambda: self._impedance(rows))

    def _impedance(self, rows: np.ndarray) -> np.ndarray:
        mobility = rows @ rows.T
        constrained, k = self._constrained / (np.linalg.norm(mobility) or 1.0), self.free.shape[1]
        forces = np.concatenate([self.mass @ self.free, constrained], axis=1)
        velocities = mobility @ forces
        velocities[:, :k] += self.free
        left, sizes, right = np.linalg.svd(velocities)
        nonzero = sizes > ROUND_OFF * np.max(sizes, initial=0.0)  # constraints may act where no mode moves
        return np.asarray((forces @ right[nonzero].T) / sizes[nonzero] @ left[:, nonzero].T)

    @functools.cached_property
    def _constrained(self) -> np.ndarray:
        """Directions (m, m - k) that constraints fix, orthonormal."""
        m, k = self.free.shape
        if k in (0, m):
            return np.eye(m)[:, k:]
        return np.linalg.svd(self.free)[0][:, k:]

    def reactions(self, rows: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """Impulses (m, k) on the points that impulses (r, k) on the body cause."""
        return -self.impedance(rows) @ (rows @ impulses)

    def mobilities(self, directions: np.ndarray, in_base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Remaining mobility of contacts: shares (k,) and W (k, k) with W^T (H B H^T) W = diag(shares).

        directions: H^T (b, k). in_base: R (m, b).
        """
        lengths = np.linalg.norm(directions, axis=0)
        responses = directions + in_base.T @ self.reactions(in_base, directions)
        shares, vectors = np.linalg.eigh(directions.T @ responses / np.outer(lengths, lengths))
        return shares, vectors / lengths[:, None]

    def immovable(self, base: ModalBase, in_base: np.ndarray) -> set[int]:
        """Indices of rigid contacts that the attached inertia leaves no mobility."""
        rigid = _impact_links(base)
        directions = base.directions[:, rigid]
        responses = directions + in_base.T @ self.reactions(in_base, directions)
        immovable = np.sum(directions * responses, axis=0) <= core.IMMOVABLE * np.sum(directions**2, axis=0)
        return set(rigid[immovable].tolist())


class Reactions:
    """Forces on the points of a body that the forces of its elements cause at one instant, by the attached inertia.

    The forces of elements are the reactions of rigid links, pushes, and friction in proportion to pressures (c,) [N].
    rows: R (m, b) of the points in base coordinates. acceleration: y'' (b,) of the body in ``level``, whose links act
    with the forces ``reactions`` (k,) [N].
    """

    def __init__(
        self,
        attached: AttachedInertia,
        base: ModalBase,
        rows: np.ndarray,
        acceleration: np.ndarray,
        level: LoadedLevel,
        reactions: np.ndarray,
        pressures: np.ndarray,
    ) -> None:
        self._attached, self._base, self._rows, self._pressures = attached, base, rows, pressures
        directions, point_reactions = self._point_reactions(level)
        rigid_reactions = reactions[np.isinf(base.stiffnesses[list(level.level.indices)])]
        push, point_push = self._pushes(level)
        by_elements = (directions + rows.T @ point_reactions) @ rigid_reactions + push + rows.T @ point_push
        self._acceleration = acceleration - by_elements  # of the body without these forces

    def at(self, level: LoadedLevel) -> np.ndarray:
        """Forces (m,) in a level, relative to a level without closed rigid links and without pushes."""
        directions, point_reactions = self._point_reactions(level)
        push, point_push = self._pushes(level)
        acceleration = self._acceleration + push + self._rows.T @ point_push
        mobility, vectors = self._attached.mobilities(directions, self._rows)
        moving = mobility > core.IMMOVABLE
        rigid_reactions = vectors[:, moving] @ (
            (vectors[:, moving].T @ (directions.T @ acceleration)) / mobility[moving]
        )
        return np.asarray(point_push - point_reactions @ rigid_reactions)

    def _point_reactions(self, level: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
        """H (b, k) of the closed rigid links, and the forces (m, k) on points that unit reactions cause."""
        rigid = [i for i in level.level.indices if np.isinf(self._base.stiffnesses[i])]
        directions = self._base.directions[:, rigid]
        return directions, self._attached.reactions(self._rows, directions)

    def _pushes(self, level: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
        """Pushes (b,) of elements, and the forces (m,) on points that they cause."""
        base = self._base
        push = base.directions @ level.pushes
        for i in level.rubbing_elements:
            link = next(k for k in base.link_indices[i] if k in base.oblique and k in level.level.indices)
            push = push + (base.pushes[:, link] - base.directions[:, link]) * self._pressures[i]
        return push, self._attached.reactions(self._rows, push)


class PointInertia:
    """Inertia attached to the points of a body during a step, in the modes of its levels (coupled.py).

    in_base: R (m, b) of the points in base coordinates. rows_in: R (m, r) by the states of a level.
    """

    independence = math.sqrt(core.IMMOVABLE)

    def __init__(self, attached: AttachedInertia, base: ModalBase, in_base: np.ndarray, rows_in: RowsIn) -> None:
        self._attached, self._base, self._in_base, self._rows_in = attached, base, in_base, rows_in

    @functools.cached_property
    def immovable(self) -> set[int]:
        """Indices of contacts without mobility, whose gaps change by round-off of constraints alone."""
        return self._attached.immovable(self._base, self._in_base)

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) with F F^T = B of a level."""
        rows = self._rows_in(states)
        impedance = self._attached.impedance(rows)
        shares, vectors = np.linalg.eigh(np.eye(rows.shape[1]) - rows.T @ (impedance + impedance.T) @ rows / 2)
        return np.asarray(vectors * np.sqrt(np.maximum(shares, 0.0)))

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """Matrix of eta'_m from eta'_l, with which attached masses keep their momentum when modes are truncated."""
        before, after = self._rows_in(source), self._rows_in(target)
        return np.asarray(matrix - after.T @ (self._attached.impedance(after) @ (after @ matrix - before)))

    def joining(self, rows: np.ndarray, difference: np.ndarray) -> np.ndarray:
        """Change -R^T X e (r,) of the modal velocity by an impact after which body and parts move as one at the points.

        rows: R (m, r) of the points. difference: e (m,) of the body's velocities there to those of the attached parts.
        """
        return np.asarray(-rows.T @ (self._attached.impedance(rows) @ difference))

    def directions(self, units: np.ndarray) -> np.ndarray:
        """Vectors (c, b) with products u.B u' for directions u (c, b) of contacts; zero for compliant ones."""
        rigid, reduced = _impact_links(self._base), np.zeros_like(units)
        directions = units[rigid].T
        responses = directions + self._in_base.T @ self._attached.reactions(self._in_base, directions)
        products = directions.T @ responses
        shares, vectors = np.linalg.eigh((products + products.T) / 2)
        reduced_rows = (vectors * np.sqrt(np.maximum(shares, 0.0)))[:, ::-1][:, : units.shape[1]]
        reduced[rigid, : reduced_rows.shape[1]] = reduced_rows
        return reduced


def _impact_links(base: ModalBase) -> np.ndarray:
    """Indices of the links that have impacts: rigid ones without stick position."""
    held = np.array([link.held for link in base.links], bool)
    return np.flatnonzero(np.isinf(base.stiffnesses) & ~held)


@dataclass(frozen=True)
class AttachedParts:
    """Masses and constraints attached to the points of a body: their inertia, and follower, S (n, m).

    only_forces: whether neither masses nor constraints are attached to the body, but forces alone. mass: M (n, n);
    jacobian: C (k, n) without the ties.
    """

    inertia: AttachedInertia
    follower: np.ndarray
    only_forces: bool
    mass: np.ndarray
    jacobian: np.ndarray


class SystemMatrices:
    """The system around one body during a run.

    body, points: indices of the body's coordinates and of its interface coordinates among those of the system. ties:
    objects of the constraints between them. exclusive_bodies: names of bodies that may not be attached to this one, by
    the index of their first coordinate.
    """

    def __init__(self, mbs: Any, body: Iterable[int], points: Iterable[int], ties: Iterable[Any]) -> None:
        self._mbs = mbs
        self.exclusive_bodies: dict[int, str] = {}
        self._state = mbs.systemData.GetSystemStateDict(reference=True)
        self._points = np.array(list(points), dtype=int)
        self._body_coordinates = np.array(list(body), dtype=int)
        self._ties = [row for tie in ties for row in mbs.systemData.GetObjectLTGAE(tie)]
        self._free = _complement(len(self._state["AECoords"]), self._ties)  # constraints other than ties
        count, m = len(self.coordinates[0]), len(self._points)
        self._nothing = AttachedInertia(np.zeros((m, m)), np.eye(m)), np.zeros((count, m))
        self._other_coordinates = _complement(count, [*self._body_coordinates, *self._points])

    @property
    def coordinates(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Views of q, v, a (n,) in the system's current state."""
        state = self._state
        return state["ODE2Coords"], state["ODE2Coords_t"], state["ODE2Coords_tt"]

    def acts_on_body(self, inertia: np.ndarray) -> bool:
        """Whether a mass or a constraint but the ties acts on the body's own coordinates; inertia: its M (s, s)."""
        return self._acts_on_body(inertia, self._mass(), self._constraints())

    def _acts_on_body(self, inertia: np.ndarray, mass: np.ndarray, jacobian: np.ndarray) -> bool:
        first, last = (
            int(self._body_coordinates[0]),
            int(self._body_coordinates[-1]) + 1,
        )  # of one node
        rows = mass[first:last]
        same = np.count_nonzero(rows) == np.count_nonzero(inertia) and bool((rows[:, first:last] == inertia).all())
        return not same or bool(jacobian[:, first:last].any())

    def copy_state(self) -> np.ndarray:
        """A copy of q, v (2, n)."""
        return np.array(self.coordinates[:2])

    def forces(self) -> np.ndarray:
        """Forces f (n,) at the current state, without those of constraints."""
        solver = self._mbs.sys["dynamicSolver"]
        solver.ComputeODE2RHS(self._mbs)
        return np.array(solver.GetSystemResidual())[: len(self.coordinates[0])]

    def attached_parts(self, undisturbed: np.ndarray, inertia: np.ndarray, ago: float = 0.0) -> AttachedParts:
        """Parts attached to the points, a time ``ago`` [s] before the others are at q, v (2, n).

        inertia: M (s, s) of the body.
        """
        if ago == 0:
            return self._attached_parts(inertia, self._mass(), self._constraints())
        q, v = undisturbed
        present = self.coordinates[0].copy()
        self.coordinates[0][self._other_coordinates] = (q - ago * v)[self._other_coordinates]
        parts = self._attached_parts(inertia, self._mass(), self._constraints())
        self.coordinates[0][:] = present
        return parts

    def move_parts(self, parts: AttachedParts, undisturbed: np.ndarray) -> None:
        """Move the attached parts with the points, from q, v (2, n) of the undisturbed system."""
        for view, start in zip(self.coordinates, undisturbed, strict=False):
            change = parts.follower @ (view - start)[self._points]
            view[self._other_coordinates] = (start + change)[self._other_coordinates]

    def apply_force_jump(self, parts: AttachedParts, step: float, elapsed: float, jump: np.ndarray) -> None:
        """Correct the other coordinates, coupled to the body by forces alone, for a jump (n,) of forces at an event.

        elapsed: time since the event [s]. step: of the solver [s].
        """
        others, free = self._other_coordinates, self._free
        if not len(others):
            return
        mass, jacobian, none = parts.mass[others[:, None], others], parts.jacobian[:, others], np.zeros(len(free))
        if jump[others].any():
            change = _solve_constrained(mass, jacobian, np.concatenate([jump[others], none]))
            self.coordinates[1][others] += elapsed * change[: len(others)]
        constraint_accelerations = self._constraint_accelerations(DIFFERENCE * step)[free] if len(free) else none
        right_side = np.concatenate([self.forces()[others], constraint_accelerations])
        solution = _solve_constrained(mass, jacobian, right_side)
        self.coordinates[2][others] = solution[: len(others)]
        self._state["AECoords"][free] = solution[len(others) :]

    def accelerations(self, step: float) -> np.ndarray:
        """Accelerations a (n,) at the current state; writes mu, and a of the other parts. step: of the solver [s]."""
        mass, jacobian = self._mass(), self._jacobian()
        forces, constraint_accelerations = self.forces(), np.zeros(len(jacobian))
        if len(jacobian) > len(self._ties):
            constraint_accelerations = self._constraint_accelerations(DIFFERENCE * step)
        solution = _solve_constrained(mass, jacobian, np.concatenate([forces, constraint_accelerations]))
        self._state["AECoords"][:] = solution[len(mass) :]
        self.coordinates[2][self._other_coordinates] = solution[self._other_coordinates]
        return solution[: len(mass)]

    def _attached_parts(self, inertia: np.ndarray, mass: np.ndarray, jacobian: np.ndarray) -> AttachedParts:
        """Parts attached to the points at the current state; jacobian: C without the ties."""
        original = mass, jacobian
        if not (mass[self._points].any() or jacobian[:, self._points].any()):
            return AttachedParts(*self._nothing, not self._acts_on_body(inertia, mass, jacobian), *original)
        jacobian = jacobian.copy()
        jacobian[:, self._body_coordinates] = 0.0
        moving = _connected_coordinates(mass, jacobian, self._points)
        for index in sorted(self.exclusive_bodies.keys() & set(moving.tolist())):
            name = self.exclusive_bodies[index]
            raise MultiPhiValueError(
                f"interface: got constraints that tie body {name!r} to another, both with rigid contacts, "
                "need contacts of finite stiffness, a spring between, or both structures in one model (assemble)"
            )
        jacobian = jacobian[:, moving]
        jacobian = jacobian[np.any(jacobian, axis=1)]
        mass, at = mass[np.ix_(moving, moving)], np.searchsorted(moving, self._points)
        follower = np.zeros((len(original[0]), len(at)))
        vectors = _null_space(jacobian)
        on_points = vectors[at]  # y of the motions that constraints allow
        heaviest = float(np.max(np.diagonal(mass)))
        weighted = vectors.T @ mass @ vectors + (heaviest or 1.0) * on_points.T @ on_points
        mobility, _ = _pseudo_inverse(weighted, MOBILITY_ROUND_OFF)
        inverse, free = _pseudo_inverse(on_points @ mobility @ on_points.T, NEGLIGIBLE)
        motion = vectors @ mobility @ on_points.T @ inverse
        follower[moving] = motion
        inertia_of_parts = AttachedInertia(motion.T @ mass @ motion, free)
        return AttachedParts(inertia_of_parts, follower, False, *original)

    def _mass(self) -> np.ndarray:
        """Mass matrix M (n, n) at the current state."""
        solver, count = self._mbs.sys["dynamicSolver"], len(self.coordinates[0])
        solver.ComputeMassMatrix(self._mbs)
        return np.array(solver.GetSystemMassMatrix())[:count, :count]

    def _constraints(self) -> np.ndarray:
        """Constraint Jacobian C (k, n) at the current state without the ties; often there are no others."""
        return self._jacobian()[self._free] if len(self._free) else np.zeros((0, len(self.coordinates[0])))

    def _jacobian(self) -> np.ndarray:
        """Constraint Jacobian C (k, n) at the current state."""
        solver, mbs = self._mbs.sys["dynamicSolver"], self._mbs
        count, first = solver.GetODE2size(), solver.GetODE2size() + solver.GetODE1size()
        size = first + solver.GetAEsize()
        solver.SetSystemJacobian(np.zeros((size, size)))
        solver.ComputeJacobianAE(mbs, scalarFactor_ODE2=1.0, scalarFactor_ODE2_t=1.0)
        mbs.solverSignalJacobianUpdate = True  # the solver's own Jacobian is overwritten
        return np.array(solver.GetSystemJacobian())[first:, :count]

    def _constraint_accelerations(self, half_step: float) -> np.ndarray:
        """-d(C v + c_t)/dt (k,) at constant v, by a central difference over 2 ``half_step`` [s]."""
        mbs, solver = self._mbs, self._mbs.sys["dynamicSolver"]
        q, v, _ = self.coordinates
        present, t, residuals = q.copy(), mbs.systemData.GetTime(), []
        try:
            for shift in (-half_step, half_step):
                q[:] = present + shift * v
                mbs.systemData.SetTime(t + shift)
                solver.ComputeAlgebraicEquations(mbs, velocityLevel=True)
                residuals.append(np.array(solver.GetSystemResidual())[len(q) + solver.GetODE1size() :])
        finally:
            q[:] = present
            mbs.systemData.SetTime(t)
        return np.asarray((residuals[0] - residuals[1]) / (2 * half_step))


def _complement(count: int, indices: Sequence[int]) -> np.ndarray:
    """All other indices below ``count``, ascending."""
    others = np.ones(count, bool)
    others[list(indices)] = False
    return np.flatnonzero(others)


def _connected_coordinates(mass: np.ndarray, jacobian: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Indices of the points' coordinates and of all that masses and constraints connect with them, ascending."""
    pattern = (jacobian != 0).astype(float)
    linked = (mass != 0) | (pattern.T.dot(pattern) > 0)
    connected, count = np.zeros(len(mass), bool), 0
    connected[points] = True
    while np.count_nonzero(connected) > count:
        count = int(np.count_nonzero(connected))
        connected |= linked[connected].any(axis=0)
    return np.flatnonzero(connected)


def _solve_constrained(mass: np.ndarray, jacobian: np.ndarray, right_side: np.ndarray) -> np.ndarray:
    """Solution (a, mu) (n + k,) of M a + C^T mu = f, C a = g; redundant constraints share mu. right_side: (f, g)."""
    n, count = len(mass), len(mass) + len(jacobian)
    if n == count and np.count_nonzero(mass) == np.count_nonzero(np.diagonal(mass)) == n:
        return np.asarray(right_side / np.diagonal(mass))
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
        return np.asarray(scale * lapack.dgetrs(factors, pivots, scale * right_side)[0])
    return np.asarray(scale * np.linalg.lstsq(system, scale * right_side, rcond=None)[0])


def _pseudo_inverse(matrix: np.ndarray, negligible: float) -> tuple[np.ndarray, np.ndarray]:
    """Pseudo-inverse (k, k) of a symmetric matrix without negative eigenvalues, and its range, orthonormal."""
    values, vectors = np.linalg.eigh(matrix)
    nonzero = values > negligible * np.max(values, initial=0.0)
    basis = vectors[:, nonzero]
    return basis / values[nonzero] @ basis.T, basis


def _null_space(jacobian: np.ndarray) -> np.ndarray:
    """Orthonormal basis (n, f) of the motions that constraints (k, n) allow."""
    if not np.any(jacobian):
        return np.eye(jacobian.shape[1])
    _, singular, vectors = np.linalg.svd(jacobian)
    return np.asarray(vectors[int(np.sum(singular > NEGLIGIBLE * np.max(singular))) :].T)
