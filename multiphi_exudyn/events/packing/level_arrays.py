"""Levels, maps and signals of one model under its loads as arrays (arrays.py), packed when the loop needs them."""

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
    put_struck,
)
from multiphi_exudyn.events.packing.level_tables import LevelTables
from multiphi_exudyn.events.packing.scratch_arrays import ScratchArrays
from multiphi_exudyn.events.transitions.defect_forms import defect_form, start_form
from multiphi_exudyn.events.transitions.exit_table import ExitTable
from multiphi_exudyn.events.transitions.exits import after, entered_row, entering_exit, exits_of
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.mathematics.blas_threads import one_blas_thread

__all__ = ["LevelArrays"]

ARRAY_BYTES = 2**29  # of a model's arrays under all loads: half of what a model may keep (level_store.py)
FEWEST_LEVELS = 8  # are kept whatever their size: a run that alternates between a few would pack them at every event
NO_NUMBERS = np.zeros(0)
ROOM = 1024  # segments, and events, that the loop records before the run copies them


class LevelChanges(Protocol):
    """Temporary action on a structure that changes the arrays of its levels."""

    def change_level(self, level: int) -> None:
        """Change a packed level, before its first use under this action."""

    def change_map(self, source: int, target: int, record: int) -> None:
        """Change the map between two levels."""

    def change_entered(self, level: int, exit_: int) -> None:
        """Change the signal that an exit's element would have in the level entered alone."""


class LevelArrays:
    """Arrays of ``levels`` for the loop; ``loaded``: the levels that are packed, by their number.

    owner: the run whose state is in the arrays. room: number of segments, and of events, in a record. held: the action
    that changes levels and maps before they are used.
    """

    def __init__(self, levels: LoadedLevels) -> None:
        self.levels = levels
        self.owner: Callable[[], Any] | None = None
        self.held: LevelChanges | None = None
        self.room = ROOM
        self._count = 0  # of levels packed so far
        self._exits = ExitTable(levels.model.contacts)
        self._memory = np.empty(0, complex)
        self._checked_size: int = 0  # of the buffers, when memory was last checked
        self.channels = ChannelArrays(levels)
        self.forget()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.levels,)  # a copy starts without levels

    def borrow_buffers(self, piece: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the buffers for evaluations between two advances of a run, which then writes its state again.

        piece: the last piece of the channels that they need.
        """
        self.channels.reserve_until(self.buffers, piece)
        self._check_size()
        self.owner = None
        return self.buffers.all

    def memory(self, count: int) -> np.ndarray:
        """Return an array of waves (count, or more) for evaluations, the same one each time."""
        if len(self._memory) < count:
            self._memory = np.empty(count, complex)
        return self._memory

    @property
    def full(self) -> bool:
        """Whether the arrays are too large; other arrays that the model keeps are dropped first."""
        self._check_size()
        return self._checked_size > ARRAY_BYTES and len(self.loaded) > FEWEST_LEVELS

    def _check_size(self) -> None:
        """Drop others' arrays if these have grown and memory is short."""
        if self.buffers.size != self._checked_size:
            self._evict_others()

    def _evict_others(self) -> None:
        """Drop the least recently used arrays that the model keeps, until there is room."""
        self._checked_size = self.buffers.size
        loaded = dict.fromkeys(levels for _, levels in self.levels.model.loaded.items())  # some are kept by two keys
        others = [(levels, arrays) for levels in loaded for arrays in levels.kept_arrays if arrays is not self]
        total = self.buffers.size + sum(arrays.buffers.size for _, arrays in others)
        for levels, arrays in others:
            if total <= ARRAY_BYTES:
                return
            total -= arrays.buffers.size
            levels.let_go(arrays)

    def forget(self) -> None:
        """Start again without any level."""
        self.buffers = Buffers()
        self._checked_size = 0
        self.loaded: dict[int, LoadedLevel] = {}
        self._offsets: dict[int, int] = {}  # records of levels, by number
        self._levels: dict[tuple[int, ...], int] = {}  # numbers by key
        self._maps: dict[tuple[int, int], int] = {}  # records by their levels
        self._ring = 0  # offset of the ring of the chatter check
        self._recorded = 0, 0  # coordinates and exits for which the record has room
        self.base = 0  # its record as a level, once there are starts
        self._starts = 0  # number of starts for which there is memory
        describe_elements(self.buffers, self.levels.model)
        self.ints[a.ISOLATED] = self.levels.isolated
        self._tables = LevelTables(self.buffers)  # of all levels and maps that the loop finds
        self.channels.describe(self.buffers)
        self.scratch = ScratchArrays(self.buffers, self.channels.terms)
        self.ints[a.INSTANTS] = self.buffers.take("numbers", a.COPIED)  # of a run that fails before its first level

    @property
    def ints(self) -> np.ndarray:
        """The ints."""
        return self.buffers.ints

    @property
    def numbers(self) -> np.ndarray:
        """The numbers."""
        return self.buffers.numbers

    def set_chatter(self, window: int, decisions: int, ring: np.ndarray) -> None:
        """Set the chatter check of a run: the size of its window, the decisions so far, and its ring."""
        ints = self.buffers.ints
        if not self._ring:
            self._ring = ints[a.RING] = self.buffers.take("numbers", 2 * (window + 1))
        ints[a.WINDOW], ints[a.DECISIONS] = window, decisions
        if len(ring):
            self.buffers.numbers[self._ring : self._ring + len(ring)] = ring

    @property
    def chatter(self) -> tuple[int, np.ndarray]:
        """The decisions so far, and the contents of the ring."""
        decisions = int(self.buffers.ints[a.DECISIONS])
        if not decisions:
            return 0, NO_NUMBERS
        count = 2 * min(decisions, int(self.buffers.ints[a.WINDOW]) + 1)
        return decisions, self.buffers.numbers[self._ring : self._ring + count].copy()

    @property
    def outgrown(self) -> bool:
        """Whether a level has been packed that is larger than the record allows."""
        return self._recorded[0] < self.scratch.coordinates or self._recorded[1] < self.scratch.exits

    def begin_record(self) -> None:
        """Begin an empty record."""
        if self.outgrown:
            n, exits = self._recorded = self.scratch.coordinates, self.scratch.exits
            room, events = self.room, max(self.room, self.scratch.changes)
            sizes_by_buffer = {
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
            beside = {"ints": room + exits, "numbers": a.COPIED + 2 * n}  # levels visited, and the state, of a copy
            for name, sizes in sizes_by_buffer.items():
                place = self.buffers.take(name, sum(sizes.values()) + beside[name])  # at once: it may copy the buffer
                for slot, count in sizes.items():
                    self.ints[slot] = place
                    place += count
            self.ints[a.SEGMENT_ROOM], self.ints[a.EVENT_ROOM] = room, events
            self._evict_others()
        self.buffers.ints[a.RECORD_COUNTS : a.RECORD_COUNTS + a.COUNTED] = 0

    def level(self, states: Sequence[int]) -> int:
        """Return the record of the level of elements in these states, packing it if needed."""
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
        """Empty the tables, so that every level and map is changed before it is used again."""
        self._tables.clear()

    @one_blas_thread()
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
            put_sizes(self.buffers, source, self._loaded_in(source))
        elif self.ints[a.NEEDED] == a.NEED_STRUCK:
            put_struck(self.buffers, source, self._loaded_in(source))
        else:
            self._supply_room()

    def _loaded_in(self, record: int) -> LoadedLevel:
        """Return the level that a record is of."""
        return self.loaded[int(self.ints[record + a.NUMBER])]

    def _supply_room(self) -> None:
        """Enlarge the memory to the powers of time that a response to a term has."""
        self.scratch.reserve_powers(max(len(level.response.basis.rates) for level in self.loaded.values()))

    def reserve_starts(self, count: int) -> None:
        """Reserve memory for so many starts, and pack the base; if it must grow, earlier starts are lost."""
        if not self.base:
            self._add_base()
        if count > self._starts:
            self._starts = count
            held = int(self.ints[a.CHANNELS] - self.ints[a.PRESCRIBED])
            self.ints[a.STARTS] = self.buffers.take("numbers", count * (2 * int(self.ints[a.COORDINATES]) + held + 1))
            self.ints[a.START_STATES] = self.buffers.take("ints", count * int(self.ints[a.ELEMENTS]))

    def _add_base(self) -> None:
        """Pack the base as a level, with memory for the states in it."""
        base, n = self.levels.model.base, int(self.ints[a.COORDINATES] + self.ints[a.CHANNELS])
        for state in (a.GIVEN, a.SLOWED):
            self.scratch.reserve_state(state, n, int(self.ints[a.ELEMENTS]))
        self.base = put_base(self.buffers, base, self.levels.excitation)
        self.ints[a.GIVEN + a.LEVEL] = self.base

    def _add(self, level: LoadedLevel) -> None:
        modal, number = level.modal, self._count
        n, free = modal.modes + int(self.ints[a.CHANNELS]), len(level.response.basis.rates)
        kept = self._exits.count(level.states)
        self.scratch.reserve(n, free, kept)
        record = put_level(self.buffers, level, number, self._exits, kept)
        self._levels[level.states], self._offsets[number], self.loaded[number] = number, record, level
        self._count += 1

    def add_powers(self, level: int) -> None:
        """Pack the powers of damping, of varying loads and of friction in a level that is packed."""
        if not self.ints[level + a.DISSIPATION]:
            put_powers(self.buffers, level, self._loaded_in(level), self.channels.carriers)

    def add_strain(self, states: tuple[int, ...]) -> None:
        """Pack the strain energy of a level, if the level is packed, for runs that end in it."""
        record = self._offsets[self._levels[states]] if states in self._levels else 0
        if record and not self.ints[record + a.STRAIN_FORM]:
            put_strain(self.buffers, record, self.loaded[self._levels[states]])

    def _add_entered(self, source: int, exit_number: int) -> None:
        """Pack the signal that an exit's element would have in the level entered alone."""
        level = self._loaded_in(source)
        element, exit_ = exits_of(level)[exit_number]
        entered = self.level(after(level, element, entering_exit(exit_)))  # may replace the buffers
        target = self._loaded_in(entered)
        row = entered_row(self.levels.transition(level, target), element)
        signal = put_signal(self.buffers, source, row)
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
        """Pack the map between two levels and return its record."""
        level, sizes, terms, transition = self._loaded_in(target), NO_NUMBERS, None, None
        if source == self.base:
            matrix, offset, rate_matrix, sizes = from_base(level)
        else:
            transition = self.levels.transition(self._loaded_in(source), level)
            matrix, offset, rate_matrix = transition.matrix, transition.offset, transition.velocity_matrix
            terms = transition.terms
        is_one_map = rate_matrix is matrix or np.array_equal(rate_matrix, matrix)
        defects = self._defects(transition, level) if self.ints[a.JUDGED] else None
        parts = matrix, offset, None if is_one_map else rate_matrix, sizes, terms, defects
        put = self.buffers.put
        places = (-1 if part is None else put("numbers", part) for part in parts)
        matrix_at, offset_at, rate_at, *further = places
        return put("ints", [matrix_at, offset_at, matrix_at if is_one_map else rate_at, -1, *further])

    def _defects(self, transition: Transition | None, level: LoadedLevel) -> np.ndarray | None:
        """Return the form of the defect of a transition, or of a start if that is None; None if there is no form."""
        return start_form(level) if transition is None else defect_form(transition, ()).factors
