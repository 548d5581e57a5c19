"""Many runs of one model that differ in their starts alone, on all cores.

The core advances a batch of runs at a time on its threads; levels are built once, for all. Every run is the same, to
the bit, as a run alone, for any number of threads. Only the requested samples of a run are kept.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.levels.model.mode_choice import is_count
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads.loads import Load
from multiphi_exudyn.mechanics.structures.arguments import no_text, real_array
from multiphi_exudyn.mechanics.structures.structure import At
from multiphi_exudyn.time.many.workers import StartVectors, Task
from multiphi_exudyn.time.simulate import Run, checked_end, holding
from multiphi_exudyn.time.warnings.base_warnings import row_warnings
from multiphi_exudyn.time.warnings.warning_groups import grouped, issue

__all__ = ["ManyRuns", "simulate_many"]

BAR_DELAY = 2.0  # s before a progress bar appears


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
