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
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.eigenproblems.orthonormal import without

__all__ = ["DefectForm", "allowed", "defect_form", "factor", "held_rigidly", "over_omega"]
__all__ += ["start_form", "struck_defects"]


@dataclass(frozen=True)
class DefectForm:
    """The maps to defects from level l to level m: (1, xi_l, s) to d, (xi'_l, s') to w / Omega.

    matrix, offset, velocity_matrix: T, c and T' of s and s'.
    """

    displaced: np.ndarray
    moving: np.ndarray
    matrix: np.ndarray
    offset: np.ndarray
    velocity_matrix: np.ndarray

    def squares(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return |defect|^2 (k,) between states (2, k, >= n) before and after an instant."""
        n_after, n = self.matrix.shape
        (x, v), (x_after, v_after) = before[:, :, :n], after[:, :, :n_after]
        changed = x @ self.matrix.T + self.offset - x_after
        slowed = v @ self.velocity_matrix.T - v_after
        d = self.displaced[:, 0] + np.hstack([x, changed]) @ self.displaced[:, 1:].T
        w = np.hstack([v, slowed]) @ self.moving.T
        return np.asarray(np.sum(d * d, axis=1) + np.sum(w * w, axis=1))


def defect_form(transition: Transition, stopped: tuple[int, ...]) -> DefectForm:
    """Return the maps to defects, kept by the level entered: under one load it has one neighbour with given states."""
    before, after = transition.source, transition.target
    key = before.states, stopped
    if key not in after.entries:
        base, held = after.level.base, held_rigidly(after)
        displaced = moved = _motion(transition, transition.matrix, held)
        if transition.velocity_matrix is not transition.matrix or not held.issuperset(stopped):
            moved = allowed(base, held | set(stopped), _motion(transition, transition.velocity_matrix, held))
        rates = factor(over_omega(base, moved[:, 1:]))
        places = (
            factor(displaced) if transition.source.excitation.channels else _factor_beside(displaced, after.level.modes)
        )
        after.entries[key] = DefectForm(places, rates, transition.matrix, transition.offset, transition.velocity_matrix)
    form: DefectForm = after.entries[key]
    return form


def _factor_beside(rows: np.ndarray, modes: int) -> np.ndarray:
    """Return ``factor`` of (rest, modes): the rest is orthogonal to the modes, which are orthonormal."""
    m, columns = rows.shape
    if m < columns:
        return factor(rows)
    result, rest = np.eye(columns), columns - modes
    result[:rest, :rest] = factor(rows[:, :rest])
    return result


def _motion(transition: Transition, matrix: np.ndarray, held: set[int]) -> np.ndarray:
    """Return the maps (m, 1 + n_l + n_m) from (1, xi_l, s) to motions that the rigid links ``held`` allow.

    matrix: T, or T'.
    """
    before, after = transition.source, transition.target
    source, target = before.level.vectors, after.level.vectors
    n = source.shape[1]
    columns = np.empty((1 + n + target.shape[1], len(source)))  # one after the other, as a factor is formed of them
    columns[0] = before.asymptotic.configuration - after.asymptotic.configuration - target @ transition.offset
    rest = np.dot(matrix.T, target.T, out=columns[1 : n + 1])
    np.subtract(source.T, rest, out=rest)
    columns[: n + 1] = allowed(after.level.base, held, columns[: n + 1].T).T
    columns[n + 1 :] = target.T if before.excitation.channels == 0 else allowed(after.level.base, held, target).T
    return columns.T


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
