"""Recorded segments and events: sequences that make each object when it is first read."""

from __future__ import annotations

import bisect
import functools
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar, overload

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Event, Loss
from multiphi_exudyn.mechanics.elements.element import event_kind
from multiphi_exudyn.time.record.record import Record
from multiphi_exudyn.time.segments.segment import Segment, Segments

__all__ = ["Events", "Recorded"]

T = TypeVar("T")
NO_SUMS = np.full(a.VERDICT + 2 - a.WORKS, np.nan)


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
    """The segments of a record so far.

    sums: as the loop has them from WORKS on: works (3,) [J] of all segments that the record does not list as left out,
    defects, truncated and verdict (2,), see Segments.
    """

    def __init__(self, record: Record, sums: np.ndarray = NO_SUMS) -> None:
        self._make, self._count, self._made = record.segment, record.count, {}
        self._record, self.arrays = record, record.arrays
        self._sums, self._left_out = sums, record.left_out_count
        self._sizes: dict[float, tuple[float, float]] = {}  # by the end of the time

    @property
    def defects(self) -> float:
        """See ``Segments``."""
        return float(self._sums[a.DEFECTS - a.WORKS])

    @property
    def truncated(self) -> float:
        """See ``Segments``."""
        return float(self._sums[a.TRUNCATED - a.WORKS])

    @property
    def verdict(self) -> tuple[float, float]:
        """See ``Segments``."""
        share, error = self._sums[a.VERDICT - a.WORKS :].tolist()
        return share, error

    @functools.cached_property
    def starts(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.instants[: self._count]

    @functools.cached_property
    def ends(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.instants[1 : self._count + 1]

    @functools.cached_property
    def numbers(self) -> np.ndarray:
        """See ``Segments``."""
        return self._record.rows[: self._count, 0]

    @property
    def settled(self) -> np.ndarray:
        """See ``Segments``."""
        return np.asarray(self._record.rows[: self._count, 3] < 0)

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

    @property
    def works(self) -> tuple[float, float, float]:
        """See ``Segments``."""
        damping, varying, friction = self._sums[:3].tolist()
        return self._completed if self._left_out else (damping, varying, friction)

    @functools.cached_property
    def _completed(self) -> tuple[float, float, float]:
        """The works, those of the segments that were left out included."""
        damping, varying, friction = self._sums[:3].tolist()
        further = self._record.works(self._record.left_out[: self._left_out])
        return damping + further[0], varying + further[1], friction + further[2]


class Events(LazySequence[Event]):
    """The events of a record so far; lost (6,): energies [J] lost at all of them."""

    def __init__(self, record: Record, lost: np.ndarray) -> None:
        self._count, self._made = record.event_count, {}
        self._record, self._lost = record, lost

    @property
    def loss(self) -> Loss:
        """Energies [J] lost at all events."""
        return Loss(*self._lost.tolist())

    def impulse(self, contact: str, first: float, last: float) -> float:
        """Impulse [N s] on a contact in [first, last] [s], impacts of other contacts included."""
        names, times = [name for name, _ in self._record.contact_states], self._record.amounts[:, 0]
        is_impact = (self._record.kinds[:, 0] == names.index(contact)) & (times >= first) & (times <= last)
        return float(self._impulses[is_impact].sum())

    def table(self) -> np.ndarray:
        """Time [s], position of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4)."""
        places, amounts = self._record.event_rows, self._record.amounts
        time, truncation = amounts[places, 0], amounts[places, 1] + amounts[places, 2]
        return np.column_stack([time, self._record.kinds[places, 0], self._impulses[places], truncation])

    @property
    def _impulses(self) -> np.ndarray:
        """Impulse [N s] of every row of kinds (m,)."""
        impulses = np.zeros(len(self._record.kinds))
        impulses[self._record.struck] = self._record.impacts[:, 0]
        return impulses

    def _impact(self, place: int) -> list[float]:
        """The row of impacts that belongs to a row of kinds, zeros where there is none."""
        struck = self._record.struck
        k = bisect.bisect_left(struck, place)
        if k == len(struck) or struck[k] != place:
            return [0.0] * a.IMPACT_WIDTH
        row: list[float] = self._record.impacts[k].tolist()
        return row

    def _make(self, i: int) -> Event:
        """The i-th event."""
        record, contacts = self._record, self._record.contact_states
        place = int(record.event_rows[i])
        before = int(record.event_rows[i - 1]) + 1 if i else 0
        time, kinetic, strain = record.amounts[place].tolist()
        impulse, impact, stop_work, damping, friction = self._impact(place)
        contact, entered, left = record.kinds[place].tolist()
        shared = tuple((contacts[record.kinds[k, 0]][0], self._impact(k)[0]) for k in range(before, place))
        name, states = contacts[contact]
        kind, loss = event_kind(states, left, entered), Loss(impact, kinetic, strain, stop_work, damping, friction)
        return Event(time, name, kind, loss, impulse, shared, states[entered].name)
