"""System matrices: those of an Exudyn system at its initial state, in the directions that constraints leave free.

    q = q_0 + S z,   M = S^T M_q S,  C = S^T C_q S,  K = S^T (K_q + K_g) S

K_q, C_q are Exudyn's tangents, K_g the geometric stiffness (geometric_stiffness.py). Exudyn's tangent of a spring of
coordinates does not contain its factors, so the matrices of such a spring are computed from its row instead.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.convert.contacts.moved_directions import moved_directions
from multiphi_exudyn.exudyn_plugin.convert.contacts.point_rows import coordinate_row
from multiphi_exudyn.exudyn_plugin.convert.linearisation.geometric_stiffness import (
    generalised_forces,
    geometric_stiffness,
    static_solver,
)
from multiphi_exudyn.exudyn_plugin.convert.linearisation.linearisation import Linearisation, MovedBy, UnmovedDirections
from multiphi_exudyn.exudyn_plugin.convert.linearisation.matrix_checks import (
    ASYMMETRY,
    DIFFERENTIATED,
    CheckedMatrices,
    NotLinearStructure,
    checked_matrices,
)
from multiphi_exudyn.exudyn_plugin.convert.linearisation.prescribed_motion import PrescribedMotion
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["forces", "linearised", "projected_matrices"]

SYMMETRISED = 0.005  # of the largest entry: a skew part that is left out; its forces are checked after every run


def projected_matrices(mbs: Any) -> tuple[CheckedMatrices, np.ndarray]:
    """M, K, C in z, (n, n), and the basis S, (n_full, n)."""
    mass, stiffness, damping, basis = _tangent_matrices(mbs)
    return checked_matrices(mbs, mass, stiffness, damping, basis, ASYMMETRY), basis


def _tangent_matrices(mbs: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """M, K, C (n, n), and S (n_full, n).

    Entries of K that are round-off of the geometric stiffness, or of a force over the system's size, are set to zero:
    they would be a frequency, or an instability. So are entries of C that are round-off beside the fastest rate.
    """
    springs, geometric = _springs_with_factors(mbs), geometric_stiffness(mbs)
    with _without_stiffness(mbs, springs):
        result = mbs.ComputeLinearizedSystem(
            projectIntoConstraintNullspace=True, returnConstraintJacobian=True, returnConstraintNullspace=True
        )
        sizes = np.abs(geometric) + np.max(np.abs(forces(mbs))) / (_largest_coordinate(mbs) or math.inf)
    mass, stiffness, damping = (np.array(matrix) for matrix in result[:3])
    basis = np.asarray(result[4]).T if len(result) > 3 else np.eye(len(mass))
    if basis.shape[1] == 0:
        raise MultiPhiValueError("mbs: got constraints that hold every coordinate, need one that can move")
    stiffness += basis.T @ geometric @ basis
    stiffness = drop_round_off(stiffness, np.abs(basis).T @ sizes @ np.abs(basis))
    for item in springs.values():
        row = _row(mbs, item) @ basis
        stiffness += item["stiffness"] * np.outer(row, row)
        damping += item["damping"] * np.outer(row, row)
    return mass, stiffness, drop_round_off(damping, _fastest(mass, stiffness) * _masses(mass)), basis


def _masses(mass: np.ndarray) -> np.ndarray:
    """sqrt(m_i m_j) (n, n), the sizes of entries of M."""
    roots = np.sqrt(np.maximum(np.diagonal(mass), 0.0))
    return np.outer(roots, roots)


def _fastest(mass: np.ndarray, stiffness: np.ndarray) -> float:
    """Largest rate sqrt(|k| / m) [1/s] of a coordinate by itself."""
    masses, springs = np.diagonal(mass), np.abs(np.diagonal(stiffness))
    return math.sqrt(float(np.max(springs[masses > 0.0] / masses[masses > 0.0], initial=0.0)))


def _row(mbs: Any, spring: Mapping[str, Any]) -> np.ndarray:
    first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in spring["markerNumbers"])
    return np.asarray(spring["factor1"] * second - spring["factor0"] * first)


def _by_motions(mbs: Any, motions: Mapping[int, PrescribedMotion]) -> dict[int, tuple[np.ndarray, ...]]:
    """M e^T, K e^T and C e^T (n_full, k) of prescribed motions, by index; round-off is set to zero."""
    if not motions:
        return {}
    springs, geometric = _springs_with_factors(mbs), geometric_stiffness(mbs)
    with _without_stiffness(mbs, springs):
        mass, stiffness, damping = map(np.array, mbs.ComputeLinearizedSystem()[:3])
    stiffness += geometric
    for item in springs.values():
        row = _row(mbs, item)
        stiffness += item["stiffness"] * np.outer(row, row)
        damping += item["damping"] * np.outer(row, row)
    return {i: tuple(_product(a, m.directions.T) for a in (mass, stiffness, damping)) for i, m in motions.items()}


def _moved_by(
    motion: PrescribedMotion, basis: np.ndarray, momenta: np.ndarray, stiffness: np.ndarray, damping: np.ndarray
) -> MovedBy:
    """Its forces S^T K e^T and S^T C e^T; damping that is an error of differentiation beside the stiffness is zero."""
    stiffness, damping = _product(basis.T, stiffness), _product(basis.T, damping)
    negligible = DIFFERENTIATED * motion.scale * np.max(np.abs(stiffness), axis=0)
    return MovedBy(motion, momenta, stiffness, np.where(np.abs(damping) <= negligible, 0.0, damping))


def _product(matrix: np.ndarray, columns: np.ndarray) -> np.ndarray:
    return drop_round_off(matrix @ columns, np.abs(matrix) @ np.abs(columns))


def _matrices_of_moved_directions(
    mbs: Any, velocity: np.ndarray, forces_on_system: np.ndarray
) -> tuple[CheckedMatrices, np.ndarray, UnmovedDirections | None]:
    """M, K, C in z, S, and the directions that are left out.

    velocity (n_full,): at the start, without that of prescribed motions. forces_on_system (k, n_full): all forces that
    may act. If the matrices are not those of a linear structure because
    of directions in which none of these forces moves the system, these directions are left out.
    """
    mass, stiffness, damping, basis = _tangent_matrices(mbs)
    try:
        return checked_matrices(mbs, mass, stiffness, damping, basis, SYMMETRISED), basis, None
    except NotLinearStructure as fault:
        momentum = mass @ (basis.T @ velocity)
        directions = moved_directions(mass, stiffness, damping, np.vstack([momentum, forces_on_system @ basis]))
        if directions is None:
            raise
        moved, others = directions
        unmoved = UnmovedDirections(basis @ others, basis @ mass @ others, fault.reason)
    sizes = np.abs(moved).T @ np.abs(stiffness) @ np.abs(moved)
    mass, stiffness, damping = (moved.T @ matrix @ moved for matrix in (mass, stiffness, damping))
    stiffness, basis = drop_round_off(stiffness, sizes), basis @ moved
    return checked_matrices(mbs, mass, stiffness, damping, basis, SYMMETRISED), basis, unmoved


def linearised(
    mbs: Any, time: float, rows: Sequence[np.ndarray], motions: Mapping[int, PrescribedMotion]
) -> Linearisation:
    """Linearisation about the initial state, at a time [s], without contacts and loads by functions of time.

    rows: rows (n_full,) of these contacts and loads. motions: by constraints.
    """
    data, initial = mbs.systemData, exu.ConfigurationType.Initial
    displacement, velocity = data.GetODE2Coordinates(initial), data.GetODE2Coordinates_t(initial)
    by_motions = _by_motions(mbs, motions)
    pulls = [column for _, *pair in by_motions.values() for pull in pair for column in pull.T]
    moved_velocity = sum((m.derivative(0.0, 1) @ m.directions for m in motions.values()), np.zeros(len(velocity)))
    present = forces(mbs, time)
    checked, basis, unmoved = _matrices_of_moved_directions(
        mbs, velocity - moved_velocity, np.vstack([present, *rows, *pulls])
    )
    mass, stiffness, damping = checked.mass, checked.stiffness, checked.damping
    moved = {i: _moved_by(motions[i], basis, *matrices) for i, matrices in by_motions.items()}
    static = basis.T @ present + damping @ (basis.T @ (velocity - moved_velocity))
    static += sum((each.damping @ each.motion.derivative(0.0, 1) for each in moved.values()), np.zeros(len(static)))
    largest = _largest_coordinate(mbs)
    return Linearisation(
        mass,
        damping,
        stiffness,
        static,
        basis,
        displacement,
        velocity,
        time,
        largest,
        checked.asymmetries,
        unmoved,
        moved=moved,
    )


def _largest_coordinate(mbs: Any) -> float:
    """Largest coordinate of the initial state, the reference included [m, rad]."""
    kinds = exu.ConfigurationType
    coordinates = (mbs.systemData.GetODE2Coordinates(kind) for kind in (kinds.Reference, kinds.Initial))
    return float(np.max(np.abs(sum(coordinates))))


def _springs_with_factors(mbs: Any) -> dict[int, dict[str, Any]]:
    """Springs of coordinates with factors, which Exudyn's tangent does not contain."""
    items = {i: mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())}
    springs = {i: item for i, item in items.items() if (item.get("factor0", 1.0), item.get("factor1", 1.0)) != (1, 1)}
    springs = {
        i: item for i, item in springs.items() if item.get("activeConnector") and "springForceUserFunction" in item
    }
    for item in springs.values():
        if item["springForceUserFunction"]:
            raise MultiPhiValueError(f"spring {item['name']!r}: got a user function and factors, need one of them")
    return springs


@contextmanager
def _without_stiffness(mbs: Any, springs: Mapping[int, Mapping[str, Any]]) -> Iterator[None]:
    """Set stiffness and damping of springs to zero; they are restored in any case."""
    try:
        for i in springs:
            for name in ("stiffness", "damping"):
                mbs.SetObjectParameter(exu.ObjectIndex(i), name, 0.0)
        yield
    finally:
        for i, item in springs.items():
            for name in ("stiffness", "damping"):
                mbs.SetObjectParameter(exu.ObjectIndex(i), name, item[name])


def forces(mbs: Any, time: float = 0.0) -> np.ndarray:
    """Generalised forces (n_full,) at the initial state and a time [s], without constraint forces."""
    with static_solver(mbs) as solver:
        mbs.systemData.SetTime(time)
        return generalised_forces(mbs, solver)
