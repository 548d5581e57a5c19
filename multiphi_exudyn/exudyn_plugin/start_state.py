"""Start state: the current state of an Exudyn system, moved to where its constraints are met.

    M dq = C^T a,   g(q_0 + dq, t_0) = 0          M dv = C^T b,   C (v_0 + dv) = -dg/dt

dq and dv are of least norm in M. This is what Exudyn's generalized-alpha solver does in the first steps of a run;
TrapezoidalIndex2 corrects the velocities only.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.matrices import check_finite, check_mass
from multiphi_exudyn.exudyn_plugin.system import (
    Directions,
    constraint_jacobian,
    mass_matrix,
    on_velocities,
    residuals,
    static_solver,
)
from multiphi_exudyn.exudyn_plugin.timed import PrescribedMotion, check_offsets, prescribed_motions

__all__ = ["moved_onto_constraints", "violated_constraints"]

MET = 1e-12  # of the largest coordinate: a smaller shift is round-off
VIOLATED = 1e-6  # of the same: a larger violation is more than the error of a solver
MOST = 20  # iterations of Newton's method


@dataclass(frozen=True, eq=False)
class StartState:
    """A state that meets the constraints.

    shift (n_full,) [m, rad]: dq. violated: the constraints that were violated, by name. motions: what constraints
    prescribe, by index of their objects, or the reason why it is left out.
    """

    shift: np.ndarray
    violated: tuple[str, ...]
    motions: Mapping[int, PrescribedMotion | str]


def moved_onto_constraints(mbs: Any, objects: Sequence[Mapping[str, Any]], time: float) -> StartState:
    """Move the initial and the current state to where the constraints of a time [s] are met."""
    data, kinds = mbs.systemData, exu.ConfigurationType
    check_offsets(mbs, objects, time)
    with static_solver(mbs) as solver:
        data.SetTime(time)
        start, jacobian = data.GetODE2Coordinates(), constraint_jacobian(mbs, solver)
        directions = _directions(mbs, jacobian, mass_matrix(mbs, solver))
        violated = _meet(mbs, solver, directions)
        shift = data.GetODE2Coordinates() - start
        if np.any(shift):
            jacobian = constraint_jacobian(mbs, solver)
            directions = Directions(jacobian, directions.mass)
        motions = prescribed_motions(mbs, solver, objects, time, directions)
        present = [motion for motion in motions.values() if isinstance(motion, PrescribedMotion)]
        velocity = _consistent_velocity(mbs, solver, jacobian, directions, present)
    for kind in (kinds.Initial, kinds.Current):
        data.SetODE2Coordinates(start + shift, kind)
        data.SetODE2Coordinates_t(velocity, kind)
    return StartState(shift, tuple(violated), motions)


def violated_constraints(mbs: Any) -> tuple[str, ...]:
    """Names of the constraints on positions that the initial state violates; raise for a coordinate without mass."""
    with static_solver(mbs) as solver:
        jacobian = constraint_jacobian(mbs, solver)
        _directions(mbs, jacobian, mass_matrix(mbs, solver))
        left = np.where(on_velocities(mbs, solver, jacobian), 0.0, residuals(mbs, solver))
        return tuple(_names(mbs, _violated(left, jacobian, VIOLATED * _largest(mbs))))


def _directions(mbs: Any, jacobian: np.ndarray, mass: np.ndarray) -> Directions:
    """Directions of the constraints; raise MultiPhiValueError for values that are not finite, and without mass."""
    bad = np.flatnonzero(~np.all(np.isfinite(jacobian), axis=1))
    if len(bad):
        raise MultiPhiValueError(
            f"mbs: got constraints with a Jacobian that is not finite ({', '.join(_names(mbs, bad))}), need a state "
            "where their directions exist"
        )
    check_finite(mbs, "mass", mass, np.eye(len(mass)))
    directions = Directions(jacobian, mass)
    check_mass(mbs, mass, directions.free)
    return directions


def _meet(mbs: Any, solver: Any, directions: Directions) -> list[str]:
    """Move the current state to where its constraints are met; return the names of those that were violated."""
    data, size, violated = mbs.systemData, _largest(mbs), list[str]()
    jacobian = constraint_jacobian(mbs, solver)
    of_velocity = on_velocities(mbs, solver, jacobian)
    for count in range(MOST):
        left = np.where(of_velocity, 0.0, residuals(mbs, solver))
        step = directions.solve(np.zeros(jacobian.shape[1]), -left)
        size = size if count else max(size, float(np.max(np.abs(step))))
        if np.max(np.abs(step)) <= MET * size:
            break
        violated = violated if count else _names(mbs, _violated(left, jacobian, MET * size))
        data.SetODE2Coordinates(data.GetODE2Coordinates() + step)
        jacobian = constraint_jacobian(mbs, solver)
        directions = Directions(jacobian, directions.mass)
    else:
        raise MultiPhiValueError(
            f"mbs: got constraints that are violated and cannot be met from here ({', '.join(violated)}), need a state "
            "nearer to them"
        )
    others = _names(mbs, _violated(left, jacobian, VIOLATED * size))
    if others:
        raise MultiPhiValueError(
            f"mbs: got constraints that contradict others ({', '.join(others)}), need constraints that can all be met"
        )
    return violated


def _consistent_velocity(
    mbs: Any, solver: Any, jacobian: np.ndarray, directions: Directions, motions: Iterable[PrescribedMotion]
) -> np.ndarray:
    """v_0 + dv (n_full,)."""
    data = mbs.systemData
    velocity, of_velocity = data.GetODE2Coordinates_t(), on_velocities(mbs, solver, jacobian)
    moved = sum((motion.derivative(0.0, 1) @ motion.directions for motion in motions), np.zeros(len(velocity)))
    data.SetODE2Coordinates_t(np.zeros(len(velocity)))
    prescribed = np.where(of_velocity, -residuals(mbs, solver), jacobian @ moved)
    correction = directions.solve(np.zeros(len(velocity)), prescribed - jacobian @ velocity)
    return np.asarray(velocity + correction)


def _violated(left: np.ndarray, jacobian: np.ndarray, allowed: float) -> np.ndarray:
    """Indices of the constraints with residuals that need a larger displacement than allowed [m, rad]."""
    return np.flatnonzero(np.abs(left) > allowed * np.linalg.norm(jacobian, axis=1))


def _largest(mbs: Any) -> float:
    """Largest coordinate of the current state, the reference included [m, rad]."""
    kinds = exu.ConfigurationType
    coordinates = (mbs.systemData.GetODE2Coordinates(kind) for kind in (kinds.Reference, kinds.Current))
    return float(np.max(np.abs(sum(coordinates))))


def _names(mbs: Any, rows: np.ndarray) -> list[str]:
    """Names of the objects that have these constraints; Euler parameters are a constraint of their body."""
    names: list[str] = []
    for i in range(mbs.systemData.NumberOfObjects()):
        index = exu.ObjectIndex(i)
        if set(rows.tolist()) & {int(row) for row in mbs.systemData.GetObjectLTGAE(index)}:
            item = mbs.GetObject(index)
            names.append(f"Object{item['objectType']} {item['name']!r}")
    return names
