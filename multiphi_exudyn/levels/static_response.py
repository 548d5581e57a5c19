"""Static response: contact forces and configuration under a load, in the coordinates of a base (38.5, with f_static).

    y_e = Omega_e^-2 (f_e + P_e f),   f + K p.y = -G  (rigid: p.y = -gap),   P_0 f + f_0 = 0

P the closed directions, f (d,) the forces along them; e elastic, 0 rigid-body coordinates. Along a single direction
of a structure without rigid-body modes f is a quotient.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.closed_directions import ClosedDirections
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import ZERO, drop_round_off

__all__ = ["Asymptotic", "neutral_response", "static_response"]

NONE = np.zeros((0, 0))  # rigid-body motions of a structure that has none


@dataclass(frozen=True)
class Asymptotic:
    """What a level's modes cannot represent: its state of rest under gaps and static loads.

    configuration: y_inf (m,). gaps: of all links there (l,) [m]. forces: lambda_inf of the closed contacts (k,) [N].
    drive: force (r,) on the zero-frequency modes. load: the static load's modal force Phi_l^T f (r,). strain,
    potential: strain energy of y_inf [J], and the same less f.y_inf.
    """

    configuration: np.ndarray
    gaps: np.ndarray
    forces: np.ndarray
    drive: np.ndarray
    load: np.ndarray
    strain: float
    potential: float


def static_response(
    base: ModalBase, closed_directions: ClosedDirections, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (d,) along closed directions and configuration y (m,) at rest, motion nobody resists left out."""
    if len(closed_directions.stiffness) == 1 and not base.modes.rigid:
        along, configuration = np.ascontiguousarray(closed_directions.vectors[:, 0]), np.empty(len(load))
        stiffness, offset = float(closed_directions.stiffness[0]), float(closed_directions.offsets[0])
        force = bend(along, base.compliance, np.array(load, float), configuration, stiffness, offset, len(load))
        if math.isfinite(force):
            return np.array([force]), configuration
    turned, mixing = closed_directions.orthogonal
    forces, configuration = _response(base, turned, load)
    if turned is not closed_directions:
        forces[closed_directions.rigid] = np.linalg.solve(mixing, forces[closed_directions.rigid])
    return forces, configuration


@compiled
def bend_one(
    along: Numbers, compliance: Numbers, load: Numbers, result: Numbers, stiffness: float, offset: float, m: int
) -> float:
    """The force along one direction p (m,), and y (m,) as the result; infinite or no number where it has no answer.

    As ``_response`` for one direction, the force corrected once by what soft modes have magnified.
    """
    sprung = 1.0 if stiffness != 0.0 else 0.0
    own, bent, pressed = 1.0 / stiffness if stiffness != 0.0 else 1.0, 0.0, 0.0
    for i in range(m):
        bent += along[i] * (compliance[i] * along[i])
        pressed += load[i] * (compliance[i] * along[i])
    flexibility = own + sprung * bent
    if flexibility == 0.0:
        return math.inf
    force, left = (-offset - sprung * pressed) / flexibility, 0.0
    for i in range(m):
        pushed = along[i] * force
        total = load[i] + pushed
        if abs(total) <= ZERO * (abs(load[i]) + abs(pushed)):
            total = 0.0
        result[i] = compliance[i] * total
        left += along[i] * result[i]
    further = -(offset + own * force + sprung * left) / flexibility
    for i in range(m):
        result[i] += compliance[i] * along[i] * further
    return force + further


bend = entry(bend_one)


def neutral_response(
    base: ModalBase, closed_directions: ClosedDirections, neutral: np.ndarray, total: np.ndarray, closed: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(f, y, what drives zero-frequency modes) where springs cancel the stiffness of modes ``neutral`` (m, z) exactly.

    closed: names of the closed contacts.
    """
    if np.any(closed_directions.rigid):
        raise NumericalFailure(
            f"level {', '.join(closed)}: negative stiffness cancels that of a mode beside closed rigid contacts, so "
            "there is no state of rest"
        )
    pushing = total - closed_directions.vectors @ closed_directions.constants
    _, found = static_response(base, closed_directions, total - neutral @ (neutral.T @ pushing))
    configuration = found - neutral @ (neutral.T @ found)
    return (
        -closed_directions.constants - closed_directions.stiffness * (closed_directions.vectors.T @ configuration),
        configuration,
        pushing,
    )


def _response(base: ModalBase, closed_directions: ClosedDirections, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``static_response`` where the directions of rigid contacts are orthogonal."""
    rigid, compliance, offsets = base.modes.rigid, base.compliance, closed_directions.offsets
    vectors, touching, pressing = closed_directions.vectors, closed_directions.vectors[rigid:], load[rigid:]
    sprung = closed_directions.stiffness != 0  # the others push with G, whatever y is
    own, carried = 1 / np.where(sprung, closed_directions.stiffness, 1.0), _carried(base, closed_directions)
    bent = (compliance * touching.T).T
    solved = _solver(touching.T @ bent, own, sprung, vectors[:rigid].T @ carried)
    forces, moved = solved(-offsets - sprung * (pressing @ bent), -(load[:rigid] @ carried))
    total = drop_round_off(pressing + touching @ forces, np.abs(pressing) + np.abs(touching) @ np.abs(forces))
    configuration = _above(carried, moved, compliance * total)
    left = offsets + own * forces + sprung * (configuration @ vectors)
    further, moved = solved(-left, np.zeros(len(moved)))  # what soft modes magnified
    return forces + further, configuration + _above(carried, moved, bent @ further)


def _carried(base: ModalBase, closed_directions: ClosedDirections) -> np.ndarray:
    """Orthonormal basis (rigid, .) of the rigid-body motions that closed contacts resist."""
    rigid = base.modes.rigid
    if not rigid:
        return NONE
    return _range(closed_directions.resisting[:rigid], INDEPENDENT * closed_directions.size)


def _above(carried: np.ndarray, moved: np.ndarray, elastic: np.ndarray) -> np.ndarray:
    """Rigid-body motions that contacts resist, above elastic coordinates."""
    return np.concatenate([carried @ moved, elastic]) if len(carried) else elastic


Solver: TypeAlias = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def _solver(bent: np.ndarray, own: np.ndarray, sprung: np.ndarray, coupling: np.ndarray) -> Solver:
    """f (d,), z (k,) of [[S bent + own, S coupling], [coupling^T, 0]] (f, z) = (a, b) from a (d,) and b (k,), S 0 or 1.

    Scaled by the sizes of the unknowns, and of the rows: pivots then do not hang on units. The smallest solution where
    the matrix is singular: springs that cancel, under a load they allow.
    """
    d = len(own)
    sizes = _sizes(bent.diagonal() + sprung * np.abs(own), coupling)
    matrix = np.zeros((d + coupling.shape[1],) * 2)
    matrix[:d, :d], matrix[:d, d:], matrix[d:, :d] = sprung[:, None] * bent, sprung[:, None] * coupling, coupling.T
    matrix.flat[: d * (len(matrix) + 1) : len(matrix) + 1] += own
    matrix *= sizes
    lengths = np.abs(matrix).max(axis=1, initial=0.0)
    rows = 1 / np.where(lengths > 0, lengths, 1.0)
    scaled = rows[:, None] * matrix

    def solved(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        given = rows * np.concatenate([a, b])
        try:
            found = sizes * np.linalg.solve(scaled, given)
        except np.linalg.LinAlgError:
            found = sizes * np.linalg.lstsq(scaled, given, rcond=None)[0]
        return found[:d], found[d:]

    return solved


def _sizes(flexibilities: np.ndarray, coupling: np.ndarray) -> np.ndarray:
    """Of the unknowns (d + k,), to which rows and columns are scaled."""
    forces = 1 / np.sqrt(np.where(flexibilities > 0, flexibilities, 1.0))
    if not coupling.size:
        return np.concatenate([forces, np.ones(coupling.shape[1])])
    largest = float(np.max(np.abs(forces[:, None] * coupling))) or 1.0
    return np.concatenate([forces, np.full(coupling.shape[1], 1 / largest)])


def _range(matrix: np.ndarray, negligible: float) -> np.ndarray:
    """Orthonormal basis of the column space, singular values up to ``negligible`` taken for zero."""
    if matrix.size == 0:
        return np.zeros((matrix.shape[0], 0))
    left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, singular > negligible]
