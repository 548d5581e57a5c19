"""Many runs of one model that differ in their starts alone, on all cores.

The core advances a batch of runs at a time on its threads; levels are built once, for all. Every run is the same, to
the bit, as a run alone, for any number of threads. Only the requested samples of a run are kept.

What a run needs of Python, its start before it and its warnings after it, is done by one thread.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.model.mode_choice import Tolerance, is_count
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.arguments import no_text, real_array
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.model_warnings import grouped, issue, row_warnings
from multiphi_exudyn.time.motion import Motion, core_start, limits
from multiphi_exudyn.time.segments import point_row
from multiphi_exudyn.time.simulate import Run, checked_end, holding, refined, run_with_warnings
from multiphi_exudyn.time.start import Start, Starts
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["ManyRuns", "StartVectors", "Task", "simulate_many"]

BAR_DELAY = 2.0  # s before a progress bar appears
KEPT = 8  # sets of levels under loads, one for each fineness of interpolation
BATCH = 64  # runs of a batch, for each thread: a progress bar then moves
MOST_SEGMENTS = 2**20  # of a batch: they are kept in memory until its results have been read

StartVectors: TypeAlias = "tuple[np.ndarray | None, np.ndarray | None]"  # x and x' (n,)


@dataclass(frozen=True)
class ManyRuns:
    """Statuses, warnings and samples of k runs; made by ``simulate_many``.

    Attributes
    ----------
    points : tuple (p,)
        As they were given.
    times : array (t,)
        [s].
    samples : array (k, p, t)
        Displacements of the points [m] at the times, NaN after the failure of a run.
    events : array (k,)
        Number of events of each run.
    ends : array (k,)
        End of each run [s].
    status : tuple of str
        "ok" or "failed" of each.
    messages : tuple of str
        The causes.
    warnings : tuple of tuple of str
        What to distrust in each.
    """

    points: tuple[At, ...]
    times: np.ndarray
    samples: np.ndarray
    events: np.ndarray
    ends: np.ndarray
    status: tuple[str, ...]
    messages: tuple[str, ...]
    warnings: tuple[tuple[str, ...], ...]


def simulate_many(
    model: MultiPhiModel,
    t_end: float,
    displacements: np.ndarray | None = None,
    velocities: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    points: Sequence[At] = (),
    times: np.ndarray | None = None,
    threads: int | None = None,
) -> ManyRuns:
    """Runs of one model from many starts; each gives what ``simulate`` gives, to the bit.

    Parameters
    ----------
    model : MultiPhiModel
        Structure, contacts and modes.
    t_end : float
        End of every run [s].
    displacements, velocities : array (k, n), default None
        x [m, rad] and x' [m/s, rad/s] at t = 0, None for zero; one of them is needed.
    loads : sequence of loads, default ()
        Of all runs, as of ``simulate``.
    points : sequence of str, mapping or array (n,), default ()
        Names, {point: coefficient} or rows, at which displacements are sampled.
    times : array (t,), default None
        At which they are [s], None for the end alone.
    threads : int, default None
        Number of threads, without effect on the answer. None for the number of cores.

    Returns
    -------
    ManyRuns
        Samples, events and warnings of each. A run that fails, or whose start is refused, is a status of its row.
        Warnings are issued by their kinds, with the numbers of the runs.

    Raises
    ------
    MultiPhiTypeError, MultiPhiValueError
        For arguments of another kind, and for what is wrong for all runs.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> speeds = np.zeros((100, 3))
    >>> speeds[:, 2] = np.linspace(0.01, 0.5, 100)
    >>> runs = mp.simulate_many(model, 0.5, velocities=speeds, points=["tip"])
    >>> runs.samples.shape, set(runs.status)
    ((100, 1, 1), {'ok'})
    """
    from tqdm import tqdm

    end, starts = checked_end(model, t_end), _starts(model, displacements, velocities)
    no_text("points", points)
    wider = holding(model, loads)
    rows = [(isinstance(point, (str, Mapping)), model.structure.row(point)) for point in points]
    outside = [sentence for named, row in rows if not named for sentence in row_warnings(wider, row)]
    Excitation.of(wider, loads, end)  # refuses loads that are wrong for all runs
    given = Run(wider, end, loads=loads)
    task = Task(given, starts, [row for _, row in rows], _times(times, end))
    with tqdm(total=len(starts), unit="run", disable=None, leave=False, delay=BAR_DELAY) as bar:
        task.carry_out(_checked(threads), bar)
    status, messages, warnings = zip(*task.results, strict=True)
    groups = grouped((str(number), sentences) for number, sentences in enumerate(warnings))
    issue((*outside, *(group.told(len(starts)) for group in groups)))
    return ManyRuns(tuple(points), task.times, task.samples, task.events, task.ends, status, messages, warnings)


def _starts(model: MultiPhiModel, displacements: Any, velocities: Any) -> list[StartVectors]:
    """x and x' of every start."""
    n, needed = model.structure.n, "a (k, n) array of real numbers"
    given = {"displacements": displacements, "velocities": velocities}
    arrays = {name: real_array(name, values, needed) for name, values in given.items() if values is not None}
    if not arrays:
        raise MultiPhiTypeError(f"displacements: got None, and no velocities, need {needed}")
    count = len(next(iter(arrays.values())))
    for name, values in arrays.items():
        if values.ndim != 2 or values.shape != (count, n) or not count:
            raise MultiPhiValueError(f"{name}: got shape {values.shape}, need (k, {n}), k the same for both")
    none = [None] * count
    return list(zip(arrays.get("displacements", none), arrays.get("velocities", none), strict=True))


def _times(given: Any, end: float) -> np.ndarray:
    """The times of samples, ``end`` where none are given."""
    if given is None:
        return np.array([end])
    times = np.asarray(real_array("times", given, "a list of times in s"))
    if times.ndim != 1 or not np.all((times >= 0) & (times <= end)):
        raise MultiPhiValueError(f"times: got {times}, need times from 0 to {end:g} s")
    return times


def _checked(threads: int | None) -> int:
    if threads is not None and not is_count(threads):
        raise MultiPhiTypeError(f"threads: got {threads!r}, need an integer or None")
    if threads is not None and threads < 1:
        raise MultiPhiValueError(f"threads: got {threads}, need at least 1")
    return threads or os.cpu_count() or 1


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

    def _run_batch(self, numbers: Sequence[int], threads: int) -> int:
        """Do a batch of runs; return the largest number of segments of one."""
        given, end = self._given, self._given.t_end
        levels = replace(given, model=given.model.decided or given.model, shared=self._kept).levels()
        waiting, starts, rule = list[int](), list[Start](), Starts(levels, end)
        for number in numbers:
            try:
                starts.append(rule.first(*self._starts[number]))
                waiting.append(number)
            except MultiPhiError as error:
                self.results[number] = "failed", str(error), ()
        built, window = levels.in_core, limits(levels.model)
        given_starts = [core_start(levels, start) for start in starts]
        runs = core.run_batch(built, given_starts, *window, levels.drive.time, end, threads)
        largest = 0
        for k, run in enumerate(runs):
            ahead = Motion.ended(levels, built, starts[k], run) if run.is_complete else None
            largest = max(largest, self._finish(waiting[k], ahead))
        return largest

    def _finish(self, number: int, ahead: Motion | None) -> int:
        """Keep the results of a run, done alone unless it is ``ahead``; return its number of segments."""
        x, x_t = self._starts[number]
        run = replace(self._given, displacement=x, velocity=x_t, shared=self._kept, ahead=ahead)
        try:
            trajectory = run_with_warnings(run)
        except MultiPhiError as error:
            self.results[number] = "failed", str(error), ()
            return 0
        self.events[number], self.ends[number] = len(trajectory.events), trajectory.t_end
        self.results[number] = trajectory.status, trajectory.message, trajectory.warnings
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
