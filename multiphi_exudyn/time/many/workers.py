"""Workers: threads that share out runs of one model from many starts, each on arrays of its own (many.py)."""

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
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.many.batch import Several
from multiphi_exudyn.time.reliability.run_warnings import Known
from multiphi_exudyn.time.reliability.truncation_warnings import least_indicator, left_out_warnings
from multiphi_exudyn.time.run.motion import Motion, carry
from multiphi_exudyn.time.run.refinement import refined
from multiphi_exudyn.time.run.start import first_start
from multiphi_exudyn.time.segments.level_rows import point_row
from multiphi_exudyn.time.simulate import Run, warned
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["StartVectors", "Task"]

KEPT_ROWS = 256  # levels whose points' rows are kept
KEPT = 8  # levels under loads as finely interpolated as runs have needed
SEVERAL = 64  # runs that are carried together: threads then hardly wait for each other
ROOM = 8192  # segments, and events, of a record of several runs: they take half of it, as they differ

StartVectors: TypeAlias = "tuple[np.ndarray | None, np.ndarray | None]"  # x and x' (n,)
Around: TypeAlias = tuple[tuple[str, ...], tuple[str, ...]]  # warnings before and after what truncation took


class Task:
    """Runs to be done, and what is kept of them; given: what they have in common; points: rows (n,).

    lock: whoever has it works on levels and on what is kept. samples, events, ends: see ManyRuns. told: status, message
    and warnings of each.
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
        self.events, self.told = np.zeros(count, int), [("failed", "", tuple[str, ...]())] * count
        self._begun, self._together = 0, not refined(given.loads)
        self._around = dict[tuple[tuple[int, ...], ...], Around]()  # by levels

    def carry_out(self, threads: int, bar: Any) -> None:
        """All runs; a Tolerance is decided by the first ones, one after the other."""
        model = self._given.model
        while isinstance(model.modes, Tolerance) and model.decided is None and (numbers := self._next(1)):
            self._finish(numbers[0], self._run(numbers[0], None))
            bar.update()
        with ThreadPoolExecutor(threads) as pool:
            working = [pool.submit(self._work, threads, bar) for _ in range(threads)]
            try:
                for each in working:
                    each.result()
            finally:
                self._stopped = True

    def _next(self, most: int) -> range:
        """The numbers of runs that nobody has begun."""
        first, self._begun = self._begun, min(self._begun + most, len(self._starts))
        return range(first, self._begun)

    def _work(self, threads: int, bar: Any) -> None:
        """A first run by itself, which packs levels that others need, and says how many are carried together."""
        worker, most = _Worker(self), 1
        with self.lock:
            while not self._stopped and (numbers := self._next(most)):
                for number in self._several(worker, numbers) if len(numbers) > 1 else numbers:
                    self._finish(number, self._run(number, worker))
                bar.update(len(numbers))
                fair = (len(self._starts) - self._begun) // (2 * threads)
                most = max(1, min(worker.most, fair)) if self._together else 1

    def _run(self, number: int, worker: _Worker | None) -> Run:
        displacement, velocity = self._starts[number]
        return replace(self._given, displacement=displacement, velocity=velocity, shared=worker)

    def _several(self, worker: _Worker, numbers: Sequence[int]) -> list[int]:
        """Runs carried together, as far as nothing stops them; those that are left."""
        given, end = self._given, self._given.t_end
        levels = replace(given, model=given.model.decided or given.model, shared=worker).levels()
        waiting, starts, left = list[int](), list[Start](), list[int]()
        for number in numbers:
            try:
                starts.append(first_start(levels, end, *self._starts[number], {}))
                waiting.append(number)
            except MultiPhiError as refused:
                self.told[number] = "failed", str(refused), ()
        while waiting:
            several = Several.carried(worker.motion(levels, starts[0], None), starts, end, worker.meanwhile)
            done = several.count
            if done:
                self._keep(worker, several, waiting[:done])
            left += waiting[done : done + 1]
            waiting, starts = waiting[done + 1 :], starts[done + 1 :]
        return left

    def _keep(self, worker: _Worker, several: Several, numbers: list[int]) -> None:
        """What is kept of the runs that have come to their end together."""
        rows = partial(self._rows_in, several.arrays.levels.model)
        self.samples[numbers] = several.values(rows, len(self._points), self.times)
        self.events[numbers], self.ends[numbers] = several.events, self._given.t_end
        found = self._warnings(worker, several, numbers)
        for k, number in enumerate(numbers):
            self.told[number] = "ok", "", found[k]

    def _warnings(self, worker: _Worker, several: Several, numbers: list[int]) -> dict[int, tuple[str, ...]]:
        """Of runs carried together; one that its numbers alone do not tell of is looked into as a whole."""
        model, runs = several.arrays.levels.model, range(several.count)
        hidden = model.general or model.validity is not None or not model.base.complete
        apart = [k for k in runs if hidden or not several.has_defects(k)]
        landed = [(k, several.land(k)) for k in apart]  # at once: who looks into one may begin the arrays anew
        found = self._from_numbers(several, [k for k in runs if k not in apart])
        for k, motion in landed:
            run = self._run(numbers[k], worker)
            run.ahead = motion
            found[k] = warned(run).warnings
        return found

    def _from_numbers(self, several: Several, runs: Sequence[int]) -> dict[int, tuple[str, ...]]:
        """Warnings of some runs by what truncation took of each; all others are those of the levels that it was in."""
        model, modes, found = several.arrays.levels.model, self._given.model.modes, dict[int, tuple[str, ...]]()
        tolerance = modes if isinstance(modes, Tolerance) else None
        rigid = any(contact.rigid for contact in model.contacts)
        for k, verdict in several.verdicts(runs, least_indicator(tolerance)).items():
            visited = several.visited(k)
            if visited not in self._around:
                trajectory = several.land(k).trajectory(several.end)
                self._around[visited] = Known.of(model, trajectory.segments).around(trajectory)
            before, after = self._around[visited]
            struck = verdict[1] > 0 and rigid and several.struck(k)
            found[k] = (*before, *left_out_warnings(model, verdict, tolerance, struck), *after)
        return found

    def _finish(self, number: int, run: Run) -> None:
        """A run by itself, from where it has come to."""
        try:
            trajectory = warned(run)
            self.events[number], self.ends[number] = len(trajectory.events), trajectory.t_end
            self.told[number] = trajectory.status, trajectory.message, trajectory.warnings
            self._sample(number, trajectory)
            if isinstance(run.shared, _Worker):
                run.shared.most = min(SEVERAL, max(1, ROOM // (2 * len(trajectory.segments) + 1)))
        except MultiPhiError as refused:
            self.told[number] = "failed", str(refused), ()

    def _sample(self, number: int, trajectory: Trajectory) -> None:
        known = self.times <= trajectory.t_end
        if not (trajectory.segments and known.any()):
            return
        segments, times = trajectory.segments, self.times[known]
        for place, row in enumerate(self._rows_of(trajectory.model)):
            self.samples[number, place, known] = segments.values(times, "right", partial(point_row, row))

    def _rows_in(self, model: MultiPhiModel, level: LoadedLevel) -> list[np.ndarray]:
        """The points' rows (2 n + 1,) in a level of the model that runs end with, kept for the runs that follow."""
        return self._in_levels.get_or_build(
            level.states, lambda: [point_row(row, level) for row in self._rows_of(model)]
        )

    def _rows_of(self, model: MultiPhiModel) -> list[np.ndarray]:
        """The points' rows (m,) in the base coordinates of the model that runs end with, one for most of them."""
        if self._rows[0] is not model:
            rows = [model.base.modes.shapes.T @ row for row in self._points]
            self._rows = model, rows
        return self._rows[1]


class _Worker:
    """The arrays of a thread (simulate.Shared); most: how many runs are carried together."""

    def __init__(self, task: Task) -> None:
        self._task, self.most = task, 1
        self._arrays = BoundedCache[LoadedLevels, LevelArrays](KEPT)

    def levels(self, key: object, made: Callable[[], LoadedLevels]) -> LoadedLevels:
        """The levels under the loads, those of all threads."""
        return self._task.levels.get_or_build(key, made)

    def motion(self, levels: LoadedLevels, start: Start, compiled: bool | None) -> Motion:
        """A run on the thread's arrays."""
        motion = Motion(self._arrays.get_or_build(levels, lambda: _roomy(levels)), start, compiled, self.loop)
        motion.sums_works = False  # nobody asks for a ledger
        return motion

    def loop(self, *given: Any) -> Any:
        """The compiled loop, while others may go on."""
        return self.meanwhile(carry, *given)

    def meanwhile(self, function: Callable[..., Any], *given: Any) -> Any:
        """What a compiled function returns, while others may go on."""
        self._task.lock.release()
        try:
            return function(*given)
        finally:
            self._task.lock.acquire()


def _roomy(levels: LoadedLevels) -> LevelArrays:
    """Arrays with room for the record of several runs."""
    arrays = LevelArrays(levels)
    arrays.room = ROOM
    return arrays
