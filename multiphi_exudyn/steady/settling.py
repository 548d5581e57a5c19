"""Settling: a run goes on from chunk to chunk of periods until its states repeat, Newton's method in between.

    q_k+1 = P(q_k),   P^p(q) = q

q is the state at whole periods of the load, P one period of the run, p the order of the response (steady_state.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from multiphi_exudyn.steady.settled_state import HIGHEST_ORDER, SAMPLES, PeriodicLoad, SteadyState
from multiphi_exudyn.steady.shooting import PeriodMap, Shooting
from multiphi_exudyn.time.reliability import warnings_of
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.warning_groups import grouped

__all__ = ["CHUNK", "Search", "warned"]

CHUNK = 2 * HIGHEST_ORDER  # periods run at a time: every order is seen to repeat
NEAR = 0.03  # of the size of the motion: states that repeat to this are worth Newton's method
DIFFERENCE = 1e-6  # of the size of the motion: step of the finite differences, half the digits


@dataclass(frozen=True)
class _Chunk:
    """Some periods of a run: q (2 m + e, k + 1) at whole periods, size of the motion, trajectory."""

    states: np.ndarray
    size: float
    trajectory: Trajectory

    @property
    def drifts(self) -> np.ndarray:
        """By how much states 1 to HIGHEST_ORDER periods apart differ at most over the last HIGHEST_ORDER periods."""
        tail, q = self.states[:, -HIGHEST_ORDER:], self.states
        return np.array(
            [
                np.max(np.linalg.norm(tail - q[:, -HIGHEST_ORDER - p : q.shape[1] - p], axis=0))
                for p in range(1, HIGHEST_ORDER + 1)
            ]
        )

    @property
    def candidate(self) -> int:
        """The order that Newton's method is tried for: 1 where no contact changed, the map being linear; 0 for none."""
        if len(self.trajectory.segments) == 1:
            return 1
        near = np.flatnonzero(self.drifts <= NEAR * self.size)
        return int(near[0]) + 1 if len(near) else 0

    @property
    def reach(self) -> float:
        """How far from the last state the run has been in these periods."""
        return self.size + float(np.max(np.linalg.norm(self.states.T - self.states[:, -1], axis=1)))


@dataclass(frozen=True)
class Search:
    """A search under way; see the module's docstring. outside: warnings of its base and start; warned: of chunks."""

    map: PeriodMap
    load: PeriodicLoad
    tolerance: float
    outside: tuple[str, ...]
    warned: list[tuple[str, ...]] = field(default_factory=list)

    def settle(self, trajectory: Trajectory, periods: int) -> SteadyState:
        """Chunks until states repeat, of which this is the first, Newton's method in between."""
        done, multiplier = 0, math.nan
        while True:
            self.warned.append(trajectory.warnings)
            if trajectory.status != "ok":
                return self._failed(trajectory, done)
            chunk, done = self._chunk(trajectory), done + CHUNK
            repeating = np.flatnonzero(chunk.drifts <= self.tolerance * chunk.size)
            if len(repeating):
                return self._found(chunk, int(repeating[0]) + 1, done, multiplier)
            if done >= periods:
                return self._lost(chunk, done)
            start, multiplier = self._shot(chunk)
            trajectory = self.run(start, CHUNK)

    def run(self, start: Trajectory, periods: int) -> Trajectory:
        """Periods from the end of a run on."""
        return warned(self.map.run(start, periods))

    def _chunk(self, trajectory: Trajectory) -> _Chunk:
        whole = np.minimum(np.arange(CHUNK + 1) * self.map.period, trajectory.t_end)
        moving = self.map.states(trajectory, np.linspace(whole[-2], whole[-1], SAMPLES))
        size = float(np.max(np.linalg.norm(moving - np.mean(moving, axis=1, keepdims=True), axis=0)))
        return _Chunk(self.map.states(trajectory, whole), size, trajectory)

    def _shot(self, chunk: _Chunk) -> tuple[Trajectory, float]:
        """A run at whose end the next chunk starts, and the largest multiplier there."""
        order = chunk.candidate
        if not order:
            return chunk.trajectory, math.nan
        shooting = Shooting(self.map, order, chunk.trajectory, DIFFERENCE * chunk.size)
        return shooting.attracting(self.tolerance * chunk.size, chunk.reach) or (chunk.trajectory, math.nan)

    # ------------------------------------------------------------------ results

    def _found(self, chunk: _Chunk, order: int, done: int, multiplier: float) -> SteadyState:
        residual = chunk.drifts[order - 1] / chunk.size if chunk.size else 0.0
        shown = self.run(chunk.trajectory, order)
        (x, v), told = _reached(chunk.trajectory), self._told(shown)
        return SteadyState("periodic", "", self.load, order, float(residual), multiplier, done, shown, x, v, told)

    def _lost(self, chunk: _Chunk, done: int) -> SteadyState:
        order, residual = int(np.argmin(chunk.drifts)) + 1, float(np.min(chunk.drifts) / chunk.size)
        message = f"states {order} periods apart still differ by {residual:.2g} of the motion after {done} periods"
        x, v = _reached(chunk.trajectory)
        run, told = chunk.trajectory, self._told(chunk.trajectory)
        return SteadyState("not settled", message, self.load, 0, residual, math.nan, done, run, x, v, told)

    def _failed(self, trajectory: Trajectory, done: int) -> SteadyState:
        reached = done + int(trajectory.t_end / self.map.period)
        message = f"after {reached} periods: {trajectory.message}"
        shapes, start = self.map.model.base.modes.shapes, trajectory.start
        x, v = shapes @ start.displacement, shapes @ start.velocity
        told = self._told(trajectory)
        return SteadyState("failed", message, self.load, 0, math.nan, math.nan, reached, trajectory, x, v, told)

    def _told(self, shown: Trajectory) -> tuple[str, ...]:
        """Warnings of the trajectory that is shown, and kinds that only runs before it had."""
        own = {sentence.partition(": ")[0] for sentence in shown.warnings}
        before = grouped(("", sentences) for sentences in self.warned)
        earlier = [f"{group.kind}: before it settled, {group.example}" for group in before if group.kind not in own]
        return (*shown.warnings, *self.outside, *earlier)


def warned(trajectory: Trajectory) -> Trajectory:
    """With its warnings."""
    return replace(trajectory, warnings=warnings_of(trajectory))


def _reached(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """x, x' (n,) at its end."""
    return trajectory.displacement(trajectory.t_end), trajectory.velocity(trajectory.t_end)
