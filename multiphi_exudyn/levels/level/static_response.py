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
from multiphi_exudyn.levels.base.closed_directions import ClosedDirections
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.round_off import FOLLOWING, INDEPENDENT, PRODUCT, ZERO, drop_round_off

__all__ = ["Asymptotic", "gaps_and_strain", "response_of_neutral_level", "static_response"]

HARDLY_BENDS = 1e-8  # of the length of a direction, the root of round-off: a correction cannot undo a smaller scale
NONE = np.zeros((0, 0))  # rigid-body motions of a structure that has none
CORRECTIONS = 8  # at most; each takes an error to its product with round-off times the flexibility of the softest mode


@dataclass(frozen=True)
class Asymptotic:
    """Static response of a level to gaps and static loads, x_inf of eq. (38.4).

    configuration: y_inf (m,). gaps: of all links at y_inf (l,) [m], zero where they are round-off. forces: lambda_inf
    of the closed contacts (k,) [N]. drive: modal force (r,) on the zero-frequency modes, zero on the others. load: f
    (m,). strain: strain energy of y_inf [J].
    """

    configuration: np.ndarray
    gaps: np.ndarray
    forces: np.ndarray
    drive: np.ndarray
    load: np.ndarray
    strain: float

    @property
    def potential(self) -> float:
        """Strain energy of y_inf less f.y_inf [J]."""
        return self.strain - float(self.load @ self.configuration)


def static_response(
    base: ModalBase, closed_directions: ClosedDirections, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return forces (d,) along closed directions and y (m,) of the static response, without unresisted motion."""
    if len(closed_directions.stiffness) == 1 and not base.modes.rigid:
        stiffness, offset = float(closed_directions.stiffness[0]), float(closed_directions.offsets[0])
        response = single_direction_response(closed_directions.vectors[:, 0], base.compliance, load, stiffness, offset)
        if response is not None:
            return np.array([response[0]]), response[1]
    forces, configuration = _response(base, closed_directions.orthogonal, load)
    return closed_directions.from_orthogonal(forces), configuration


def single_direction_response(
    along: np.ndarray, compliance: np.ndarray, load: np.ndarray, stiffness: float, offset: float
) -> tuple[float, np.ndarray] | None:
    """Return the force along one direction p (m,) and y (m,); None without a solution.

    The same as ``_response`` for one direction. The force is corrected once for round-off magnified by soft modes.
    """
    deflections, sprung = compliance * along, stiffness != 0.0
    spring_compliance = 1 / stiffness if sprung else 1.0
    flexibility = spring_compliance + sprung * float(along @ deflections)
    if not math.isfinite(flexibility) or flexibility == 0.0:
        return None
    force = (-offset - sprung * float(load @ deflections)) / flexibility
    pushes = along * force
    configuration = compliance * drop_round_off(load + pushes, np.abs(load) + np.abs(pushes))
    correction = -(offset + spring_compliance * force + sprung * float(along @ configuration)) / flexibility
    force += correction
    return (force, configuration + deflections * correction) if math.isfinite(force) else None


def gaps_and_strain(
    base: ModalBase, configuration: np.ndarray, closed: list[int], following: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the gaps (l,) at y (m,), zero where they are round-off, and the strain energy [J].

    That of the structure, of the springs of closed links, and of the constant forces of force laws. following (l,):
    gaps that others determine.
    """
    directions, constants = base.magnitudes
    sums, sizes = base.gaps_at(configuration, base.gaps), directions.T @ np.abs(configuration) + constants
    gaps = np.where(np.abs(sums) > np.where(following, FOLLOWING, ZERO) * sizes, sums, 0.0)
    energy = 0.5 * float(base.squares @ configuration**2 + base.springs[closed] @ gaps[closed] ** 2)
    if base.laws:
        energy += base.energy_offset - float(base.preload @ configuration)
    return gaps, energy


def response_of_neutral_level(
    base: ModalBase, closed_directions: ClosedDirections, neutral: np.ndarray, total: np.ndarray, closed: Sequence[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (f, y, force on zero-frequency modes) where springs cancel the stiffness of modes ``neutral`` (m, z).

    closed: names of the closed contacts.
    """
    if np.any(closed_directions.rigid):
        raise NumericalFailure(
            f"level {', '.join(closed)}: negative stiffness cancels that of a mode beside closed rigid contacts, so "
            "there is no equilibrium"
        )
    driving = total - closed_directions.vectors @ closed_directions.constants
    _, response = static_response(base, closed_directions, total - neutral @ (neutral.T @ driving))
    configuration = response - neutral @ (neutral.T @ response)
    return (
        -closed_directions.constants - closed_directions.stiffness * (closed_directions.vectors.T @ configuration),
        configuration,
        driving,
    )


def _response(base: ModalBase, closed_directions: ClosedDirections, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``static_response`` where the directions of rigid contacts are orthogonal.

    The solution is corrected until it holds: round-off of y is magnified by soft modes, that of f by a direction that
    hardly bends (``_sizes``). What a correction takes back is round-off and becomes zero. The first one judges y by the
    terms of Omega^-2 (f_e + P_e f) too; what that drops of a soft mode's displacement, the next ones give again.
    """
    rigid, compliance, offsets = base.modes.rigid, base.compliance, closed_directions.offsets
    vectors, elastic_vectors, elastic_load = closed_directions.vectors, closed_directions.vectors[rigid:], load[rigid:]
    sprung = closed_directions.stiffness != 0  # the others have the constant force G
    spring_compliance, resisted = (
        1 / np.where(sprung, closed_directions.stiffness, 1.0),
        _resisted_motions(base, closed_directions),
    )
    deflections, coupling = (compliance * elastic_vectors.T).T, vectors[:rigid].T @ resisted
    flexibility, push = elastic_vectors.T @ deflections, load[:rigid] @ resisted
    unknowns = _sizes(base, closed_directions, flexibility.diagonal() + sprung * np.abs(spring_compliance), coupling)
    solve = _solver(flexibility, spring_compliance, sprung, coupling, unknowns)
    forces, rigid_motion = solve(-offsets - sprung * (elastic_load @ deflections), -push)
    terms = np.abs(elastic_load) + np.abs(elastic_vectors) @ np.abs(forces)
    total = drop_round_off(elastic_load + elastic_vectors @ forces, terms)
    configuration = _with_rigid_motion(resisted, rigid_motion, compliance * total)
    sizes_of_forces, summed = np.abs(forces), _with_rigid_motion(resisted, 0.0 * rigid_motion, compliance * terms)
    for passed in range(CORRECTIONS):
        violation = offsets + spring_compliance * forces + sprung * (configuration @ vectors)
        negligible = PRODUCT * (
            np.abs(offsets) + np.abs(spring_compliance * forces) + sprung * (np.abs(configuration) @ np.abs(vectors))
        )
        imbalance = drop_round_off(
            push + forces @ coupling, np.abs(load[:rigid]) @ np.abs(resisted) + np.abs(forces) @ np.abs(coupling)
        )
        if passed and not imbalance.any() and np.all(np.abs(violation) <= negligible):
            break
        correction, rigid_motion = solve(-violation, -imbalance)
        moved = _with_rigid_motion(resisted, rigid_motion, deflections @ correction)
        sizes = np.abs(configuration) + np.abs(moved) + (0.0 if passed else summed)
        sizes_of_forces = sizes_of_forces + np.abs(correction)
        forces, configuration = (
            drop_round_off(forces + correction, sizes_of_forces),
            drop_round_off(configuration + moved, sizes),
        )
    return forces, configuration


def _resisted_motions(base: ModalBase, closed_directions: ClosedDirections) -> np.ndarray:
    """Return an orthonormal basis (rigid, .) of the rigid-body motions that closed contacts resist."""
    rigid = base.modes.rigid
    if not rigid:
        return NONE
    return _range(closed_directions.resisting[:rigid], INDEPENDENT * closed_directions.size)


def _with_rigid_motion(resisted: np.ndarray, rigid_motion: np.ndarray, elastic: np.ndarray) -> np.ndarray:
    """Return coordinates (m,): of the resisted rigid-body motions, then elastic ones."""
    return np.concatenate([resisted @ rigid_motion, elastic]) if len(resisted) else elastic


Solver: TypeAlias = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def _solver(
    flexibility: np.ndarray, spring_compliance: np.ndarray, sprung: np.ndarray, coupling: np.ndarray, sizes: np.ndarray
) -> Solver:
    """Solver for f (d,), z (k,) of [[S F + C, S coupling], [coupling^T, 0]] (f, z) = (a, b), S = 0 or 1.

    Unknowns, by their sizes (d + k,), and rows are scaled, so that pivots do not depend on units. Where springs cancel
    and the matrix is singular, the solution is the shortest one.
    """
    d = len(spring_compliance)
    matrix = np.zeros((d + coupling.shape[1],) * 2)
    matrix[:d, :d], matrix[:d, d:], matrix[d:, :d] = (
        sprung[:, None] * flexibility,
        sprung[:, None] * coupling,
        coupling.T,
    )
    matrix.flat[: d * (len(matrix) + 1) : len(matrix) + 1] += spring_compliance
    matrix *= sizes
    lengths = np.abs(matrix).max(axis=1, initial=0.0)
    rows = 1 / np.where(lengths > 0, lengths, 1.0)
    scaled = rows[:, None] * matrix

    def solve(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        right_side = rows * np.concatenate([a, b])
        try:
            solution = sizes * np.linalg.solve(scaled, right_side)
        except np.linalg.LinAlgError:
            solution = sizes * np.linalg.lstsq(scaled, right_side, rcond=None)[0]
        return solution[:d], solution[d:]

    return solve


def _sizes(
    base: ModalBase, closed_directions: ClosedDirections, flexibilities: np.ndarray, coupling: np.ndarray
) -> np.ndarray:
    """Return the sizes (d + k,) of the unknowns, by which columns are scaled.

    The flexibility of a direction gives its force a size. A rigid direction along which the structure moves as a rigid
    body does not bend: its flexibility is round-off, equilibrium gives its force, and its size is the largest other.
    """
    bends = flexibilities > 0
    if coupling.size:
        vectors = closed_directions.vectors
        length, bent = np.linalg.norm(vectors, axis=0), np.linalg.norm(vectors[base.modes.rigid :], axis=0)
        bends &= ~closed_directions.rigid | (bent > HARDLY_BENDS * length)
    stiffest = float(np.min(flexibilities[bends])) if np.any(bends) else 1.0
    forces = 1 / np.sqrt(np.where(bends, flexibilities, stiffest))
    if not coupling.size:
        return np.concatenate([forces, np.ones(coupling.shape[1])])
    largest = float(np.max(np.abs(forces[:, None] * coupling))) or 1.0
    return np.concatenate([forces, np.full(coupling.shape[1], 1 / largest)])


def _range(matrix: np.ndarray, negligible: float) -> np.ndarray:
    """Return an orthonormal basis of the column space; singular values up to ``negligible`` count as zero."""
    if matrix.size == 0:
        return np.zeros((matrix.shape[0], 0))
    left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, singular > negligible]
