"""Stops: what Exudyn is told of a known motion, and at the ends of which steps.

A stop is the end of a step in which something changes: an event, or a contact that is refused. Of a body whose loads
vary it is the end of every step. It is planned for steps of equal length, h, from the end of a step at t on:

    t_k = t + k h,   k = 0, 1, ...

with the exact state at t_k, and with the one that Exudyn's own steps make of the last stop, if nobody disturbs them.
Behind the stops the last of these steps is planned too, at which nothing is written.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.exudyn_plugin.body.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.known_motion import Stretch
from multiphi_exudyn.exudyn_plugin.body.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.body.undisturbed_steps import UndisturbedSteps
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["Departure", "KnownBody", "StepsOf", "Stops", "stops_of", "swings"]

SAME_PLACE = 1e-9  # of a step: a change so close behind the end of one may be rounding of the times

StepsOf = Callable[[SteppedLevel], UndisturbedSteps]


class KnownBody(Protocol):
    """What is needed of a body."""

    name: str
    model: MultiPhiModel
    items: dict[str, Any]
    coordinates: Coordinates
    matched_step: float | None
    own: OwnLoads

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The level of elements in these states as the solver has it."""


@dataclass(frozen=True)
class Departure:
    """The end of a step at ``time`` [s], the ``index``-th of the run, from which steps of length ``step`` [s] follow.

    level, state: as Exudyn has them there, (q, q', q'') (3, s). done: how many changes of the stretch are behind it.
    """

    time: float
    index: int
    step: float
    level: SteppedLevel
    state: np.ndarray
    done: int


@dataclass(frozen=True)
class Stops:
    """n stops, and maybe the last step behind them, k = n or n + 1 in all.

    times: [s]; due: a step that ends at this time [s] or later is the one. indices: of these steps. done: how many
    changes of the stretch are then behind. expected (k, s): q that Exudyn has before, largest (k,): how far the modes
    have gone so far. levels, states (n, 3, s): what is written; data (n, width): what goes into the data node.
    """

    times: list[float]
    due: list[float]
    indices: list[int]
    done: list[int]
    levels: list[SteppedLevel]
    states: np.ndarray
    data: np.ndarray
    expected: np.ndarray
    largest: list[float]


def stops_of(
    body: KnownBody, stretch: Stretch, start: Departure, steps_of: StepsOf, most: int, missed: bool = False
) -> Stops:
    """The stops within a stretch among the next ``most`` ends of steps, the one at the departure included.

    missed: that one is a stop, whatever comes.
    """
    last = min(most - 1, math.floor((stretch.end - start.time) / start.step + SAME_PLACE))
    coming = stretch.changes[start.done :]
    places = np.ceil((coming - start.time) / start.step - SAME_PLACE)
    places = np.maximum(places + (start.time + start.step * places < coming), 0).astype(int)
    coming, places = coming[places <= last], places[places <= last]
    every = np.arange(last + 1) if body.varies else places if not missed else np.append(0, places)
    first = np.flatnonzero(every > np.append(-1, every)[:-1])
    stops = every[first]
    times = start.time + start.step * stops
    if stretch.failure:
        known = times < stretch.end
        stops, first, times = stops[known], first[known], times[known]
    due = times - SAME_PLACE * start.step
    if not (body.varies or missed):
        due = np.minimum(due, coming[first])
    levels, numbers, states, data = _states(body, stretch, times, start.level)
    if last > (stops[-1] if len(stops) else 0) and not stretch.failure:
        stops, until = np.append(stops, last), start.time + start.step * last
        times, due = np.append(times, until), np.append(due, until - SAME_PLACE * start.step)
    done = start.done + np.searchsorted(places, stops, side="right")
    expected, reached = _expected(start, stops, levels, numbers, states, steps_of)
    largest = np.maximum.accumulate(reached).tolist()
    given = times.tolist(), due.tolist(), (start.index + stops).tolist(), done.tolist()
    return Stops(*given, [levels[number] for number in numbers.tolist()], states, data, expected, largest)


def swings(states: np.ndarray, periods: np.ndarray) -> np.ndarray:
    """How far the modes go (k,) from states (q, q', q'') (k, 3, s): the largest of |q| and |q'| / omega.

    periods: 1 / omega (s,) [s] or (k, s), zero of those that are free.
    """
    return np.asarray(np.maximum(_largest(states[:, 0]), _largest(states[:, 1] * periods)))


def _largest(rows: np.ndarray) -> np.ndarray:
    return np.asarray(np.max(np.abs(rows), axis=1, initial=0.0))


def _states(
    body: KnownBody, stretch: Stretch, times: np.ndarray, first: SteppedLevel
) -> tuple[list[SteppedLevel], np.ndarray, np.ndarray, np.ndarray]:
    """Levels, the ``first`` at their head; at times (n,) [s] which of them holds, states (n, 3, s), data (n, width).

    The phases are those with which the level was entered.
    """
    layout, count, levels = body.coordinates.layout, len(times), [first]
    numbers, states, data = np.zeros(count, int), np.empty((count, 3, first.size)), np.zeros((count, layout.width))
    for moments in stretch.at(times) if count else ():
        places, own = moments.places, moments.level.states
        stepped, forces = body.stepped_level(own), body.own.forces(own, times[places])
        states[places] = stepped.shown(moments.displacement, moments.velocity, forces).reshape(len(places), 3, -1)
        data[places] = layout.rows(own, moments.phases, moments.displacement[:, stepped.modes :])
        if own != first.states:
            numbers[places] = len(levels)
            levels.append(stepped)
    return levels, numbers, states, data


def _expected(
    start: Departure,
    stops: np.ndarray,
    levels: list[SteppedLevel],
    numbers: np.ndarray,
    states: np.ndarray,
    steps_of: StepsOf,
) -> tuple[np.ndarray, np.ndarray]:
    """q (n, s) that undisturbed steps make of the state at the departure and at every stop up to the next one.

    Beside it how far the modes go on that way (n,).
    """
    count, counts = len(stops), np.diff(stops, prepend=0)
    before, given = np.concatenate([start.state[None], states])[:count], np.append(0, numbers)[:count]
    found, periods = np.empty((2, count, start.level.size))
    for number, stepped in enumerate(levels):
        here = np.flatnonzero(given == number)
        if len(here):
            steps = steps_of(stepped)
            found[here] = steps.after(before[here], counts[here])[:, 0]
            periods[here] = steps.periods
    return found, np.maximum(swings(before, periods), _largest(found))
