"""Static response: contact forces and configuration under a load, in the coordinates of a base (38.5, with f_static).

    y_e = Omega_e^-2 (f_e + P_e f),   f + K p.y = -G  (rigid: p.y = -gap),   P_0 f + f_0 = 0

P the closed directions, f (d,) the forces along them; e elastic, 0 rigid-body coordinates.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.levels.closed_directions import ClosedDirections
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["static_response"]


def static_response(
    base: ModalBase, closed_directions: ClosedDirections, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (d,) along closed directions and configuration y (m,) at rest, motion nobody resists left out."""
    turned, mixing = closed_directions.orthogonal
    forces, configuration = _response(base, turned, load)
    forces[closed_directions.rigid] = np.linalg.solve(mixing, forces[closed_directions.rigid])
    return forces, configuration


def _response(base: ModalBase, closed_directions: ClosedDirections, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``rest`` where the directions of rigid contacts are orthogonal."""
    elastic, free = slice(base.modes.rigid, None), slice(base.modes.rigid)
    compliance = base.modes.omega[elastic] ** -2.0
    touching = closed_directions.vectors[elastic]
    sprung = closed_directions.stiffness != 0  # the others push with G, whatever y is
    own = np.where(sprung, 1 / np.where(sprung, closed_directions.stiffness, 1.0), 1.0)
    bent = touching.T @ (compliance[:, None] * touching)
    carried = _range(closed_directions.resisting[free], INDEPENDENT * closed_directions.size)
    coupling = closed_directions.vectors[free].T @ carried
    none = np.zeros((carried.shape[1],) * 2)
    matrix = np.block([[sprung[:, None] * bent + np.diag(own), sprung[:, None] * coupling], [coupling.T, none]])
    sizes = _sizes(np.diagonal(bent) + sprung * np.abs(own), coupling)
    pressed = -closed_directions.offsets - sprung * (touching.T @ (compliance * load[elastic]))
    solution = _solved(matrix, np.concatenate([pressed, -carried.T @ load[free]]), sizes)
    forces = solution[: len(own)]
    total = drop_round_off(load[elastic] + touching @ forces, np.abs(load[elastic]) + np.abs(touching) @ np.abs(forces))
    configuration = np.concatenate([carried @ solution[len(own) :], compliance * total])
    left = closed_directions.offsets + own * forces + sprung * (closed_directions.vectors.T @ configuration)
    further = _solved(matrix, np.concatenate([-left, np.zeros(len(none))]), sizes)  # what soft modes magnified
    added = np.concatenate([carried @ further[len(own) :], compliance * (touching @ further[: len(own)])])
    return forces + further[: len(own)], configuration + added


def _sizes(flexibilities: np.ndarray, coupling: np.ndarray) -> np.ndarray:
    """Of the unknowns (d + k,), to which rows and columns are scaled: pivots then do not hang on units."""
    forces = 1 / np.sqrt(np.where(flexibilities > 0, flexibilities, 1.0))
    largest = float(np.max(np.abs(forces[:, None] * coupling), initial=0.0)) or 1.0
    return np.concatenate([forces, np.full(coupling.shape[1], 1 / largest)])


def _solved(matrix: np.ndarray, given: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """The solution, the smallest one where the matrix is singular: springs that cancel, under a load they allow."""
    lengths = np.max(np.abs(matrix * sizes), axis=1, initial=0.0)
    rows = 1 / np.where(lengths > 0, lengths, 1.0)
    scaled, right = rows[:, None] * matrix * sizes, rows * given
    try:
        return np.asarray(sizes * np.linalg.solve(scaled, right))
    except np.linalg.LinAlgError:
        return np.asarray(sizes * np.linalg.lstsq(scaled, right, rcond=None)[0])


def _range(matrix: np.ndarray, negligible: float) -> np.ndarray:
    """Orthonormal basis of the column space, singular values up to ``negligible`` taken for zero."""
    if matrix.size == 0:
        return np.zeros((matrix.shape[0], 0))
    left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, singular > negligible]
