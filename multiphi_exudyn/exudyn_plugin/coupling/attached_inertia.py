"""Attached inertia: masses and constraints of the system at points of a body, which take part in its impacts.

    min |dv|^2 + dw.M_a dw,   dw = R dv = U u,   H (v + dv) >= 0

v (r,) is the modal velocity of the body, R v (m,) that of its points, M_a (m, m) the inertia attached to them, the
columns of U (m, k) the velocities that constraints leave them (system_matrices.py), H the contacts that touch. An
impulse i on the body then changes its velocity by

    dv = B i,   B = 1 - R^T X R,   X (R R^T + M_a^-1) = 1 without constraints,

and -X R i is the impulse on it at the points. If R v in a new level's modes has an error e (m,), its velocity changes
by -R^T X e. The accelerations of contacts at rest follow the same equation. A contact that attached parts leave no
mobility stays open at its stop without a force, as does one that closed contacts leave none (core/law).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache

__all__ = ["AttachedInertia", "PointInertia", "Reactions"]

KEPT = 16  # impedances: in base coordinates, and in the levels between which a body changes
ROUND_OFF = 1e-15  # of the largest singular value: smaller ones count as zero
RowsIn = Callable[[tuple[int, ...]], np.ndarray]  # R (m, r) by the states of a level


@dataclass(frozen=True)
class AttachedInertia:
    """Inertia attached to points: mass M_a (m, m), and free, the orthonormal columns U (m, k)."""

    mass: np.ndarray
    free: np.ndarray
    _impedances: BoundedCache[tuple[int, bytes], np.ndarray] = field(
        default_factory=lambda: BoundedCache(KEPT), init=False, repr=False, compare=False
    )

    def impedance(self, rows: np.ndarray) -> np.ndarray:
        """X (m, m) for a body whose points have the rows R (m, r); kept, as every force in a step asks for it."""
        return self._impedances.get_or_build((rows.shape[1], rows.tobytes()), lambda: self._impedance(rows))

    def _impedance(self, rows: np.ndarray) -> np.ndarray:
        mobility = rows @ rows.T
        constrained, k = self._constrained / (np.linalg.norm(mobility) or 1.0), self.free.shape[1]
        forces = np.concatenate([self.mass @ self.free, constrained], axis=1)
        velocities = mobility @ forces
        velocities[:, :k] += self.free
        left, sizes, right = np.linalg.svd(velocities)
        nonzero = sizes > ROUND_OFF * np.max(sizes, initial=0.0)  # constraints may act where no mode moves
        return np.asarray((forces @ right[nonzero].T) / sizes[nonzero] @ left[:, nonzero].T)

    @functools.cached_property
    def _constrained(self) -> np.ndarray:
        """Directions (m, m - k) that constraints fix, orthonormal."""
        m, k = self.free.shape
        if k in (0, m):
            return np.eye(m)[:, k:]
        return np.linalg.svd(self.free)[0][:, k:]

    def reactions(self, rows: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """Impulses (m, k) on the points that impulses (r, k) on the body cause."""
        return -self.impedance(rows) @ (rows @ impulses)

    def mobilities(self, directions: np.ndarray, in_base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Remaining mobility of contacts: shares (k,) and W (k, k) with W^T (H B H^T) W = diag(shares).

        directions: H^T (b, k). in_base: R (m, b).
        """
        lengths = np.linalg.norm(directions, axis=0)
        responses = directions + in_base.T @ self.reactions(in_base, directions)
        shares, vectors = np.linalg.eigh(directions.T @ responses / np.outer(lengths, lengths))
        return shares, vectors / lengths[:, None]

    def immovable(self, base: ModalBase, in_base: np.ndarray) -> set[int]:
        """Indices of rigid contacts that the attached inertia leaves no mobility."""
        rigid = _impact_links(base)
        directions = base.directions[:, rigid]
        responses = directions + in_base.T @ self.reactions(in_base, directions)
        immovable = np.sum(directions * responses, axis=0) <= core.IMMOVABLE * np.sum(directions**2, axis=0)
        return set(rigid[immovable].tolist())


class Reactions:
    """Forces on the points of a body that the forces of its elements cause at one instant, by the attached inertia.

    The forces of elements are the reactions of rigid links, pushes, and friction in proportion to pressures (c,) [N].
    rows: R (m, b) of the points in base coordinates. acceleration: y'' (b,) of the body in ``level``, whose links act
    with the forces ``reactions`` (k,) [N].
    """

    def __init__(
        self,
        attached: AttachedInertia,
        base: ModalBase,
        rows: np.ndarray,
        acceleration: np.ndarray,
        level: LoadedLevel,
        reactions: np.ndarray,
        pressures: np.ndarray,
    ) -> None:
        self._attached, self._base, self._rows, self._pressures = attached, base, rows, pressures
        directions, point_reactions = self._point_reactions(level)
        rigid_reactions = reactions[np.isinf(base.stiffnesses[list(level.level.indices)])]
        push, point_push = self._pushes(level)
        by_elements = (directions + rows.T @ point_reactions) @ rigid_reactions + push + rows.T @ point_push
        self._acceleration = acceleration - by_elements  # of the body without these forces

    def at(self, level: LoadedLevel) -> np.ndarray:
        """Forces (m,) in a level, relative to a level without closed rigid links and without pushes."""
        directions, point_reactions = self._point_reactions(level)
        push, point_push = self._pushes(level)
        acceleration = self._acceleration + push + self._rows.T @ point_push
        mobility, vectors = self._attached.mobilities(directions, self._rows)
        moving = mobility > core.IMMOVABLE
        rigid_reactions = vectors[:, moving] @ (
            (vectors[:, moving].T @ (directions.T @ acceleration)) / mobility[moving]
        )
        return np.asarray(point_push - point_reactions @ rigid_reactions)

    def _point_reactions(self, level: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
        """H (b, k) of the closed rigid links, and the forces (m, k) on points that unit reactions cause."""
        rigid = [i for i in level.level.indices if np.isinf(self._base.stiffnesses[i])]
        directions = self._base.directions[:, rigid]
        return directions, self._attached.reactions(self._rows, directions)

    def _pushes(self, level: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
        """Pushes (b,) of elements, and the forces (m,) on points that they cause."""
        push, base = level.alone.excitation.static - level.excitation.static, self._base
        for i in level.rubbing_elements:
            link = next(k for k in base.link_indices[i] if k in base.oblique and k in level.level.indices)
            push = push + (base.pushes[:, link] - base.directions[:, link]) * self._pressures[i]
        return push, self._attached.reactions(self._rows, push)


class PointInertia:
    """Inertia attached to the points of a body during a step, in the modes of its levels (modal_force.py).

    in_base: R (m, b) of the points in base coordinates. rows_in: R (m, r) by the states of a level.
    """

    independence = math.sqrt(core.IMMOVABLE)

    def __init__(self, attached: AttachedInertia, base: ModalBase, in_base: np.ndarray, rows_in: RowsIn) -> None:
        self._attached, self._base, self._in_base, self._rows_in = attached, base, in_base, rows_in

    @functools.cached_property
    def immovable(self) -> set[int]:
        """Indices of contacts without mobility, whose gaps change by round-off of constraints alone."""
        return self._attached.immovable(self._base, self._in_base)

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) with F F^T = B of a level."""
        rows = self._rows_in(states)
        impedance = self._attached.impedance(rows)
        shares, vectors = np.linalg.eigh(np.eye(rows.shape[1]) - rows.T @ (impedance + impedance.T) @ rows / 2)
        return np.asarray(vectors * np.sqrt(np.maximum(shares, 0.0)))

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """Matrix of eta'_m from eta'_l, with which attached masses keep their momentum when modes are truncated."""
        before, after = self._rows_in(source), self._rows_in(target)
        return np.asarray(matrix - after.T @ (self._attached.impedance(after) @ (after @ matrix - before)))

    def joining(self, rows: np.ndarray, difference: np.ndarray) -> np.ndarray:
        """Change -R^T X e (r,) of the modal velocity by an impact after which body and parts move as one at the points.

        rows: R (m, r) of the points. difference: e (m,) of the body's velocities there to those of the attached parts.
        """
        return np.asarray(-rows.T @ (self._attached.impedance(rows) @ difference))

    def directions(self, units: np.ndarray) -> np.ndarray:
        """Vectors (c, b) with products u.B u' for directions u (c, b) of contacts; zero for compliant ones."""
        rigid, reduced = _impact_links(self._base), np.zeros_like(units)
        directions = units[rigid].T
        responses = directions + self._in_base.T @ self._attached.reactions(self._in_base, directions)
        products = directions.T @ responses
        shares, vectors = np.linalg.eigh((products + products.T) / 2)
        reduced_rows = (vectors * np.sqrt(np.maximum(shares, 0.0)))[:, ::-1][:, : units.shape[1]]
        reduced[rigid, : reduced_rows.shape[1]] = reduced_rows
        return reduced


def _impact_links(base: ModalBase) -> np.ndarray:
    """Indices of the links that have impacts: rigid ones without stick position."""
    held = np.array([link.held for link in base.links], bool)
    return np.flatnonzero(np.isinf(base.stiffnesses) & ~held)
