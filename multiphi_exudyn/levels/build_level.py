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
from multiphi_exudyn.levels.modal_base import INTERLACING, ModalBase
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.eigenproblems.modes import turned
from multiphi_exudyn.mathematics.eigenproblems.orthonormal import least_squares, orthonormal
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["build_level", "independent"]

UNDAMPED = 1e-12  # of the largest damping: round-off of projecting it
NEUTRAL = 1e-12  # of mu: an |omega^2| below it is round-off of zero
ALMOST = 0.99  # of a direction's square: one of which others have less does not follow from them


def build_level(base: ModalBase, indices: tuple[int, ...], modes: int | None = None) -> Level:
    """The level with these contacts closed, with its lowest ``modes`` modes at least, None for all that it has."""
    closed = list(indices)
    closed_directions = base.closed_at(indices)
    following = _following(base, [i for i in closed if base.links[i].rigid])
    turned, _ = closed_directions.orthogonal
    squares, vectors, accuracy = level_modes(base, turned, modes)
    rigid_body = _rigid_body_modes(base, turned)
    if rigid_body:
        squares[np.argsort(np.abs(squares), kind="stable")[:rigid_body]] = 0.0
    if accuracy:
        squares[np.abs(squares) <= NEUTRAL * accuracy] = 0.0
    squares, vectors, seen = _turned(base, squares, vectors, closed)
    _check_interlacing(base, squares, closed_directions, accuracy)
    gap_rows = drop_round_off(seen[: len(base.links)], base.lengths[:, None])  # of a mode all components have some
    if following.any():
        gap_rows[following] = 0.0  # by definition, whatever a soft mode leaves
    damped = base.damped(vectors, closed)
    forces, rates = _force_rows(base, closed, squares, vectors, damped, gap_rows[closed])
    zero = squares == 0
    return Level(
        closed=tuple(base.links[i].name for i in closed if i not in base.laws),
        indices=indices,
        base=base,
        squares=squares,
        vectors=vectors,
        damping=_projected_damping(base, closed, zero, vectors, damped),
        gap_rows=gap_rows,
        following=following,
        speed_rows=gap_rows,
        force_rows=forces,
        force_rate_rows=rates,
        neutral=vectors[:, zero] if np.count_nonzero(zero) > rigid_body else vectors[:, :0],
        computed=squares,
        kept_beyond=0,
    )


def _turned(
    base: ModalBase, squares: np.ndarray, vectors: np.ndarray, closed: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Modes of a level with signs and clusters chosen by contacts, then points, then the base's own modes.

    And what contacts and points see of them. Of zero-frequency modes those that nothing damps come first: they drift
    for ever, the others come to rest.
    """
    rows, sizes = base.seen
    if squares.all():
        return turned(squares, vectors, rows, sizes)
    free = np.flatnonzero(squares == 0)
    squares, vectors, seen = squares.copy(), vectors.copy(), np.empty((len(rows), len(squares)))
    resisted, rotation = np.linalg.eigh(vectors[:, free].T @ base.damped(vectors[:, free], closed))
    drifting = int(np.sum(resisted <= UNDAMPED * base.largest_damping(closed)))
    if 0 < drifting < len(free):
        vectors[:, free] = vectors[:, free] @ rotation
    for part in (free[:drifting], free[drifting:], np.flatnonzero(squares)):
        squares[part], vectors[:, part], seen[:, part] = turned(squares[part], vectors[:, part], rows, sizes)
    return squares, vectors, seen


def _force_rows(
    base: ModalBase,
    closed: list[int],
    squares: np.ndarray,
    vectors: np.ndarray,
    damped: np.ndarray,
    gap_rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Contact forces of the closed contacts from eta and eta', (k, r) each; gap_rows (k, r): theirs."""
    rigid = [base.links[i].rigid for i in closed]
    forces, rates = base.restoring[:, closed, None] * gap_rows
    if any(rigid):
        directions = base.directions[:, closed]
        pinned = directions[:, rigid]
        forces[rigid] = _reaction_rows(base, pinned, squares, vectors, directions @ forces)
        rates[rigid] = least_squares(pinned, damped)
    return forces, rates


def _projected_damping(
    base: ModalBase, closed: Sequence[int], free: np.ndarray, vectors: np.ndarray, damped: np.ndarray
) -> np.ndarray:
    """D (r, r); on a zero-frequency mode round-off of no damping would be a damping of its own.

    free: (r,) whether its frequency is zero. damped: C_l Phi_l.
    """
    projected: np.ndarray = vectors.T @ damped
    if not free.any():
        return projected
    negligible = np.abs(projected) <= UNDAMPED * base.largest_damping(closed)
    projected[negligible & (free[:, None] | free[None, :])] = 0.0
    return projected


def independent(base: ModalBase, rigid: Sequence[int]) -> bool:
    """Whether none of these rigid contacts follows from the others, so that they can be closed together."""
    return not len(rigid) or _told_apart(base, orthonormal(base.units[:, list(rigid)])[1])


def _told_apart(base: ModalBase, triangle: np.ndarray) -> bool:
    """Whether directions of length one are independent; triangle: R (k, k) of them."""
    left = np.abs(np.diagonal(triangle))
    return triangle.shape[1] <= base.modes.count and bool(np.min(left) > INDEPENDENT)


def _following(base: ModalBase, held: Sequence[int]) -> np.ndarray:
    """Which contacts (c,) follow from these rigid ones, which are independent: their gaps do not move."""
    units = base.units
    if not len(held):
        return base.lengths == 0
    q, triangle = orthonormal(units[:, list(held)])
    if not _told_apart(base, triangle):
        names = ", ".join(base.links[i].name for i in held)
        raise NumericalFailure(f"level: rigid contacts {names} are not independent of each other")
    along = q.T @ units
    almost = (along * along).sum(axis=0) > ALMOST
    almost[list(held)] = False  # of themselves nothing is left
    following = base.lengths == 0
    following[list(held)] = True
    if almost.any():
        left = units[:, almost] - q @ along[:, almost]
        following[almost] |= np.linalg.norm(left, axis=0) <= INDEPENDENT
    return following


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
    total = base.squares + np.abs(squares)[:, None]  # a row for every mode, as vectors stand in memory
    if not total[:, 0].all():
        smallest = np.min(np.where(total > 0, total, np.inf), axis=1, initial=np.inf, keepdims=True)
        total = np.where(total > 0, total, np.where(np.isinf(smallest), 1.0, smallest))
    residuals = (base.squares - squares[:, None]) * vectors.T - spring_forces.T
    if pinned.shape[1] == 1:
        along = pinned[:, 0]
        return np.asarray((residuals / total @ along) / (along * along / total).sum(axis=1))[None, :]
    roots = 1 / np.sqrt(total)
    q, r = np.linalg.qr(roots[:, :, None] * pinned)
    given = np.einsum("ijk,ij->ik", q, roots * residuals)
    return np.asarray(np.linalg.solve(r, given[:, :, None])[:, :, 0].T)


def _check_interlacing(
    base: ModalBase, squares: np.ndarray, closed_directions: ClosedDirections, accuracy: float
) -> None:
    """Refuse omega^2 (r,) that the theorem in the module's docstring forbids."""
    stiffness, slack = closed_directions.stiffness.tolist(), INTERLACING * accuracy
    stiffening, softening = sum(k > 0 for k in stiffness), sum(k < 0 for k in stiffness)
    below, above = base.square_bounds
    below, above = below[: len(squares) - softening], above[stiffening : len(squares) + stiffening]
    if slack:
        below, above = below - slack, above + slack
    if not ((squares[softening:] >= below).all() and (squares[: len(above)] <= above).all()):
        raise NumericalFailure(
            "level: its modes are not accurate (interlacing violated); are units and magnitudes of mass and stiffness "
            "right?"
        )
