"""Workers: the runs of one model from many starts, on all cores (many.py).

The core does a batch of them at a time on its threads; what a run needs of Python, its start before it and its warnings
after it, is done by one thread.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Any, TypeAlias

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.core_levels import core_levels
from multiphi_exudyn.time.run.chatter import limits
from multiphi_exudyn.time.run.motion import Motion, core_start
from multiphi_exudyn.time.run.refinement import refined
from multiphi_exudyn.time.run.start import first_start
from multiphi_exudyn.time.segments.level_rows import point_row
from multiphi_exudyn.time.simulate import Run, run_with_warnings
from multiphi_exudyn.time.start_conditions import Start
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["StartVectors", "Task"]

KEPT = 8  # sets of levels under loads, one for each fineness of interpolation
BATCH = 64  # runs of a batch, for each thread: a progress bar then moves
MOST_SEGMENTS = 2**20  # of a batch: they are kept in memory until its results have been read

StartVectors: TypeAlias = "tuple[np.ndarray | None, np.ndarray | None]"  # x and x' (n,)


class Task:
    """Runs to be done, and their results; given: the run that they have in common; points: rows (n,).

    samples, events, ends: see ManyRuns. results: status, message and warnings of each run.
    """

    def __init__(
        self, given: Run, starts: Sequence[StartVectors], points: Sequence[np.ndarray], times: np.ndarray
    ) -> None:
        self._given, self._starts, self._points, self.times = given, starts, points, times
        self._kept = BoundedCache[object, LoadedLevels](KEPT)
        count = len(starts)
        self.samples, self.ends = np.full((count, len(points), len(times)), np.nan), np.zeros(count)
        self.events, self.results = np.zeros(count, int), [("failed", "", tuple[str, ...]())] * count

    def levels(self, key: object, build: Any) -> LoadedLevels:
        """The levels under the loads, which all runs share (simulate.SharedResources)."""
        return self._kept.get_or_build(key, build)

    def carry_out(self, threads: int, bar: Any) -> None:
        """Do all runs; the first ones, one after the other, decide the modes of a Tolerance."""
        model, numbers = self._given.model, list(range(len(self._starts)))
        alone = len(numbers) if refined(self._given.loads) else 1  # a first run sets the size of batches
        while numbers and (alone > 0 or (isinstance(model.modes, Tolerance) and model.decided is None)):
            segments = self._finish(numbers.pop(0), None)
            alone -= 1
            bar.update()
        while numbers:
            count = max(threads, min(BATCH * threads, MOST_SEGMENTS // (segments + 1)))
            batch, numbers = numbers[:count], numbers[count:]
            segments = self._run_batch(batch, threads)
            bar.update(len(batch))

    def _run(self, number: int) -> Run:
        displacement, velocity = self._starts[number]
        return replace(self._given, displacement=displacement, velocity=velocity, shared=self)

    def _run_batch(self, numbers: Sequence[int], threads: int) -> int:
        """Do a batch of runs; return the largest number of segments of one."""
        given, end = self._given, self._given.t_end
        levels = replace(given, model=given.model.decided or given.model, shared=self).levels()
        waiting, starts = list[int](), list[Start]()
        for number in numbers:
            try:
                starts.append(first_start(levels, end, *self._starts[number]))
                waiting.append(number)
            except MultiPhiError as error:
                self.results[number] = "failed", str(error), ()
        built, window = core_levels(levels), limits(levels.model)
        given_starts = [core_start(levels, start) for start in starts]
        runs = core.run_batch(built, given_starts, *window, levels.drive.time, end, threads)
        done = [k for k, run in enumerate(runs) if run.is_complete]
        self._sample_batch(levels, built, [runs[k].trajectory for k in done], [waiting[k] for k in done], threads)
        largest = 0
        for k, run in enumerate(runs):
            ahead = Motion.ended(levels, built, starts[k], run) if run.is_complete else None
            largest = max(largest, self._finish(waiting[k], ahead))
        return largest

    def _sample_batch(
        self,
        levels: LoadedLevels,
        built: core.Levels,
        trajectories: Sequence[core.Trajectory],
        numbers: Sequence[int],
        threads: int,
    ) -> None:
        """Sample the points in runs that have reached their end."""
        if self._points and len(self.times) and trajectories:
            points = self._rows_of(levels.model)
            keys = set(map(tuple, chain.from_iterable(trajectory.keys for trajectory in trajectories)))
            visited = {key: levels.level(key) for key in keys}
            rows: dict[Sequence[int], np.ndarray] = {
                key: np.array([point_row(point, level) for point in points]) for key, level in visited.items()
            }
            values = core.sample_batch(built, trajectories, rows, self.times.tolist(), threads)
            self.samples[numbers] = np.asarray(values).reshape(len(numbers), len(points), -1)

    def _finish(self, number: int, ahead: Motion | None) -> int:
        """Keep the results of a run, done alone unless it is ``ahead``; return its number of segments."""
        run = self._run(number)
        run.ahead = ahead
        try:
            trajectory = run_with_warnings(run)
        except MultiPhiError as error:
            self.results[number] = "failed", str(error), ()
            return 0
        self.events[number], self.ends[number] = len(trajectory.events), trajectory.t_end
        self.results[number] = trajectory.status, trajectory.message, trajectory.warnings
        if ahead is None:
            self._sample(number, trajectory)
        return len(trajectory.segments)

    def _sample(self, number: int, trajectory: Trajectory) -> None:
        reached = self.times <= trajectory.t_end
        if not (trajectory.segments and reached.any()):
            return
        segments, times = trajectory.segments, self.times[reached]
        for place, row in enumerate(self._rows_of(trajectory.model)):
            self.samples[number, place, reached] = segments.values(times, "right", partial(point_row, row))

    def _rows_of(self, model: MultiPhiModel) -> list[np.ndarray]:
        """Rows (m,) of the points in the base coordinates of a run's final model."""
        return [model.base.modes.shapes.T @ row for row in self._points]
