"""Run ahead: a body on which nothing acts but its own loads, told to Exudyn from a motion that is known beforehand.

At a stop (stops.py) the exact state is written, with the matrices of its level. Between stops Exudyn does the steps on
its own, and all there is to do for the body is to compare the time with ``next_time``.

Stops are planned many steps ahead, for steps of the length that the run has. One that is met at another time is planned
again, so steps of any length are right. At every stop Exudyn's coordinates are compared with what its steps make of the
last ones: whoever has changed them on the way, unseen, ends the run. Steps of unequal length, which cannot be told from
afar, are looked at one by one from then on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.state import Event
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP
from multiphi_exudyn.exudyn_plugin.body.known_motion import KnownMotion
from multiphi_exudyn.exudyn_plugin.body.run_checks import check_matched
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.stops import Departure, KnownBody, Stops, stops_of, swings
from multiphi_exudyn.exudyn_plugin.body.undisturbed_steps import UndisturbedSteps
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel

__all__ = ["RunAhead"]

SAME_TIME = 1e-12  # relative: what adding up thousands of steps leaves of a time
STEPS_AHEAD = 2**14  # planned at once, of which few are stops: computed in the time of as many steps of Exudyn
ROWS_AHEAD = 2**8  # planned at once where every step is a stop
CHANGED = 1e-6  # of how far the modes go: more than Newton's iterations leave, less than anybody means to change
UNSEEN = 1e-3  # of what brings a contact to its stop: coordinates this small are compared with it


class RunAhead:
    """One run of ``body`` along ``motion``, from time to ``end`` [s] in steps of length ``step`` [s].

    record: is told of what has happened. running: until another solver begins. next_time: the end of a step at this
    time [s] or later is to be reported (``arrive``). time, index: of the last one that was.
    """

    def __init__(
        self, body: KnownBody, motion: KnownMotion, record: RunRecord, time: float, step: float, end: float
    ) -> None:
        here = body.coordinates
        self.running, self.next_time = True, -math.inf
        self.time, self.index = time, 0
        self._body, self._motion, self._record = body, motion, record
        self._step, self._rounding, self._end = step, SAME_STEP * step, end
        self._regular = True
        self._state = np.array(here.views)
        states = here.stepped.states
        self._way = body.own.levels.further(states, "way", lambda: _way(here.stepped))
        self._past, self._truncated = list[Sequence[Event]](), 0.0
        self._stretch = self._motion.advance(self._until(time))
        self._place = self._done = 0
        self._stops = self._planned(missed=False)

    @property
    def events(self) -> list[Event]:
        """What has happened so far."""
        before = [event for events in self._past for event in events]
        return before + list(self._stretch.events[: self._told])

    def recorded(self) -> float:
        """Bring the record up to date; energy [J] that truncation took so far."""
        for level in self._stretch.levels(self.time):
            self._record.include(level)
        if not self._body.own.loaded.isolated:
            self._record.reach(self._stretch.largest_energy(self.time))
        return self._truncated + float(np.sum(self._stretch.truncated[: self._told]))

    @property
    def _told(self) -> int:
        """How many events of the stretch have happened."""
        stretch = self._stretch
        since = stretch.changes[self._done] if self._done < len(stretch.changes) else math.inf
        return int(np.searchsorted(stretch.event_times, since))

    # ------------------------------------------------------------------ a stop

    def begin(self, mbs: Any) -> None:
        """The run begins."""
        if self._stops_at(self.time):
            self._write(mbs)
        self.next_time = self._next()

    def arrive(self, mbs: Any, t: float, index: int) -> None:
        """A step has ended at t [s], the ``index``-th of the run."""
        k, stops, here = self._place, self._stops, self._body.coordinates
        if self._meets(t) and index == stops.indices[k]:
            self._check(here.views[0], stops.expected[k], stops.largest[k], t)
        elif index > self.index:
            self._check_steps(t, index)
        if not self._stops_at(t):
            self._state = np.array(here.views)
            if not self._is_over(t):
                self._plan(t, index)
        if self._stops_at(t):
            self._write(mbs)
        self.time, self.index, self.next_time = t, index, self._next()

    def _meets(self, t: float) -> bool:
        """Whether the next step that is planned ends at t."""
        times = self._stops.times
        return self._place < len(times) and abs(times[self._place] - t) <= SAME_TIME * t

    def _stops_at(self, t: float) -> bool:
        """Whether it does, and is a stop."""
        return self._place < len(self._stops.levels) and self._meets(t)

    def _is_over(self, t: float) -> bool:
        """Whether the run ends at t, where nothing is left to be told."""
        stretch = self._stretch
        told = self._done == len(stretch.changes) and not (stretch.failure or self._body.varies)
        return told and min(t, stretch.end) >= self._end - self._rounding

    def _write(self, mbs: Any) -> None:
        stops, k, here = self._stops, self._place, self._body.coordinates
        stepped, self._state = stops.levels[k], stops.states[k]
        held = here.layout.held(stops.data[k])
        here.enter_with(mbs, stepped, held, stepped.drive)
        here.write(stepped, held, self._state)
        here.store(stops.data[k])
        self._done, self._place = stops.done[k], k + 1

    def _next(self) -> float:
        if not self._regular or self._body.varies:
            return -math.inf
        last = self._stretch.end + (0.0 if self._stretch.failure else self._rounding)
        due = self._stops.due[self._place] if self._place < len(self._stops.due) else last
        return min(due, self._end - self._rounding)

    def _check_steps(self, t: float, index: int) -> None:
        """Look at the steps since the last report, which were not planned to end here."""
        count, here = index - self.index, self._body.coordinates
        step = (t - self.time) / count
        regular = abs(step - self._step) <= self._rounding
        if not regular:
            check_matched(self._body, step)
            self._regular = False
            if count > 1:
                return
        steps = self._steps_of(here.stepped) if regular else UndisturbedSteps(here.stepped, step)
        expected = steps.after(self._state[None], np.array([count]))[0, 0]
        self._check(here.views[0], expected, float(swings(self._state[None], steps.periods)[0]), t)

    def _check(self, q: np.ndarray, expected: np.ndarray, largest: float, t: float) -> None:
        """Raises if somebody has changed the coordinates since the last stop."""
        here, way = self._body.coordinates, self._way
        if here.slips:  # what stays where it is held moves its modes by nothing
            way += float(np.linalg.norm(here.stepped.loaded.channels.shapes @ here.held))
        apart, limit = q - expected, CHANGED * max(largest, UNSEEN * way)
        off = apart.dot(apart)  # free modes do not swing: of those counts how far they are
        if not (off <= limit * limit or off <= CHANGED**2 * expected.dot(expected)):
            raise MultiPhiValueError(
                f"coordinates of {self._body.name!r}: got values at t = {t:.9g} s that something else has set, need "
                "the PreStep or PostStep function that sets them to be there before the run begins"
            )

    def _steps_of(self, stepped: SteppedLevel) -> UndisturbedSteps:
        step, levels = self._step, self._body.own.levels
        return levels.further(stepped.states, ("steps", stepped.step, step), lambda: UndisturbedSteps(stepped, step))

    # ------------------------------------------------------------------ what comes

    def _plan(self, t: float, index: int) -> None:
        """The stops from the end of a step at t [s] on, as far as one looks ahead."""
        self.time, self.index = t, index
        if self._stretch.failure and t >= self._stretch.end:
            self._done = len(self._stretch.changes)
            raise NumericalFailure(f"body {self._body.name!r}: {self._stretch.failure}")
        left = self._done < len(self._stretch.changes)
        spent = self._stretch.end <= t + (0.0 if left else self._rounding)
        missed = left and spent
        if missed or (spent and self._stretch.end < self._end - self._rounding):
            self._done = len(self._stretch.changes)
            self._truncated = self.recorded()
            self._past.append(self._stretch.events)
            self._stretch, self._done = self._motion.advance(self._until(t)), 0
        self._stops, self._place = self._planned(missed), 0

    @property
    def _most(self) -> int:
        """How many ends of steps are looked at together."""
        if not self._regular:
            return 1
        return ROWS_AHEAD if self._body.varies else STEPS_AHEAD

    def _until(self, t: float) -> float:
        """How far [s] to look ahead."""
        return max(t, min(t + self._step * (self._most - 1), self._end))

    def _planned(self, missed: bool) -> Stops:
        level = self._body.coordinates.stepped
        start = Departure(self.time, self.index, self._step, level, self._state, self._done)
        return stops_of(self._body, self._stretch, start, self._steps_of, self._most, missed)


def _way(stepped: SteppedLevel) -> float:
    """How far modes go from the asymptotic configuration to where contacts change [m kg^1/2]."""
    base = stepped.loaded.level.base
    sizes = np.linalg.norm(base.directions, axis=0)
    ways = np.divide(np.abs(base.gaps), sizes, out=np.zeros(len(sizes)), where=sizes > 0)
    return float(np.linalg.norm(stepped.loaded.asymptotic.configuration) + np.max(ways, initial=0.0))
