"""Truncation: estimate, from a run itself, of the error that r instead of all modes make.

The indicator adds the defects of a run (defects.py) like independent errors and relates them to the motion:

    indicator(T) = sqrt( sum over instants until T of |defect|^2 / mean of |y|^2 over [0, T] )

The mean is that of a polygon through 25 instants evenly spaced: the indicator is known to some per cent of itself. It
predicts an error, it does not bound it: it does not include how fast neighbouring motions separate, and motion that one
level contains and the next one drops has little weight in it (keep the levels' highest frequencies near each other).

A Tolerance is therefore not decided by the indicator alone: the run is repeated with twice as many modes, and holds if
both differ by less than the tolerance / SAFETY, in |y| and at every point of the structure, and so does a run with four
times as many: which contact strikes first may hang on a mode that both of two runs lack. Where the largest number of
modes is reached before, the difference to half of it is told.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.mode_choice import TRIED, Tolerance, UpTo
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.reliability.defects import DefectHistory
from multiphi_exudyn.time.reliability.truncation_warnings import CHANGE
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["run_with_enough_modes", "truncation_indicator"]

APART = 1.5  # times as many modes has a run by which another one is judged
SAFETY = 2.0  # of the difference to a run with twice as many modes: the error of the coarser one is larger by its own
INSTANTS = 400  # at which two runs are compared
UNMOVED = 1e-3  # of what a point could move by |y|: a smaller motion there is not compared
FEWEST = 3  # modes of the open level in the first run
GROWTH = 0.25  # of its modes are added each time, at least one
ABOVE = 1 + 1e-9  # of its last mode's frequency: the cut-off that keeps this mode


def truncation_indicator(trajectory: Trajectory, until: float | None = None) -> float:
    """Estimate of the relative error of displacements that truncation has made.

        indicator(T) = sqrt( sum over instants until T of |defect|^2 / mean of |y|^2 over [0, T] )

    The defects of a run are the motion at its events that the modes of the next level do not contain; the mean is that
    of a polygon through 25 instants evenly spaced. The indicator predicts an error, it does not bound it: it does not
    include how fast neighbouring motions separate.

    Parameters
    ----------
    trajectory : Trajectory
        Of ``simulate``.
    until : float, default None
        T [s], None for the end of the trajectory.

    Returns
    -------
    float
        The estimate; 0.01 is 1 %.

    Raises
    ------
    MultiPhiTypeError
        For anything but a Trajectory.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> tr = mp.simulate(model, 0.5, displacement=pulled)
    >>> mp.truncation_indicator(tr) < 1e-9  # all modes are kept: nothing is lost
    True
    """
    if not isinstance(trajectory, Trajectory):
        raise MultiPhiTypeError(f"trajectory: got {type(trajectory).__name__}, need a Trajectory")
    return DefectHistory.of(trajectory).indicator(trajectory.t_end if until is None else until)


def run_with_enough_modes(model: MultiPhiModel, run: Callable[[MultiPhiModel], Trajectory]) -> Trajectory:
    """Repeat ``run`` with more modes until the Tolerance of the model is met; ``Trajectory.model`` has these modes.

    The open level begins with the modes that contain the static flexibility of every contact, and is given more until
    the indicator is below the tolerance and runs with two and four times as many differ by less; every other level has
    its modes up to the same frequency. The last try is all modes of the structure, unless the tolerance allows fewer:
    then the model keeps the change from half as many, if that is more than the tolerance. The base, at first of TRIED
    modes, is doubled when more are needed.
    """
    tolerance = model.modes
    assert isinstance(tolerance, Tolerance), "the caller has checked it"
    most = min(tolerance.most, model.structure.n)
    attempts = _Attempts(replace(model, modes=most if model.base.complete else min(most, TRIED)), most, run)
    level = attempts.level
    count = max(_modes_for_flexibility(level, tolerance.error), min(int(np.sum(level.omega == 0)) + 1, most))
    while True:
        count, trajectory = attempts.run(count)
        if trajectory.status != "ok" or trajectory.model.modes == "all":
            return trajectory
        if truncation_indicator(trajectory) <= tolerance.error:
            changes = [_change(trajectory, other) for other in attempts.judges(count)]
            if count < most and changes and max(changes) <= tolerance.error / SAFETY:
                return trajectory
            if (count == most or math.inf in changes) and max(changes) > tolerance.error:
                trajectory.model.entries.keep(CHANGE, max(changes))
            if math.inf in changes:
                return trajectory
        if count == most:
            return trajectory
        count = min(most, count + max(1, round(GROWTH * count)))


class _Attempts:
    """Runs with numbers of modes up to ``most``; level: the open one of a model with at least so many."""

    def __init__(self, source: MultiPhiModel, most: int, run: Callable[[MultiPhiModel], Trajectory]) -> None:
        self._source, self._most, self._run = source, most, run
        self.level, self._runs = source.level(()), dict[int, Trajectory]()

    def run(self, count: int) -> tuple[int, Trajectory]:
        """Trajectory with ``count`` modes, or as many as there may be, and their number before it."""
        count = max(1, min(count, self._most))
        while count > self.level.modes < self._most:
            modes = self.level.modes
            self._source = replace(self._source, modes=min(self._most, 2 * modes))
            self.level = self._source.level(())
            if self.level.modes <= modes:
                break
        count = min(count, self.level.modes)
        if count not in self._runs:
            self._runs[count] = self._run(replace(self._source, modes=_mode_choice(self.level, count)))
        return count, self._runs[count]

    def judges(self, count: int) -> list[Trajectory]:
        """Runs by which one of ``count`` modes is judged: with twice and four times as many, and all at the most.

        With half as many, where there may not be more; none where there are too few more.
        """
        if count == self._most:
            return [self.run(count // 2)[1]]
        found = dict[int, Trajectory]()
        for factor in (2, 4):
            known = [other for other in self._runs if other >= min(self._most, APART * factor / 2 * count)]
            other, trajectory = self.run(min(known, default=factor * count))
            if other >= APART * count or trajectory.model.modes == "all":
                found[other] = trajectory
        return list(found.values())


def _change(coarser: Trajectory, finer: Trajectory) -> float:
    """Largest relative difference of two runs, as root mean squares over time: of |y|, and at points that move."""
    if finer.status != "ok":
        return math.inf
    times = np.linspace(coarser.t_start, coarser.t_end, INSTANTS)
    x, difference = finer.displacement(times), coarser.displacement(times)
    difference -= x
    base, rows = finer.model.base, np.array([finer.model.structure.row(name) for name in finer.points])
    y, apart = base.coordinates(x), base.coordinates(difference)
    whole, largest = float(np.linalg.norm(y)), float(np.linalg.norm(apart))
    change = largest / whole if whole > 0 else 0.0
    for row in rows:
        moved, reach = float(np.linalg.norm(row @ x)), float(np.linalg.norm(base.modes.shapes.T @ row))
        if moved > UNMOVED * reach * whole:
            change = max(change, float(np.linalg.norm(row @ difference)) / moved)
    return change


def _mode_choice(level: Level, count: int) -> str | int | UpTo:
    """Choice of modes that keeps ``count`` in the open level and the same frequencies in the others."""
    highest = float(level.frequencies[count - 1])
    if count == level.base.modes.count:
        return "all"
    return UpTo(ABOVE * highest, count) if highest > 0 else count


def _modes_for_flexibility(level: Level, error: float) -> int:
    """Smallest number of modes that leaves a static residual below the error at every contact."""
    elastic = level.omega > 0
    flexibility = np.zeros_like(level.gap_rows)
    flexibility[:, elastic] = (level.gap_rows[:, elastic] / level.omega[elastic]) ** 2
    partial_sums = np.cumsum(flexibility, axis=1)
    enough = partial_sums >= (1 - error) * partial_sums[:, -1:]
    return max(FEWEST, 1 + int(np.max(np.argmax(enough, axis=1), initial=0)))
