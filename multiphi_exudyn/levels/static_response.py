"""Static response: contact forces and configuration under a load, in the coordinates of a base (38.5, with f_static).

    y_e = Omega_e^-2 (f_e + P_e f),   f + K p.y = -G  (rigid: p.y = -gap),   P_0 f + f_0 = 0

P the closed directions, f (d,) the forces along them; e elastic, 0 rigid-body coordinates.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.closed_directions import ClosedDirections
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["Asymptotic", "neutral_response", "static_response"]


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
    turned, mixing = closed_directions.orthogonal
    forces, configuration = _response(base, turned, load)
    if turned is not closed_directions:
        forces[closed_directions.rigid] = np.linalg.solve(mixing, forces[closed_directions.rigid])
    return forces, configuration


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
    free, touching, pressing = closed_directions.vectors[:rigid], closed_directions.vectors[rigid:], load[rigid:]
    sprung = closed_directions.stiffness != 0  # the others push with G, whatever y is
    own = 1 / np.where(sprung, closed_directions.stiffness, 1.0)
    carried = np.zeros((rigid, 0))
    if rigid:
        carried = _range(closed_directions.resisting[:rigid], INDEPENDENT * closed_directions.size)
    bent = compliance[:, None] * touching
    solved = _solver(touching.T @ bent, own, sprung, free.T @ carried)
    pressed = -offsets - sprung * (bent.T @ pressing)
    forces, moved = solved(pressed, -carried.T @ load[:rigid])
    total = drop_round_off(pressing + touching @ forces, np.abs(pressing) + np.abs(touching) @ np.abs(forces))
    configuration = np.concatenate([carried @ moved, compliance * total])
    left = offsets + own * forces + sprung * (closed_directions.vectors.T @ configuration)
    further, moved = solved(-left, np.zeros(len(moved)))  # what soft modes magnified
    added = np.concatenate([carried @ moved, bent @ further])
    return forces + further, configuration + added


Solver: TypeAlias = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def _solver(bent: np.ndarray, own: np.ndarray, sprung: np.ndarray, coupling: np.ndarray) -> Solver:
    """f (d,), z (k,) of [[S bent + own, S coupling], [coupling^T, 0]] (f, z) = (a, b) from a (d,) and b (k,), S 0 or 1.

    Scaled by the sizes of the unknowns, and of the rows: pivots then do not hang on units. The smallest solution where
    the matrix is singular: springs that cancel, under a load they allow.
    """
    d = len(own)
    if d == 1 and not coupling.size and own[0] + sprung[0] * bent[0, 0] != 0:
        flexibility = own[0] + sprung[0] * bent[0, 0]
        return lambda a, b: (a / flexibility, b)
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
