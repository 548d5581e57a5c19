"""Run ahead: a run of an isolated body, whose exact motion is computed ahead of Exudyn's steps.

At the end of an event step (event_steps.py) the exact state is written, with the matrices of its level. Between event
steps Exudyn's own steps need nothing of the body; it only compares the time with ``next_time``.

Event steps are planned many steps ahead, for the present step size. Where a step ends at another time than planned, the
plan is made anew, so any step size gives right results. At every event step Exudyn's coordinates are compared with
those that undisturbed steps give: if anything else has changed them, the run ends with an error. After a change of the
step size, which the body sees only at the next event step, every step is checked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.transitions.state import Event
from multiphi_exudyn.exudyn_plugin.body.ahead.event_steps import (
    EventSteps,
    IsolatedBody,
    PlanStart,
    amplitudes,
    plan_event_steps,
)
from multiphi_exudyn.exudyn_plugin.body.ahead.known_motion import KnownMotion
from multiphi_exudyn.exudyn_plugin.body.ahead.undisturbed_steps import UndisturbedSteps
from multiphi_exudyn.exudyn_plugin.body.solver.run_checks import check_matched
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import SAME_STEP
from multiphi_exudyn.exudyn_plugin.body.state.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel

__all__ = ["RunAhead"]

SAME_TIME = 1e-12  # relative: round-off of a time that is a sum of thousands of steps
STEPS_AHEAD = 2**14  # planned at once where few are event steps: takes no longer than as many steps of Exudyn
ROWS_AHEAD = 2**8  # planned at once where every step is an event step
CHANGED = 1e-6  # of the modes' amplitude: more than the error of Newton's iterations, less than a deliberate change
UNSEEN = 1e-3  # of the displacement at which contacts change: smaller amplitudes are compared with this part of it


class RunAhead:
    """One run of ``body`` along ``motion``, from time to ``end`` [s] in steps of length ``step`` [s].

    record: of levels and energies, for the warnings. running: until another solver begins. next_time: ``after_step``
    is to be called at the first end of a step at this time [s] or later. time, index: of its last call.
    """

    def __init__(
        self, body: IsolatedBody, motion: KnownMotion, record: RunRecord, time: float, step: float, end: float
    ) -> None:
        coordinates = body.coordinates
        self.running, self.next_time = True, -math.inf
        self.time, self.index = time, 0
        self._body, self._motion, self._record = body, motion, record
        self._step_size, self._rounding, self._end = step, SAME_STEP * step, end
        self._regular = True
        self._state = np.array(coordinates.views)
        states = coordinates.stepped.states
        self._displacement_scale = body.own_loads.static_levels.further(
            states, "displacement scale", lambda: _displacement_scale(coordinates.stepped)
        )
        self._past_events, self._truncated = list[Sequence[Event]](), 0.0
        self._interval = self._motion.advance(self._plan_end(time))
        self._next = self._changes_passed = 0
        self._steps = self._plan(missed=False)

    @property
    def events(self) -> list[Event]:
        """Events of the run so far."""
        before = [event for events in self._past_events for event in events]
        return before + list(self._interval.events[: self._event_count])

    def update_record(self) -> float:
        """Bring the record up to date, and return the energy [J] that truncation has removed so far."""
        for level in self._interval.levels(self.time):
            self._record.include_level(level)
        for states in self._interval.law_states(self.time):
            self._record.include_places(*states)
        if not self._body.own_loads.loaded_levels.isolated:
            self._record.include_energy(self._interval.largest_energy(self.time))
        return self._truncated + float(np.sum(self._interval.truncated[: self._event_count]))

    @property
    def _event_count(self) -> int:
        """Number of events of the interval that have happened."""
        interval, passed = self._interval, self._changes_passed
        next_change = interval.change_times[passed] if passed < len(interval.change_times) else math.inf
        return int(np.searchsorted(interval.event_times, next_change))

    # ------------------------------------------------------------------ end of a step

    def begin(self, mbs: Any) -> None:
        """Begin the run."""
        if self._is_event_step(self.time):
            self._write_state(mbs)
        self.next_time = self._next_time()

    def after_step(self, mbs: Any, t: float, index: int) -> None:
        """Handle the end of a step at t [s], the ``index``-th of the run."""
        k, steps, coordinates = self._next, self._steps, self._body.coordinates
        if self._is_planned(t) and index == steps.indices[k]:
            self._check_undisturbed(coordinates.views[0], steps.expected[k], steps.largest[k], t)
        elif index > self.index:
            self._check_unplanned_steps(t, index)
        if not self._is_event_step(t):
            self._state = np.array(coordinates.views)
            if not self._is_complete(t):
                self._extend_plan(t, index)
        if self._is_event_step(t):
            self._write_state(mbs)
        self.time, self.index, self.next_time = t, index, self._next_time()

    def _is_planned(self, t: float) -> bool:
        """Whether the next planned step ends at t [s]."""
        times = self._steps.times
        return self._next < len(times) and abs(times[self._next] - t) <= SAME_TIME * t

    def _is_event_step(self, t: float) -> bool:
        """Whether an event step ends at t [s]."""
        return self._next < len(self._steps.levels) and self._is_planned(t)

    def _is_complete(self, t: float) -> bool:
        """Whether the run ends at t [s], and nothing is left to be written or raised."""
        interval = self._interval
        all_passed = self._changes_passed == len(interval.change_times)
        nothing_left = all_passed and not (interval.failure or self._body.varies)
        return nothing_left and min(t, interval.end) >= self._end - self._rounding

    def _write_state(self, mbs: Any) -> None:
        """Write the exact state at the end of an event step into the system."""
        steps, k, coordinates = self._steps, self._next, self._body.coordinates
        stepped, self._state = steps.levels[k], steps.states[k]
        held = coordinates.layout.held(steps.data[k])
        coordinates.set_level_if_changed(mbs, stepped, held, stepped.drive)
        coordinates.write(stepped, held, self._state)
        coordinates.write_level_data(steps.data[k])
        self._body.include_step_error(float(steps.times[k]))
        self._changes_passed, self._next = steps.changes_passed[k], k + 1

    def _next_time(self) -> float:
        """Time [s] from which on the next end of a step is to be handled, -inf for every step."""
        if not self._regular or self._body.varies:
            return -math.inf
        last = self._interval.end + (0.0 if self._interval.failure else self._rounding)
        due = self._steps.due_times[self._next] if self._next < len(self._steps.due_times) else last
        return min(due, self._end - self._rounding)

    def _check_unplanned_steps(self, t: float, index: int) -> None:
        """Check the steps since the last call of ``after_step``; the last of them is not in the plan."""
        count, coordinates = index - self.index, self._body.coordinates
        step = (t - self.time) / count
        regular = abs(step - self._step_size) <= self._rounding
        if not regular:
            check_matched(self._body, step)
            self._regular = False
            if count > 1:
                return
        steps = self._undisturbed_steps(coordinates.stepped) if regular else UndisturbedSteps(coordinates.stepped, step)
        expected = steps.after(self._state[None], np.array([count]))[0, 0]
        self._check_undisturbed(
            coordinates.views[0], expected, float(amplitudes(self._state[None], steps.periods)[0]), t
        )

    def _check_undisturbed(self, q: np.ndarray, expected: np.ndarray, largest: float, t: float) -> None:
        """Raise if anything but Exudyn's steps has changed the coordinates since the last event step."""
        coordinates, scale = self._body.coordinates, self._displacement_scale
        if coordinates.has_friction:  # a stick position displaces the structure without any modal motion
            scale += float(np.linalg.norm(coordinates.stepped.loaded.channels.shapes @ coordinates.held))
        difference, limit = q - expected, CHANGED * max(largest, UNSEEN * scale)
        square = difference.dot(difference)  # modes of zero frequency have no amplitude: compared with their distance
        if not (square <= limit * limit or square <= CHANGED**2 * expected.dot(expected)):
            raise MultiPhiValueError(
                f"coordinates of {self._body.name!r}: got values at t = {t:.9g} s that something else has set, need "
                "the PreStep or PostStep function that sets them to be there before the run begins"
            )

    def _undisturbed_steps(self, stepped: SteppedLevel) -> UndisturbedSteps:
        step, levels = self._step_size, self._body.own_loads.static_levels
        return levels.further(stepped.states, ("steps", stepped.step, step), lambda: UndisturbedSteps(stepped, step))

    # ------------------------------------------------------------------ the plan

    def _extend_plan(self, t: float, index: int) -> None:
        """Plan the next event steps, from the end of a step at t [s] on."""
        self.time, self.index = t, index
        if self._interval.failure and t >= self._interval.end:
            self._changes_passed = len(self._interval.change_times)
            raise NumericalFailure(f"body {self._body.name!r}: {self._interval.failure}")
        pending = self._changes_passed < len(self._interval.change_times)
        used_up = self._interval.end <= t + (0.0 if pending else self._rounding)
        missed = pending and used_up
        if missed or (used_up and self._interval.end < self._end - self._rounding):
            self._changes_passed = len(self._interval.change_times)
            self._truncated = self.update_record()
            self._past_events.append(self._interval.events)
            self._interval, self._changes_passed = self._motion.advance(self._plan_end(t)), 0
        self._steps, self._next = self._plan(missed), 0

    @property
    def _plan_length(self) -> int:
        """Number of steps that are planned together."""
        if not self._regular:
            return 1
        return ROWS_AHEAD if self._body.varies else STEPS_AHEAD

    def _plan_end(self, t: float) -> float:
        """Time [s] up to which the motion is to be computed."""
        return max(t, min(t + self._step_size * (self._plan_length - 1), self._end))

    def _plan(self, missed: bool) -> EventSteps:
        level = self._body.coordinates.stepped
        start = PlanStart(self.time, self.index, self._step_size, level, self._state, self._changes_passed)
        return plan_event_steps(self._body, self._interval, start, self._undisturbed_steps, self._plan_length, missed)


def _displacement_scale(stepped: SteppedLevel) -> float:
    """Modal displacement [m kg^1/2] of the asymptotic configuration and of the largest gap, as a scale."""
    base = stepped.loaded.level.base
    sizes = np.linalg.norm(base.directions, axis=0)
    distances = np.divide(np.abs(base.gaps), sizes, out=np.zeros(len(sizes)), where=sizes > 0)
    return float(np.linalg.norm(stepped.loaded.asymptotic.configuration) + np.max(distances, initial=0.0))
