"""Known motion: the exact motion of a body on which nothing acts but its own loads, computed before Exudyn gets there.

It is the library's own run (motion.py), carried on stretch by stretch; of a stretch one may ask for the states
at given times and for the events with theirs. A run that fails does so at an instant: what is known ends there.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.loaded_levels import LoadedLevels
from multiphi_exudyn.events.state import Event, Phase, State
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.recorded import Recorded
from multiphi_exudyn.time.segment import Segments

__all__ = ["KnownMotion", "Moments", "Stretch"]

PHASES = tuple(Phase)


@dataclass(frozen=True)
class Moments:
    """States of one level at k times, ``places`` among those that were asked for.

    displacement, velocity: xi, xi' (k, r + h), held places behind eta. phases: numbers (k, e) of those with which the
    level was entered.
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

    failure: why nothing is known beyond its end, or "". phases (n, e): of all segments, in numbers. alone:
    levels under static loads alone.
    """

    end: float
    events: Sequence[Event]
    event_times: np.ndarray
    truncated: np.ndarray
    last: State
    failure: str
    segments: Segments
    phases: np.ndarray
    alone: LoadedLevels

    @functools.cached_property
    def changes(self) -> np.ndarray:
        """When [s] something was decided, ascending: events, and contacts that were refused."""
        return np.union1d(self.segments.starts[1:], self.event_times)

    def at(self, times: np.ndarray) -> Iterator[Moments]:
        """The states at times (k,) [s], level by level, at an event those after it."""
        known = np.flatnonzero(times < self.end)
        owners = self.segments.owners(times[known])
        states = self.segments.states(owners, times[known] - self.segments.starts[owners])
        numbers = self.segments.numbers[owners]
        for number in np.unique(numbers).tolist():
            own, level = numbers == number, self.segments.levels[number]
            eta, eta_t = states[:, own, : level.level.modes]
            yield self._moments(known[own], level, eta, eta_t, self.phases[owners[own]])
        places = np.flatnonzero(times >= self.end)
        if len(places):
            eta, eta_t = (np.tile(x, (len(places), 1)) for x in (self.last.displacement, self.last.velocity))
            yield self._moments(places, self.last.level, eta, eta_t, _numbers([self.last.phases] * len(places)))

    def _moments(
        self, places: np.ndarray, level: LoadedLevel, xi: np.ndarray, xi_t: np.ndarray, phases: np.ndarray
    ) -> Moments:
        """In the level under static loads alone."""
        r = level.modal.modes
        given = slice(r, r + level.excitation.prescribed)
        alone = self.alone.level(level.states)
        if level.excitation.prescribed:
            xi, xi_t = np.delete(xi, given, axis=1), np.delete(xi_t, given, axis=1)
        return Moments(places, alone, xi, xi_t, phases)

    def levels(self, until: float) -> Iterator[Level]:
        """Levels entered up to a time [s]."""
        for number in set(self.segments.numbers[self.segments.starts <= until].tolist()):
            yield self.alone.level(self.segments.levels[number].states).level

    def largest_energy(self, until: float) -> float:
        """Of the states in which levels were entered up to a time [s], kinetic and strain [J]."""
        starts, largest = self.segments.starts, 0.0
        for moments in self.at(starts[starts <= until]):
            eta, eta_t = moments.displacement.T, moments.velocity.T
            largest = max(largest, float(np.max(moments.level.kinetic(eta_t) + moments.level.strain(eta))))
        return largest


class KnownMotion:
    """The motion ``motion``, which others leave alone, from a state and a time [s] on."""

    def __init__(self, motion: Motion, state: State, time: float) -> None:
        self._motion = motion
        self._reached = motion.levels.with_channels(state), time

    def advance(self, until: float) -> Stretch:
        """The next stretch, up to ``until`` [s]."""
        motion = self._motion
        motion.go_on_from(*self._reached)
        motion.advance(until)
        self._reached = motion.state, motion.time
        times, _, _, truncated = motion.events.table().T
        segments = Recorded(
            motion.record, math.nan, math.nan, (0.0, 0.0, 0.0)
        )  # nobody asks a body for defects and works
        given = motion.state, motion.message, segments, motion.record.standings()
        return Stretch(motion.time, motion.events, times, truncated, *given, motion.levels.alone)


def _numbers(phases: Sequence[tuple[Phase, ...]]) -> np.ndarray:
    return np.array([[PHASES.index(phase) for phase in each] for each in phases], dtype=np.int8)
