"""Stops: what Exudyn is told of a known motion, and at the ends of which steps.

A stop is the end of a step in which something changes: an event, or a contact that is refused. Of a body whose loads
vary it is the end of every step. It is planned for steps of equal length, h, from the end of a step at t on:

    t_k = t + k h,   k = 0, 1, ...

with the exact state at t_k, and with the one that Exudyn's own steps make of the last stop, if nobody disturbs them.
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
    """n stops. times: [s]; due: a step that ends at this time [s] or later is the stop. indices: of these steps.

    done: how many changes of the stretch are then behind. levels, states (n, 3, s): what is written; data (n, width):
    what goes into the data node. expected (n, s): q that Exudyn has before, largest (n,): how far the modes have gone
    so far.
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
    stops, first = np.unique(every, return_index=True)
    times = start.time + start.step * stops
    if stretch.failure:
        known = times < stretch.end
        stops, first, times = stops[known], first[known], times[known]
    due = times - SAME_PLACE * start.step
    if not (body.varies or missed):
        due = np.minimum(due, coming[first])
    levels, states, data = _states(body, stretch, times)
    done = start.done + np.searchsorted(places, stops, side="right")
    expected, reached = _expected(start, stops, levels, states, steps_of)
    largest = np.maximum.accumulate(reached).tolist()
    given = times.tolist(), due.tolist(), (start.index + stops).tolist(), done.tolist()
    return Stops(*given, levels, states, data, expected, largest)


def swings(stepped: SteppedLevel, states: np.ndarray) -> np.ndarray:
    """How far the modes go (k,) from states (q, q', q'') (k, 3, s): the largest of |q| and |q'| / omega."""
    omega = stepped.loaded.modal.omega
    periods = np.divide(1.0, omega, out=np.zeros(len(omega)), where=omega > 0)
    ways = np.abs(states[:, 1, : len(omega)]) * periods
    return np.asarray(np.maximum(_largest(states[:, 0]), _largest(ways)))


def _largest(rows: np.ndarray) -> np.ndarray:
    return np.asarray(np.max(np.abs(rows), axis=1, initial=0.0))


def _states(body: KnownBody, stretch: Stretch, times: np.ndarray) -> tuple[list[SteppedLevel], np.ndarray, np.ndarray]:
    """Levels, states (n, 3, s) and data (n, width) at times (n,) [s], the phases as on entering the level."""
    here, layout, count = body.coordinates.stepped, body.coordinates.layout, len(times)
    levels, states, data = [here] * count, np.empty((count, 3, here.size)), np.zeros((count, layout.width))
    for moments in stretch.at(times) if count else ():
        places, own = moments.places, moments.level.states
        stepped, forces = body.stepped_level(own), body.own.forces(own, times[places])
        states[places] = stepped.shown(moments.displacement, moments.velocity, forces).reshape(len(places), 3, -1)
        data[places] = layout.rows(own, moments.phases, moments.displacement[:, stepped.modes :])
        for place in places.tolist():
            levels[place] = stepped
    return levels, states, data


def _expected(
    start: Departure, stops: np.ndarray, levels: list[SteppedLevel], states: np.ndarray, steps_of: StepsOf
) -> tuple[np.ndarray, np.ndarray]:
    """q (n, s) that undisturbed steps make of the state at the departure and at every stop up to the next one.

    Beside it how far the modes go on that way (n,).
    """
    if not len(stops):
        return np.zeros((0, start.level.size)), np.zeros(0)
    before, counts = np.concatenate([start.state[None], states[:-1]]), np.diff(stops, prepend=0)
    found, given = np.empty((len(stops), start.level.size)), [start.level, *levels[:-1]]
    ways = np.empty(len(stops))
    numbers = {stepped.states: (number, stepped) for number, stepped in enumerate(given)}
    number = np.array([numbers[stepped.states][0] for stepped in given])
    for mark, stepped in numbers.values():
        here = number == mark
        found[here] = steps_of(stepped).after(before[here], counts[here])[:, 0]
        ways[here] = swings(stepped, before[here])
    return found, np.maximum(ways, _largest(found))
