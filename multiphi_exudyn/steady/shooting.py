"""Shooting: states that repeat after whole periods, by Newton's method on the map of a period.

P maps a state at the beginning of a period of the loads to the one at its end. A state that repeats after p periods
solves P^p(z) = z:

    (1 - J) dz = P^p(z) - z,   J = dP^p / dz,   z = (s eta, eta', u w),   s = max(omega, 2 pi / T),   u = 2 pi / (T |h|)

eta, eta' in the level that holds at whole periods, w the places that links hold; J by finite differences. The
eigenvalues of J, the multipliers, say by what small disturbances grow: the state attracts if they lie inside the unit
circle. Between events the map is linear, so that few steps suffice.

A link that slips forgets its place: a multiplier is zero. One that never slips keeps it: its multiplier is one, and to
every such place belongs another state that repeats. Those places are no unknowns: they stay what the path that led here
has made them, and their multipliers are left out. Neither are those of links that never hold.

Source: A. H. Nayfeh, B. Balachandran, Applied Nonlinear Dynamics, 1995, ch. 3, 5.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.state import State
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.going_on import stops_moved
from multiphi_exudyn.time.simulate import Run
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["ATTRACTS", "PeriodMap", "Shooting"]

MOST_STEPS = 16  # of Newton's method: within one order of events the map is nearly linear,
SHRINKING = 0.6  # at a double root steps halve; one longer than this part of the one before shows that it is neither
ATTRACTS = 1 - 1e-7  # a multiplier above this cannot be told from 1 by finite differences


@dataclass(frozen=True)
class PeriodMap:
    """Runs over whole periods [s] of the loads."""

    model: MultiPhiModel
    loads: Sequence[Load]
    period: float

    def run(self, start: Trajectory, periods: int) -> Trajectory:
        """From the end of a run, at the beginning of a period, over some periods."""
        return Run(self.model, periods * self.period, loads=self.loads, start=start, rewound=True).trajectory()

    def states(self, trajectory: Trajectory, times: np.ndarray) -> np.ndarray:
        """(s y, y', T / sqrt(k)) (2 m + e, k) at times (k,) [s], T of the e springs in series with friction."""
        base = self.model.base
        scales = np.maximum(base.modes.omega, 2 * math.pi / self.period)[:, None]
        places, rates = base.coordinates(trajectory.displacement(times)), base.coordinates(trajectory.velocity(times))
        springs = ((c.name, friction_spring(c)[2]) for c in self.model.contacts)
        stretched = [trajectory.friction_force(name, times) / math.sqrt(k) for name, k in springs if k]
        return np.vstack([scales * places, rates, *stretched])


@dataclass(frozen=True)
class Shooting:
    """Newton's method around the end of a run; difference: step of the finite differences."""

    map: PeriodMap
    order: int
    start: Trajectory
    difference: float

    def attracting(self, tolerance: float, far: float) -> tuple[Trajectory, float] | None:
        """A run that ends in a state that repeats and attracts, with its largest multiplier in a period; or None.

        tolerance: length of the last step of Newton's method, or of what a period still changes: where the multiplier
        tends to one with the distance, steps only halve. far: the longest step it may take.
        """
        place, allowed = np.zeros(len(self._scales)), far
        for _ in range(MOST_STEPS):
            run = self._run(place)
            if run is None:
                return None
            free, reached = self._free(run), self._place(run)
            jacobian = self._jacobian(place, reached, free)
            if jacobian is None:
                return None
            step, left = np.zeros(len(place)), (reached - place)[free]
            step[free] = np.linalg.lstsq(np.eye(len(free)) - jacobian, left)[0]
            length = float(np.linalg.norm(step))
            if not length <= allowed:
                return None
            place, allowed = place + step, max(SHRINKING * length, tolerance)
            if length <= tolerance or np.linalg.norm(left) <= tolerance:
                largest = float(np.max(np.abs(np.linalg.eigvals(jacobian)), initial=0.0)) ** (1 / self.order)
                return (self._moved(place), largest) if largest < ATTRACTS else None
        return None

    @property
    def _state(self) -> State:
        """Where the run has ended."""
        assert self.start.final is not None, "a run that is ok has a final state"
        return self.start.final

    @functools.cached_property
    def _scales(self) -> np.ndarray:
        """(s, 1, u) (2 r + h,)."""
        level, slowest = self._state.level, 2 * math.pi / self.map.period
        lengths = np.linalg.norm(level.level.base.directions[:, list(self.map.model.held)], axis=0)
        omega = level.modal.omega
        return np.concatenate([np.maximum(omega, slowest), np.ones(len(omega)), slowest / lengths])

    def _moved(self, place: np.ndarray) -> Trajectory:
        """A run that ends ``place`` away from where this one ended."""
        own, change = self._state, place / self._scales
        r, given = own.level.modal.modes, np.zeros(own.level.excitation.prescribed)
        xi = own.displacement + np.concatenate([change[:r], given, change[2 * r :]])
        xi_t = own.velocity + np.concatenate([change[r : 2 * r], given, 0 * own.held])
        return self.start.ending_in(replace(own, displacement=xi, velocity=xi_t))

    def _run(self, place: np.ndarray) -> Trajectory | None:
        """A run over the periods of the order, None where it fails or cannot start."""
        try:
            trajectory = self.map.run(self._moved(place), self.order)
        except MultiPhiValueError:  # a disturbance that leads into a rigid stop
            return None
        return trajectory if trajectory.status == "ok" else None

    def _place(self, trajectory: Trajectory) -> np.ndarray:
        """How far away from where this one ended another run has ended, in the level in which this one did."""
        own, other = self._state, trajectory.final
        assert other is not None, "a run that is ok has a final state"
        level = own.level
        held = other.held + (stops_moved(other) - stops_moved(own))[list(self.map.model.held)]
        centre = np.concatenate([own.displacement[: len(own.displacement) - len(held)], held])
        y = other.level.configuration(other.displacement) - level.configuration(centre)
        v = other.level.motion(other.velocity) - level.motion(own.velocity)
        vectors = level.modal.vectors
        return self._scales * np.concatenate([vectors.T @ y, vectors.T @ v, held - own.held])

    def _free(self, trajectory: Trajectory) -> np.ndarray:
        """Which coordinates are unknowns: all but places that links have held all the time, or never."""
        model = self.map.model
        levels = [self._state.level, *trajectory.segments.levels]
        holding = [model.links_held(level.states) for level in levels]
        kept = [len({i in held for held in holding}) == 1 for i in model.held]
        return np.flatnonzero(np.append(np.ones(len(self._scales) - len(kept), bool), ~np.array(kept, bool)))

    def _jacobian(self, place: np.ndarray, reached: np.ndarray, free: np.ndarray) -> np.ndarray | None:
        columns = []
        for direction in np.eye(len(place))[free]:
            run = self._run(place + self.difference * direction)
            if run is None:
                return None
            columns.append((self._place(run) - reached)[free] / self.difference)
        return np.array(columns).reshape(len(free), len(free)).T
