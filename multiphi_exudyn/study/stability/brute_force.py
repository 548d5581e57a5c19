"""Brute force: contacts looked at on a dense grid, against what the events of a trajectory tell.

    g(t) = h.x(t) + gap - z(t)         from the displacement, the contact's definition and the way z of its stop,
    a(t) = g(t) + (c/k) max(0, g'(t))  not from the event signals; by its law a contact is closed where a < 0

a is g but for a viscous contact, which is open inside its stop where it would pull.

SAMPLES_PER_PERIOD samples per shortest period of the levels visited, over the whole run where that fits the budget.
Else half the budget is a grid over the whole run, the other half goes into windows of one such period at full
density, around events spread evenly over the run (around even times where there are none). Up to MOST_EVENTS events are
samples themselves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.transitions.exits import exits_of
from multiphi_exudyn.events.transitions.state import Phase
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import BaseMotion, Load, StopMotion
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = [
    "ContactSamples",
    "Sampling",
    "SegmentTable",
    "highest_frequency",
    "missed",
    "sample_contact",
    "sampling",
    "switches_without_event",
    "truncated",
]

SAMPLES_PER_PERIOD = 10_000
MOST_EVENTS = 2_000  # at whose instants a contact is looked at
CHUNK = 20_000  # samples evaluated at once: what their exponentials take of memory
TIME_ROUND_OFF = 1e-12  # of the run: an event this near to a sample may lie on either side of it


@dataclass(frozen=True)
class Sampling:
    """times (k,) ascending; covered: share of the run with SAMPLES_PER_PERIOD."""

    times: np.ndarray
    covered: float


@dataclass(frozen=True)
class SegmentTable:
    """Of every segment: start, end (s,), states (s, c), closed, and until when the phase excuses s < 0, else -inf."""

    start: np.ndarray
    end: np.ndarray
    states: np.ndarray
    closed: np.ndarray
    excused: np.ndarray

    @classmethod
    def of(cls, trajectory: Trajectory) -> SegmentTable:
        """The table of a trajectory."""
        segments, count = list(trajectory.segments), len(trajectory.model.contacts)
        closed = np.zeros((len(segments), count), dtype=bool)
        excused = np.full((len(segments), count), -np.inf)
        for row, segment in enumerate(segments):
            held = set(segment.level.level.indices)
            closed[row] = [not held.isdisjoint(trajectory.model.pressing_links(i)) for i in range(count)]
            until = segment.start + segment.armed_at if segment.armed_at > 0 else segment.end
            for (i, _), phase in zip(exits_of(segment.level), segment.phases, strict=True):
                if phase is not Phase.ARMED:
                    excused[row, i] = until
        starts, ends = np.array([(segment.start, segment.end) for segment in segments]).reshape(-1, 2).T
        states = np.array([segment.level.states for segment in segments], int).reshape(len(segments), count)
        return cls(starts, ends, states, closed, excused)

    def owners(self, times: np.ndarray) -> np.ndarray:
        """Positions of the segments at times (k,)."""
        return np.maximum(np.searchsorted(self.start, times, side="right") - 1, 0)


@dataclass(frozen=True)
class ContactSamples:
    """Of one contact at times (k,): gap [m], apart: a [m], slowed: (c/k) g' [m], force [N], closed and excused.

    excused: its phase lets s < 0; for a viscous contact only where its model is truncated.
    """

    times: np.ndarray
    gap: np.ndarray
    apart: np.ndarray
    slowed: np.ndarray
    force: np.ndarray
    closed: np.ndarray
    excused: np.ndarray


def sampling(trajectory: Trajectory, budget: int) -> Sampling:
    """Where to look at a trajectory with about this many samples."""
    end = trajectory.t_end
    shortest = 1 / max(highest_frequency(trajectory), 1 / end)
    whole = math.ceil(SAMPLES_PER_PERIOD * end / shortest)
    happened = trajectory.events[:: 1 + len(trajectory.events) // MOST_EVENTS]
    at = np.array([event.time for event in happened])
    if whole <= budget:
        return Sampling(np.unique([*np.linspace(0.0, end, whole + 1), *at]), 1.0)
    grid = np.linspace(0.0, end, budget // 2)
    windows = _windows(trajectory, shortest, max(1, budget // 2 // SAMPLES_PER_PERIOD))
    times = np.unique(np.clip(np.concatenate([grid, at, *windows]), 0.0, end))
    return Sampling(times, min(1.0, len(windows) * shortest / end))


def highest_frequency(trajectory: Trajectory) -> float:
    """Of the levels that a trajectory visits [Hz]."""
    levels = {segment.level.level.indices: segment.level.level for segment in trajectory.segments}
    return max(level.highest_frequency for level in levels.values())


def _windows(trajectory: Trajectory, width: float, count: int) -> list[np.ndarray]:
    happened = len(trajectory.events)
    chosen = np.unique(np.linspace(0, happened - 1, count).astype(int)) if happened else ()
    centres = [trajectory.events[int(i)].time for i in chosen] or np.linspace(0.0, trajectory.t_end, count)
    return [centre + width * np.linspace(-0.5, 0.5, SAMPLES_PER_PERIOD) for centre in centres]


def sample_contact(
    trajectory: Trajectory,
    contact: UnilateralContact,
    table: SegmentTable,
    times: np.ndarray,
    loads: Sequence[Load] = (),
) -> ContactSamples:
    """One contact at times (k,), its stop moved by some of the loads."""
    chunks = np.array_split(times, math.ceil(len(times) / CHUNK))
    row = trajectory.model.structure.row(contact.direction)
    gap = np.concatenate([np.asarray(trajectory.at(row, chunk)) for chunk in chunks]) + contact.gap
    gap = gap - _way(trajectory, contact, row, times, loads)
    force = np.concatenate([np.asarray(trajectory.contact_force(contact.name, chunk)) for chunk in chunks])
    owner, i = table.owners(times), trajectory.model.index(contact.name)
    slowed, excused = np.zeros(len(times)), times <= table.excused[owner, i]
    if contact.damping > 0:
        rate = np.concatenate([row @ trajectory.velocity(chunk) for chunk in chunks])
        rate = rate - _way(trajectory, contact, row, times, loads, derivative=True)
        slowed, excused = contact.damping / contact.stiffness * rate, excused & truncated(trajectory)
    return ContactSamples(times, gap, gap + np.maximum(0.0, slowed), slowed, force, table.closed[owner, i], excused)


def truncated(trajectory: Trajectory) -> bool:
    """Whether a level has fewer modes than the structure has motions."""
    return trajectory.model.level(()).modes < trajectory.model.structure.n


def _way(
    trajectory: Trajectory,
    contact: UnilateralContact,
    row: np.ndarray,
    times: np.ndarray,
    loads: Sequence[Load],
    derivative: bool = False,
) -> np.ndarray:
    """z (k,) [m] of a contact's stop, away from it, seen from the base, or z' [m/s]."""
    way = np.zeros(len(times))
    for load in loads:
        if isinstance(load, StopMotion) and load.contact == contact.name:
            history = load.course.history(trajectory.t_end)
            way += (history.derivative if derivative else history).at(times)
        if isinstance(load, BaseMotion) and contact.name in load.fixed_stops:
            carried = float(row @ trajectory.model.structure.row(load.direction))
            history = load.course.history(trajectory.t_end)
            way -= carried * (history.derivative if derivative else history).at(times)
    return way


def missed(trajectory: Trajectory, samples: ContactSamples, table: SegmentTable, name: str, tolerance: float) -> int:
    """Closings and openings of a contact that no event tells: the most that one of three ways to look finds.

    Samples of a below -tolerance in an open contact that its phase does not excuse (a run of them counts once);
    changes of the sign of a; changes of the level between segments.
    """
    own, slack = _times(trajectory, name), TIME_ROUND_OFF * trajectory.t_end
    entered = (samples.apart < -tolerance) & ~samples.closed & ~samples.excused
    inside = int(entered[0]) + int(np.sum(entered[1:] & ~entered[:-1]))
    return max(
        inside,
        _sign_changes_without_event(samples, own, slack, tolerance),
        switches_without_event(trajectory, table, name),
    )


def switches_without_event(trajectory: Trajectory, table: SegmentTable, name: str) -> int:
    """How often an element changes its state between segments without an event."""
    i, slack = trajectory.model.index(name), TIME_ROUND_OFF * trajectory.t_end
    switched = table.start[1:][table.states[1:, i] != table.states[:-1, i]]
    return int(np.sum(_events_in(_times(trajectory, name), switched - slack, switched + slack) == 0))


def _times(trajectory: Trajectory, name: str) -> np.ndarray:
    """When (k,) [s] an element changes."""
    return np.array([event.time for event in trajectory.events if event.contact == name])


def _sign_changes_without_event(samples: ContactSamples, own: np.ndarray, slack: float, tolerance: float) -> int:
    """Changes of the sign of a between which no event lies and which no phase excuses."""
    clear = np.flatnonzero(np.abs(samples.apart) > tolerance)
    before, after = clear[:-1], clear[1:]
    change = samples.apart[before] * samples.apart[after] < 0
    change &= ~(samples.excused[before] | samples.excused[after])
    between = _events_in(own, samples.times[before[change]] - slack, samples.times[after[change]] + slack)
    return int(np.sum(between == 0))


def _events_in(own: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """How many of the ascending times lie in each interval."""
    return np.searchsorted(own, last, side="right") - np.searchsorted(own, first, side="left")
