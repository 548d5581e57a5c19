"""Matrices of an Exudyn system at its initial state, in the directions that its constraints leave free.

    q = q_0 + S z,   M = S^T M_q S,  C = S^T C_q S,  K = S^T (K_q + K_g) S

K_q, C_q are Exudyn's tangents, K_g the geometric stiffness (geometric_stiffness.py). Exudyn's tangent of a spring of
coordinates lacks its factors; such a spring is taken out and put in by its row.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.convert.geometric_stiffness import (
    generalised_forces,
    geometric_stiffness,
    static_solver,
)
from multiphi_exudyn.exudyn_plugin.convert.linearisation import Idle, Linearisation
from multiphi_exudyn.exudyn_plugin.convert.matrix_checks import ASYMMETRY, Checked, NoStructure, checked_matrices
from multiphi_exudyn.exudyn_plugin.convert.moved import moved_directions
from multiphi_exudyn.exudyn_plugin.convert.point_rows import coordinate_row
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["forces", "linearised", "projected_matrices"]

SYMMETRISED = 0.005  # of the largest entry: asymmetry that is left out, its forces being looked at after every run


def projected_matrices(mbs: Any) -> tuple[Checked, np.ndarray]:
    """M, K, C in z, (n, n), and the basis S, (n_full, n)."""
    mass, stiffness, damping, basis = _tangents(mbs)
    return checked_matrices(mbs, mass, stiffness, damping, basis, ASYMMETRY), basis


def _tangents(mbs: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """M, K, C (n, n), and S (n_full, n).

    What is round-off of the stiffness that forces give, or of a force over the system's size, is none: it would be a
    frequency, or an instability.
    """
    geared, geometric = _geared_springs(mbs), geometric_stiffness(mbs)
    with _slack(mbs, geared):
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
    for item in geared.values():
        first, second = (coordinate_row(mbs, exu.MarkerIndex(m)) for m in item["markerNumbers"])
        row = (item["factor1"] * second - item["factor0"] * first) @ basis
        stiffness += item["stiffness"] * np.outer(row, row)
        damping += item["damping"] * np.outer(row, row)
    return mass, stiffness, damping, basis


def _moved_matrices(mbs: Any, pushes: np.ndarray) -> tuple[Checked, np.ndarray, Idle | None]:
    """M, K, C in z, S, and the directions that are left out.

    pushes (k, n_full): what may move the system. Where it is no linear structure for the sake of directions in which
    none of them moves it, these are left out.
    """
    mass, stiffness, damping, basis = _tangents(mbs)
    try:
        return checked_matrices(mbs, mass, stiffness, damping, basis, SYMMETRISED), basis, None
    except NoStructure as fault:
        momentum = mass @ (basis.T @ mbs.systemData.GetODE2Coordinates_t(exu.ConfigurationType.Initial))
        directions = moved_directions(mass, stiffness, damping, np.vstack([momentum, pushes @ basis]))
        if directions is None:
            raise
        kept, others = directions
        idle = Idle(basis @ others, basis @ mass @ others, fault.of)
    sizes = np.abs(kept).T @ np.abs(stiffness) @ np.abs(kept)
    mass, stiffness, damping = (kept.T @ matrix @ kept for matrix in (mass, stiffness, damping))
    stiffness, basis = drop_round_off(stiffness, sizes), basis @ kept
    return checked_matrices(mbs, mass, stiffness, damping, basis, SYMMETRISED), basis, idle


def linearised(mbs: Any, time: float, pushes: Sequence[np.ndarray]) -> Linearisation:
    """The system about its initial state, at a time [s], without contacts and loads by functions of time.

    pushes: rows (n_full,) of these contacts and loads.
    """
    data, initial = mbs.systemData, exu.ConfigurationType.Initial
    displacement, velocity = data.GetODE2Coordinates(initial), data.GetODE2Coordinates_t(initial)
    found, basis, idle = _moved_matrices(mbs, np.vstack([forces(mbs, time), *pushes]))
    mass, stiffness, damping = found.mass, found.stiffness, found.damping
    static = basis.T @ forces(mbs, time) + damping @ (basis.T @ velocity)
    largest = _largest_coordinate(mbs)
    return Linearisation(
        mass, damping, stiffness, static, basis, displacement, velocity, time, largest, found.told, idle
    )


def _largest_coordinate(mbs: Any) -> float:
    """Of the system at its initial state, where it stands [m, rad]."""
    kinds = exu.ConfigurationType
    places = (mbs.systemData.GetODE2Coordinates(kind) for kind in (kinds.Reference, kinds.Initial))
    return float(np.max(np.abs(sum(places))))


def _geared_springs(mbs: Any) -> dict[int, dict[str, Any]]:
    """Springs of coordinates with factors, of which Exudyn's tangent does not hold the factors."""
    items = {i: mbs.GetObject(exu.ObjectIndex(i)) for i in range(mbs.systemData.NumberOfObjects())}
    geared = {i: item for i, item in items.items() if (item.get("factor0", 1.0), item.get("factor1", 1.0)) != (1, 1)}
    geared = {
        i: item for i, item in geared.items() if item.get("activeConnector") and "springForceUserFunction" in item
    }
    for item in geared.values():
        if item["springForceUserFunction"]:
            raise MultiPhiValueError(f"spring {item['name']!r}: got a user function and factors, need one of them")
    return geared


@contextmanager
def _slack(mbs: Any, springs: Mapping[int, Mapping[str, Any]]) -> Iterator[None]:
    """Take stiffness and damping from springs and, whatever happens, give them back."""
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
    """Generalised forces at the initial state and a time [s], constraint forces left out, (n_full,)."""
    with static_solver(mbs) as solver:
        mbs.systemData.SetTime(time)
        return generalised_forces(mbs, solver)
