"""Many runs on all cores: of one model from many starts, or of models and loads that differ in numbers.

The core advances a batch of runs at a time on its threads. What a run needs of Python, its start before it and its
warnings after it, is done by one thread. Levels are built once for all starts; models that differ in gaps share the
modes of their levels, and have a static response each. Every run is the same, to the bit, as a run alone, for any
number of threads. Only what is asked for of a run is kept.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from dataclasses import fields as fields_of
from functools import partial
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.levels.model.mode_choice import Tolerance, is_count
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.arguments import is_real, no_text, real_array
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

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["ManyGiven", "ManyRuns", "StartVectors", "Task", "simulate_many"]

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
    contacts : tuple (c,)
        As they were given.
    times : array (t,)
        [s].
    samples : array (k, p, t)
        Displacements of the points [m] at the times, NaN after the failure of a run.
    forces : array (k, c, t)
        Forces of the contacts [N] at the times, NaN after the failure of a run.
    impulses : array (k, c)
        Integrals of the forces over each run [N s], impulses of impacts included.
    contact_times : array (k, c)
        How long each contact is closed [s].
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
    varied : dict of str to array (k,)
        The numbers in which the runs differ, as they were given.
    """

    points: tuple[At, ...]
    contacts: tuple[str, ...]
    times: np.ndarray
    samples: np.ndarray
    forces: np.ndarray
    impulses: np.ndarray
    contact_times: np.ndarray
    events: np.ndarray
    ends: np.ndarray
    status: tuple[str, ...]
    messages: tuple[str, ...]
    warnings: tuple[tuple[str, ...], ...]
    varied: dict[str, np.ndarray]

    def to_dataframe(self) -> DataFrame:
        """A pandas table, a row for each run.

        Columns: the numbers varied, "status", "events", "end" [s], for every point "peak NAME" [m], the largest
        |displacement| at the times, and for every contact "peak force NAME" [N] at the times, "impulse NAME" [N s] and
        "closed NAME" [s].
        """
        from pandas import DataFrame

        columns: dict[str, Any] = {**self.varied, "status": self.status, "events": self.events, "end": self.ends}
        for place, point in enumerate(self.points):
            name = point if isinstance(point, str) else f"point {place}"
            columns[f"peak {name}"] = np.max(np.abs(self.samples[:, place]), axis=1)
        for place, name in enumerate(self.contacts):
            columns[f"peak force {name}"] = np.max(self.forces[:, place], axis=1)
            columns[f"impulse {name}"] = self.impulses[:, place]
            columns[f"closed {name}"] = self.contact_times[:, place]
        return DataFrame(columns)


def simulate_many(
    model: MultiPhiModel,
    t_end: float,
    displacements: np.ndarray | None = None,
    velocities: np.ndarray | None = None,
    loads: Sequence[Load] = (),
    points: Sequence[At] = (),
    times: np.ndarray | None = None,
    threads: int | None = None,
    vary: Mapping[str, np.ndarray] | None = None,
    contacts: Sequence[str] = (),
) -> ManyRuns:
    """Many runs: from many starts, or with other gaps, stiffnesses, loads; each is what ``simulate`` gives, to the bit.

    Parameters
    ----------
    model : MultiPhiModel
        Structure, contacts and modes.
    t_end : float
        End of every run [s].
    displacements, velocities : array (k, n) or (n,), default None
        x [m, rad] and x' [m/s, rad/s] at t = 0 of each run, or of all; None for zero. Without ``vary`` one of them is
        needed.
    loads : sequence of loads, default ()
        Of all runs, as of ``simulate``.
    points : sequence of str, mapping or array (n,), default ()
        Names, {point: coefficient} or rows, at which displacements are sampled.
    times : array (t,), default None
        At which they are [s], None for the end alone.
    threads : int, default None
        Number of threads, without effect on the answer. None for the number of cores.
    vary : mapping of str to array (k,), default None
        Numbers in which the runs differ: "NAME.FIELD" of a contact, friction or force law, such as "stop.gap",
        "stop.stiffness" or "ring.limit", and "loads.I.FIELD" of the I-th load, such as "loads.0.amplitude". Runs whose
        gaps or loads differ share the modes of their levels.
    contacts : sequence of str, default ()
        Names of contacts whose forces are sampled, with their impulses and contact times.

    Returns
    -------
    ManyRuns
        Samples, events and warnings of each; ``to_dataframe`` is a table of them. A run that fails, or whose start is
        refused, is a status of its row. Warnings are issued by their kinds, with the numbers of the runs.

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
    >>> gaps = np.linspace(0.5e-3, 2e-3, 4)
    >>> runs = mp.simulate_many(model, 0.5, velocities=speeds[-1], contacts=["stop"], vary={"stop.gap": gaps})
    >>> runs.to_dataframe()["impulse stop"].round(2).tolist() == [round(float(p), 2) for p in runs.impulses[:, 0]]
    True
    """
    from tqdm import tqdm

    end, starts = checked_end(model, t_end), _starts(model, displacements, velocities, _count(vary))
    no_text("points", points)
    no_text("contacts", contacts)
    wider = holding(model, loads)
    rows = [(isinstance(point, (str, Mapping)), model.structure.row(point)) for point in points]
    outside = [sentence for named, row in rows if not named for sentence in row_warnings(wider, row)]
    Excitation.of(wider, loads, end)  # refuses loads that are wrong for all runs
    for name in contacts:
        model.index(name)
    runs = ManyGiven(Run(wider, end, loads=loads), starts, vary or {})
    task = Task(runs, [row for _, row in rows], contacts, _times(times, end))
    with tqdm(total=len(starts), unit="run", disable=None, leave=False, delay=BAR_DELAY) as bar:
        task.carry_out(_checked(threads), bar)
    status, messages, warnings = zip(*task.results, strict=True)
    groups = grouped((str(number), sentences) for number, sentences in enumerate(warnings))
    issue((*outside, *(group.told(len(starts)) for group in groups)))
    return ManyRuns(
        points=tuple(points),
        contacts=tuple(contacts),
        times=task.times,
        samples=task.samples,
        forces=task.forces,
        impulses=task.impulses,
        contact_times=task.contact_times,
        events=task.events,
        ends=task.ends,
        status=status,
        messages=messages,
        warnings=warnings,
        varied={name: np.asarray(values) for name, values in (vary or {}).items()},
    )


def _count(vary: Any) -> int | None:
    """The number of runs that ``vary`` asks for, None without it."""
    if not vary:
        return None
    if not isinstance(vary, Mapping):
        raise MultiPhiTypeError(f"vary: got {type(vary).__name__}, need a mapping such as {{'stop.gap': array}}")
    lengths = {name: np.shape(real_array(f"vary {name!r}", values, "a (k,) array")) for name, values in vary.items()}
    shapes = set(lengths.values())
    if len(shapes) > 1 or len(shape := shapes.pop()) != 1 or not shape[0]:
        raise MultiPhiValueError(f"vary: got shapes {lengths}, need arrays (k,), k the same for all")
    return int(shape[0])


class ManyGiven(Sequence[Run]):
    """The runs as they are given, each made anew when it is asked for: ``run`` with its start and numbers of ``vary``.

    differ: whether they have other models or loads. An error names what is not there, or not possible.
    """

    def __init__(self, run: Run, starts: Sequence[StartVectors], vary: Mapping[str, np.ndarray]) -> None:
        self._run, self._starts = run, starts
        self._fields = [(_place(run, name), np.asarray(values, float)) for name, values in vary.items()]
        self.differ = bool(vary)

    def __len__(self) -> int:
        return len(self._starts)

    def __getitem__(self, number: int) -> Run:  # type: ignore[override]
        x, x_t = self._starts[number]
        model, loads = self._run.model, self._run.loads
        contacts, varied_loads = list(model.contacts), list(loads)
        for (of_load, index, field), values in self._fields:
            items: list[Any] = varied_loads if of_load else contacts
            items[index] = replace(items[index], **{field: float(values[number])})
        if any(not of_load for (of_load, _, _), _ in self._fields):
            model = replace(model, contacts=contacts)
        if any(of_load for (of_load, _, _), _ in self._fields):
            loads = tuple(varied_loads)
        return replace(self._run, model=model, loads=loads, displacement=x, velocity=x_t)


def _place(run: Run, name: str) -> tuple[bool, int, str]:
    """Whether a name is that of a load's number, its place among the loads or contacts, and its field."""
    owner, _, field = str(name).rpartition(".")
    prefix, _, number = owner.rpartition(".")
    of_load = prefix == "loads" and number.isdigit() and owner not in {contact.name for contact in run.model.contacts}
    if of_load and int(number) >= len(run.loads):
        raise MultiPhiValueError(f"vary: got {name!r}, need the number of a load, 0 to {len(run.loads) - 1}")
    index = int(number) if of_load else run.model.index(owner)
    item: Any = run.loads[index] if of_load else run.model.contacts[index]
    known = [each.name for each in fields_of(item) if is_real(getattr(item, each.name))]
    if field not in known:
        raise MultiPhiValueError(f"vary: got {name!r}, need a number of it: {', '.join(known)}")
    return of_load, index, field


def _starts(model: MultiPhiModel, displacements: Any, velocities: Any, count: int | None) -> list[StartVectors]:
    """x and x' of every start, of ``count`` runs where it is given."""
    n, needed = model.structure.n, "a (k, n) array of real numbers"
    given = {"displacements": displacements, "velocities": velocities}
    arrays = {name: real_array(name, values, needed) for name, values in given.items() if values is not None}
    if not arrays and count is None:
        raise MultiPhiTypeError(f"displacements: got None, and no velocities, need {needed}")
    if count is None:
        count = len(next(iter(arrays.values())))
    else:
        arrays = {name: np.tile(values, (count, 1)) if values.ndim == 1 else values for name, values in arrays.items()}
    for name, values in arrays.items():
        if values.ndim != 2 or values.shape != (count, n) or not count:
            raise MultiPhiValueError(f"{name}: got shape {values.shape}, need (k, {n}), k the same for all")
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


def _is_undecided(model: MultiPhiModel) -> bool:
    """Whether a model with a Tolerance has yet to find its modes by a run."""
    return isinstance(model.modes, Tolerance) and model.decided is None


class Task:
    """Runs to be done, and their results; points: rows (n,); contacts: names.

    samples, forces, impulses, contact_times, events, ends: see ManyRuns. results: status, message and warnings of each.
    """

    def __init__(
        self, runs: ManyGiven, points: Sequence[np.ndarray], contacts: Sequence[str], times: np.ndarray
    ) -> None:
        self._runs, self._points, self._contacts, self.times = runs, points, contacts, times
        count, shape = len(runs), (len(runs), len(contacts))
        self.samples = np.full((count, len(points), len(times)), np.nan)
        self.forces, self.impulses, self.contact_times = np.full((*shape, len(times)), np.nan), *np.zeros((2, *shape))
        self.ends, self.events = np.zeros(count), np.zeros(count, int)
        self.results = [("failed", "", tuple[str, ...]())] * count
        self._kept = None if runs.differ else BoundedCache[object, LoadedLevels](KEPT)

    def carry_out(self, threads: int, bar: Any) -> None:
        """Do all runs; the first ones, one after the other, decide the modes of a Tolerance."""
        numbers = list(range(len(self._runs)))
        alone = len(numbers) if refined(self._runs[0].loads) else 1  # a first run sets the size of batches
        while numbers and (alone > 0 or _is_undecided(self._runs[numbers[0]].model)):
            segments = self._finish(numbers[0], self._run(numbers[0]))
            numbers, alone = numbers[1:], alone - 1
            bar.update()
        while numbers:
            count = max(threads, min(BATCH * threads, MOST_SEGMENTS // (segments + 1)))
            batch, numbers = numbers[:count], numbers[count:]
            segments = self._run_batch(batch, threads)
            bar.update(len(batch))

    def _run(self, number: int) -> Run:
        """A run, with what it shares with the others."""
        return replace(self._runs[number], shared=self._kept)

    def _run_batch(self, numbers: Sequence[int], threads: int) -> int:
        """Do a batch of runs; return the largest number of segments of one."""
        begun, rules = list[tuple[int, Run, LoadedLevels, Start]](), dict[int, Starts]()
        for number in numbers:
            run = self._run(number)
            try:
                levels = replace(run, model=run.model.decided or run.model).levels()
                rule = rules.setdefault(id(levels), Starts(levels, run.t_end))  # a batch keeps its levels
                begun.append((number, run, levels, rule.first(run.displacement, run.velocity)))
            except MultiPhiError as error:
                self.results[number] = "failed", str(error), ()
        if not begun:
            return 0
        built = [levels.in_core for _, _, levels, _ in begun]
        given = [core_start(levels, start) for _, _, levels, start in begun]
        _, run, levels, _ = begun[0]
        done = core.run_batch(built, given, *limits(levels.model), levels.drive.time, run.t_end, threads)
        largest = 0
        for (number, run, levels, start), in_core, each in zip(begun, built, done, strict=True):
            ahead = Motion.ended(levels, in_core, start, each) if each.is_complete else None
            largest = max(largest, self._finish(number, replace(run, ahead=ahead)))
        return largest

    def _finish(self, number: int, run: Run) -> int:
        """Keep the results of a run, done here unless its motion is ahead; return its number of segments."""
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
        if not trajectory.segments:
            return
        for place, name in enumerate(self._contacts):
            self.impulses[number, place] = trajectory.contact_impulse(name, 0.0, trajectory.t_end)
            self.contact_times[number, place] = sum(b - a for a, b in trajectory.contact_intervals(name))
        if not reached.any():
            return
        segments, times = trajectory.segments, self.times[reached]
        for place, row in enumerate(self._rows_of(trajectory.model)):
            self.samples[number, place, reached] = segments.values(times, "right", partial(point_row, row))
        for place, name in enumerate(self._contacts):
            self.forces[number, place, reached] = trajectory.contact_force(name, times)

    def _rows_of(self, model: MultiPhiModel) -> list[np.ndarray]:
        """Rows (m,) of the points in the base coordinates of a run's final model."""
        return [model.base.modes.shapes.T @ row for row in self._points]
