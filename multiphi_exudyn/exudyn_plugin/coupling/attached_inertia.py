"""Attached inertia: masses and constraints of the system that hang on points of a body take part in its impacts.

    min |dv|^2 + dw.M_a dw,   dw = R dv = U u,   H (v + dv) >= 0

v (r,) the modal velocity of the body, R v (m,) that of its points, M_a (m, m) the inertia they carry and the columns of
U (m, k) the velocities that constraints leave them (system_matrices.py), H the contacts that touch. An impulse i on the
body then gives it

    dv = B i,   B = 1 - R^T X R,   X (R R^T + M_a^-1) = 1 where nothing is held,

-X R i of it goes back through the points, and what a level's modes miss of R v by e (m,) takes -R^T X e to mend. The
accelerations of contacts at rest obey the same law. A contact that cannot move for what is attached stays open at its
stop, without a force, as one does which the closed ones hold (events/rule.py).
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import State
from multiphi_exudyn.events.transition import LoadedLevel, Transition, nearest_admissible
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import ForcedRule, InLevel
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.least_distance import Infeasible

__all__ = ["AttachedInertia", "AttachedRule", "Reactions"]

IMMOVABLE = 1e-11  # of a contact's mobility: below it what is attached holds it


@dataclass(frozen=True)
class AttachedInertia:
    """mass: M_a (m, m). free: U (m, k), orthonormal."""

    mass: np.ndarray
    free: np.ndarray

    def impedance(self, rows: np.ndarray) -> np.ndarray:
        """X (m, m) beside a body whose points have the rows R (m, r)."""
        own = rows @ rows.T
        held = self._held / (np.linalg.norm(own) or 1.0)
        carried, moved = np.hstack([self.mass @ self.free, held]), np.hstack([self.free, np.zeros_like(held)])
        return np.asarray(carried @ np.linalg.pinv(moved + own @ carried))  # held may be what no mode moves

    @functools.cached_property
    def _held(self) -> np.ndarray:
        """What constraints hold (m, m - k), orthonormal."""
        m, k = self.free.shape
        return np.linalg.svd(self.free)[0][:, k:] if k else np.eye(m)

    def reactions(self, rows: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """Impulses (m, k) on the body's points that follow impulses (r, k) on it."""
        return -self.impedance(rows) @ (rows @ impulses)

    def mobilities(self, directions: np.ndarray, in_base: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left of the mobility of contacts, as shares (k,), and W (k, k): W^T (H B H^T) W = diag(shares).

        directions: H^T (b, k). in_base: R (m, b).
        """
        lengths = np.linalg.norm(directions, axis=0)
        moved = directions + in_base.T @ self.reactions(in_base, directions)
        shares, ways = np.linalg.eigh(directions.T @ moved / np.outer(lengths, lengths))
        return shares, ways / lengths[:, None]

    def immovable(self, base: ModalBase, in_base: np.ndarray) -> set[int]:
        """Rigid contacts that cannot move for what is attached."""
        rigid = np.flatnonzero(np.isinf(base.stiffnesses))
        directions = base.directions[:, rigid]
        moved = directions + in_base.T @ self.reactions(in_base, directions)
        left = np.sum(directions * moved, axis=0) <= IMMOVABLE * np.sum(directions**2, axis=0)
        return set(rigid[left].tolist())


class Reactions:
    """Forces on the points of a body that follow from the reactions of closed rigid contacts, at one instant.

    rows: R (m, b) of the points in base coordinates. acceleration: y'' (b,) of the body in the level it is in, where
    the contacts ``closed`` push with the forces ``reactions`` (k,) [N].
    """

    def __init__(
        self,
        attached: AttachedInertia,
        base: ModalBase,
        rows: np.ndarray,
        acceleration: np.ndarray,
        closed: tuple[int, ...],
        reactions: np.ndarray,
    ) -> None:
        self._attached, self._base, self._rows = attached, base, rows
        directions, answers = self._answers(closed)
        pushed = reactions[np.isinf(base.stiffnesses[list(closed)])]
        self._acceleration = acceleration - (directions + rows.T @ answers) @ pushed  # of the body they let go

    def at(self, closed: tuple[int, ...]) -> np.ndarray:
        """The forces (m,) in a level, beside those of a level without closed rigid contacts."""
        directions, answers = self._answers(closed)
        mobility, ways = self._attached.mobilities(directions, self._rows)
        moving = mobility > IMMOVABLE
        pushed = ways[:, moving] @ ((ways[:, moving].T @ (directions.T @ self._acceleration)) / mobility[moving])
        return np.asarray(-answers @ pushed)

    def _answers(self, closed: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """H (b, k) of the closed rigid contacts, and the forces (m, k) that follow unit reactions."""
        directions = self._base.directions[:, [i for i in closed if np.isinf(self._base.stiffnesses[i])]]
        return directions, self._attached.reactions(self._rows, directions)


class AttachedRule(ForcedRule):
    """``ForcedRule`` for a body on whose points ``attached`` hangs; rows_in: R (m, r) by a level's closed contacts.

    in_base: the same (m, b) in base coordinates.
    """

    def __init__(
        self,
        plain: EventRule,
        force_in: InLevel,
        direct_in: InLevel,
        attached: AttachedInertia,
        rows_in: InLevel,
        in_base: np.ndarray,
    ) -> None:
        super().__init__(plain, force_in, direct_in)
        self._attached = attached
        self._rows_in = rows_in
        self._in_base = in_base
        self._immovable = attached.immovable(plain.model.base, in_base)
        self._mobilities = BoundedCache[tuple[int, ...], np.ndarray](plain.model.most_levels)

    def _nearest_of(
        self, level: LoadedLevel, rows: np.ndarray, vector: np.ndarray, sizes: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        root = self._mobilities.get_or_build(level.level.indices, lambda: self._mobility_root(level))
        within, impulses = rows @ root, np.zeros(len(rows))
        moving = np.sum(within**2, axis=1) > IMMOVABLE * np.sum(rows**2, axis=1)
        asked = np.column_stack([within, rows @ vector])[moving]
        terms = np.abs(rows) @ np.abs(vector) + (0.0 if sizes is None else sizes)
        given = np.append(np.zeros(len(vector)), 1.0)
        try:
            moved, impulses[moving] = nearest_admissible(asked, given, len(vector), terms[moving])
        except Infeasible as found:
            raise Infeasible(np.flatnonzero(moving)[found.rows].tolist()) from found
        return vector + root @ moved[:-1], impulses

    def _joining(self, state: State, held: set[int], asking: set[int]) -> set[int]:
        joined = set(held)
        for i in sorted(super()._joining(state, held, asking)):
            if self._movable(sorted(joined | {i})):
                joined.add(i)
        return joined - held

    def _movable(self, rigid: list[int]) -> bool:
        """Whether what is attached leaves each of these contacts a motion that the others do not take."""
        return bool(
            np.min(self._attached.mobilities(self.model.base.directions[:, rigid], self._in_base)[0]) > IMMOVABLE
        )

    def ends(self, closed: tuple[int, ...]) -> tuple[int, ...]:
        """As there, without contacts that cannot move: what is left of their gaps is round-off of the constraints."""
        return tuple(i for i in super().ends(closed) if i not in self._immovable)

    def _mobility_root(self, level: LoadedLevel) -> np.ndarray:
        """F (r, r) of B = F F^T."""
        rows = self._rows_in(level.level.indices)
        impedance = self._attached.impedance(rows)
        shares, ways = np.linalg.eigh(np.eye(rows.shape[1]) - rows.T @ (impedance + impedance.T) @ rows / 2)
        return np.asarray(ways * np.sqrt(np.maximum(shares, 0.0)))

    def _map(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        before, after = (self._rows_in(level.level.indices) for level in (source, target))
        return _AttachedTransition(source, target, before, after, self._attached.impedance(after))

    @staticmethod
    def _plastic(lost: float, speeds: np.ndarray, impulses: np.ndarray) -> float:
        return -0.5 * float(impulses @ speeds)


@dataclass(frozen=True)
class _AttachedTransition(Transition):
    """before, after: R (m, r) in source and target. impedance: X of the target."""

    before: np.ndarray
    after: np.ndarray
    impedance: np.ndarray

    @property
    def velocity_matrix(self) -> np.ndarray:
        """eta'_m from eta'_l: what hangs on the points keeps its momentum where modes are left out."""
        missed = self.after @ self.matrix - self.before
        return np.asarray(self.matrix - self.after.T @ (self.impedance @ missed))
