"""What the loop has done, taken from its arrays; segments and events are made when somebody looks at them."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar, overload

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.level_arrays import LevelArrays
from multiphi_exudyn.events.state import Event, Loss, Phase
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.time.segment import Batch, Segment

__all__ = ["PHASES", "Record"]

PHASES = (Phase.ARMED, Phase.RECOVERING, Phase.REFUSED, Phase.HELD_BACK)  # in the order of their numbers

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
        super().__init__(record.segment, len(record.spans), {})
        self._record = record

    def batches(self) -> list[Batch]:
        """By level and exponentials, in arrays."""
        return self._record.batches()

    @property
    def starts(self) -> np.ndarray:
        """Their starts (n,) [s]."""
        return self._record.spans[: len(self), 0]


class Events(Made[Event]):
    """The events of a record."""

    def __init__(self, record: Record) -> None:
        super().__init__(record.event, len(record.places), {})
        self._record = record

    def table(self) -> np.ndarray:
        """Time [s], position of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4)."""
        places, amounts = self._record.places, self._record.amounts
        time, truncation = amounts[places, 0], amounts[places, 2] + amounts[places, 3]
        return np.column_stack([time, self._record.kinds[places, 0], amounts[places, 6], truncation])


class Record:
    """Segments and events of a run, in arrays that grow.

    rows (n, 5): number of the level, piece, events before, where coordinates and phases stand (-1: all armed).
    spans (n, 6): start, end, armed at, horizon [s], work [J] at the start, since when [s] its piece lasts.
    coordinates: xi, xi' of every start.
    phases: of the starts at which some are not armed. kinds (m, 2): contact, state entered, or SHARED.
    amounts (m, 7): time [s], five losses [J], impulse [N s]. names: of the contacts.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        self._levels: dict[int, LoadedLevel] = {}
        self.rows, self.spans = np.empty((0, a.SEGMENT_WIDTH), np.int64), np.empty((0, a.SEGMENT_WIDTH_NUMBERS))
        self.coordinates, self.phases = np.empty(0), np.empty(0, np.int64)
        self.kinds, self.amounts = np.empty((0, a.EVENT_WIDTH), np.int64), np.empty((0, a.EVENT_WIDTH_NUMBERS))

    def take(self, arrays: LevelArrays) -> None:
        """Take over what the loop has written."""
        ints, numbers = arrays.ints, arrays.numbers
        n, m = int(ints[a.SEGMENT_COUNT]), int(ints[a.EVENT_COUNT])
        rows = ints[ints[a.SEGMENT_INTS] :][: n * a.SEGMENT_WIDTH].reshape(n, a.SEGMENT_WIDTH).copy()
        for number in set(rows[:, 0].tolist()) - set(self._levels):
            self._levels[number] = arrays.loaded[number]
        rows[:, 2] += len(self.kinds)
        rows[:, 3] += len(self.coordinates)
        rows[rows[:, 4] >= 0, 4] += len(self.phases)
        parts = {
            "rows": rows,
            "spans": numbers[ints[a.SEGMENT_NUMBERS] :][: n * a.SEGMENT_WIDTH_NUMBERS].reshape(
                n, a.SEGMENT_WIDTH_NUMBERS
            ),
            "coordinates": numbers[ints[a.COORDINATE_NUMBERS] :][: ints[a.COORDINATE_COUNT]],
            "phases": ints[ints[a.PHASE_INTS] :][: ints[a.PHASE_COUNT]],
            "kinds": ints[ints[a.EVENT_INTS] :][: m * a.EVENT_WIDTH].reshape(m, a.EVENT_WIDTH),
            "amounts": numbers[ints[a.EVENT_NUMBERS] :][: m * a.EVENT_WIDTH_NUMBERS].reshape(m, a.EVENT_WIDTH_NUMBERS),
        }
        for name, part in parts.items():
            setattr(self, name, np.concatenate([getattr(self, name), part]))
        vars(self).pop("places", None)
        for slot in (a.SEGMENT_COUNT, a.COORDINATE_COUNT, a.PHASE_COUNT, a.EVENT_COUNT):
            ints[slot] = 0

    @functools.cached_property
    def places(self) -> np.ndarray:
        """Which rows of kinds and amounts are events."""
        return np.flatnonzero(self.kinds[:, 1] != a.SHARED)

    def add_event(self, event: Event) -> None:
        """An event of the start."""
        loss, places = event.loss, [self._names.index(name) for name, _ in event.shared]
        own = loss.impact, loss.truncation_kinetic, loss.truncation_strain, loss.stop_work, loss.damping
        shared = [(event.time, *np.zeros(a.LOSSES), impulse) for _, impulse in event.shared]
        kinds = [*((i, a.SHARED) for i in places), (self._names.index(event.contact), int(event.kind == "close"))]
        self.kinds = np.concatenate([self.kinds, kinds])
        self.amounts = np.concatenate([self.amounts, [*shared, (event.time, *own, event.impulse)]])
        vars(self).pop("places", None)

    # ------------------------------------------------------------------ objects

    def segments(self) -> Segments:
        """All segments so far."""
        return Segments(self)

    def events(self) -> Events:
        """All events so far."""
        return Events(self)

    def level(self, i: int) -> LoadedLevel:
        """The level of the i-th segment."""
        return self._levels[int(self.rows[i, 0])]

    def state(self, i: int) -> tuple[np.ndarray, np.ndarray]:
        """xi, xi' (n,) at the start of the i-th segment."""
        n, start = self.level(i).level.modes, self.rows[i, 3]
        return self.coordinates[start : start + n], self.coordinates[start + n : start + 2 * n]

    def standing(self, i: int) -> tuple[Phase, ...]:
        """The phases at the start of the i-th segment."""
        c, start = len(self._names), self.rows[i, 4]
        return (Phase.ARMED,) * c if start < 0 else tuple(PHASES[k] for k in self.phases[start : start + c])

    def standings(self) -> np.ndarray:
        """The phases (n, c), in numbers, at the start of every segment."""
        numbers, starts = np.zeros((len(self.rows), len(self._names)), np.int64), self.rows[:, 4]
        unsettled = starts >= 0
        numbers[unsettled] = self.phases[starts[unsettled][:, None] + np.arange(len(self._names))]
        return numbers

    def segment(self, i: int) -> Segment:
        """The i-th segment."""
        level, (start, end, armed_at) = self.level(i), self.spans[i, :3].tolist()
        drive = level.asymptotic.drive if level.driven else None
        coefficients = level.level.response.coefficients(*self.state(i), drive)
        return Segment(start, end, level, coefficients, self.standing(i), armed_at)

    def event(self, i: int) -> Event:
        """The i-th event."""
        place = int(self.places[i])
        before = int(self.places[i - 1]) + 1 if i else 0
        time, *lost, impulse = self.amounts[place].tolist()
        impact, kinetic, strain, stop_work, damping = lost
        contact, entered = self.kinds[place].tolist()
        shared = tuple((self._names[self.kinds[k, 0]], float(self.amounts[k, 6])) for k in range(before, place))
        loss, kind = Loss(impact, kinetic, strain, stop_work, damping), "close" if entered == a.CLOSE else "open"
        return Event(time, self._names[contact], kind, loss, impulse, shared)

    def batches(self) -> list[Batch]:
        """The segments by level and exponentials."""
        numbers = self.rows[:, 0]
        return [self._batch(number, np.flatnonzero(numbers == number)) for number in sorted(set(numbers.tolist()))]

    def _batch(self, number: int, places: np.ndarray) -> Batch:
        level = self._levels[number]
        response, n = level.level.response, level.level.modes
        states = self.coordinates[self.rows[places, 3][:, None] + np.arange(2 * n)]
        coefficients = states @ np.hstack([response.from_displacement, response.from_velocity]).T
        if level.driven:
            coefficients = coefficients + response.from_force @ level.asymptotic.drive
        starts, ends = self.spans[places, 0], self.spans[places, 1]
        return Batch(level, places, starts, ends, response.basis, response.shapes, coefficients)
