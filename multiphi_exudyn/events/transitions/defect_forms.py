"""Forms of defects: the part of a motion that a level entered, from another one or from the base, cannot hold.

    d = P (y - Psi eta - y_inf),   w = Q (v - Psi eta')

as in defects.py. From level l to level m the state after is the image of the state before (eq. 38.6), apart from
changes by impacts and by further levels at the same instant:

    s = T xi_l + c - xi_m,   s' = T' xi'_l - xi'_m
    d = P (Psi_l - Psi_m T) xi_l + P (y_l - y_m - Psi_m c) + P Psi_m s
    w = Q (Psi_l - Psi_m T') xi'_l + Q Psi_m s'

Triangular factors of these maps from (1, xi_l, s) and (xi'_l, s') are kept. If s = 0 their first rows and columns are
enough. The factors hold the difference of the levels, so no difference of two states is formed.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgeqrf

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.levels.base.modal_base import LENGTHS, SQUARES, ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.orthonormal import add_direction, remove_direction, without

__all__ = ["DefectForm", "allowed", "defect_form", "factor", "held_rigidly", "over_omega"]
__all__ += ["start_form", "struck_defects"]


@dataclass(frozen=True)
class DefectForm:
    """The maps to defects from level l to level m: (1, xi_l, s) to d, (xi'_l, s') to w / Omega.

    factors: the triangular factors of both maps, one after the other. matrix, offset, velocity_matrix: T, c and T' of s
    and s'.
    """

    factors: np.ndarray
    matrix: np.ndarray
    offset: np.ndarray
    velocity_matrix: np.ndarray

    def squares(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return |defect|^2 (k,) between states (2, k, >= n) before and after an instant."""
        n_after, n = self.matrix.shape
        width = 1 + n + n_after
        displaced = self.factors[: width * width].reshape(width, width)
        moving = self.factors[width * width :].reshape(width - 1, width - 1)
        (x, v), (x_after, v_after) = before[:, :, :n], after[:, :, :n_after]
        changed = x @ self.matrix.T + self.offset - x_after
        slowed = v @ self.velocity_matrix.T - v_after
        d = displaced[:, 0] + np.hstack([x, changed]) @ displaced[:, 1:].T
        w = np.hstack([v, slowed]) @ moving.T
        return np.asarray(np.sum(d * d, axis=1) + np.sum(w * w, axis=1))


def defect_form(transition: Transition, stopped: tuple[int, ...]) -> DefectForm:
    """Return the maps to defects, kept by the level entered: under one load it has one neighbour with given states."""
    before, after = transition.source, transition.target
    key = before.states, stopped
    if key not in after.entries:
        factors = _factors(transition, held_rigidly(after), stopped)
        after.entries[key] = DefectForm(factors, transition.matrix, transition.offset, transition.velocity_matrix)
    form: DefectForm = after.entries[key]
    return form


def _factors(transition: Transition, held: set[int], stopped: tuple[int, ...]) -> np.ndarray:
    """Return the triangular factors of both maps, one after the other.

    Without channels d due to s is a motion in the modes, which are orthonormal, and orthogonal to the rest: the factor
    of that part is one.
    """
    (r, n), m = transition.matrix.shape, len(transition.source.level.vectors)
    width = 1 + n + r
    displaced, moving = _motions(transition, transition.matrix, held)
    if transition.velocity_matrix is not transition.matrix or not held.issuperset(stopped):
        moving = _motions(transition, transition.velocity_matrix, held | set(stopped))[1]
    ones = r if m >= width and not transition.source.excitation.channels else 0
    factors = np.zeros(width * width + (width - 1) ** 2)
    triangles = [_triangle(displaced[: width - ones]).ravel(), _triangle(moving).ravel()]
    copy_triangles(*triangles, factors, m, width, ones)
    return factors


def _triangle(columns: np.ndarray) -> np.ndarray:
    """Return the columns (k, m) of a QR decomposition of columns (k, m), which are overwritten."""
    return np.ascontiguousarray(dgeqrf(columns.T, overwrite_a=True)[0].T) if columns.size else columns


def _motions(transition: Transition, matrix: np.ndarray, held: set[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the maps from (1, xi_l, s) to motions that links ``held`` allow (width, m), and from (xi'_l, s') / Omega.

    matrix: T, or T'.
    """
    before, after = transition.source, transition.target
    source, target, base = before.level.vectors, after.level.vectors, after.level.base
    (m, n), r, c = source.shape, target.shape[1], len(held)
    width, changes_target = 1 + n + r, before.excitation.channels > 0 or held != held_rigidly(after)
    columns = np.empty(((2 * width - 1) + c, m))  # one after the other, as factors are formed of them
    np.dot(matrix.T, target.T, out=columns[1 : n + 1])
    write_motions(
        base.link_numbers, np.array(sorted(held), int), np.ascontiguousarray(source.T).ravel(),
        np.ascontiguousarray(target.T).ravel(), transition.offset, before.asymptotic.configuration,
        after.asymptotic.configuration, columns.ravel(), m, n, r, c, len(base.links), int(changes_target),
    )  # fmt: skip
    return columns[:width], columns[width : 2 * width - 1]


@compiled
def map_to_defects(
    links: Numbers,
    held: Ints,
    source: Numbers,
    target: Numbers,
    offset: Numbers,
    rest: Numbers,
    rest_after: Numbers,
    columns: Numbers,
    m: int,
    n: int,
    r: int,
    c: int,
    count: int,
    changes_target: int,
) -> None:
    """Set the columns of both maps, each a vector (m,), one after the other.

    links: ``ModalBase.link_numbers``, of ``count`` links. source, target: the modes Psi_l (n, m) and Psi_m (r, m).
    columns, of which those of Psi_m T are there before:

        1 column     P (y_l - y_m - Psi_m c)
        n columns    P (Psi_l - Psi_m T)
        r columns    P Psi_m
        n + r        the latter two over Omega
        c            memory: unit vectors of the directions of held links, which P removes

    changes_target: 0 where held links allow Psi_m, so that P does not change it.
    """
    width, basis = 1 + n + r, (1 + 2 * (n + r)) * m
    lengths, periods = count * (m + LENGTHS), count * (m + SQUARES) + m
    for i in range(m):
        columns[i] = rest[i] - rest_after[i]
    for k in range(r):
        for i in range(m):
            columns[i] -= target[k * m + i] * offset[k]
            columns[(1 + n + k) * m + i] = target[k * m + i]
    for j in range(n):
        column = (1 + j) * m
        for i in range(m):
            columns[column + i] = source[j * m + i] - columns[column + i]
    for p in range(c):
        if add_direction(links, held[p] * m, links[lengths + held[p]], columns, basis, m, p) == 1:
            remove_direction(columns, basis + p * m, columns, 0, m, width if changes_target == 1 else 1 + n)
    for j in range(n + r):
        for i in range(m):
            columns[(width + j) * m + i] = columns[(1 + j) * m + i] * links[periods + i]


@compiled
def copy_factors(displaced: Numbers, moving: Numbers, factors: Numbers, m: int, width: int, ones: int) -> None:
    """Copy R of two QR decompositions, columns of m numbers, one matrix after the other, zero before.

    The first one is (width, width), and ``ones`` continue its diagonal. The second one is narrower by one.
    """
    for j in range(width - ones):
        for i in range(min(j + 1, m)):
            factors[i * width + j] = displaced[j * m + i]
    for j in range(width - ones, width):
        factors[j * (width + 1)] = 1.0
    narrow, start = width - 1, width * width
    for j in range(narrow):
        for i in range(min(j + 1, m)):
            factors[start + i * narrow + j] = moving[j * m + i]


write_motions, copy_triangles = entry(map_to_defects), entry(copy_factors)


def start_form(level: LoadedLevel) -> np.ndarray | None:
    """Return (Psi, y_inf) (m, n + 1), with which d = y - Psi xi - y_inf at the start; None if a rigid link holds."""
    return None if held_rigidly(level) else np.column_stack([level.level.vectors, level.asymptotic.configuration])


def struck_defects(level: LoadedLevel) -> np.ndarray:
    """Return |w / Omega|^2 (c,) for a unit impulse on a rigid contact that opens again; nan for other contacts.

    The level's modes map the impulse to V V^T h, of which Q keeps the part orthogonal to h and to the closed rigid
    contacts. It is unknown for contacts with friction, whose impulse has another direction.
    """
    modes, base = level.modal.vectors, level.level.base
    result, rigid = np.full(len(base.contacts), np.nan), base.frictionless_rigid_contacts
    if not len(rigid):
        return result
    held, given = held_rigidly(level), base.directions[:, rigid]
    across, motions = allowed(base, held, given), allowed(base, held, modes)
    moved, lengths = motions @ (modes.T @ given), np.einsum("ij,ij->j", across, across)
    along = np.divide(np.einsum("ij,ij->j", across, moved), lengths, out=np.zeros(len(rigid)), where=lengths > 0)
    left = over_omega(base, moved - across * along)
    result[rigid] = np.einsum("ij,ij->j", left, left)
    return result


def factor(rows: np.ndarray) -> np.ndarray:
    """Return R (n, n), upper triangular, with |R z| = |rows z|; the rows (m, n) are overwritten."""
    n = rows.shape[1]
    square = np.zeros((n, n))
    if rows.size:
        result = dgeqrf(rows, overwrite_a=True)[0][:n]
        np.multiply(result, _upper(*result.shape), out=square[: len(result)])
    return square


@functools.lru_cache(maxsize=64)
def _upper(rows: int, columns: int) -> np.ndarray:
    """Return ones on and above the diagonal, zeros below."""
    return np.triu(np.ones((rows, columns)))


def held_rigidly(level: LoadedLevel) -> set[int]:
    """Return the rigid links that hold: closed rigid contacts, and rigid friction that sticks."""
    return {i for i in level.level.indices if level.level.base.links[i].rigid}


def allowed(base: ModalBase, held: set[int], motion: np.ndarray) -> np.ndarray:
    """Return the part of motions (m, ...) that rigid contacts allow."""
    if not held:
        return motion
    return without(base.directions[:, sorted(held)], motion)


def over_omega(base: ModalBase, motion: np.ndarray) -> np.ndarray:
    """Return motions (m, ...) over Omega, zero where Omega is zero."""
    return np.asarray((motion.T * base.periods).T)
