"""Building a level: its modes, and the rows by which gaps and contact forces follow from them.

Each direction of positive stiffness added interlaces: omega_i(open) <= omega_i(level) <= omega_i+c(open), one of
negative stiffness downwards; asserted when a level is built.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.closed_directions import ClosedDirections
from multiphi_exudyn.levels.base.modal_base import INTERLACING, ModalBase
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.level.level_modes import level_modes
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled, entry
from multiphi_exudyn.mathematics.complementarity.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.eigenproblems.modes import aligned_modes
from multiphi_exudyn.mathematics.eigenproblems.orthonormal import least_squares, orthonormal
from multiphi_exudyn.mathematics.round_off import drop_round_off

__all__ = ["build_level", "independent"]

UNDAMPED = 1e-12  # of the largest damping: round-off of projecting it
NEUTRAL = 1e-12  # of mu: an |omega^2| below it is round-off of zero
ALMOST = 0.99  # of a direction's square: with a smaller part in the span of others it is independent of them


def build_level(base: ModalBase, indices: tuple[int, ...], modes: int | None = None) -> Level:
    """Return the level with these contacts closed and at least its lowest ``modes`` modes, all of them for None."""
    closed = list(indices)
    closed_directions = base.closed_at(indices)
    following = _following(base, [i for i in closed if base.links[i].rigid])
    orthogonal, _ = closed_directions.orthogonal
    squares, vectors, accuracy = level_modes(base, orthogonal, modes)
    rigid_body = _rigid_body_modes(base, orthogonal)
    if rigid_body:
        squares[np.argsort(np.abs(squares), kind="stable")[:rigid_body]] = 0.0
    if accuracy:
        squares[np.abs(squares) <= NEUTRAL * accuracy] = 0.0
    squares, vectors, row_values = _aligned(base, squares, vectors, closed)
    _check_interlacing(base, squares, closed_directions, accuracy)
    gap_rows = drop_round_off(
        row_values[: len(base.links)], base.lengths[:, None]
    )  # every component of a mode has some
    if following.any():
        gap_rows[following] = 0.0  # exactly, whatever round-off a soft mode leaves
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


def _aligned(
    base: ModalBase, squares: np.ndarray, vectors: np.ndarray, closed: Sequence[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return omega^2 and modes of a level, and the displacements (k, r) of contacts and points in each mode.

    Signs, and the modes within a cluster of one frequency, are chosen by contacts, then points, then the modes of the
    base. Undamped zero-frequency modes come first: they drift for ever, damped ones come to rest.
    """
    rows, sizes = base.observed_rows
    if squares.all():
        return aligned_modes(squares, vectors, rows, sizes)
    free = np.flatnonzero(squares == 0)
    squares, vectors, row_values = squares.copy(), vectors.copy(), np.empty((len(rows), len(squares)))
    rates, rotation = np.linalg.eigh(vectors[:, free].T @ base.damped(vectors[:, free], closed))
    drifting = int(np.sum(rates <= UNDAMPED * base.largest_damping(closed)))
    if 0 < drifting < len(free):
        vectors[:, free] = vectors[:, free] @ rotation
    for part in (free[:drifting], free[drifting:], np.flatnonzero(squares)):
        squares[part], vectors[:, part], row_values[:, part] = aligned_modes(
            squares[part], vectors[:, part], rows, sizes
        )
    return squares, vectors, row_values


def _force_rows(
    base: ModalBase,
    closed: list[int],
    squares: np.ndarray,
    vectors: np.ndarray,
    damped: np.ndarray,
    gap_rows: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows (k, r) that give the forces of closed contacts from eta, and those from eta'.

    gap_rows: (k, r) of the closed contacts.
    """
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
    """Return the modal damping matrix D (r, r), with zeros in place of round-off on zero-frequency modes.

    Round-off would damp a mode that has no other damping. free: (r,) bool, zero frequency. damped: C_l Phi_l.
    """
    projected: np.ndarray = vectors.T @ damped
    if not free.any():
        return projected
    negligible = np.abs(projected) <= UNDAMPED * base.largest_damping(closed)
    projected[negligible & (free[:, None] | free[None, :])] = 0.0
    return projected


def independent(base: ModalBase, rigid: Sequence[int]) -> bool:
    """Return whether the directions of these rigid contacts are linearly independent: they can be closed together."""
    return not len(rigid) or _has_full_rank(base, orthonormal(base.units[:, list(rigid)])[1])


def _has_full_rank(base: ModalBase, triangle: np.ndarray) -> bool:
    """Return whether unit directions are linearly independent; triangle: R (k, k) of their QR decomposition."""
    remainders = triangle.diagonal().tolist()
    return triangle.shape[1] <= base.modes.count and all(abs(remainder) > INDEPENDENT for remainder in remainders)


def _following(base: ModalBase, rigid: list[int]) -> np.ndarray:
    """Return for every contact (c,) whether these independent rigid contacts keep its gap constant."""
    following = base.lengths == 0
    if not rigid:
        return following
    units = base.units
    q, triangle = orthonormal(units[:, rigid])
    if not _has_full_rank(base, triangle):
        names = ", ".join(base.links[i].name for i in rigid)
        raise NumericalFailure(f"level: rigid contacts {names} are not independent of each other")
    components = q.T @ units
    almost = np.add.reduce(components * components) > ALMOST
    almost[rigid] = False  # no remainder beside themselves
    following[rigid] = True
    if almost.any():
        remainders = units[:, almost] - q @ components[:, almost]
        following[almost] |= np.linalg.norm(remainders, axis=0) <= INDEPENDENT
    return following


def _rigid_body_modes(base: ModalBase, closed_directions: ClosedDirections) -> int:
    """Return the number of rigid-body motions that no closed contact resists."""
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
    """Return the reactions (c, r) of every mode: (Omega^2 - omega^2) psi - (force of the springs) = H_r rho.

    Weighted by 1 / (Omega^2 + |omega^2|), in which no mode of the base outweighs the others. spring_forces: (m, r).
    """
    (m, r), c = vectors.shape, pinned.shape[1]
    reactions, scratch = np.empty((c, r)), np.empty((c + 2) * m + c * (c + 1))
    modes, forces = np.ascontiguousarray(vectors.T).ravel(), np.ascontiguousarray(spring_forces.T).ravel()
    directions = np.ascontiguousarray(pinned.T).ravel()
    set_reactions(base.squares, squares, modes, forces, directions, reactions.ravel(), scratch, m, r, c)
    return reactions


@compiled
def write_reactions(
    base: Numbers,
    squares: Numbers,
    modes: Numbers,
    forces: Numbers,
    pinned: Numbers,
    reactions: Numbers,
    scratch: Numbers,
    m: int,
    r: int,
    c: int,
) -> None:
    """Set ``_reaction_rows`` (c, r); base: Omega^2 (m,), modes, forces: (r, m), pinned: (c, m).

    By Gram-Schmidt orthogonalisation, in the weighted product. scratch: (c + 2) m + c (c + 1) numbers. A weight of zero
    Omega^2 and omega^2 is the largest other one of its mode.
    """
    weights, residual, columns, triangle = 0, m, 2 * m, (2 + c) * m
    for j in range(r):
        square, smallest = abs(squares[j]), math.inf
        for i in range(m):
            if 0.0 < base[i] + square < smallest:
                smallest = base[i] + square
        for i in range(m):
            total = base[i] + square
            scratch[weights + i] = 1.0 / (total if total > 0.0 else (smallest if smallest < math.inf else 1.0))
            scratch[residual + i] = (base[i] - squares[j]) * modes[j * m + i] - forces[j * m + i]
        for k in range(c * m):
            scratch[columns + k] = pinned[k]
        for k in range(c):
            column, row = columns + k * m, triangle + k * (c + 1)
            length = weighted_product(scratch, weights, column, column, m)
            for p in range(k + 1, c + 1):
                other = columns + p * m if p < c else residual
                scratch[row + p] = weighted_product(scratch, weights, column, other, m) / length
                for i in range(m):
                    scratch[other + i] -= scratch[row + p] * scratch[column + i]
        for k in range(c - 1, -1, -1):
            row = triangle + k * (c + 1)
            value = scratch[row + c]
            for p in range(k + 1, c):
                value -= scratch[row + p] * reactions[p * r + j]
            reactions[k * r + j] = value


@compiled
def weighted_product(numbers: Numbers, weights: int, a: int, b: int, m: int) -> float:
    """Return the sum of w a b over m elements, in two independent sums, which a processor adds up together."""
    even, odd = 0.0, 0.0
    for i in range(0, m - 1, 2):
        even += numbers[weights + i] * numbers[a + i] * numbers[b + i]
        odd += numbers[weights + i + 1] * numbers[a + i + 1] * numbers[b + i + 1]
    if m % 2 == 1:
        even += numbers[weights + m - 1] * numbers[a + m - 1] * numbers[b + m - 1]
    return even + odd


set_reactions = entry(write_reactions)


def _check_interlacing(
    base: ModalBase, squares: np.ndarray, closed_directions: ClosedDirections, accuracy: float
) -> None:
    """Raise NumericalFailure for omega^2 (r,) that violate the interlacing theorem of the module's docstring."""
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
