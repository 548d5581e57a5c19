"""Run ahead: a body on which nothing acts but its own loads, told to Exudyn from a motion that is known beforehand.

A stop is the end of a step in which something happens, be it that a contact is refused; of a body whose loads vary, the
end of every step. At a stop the exact state is written, with the matrices of its level. Before and between stops Exudyn
does the steps on its own, and all there is to do for the body is to compare the time with ``next_time``.

Stops are planned many steps ahead, for steps of the length that the run has. One that is met at another time is planned
again, so steps of any length are right. At every stop Exudyn's coordinates are compared with what its steps make of the
last ones (undisturbed_steps.py): whoever has changed them on the way, unseen, ends the run. Steps of unequal length,
which cannot be told from afar, are looked at one by one from then on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.state import Event, Phase
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP, Coordinates, flags_of
from multiphi_exudyn.exudyn_plugin.body.known_motion import KnownMotion, Moments, Stretch
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.undisturbed_steps import UndisturbedSteps
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache

__all__ = ["KnownBody", "RunAhead"]

SAME_TIME = 1e-12  # relative: what adding up thousands of steps leaves of a time
STEPS_AHEAD = 4096  # planned at once, of which few are stops: computed in the time of as many steps of Exudyn
ROWS_AHEAD = 256  # planned at once where every step is a stop
CHANGED = 1e-6  # of the largest coordinate: more than Newton's iterations leave, less than anybody means to change
UNSEEN = 1e-9  # of what brings a contact to its stop: coordinates this small are round-off of rest


class KnownBody(Protocol):
    """What is needed of a body. varies: whether its loads do."""

    name: str
    model: MultiPhiModel
    coordinates: Coordinates

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""

    def check_matched(self, step: float) -> None:
        """Raises where steps of this length [s] are not those to which its modes are matched."""

    def stepped_level(self, closed: Sequence[int]) -> SteppedLevel:
        """The level of closed contacts as the solver has it."""

    def own_forces(self, closed: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of its own varying loads at times (k,) [s], in a level."""

    def phases_at(
        self, closed: tuple[int, ...], eta: np.ndarray, eta_t: np.ndarray, time: float, entered: Sequence[int]
    ) -> tuple[Phase, ...]:
        """Phases at a time [s] in a level that was entered with others, in numbers."""


@dataclass(frozen=True)
class _Stops:
    """k stops. due: from when on [s] they are. times: where [s] the steps end. done: how many changes of the stretch
    have then happened. levels: at them. rows (k, 3, s): q, q', q''. flags: coordinates of the data node.
    """

    due: list[float]
    times: list[float]
    done: list[int]
    levels: list[SteppedLevel]
    rows: np.ndarray
    flags: list[list[float]]


class RunAhead:
    """One run of ``body`` along ``motion``, from time to ``end`` [s] in steps of length ``step`` [s].

    next_time: the end of a step at this time [s] or later is to be reported (``arrive``). time, index: of the last one
    that was.
    """

    def __init__(self, body: KnownBody, motion: KnownMotion, time: float, step: float, end: float) -> None:
        self.next_time = -math.inf
        self.time, self.index = time, 0
        self._body, self._motion = body, motion
        self._step, self._rounding, self._end = step, SAME_STEP * step, end
        self._regular = True
        self._steps = BoundedCache[tuple[int, ...], UndisturbedSteps](body.model.most_levels)
        self._x = body.coordinates.read().copy()
        self._largest = UNSEEN * _way(body.coordinates.stepped)
        self._past = list[Stretch]()
        self._stretch = motion.advance(time)
        self._place = self._done = 0
        self._stops = self._planned(np.zeros(0), missed=False)

    @property
    def events(self) -> list[Event]:
        """What has happened so far."""
        before = [event for stretch in self._past for event in stretch.events]
        since = self._stretch.changes[self._done] if self._done < len(self._stretch.changes) else math.inf
        return before + list(self._stretch.events[: np.searchsorted(self._stretch.event_times, since)])

    def summarise(self, record: RunRecord) -> None:
        """Tell a record what has happened so far."""
        for stretch in (*self._past, self._stretch):
            for level, energy in stretch.levels(self.time):
                record.include(level, energy)

    # ------------------------------------------------------------------ a stop

    def arrive(self, mbs: Any, t: float, index: int) -> None:
        """A step has ended at t [s], the ``index``-th of the run."""
        self._compare(t, index)
        if not self._meets(t):
            self._plan(t)
        if self._meets(t):
            self._write(mbs)
        else:
            self._x = self._body.coordinates.read().copy()
        self.time, self.index = t, index
        self.next_time = self._next()

    def _meets(self, t: float) -> bool:
        """Whether the next stop is the end of the step at t."""
        times = self._stops.times
        return self._place < len(times) and abs(times[self._place] - t) <= SAME_TIME * t

    def _write(self, mbs: Any) -> None:
        stops, k, here = self._stops, self._place, self._body.coordinates
        stepped, row = stops.levels[k], stops.rows[k]
        if stepped.closed != here.stepped.closed:
            here.enter(mbs, stepped, stepped.drive)
        here.write(row)
        here.store(stops.flags[k])
        self._x[: row.size] = row.ravel()
        self._done, self._place = stops.done[k], k + 1

    def _next(self) -> float:
        if not self._regular or self._body.varies:
            return -math.inf
        last = self._stretch.end + (0.0 if self._stretch.failure else self._rounding)
        due = self._stops.due[self._place] if self._place < len(self._stops.due) else last
        return min(due, self._end - self._rounding)

    def _compare(self, t: float, index: int) -> None:
        """Raises if somebody has changed the coordinates since the last stop."""
        count = index - self.index
        if count <= 0:
            return  # the start of the run
        step, here = (t - self.time) / count, self._body.coordinates
        regular = abs(step - self._step) <= self._rounding
        if not regular:
            self._body.check_matched(step)
            self._regular = False
            if count > 1:
                return
        q = here.views[0]
        expected = self._undisturbed(here.stepped, step, regular).after(self._x, count)[: len(q)]
        self._largest = max(self._largest, float(np.abs(expected).max(initial=0.0)))
        if not np.abs(q - expected).max(initial=0.0) <= CHANGED * self._largest:
            raise MultiPhiValueError(
                f"coordinates of {self._body.name!r}: got others at t = {t:.9g} s than its motion has led to, need a "
                "PreStep or PostStep function for what changes them, set before the run"
            )

    def _undisturbed(self, stepped: SteppedLevel, step: float, regular: bool) -> UndisturbedSteps:
        if not regular:
            return UndisturbedSteps(stepped, step)
        return self._steps.get_or_build(stepped.closed, lambda: UndisturbedSteps(stepped, step))

    # ------------------------------------------------------------------ what comes

    def _plan(self, t: float) -> None:
        """The stops from the end of a step at t [s] on, as far as one looks ahead."""
        count = ROWS_AHEAD if self._body.varies else STEPS_AHEAD
        if t >= self._end - self._rounding or not self._regular:
            count = 1
        grid = t + self._step * np.arange(count)
        if self._stretch.failure and t >= self._stretch.end:
            self._done = len(self._stretch.changes)
            raise NumericalFailure(f"body {self._body.name!r}: {self._stretch.failure}")
        missed = False
        if t >= self._stretch.end:
            missed = self._done < len(self._stretch.changes)
            self._past.append(self._stretch)
            self._stretch, self._done = self._motion.advance(max(t, min(float(grid[-1]), self._end))), 0
        self._stops, self._place = self._planned(grid, missed), 0

    def _planned(self, grid: np.ndarray, missed: bool) -> _Stops:
        """The stops among ends of steps (k,) [s]; missed: the first of them is one, whatever comes."""
        stretch = self._stretch
        grid = grid[grid <= stretch.end + self._rounding]
        if stretch.failure:
            grid = grid[grid < stretch.end]
        coming = stretch.changes[self._done :]
        coming = coming[coming <= grid[-1] + self._rounding] if len(grid) else coming[:0]
        where = np.minimum(np.searchsorted(grid, coming), len(grid) - 1)
        places = np.arange(len(grid)) if self._body.varies else np.unique(np.append(where, [0] * missed).astype(int))
        times, done = grid[places], self._done + np.searchsorted(where, places, side="right")
        due = times - self._rounding
        happens = np.isin(places, where)
        due[happens] = np.minimum(due[happens], coming[np.searchsorted(where, places[happens])])
        s, size = self._body.coordinates.stepped.size, len(times)
        levels, flags, rows = [self._body.coordinates.stepped] * size, [list[float]()] * size, np.empty((size, 3, s))
        for moments in stretch.at(times) if size else ():
            self._take(moments, times, levels, flags, rows)
        return _Stops(due.tolist(), times.tolist(), done.tolist(), levels, rows, flags)

    def _take(
        self,
        moments: Moments,
        times: np.ndarray,
        levels: list[SteppedLevel],
        flags: list[list[float]],
        rows: np.ndarray,
    ) -> None:
        """Put the states of one level where they belong."""
        places, closed = moments.places, moments.level.level.indices
        stepped, forces = self._body.stepped_level(closed), self._body.own_forces(closed, times[places])
        rows[places] = stepped.states(moments.displacement, moments.velocity, forces).reshape(rows[places].shape)
        for k, place in enumerate(places.tolist()):
            eta, eta_t, entered = moments.displacement[k], moments.velocity[k], moments.phases[k]
            phases = self._body.phases_at(closed, eta, eta_t, float(times[place]), entered)
            levels[place], flags[place] = stepped, flags_of(closed, phases)


def _way(stepped: SteppedLevel) -> float:
    """How far modes go from the asymptotic configuration to where contacts change [m kg^1/2]."""
    base = stepped.loaded.level.base
    sizes = np.linalg.norm(base.directions, axis=0)
    ways = np.divide(np.abs(base.gaps), sizes, out=np.zeros(len(sizes)), where=sizes > 0)
    return float(np.linalg.norm(stepped.loaded.asymptotic.configuration) + np.max(ways, initial=0.0))
