"""Record: segments and events of a run as the core keeps them, and values of many segments at once.

Recorded segments and events: sequences that make each object when it is first read.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Sequence
from typing import Any, Generic, TypeVar, overload

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Event, Loss, Phase
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mechanics.element import ElementState, event_kind
from multiphi_exudyn.time.core_levels import core_levels
from multiphi_exudyn.time.segments import Flow, Segment, Segments

__all__ = ["PHASES", "Events", "Record", "Recorded"]

PHASES = (Phase.ARMED, Phase.RECOVERING, Phase.REFUSED, Phase.HELD_BACK, Phase.LANDING)  # in the order of their numbers
T = TypeVar("T")


class Record:
    """Segments and events of ``trajectory`` so far, in levels that ``core_levels`` have built.

    count: of segments. rows of events: impulses on contacts that stay closed (shared) precede the event they belong to.
    """

    def __init__(self, levels: LoadedLevels, core_levels: core.Levels, trajectory: core.Trajectory) -> None:
        self.loaded, self.core_levels, self.trajectory = levels, core_levels, trajectory
        self.level_numbers = np.asarray(trajectory.levels)
        self.count = len(self.level_numbers)
        self.elements = np.asarray(trajectory.event_elements)
        self.entered = np.asarray(trajectory.event_entered)
        self.left_out = np.asarray(trajectory.left_out, np.int32)

    def __getstate__(self) -> dict[str, Any]:
        return {"loaded": self.loaded, "trajectory": self.trajectory}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(state["loaded"], core_levels(state["loaded"]), state["trajectory"])  # type: ignore[misc]

    @functools.cached_property
    def instants(self) -> np.ndarray:
        """Starts of the segments, and the end of the last one (n + 1,) [s]."""
        return np.asarray(self.trajectory.instants)[: self.count + 1]

    @functools.cached_property
    def settled(self) -> np.ndarray:
        """Whether (n,) every guard is armed at the start of a segment."""
        return np.asarray(self.trajectory.all_armed)[: self.count].astype(bool)

    @functools.cached_property
    def visited(self) -> tuple[tuple[int, ...], ...]:
        """States of the elements of every visited level."""
        return tuple(map(tuple, self.trajectory.keys))

    @functools.cached_property
    def levels(self) -> list[LoadedLevel]:
        """The visited levels, by their numbers."""
        return [self.loaded.level(states) for states in self.visited]

    @property
    def bytes(self) -> int:
        """Memory of the record."""
        return self.trajectory.memory

    @functools.cached_property
    def _sampler(self) -> core.Sampler:
        return core.Sampler(self.core_levels, self.trajectory)

    @functools.cached_property
    def width(self) -> int:
        """Largest number of coordinates of a level."""
        return max(self.trajectory.widths, default=0)

    # ------------------------------------------------------------------ segments

    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """xi and xi' (2, k, n) of the segments ``places`` (k,), times ``after`` (k,) [s] their starts.

        n: largest number of coordinates of a level; coordinates beyond those of a level are zero.
        """
        count, width = len(places), self.width
        segments, delays = np.ascontiguousarray(places, np.int32), np.ascontiguousarray(after, float)
        return np.asarray(self._sampler.states(segments, delays, width)).reshape(2, count, width)

    def values(self, times: np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> np.ndarray:
        """row.(xi, xi', 1) (k,) at times (k,) [s]; row: (2 n + 1,) of a level with n coordinates."""
        width = self.width
        rows = np.zeros((len(self.levels), 2 * width + 1))
        for number, level in enumerate(self.levels):
            function, n = row(level), level.level.modes
            rows[number, :n], rows[number, width : width + n], rows[number, -1] = (
                function[:n],
                function[n : 2 * n],
                function[-1],
            )
        return np.asarray(self._sampler.values(np.ascontiguousarray(times, float), side == "left", rows))

    def sizes(self, end: float) -> tuple[float, float]:
        """Mean of |y|^2 [m2 kg] and largest energy [J] up to ``end`` [s], see ``Segments``."""
        square, largest = self._sampler.sizes(end)
        return square, largest

    def works(self, places: Sequence[int] | np.ndarray) -> tuple[float, float, float]:
        """Work [J] of damping, of varying loads, jumps at the starts included, and of friction in segments (k,)."""
        works = self._sampler.works(list(places))
        return works.damping, works.varying, works.friction

    def level(self, i: int) -> LoadedLevel:
        """Level of the i-th segment."""
        return self.levels[self.level_numbers[i]]

    def phases_at_start(self, i: int) -> tuple[Phase, ...]:
        """Phases at the start of the i-th segment."""
        return tuple(PHASES[phase.value] for phase in self.trajectory.start_phases(i))

    def start_phases(self) -> np.ndarray:
        """Phases (n, e), in numbers, at the start of every segment; e: largest number of guards of a level."""
        phases = [self.trajectory.start_phases(i) for i in range(self.count)]
        numbers = np.zeros((self.count, max(map(len, phases), default=0)), np.int64)
        for i, each in enumerate(phases):
            numbers[i, : len(each)] = [phase.value for phase in each]
        return numbers

    def segment(self, i: int) -> Segment:
        """Return the i-th segment."""
        start, end = self.instants[i : i + 2].tolist()
        rates, listed, unit, shapes, coefficients, free = self._sampler.closed_form(i)
        powers, level = np.array(listed, int), self.level(i)
        held = level.modal.modes + level.excitation.prescribed
        if held < len(shapes):  # a constant term for the displacements that links hold
            still = np.zeros(len(shapes), complex)
            still[held:] = np.asarray(self.trajectory.start(i)[0])[held:]
            rates, powers = np.append(rates, 0j), np.append(powers, 0)
            shapes, coefficients = np.column_stack([shapes, still]), np.append(coefficients, 1.0 + 0j)
        flow = Flow(Exponentials(rates, powers, unit), shapes, coefficients, free)
        armed_after, entry_work = (
            np.asarray(each)[i] for each in (self.trajectory.armed_after, self.trajectory.entry_works)
        )
        return Segment(start, end, level, flow, self.phases_at_start(i), float(armed_after), float(entry_work))

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

    @functools.cached_property
    def contact_states(self) -> list[tuple[str, tuple[ElementState, ...]]]:
        """Name and states of every contact."""
        return [(contact.name, contact.states) for contact in self.loaded.model.contacts]


class LazySequence(Sequence[T], Generic[T]):
    """Sequence whose objects are made one by one when they are read; compares like a tuple."""

    _make: Callable[[int], T]
    _count: int
    _made: dict[int, T]

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[T, ...]: ...
    def __getitem__(self, index: int | slice) -> T | tuple[T, ...]:
        positions = range(self._count)[index]
        return self._object(positions) if isinstance(positions, int) else tuple(map(self._object, positions))

    def _object(self, i: int) -> T:
        if i not in self._made:
            self._made[i] = self._make(i)
        return self._made[i]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(tuple(self))


class Recorded(LazySequence[Segment], Segments):
    """The segments of a record so far."""

    def __init__(self, record: Record) -> None:
        self._make, self._count, self._made = record.segment, record.count, {}
        self._record = record
        # copies, as the run may go on
        self._truncation = copy.copy(record.trajectory.truncation)
        self._works = copy.copy(record.trajectory.ledger.works)
        self._sizes: dict[float, tuple[float, float]] = {}  # by the end of the time

    @property
    def defects(self) -> float:
        """See ``Segments``."""
        return self._truncation.defects

    @property
    def truncated(self) -> float:
        """See ``Segments``."""
        return self._truncation.truncated_energy

    @property
    def verdict(self) -> tuple[float, float]:
        """See ``Segments``."""
        return self._truncation.energy_share, self._truncation.motion

    @property
    def starts(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.instants[:-1]

    @property
    def ends(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.instants[1:]

    @property
    def numbers(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.level_numbers

    @property
    def settled(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.settled

    @property
    def levels(self) -> Sequence[LoadedLevel]:
        """See ``Segments``."""
        return self._record.levels

    @property
    def visited(self) -> tuple[tuple[int, ...], ...]:
        """See ``Segments``."""
        return self._record.visited

    def states(self, places: np.ndarray, after: np.ndarray) -> np.ndarray:
        """See ``Segments``."""
        return self._record.states(places, after)

    def values(self, times: np.ndarray, side: str, row: Callable[[LoadedLevel], np.ndarray]) -> np.ndarray:
        """See ``Segments``."""
        return self._record.values(times, side, row)

    def sizes(self, end: float) -> tuple[float, float]:
        """See ``Segments``."""
        if end not in self._sizes:
            self._sizes[end] = self._record.sizes(end)
        return self._sizes[end]

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

    @functools.cached_property
    def works(self) -> tuple[float, float, float]:
        """See ``Segments``; those that the run has left out are computed now."""
        further = self._record.works(self._record.left_out) if len(self._record.left_out) else (0.0, 0.0, 0.0)
        return (
            self._works.damping + further[0],
            self._works.varying + further[1],
            self._works.friction + further[2],
        )


class Events(LazySequence[Event]):
    """The events of a record so far."""

    def __init__(self, record: Record) -> None:
        self._count, self._made = len(record.event_rows), {}
        self._record = record

    @property
    def loss(self) -> Loss:
        """Energies [J] lost at all events."""
        return Loss(*self._record.losses.sum(axis=0).tolist())

    def impulse(self, contact: str, first: float, last: float) -> float:
        """Impulse [N s] on a contact in [first, last] [s], impacts of other contacts included."""
        record, names = self._record, [name for name, _ in self._record.contact_states]
        within = (record.elements == names.index(contact)) & (record.times >= first) & (record.times <= last)
        return float(record.impulses[within].sum())

    def table(self) -> np.ndarray:
        """Time [s], position of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4)."""
        record, rows = self._record, self._record.event_rows
        truncation = record.losses[rows, 1] + record.losses[rows, 2]
        return np.column_stack([record.times[rows], record.elements[rows], record.impulses[rows], truncation])

    def _make(self, i: int) -> Event:
        """The i-th event."""
        record, contacts = self._record, self._record.contact_states
        row = int(record.event_rows[i])
        before = int(record.event_rows[i - 1]) + 1 if i else 0
        shared = tuple(
            (contacts[element][0], impulse)
            for element, impulse in zip(
                record.elements[before:row].tolist(), record.impulses[before:row].tolist(), strict=True
            )
        )
        name, states = contacts[int(record.elements[row])]
        entered, left = int(record.entered[row]), int(record.left[row])
        kind, loss = event_kind(states, left, entered), Loss(*record.losses[row].tolist())
        return Event(
            float(record.times[row]), name, kind, loss, float(record.impulses[row]), shared, states[entered].name
        )
