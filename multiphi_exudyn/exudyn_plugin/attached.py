"""What hangs on points of a body takes part in its impacts: masses and constraints of the system.

    min |v+ - v|^2 + (y+ - y).M_a (y+ - y),   y' = R v,   A v+ >= 0,   y+ - y = U u

v (r,) the modal velocity of the body, y' (m,) that of its points, M_a (m, m) the inertia they carry and the columns of
U (m, k) the velocities that constraints leave them (surroundings.py). An impulse i on the body then gives it

    v+ - v = B i,   B = 1 - R^T X R,   X (A + M_a^-1) = 1,   A = R R^T,

-X R i of it back through the points, and what a level's modes miss of y' by e (m,) takes -R^T X e to mend. The
accelerations of contacts at rest obey the same law. Where nothing is attached X = 0, where all is held B holds it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.base import Base
from multiphi_exudyn.event_rule import EventRule
from multiphi_exudyn.exudyn_plugin.modal_force import ForcedRule
from multiphi_exudyn.recent import Recent
from multiphi_exudyn.transition import LoadedLevel, Transition, nearest_admissible

__all__ = ["Attached", "AttachedRule", "Reactions"]

InLevel = Callable[[tuple[int, ...]], np.ndarray]  # an array by the closed contacts of a level


@dataclass(frozen=True)
class Attached:
    """mass: M_a (m, m). free: U (m, k), orthonormal."""

    mass: np.ndarray
    free: np.ndarray

    def resistance(self, rows: np.ndarray) -> np.ndarray:
        """X (m, m) beside a body whose points have the rows R (m, r)."""
        (carried, moved), own = self._ways, rows @ rows.T
        return np.asarray(carried @ np.linalg.inv(moved + own @ carried))

    @functools.cached_property
    def _ways(self) -> tuple[np.ndarray, np.ndarray]:
        """[M_a U, V] and [U, 0], V (m, m - k) what constraints hold."""
        m, k = self.free.shape
        held = np.linalg.svd(self.free)[0][:, k:] if k else np.eye(m)
        return np.hstack([self.mass @ self.free, held]), np.hstack([self.free, np.zeros((m, m - k))])

    def reactions(self, rows: np.ndarray, impulses: np.ndarray) -> np.ndarray:
        """Impulses (m, k) on the body's points that follow impulses (r, k) on it."""
        return -self.resistance(rows) @ (rows @ impulses)


class Reactions:
    """Forces on the points of a body that follow from the reactions of closed rigid contacts, at one instant.

    rows: R (m, b) of the points in base coordinates. acceleration: y'' (b,) of the body in the level it is in, where
    the contacts ``closed`` push with the forces ``reactions`` (k,) [N].
    """

    def __init__(
        self,
        attached: Attached,
        base: Base,
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
        pressed = directions.T @ (directions + self._rows.T @ answers)
        return np.asarray(-answers @ np.linalg.lstsq(pressed, directions.T @ self._acceleration, rcond=None)[0])

    def _answers(self, closed: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """H (b, k) of the closed rigid contacts, and the forces (m, k) that follow unit reactions."""
        directions = self._base.directions[:, [i for i in closed if np.isinf(self._base.stiffnesses[i])]]
        return directions, self._attached.reactions(self._rows, directions)


class AttachedRule(ForcedRule):
    """``ForcedRule`` for a body on whose points ``attached`` hangs; rows_in: R (m, r) by a level's closed contacts."""

    def __init__(
        self, plain: EventRule, force_in: InLevel, direct_in: InLevel, attached: Attached, rows_in: InLevel
    ) -> None:
        super().__init__(plain, force_in, direct_in)
        self._attached = attached
        self._rows_in = rows_in
        self._mobilities = Recent[tuple[int, ...], np.ndarray](plain.model.most_levels)

    def _nearest(self, level: LoadedLevel, rows: np.ndarray, vector: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        root = self._mobilities.made(level.level.indices, lambda: self._mobility_root(level))
        within = np.column_stack([rows @ root, rows @ vector])
        moved, impulses = nearest_admissible(within, np.append(np.zeros(len(vector)), 1.0), len(vector))
        return vector + root @ moved[:-1], impulses

    def _mobility_root(self, level: LoadedLevel) -> np.ndarray:
        """F (r, r) of B = F F^T."""
        rows = self._rows_in(level.level.indices)
        resistance = self._attached.resistance(rows)
        shares, ways = np.linalg.eigh(np.eye(rows.shape[1]) - rows.T @ (resistance + resistance.T) @ rows / 2)
        return np.asarray(ways * np.sqrt(np.maximum(shares, 0.0)))

    def _map(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        before, after = (self._rows_in(level.level.indices) for level in (source, target))
        return _AttachedTransition(source, target, before, after, self._attached.resistance(after))

    @staticmethod
    def _plastic(lost: float, speeds: np.ndarray, impulses: np.ndarray) -> float:
        return -0.5 * float(impulses @ speeds)


@dataclass(frozen=True)
class _AttachedTransition(Transition):
    """before, after: R (m, r) in source and target. resistance: X of the target."""

    before: np.ndarray
    after: np.ndarray
    resistance: np.ndarray

    @property
    def velocity_matrix(self) -> np.ndarray:
        """eta'_m from eta'_l: what hangs on the points keeps its momentum where modes are left out."""
        missed = self.after @ self.matrix - self.before
        return np.asarray(self.matrix - self.after.T @ (self.resistance @ missed))
