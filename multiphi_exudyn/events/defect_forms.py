"""Forms of defects: what a level cannot hold of the motion that comes into it from another one, or from the base.

    d = P (y - Psi eta - y_inf),   w = Q (v - Psi eta')

as in time/defects.py; d and w / Omega are linear in the states before and after, of these maps triangular factors are
kept.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dgeqrf

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.orthonormal import least_squares

__all__ = ["DefectForm", "allowed", "defect_form", "factor", "held_rigidly", "over_omega"]
__all__ += ["struck_defects"]


@dataclass(frozen=True)
class DefectForm:
    """The maps to defects from level to level: (eta, eta_after, 1) to d, (eta', eta'_after) to w / Omega.

    modes: of either level.
    """

    displaced: np.ndarray
    moving: np.ndarray
    modes: tuple[int, int]

    def squares(self, before: np.ndarray, after: np.ndarray) -> np.ndarray:
        """|defect|^2 (k,) between states (2, k, >= r) at an instant."""
        r, s = self.modes
        states = np.concatenate([before[:, :, :r], after[:, :, :s]], axis=2)
        d = states[0] @ self.displaced[:, :-1].T + self.displaced[:, -1]
        w = states[1] @ self.moving.T
        return np.asarray(np.sum(d * d, axis=1) + np.sum(w * w, axis=1))


def defect_form(before: LoadedLevel, after: LoadedLevel, stopped: tuple[int, ...]) -> DefectForm:
    """The maps into a level, which keeps them: under one load a level has one neighbour with given states."""
    key = before.states, stopped
    if key not in after.entries:
        base, source, target = after.level.base, before.level.vectors, after.level.vectors
        held, modes = held_rigidly(after), (source.shape[1], target.shape[1])
        motion = np.empty((len(source), sum(modes) + 1), order="F")
        motion[:, : modes[0]] = source
        np.negative(target, out=motion[:, modes[0] : -1])
        motion[:, -1] = before.asymptotic.configuration - after.asymptotic.configuration
        displaced = allowed(base, held, motion)
        moved = displaced if held.issuperset(stopped) else allowed(base, held | set(stopped), motion)
        moving = over_omega(base, moved[:, :-1])
        rates = factor(moving)
        after.entries[key] = DefectForm(factor(displaced), rates, modes)
    way: DefectForm = after.entries[key]
    return way


def struck_defects(level: LoadedLevel) -> np.ndarray:
    """|w / Omega|^2 (c,) of a rigid contact that an impulse of one strikes and that opens again; nan for others.

    The level's modes turn it into V V^T h, of which Q leaves what is across h and the closed rigid contacts. Unknown
    where contacts rub: their impulse has another direction.
    """
    own, base = level.level, level.level.base
    found, rigid = np.full(len(base.contacts), np.nan), base.struck_alone
    if not len(rigid):
        return found
    held, given = held_rigidly(level), base.directions[:, rigid]
    across, motions = allowed(base, held, given), allowed(base, held, own.vectors)
    moved, lengths = motions @ (own.vectors.T @ given), np.einsum("ij,ij->j", across, across)
    along = np.divide(np.einsum("ij,ij->j", across, moved), lengths, out=np.zeros(len(rigid)), where=lengths > 0)
    left = over_omega(base, moved - across * along)
    found[rigid] = np.einsum("ij,ij->j", left, left)
    return found


def factor(rows: np.ndarray) -> np.ndarray:
    """R with |R z| = |rows z|, upper triangular; the rows are lost."""
    if not rows.size:
        return np.zeros((0, rows.shape[1]))
    found = dgeqrf(rows, overwrite_a=True)[0][: rows.shape[1]]
    return np.asarray(found * _upper(*found.shape))


@functools.lru_cache(maxsize=64)
def _upper(rows: int, columns: int) -> np.ndarray:
    """One on the diagonal and above it, zero below."""
    return np.triu(np.ones((rows, columns)))


def held_rigidly(level: LoadedLevel) -> set[int]:
    """The closed rigid contacts."""
    return {i for i in level.level.indices if level.level.base.links[i].rigid}


def allowed(base: ModalBase, held: set[int], motion: np.ndarray) -> np.ndarray:
    """The part of motions (m, ...) that rigid contacts allow."""
    if not held:
        return motion
    directions = base.directions[:, sorted(held)]
    return motion - directions @ least_squares(directions, motion)


def over_omega(base: ModalBase, motion: np.ndarray) -> np.ndarray:
    """Motions (m, ...) over Omega, zero where that is zero."""
    return np.asarray((motion.T * base.periods).T)
