"""Attached inertia: masses and constraints of the system that hang on points of a body take part in its impacts.

    min |dv|^2 + dw.M_a dw,   dw = R dv = U u,   H (v + dv) >= 0

v (r,) the modal velocity of the body, R v (m,) that of its points, M_a (m, m) the inertia they carry and the columns of
U (m, k) the velocities that constraints leave them (system_matrices.py), H the contacts that touch. An impulse i on the
body then gives it

    dv = B i,   B = 1 - R^T X R,   X (R R^T + M_a^-1) = 1 where nothing is held,

-X R i of it goes back through the points, and what a level's modes miss of R v by e (m,) takes -R^T X e to mend. The
accelerations of contacts at rest obey the same law. A contact that cannot move for what is attached stays open at its
stop, without a force, as one does which the closed ones hold (events/decision.py).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.impact import IMMOVABLE
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.levels.modal_base import ModalBase

__all__ = ["AttachedInertia", "PointInertia", "Reactions"]

ROUND_OFF = 1e-15  # of the largest singular value: below it one is zero
RowsIn = Callable[[tuple[int, ...]], np.ndarray]  # R (m, r) by the states of a level


@dataclass(frozen=True)
class AttachedInertia:
    """mass: M_a (m, m). free: U (m, k), orthonormal."""

    mass: np.ndarray
    free: np.ndarray

    def impedance(self, rows: np.ndarray) -> np.ndarray:
        """X (m, m) beside a body whose points have the rows R (m, r)."""
        own = rows @ rows.T
        held, k = self._held / (np.linalg.norm(own) or 1.0), self.free.shape[1]
        carried = np.concatenate([self.mass @ self.free, held], axis=1)
        moved = own @ carried
        moved[:, :k] += self.free
        left, sizes, right = np.linalg.svd(moved)
        kept = sizes > ROUND_OFF * np.max(sizes, initial=0.0)  # held may be what no mode moves
        return np.asarray((carried @ right[kept].T) / sizes[kept] @ left[:, kept].T)

    @functools.cached_property
    def _held(self) -> np.ndarray:
        """What constraints hold (m, m - k), orthonormal."""
        m, k = self.free.shape
        if k in (0, m):
            return np.eye(m)[:, k:]
        return np.linalg.svd(self.free)[0][:, k:]

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
        rigid = _striking(base)
        directions = base.directions[:, rigid]
        moved = directions + in_base.T @ self.reactions(in_base, directions)
        left = np.sum(directions * moved, axis=0) <= IMMOVABLE * np.sum(directions**2, axis=0)
        return set(rigid[left].tolist())


class Reactions:
    """Forces on the points of a body that follow from those of its elements at one instant.

    These are the reactions of rigid links, what elements push, and friction that goes with pressures (c,) [N].
    rows: R (m, b) of the points in base coordinates. acceleration: y'' (b,) of the body in ``level``, where links hold
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
        directions, answers = self._answers(level)
        pushed = reactions[np.isinf(base.stiffnesses[list(level.level.indices)])]
        push, answer = self._push(level)
        held = (directions + rows.T @ answers) @ pushed + push + rows.T @ answer
        self._acceleration = acceleration - held  # of the body they let go

    def at(self, level: LoadedLevel) -> np.ndarray:
        """The forces (m,) in a level, beside those of one without rigid links that hold, and without pushes."""
        directions, answers = self._answers(level)
        push, answer = self._push(level)
        acceleration = self._acceleration + push + self._rows.T @ answer
        mobility, ways = self._attached.mobilities(directions, self._rows)
        moving = mobility > IMMOVABLE
        pushed = ways[:, moving] @ ((ways[:, moving].T @ (directions.T @ acceleration)) / mobility[moving])
        return np.asarray(answer - answers @ pushed)

    def _answers(self, level: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
        """H (b, k) of the rigid links that hold, and the forces (m, k) that follow unit reactions."""
        rigid = [i for i in level.level.indices if np.isinf(self._base.stiffnesses[i])]
        directions = self._base.directions[:, rigid]
        return directions, self._attached.reactions(self._rows, directions)

    def _push(self, level: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
        """What elements push (b,), and the forces (m,) that follow."""
        push, base = level.alone.excitation.static - level.excitation.static, self._base
        for i in level.rubbing_elements:
            link = next(k for k in base.link_places[i] if k in base.oblique and k in level.level.indices)
            push = push + (base.pushes[:, link] - base.directions[:, link]) * self._pressures[i]
        return push, self._attached.reactions(self._rows, push)


class PointInertia:
    """What hangs on the points of a body during a step, as its levels see it (modal_force.py).

    in_base: R (m, b) of the points in base coordinates. rows_in: R (m, r) by the states of a level.
    """

    independence = math.sqrt(IMMOVABLE)

    def __init__(self, attached: AttachedInertia, base: ModalBase, in_base: np.ndarray, rows_in: RowsIn) -> None:
        self._attached, self._base, self._in_base, self._rows_in = attached, base, in_base, rows_in
        self._impedances = dict[tuple[int, ...], np.ndarray]()

    @functools.cached_property
    def held(self) -> set[int]:
        """Contacts that cannot move for what is attached: what is left of their gaps is round-off of constraints."""
        return self._attached.immovable(self._base, self._in_base)

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) of a level's B = F F^T."""
        rows, impedance = self._rows_in(states), self._impedance(states)
        shares, ways = np.linalg.eigh(np.eye(rows.shape[1]) - rows.T @ (impedance + impedance.T) @ rows / 2)
        return np.asarray(ways * np.sqrt(np.maximum(shares, 0.0)))

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """eta'_m from eta'_l: what hangs on the points keeps its momentum where modes are left out."""
        before, after = self._rows_in(source), self._rows_in(target)
        return np.asarray(matrix - after.T @ (self._impedance(target) @ (after @ matrix - before)))

    def directions(self, units: np.ndarray) -> np.ndarray:
        """Vectors (c, b) whose products are u.B u', of the directions u (c, b) of contacts; zero for compliant ones."""
        rigid, found = _striking(self._base), np.zeros_like(units)
        directions = units[rigid].T
        moved = directions + self._in_base.T @ self._attached.reactions(self._in_base, directions)
        products = directions.T @ moved
        shares, ways = np.linalg.eigh((products + products.T) / 2)
        left = (ways * np.sqrt(np.maximum(shares, 0.0)))[:, ::-1][:, : units.shape[1]]
        found[rigid, : left.shape[1]] = left
        return found

    def _impedance(self, states: tuple[int, ...]) -> np.ndarray:
        if states not in self._impedances:
            self._impedances[states] = self._attached.impedance(self._rows_in(states))
        return self._impedances[states]


def _striking(base: ModalBase) -> np.ndarray:
    """Positions of the links that are struck where their links begin to hold."""
    held = np.array([link.held for link in base.links], bool)
    return np.flatnonzero(np.isinf(base.stiffnesses) & ~held)
