"""Many runs of one model that differ in their starts alone, on as many threads as are worth it.

A thread carries one run at a time, on arrays of its own; levels are built once, for all. The compiled loop lets other
threads go on, and everything else of a run is done by one thread at a time, so a run is what it is alone, to the bit,
however many threads there are. What is not asked for is not kept.
"""

from __future__ import annotations

import functools
import itertools
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.loaded_levels import LoadedLevels
from multiphi_exudyn.levels.mode_choice import Tolerance, is_count
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.arguments import no_text, real_array
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.structure import At
from multiphi_exudyn.time.base_share import row_warnings
from multiphi_exudyn.time.level_rows import point_row
from multiphi_exudyn.time.motion import Motion, carry
from multiphi_exudyn.time.segment import listed
from multiphi_exudyn.time.simulate import Run, checked_end, holding, warned
from multiphi_exudyn.time.start import Start
from multiphi_exudyn.time.trajectory import Trajectory
from multiphi_exudyn.time.warning_groups import grouped, issue

__all__ = ["ManyRuns", "simulate_many"]

BAR_DELAY = 2.0  # s before a progress bar appears
KEPT = 8  # levels under loads as finely interpolated as runs have needed
TRIED = 8  # first runs, by which the number of threads is chosen
MOSTLY = 0.6  # of their time in the loop: below it threads wait for each other longer than they gain

_Start: TypeAlias = "tuple[np.ndarray | None, np.ndarray | None]"


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
        Displacements of the points [m] at the times, NaN from where a run has failed.
    events : array (k,)
        Their numbers.
    ends : array (k,)
        How far each came [s].
    status : tuple of str
        "ok" or "failed" of each.
    messages : tuple of str
        The causes.
    warnings : tuple of tuple of str
        What to distrust in each.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> runs = mp.simulate_many(model, 0.5, velocities=np.diag([0.5, 0.5, 0.5]), points=["tip"])
    >>> runs.samples.shape, set(runs.status)
    ((3, 1, 1), {'ok'})
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
        How many; the answer does not hang on it. None for as many as there are cores where the loop takes most of the
        first runs' time, and one elsewhere: all but the loop is done by one thread at a time.

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
    Excitation.of(wider, loads, end)  # what is wrong with a load is so for all runs
    given = Run(wider, end, loads=loads)
    task = _Task(given, starts, tuple(points), _times(times, end))
    with tqdm(total=len(starts), unit="run", disable=None, leave=False, delay=BAR_DELAY) as bar:
        task.carry_out(_checked(threads), bar)
    result = task.result()
    groups = grouped((str(number), sentences) for number, sentences in enumerate(result.warnings))
    issue((*outside, *(group.told(len(starts)) for group in groups)))
    return result


class _Task:
    """Runs to be done, and what is kept of them; given: what they have in common.

    lock: whoever has it works on levels and on what is kept.
    """

    def __init__(self, given: Run, starts: list[_Start], points: tuple[At, ...], times: np.ndarray) -> None:
        self.lock, self._stopped, self._given, self._starts = threading.Lock(), False, given, starts
        self.levels = BoundedCache[object, LoadedLevels](KEPT)
        self._rows: tuple[MultiPhiModel | None, list[np.ndarray]] = None, []
        self._points, self._times, count = points, times, len(starts)
        self._samples, self._ends = np.full((count, len(points), len(times)), np.nan), np.zeros(count)
        self._events, self._told = np.zeros(count, int), [("failed", "", tuple[str, ...]())] * count

    def carry_out(self, threads: int | None, bar: Any) -> None:
        """All runs; a Tolerance is decided by the first ones, one after the other."""
        left, model = iter(range(len(self._starts))), self._given.model
        while isinstance(model.modes, Tolerance) and model.decided is None and (number := next(left, None)) is not None:
            self._run(number, None)
            bar.update()
        threads = self._chosen(left, bar) if threads is None else threads
        with ThreadPoolExecutor(threads) as pool:
            working = [pool.submit(self._work, left, bar) for _ in range(threads)]
            try:
                for each in working:
                    each.result()
            finally:
                self._stopped = True

    def _chosen(self, left: Iterator[int], bar: Any) -> int:
        """How many threads are worth it, by the first runs."""
        worker, begun = _Worker(self), time.perf_counter()
        with self.lock:
            for number in itertools.islice(left, TRIED):
                self._run(number, worker)
                bar.update()
        return os.cpu_count() or 1 if worker.looped > MOSTLY * (time.perf_counter() - begun) else 1

    def result(self) -> ManyRuns:
        """What is kept."""
        status, messages, warnings = zip(*self._told, strict=True)
        kept = self._samples, self._events, self._ends
        return ManyRuns(self._points, self._times, *kept, status, messages, warnings)

    def _work(self, left: Iterator[int], bar: Any) -> None:
        worker = _Worker(self)
        with self.lock:
            while not self._stopped and (number := next(left, None)) is not None:
                self._run(number, worker)
                bar.update()

    def _run(self, number: int, worker: _Worker | None) -> None:
        displacement, velocity = self._starts[number]
        run = replace(self._given, displacement=displacement, velocity=velocity, shared=worker)
        try:
            trajectory = warned(run)
            self._events[number], self._ends[number] = len(trajectory.events), trajectory.t_end
            self._told[number] = trajectory.status, trajectory.message, trajectory.warnings
            self._sample(number, trajectory)
        except MultiPhiError as refused:
            self._told[number] = "failed", str(refused), ()

    def _sample(self, number: int, trajectory: Trajectory) -> None:
        known = self._times <= trajectory.t_end
        if not (trajectory.segments and known.any()):
            return
        segments, times = listed(trajectory.segments), self._times[known]
        for place, row in enumerate(self._rows_of(trajectory.model)):
            self._samples[number, place, known] = segments.values(times, "right", functools.partial(point_row, row))

    def _rows_of(self, model: MultiPhiModel) -> list[np.ndarray]:
        """The points' rows (m,) in the base coordinates of the model that runs end with, one for most of them."""
        if self._rows[0] is not model:
            rows = [model.base.modes.shapes.T @ model.structure.row(point) for point in self._points]
            self._rows = model, rows
        return self._rows[1]


class _Worker:
    """The arrays of a thread (simulate.Shared); looped: time [s] that it has been in the loop."""

    def __init__(self, task: _Task) -> None:
        self._task, self.looped = task, 0.0
        self._arrays = BoundedCache[LoadedLevels, LevelArrays](KEPT)

    def levels(self, key: object, made: Callable[[], LoadedLevels]) -> LoadedLevels:
        """The levels under the loads, those of all threads."""
        return self._task.levels.get_or_build(key, made)

    def motion(self, levels: LoadedLevels, start: Start, compiled: bool | None) -> Motion:
        """A run on the thread's arrays."""
        arrays = self._arrays.get_or_build(levels, lambda: LevelArrays(levels))
        motion = Motion(arrays, start, compiled, self._loop)
        motion.sums_works = False  # an outcome has no ledger
        return motion

    def _loop(self, *given: Any) -> Any:
        """The compiled loop, while others may go on."""
        self._task.lock.release()
        begun = time.perf_counter()
        try:
            return carry(*given)
        finally:
            self.looped += time.perf_counter() - begun
            self._task.lock.acquire()


def _starts(model: MultiPhiModel, displacements: Any, velocities: Any) -> list[_Start]:
    """x and x' of every start."""
    n, needed = model.structure.n, "a (k, n) array of real numbers"
    given = {"displacements": displacements, "velocities": velocities}
    found = {name: real_array(name, values, needed) for name, values in given.items() if values is not None}
    if not found:
        raise MultiPhiTypeError(f"displacements: got None, and no velocities, need {needed}")
    count = len(next(iter(found.values())))
    for name, values in found.items():
        if values.ndim != 2 or values.shape != (count, n) or not count:
            raise MultiPhiValueError(f"{name}: got shape {values.shape}, need (k, {n}), k the same for both")
    none = [None] * count
    return list(zip(found.get("displacements", none), found.get("velocities", none), strict=True))


def _times(given: Any, end: float) -> np.ndarray:
    """The times of samples, ``end`` where none are given."""
    if given is None:
        return np.array([end])
    times = np.asarray(real_array("times", given, "a list of times in s"))
    if times.ndim != 1 or not np.all((times >= 0) & (times <= end)):
        raise MultiPhiValueError(f"times: got {times}, need times from 0 to {end:g} s")
    return times


def _checked(threads: int | None) -> int | None:
    if threads is not None and not is_count(threads):
        raise MultiPhiTypeError(f"threads: got {threads!r}, need an integer or None")
    if threads is not None and threads < 1:
        raise MultiPhiValueError(f"threads: got {threads}, need at least 1")
    return threads
