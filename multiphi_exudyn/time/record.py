"""Record: segments and events of a run as the core keeps them.

Values at many times come from the core's sampler; single segments and events are made when they are read.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mechanics.element import event_kind
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.segments import Segment, Segments
from multiphi_exudyn.time.state import Event, Loss, Phase

__all__ = ["PHASES", "Events", "Record"]

PHASES = (Phase.ARMED, Phase.RECOVERING, Phase.REFUSED, Phase.HELD_BACK, Phase.LANDING)  # in the order of their numbers


class Record(Segments):
    """Segments of ``trajectory`` so far, in levels of the core; the run may go on.

    loaded: the levels under the loads. levels: the visited ones. left_out: segments whose works the run has left out.
    truncation: what the run has lost by it (core/truncation.hpp).

    Rows of events are arrays (k,): elements, states entered (-1 for impulses on contacts that stay closed, which
    precede the event they belong to) and left, times [s], impulses [N s], losses [J] in the order of ``Loss`` (k, 6).
    """

    def __init__(self, loaded: LoadedLevels, core_levels: core.Levels, trajectory: core.Trajectory) -> None:
        self.loaded, self.core_levels, self.trajectory = loaded, core_levels, trajectory
        self.numbers = np.asarray(trajectory.levels)
        self.elements = np.asarray(trajectory.event_elements)
        self.entered = np.asarray(trajectory.event_entered)
        self.left_out = np.asarray(trajectory.left_out, np.int32)
        self.truncation = copy.copy(trajectory.truncation)
        self._works = copy.copy(trajectory.ledger.works)

    def __getstate__(self) -> dict[str, Any]:
        return {"loaded": self.loaded, "trajectory": self.trajectory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["loaded"], state["loaded"].in_core, state["trajectory"])  # type: ignore[misc]

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, index: int | slice) -> Any:
        positions = range(len(self))[index]
        return self._segment(positions) if isinstance(positions, int) else tuple(map(self._segment, positions))

    @functools.cached_property
    def starts(self) -> np.ndarray:  # type: ignore[override]
        """Starts (n,) [s] of the segments."""
        return np.asarray(self.trajectory.instants)[: len(self)]

    @functools.cached_property
    def ends(self) -> np.ndarray:  # type: ignore[override]
        """Their ends (n,) [s]."""
        return np.asarray(self.trajectory.instants)[1 : len(self) + 1]

    @functools.cached_property
    def visited(self) -> tuple[tuple[int, ...], ...]:
        """States of the elements of the visited levels."""
        return tuple(map(tuple, self.trajectory.keys))

    @functools.cached_property
    def levels(self) -> list[LoadedLevel]:  # type: ignore[override]
        """The visited levels, by their numbers."""
        return [self.loaded.level(states) for states in self.visited]

    @functools.cached_property
    def all_armed(self) -> np.ndarray:
        """Whether (n,) every guard is armed at the start of a segment: then no signal is below zero in it."""
        return np.asarray(self.trajectory.all_armed)[: len(self)].astype(bool)

    @functools.cached_property
    def _sampler(self) -> core.Sampler:
        return core.Sampler(self.core_levels, self.trajectory)

    @functools.cached_property
    def _width(self) -> int:
        """Largest number of coordinates of a level."""
        return max(self.trajectory.widths, default=0)

    # ------------------------------------------------------------------ segments

    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """See ``Segments``."""
        segments, delays = np.ascontiguousarray(places, np.int32), np.ascontiguousarray(after, float)
        return np.asarray(self._sampler.states(segments, delays, self._width)).reshape(2, len(places), self._width)

    def values(self, times: np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> np.ndarray:
        """See ``Segments``."""
        width = self._width
        rows = np.zeros((len(self.levels), 2 * width + 1))
        for number, level in enumerate(self.levels):
            function, n = row(level), level.level.modes
            rows[number, :n], rows[number, width : width + n] = function[:n], function[n : 2 * n]
            rows[number, -1] = function[-1]
        return np.asarray(self._sampler.values(np.ascontiguousarray(times, float), side == "left", rows))

    def sizes(self, end: float) -> tuple[float, float]:
        """Mean of |y|^2 [m2 kg] and largest energy [J] from the first start to ``end`` [s], from even instants.

        The mean is that of a polygon through them; energy: kinetic and strain, its absolute value.
        """
        square, largest = self._sampler.sizes(end)
        return square, largest

    @functools.cached_property
    def works(self) -> tuple[float, float, float]:
        """Work [J] of damping, of loads and stops that vary in time, and of friction."""
        all_works = [self._works, *([self._sampler.works(list(self.left_out))] if len(self.left_out) else [])]
        return (
            sum(each.damping for each in all_works),
            sum(each.varying for each in all_works),
            sum(each.friction for each in all_works),
        )

    def start_phases(self) -> np.ndarray:
        """Phases (n, e), in numbers, at the start of every segment; e: largest number of guards of a level."""
        phases = [self.trajectory.start_phases(i) for i in range(len(self))]
        numbers = np.zeros((len(self), max(map(len, phases), default=0)), np.int64)
        for i, each in enumerate(phases):
            numbers[i, : len(each)] = [phase.value for phase in each]
        return numbers

    def _segment(self, i: int) -> Segment:
        """Return the i-th segment."""
        rates, listed, unit, shapes, coefficients, free = self._sampler.closed_form(i)
        powers, level = np.array(listed, int), self.levels[self.numbers[i]]
        rows, held = shapes * coefficients, level.modal.modes + level.excitation.prescribed
        if held < len(rows):  # a constant term for the displacements that links hold
            still = np.zeros(len(rows), complex)
            still[held:] = np.asarray(self.trajectory.start(i)[0])[held:]
            rates, powers, rows = np.append(rates, 0j), np.append(powers, 0), np.column_stack([rows, still])
        phases = tuple(PHASES[phase.value] for phase in self.trajectory.start_phases(i))
        armed_at = float(np.asarray(self.trajectory.armed_after)[i])
        basis = Exponentials(rates, powers, unit)
        return Segment(float(self.starts[i]), float(self.ends[i]), level, basis, rows, free, phases, armed_at)

    def _integral(
        self, level: LoadedLevel, row: np.ndarray, places: np.ndarray, starts: np.ndarray, ends: np.ndarray
    ) -> float:
        """See ``Segments``; in closed form at once where no channel is a function of time."""
        if level.excitation.prescribed:
            return super()._integral(level, row, places, starts, ends)
        response, r, n = level.response, level.modal.modes, level.width
        x, v = self.states(places, starts - self.starts[places])[:, :, :n]
        c = x[:, :r] @ response.from_displacement.T + v[:, :r] @ response.from_velocity.T
        if level.driven:
            c = c + response.from_force @ level.asymptotic.drive
        if level.channels.force.any():
            c = c + x[:, r:] @ level.channels.force.T @ response.from_force.T
        terms = c * (row[:r] @ response.shapes)
        terms = terms + response.basis.derivative(c * (row[n : n + r] @ response.shapes))
        moved = (terms * response.basis.integrals((ends - starts)[:, None])).real.sum()
        return float(moved + (row[-1] + x[:, r:] @ row[r:n]) @ (ends - starts))

    # ------------------------------------------------------------------ events

    @functools.cached_property
    def event_rows(self) -> np.ndarray:
        """Indices of the rows that are events, not shared impulses."""
        return np.flatnonzero(self.entered >= 0).astype(np.int32)

    @functools.cached_property
    def times(self) -> np.ndarray:
        """Times [s] of all rows of events."""
        return np.asarray(self.trajectory.event_times)[: len(self.entered)]

    @functools.cached_property
    def left(self) -> np.ndarray:
        """States left, of all rows of events."""
        return np.asarray(self.trajectory.event_left)[: len(self.entered)]

    @functools.cached_property
    def impulses(self) -> np.ndarray:
        """Impulses [N s] of all rows of events."""
        return np.asarray(self.trajectory.event_impulses)[: len(self.entered)]

    @functools.cached_property
    def losses(self) -> np.ndarray:
        """Energies [J] lost at all rows of events, in the order of ``Loss`` (m, 6)."""
        return np.asarray(self.trajectory.event_losses)[: len(self.entered)]


class Events(Sequence[Event]):
    """The events of a record so far; compares like a tuple."""

    def __init__(self, record: Record) -> None:
        self._record = record

    def __len__(self) -> int:
        return len(self._record.event_rows)

    def __getitem__(self, index: int | slice) -> Any:
        positions = range(len(self))[index]
        return self._event(positions) if isinstance(positions, int) else tuple(map(self._event, positions))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(tuple(self))

    @property
    def loss(self) -> Loss:
        """Energies [J] lost at all events."""
        return Loss(*self._record.losses.sum(axis=0).tolist())

    def impulse(self, contact: str, first: float, last: float) -> float:
        """Impulse [N s] on a contact in [first, last] [s], impacts of other contacts included."""
        record, number = self._record, self._record.loaded.model.index(contact)
        within = (record.elements == number) & (record.times >= first) & (record.times <= last)
        return float(record.impulses[within].sum())

    def table(self) -> np.ndarray:
        """Time [s], position of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4)."""
        record, rows = self._record, self._record.event_rows
        truncation = record.losses[rows, 1] + record.losses[rows, 2]
        return np.column_stack([record.times[rows], record.elements[rows], record.impulses[rows], truncation])

    def _event(self, i: int) -> Event:
        """The i-th event."""
        record, contacts = self._record, self._record.loaded.model.contacts
        row, before = int(record.event_rows[i]), int(record.event_rows[i - 1]) + 1 if i else 0
        shared = tuple((contacts[int(record.elements[k])].name, float(record.impulses[k])) for k in range(before, row))
        contact, entered = contacts[int(record.elements[row])], int(record.entered[row])
        kind = event_kind(contact.states, int(record.left[row]), entered)
        loss, impulse = Loss(*record.losses[row].tolist()), float(record.impulses[row])
        state = contact.states[entered].name
        return Event(float(record.times[row]), contact.name, kind, loss, impulse, shared, state)
