"""Levels, maps and signals of one model under its loads as arrays (arrays.py), packed when the loop asks for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.channel_arrays import ChannelArrays
from multiphi_exudyn.events.packing.element_arrays import describe_elements
from multiphi_exudyn.events.packing.level_parts import from_base
from multiphi_exudyn.events.packing.level_records import (
    put_base,
    put_level,
    put_powers,
    put_signal,
    put_sizes,
    put_strain,
)
from multiphi_exudyn.events.packing.level_tables import LevelTables
from multiphi_exudyn.events.packing.scratch_arrays import ScratchArrays
from multiphi_exudyn.events.transitions.defect_forms import defect_form, start_form
from multiphi_exudyn.events.transitions.exit_table import ExitTable
from multiphi_exudyn.events.transitions.exits import after, asked_alone, entered_row, exits_of
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.transition import Transition

__all__ = ["LevelArrays"]

ARRAY_BYTES = 2**29  # of a model's arrays under all loads: half of what a model may keep (level_store.py)
FEWEST_LEVELS = 8  # packed whatever they take: a run that goes to and fro between a few would pack them at every event
UNTOUCHED = np.zeros(0)  # a ring to which nothing has been written
ROOM = 1024  # segments, and events, that the loop records before they are taken, in a long run


class Held(Protocol):
    """What acts on a structure for a while, and changes the arrays of its levels."""

    def change_level(self, level: int) -> None:
        """Change a level that stands in the ints, before it is used for the first time since then."""

    def change_map(self, source: int, target: int, record: int) -> None:
        """Change the map between two levels."""

    def change_entered(self, level: int, exit_: int) -> None:
        """Change the signal that an exit's element would have in the level entered alone."""


class LevelArrays:
    """What the loop knows of ``levels``; ``loaded``: the levels themselves, by their number.

    owner: the run whose state stands in the arrays. room: for segments, and events, in a record.
    held: what changes levels and maps before they are used.
    """

    def __init__(self, levels: LoadedLevels) -> None:
        self.levels = levels
        self.owner: Callable[[], Any] | None = None
        self.held: Held | None = None
        self.room = ROOM
        self._count = 0  # of levels packed so far
        self._exits = ExitTable(levels.model.contacts)
        self._memory = np.empty(0, complex)
        self._weighed: int = 0  # size of the buffers when others were last looked at
        self.channels = ChannelArrays(levels)
        self.forget()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.levels,)  # what is unpickled begins anew

    def lent(self, piece: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The buffers, for questions between two advances of a run, which then puts its state there again.

        piece: the last one of the channels that they are about.
        """
        self.channels.reserve_until(self.buffers, piece)
        self._weigh()
        self.owner = None
        return self.buffers.all

    def memory(self, count: int) -> np.ndarray:
        """Waves (count, or more) for questions, the same ones each time."""
        if len(self._memory) < count:
            self._memory = np.empty(count, complex)
        return self._memory

    @property
    def full(self) -> bool:
        """Whether the arrays are too large; those that their model keeps beside them go first."""
        self._weigh()
        return self._weighed > ARRAY_BYTES and len(self.loaded) > FEWEST_LEVELS

    def _weigh(self) -> None:
        """Look at what others take where the arrays have grown, for levels or for questions."""
        if self.buffers.size != self._weighed:
            self._let_others_go()

    def _let_others_go(self) -> None:
        """Of all that a model keeps the least recently used goes, until there is room."""
        self._weighed = self.buffers.size
        loaded = dict.fromkeys(levels for _, levels in self.levels.model.loaded.items())  # some by two keys
        others = [(levels, arrays) for levels in loaded for arrays in levels.kept_arrays if arrays is not self]
        total = self.buffers.size + sum(arrays.buffers.size for _, arrays in others)
        for levels, arrays in others:
            if total <= ARRAY_BYTES:
                return
            total -= arrays.buffers.size
            levels.let_go(arrays)

    def forget(self) -> None:
        """Begin anew, without any level."""
        self.buffers = Buffers()
        self._weighed = 0
        self.loaded: dict[int, LoadedLevel] = {}
        self._offsets: dict[int, int] = {}  # of levels in the ints, by number
        self._levels: dict[tuple[int, ...], int] = {}  # numbers by key
        self._maps: dict[tuple[int, int], int] = {}  # records by their levels
        self._ring = 0  # where that of a chatter check begins
        self._recorded = 0, 0  # coordinates and exits for which the record has room
        self.base = 0  # where it stands as a level in the ints, once there are starts
        self._starts = 0  # for how many there is room
        describe_elements(self.buffers, self.levels.model)
        self.ints[a.ISOLATED] = self.levels.isolated
        self._tables = LevelTables(self.buffers)  # what the loop finds, and does not ask for
        self.channels.describe(self.buffers)
        self.scratch = ScratchArrays(self.buffers, self.channels.terms)

    @property
    def ints(self) -> np.ndarray:
        """The ints."""
        return self.buffers.ints

    @property
    def numbers(self) -> np.ndarray:
        """The numbers."""
        return self.buffers.numbers

    def set_chatter(self, window: int, decisions: int, ring: np.ndarray) -> None:
        """The chatter check of a run: the size of its window, the decisions so far, and its ring as it stands."""
        ints = self.buffers.ints
        if not self._ring:
            self._ring = ints[a.RING] = self.buffers.take("numbers", 2 * (window + 1))
        ints[a.WINDOW], ints[a.DECISIONS] = window, decisions
        if len(ring):
            self.buffers.numbers[self._ring : self._ring + len(ring)] = ring

    @property
    def chatter(self) -> tuple[int, np.ndarray]:
        """The decisions so far, and what stands in the ring."""
        decisions = int(self.buffers.ints[a.DECISIONS])
        if not decisions:
            return 0, UNTOUCHED
        count = 2 * min(decisions, int(self.buffers.ints[a.WINDOW]) + 1)
        return decisions, self.buffers.numbers[self._ring : self._ring + count].copy()

    @property
    def outgrown(self) -> bool:
        """Whether a level has come that is larger than the record has room for."""
        return self._recorded[0] < self.scratch.coordinates or self._recorded[1] < self.scratch.exits

    def begin_record(self) -> None:
        """An empty record to write to."""
        if self.outgrown:
            n, exits = self._recorded = self.scratch.coordinates, self.scratch.exits
            room, events = self.room, max(self.room, self.scratch.changes)
            wanted = {
                "ints": {
                    a.SEGMENT_INTS: a.SEGMENT_WIDTH * room,
                    a.PHASE_INTS: exits * room,
                    a.LEFT_OUT: room,
                    a.EVENT_INTS: a.EVENT_WIDTH * events,
                    a.IMPACT_INTS: events,
                },
                "numbers": {
                    a.INSTANTS: room + 1,
                    a.COORDINATE_NUMBERS: (2 * n + a.DRIVEN_WIDTH + 1) * room,
                    a.EVENT_NUMBERS: a.EVENT_WIDTH_NUMBERS * events,
                    a.IMPACT_NUMBERS: a.IMPACT_WIDTH * events,
                },
            }
            for name, sizes in wanted.items():
                place = self.buffers.take(name, sum(sizes.values()))  # at once: a buffer that grows is copied
                for slot, count in sizes.items():
                    self.ints[slot] = place
                    place += count
            self.ints[a.SEGMENT_ROOM], self.ints[a.EVENT_ROOM] = room, events
            self._let_others_go()
        ints = self.buffers.ints
        ints[a.SEGMENT_COUNT] = ints[a.COORDINATE_COUNT] = ints[a.PHASE_COUNT] = ints[a.EVENT_COUNT] = 0
        ints[a.LEFT_OUT_COUNT] = ints[a.IMPACT_COUNT] = 0

    def level(self, states: Sequence[int]) -> int:
        """Where the level of elements in these states stands in the ints, packed if it was not."""
        key = tuple(states)
        if key not in self._levels:
            self._add(self.levels.level(key))
        record = self._offsets[self._levels[key]]
        if record not in self._tables.levels:
            if self.held is not None:
                self.held.change_level(record)
            self._tables.add_level(record)
        return record

    def hide(self) -> None:
        """Let the loop ask once more for every level and map, which are changed before they are used again."""
        self._tables.clear()

    def supply(self) -> None:
        """Pack what the loop needs."""
        key = self.ints[self.ints[a.NEEDED_KEY] :][: self.ints[a.ELEMENTS]].tolist()
        source = int(self.ints[a.NEEDED_FROM])
        if self.ints[a.NEEDED] == a.NEED_LEVEL:
            self.level(key)
        elif self.ints[a.NEEDED] == a.NEED_MAP:
            self._add_map(source, self.level(key))
        elif self.ints[a.NEEDED] == a.NEED_ENTERED:
            self._add_entered(source, key[0])
        elif self.ints[a.NEEDED] == a.NEED_PIECES:
            self.channels.reserve(self.buffers)
        elif self.ints[a.NEEDED] == a.NEED_POWERS:
            self.add_powers(source)
        elif self.ints[a.NEEDED] == a.NEED_SIZES:
            self._add_sizes(source)
        else:
            self._supply_room()

    def _supply_room(self) -> None:
        """Room for the powers that a response to a term has taken."""
        self.scratch.reserve_powers(max(len(level.response.basis.rates) for level in self.loaded.values()))

    def reserve_starts(self, count: int) -> None:
        """Room for so many starts, and the base in which they are; where there was less, none stands there any more."""
        if not self.base:
            self._add_base()
        if count > self._starts:
            self._starts = count
            held = int(self.ints[a.CHANNELS] - self.ints[a.PRESCRIBED])
            self.ints[a.STARTS] = self.buffers.take("numbers", count * (2 * int(self.ints[a.COORDINATES]) + held + 1))
            self.ints[a.START_STATES] = self.buffers.take("ints", count * int(self.ints[a.ELEMENTS]))

    def _add_base(self) -> None:
        """Pack the base as a level, with memory for what happens there."""
        base, n = self.levels.model.base, int(self.ints[a.COORDINATES] + self.ints[a.CHANNELS])
        for state in (a.GIVEN, a.SLOWED):
            self.scratch.reserve_state(state, n, int(self.ints[a.ELEMENTS]))
        self.base = put_base(self.buffers, base, self.levels.excitation)
        self.ints[a.GIVEN + a.LEVEL] = self.base

    def _add(self, level: LoadedLevel) -> None:
        modal, number = level.modal, self._count
        n, free = modal.modes + int(self.ints[a.CHANNELS]), len(level.response.basis.rates)
        kept = self._exits.of(level.states)
        self.scratch.reserve(n, free, int(np.count_nonzero(kept)))
        record = put_level(self.buffers, level, number, self._exits, kept)
        self._levels[level.states], self._offsets[number], self.loaded[number] = number, record, level
        self._count += 1

    def add_powers(self, level: int) -> None:
        """Pack the power of damping, of what varies and of friction in a level that stands in the ints."""
        if not self.ints[level + a.DISSIPATION]:
            put_powers(self.buffers, level, self.loaded[int(self.ints[level + a.NUMBER])], self.channels.carriers)

    def add_strain(self, states: tuple[int, ...]) -> None:
        """Pack the strain energy of a level, if it stands in the ints, for runs that end in it."""
        record = self._offsets[self._levels[states]] if states in self._levels else 0
        if record and not self.ints[record + a.STRAIN_FORM]:
            put_strain(self.buffers, record, self.loaded[self._levels[states]])

    def _add_sizes(self, level: int) -> None:
        """Pack what |y| and the work of static loads are read from in a level that stands in the ints."""
        put_sizes(self.buffers, level, self.loaded[int(self.ints[level + a.NUMBER])])

    def _add_entered(self, source: int, exit_number: int) -> None:
        """The signal that an exit's element would have in the level entered alone."""
        level = self.loaded[int(self.ints[source + a.NUMBER])]
        element, exit_ = exits_of(level)[exit_number]
        entered = self.level(after(level, element, asked_alone(exit_)))  # may make the buffers anew
        target = self.loaded[int(self.ints[entered + a.NUMBER])]
        row = entered_row(self.levels.transition(level, target), element)
        signal = self.buffers.put("ints", put_signal(self.buffers.put, level, row))
        record = int(self.ints[source + a.EXITS]) + a.EXIT_INTS * exit_number
        self.ints[record + a.ENTERED] = signal
        if self.held is not None:
            self.held.change_entered(source, record)

    def _add_map(self, source: int, target: int) -> None:
        if (source, target) not in self._maps:
            self._maps[source, target] = self._map(source, target)
        record = self._maps[source, target]
        if self.held is not None:
            self.held.change_map(source, target, record)
        self._tables.add_map(source, target, record)

    def _map(self, source: int, target: int) -> int:
        """The record of the map between two levels."""
        put, level = self.buffers.put, self.loaded[int(self.ints[target + a.NUMBER])]
        sizes, terms, way = np.zeros(0), None, None
        if source == self.base:
            matrix, offset, rate_matrix, sizes = from_base(level)
        else:
            way = self.levels.transition(self.loaded[int(self.ints[source + a.NUMBER])], level)
            matrix, offset, rate_matrix, terms = way.matrix, way.offset, way.velocity_matrix, way.terms
        at = put("numbers", matrix)
        rates = at if rate_matrix is matrix or np.array_equal(rate_matrix, matrix) else put("numbers", rate_matrix)
        known = -1 if terms is None else put("numbers", terms)
        defect = self._defect(way, level) if self.ints[a.JUDGED] else -1
        return put("ints", [at, put("numbers", offset), rates, -1, put("numbers", sizes), known, defect])

    def _defect(self, way: Transition | None, level: LoadedLevel) -> int:
        """Where stands what a defect is read from on the way from a level, or from the base, into a level, or -1."""
        if way is None:
            form = start_form(level)
            return -1 if form is None else self.buffers.put("numbers", form)
        parts = defect_form(way, ())
        return self.buffers.put("numbers", np.concatenate([parts.displaced, parts.moving], axis=None))
