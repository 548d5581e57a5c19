"""Event steps: the steps at whose ends the states of a known motion are written into the Exudyn system.

These are the steps in which the level or a phase changes: by an event, or by a request that is refused. With loads that
vary, every step is one of them. They are planned for steps of equal length h from the end of a step at t on,

    t_k = t + k h,   k = 0, 1, ...

Each has the exact state at t_k, and the coordinates that Exudyn's own steps reach there from the last event step if
nothing else changes them. The last step of the plan is added even if nothing is to be written at its end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.exudyn_plugin.body.ahead.known_motion import MotionInterval
from multiphi_exudyn.exudyn_plugin.body.ahead.undisturbed_steps import UndisturbedSteps
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.stepping.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.model.model import MultiPhiModel

__all__ = ["EventSteps", "IsolatedBody", "PlanStart", "StepsOf", "amplitudes", "plan_event_steps"]

TIME_ROUNDING = 1e-9  # of a step: a change this little after the end of a step is counted in it

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
