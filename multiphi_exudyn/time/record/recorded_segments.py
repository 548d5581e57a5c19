"""Recorded segments and events: sequences that make each object when it is first read."""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar, overload

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Event, Loss
from multiphi_exudyn.mechanics.elements.element import event_kind
from multiphi_exudyn.time.record.record import Record
from multiphi_exudyn.time.segments.segment import Segment, Segments

__all__ = ["Events", "Recorded"]

T = TypeVar("T")


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
