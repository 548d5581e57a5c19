"""Known motion: the exact motion of a body under its own loads alone, computed before Exudyn's solver reaches it.

The motion is a run of the library (motion.py), computed interval by interval. An interval gives the states at any
times in it and the events with their times. Where the run fails, the interval ends at the time of the failure.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Event, Phase, State
from multiphi_exudyn.levels.level.level import Level
from multiphi_exudyn.mechanics.elements.force_law import ForceLaw
from multiphi_exudyn.time.record.recorded_segments import Recorded
from multiphi_exudyn.time.reliability.law_span import law_times
from multiphi_exudyn.time.run.motion import Motion
from multiphi_exudyn.time.segments.segment import Segments

__all__ = ["KnownMotion", "LevelStates", "MotionInterval"]

PHASES = tuple(Phase)


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
        segments = Recorded(motion.record)  # a body reports neither defects nor works
        return MotionInterval(
            end=motion.time,
            events=motion.events,
            event_times=times,
            truncated=truncated,
            final_state=motion.state,
            failure=motion.message,
            segments=segments,
            phases=motion.record.start_phases(),
            static_levels=motion.levels.alone,
        )


def _phase_numbers(phases: Sequence[tuple[Phase, ...]]) -> np.ndarray:
    return np.array([[PHASES.index(phase) for phase in each] for each in phases], dtype=np.int8)
