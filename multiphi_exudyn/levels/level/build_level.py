"""Building a level: its modes, and the rows by which gaps and contact forces follow from them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.closed_directions import ClosedDirections
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.level_modes import level_modes
from multiphi_exudyn.levels.level.level_rows import level_rows
from multiphi_exudyn.mathematics.modes import aligned_clusters, cluster_end
from multiphi_exudyn.mathematics.round_off import INDEPENDENT

__all__ = ["build_level", "drop_damping_of_free_modes"]

UNDAMPED = 1e-12  # of the largest damping: round-off of projecting it
NEUTRAL = 1e-12  # of mu: an |omega^2| below it is round-off of zero
NEARLY_NEUTRAL = 1e-7  # of the sum of |stiffnesses| along a mode: to drop a smaller rest costs less than round-off does


def build_level(base: ModalBase, indices: tuple[int, ...], modes: int | None = None) -> Level:
    """Return the level with these contacts closed and at least its lowest ``modes`` modes, all of them for None.

    Its last mode ends a cluster of modes of one frequency.
    """
    closed = list(indices)
    closed_directions = base.closed_at(indices)
    rigid = [i for i in closed if base.links[i].rigid]
    if not base.independent(rigid):
        names = ", ".join(base.links[i].name for i in rigid)
        raise NumericalFailure(f"level: rigid contacts {names} are not independent of each other")
    orthogonal = closed_directions.orthogonal
    rigid_body = _rigid_body_modes(base, orthogonal)
    squares, vectors, accuracy, kept = _lowest_modes(base, orthogonal, modes, len(rigid), rigid_body)
    squares[_cancelled(base, closed, squares, vectors)] = 0.0
    neutral = None
    if not (is_vibrating := np.count_nonzero(squares) == len(squares)):
        squares, vectors = _aligned_free_modes(base, squares, vectors, closed)
        zero = squares == 0
        neutral = vectors[:, zero] if np.count_nonzero(zero) > rigid_body else None
    squares, vectors = squares[:kept].copy(), vectors[:, :kept]  # a view would keep all that was computed
    if is_vibrating:
        squares, vectors = aligned_clusters(squares, vectors, *base.observed_rows)
    rows = level_rows(base, closed, closed_directions.stiffness, squares, vectors, accuracy)
    vectors, damping, gaps = rows.modes.T, rows.damping, rows.gaps
    if not is_vibrating:
        drop_damping_of_free_modes(base, closed, squares == 0, damping)
    return Level(
        closed=tuple(base.links[i].name for i in closed if i not in base.laws),
        indices=indices,
        base=base,
        squares=squares,
        vectors=vectors,
        damping=damping,
        gap_rows=gaps,
        following=rows.following,
        speed_rows=gaps,
        force_rows=rows.forces,
        force_rate_rows=rows.force_rates,
        neutral=vectors[:, :0] if neutral is None else neutral,
        computed=squares,
        kept_beyond=0,
        bending=None,
    )


def _lowest_modes(
    base: ModalBase, closed_directions: ClosedDirections, modes: int | None, constraints: int, rigid_body: int
) -> tuple[np.ndarray, np.ndarray, float, int]:
    """Return ``level_modes``, with omega^2 = 0 of zero-frequency modes, and how many modes the level keeps.

    It keeps all where a method gives all, else the lowest ``modes`` and those that complete their last cluster, for
    which one mode more has to be known. constraints: number of rigid contacts. rigid_body: of rigid-body modes.
    """
    most, beyond = base.modes.count - constraints, 1
    while True:
        requested = modes + beyond if modes is not None and modes + beyond < most else None
        squares, vectors, accuracy = level_modes(base, closed_directions, requested)
        if rigid_body:
            squares[np.argsort(np.abs(squares), kind="stable")[:rigid_body]] = 0.0
        if accuracy:
            squares[np.abs(squares) <= NEUTRAL * accuracy] = 0.0
        kept = len(squares) if modes is None or len(squares) >= most else cluster_end(squares, modes)
        if kept is not None:
            return squares, vectors, accuracy, kept
        beyond *= 2


def _cancelled(base: ModalBase, closed: Sequence[int], squares: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return which modes (r,) are neutral, as negative springs cancel the stiffness along them but for a small rest.

    omega^2 is the sum of the stiffnesses along a mode. Where contacts slide, or rigid ones are closed, a mode is
    neutral only if omega^2 is round-off.
    """
    stiffnesses = base.stiffnesses[closed]
    if np.all(stiffnesses >= 0) or np.any(np.isinf(stiffnesses)) or any(i in base.oblique for i in closed):
        return np.zeros(len(squares), bool)
    return np.asarray(np.abs(squares) <= NEARLY_NEUTRAL * base.stiffness_sizes(closed, vectors))


def _aligned_free_modes(
    base: ModalBase, squares: np.ndarray, vectors: np.ndarray, closed: Sequence[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Return omega^2 and modes with unique bases of equal omega^2, among which are zero-frequency modes.

    They are chosen by contacts, then points, then the modes of the base. Undamped zero-frequency modes come first: they
    drift for ever, damped ones come to rest.
    """
    rows, sizes = base.observed_rows
    free = np.flatnonzero(squares == 0)
    squares, vectors = squares.copy(), vectors.copy()
    rates, rotation = np.linalg.eigh(vectors[:, free].T @ base.damped(vectors[:, free], closed))
    drifting = int(np.sum(rates <= UNDAMPED * base.largest_damping(closed)))
    if 0 < drifting < len(free):
        vectors[:, free] = vectors[:, free] @ rotation
    for part in (free[:drifting], free[drifting:], np.flatnonzero(squares)):
        squares[part], vectors[:, part] = aligned_clusters(squares[part], vectors[:, part], rows, sizes)
    return squares, vectors


def drop_damping_of_free_modes(base: ModalBase, closed: Sequence[int], free: np.ndarray, damping: np.ndarray) -> None:
    """Put zeros in place of round-off in the damping matrix (r, r) of zero-frequency modes, ``free`` (r,).

    Round-off would damp a mode that has no other damping.
    """
    negligible = np.abs(damping) <= UNDAMPED * base.largest_damping(closed)
    damping[negligible & (free[:, None] | free[None, :])] = 0.0


def _rigid_body_modes(base: ModalBase, closed_directions: ClosedDirections) -> int:
    """Return the number of rigid-body motions that no closed contact resists."""
    if base.modes.rigid == 0:
        return 0
    rigid = closed_directions.resisting[: base.modes.rigid]
    if rigid.size == 0:
        return base.modes.rigid
    singular = np.linalg.svd(rigid, compute_uv=False)
    return base.modes.rigid - int(np.sum(singular > INDEPENDENT * closed_directions.size))
