"""What the compiled loop has done, in arrays that grow; segments and events are made when somebody looks at them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar, overload

import numpy as np

from multiphi_exudyn.events.state import Event, Loss, Phase
from multiphi_exudyn.time.compiled.kernel import CLOSE, OPEN
from multiphi_exudyn.time.compiled.pack import Pack
from multiphi_exudyn.time.segment import Batch, Segment, batched

__all__ = ["NUMBERS", "PHASES", "Record"]

ROWS = 128  # at first
UNPACKED = -1  # in place of a level: a segment of the NumPy loop, which is kept as it is
PHASES = tuple(Phase)
NUMBERS = {phase: number for number, phase in enumerate(PHASES)}

T = TypeVar("T")


class Made(Sequence[T], Generic[T]):
    """A sequence of objects that are made one by one when they are asked for; compares like a tuple."""

    def __init__(self, make: Callable[[int], T], count: int, known: dict[int, T]) -> None:
        self._make, self._count, self._known = make, count, known

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[T, ...]: ...
    def __getitem__(self, index: int | slice) -> T | tuple[T, ...]:
        positions = range(self._count)[index]
        return self._one(positions) if isinstance(positions, int) else tuple(map(self._one, positions))

    def _one(self, i: int) -> T:
        if i not in self._known:
            self._known[i] = self._make(i)
        return self._known[i]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and tuple(self) == tuple(other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return repr(tuple(self))


class Segments(Made[Segment]):
    """The segments of a record."""

    def __init__(self, record: Record) -> None:
        super().__init__(record.segment, record.count, record.made)
        self._record = record

    def batches(self) -> list[Batch]:
        """By level and exponentials, in arrays."""
        return self._record.batches(len(self))


class Events(Made[Event]):
    """The events of a record."""

    def __init__(self, record: Record) -> None:
        super().__init__(record.event, record.happened, record.known)
        self._record = record

    def table(self) -> np.ndarray:
        """Time [s], position of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4)."""
        time, _, kinetic, strain, impulse = self._record.amounts[: len(self)].T
        return np.column_stack([time, self._record.kinds[: len(self), 0], impulse, kinetic + strain])


class Record:
    """Segments and events of a run, in rows as kernel.run writes them; those of the NumPy loop stand among them."""

    def __init__(self, pack: Pack) -> None:
        self._pack = pack
        contacts = pack.rule.model.contacts
        self._names = [contact.name for contact in contacts]
        self.count = self.happened = 0
        self.spans = np.empty((ROWS, 4))
        self.levels = np.empty(ROWS, np.int64)
        self.coefficients = np.empty((ROWS, 2, pack.levels.rates.shape[2]))
        self.standings = np.empty((ROWS, len(contacts)), np.int8)
        self.amounts = np.empty((ROWS, 5))
        self.kinds = np.empty((ROWS, 2), np.int64)
        self.made: dict[int, Segment] = {}
        self.known: dict[int, Event] = {}

    @property
    def segments(self) -> Segments:
        """All segments so far."""
        return Segments(self)

    def batches(self, count: int) -> list[Batch]:
        """The first ``count`` segments by level and exponentials."""
        levels = self.levels[:count]
        packed = [self._batch(k, np.flatnonzero(levels == k)) for k in sorted(set(levels.tolist()) - {UNPACKED})]
        return packed + batched({i: self.made[i] for i in np.flatnonzero(levels == UNPACKED).tolist()})

    def _batch(self, level: int, places: np.ndarray) -> Batch:
        loaded = self._pack.loaded[level]
        response, spans = loaded.level.response, self.spans[places]
        re, im = self.coefficients[places, :, : len(response.basis.rates)].swapaxes(0, 1)
        return Batch(loaded, places, spans[:, 0], spans[:, 1], response.basis, response.shapes, re + 1j * im)

    @property
    def events(self) -> Events:
        """All events so far."""
        return Events(self)

    def add(self, segment: Segment) -> None:
        """A segment of the NumPy loop."""
        self.make_room()
        self.spans[self.count] = segment.start, segment.end, segment.armed_at, segment.level.level.highest_frequency
        position = self._pack.known(segment.level)
        self.levels[self.count] = UNPACKED if position is None else position
        if position is not None:
            c = segment.coefficients
            self.coefficients[self.count, :, : len(c)] = c.real, c.imag
        self.made[self.count] = segment
        self.count += 1

    def add_event(self, event: Event) -> None:
        """An event of the NumPy loop."""
        self.make_room()
        loss, contact = event.loss, self._names.index(event.contact)
        row = event.time, loss.impact, loss.truncation_kinetic, loss.truncation_strain, event.impulse
        self.amounts[self.happened] = row
        self.kinds[self.happened] = contact, CLOSE if event.kind == "close" else OPEN
        self.known[self.happened] = event
        self.happened += 1

    def recent(self, count: int) -> list[tuple[float, float]]:
        """Start [s] and highest frequency [Hz] of the last ``count`` segments."""
        spans = self.spans[max(0, self.count - count) : self.count]
        return list(zip(spans[:, 0].tolist(), spans[:, 3].tolist(), strict=True))

    def make_room(self) -> None:
        """For at least one more segment and two events, of the widest level."""
        if self.count >= len(self.spans):
            for name in ("spans", "levels", "coefficients", "standings"):
                setattr(self, name, _doubled(getattr(self, name)))
        while self.happened + 2 > len(self.amounts):
            self.amounts, self.kinds = _doubled(self.amounts), _doubled(self.kinds)
        missing = self._pack.levels.rates.shape[2] - self.coefficients.shape[2]
        if missing:
            self.coefficients = np.pad(self.coefficients, ((0, 0), (0, 0), (0, missing)))

    def segment(self, i: int) -> Segment:
        """The i-th segment, of those that the kernel has written."""
        start, end, armed_at, _ = self.spans[i].tolist()
        level = self._pack.loaded[self.levels[i]]
        re, im = self.coefficients[i, :, : len(level.level.response.basis.rates)]
        return Segment(start, end, level, re + 1j * im, tuple(PHASES[k] for k in self.standings[i].tolist()), armed_at)

    def event(self, i: int) -> Event:
        """The i-th event, of those that the kernel has written."""
        time, impact, kinetic, strain, impulse = self.amounts[i].tolist()
        contact, kind = self.kinds[i].tolist()
        loss = Loss(impact, kinetic, strain)
        return Event(time, self._names[contact], "close" if kind == CLOSE else "open", loss, impulse)


def _doubled(rows: np.ndarray) -> np.ndarray:
    return np.concatenate([rows, np.empty_like(rows)])
