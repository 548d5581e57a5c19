"""Alone: a run of a body on which nothing of the system acts, whose exact motion is computed ahead of Exudyn's steps.

The motion is a run of the library, computed interval by interval. At the ends of event steps, in which the level or a
phase changes, the exact state is written, with the matrices of its level; between them Exudyn's own steps need nothing
of the body, which only compares the time with ``next_time``. With loads that vary, every step is an event step. They
are planned for steps of equal length h from the end of a step at t on,

    t_k = t + k h,   k = 0, 1, ...

Where a step ends at another time than planned, the plan is made anew, so any step size gives right results. At every
event step Exudyn's coordinates are compared with those that undisturbed steps give,

    x_n = T^n x_0,   x = (q, q', q'', 1),   M q'' + D q' + K q = drive  at the end of every step,

and if anything else has changed them, the run ends with an error. The powers T, T^2, T^4, ... of a level are kept, so n
steps are at most log2(n) + 1 products. After a change of the step size, which the body sees only at the next event
step, every step is checked. Where the run fails, its last interval ends at the time of the failure.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP, BodyParts
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.time.law_warnings import law_times
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.segments import Segments
from multiphi_exudyn.time.state import Event, Phase, State

__all__ = ["RunAhead", "UndisturbedSteps"]

PHASES = tuple(Phase)
TIME_ROUNDING = 1e-9  # of a step: a change this little after the end of a step is counted in it
SAME_TIME = 1e-12  # relative: round-off of a time that is a sum of thousands of steps
STEPS_AHEAD = 2**14  # planned at once where few are event steps: takes no longer than as many steps of Exudyn
ROWS_AHEAD = 2**8  # planned at once where every step is an event step
CHANGED = 1e-6  # of the modes' amplitude: more than the error of Newton's iterations, less than a deliberate change
UNSEEN = 1e-3  # of the displacement at which contacts change: smaller amplitudes are compared with this part of it


class UndisturbedSteps:
    """Steps of length ``step`` [s] in one level.

    periods: 1 / omega (s,) [s] of its modes, zero for modes of zero frequency.
    """

    def __init__(self, discretised: DiscretisedLevel, step: float) -> None:
        self._powers = [_one_step(discretised, step).T]
        omega, self.periods = discretised.loaded.modal.omega, np.zeros(discretised.size)
        np.divide(1.0, omega, out=self.periods[: len(omega)], where=omega > 0)

    def after(self, states: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """States (q, q', q'') (k, 3, s) that ``counts`` (k,) steps reach from ``states`` (k, 3, s)."""
        x = np.ones((len(states), len(self._powers[0])))
        x[:, :-1] = states.reshape(len(states), -1)
        for power in range(int(np.max(counts, initial=0)).bit_length()):
            if power == len(self._powers):
                self._powers.append(self._powers[-1] @ self._powers[-1])
            rows = np.flatnonzero((counts >> power) & 1)
            x[rows] = x[rows] @ self._powers[power]
        return x[:, :-1].reshape(states.shape)


def _one_step(discretised: DiscretisedLevel, step: float) -> np.ndarray:
    """The matrix T (3 s + 1, 3 s + 1) of one step."""
    s, m, d, k = discretised.size, discretised.mass, discretised.damping, discretised.stiffness
    identity, none, h = np.eye(s), np.zeros((s, s)), step / 2
    q = np.hstack([identity, step * identity, h**2 * identity])
    q_t = np.hstack([none, identity, h * identity])
    right_side = np.hstack([-d @ q_t - k @ q, discretised.drive[:, None]])
    q_tt = np.linalg.solve(m + h * d + h**2 * k, right_side)
    matrix = np.vstack([h**2 * q_tt, h * q_tt, q_tt, np.zeros((1, 3 * s + 1))])
    matrix[:s, : 3 * s] += q
    matrix[s : 2 * s, : 3 * s] += q_t
    matrix[-1, -1] = 1.0
    return matrix


@dataclass(frozen=True)
class LevelStates:
    """States of one level at k of the requested times; indices: of these times among all requested ones.

    displacement, velocity: xi, xi' (k, r + h), eta followed by the stick positions. phases: numbers (k, e) of the
    phases with which the level was entered.
    """

    indices: np.ndarray
    level: LoadedLevel
    displacement: np.ndarray
    velocity: np.ndarray
    phases: np.ndarray


@dataclass(frozen=True)
class MotionInterval:
    """The motion up to ``end`` [s], in the state ``final_state`` there.

    events: at event_times (k,) [s], at each of which truncation of modes removes the energy truncated (k,) [J].
    failure: message of the failure that ends the interval, or "". phases (n, e): numbers of the phases of all segments.
    static_levels: the levels under static loads alone.
    """

    end: float
    events: Sequence[Event]
    event_times: np.ndarray
    truncated: np.ndarray
    final_state: State
    failure: str
    segments: Segments
    phases: np.ndarray
    static_levels: LoadedLevels

    @functools.cached_property
    def change_times(self) -> np.ndarray:
        """Times [s] at which the level or a phase changes, ascending: events and refused requests."""
        return np.union1d(self.segments.starts[1:], self.event_times)

    def at(self, times: np.ndarray) -> Iterator[LevelStates]:
        """The states at times (k,) [s], level by level; at an event those right after it."""
        before_end = np.flatnonzero(times < self.end)
        owners = self.segments.owners(times[before_end])
        states = self.segments.states(owners, times[before_end] - self.segments.starts[owners])
        numbers = self.segments.numbers[owners]
        for number in np.unique(numbers).tolist():
            in_level, level = numbers == number, self.segments.levels[number]
            eta, eta_t = states[:, in_level, : level.level.modes]
            yield self._level_states(before_end[in_level], level, eta, eta_t, self.phases[owners[in_level]])
        indices = np.flatnonzero(times >= self.end)
        if len(indices):
            eta, eta_t = (
                np.tile(x, (len(indices), 1)) for x in (self.final_state.displacement, self.final_state.velocity)
            )
            yield self._level_states(
                indices, self.final_state.level, eta, eta_t, _phase_numbers([self.final_state.phases] * len(indices))
            )

    def _level_states(
        self, indices: np.ndarray, level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray, phases: np.ndarray
    ) -> LevelStates:
        """The states without the channels of the loads, in the level under static loads alone."""
        r = level.modal.modes
        channels = slice(r, r + level.excitation.prescribed)
        level_under_static_loads = self.static_levels.level(level.states)
        if level.excitation.prescribed:
            xi, xi_t = np.delete(xi, channels, axis=1), np.delete(xi_t, channels, axis=1)
        return LevelStates(indices, level_under_static_loads, xi, xi_t, phases)

    def levels(self, until: float) -> Iterator[Level]:
        """Levels entered up to a time [s]."""
        for number in set(self.segments.numbers[self.segments.starts <= until].tolist()):
            yield self.static_levels.level(self.segments.levels[number].states).level

    def law_states(self, until: float) -> Iterator[tuple[LoadedLevel, np.ndarray, np.ndarray]]:
        """Levels with a force law in a last segment, coordinates (r, k) in them and times (k,) up to a time [s]."""
        elements = self.segments.levels[0].level.base.contacts
        laws = [(i, law) for i, law in enumerate(elements) if isinstance(law, ForceLaw)]
        if not laws:
            return
        sampled = np.unique(np.concatenate([law_times(self.segments, i, law) for i, law in laws]))
        times = sampled[sampled <= until]
        owners = self.segments.owners(times)
        states = self.segments.states(owners, times - self.segments.starts[owners])
        numbers = self.segments.numbers[owners]
        for number in np.unique(numbers).tolist():
            in_level, level = numbers == number, self.segments.levels[number]
            yield level, states[0, in_level, : level.level.modes].T, times[in_level]

    def largest_energy(self, until: float) -> float:
        """Largest kinetic plus strain energy [J] of the states in which segments begin up to a time [s]."""
        starts, largest = self.segments.starts, 0.0
        for states in self.at(starts[starts <= until]):
            eta, eta_t = states.displacement.T, states.velocity.T
            largest = max(largest, float(np.max(states.level.kinetic(eta_t) + states.level.strain(eta))))
        return largest


def _phase_numbers(phases: Sequence[tuple[Phase, ...]]) -> np.ndarray:
    return np.array([[PHASES.index(phase) for phase in each] for each in phases], dtype=np.int8)


@dataclass(frozen=True)
class EventSteps:
    """n event steps, and the last step of the plan where it is none of them: k = n or n + 1 steps.

    times: ends of the steps [s]. due_times [s]: the first step that ends at such a time or later is the event step.
    indices: of the steps in the run. changes_passed: number of changes in the interval up to there. expected (k, s): q
    before anything is written. largest (k,): largest amplitude of the modes so far. levels, states (n, 3, s): to be
    written; data (n, width): for the data node.
    """

    times: list[float]
    due_times: list[float]
    indices: list[int]
    changes_passed: list[int]
    levels: list[DiscretisedLevel]
    states: np.ndarray
    data: np.ndarray
    expected: np.ndarray
    largest: list[float]


def amplitudes(states: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Largest amplitude (k,) of any mode that moves freely from (q, q', q'') (k, 3, s): max of |q| and |q'| / omega.

    periods: 1 / omega (s,) [s] or (k, s), zero for modes of zero frequency.
    """
    return np.asarray(np.maximum(_largest(states[:, 0]), _largest(states[:, 1] * periods)))


def _largest(rows: np.ndarray) -> np.ndarray:
    return np.asarray(np.max(np.abs(rows), axis=1, initial=0.0))


class RunAhead:
    """One run of ``body`` along ``motion``, from time to ``end`` [s] in steps of length ``step`` [s].

    running: until another solver begins. next_time: ``after_step``
    is to be called at the first end of a step at this time [s] or later. time, index: of its last call.
    """

    def __init__(self, body: BodyParts, motion: Motion, start: State, time: float, step: float, end: float) -> None:
        coordinates = body.coordinates
        self.running, self.next_time = True, -math.inf
        self.time, self.index = time, 0
        self._body, self._motion, self._record = body, motion, body.record
        self._continuation = motion.levels.with_channels(start), time
        self._step_size, self._rounding, self._end = step, SAME_STEP * step, end
        self._regular = True
        self._state = np.array(coordinates.views)
        states = coordinates.discretised.states
        self._displacement_scale = body.own_loads.static_levels.further(
            states, "displacement scale", lambda: _displacement_scale(coordinates.discretised)
        )
        self._past_events, self._truncated = list[Sequence[Event]](), 0.0
        self._interval = self._advance(self._plan_end(time))
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
        discretised, self._state = steps.levels[k], steps.states[k]
        held = coordinates.layout.held(steps.data[k])
        coordinates.set_level_if_changed(mbs, discretised, held, discretised.drive)
        coordinates.write(discretised, held, self._state)
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
            self._body.check_step(step)
            self._regular = False
            if count > 1:
                return
        steps = (
            self._undisturbed_steps(coordinates.discretised)
            if regular
            else UndisturbedSteps(coordinates.discretised, step)
        )
        expected = steps.after(self._state[None], np.array([count]))[0, 0]
        self._check_undisturbed(
            coordinates.views[0], expected, float(amplitudes(self._state[None], steps.periods)[0]), t
        )

    def _check_undisturbed(self, q: np.ndarray, expected: np.ndarray, largest: float, t: float) -> None:
        """Raise if anything but Exudyn's steps has changed the coordinates since the last event step."""
        coordinates, scale = self._body.coordinates, self._displacement_scale
        if coordinates.has_friction:  # a stick position displaces the structure without any modal motion
            scale += float(np.linalg.norm(coordinates.discretised.loaded.channels.shapes @ coordinates.held))
        difference, limit = q - expected, CHANGED * max(largest, UNSEEN * scale)
        square = difference.dot(difference)  # modes of zero frequency have no amplitude: compared with their distance
        if not (square <= limit * limit or square <= CHANGED**2 * expected.dot(expected)):
            raise MultiPhiValueError(
                f"coordinates of {self._body.name!r}: got values at t = {t:.9g} s that something else has set, need "
                "the PreStep or PostStep function that sets them to be there before the run begins"
            )

    def _undisturbed_steps(self, discretised: DiscretisedLevel) -> UndisturbedSteps:
        step, levels = self._step_size, self._body.own_loads.static_levels
        return levels.further(
            discretised.states, ("steps", discretised.step, step), lambda: UndisturbedSteps(discretised, step)
        )

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
            self._interval, self._changes_passed = self._advance(self._plan_end(t)), 0
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

    def _advance(self, until: float) -> MotionInterval:
        """The next interval of the motion, up to ``until`` [s]."""
        motion = self._motion
        motion.continue_from(*self._continuation)
        motion.advance(until)
        self._continuation = motion.state, motion.time
        times, _, _, truncated = motion.events.table().T
        return MotionInterval(
            end=motion.time,
            events=motion.events,
            event_times=times,
            truncated=truncated,
            final_state=motion.state,
            failure=motion.message,
            segments=motion.record,  # a body reports neither defects nor works
            phases=motion.record.start_phases(),
            static_levels=motion.levels.alone,
        )

    def _plan(self, missed: bool) -> EventSteps:
        """Plan the event steps within the interval, among the next ends of steps, the present one included.

        missed: whether a change has been missed, which makes the present end of a step one of them.
        """
        interval, h, start, varies = self._interval, self._step_size, self.time, self._body.varies
        last = min(self._plan_length - 1, math.floor((interval.end - start) / h + TIME_ROUNDING))
        change_times = interval.change_times[self._changes_passed :]
        change_steps = np.ceil((change_times - start) / h - TIME_ROUNDING)
        change_steps = np.maximum(change_steps + (start + h * change_steps < change_times), 0).astype(int)
        change_times, change_steps = change_times[change_steps <= last], change_steps[change_steps <= last]
        candidates = np.arange(last + 1) if varies else change_steps if not missed else np.append(0, change_steps)
        first = np.flatnonzero(candidates > np.append(-1, candidates)[:-1])
        steps = candidates[first]
        times = start + h * steps
        if interval.failure:
            before_failure = times < interval.end
            steps, first, times = steps[before_failure], first[before_failure], times[before_failure]
        due_times = times - TIME_ROUNDING * h
        if not (varies or missed):
            due_times = np.minimum(due_times, change_times[first])
        levels, numbers, states, data = self._planned_states(times)
        if last > (steps[-1] if len(steps) else 0) and not interval.failure:
            steps, end = np.append(steps, last), start + h * last
            times, due_times = np.append(times, end), np.append(due_times, end - TIME_ROUNDING * h)
        expected, largest = self._expected(steps, levels, numbers, states)
        passed = self._changes_passed + np.searchsorted(change_steps, steps, side="right")
        return EventSteps(
            times=times.tolist(),
            due_times=due_times.tolist(),
            indices=(self.index + steps).tolist(),
            changes_passed=passed.tolist(),
            levels=[levels[number] for number in numbers.tolist()],
            states=states,
            data=data,
            expected=expected,
            largest=np.maximum.accumulate(largest).tolist(),
        )

    def _planned_states(self, times: np.ndarray) -> tuple[list[DiscretisedLevel], np.ndarray, np.ndarray, np.ndarray]:
        """Levels, the present one first; at times (n,) [s] number of the level, states (n, 3, s), data (n, width).

        The phases in the data are those with which the level was entered.
        """
        body, first = self._body, self._body.coordinates.discretised
        layout, count, levels = body.coordinates.layout, len(times), [first]
        numbers, states, data = np.zeros(count, int), np.empty((count, 3, first.size)), np.zeros((count, layout.width))
        for part in self._interval.at(times) if count else ():
            rows, key = part.indices, part.level.states
            discretised, forces = body.discretised_level(key), body.own_loads.forces(key, times[rows])
            reached = discretised.solver_states(part.displacement, part.velocity, forces)
            states[rows] = reached.reshape(len(rows), 3, -1)
            data[rows] = layout.rows(key, part.phases, part.displacement[:, discretised.modes :])
            if key != first.states:
                numbers[rows] = len(levels)
                levels.append(discretised)
        return levels, numbers, states, data

    def _expected(
        self, steps: np.ndarray, levels: list[DiscretisedLevel], numbers: np.ndarray, states: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """q (n, s) before each step, by undisturbed ones from the event step before, and the largest amplitude (n,)."""
        count, counts = len(steps), np.diff(steps, prepend=0)
        before, numbers_before = np.concatenate([self._state[None], states])[:count], np.append(0, numbers)[:count]
        q, periods = np.empty((2, count, levels[0].size))
        for number, discretised in enumerate(levels):
            rows = np.flatnonzero(numbers_before == number)
            if len(rows):
                undisturbed = self._undisturbed_steps(discretised)
                q[rows] = undisturbed.after(before[rows], counts[rows])[:, 0]
                periods[rows] = undisturbed.periods
        return q, np.maximum(amplitudes(before, periods), _largest(q))


def _displacement_scale(discretised: DiscretisedLevel) -> float:
    """Modal displacement [m kg^1/2] of the asymptotic configuration and of the largest gap, as a scale."""
    base = discretised.loaded.level.base
    sizes = np.linalg.norm(base.directions, axis=0)
    distances = np.divide(np.abs(base.gaps), sizes, out=np.zeros(len(sizes)), where=sizes > 0)
    return float(np.linalg.norm(discretised.loaded.asymptotic.configuration) + np.max(distances, initial=0.0))
