"""Undisturbed steps: many equal steps of the trapezoidal rule at once, for a body on which no other force acts.

    x_n = T^n x_0,   x = (q, q', q'', 1),   M q'' + D q' + K q = drive  at the end of every step

Exudyn's coordinates are compared with these: a difference means that something else has changed them. The powers T,
T^2, T^4, ... of a level are kept, so n steps are at most log2(n) + 1 products.

Known motion: the exact motion of a body under its own loads alone, computed before Exudyn's solver reaches it.

The motion is a run of the library (motion.py), computed interval by interval. An interval gives the states at any
times in it and the events with their times. Where the run fails, the interval ends at the time of the failure.

Event steps: the steps at whose ends the states of a known motion are written into the Exudyn system.

These are the steps in which the level or a phase changes: by an event, or by a request that is refused. With loads that
vary, every step is one of them. They are planned for steps of equal length h from the end of a step at t on,

    t_k = t + k h,   k = 0, 1, ...

Each has the exact state at t_k, and the coordinates that Exudyn's own steps reach there from the last event step if
nothing else changes them. The last step of the plan is added even if nothing is to be written at its end.

Run ahead: a run of an isolated body, whose exact motion is computed ahead of Exudyn's steps.

At the end of an event step (alone.py) the exact state is written, with the matrices of its level. Between event
steps Exudyn's own steps need nothing of the body; it only compares the time with ``next_time``.

Event steps are planned many steps ahead, for the present step size. Where a step ends at another time than planned, the
plan is made anew, so any step size gives right results. At every event step Exudyn's coordinates are compared with
those that undisturbed steps give: if anything else has changed them, the run ends with an error. After a change of the
step size, which the body sees only at the next event step, every step is checked.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.discretised_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.solver import check_matched
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP, Coordinates, RunRecord
from multiphi_exudyn.exudyn_plugin.step_test import OwnLoads
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.time.law_warnings import law_times
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.segments import Segments
from multiphi_exudyn.time.state import Event, Phase, State

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

    def __init__(self, stepped: SteppedLevel, step: float) -> None:
        self._powers = [_one_step(stepped, step).T]
        omega, self.periods = stepped.loaded.modal.omega, np.zeros(stepped.size)
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


def _one_step(stepped: SteppedLevel, step: float) -> np.ndarray:
    """The matrix T (3 s + 1, 3 s + 1) of one step."""
    s, m, d, k = stepped.size, stepped.mass, stepped.damping, stepped.stiffness
    identity, none, h = np.eye(s), np.zeros((s, s)), step / 2
    q = np.hstack([identity, step * identity, h**2 * identity])
    q_t = np.hstack([none, identity, h * identity])
    right_side = np.hstack([-d @ q_t - k @ q, stepped.drive[:, None]])
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


class KnownMotion:
    """The motion ``motion`` from a state and a time [s] on, computed interval by interval."""

    def __init__(self, motion: Motion, state: State, time: float) -> None:
        self._motion = motion
        self._continuation = motion.levels.with_channels(state), time

    def advance(self, until: float) -> MotionInterval:
        """The next interval, up to ``until`` [s]."""
        motion = self._motion
        motion.continue_from(*self._continuation)
        motion.advance(until)
        self._continuation = motion.state, motion.time
        times, _, _, truncated = motion.events.table().T
        segments = motion.record
        return MotionInterval(
            end=motion.time,
            events=motion.events,
            event_times=times,
            truncated=truncated,
            final_state=motion.state,
            failure=motion.message,
            segments=segments,
            phases=segments.start_phases(),
            static_levels=motion.levels.alone,
        )


def _phase_numbers(phases: Sequence[tuple[Phase, ...]]) -> np.ndarray:
    return np.array([[PHASES.index(phase) for phase in each] for each in phases], dtype=np.int8)


StepsOf = Callable[[SteppedLevel], UndisturbedSteps]


class IsolatedBody(Protocol):
    """Attributes of a body that the plan of its event steps needs."""

    name: str
    model: MultiPhiModel
    items: dict[str, Any]
    coordinates: Coordinates
    matched_step: float | None
    own_loads: OwnLoads

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""

    def include_step_error(self, time: float) -> None:
        """Take notice of the present state, after an event at a time [s]."""

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The solver's level in which the elements are in these states."""


@dataclass(frozen=True)
class PlanStart:
    """The end of a step at ``time`` [s], the ``index``-th of the run, from which steps of length ``step`` [s] follow.

    level, state: those of the Exudyn system there, state (q, q', q'') (3, s). changes_passed: number of changes in the
    interval of the motion up to this time.
    """

    time: float
    index: int
    step: float
    level: SteppedLevel
    state: np.ndarray
    changes_passed: int


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
    levels: list[SteppedLevel]
    states: np.ndarray
    data: np.ndarray
    expected: np.ndarray
    largest: list[float]


def plan_event_steps(
    body: IsolatedBody, interval: MotionInterval, start: PlanStart, steps_of: StepsOf, count: int, missed: bool = False
) -> EventSteps:
    """Plan the event steps within an interval, among the next ``count`` ends of steps, that at the start included.

    missed: whether a change has been missed, which makes the start itself an event step.
    """
    last = min(count - 1, math.floor((interval.end - start.time) / start.step + TIME_ROUNDING))
    change_times = interval.change_times[start.changes_passed :]
    change_steps = np.ceil((change_times - start.time) / start.step - TIME_ROUNDING)
    change_steps = np.maximum(change_steps + (start.time + start.step * change_steps < change_times), 0).astype(int)
    change_times, change_steps = change_times[change_steps <= last], change_steps[change_steps <= last]
    candidates = np.arange(last + 1) if body.varies else change_steps if not missed else np.append(0, change_steps)
    first = np.flatnonzero(candidates > np.append(-1, candidates)[:-1])
    steps = candidates[first]
    times = start.time + start.step * steps
    if interval.failure:
        before_failure = times < interval.end
        steps, first, times = steps[before_failure], first[before_failure], times[before_failure]
    due_times = times - TIME_ROUNDING * start.step
    if not (body.varies or missed):
        due_times = np.minimum(due_times, change_times[first])
    levels, level_numbers, states, data = _states(body, interval, times, start.level)
    if last > (steps[-1] if len(steps) else 0) and not interval.failure:
        steps, end = np.append(steps, last), start.time + start.step * last
        times, due_times = np.append(times, end), np.append(due_times, end - TIME_ROUNDING * start.step)
    expected, largest = _undisturbed(start, steps, levels, level_numbers, states, steps_of)
    return EventSteps(
        times=times.tolist(),
        due_times=due_times.tolist(),
        indices=(start.index + steps).tolist(),
        changes_passed=(start.changes_passed + np.searchsorted(change_steps, steps, side="right")).tolist(),
        levels=[levels[number] for number in level_numbers.tolist()],
        states=states,
        data=data,
        expected=expected,
        largest=np.maximum.accumulate(largest).tolist(),
    )


def amplitudes(states: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """Largest amplitude (k,) of any mode that moves freely from (q, q', q'') (k, 3, s): max of |q| and |q'| / omega.

    periods: 1 / omega (s,) [s] or (k, s), zero for modes of zero frequency.
    """
    return np.asarray(np.maximum(_largest(states[:, 0]), _largest(states[:, 1] * periods)))


def _largest(rows: np.ndarray) -> np.ndarray:
    return np.asarray(np.max(np.abs(rows), axis=1, initial=0.0))


def _states(
    body: IsolatedBody, interval: MotionInterval, times: np.ndarray, first: SteppedLevel
) -> tuple[list[SteppedLevel], np.ndarray, np.ndarray, np.ndarray]:
    """Levels, beginning with ``first``; at times (n,) [s] the number of the level, states (n, 3, s), data (n, width).

    The phases in the data are those with which the level was entered.
    """
    layout, count, levels = body.coordinates.layout, len(times), [first]
    numbers, states, data = np.zeros(count, int), np.empty((count, 3, first.size)), np.zeros((count, layout.width))
    for part in interval.at(times) if count else ():
        rows, element_states = part.indices, part.level.states
        stepped, forces = body.stepped_level(element_states), body.own_loads.forces(element_states, times[rows])
        states[rows] = stepped.solver_states(part.displacement, part.velocity, forces).reshape(len(rows), 3, -1)
        data[rows] = layout.rows(element_states, part.phases, part.displacement[:, stepped.modes :])
        if element_states != first.states:
            numbers[rows] = len(levels)
            levels.append(stepped)
    return levels, numbers, states, data


def _undisturbed(
    start: PlanStart,
    steps: np.ndarray,
    levels: list[SteppedLevel],
    level_numbers: np.ndarray,
    states: np.ndarray,
    steps_of: StepsOf,
) -> tuple[np.ndarray, np.ndarray]:
    """q (n, s) before each event step, by undisturbed steps from the start or from the event step before it.

    The second array holds the largest amplitude (n,) of the modes on the way.
    """
    count, counts = len(steps), np.diff(steps, prepend=0)
    before = np.concatenate([start.state[None], states])[:count]
    numbers_before = np.append(0, level_numbers)[:count]
    q, periods = np.empty((2, count, start.level.size))
    for number, stepped in enumerate(levels):
        rows = np.flatnonzero(numbers_before == number)
        if len(rows):
            undisturbed = steps_of(stepped)
            q[rows] = undisturbed.after(before[rows], counts[rows])[:, 0]
            periods[rows] = undisturbed.periods
    return q, np.maximum(amplitudes(before, periods), _largest(q))


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
