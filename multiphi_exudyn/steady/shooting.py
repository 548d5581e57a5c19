"""Shooting: states that repeat after whole periods, by Newton's method for the map of a period.

P maps a state at the beginning of a period of the loads to the state at its end. A state that repeats after p periods
is a solution of P^p(z) = z:

    (1 - J) dz = P^p(z) - z,   J = dP^p / dz,   z = (s eta, eta', u w),   s = max(omega, 2 pi / T),   u = 2 pi / (T |h|)

eta, eta' are the coordinates in the level at whole periods, w the stick positions; J is computed by finite differences.
The eigenvalues of J, the multipliers, are the growth factors of small disturbances: the state is an attractor if they
lie inside the unit circle. Between events the map is linear, so that few steps suffice.

A link that slips loses its stick position: the multiplier is zero. A link that never slips keeps it: the multiplier is
one, and every stick position belongs to another repeating state. Such positions are no unknowns: they keep the values
of the previous run, and their multipliers are left out. The same holds for links that never act.

Source: A. H. Nayfeh, B. Balachandran, Applied Nonlinear Dynamics, 1995, ch. 3, 5.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.element import friction_spring
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.continuation import stop_displacements
from multiphi_exudyn.time.simulate import Run
from multiphi_exudyn.time.state import State
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["ATTRACTS", "PeriodMap", "Shooting"]

MOST_STEPS = 16  # of Newton's method: with a fixed order of events the map is nearly linear,
CONVERGENCE = 0.6  # at a double root steps halve: a larger ratio of two steps shows that the method does not converge
ATTRACTS = 1 - 1e-7  # a larger multiplier may be 1, within the error of finite differences


@dataclass(frozen=True)
class PeriodMap:
    """Runs over whole periods [s] of the loads."""

    model: MultiPhiModel
    loads: Sequence[Load]
    period: float

    def run(self, start: Trajectory, periods: int) -> Trajectory:
        """Run over some periods, from the end of another run at a whole period."""
        return Run(self.model, periods * self.period, loads=self.loads, start=start, rewound=True).trajectory()

    def states(self, trajectory: Trajectory, times: np.ndarray) -> np.ndarray:
        """(s y, y', T / sqrt(k)) (2 m + e, k) at times (k,) [s], T of the e springs in series with friction."""
        base = self.model.base
        scales = np.maximum(base.modes.omega, 2 * math.pi / self.period)[:, None]
        displacements, velocities = (
            base.coordinates(trajectory.displacement(times)),
            base.coordinates(trajectory.velocity(times)),
        )
        springs = ((c.name, friction_spring(c)[2]) for c in self.model.contacts)
        spring_forces = [trajectory.friction_force(name, times) / math.sqrt(k) for name, k in springs if k]
        return np.vstack([scales * displacements, velocities, *spring_forces])


@dataclass(frozen=True)
class Shooting:
    """Newton's method around the end of a run; difference: step of the finite differences."""

    map: PeriodMap
    order: int
    start: Trajectory
    difference: float

    def attractor(self, tolerance: float, longest_step: float) -> tuple[Trajectory, float] | None:
        """A run that ends in a repeating state that is an attractor, and its largest multiplier in a period; or None.

        tolerance: of the last step of Newton's method, or of the residual: where the multiplier tends to one near the
        solution, steps only halve. longest_step: largest length of a step.
        """
        point, allowed = np.zeros(len(self._scales)), longest_step
        for _ in range(MOST_STEPS):
            run = self._run(point)
            if run is None:
                return None
            unknowns, mapped = self._unknowns(run), self._coordinates(run)
            jacobian = self._jacobian(point, mapped, unknowns)
            if jacobian is None:
                return None
            step, residual = np.zeros(len(point)), (mapped - point)[unknowns]
            step[unknowns] = np.linalg.lstsq(np.eye(len(unknowns)) - jacobian, residual)[0]
            length = float(np.linalg.norm(step))
            if not length <= allowed:
                return None
            point, allowed = point + step, max(CONVERGENCE * length, tolerance)
            if length <= tolerance or np.linalg.norm(residual) <= tolerance:
                largest = float(np.max(np.abs(np.linalg.eigvals(jacobian)), initial=0.0)) ** (1 / self.order)
                return (self._displaced(point), largest) if largest < ATTRACTS else None
        return None

    @property
    def _state(self) -> State:
        """State at the end of the run."""
        assert self.start.final is not None, "a run that is ok has a final state"
        return self.start.final

    @functools.cached_property
    def _scales(self) -> np.ndarray:
        """Scales (s, 1, u) (2 r + h,) of the coordinates z."""
        level, slowest = self._state.level, 2 * math.pi / self.map.period
        lengths = np.linalg.norm(level.level.base.directions[:, list(self.map.model.held)], axis=0)
        omega = level.modal.omega
        return np.concatenate([np.maximum(omega, slowest), np.ones(len(omega)), slowest / lengths])

    def _displaced(self, point: np.ndarray) -> Trajectory:
        """The run with its final state changed by ``point`` in coordinates z."""
        final, change = self._state, point / self._scales
        r, prescribed = final.level.modal.modes, np.zeros(final.level.excitation.prescribed)
        xi = final.displacement + np.concatenate([change[:r], prescribed, change[2 * r :]])
        xi_t = final.velocity + np.concatenate([change[r : 2 * r], prescribed, 0 * final.held])
        return self.start.ending_in(replace(final, displacement=xi, velocity=xi_t))

    def _run(self, point: np.ndarray) -> Trajectory | None:
        """Run over ``order`` periods from a displaced start, None if it fails or cannot start."""
        try:
            trajectory = self.map.run(self._displaced(point), self.order)
        except MultiPhiValueError:  # a disturbance that leads into a rigid stop
            return None
        return trajectory if trajectory.status == "ok" else None

    def _coordinates(self, trajectory: Trajectory) -> np.ndarray:
        """Coordinates z of another run's final state relative to that of this run, in the level of this run."""
        final, other = self._state, trajectory.final
        assert other is not None, "a run that is ok has a final state"
        level = final.level
        held = other.held + (stop_displacements(other) - stop_displacements(final))[list(self.map.model.held)]
        centre = np.concatenate([final.displacement[: len(final.displacement) - len(held)], held])
        y = other.level.configuration(other.displacement) - level.configuration(centre)
        v = other.level.motion(other.velocity) - level.motion(final.velocity)
        vectors = level.modal.vectors
        return self._scales * np.concatenate([vectors.T @ y, vectors.T @ v, held - final.held])

    def _unknowns(self, trajectory: Trajectory) -> np.ndarray:
        """Indices of the unknowns: all coordinates except stick positions of links that acted always, or never."""
        model = self.map.model
        levels = [self._state.level, *trajectory.segments.levels]
        active = [model.active_links(level.states) for level in levels]
        constant = [len({i in held for held in active}) == 1 for i in model.held]
        return np.flatnonzero(np.append(np.ones(len(self._scales) - len(constant), bool), ~np.array(constant, bool)))

    def _jacobian(self, point: np.ndarray, mapped: np.ndarray, unknowns: np.ndarray) -> np.ndarray | None:
        columns = []
        for direction in np.eye(len(point))[unknowns]:
            run = self._run(point + self.difference * direction)
            if run is None:
                return None
            columns.append((self._coordinates(run) - mapped)[unknowns] / self.difference)
        return np.array(columns).reshape(len(unknowns), len(unknowns)).T
