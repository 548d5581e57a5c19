"""Known motion: the exact motion of a body on which nothing acts but its own loads, computed before Exudyn gets there.

It is the library's own run (time/motion.py), carried on stretch by stretch; of a stretch one may ask for the states at
given times and for the events with theirs. A run that fails does so at an instant: what is known ends there.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.state import Event, Phase, State, event_table
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.time.driven.level import DrivenLevel
from multiphi_exudyn.time.loop_motion import LoopMotion
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.segment import Batch, batches

__all__ = ["KnownMotion", "Moments", "Stretch"]

PHASES = tuple(Phase)


@dataclass(frozen=True)
class Moments:
    """States of one level at k times, ``places`` among those that were asked for.

    displacement, velocity: eta, eta' (k, r). phases: numbers (k, c) of those with which the level was entered.
    """

    places: np.ndarray
    level: LoadedLevel
    displacement: np.ndarray
    velocity: np.ndarray
    phases: np.ndarray


@dataclass(frozen=True)
class Stretch:
    """A motion up to ``end`` [s]. last: the state there. events: in it, at event_times (k,) [s], where truncation took
    the energies truncated (k,) [J].

    failure: why nothing is known beyond its end, or "". parts: segments by level and exponentials. starts (n,) [s] and
    phases (n, c), in numbers, of all segments.
    """

    end: float
    events: Sequence[Event]
    event_times: np.ndarray
    truncated: np.ndarray
    last: State
    failure: str
    parts: Sequence[Batch]
    starts: np.ndarray
    phases: np.ndarray

    @functools.cached_property
    def changes(self) -> np.ndarray:
        """When [s] something was decided, ascending: events, and contacts that were refused."""
        return np.union1d(self.starts[1:], self.event_times)

    def at(self, times: np.ndarray) -> Iterator[Moments]:
        """The states at times (k,) [s], level by level, at an event those after it."""
        segment = np.searchsorted(self.starts, times, side="right") - 1
        segment[times >= self.end] = -1
        for part in self.parts:
            rows = np.full(len(self.starts) + 1, -1)
            rows[part.places] = np.arange(len(part.places))
            places = np.flatnonzero(rows[segment] >= 0)
            if len(places):
                row = rows[segment[places]]
                eta, eta_t = part.states(row, times[places] - part.starts[row])
                yield _moments(places, part.level, eta, eta_t, self.phases[segment[places]])
        places = np.flatnonzero(segment < 0)
        if len(places):
            eta, eta_t = (np.tile(x, (len(places), 1)) for x in (self.last.displacement, self.last.velocity))
            yield _moments(places, self.last.level, eta, eta_t, _numbers([self.last.phases] * len(places)))

    def levels(self, until: float) -> Iterator[tuple[Level, float]]:
        """Levels entered up to a time [s], with the largest energy [J] there."""
        for moments in self.at(self.starts[self.starts <= until]):
            eta, eta_t = moments.displacement.T, moments.velocity.T
            yield moments.level.level, float(np.max(moments.level.kinetic(eta_t) + moments.level.strain(eta)))


class KnownMotion:
    """The motion ``motion``, which others leave alone, from a state and a time [s] on."""

    def __init__(self, motion: Motion, state: State, time: float) -> None:
        self._motion = motion
        motion.go_on_from(state, time)

    def advance(self, until: float) -> Stretch:
        """The next stretch, up to ``until`` [s]."""
        motion = self._motion
        motion.go_on_from(motion.state, motion.time)
        motion.advance(until)
        trajectory = motion.trajectory(until)
        parts, events = batches(trajectory.segments), trajectory.events
        starts = np.empty(len(trajectory.segments))
        for part in parts:
            starts[part.places] = part.starts
        times, _, _, truncated = event_table(events, motion.model.index).T
        given = motion.state, motion.message, parts, starts, _phases(motion)
        return Stretch(motion.time, events, times, truncated, *given)


def _phases(motion: Motion) -> np.ndarray:
    """Phases (n, c) at the start of every segment, in numbers."""
    if isinstance(motion, LoopMotion):
        return motion.record.standings()
    phases = [segment.phases for segment in motion.segments]
    return _numbers(phases).reshape(len(phases), len(motion.model.contacts))


def _numbers(phases: Sequence[tuple[Phase, ...]]) -> np.ndarray:
    return np.array([[PHASES.index(phase) for phase in each] for each in phases], dtype=np.int8)


def _moments(
    places: np.ndarray, level: LoadedLevel, displacement: np.ndarray, velocity: np.ndarray, phases: np.ndarray
) -> Moments:
    """In the coordinates eta of the level under static loads alone."""
    if isinstance(level, DrivenLevel):
        r = level.plain.level.modes
        return Moments(places, level.plain, displacement[:, :r], velocity[:, :r], phases)
    return Moments(places, level, displacement, velocity, phases)
