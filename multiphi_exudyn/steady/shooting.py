"""Shooting: states that repeat after whole periods, by Newton's method on the map of a period.

P maps q = (s y, y') at the beginning of a period of the loads to q at its end, s = max(omega, 2 pi / T). A state that
repeats after p periods solves P^p(q) = q:

    (1 - J) dq = P^p(q) - q,   J = dP^p / dq

J by finite differences, in the modes of the level that holds at whole periods. The eigenvalues of J, the multipliers,
say by what small disturbances grow: the state attracts if they lie inside the unit circle. Between events the map is
linear, so that few steps suffice. Source: A. H. Nayfeh, B. Balachandran, Applied Nonlinear Dynamics, 1995, ch. 3, 5.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.simulate import Run
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["ATTRACTS", "PeriodMap", "Shooting"]

MOST_STEPS = 8  # of Newton's method: within one order of events the map is nearly linear,
SHRINKING = 0.5  # and a step longer than this part of the one before shows that it is not
ATTRACTS = 1 - 1e-7  # a multiplier above this cannot be told from 1 by finite differences


@dataclass(frozen=True)
class PeriodMap:
    """Runs over whole periods [s] of the loads."""

    model: MultiPhiModel
    loads: Sequence[Load]
    period: float

    @functools.cached_property
    def scales(self) -> np.ndarray:
        """s (m, 1) [rad/s]."""
        return np.maximum(self.model.base.modes.omega, 2 * math.pi / self.period)[:, None]

    def run(self, x: np.ndarray, v: np.ndarray, periods: int) -> Trajectory:
        """From x, x' (n,) over some periods."""
        return Run(self.model, periods * self.period, x, v, self.loads).trajectory()

    def states(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """q (2 m, k) of x, x' (n, k)."""
        base = self.model.base
        return np.vstack([self.scales * base.coordinates(x), base.coordinates(v)])

    def configuration(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x, x' (n,) of q (2 m,)."""
        m, shapes = len(self.scales), self.model.base.modes.shapes
        return shapes @ (q[:m] / self.scales[:, 0]), shapes @ q[m:]

    def directions(self, closed: tuple[str, ...]) -> np.ndarray:
        """Orthonormal directions of q (2 m, 2 r): modes of the level with these contacts closed, at rest and moving."""
        vectors = self.model.level(closed).vectors
        nothing = np.zeros_like(vectors)
        return np.block([[np.linalg.qr(self.scales * vectors)[0], nothing], [nothing, vectors]])


@dataclass(frozen=True)
class Shooting:
    """Newton's method around a state q (2 m,) along ``directions``; difference: step of the finite differences."""

    map: PeriodMap
    order: int
    directions: np.ndarray
    origin: np.ndarray
    difference: float

    @classmethod
    def around(
        cls, of: PeriodMap, order: int, closed: tuple[str, ...], x: np.ndarray, v: np.ndarray, difference: float
    ) -> Shooting:
        """Around x, x' (n,), a state in the level with these contacts closed."""
        return cls(of, order, of.directions(closed), of.states(x[:, None], v[:, None])[:, 0], difference)

    def attracting(self, tolerance: float, far: float) -> tuple[np.ndarray, np.ndarray, float] | None:
        """x, x' of a state that repeats and attracts, with its largest multiplier in a period; None if there is none.

        tolerance: length of the last step of Newton's method. far: the longest step it may take.
        """
        place, allowed = np.zeros(self.directions.shape[1]), far
        for _ in range(MOST_STEPS):
            reached = self._mapped(place)
            jacobian = None if reached is None else self._jacobian(place, reached)
            if reached is None or jacobian is None:
                return None
            step = np.linalg.lstsq(np.eye(len(place)) - jacobian, reached - place)[0]
            length = float(np.linalg.norm(step))
            if not length <= allowed:
                return None
            place, allowed = place + step, max(SHRINKING * length, tolerance)
            if length <= tolerance:
                largest = float(np.max(np.abs(np.linalg.eigvals(jacobian)))) ** (1 / self.order)
                return (*self._configuration(place), largest) if largest < ATTRACTS else None
        return None

    def _configuration(self, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.map.configuration(self.origin + self.directions @ place)

    def _mapped(self, place: np.ndarray) -> np.ndarray | None:
        """P^p, None where the run fails or cannot start."""
        try:
            trajectory = self.map.run(*self._configuration(place), self.order)
        except MultiPhiValueError:  # a disturbance that leads into a rigid stop
            return None
        if trajectory.status != "ok":
            return None
        end = np.array([trajectory.t_end])
        reached = self.map.states(trajectory.displacement(end), trajectory.velocity(end))[:, 0]
        return np.asarray(self.directions.T @ (reached - self.origin))

    def _jacobian(self, place: np.ndarray, reached: np.ndarray) -> np.ndarray | None:
        columns = []
        for direction in np.eye(len(place)):
            moved = self._mapped(place + self.difference * direction)
            if moved is None:
                return None
            columns.append((moved - reached) / self.difference)
        return np.array(columns).T
