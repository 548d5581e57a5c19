"""Settling: a run continues in chunks of periods until its states repeat, with Newton's method between chunks.

    q_k+1 = P(q_k),   P^p(q) = q

q is the state at whole periods of the load, P one period of the run, p the order of the response (steady_state.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from multiphi_exudyn.steady.settled_state import HIGHEST_ORDER, SAMPLES, PeriodicLoad, SteadyState
from multiphi_exudyn.steady.shooting import PeriodMap, Shooting
from multiphi_exudyn.time.reliability.run_warnings import warnings_of
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.time.warnings.warning_groups import grouped

__all__ = ["CHUNK", "Search", "with_warnings"]

CHUNK = 2 * HIGHEST_ORDER  # periods of a chunk, enough for a repetition of every order
CANDIDATE = 0.03  # of the size of the motion: if states repeat to this, Newton's method is tried
DIFFERENCE = 1e-6  # of the size of the motion: step of the finite differences, the root of round-off


@dataclass(frozen=True)
class _Chunk:
    """Some periods of a run: q (2 m + e, k + 1) at whole periods, size of the motion, trajectory."""

    states: np.ndarray
    size: float
    trajectory: Trajectory

    @property
    def drifts(self) -> np.ndarray:
        """Largest differences of states 1 to HIGHEST_ORDER periods apart, over the last HIGHEST_ORDER periods."""
        tail, q = self.states[:, -HIGHEST_ORDER:], self.states
        return np.array(
            [
                np.max(np.linalg.norm(tail - q[:, -HIGHEST_ORDER - p : q.shape[1] - p], axis=0))
                for p in range(1, HIGHEST_ORDER + 1)
            ]
        )

    @property
    def candidate(self) -> int:
        """Order for Newton's method: 1 without an event, as the map is then linear; 0 if no order is near."""
        if len(self.trajectory.segments) == 1:
            return 1
        near = np.flatnonzero(self.drifts <= CANDIDATE * self.size)
        return int(near[0]) + 1 if len(near) else 0

    @property
    def largest_distance(self) -> float:
        """Largest distance of the states in these periods from the last one, plus the size of the motion."""
        return self.size + float(np.max(np.linalg.norm(self.states.T - self.states[:, -1], axis=1)))


@dataclass(frozen=True)
class Search:
    """Search for a steady state, see the module's docstring.

    base_warnings: of the modal base and the start. chunk_warnings: of every chunk so far.
    """

    map: PeriodMap
    load: PeriodicLoad
    tolerance: float
    base_warnings: tuple[str, ...]
    chunk_warnings: list[tuple[str, ...]] = field(default_factory=list)

    def settle(self, trajectory: Trajectory, periods: int) -> SteadyState:
        """Run chunks until states repeat, ``trajectory`` being the first, with Newton's method between them."""
        done, multiplier = 0, math.nan
        while True:
            self.chunk_warnings.append(trajectory.warnings)
            if trajectory.status != "ok":
                return self._failed(trajectory, done)
            chunk, done = self._chunk(trajectory), done + CHUNK
            repeating = np.flatnonzero(chunk.drifts <= self.tolerance * chunk.size)
            if len(repeating):
                return self._periodic(chunk, int(repeating[0]) + 1, done, multiplier)
            if done >= periods:
                return self._not_settled(chunk, done)
            start, multiplier = self._next_start(chunk)
            trajectory = self.run(start, CHUNK)

    def run(self, start: Trajectory, periods: int) -> Trajectory:
        """Run over some periods from the end of another run, with its warnings."""
        return with_warnings(self.map.run(start, periods))

    def _chunk(self, trajectory: Trajectory) -> _Chunk:
        whole = np.minimum(np.arange(CHUNK + 1) * self.map.period, trajectory.t_end)
        moving = self.map.states(trajectory, np.linspace(whole[-2], whole[-1], SAMPLES))
        size = float(np.max(np.linalg.norm(moving - np.mean(moving, axis=1, keepdims=True), axis=0)))
        return _Chunk(self.map.states(trajectory, whole), size, trajectory)

    def _next_start(self, chunk: _Chunk) -> tuple[Trajectory, float]:
        """A run at whose end the next chunk starts, and the largest multiplier there, NaN without Newton's method."""
        order = chunk.candidate
        if not order:
            return chunk.trajectory, math.nan
        shooting = Shooting(self.map, order, chunk.trajectory, DIFFERENCE * chunk.size)
        return shooting.attractor(self.tolerance * chunk.size, chunk.largest_distance) or (chunk.trajectory, math.nan)

    # ------------------------------------------------------------------ results

    def _periodic(self, chunk: _Chunk, order: int, done: int, multiplier: float) -> SteadyState:
        residual = chunk.drifts[order - 1] / chunk.size if chunk.size else 0.0
        run = self.run(chunk.trajectory, order)
        (x, v), warnings = _final_state(chunk.trajectory), self._warnings(run)
        return SteadyState("periodic", "", self.load, order, float(residual), multiplier, done, run, x, v, warnings)

    def _not_settled(self, chunk: _Chunk, done: int) -> SteadyState:
        order, residual = int(np.argmin(chunk.drifts)) + 1, float(np.min(chunk.drifts) / chunk.size)
        message = f"states {order} periods apart still differ by {residual:.2g} of the motion after {done} periods"
        x, v = _final_state(chunk.trajectory)
        run, warnings = chunk.trajectory, self._warnings(chunk.trajectory)
        return SteadyState("not settled", message, self.load, 0, residual, math.nan, done, run, x, v, warnings)

    def _failed(self, trajectory: Trajectory, done: int) -> SteadyState:
        reached = done + int(trajectory.t_end / self.map.period)
        message = f"after {reached} periods: {trajectory.message}"
        shapes, start = self.map.model.base.modes.shapes, trajectory.start
        x, v = shapes @ start.displacement, shapes @ start.velocity
        warnings = self._warnings(trajectory)
        return SteadyState("failed", message, self.load, 0, math.nan, math.nan, reached, trajectory, x, v, warnings)

    def _warnings(self, run: Trajectory) -> tuple[str, ...]:
        """Warnings of a trajectory, and one sentence for every further kind that earlier chunks had."""
        shown_kinds = {sentence.partition(": ")[0] for sentence in run.warnings}
        before = grouped(("", sentences) for sentences in self.chunk_warnings)
        earlier = [
            f"{group.kind}: before it settled, {group.example}" for group in before if group.kind not in shown_kinds
        ]
        return (*run.warnings, *self.base_warnings, *earlier)


def with_warnings(trajectory: Trajectory) -> Trajectory:
    """The trajectory with its warnings."""
    return replace(trajectory, warnings=warnings_of(trajectory))


def _final_state(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """x, x' (n,) at the end of a trajectory."""
    return trajectory.displacement(trajectory.t_end), trajectory.velocity(trajectory.t_end)
