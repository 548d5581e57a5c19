"""Workers: threads that divide the runs of one model from many starts, each on arrays of its own (many.py)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_arrays import LevelArrays
from multiphi_exudyn.events.packing.start_arrays import Start
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.many.batch import Batch
from multiphi_exudyn.time.reliability.impact_warnings import is_taking, spread_contacts
from multiphi_exudyn.time.reliability.law_span import laws_at_an_end
from multiphi_exudyn.time.reliability.law_warnings import approximated_laws
from multiphi_exudyn.time.reliability.run_warnings import ModelWarnings
from multiphi_exudyn.time.reliability.truncation_warnings import indicator_threshold, truncation_warnings
from multiphi_exudyn.time.run.motion import Motion, carry
from multiphi_exudyn.time.run.refinement import refined
from multiphi_exudyn.time.run.start import first_start
from multiphi_exudyn.time.segments.level_rows import point_row
from multiphi_exudyn.time.simulate import Run, run_with_warnings
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.time.warnings.model_warnings import advised

__all__ = ["StartVectors", "Task"]

KEPT_ROWS = 256  # levels for which the points' rows are kept
KEPT = 8  # sets of levels under loads, one for each fineness of interpolation
BATCH = 64  # most runs of a batch: threads then hardly wait for each other
ROOM = 8192  # segments, and events, of the record of a batch: half of it is planned for, as runs differ

StartVectors: TypeAlias = "tuple[np.ndarray | None, np.ndarray | None]"  # x and x' (n,)
WarningPair: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]  # warnings before and after those of truncation


class Task:
    """Runs to be done, and their results; given: the run that they have in common; points: rows (n,).

    lock: the thread that holds it works on levels and results. samples, events, ends: see ManyRuns. results: status,
    message and warnings of each run.
    """

    def __init__(
        self, given: Run, starts: Sequence[StartVectors], points: Sequence[np.ndarray], times: np.ndarray
    ) -> None:
        self.lock, self._stopped, self._given, self._starts = threading.Lock(), False, given, starts
        self.levels = BoundedCache[object, LoadedLevels](KEPT)
        self._rows: tuple[MultiPhiModel | None, list[np.ndarray]] = None, []
        self._in_levels = BoundedCache[tuple[int, ...], list[np.ndarray]](KEPT_ROWS)
        self._points, self.times, count = points, times, len(starts)
        self.samples, self.ends = np.full((count, len(points), len(times)), np.nan), np.zeros(count)
        self.events, self.results = np.zeros(count, int), [("failed", "", tuple[str, ...]())] * count
        self._next_run, self._in_batches = 0, not refined(given.loads)
        self._level_warnings = dict[tuple[tuple[int, ...], ...], WarningPair]()  # by levels

    def carry_out(self, threads: int, bar: Any) -> None:
        """Do all runs; the first ones, one after the other, decide the modes of a Tolerance."""
        model = self._given.model
        while isinstance(model.modes, Tolerance) and model.decided is None and (numbers := self._next(1)):
            self._finish(numbers[0], self._run(numbers[0], None))
            bar.update()
        with ThreadPoolExecutor(threads) as pool:
            futures = [pool.submit(self._work, threads, bar) for _ in range(threads)]
            try:
                for future in futures:
                    future.result()
            finally:
                self._stopped = True

    def _next(self, most: int) -> range:
        """Numbers of at most ``most`` runs that no thread has begun."""
        first, self._next_run = self._next_run, min(self._next_run + most, len(self._starts))
        return range(first, self._next_run)

    def _work(self, threads: int, bar: Any) -> None:
        """Do runs of one thread: a first one alone, which packs levels and sets the size of batches, then batches."""
        worker, most = _Worker(self), 1
        with self.lock:
            while not self._stopped and (numbers := self._next(most)):
                for number in self._run_batches(worker, numbers) if len(numbers) > 1 else numbers:
                    self._finish(number, self._run(number, worker))
                bar.update(len(numbers))
                fair = (len(self._starts) - self._next_run) // (2 * threads)
                most = max(1, min(worker.most, fair)) if self._in_batches else 1

    def _run(self, number: int, worker: _Worker | None) -> Run:
        displacement, velocity = self._starts[number]
        return replace(self._given, displacement=displacement, velocity=velocity, shared=worker)

    def _run_batches(self, worker: _Worker, numbers: Sequence[int]) -> list[int]:
        """Do runs in batches; return those that stopped a batch, which are to be run alone."""
        given, end = self._given, self._given.t_end
        levels = replace(given, model=given.model.decided or given.model, shared=worker).levels()
        waiting, starts, remaining = list[int](), list[Start](), list[int]()
        for number in numbers:
            try:
                starts.append(first_start(levels, end, *self._starts[number]))
                waiting.append(number)
            except MultiPhiError as error:
                self.results[number] = "failed", str(error), ()
        while waiting:
            batch = Batch.run(worker.motion(levels, starts[0], None), starts, end, worker.meanwhile)
            count = batch.count
            if count:
                self._keep(worker, batch, waiting[:count])
            remaining += waiting[count : count + 1]
            waiting, starts = waiting[count + 1 :], starts[count + 1 :]
        return remaining

    def _keep(self, worker: _Worker, batch: Batch, numbers: list[int]) -> None:
        """Keep the results of the runs of a batch that have reached their end."""
        rows = partial(self._rows_in, batch.arrays.levels.model)
        self.samples[numbers] = batch.values(rows, len(self._points), self.times)
        self.events[numbers], self.ends[numbers] = batch.events, self._given.t_end
        warnings = self._warnings(worker, batch, numbers)
        for k, number in enumerate(numbers):
            self.results[number] = "ok", "", warnings[k]

    def _warnings(self, worker: _Worker, batch: Batch, numbers: list[int]) -> dict[int, tuple[str, ...]]:
        """Warnings of the runs of a batch; a run whose numbers do not suffice is made into a trajectory."""
        model, runs = batch.arrays.levels.model, range(batch.count)
        needs_trajectory = model.general or model.validity is not None or not model.base.complete
        needs_trajectory = needs_trajectory or bool(approximated_laws(model))
        spread = spread_contacts(model)
        separate = [
            k
            for k in runs
            if needs_trajectory
            or not (batch.is_balanced(k) and batch.has_defects(k))
            or (spread and is_taking(batch.run_numbers[k]))
            or laws_at_an_end(model, batch.visited(k))
        ]
        motions = [(k, batch.motion(k)) for k in separate]  # first: warnings may rebuild the arrays
        warnings = self._from_numbers(batch, [k for k in runs if k not in separate])
        for k, motion in motions:
            run = self._run(numbers[k], worker)
            run.ahead = motion
            warnings[k] = run_with_warnings(run).warnings
        return warnings

    def _from_numbers(self, batch: Batch, runs: Sequence[int]) -> dict[int, tuple[str, ...]]:
        """Warnings of some runs: of truncation by their verdicts, all others by the levels that they visited."""
        model, modes, warnings = batch.arrays.levels.model, self._given.model.modes, dict[int, tuple[str, ...]]()
        tolerance = modes if isinstance(modes, Tolerance) else None
        rigid = any(contact.rigid for contact in model.contacts)
        for k, verdict in batch.verdicts(runs, indicator_threshold(tolerance)).items():
            visited = batch.visited(k)
            if visited not in self._level_warnings:
                trajectory = batch.motion(k).trajectory(batch.end)
                self._level_warnings[visited] = ModelWarnings.of(model, trajectory.segments).for_run(trajectory)
            before, after = self._level_warnings[visited]
            struck = verdict[1] > 0 and rigid and batch.struck(k)
            truncated = truncation_warnings(model, verdict, tolerance, struck)
            warnings[k] = advised((*before, *truncated, *after), tolerance)
        return warnings

    def _finish(self, number: int, run: Run) -> None:
        """Do a run alone, and keep its results."""
        try:
            trajectory = run_with_warnings(run)
            self.events[number], self.ends[number] = len(trajectory.events), trajectory.t_end
            self.results[number] = trajectory.status, trajectory.message, trajectory.warnings
            self._sample(number, trajectory)
            if isinstance(run.shared, _Worker):
                run.shared.most = min(BATCH, max(1, ROOM // (2 * len(trajectory.segments) + 1)))
        except MultiPhiError as error:
            self.results[number] = "failed", str(error), ()

    def _sample(self, number: int, trajectory: Trajectory) -> None:
        reached = self.times <= trajectory.t_end
        if not (trajectory.segments and reached.any()):
            return
        segments, times = trajectory.segments, self.times[reached]
        for place, row in enumerate(self._rows_of(trajectory.model)):
            self.samples[number, place, reached] = segments.values(times, "right", partial(point_row, row))

    def _rows_in(self, model: MultiPhiModel, level: LoadedLevel) -> list[np.ndarray]:
        """Rows (2 n + 1,) of the points in a level of the runs' final model, kept for later runs."""
        return self._in_levels.get_or_build(
            level.states, lambda: [point_row(row, level) for row in self._rows_of(model)]
        )

    def _rows_of(self, model: MultiPhiModel) -> list[np.ndarray]:
        """Rows (m,) of the points in the base coordinates of a run's final model, mostly the same for all runs."""
        if self._rows[0] is not model:
            rows = [model.base.modes.shapes.T @ row for row in self._points]
            self._rows = model, rows
        return self._rows[1]


class _Worker:
    """Arrays of a thread (simulate.SharedResources); most: largest number of runs in a batch."""

    def __init__(self, task: Task) -> None:
        self._task, self.most = task, 1
        self._arrays = BoundedCache[LoadedLevels, LevelArrays](KEPT)

    def levels(self, key: object, build: Callable[[], LoadedLevels]) -> LoadedLevels:
        """The levels under the loads, which all threads share."""
        return self._task.levels.get_or_build(key, build)

    def motion(self, levels: LoadedLevels, start: Start, compiled: bool | None) -> Motion:
        """Return a motion on the thread's arrays."""
        return Motion(self._arrays.get_or_build(levels, lambda: _roomy(levels)), start, compiled, self.loop)

    def loop(self, *given: Any) -> Any:
        """Call the compiled loop while other threads may run."""
        return self.meanwhile(carry, *given)

    def meanwhile(self, function: Callable[..., Any], *given: Any) -> Any:
        """Call a compiled function while other threads may run."""
        self._task.lock.release()
        try:
            return function(*given)
        finally:
            self._task.lock.acquire()


def _roomy(levels: LoadedLevels) -> LevelArrays:
    """Arrays with room for the record of a batch."""
    arrays = LevelArrays(levels)
    arrays.room = ROOM
    return arrays
