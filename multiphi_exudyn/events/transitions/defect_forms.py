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

from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.orthonormal import without

__all__ = ["DefectForm", "allowed", "defect_form", "held_rigidly", "over_omega"]


@dataclass(frozen=True)
class DefectForm:
    """The maps to defects from level l to level m, as triangular factors: (1, xi_l, s) to d, (xi'_l, s') to w / Omega.

    transition: T, c and T' of s and s'.
    """

    displaced: np.ndarray
    moving: np.ndarray
    transition: Transition

    def squares(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """Return |defect|^2 (k,) between states (2, k, >= n) before and after an instant."""
        matrix, velocity_matrix = self.transition.matrix, self.transition.velocity_matrix
        n_after, n = matrix.shape
        (x, v), (x_after, v_after) = before[:, :, :n], after[:, :, :n_after]
        changed = x @ matrix.T + self.transition.offset - x_after
        slowed = v @ velocity_matrix.T - v_after
        d = self.displaced[:, 0] + np.hstack([x, changed]) @ self.displaced[:, 1:].T
        w = np.hstack([v, slowed]) @ self.moving.T
        return np.asarray(np.sum(d * d, axis=1) + np.sum(w * w, axis=1))


def defect_form(transition: Transition, stopped: tuple[int, ...]) -> DefectForm:
    """Return the maps to defects, kept by the level entered: under one load it has one neighbour with given states."""
    before, after = transition.source, transition.target
    key = before.states, stopped
    if key not in after.entries:
        after.entries[key] = _defect_form(transition, stopped)
    form: DefectForm = after.entries[key]
    return form


def _defect_form(transition: Transition, stopped: tuple[int, ...]) -> DefectForm:
    before, after = transition.source, transition.target
    source, target, base = before.level.vectors, after.level.vectors, after.level.base
    rest = before.asymptotic.configuration - after.asymptotic.configuration
    held = held_rigidly(after)
    apart = np.column_stack([rest - target @ transition.offset, source - target @ transition.matrix, target])
    slowed = np.column_stack([source - target @ transition.velocity_matrix, target])
    moving = over_omega(base, allowed(base, held | set(stopped), slowed))
    return DefectForm(_triangle(allowed(base, held, apart)), _triangle(moving), transition)


def _triangle(columns: np.ndarray) -> np.ndarray:
    """Return R, upper triangular, with |R z| = |columns z|."""
    return np.asarray(np.linalg.qr(columns, mode="r"))


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
