"""Building a level: its modes, and the rows by which gaps and contact forces follow from them.

Each direction of positive stiffness added interlaces: omega_i(open) <= omega_i(level) <= omega_i+c(open), one of
negative stiffness downwards; asserted when a level is built.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.closed_directions import ClosedDirections
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.level_modes import level_modes
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.modes import turned
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["build_level", "independent"]

ORTHONORMAL = 1e-10  # |Phi^T M Phi - I| a level may show
INTERLACING = 1e-8  # relative violation of the interlacing theorem that is still round-off
UNDAMPED = 1e-12  # of the largest damping: round-off of projecting it
NEUTRAL = 1e-12  # of mu: an |omega^2| below it is round-off of zero


def build_level(base: ModalBase, indices: tuple[int, ...], modes: int | None = None) -> Level:
    """The level with these contacts closed, with its lowest ``modes`` modes at least, None for all that it has."""
    closed = list(indices)
    closed_directions = base.closed_directions(closed, base.gaps[closed])
    if not independent(base, held := [i for i in closed if base.links[i].rigid]):
        names = ", ".join(base.links[i].name for i in held)
        raise NumericalFailure(f"level: rigid contacts {names} are not independent of each other")
    turned, _ = closed_directions.orthogonal
    squares, vectors, accuracy = level_modes(base, turned, modes)
    rigid_body = _rigid_body_modes(base, turned)
    squares[np.argsort(np.abs(squares), kind="stable")[:rigid_body]] = 0.0
    squares[np.abs(squares) <= NEUTRAL * accuracy] = 0.0
    squares, vectors = _turned(base, squares, vectors, closed)
    zero = squares == 0
    _check(base, squares, vectors, closed_directions, accuracy)
    gap_rows = drop_round_off(base.directions.T @ vectors, base.lengths[:, None])  # of a mode all components have some
    following = _following(base, held)
    gap_rows[following] = 0.0  # by definition, whatever a soft mode leaves
    damped = base.damped(vectors, closed)
    forces, rates = _force_rows(base, closed, squares, vectors, damped, gap_rows[closed])
    return Level(
        closed=tuple(base.links[i].name for i in closed if i not in base.laws),
        indices=indices,
        base=base,
        squares=squares,
        vectors=vectors,
        damping=_projected_damping(base, closed, squares, vectors, damped),
        gap_rows=gap_rows,
        following=following,
        speed_rows=gap_rows,
        force_rows=forces,
        force_rate_rows=rates,
        neutral=vectors[:, zero if np.sum(zero) > rigid_body else np.zeros_like(zero)],
        computed=squares,
        kept_beyond=0,
    )


def _turned(
    base: ModalBase, squares: np.ndarray, vectors: np.ndarray, closed: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Modes of a level with signs and clusters chosen by contacts, then points, then the base's own modes.

    Of zero-frequency modes those that nothing damps come first: they drift for ever, the others come to rest.
    """
    rows, sizes = base.seen
    free = np.flatnonzero(squares == 0)
    if not len(free):
        return turned(squares, vectors, rows, sizes)
    squares, vectors = squares.copy(), vectors.copy()
    resisted, rotation = np.linalg.eigh(vectors[:, free].T @ base.damped(vectors[:, free], closed))
    drifting = int(np.sum(resisted <= UNDAMPED * _largest_damping(base, closed)))
    if 0 < drifting < len(free):
        vectors[:, free] = vectors[:, free] @ rotation
    for part in (free[:drifting], free[drifting:], np.flatnonzero(squares)):
        squares[part], vectors[:, part] = turned(squares[part], vectors[:, part], rows, sizes)
    return squares, vectors


def _force_rows(
    base: ModalBase,
    closed: list[int],
    squares: np.ndarray,
    vectors: np.ndarray,
    damped: np.ndarray,
    gap_rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces of the closed contacts from eta and eta', (k, r) each; gap_rows (k, r): theirs."""
    stiffness, damping = base.stiffnesses[closed], base.dampings[closed]
    rigid = np.isinf(stiffness)
    forces, rates = -np.where(rigid, 0.0, stiffness)[:, None] * gap_rows, -damping[:, None] * gap_rows
    if rigid.any():
        pinned = base.directions[:, closed][:, rigid]
        forces[rigid] = _reaction_rows(base, pinned, squares, vectors, base.directions[:, closed] @ forces)
        rates[rigid] = np.linalg.lstsq(pinned, damped, rcond=None)[0]
    return forces, rates


def _projected_damping(
    base: ModalBase, closed: Sequence[int], squares: np.ndarray, vectors: np.ndarray, damped: np.ndarray
) -> np.ndarray:
    """D (r, r); on a zero-frequency mode round-off of no damping would be a damping of its own. damped: C_l Phi_l."""
    projected: np.ndarray = vectors.T @ damped
    free = squares == 0
    if not free.any():
        return projected
    negligible = np.abs(projected) <= UNDAMPED * _largest_damping(base, closed)
    projected[negligible & (free[:, None] | free[None, :])] = 0.0
    return projected


def _largest_damping(base: ModalBase, closed: Sequence[int]) -> float:
    return float(np.max(np.abs(base.damping_matrix(closed)), initial=0.0))


def independent(base: ModalBase, rigid: Sequence[int]) -> bool:
    """Whether none of these rigid contacts follows from the others, so that they can be closed together."""
    if not len(rigid):
        return True
    pinned = _units(base.directions[:, list(rigid)])
    left = np.abs(np.diagonal(np.linalg.qr(pinned, mode="r")))
    return pinned.shape[1] <= base.modes.count and bool(np.min(left) > INDEPENDENT)


def _following(base: ModalBase, held: Sequence[int]) -> np.ndarray:
    """Which contacts (c,) follow from these rigid ones, which are independent: their gaps do not move."""
    units, (q, _) = _units(base.directions), np.linalg.qr(base.directions[:, list(held)])
    left = units - q @ (q.T @ units)
    return np.asarray(np.linalg.norm(left, axis=0) <= INDEPENDENT)


def _units(directions: np.ndarray) -> np.ndarray:
    """Directions (m, c) as unit vectors, zero where no mode of the base moves a contact."""
    lengths = np.linalg.norm(directions, axis=0)
    return directions / np.where(lengths > 0, lengths, 1.0)


def _rigid_body_modes(base: ModalBase, closed_directions: ClosedDirections) -> int:
    """Rigid-body motions that no closed contact resists."""
    if base.modes.rigid == 0:
        return 0
    rigid = closed_directions.resisting[: base.modes.rigid]
    if rigid.size == 0:
        return base.modes.rigid
    singular = np.linalg.svd(rigid, compute_uv=False)
    return base.modes.rigid - int(np.sum(singular > INDEPENDENT * closed_directions.size))


def _reaction_rows(
    base: ModalBase, pinned: np.ndarray, squares: np.ndarray, vectors: np.ndarray, spring_forces: np.ndarray
) -> np.ndarray:
    """Reaction of every mode: (Omega^2 - omega^2) psi - (force of the springs) = H_r rho, solved for rho (c, r).

    Weighted by 1 / (Omega^2 + |omega^2|), in which no mode of the base outweighs the others.
    """
    squared = base.modes.omega[:, None] ** 2
    total = squared + np.abs(squares)
    smallest = np.min(np.where(total > 0, total, np.inf), axis=0, initial=np.inf)
    weights = 1 / np.where(total > 0, total, np.where(np.isinf(smallest), 1.0, smallest))
    roots = np.sqrt(weights)
    residuals = roots * ((squared - squares) * vectors - spring_forces)
    q, r = np.linalg.qr(roots.T[:, :, None] * pinned)
    given = np.einsum("ijk,ji->ik", q, residuals)
    return np.asarray(np.linalg.solve(r, given[:, :, None])[:, :, 0].T)


def _check(
    base: ModalBase, squares: np.ndarray, vectors: np.ndarray, closed_directions: ClosedDirections, accuracy: float
) -> None:
    """Mass normalisation and interlacing."""
    error = np.max(np.abs(vectors.T @ vectors - np.eye(len(squares))), initial=0.0)
    stiffening, softening = int(np.sum(closed_directions.stiffness > 0)), int(np.sum(closed_directions.stiffness < 0))
    largest = float(base.modes.omega[-1]) ** 2 if base.modes.count else 0.0
    given = base.squares[: len(squares) + stiffening]
    slack = INTERLACING * (given + accuracy) + np.finfo(float).eps * largest
    below, above = (given - slack)[: len(squares) - softening], (given + slack)[stiffening:]
    interlaced = (squares[softening:] >= below).all() and (squares[: len(above)] <= above).all()
    if not (error <= ORTHONORMAL and interlaced):
        raise NumericalFailure(
            f"level: its modes fail their invariants (mass normalisation off by {error:g}, "
            f"interlacing {'holds' if interlaced else 'violated'})"
        )
