"""Levels, maps and signals of one model under its loads as arrays (arrays.py), packed when the loop asks for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.channel_arrays import ChannelArrays
from multiphi_exudyn.events.decision import ROUNDS
from multiphi_exudyn.events.exits import after, entered_row, exits_of, signal_row
from multiphi_exudyn.events.level_parts import base_parts, from_base, level_parts, powers
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.loaded_levels import LoadedLevels
from multiphi_exudyn.events.maps import level_hash, map_hash
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.events.state_arrays import measure
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.mathematics import basis_arrays, response_arrays, zero_crossing
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.free_response import ModalResponse
from multiphi_exudyn.mathematics.least_distance import INDEPENDENT
from multiphi_exudyn.mathematics.least_distance_arrays import least_distance_ints, least_distance_numbers
from multiphi_exudyn.mechanics.element import Exit, Share, friction_spring

__all__ = ["LevelArrays"]

ARRAY_BYTES = 2**29  # of a model's arrays under one load: half of what a model may keep (model.py)
FEWEST_LEVELS = 8  # packed whatever they take: a run that goes to and fro between a few would pack them at every event
ROOM = 1024  # segments, and events, that the loop records before they are taken, in a long run
POWERS = 96  # of a response to one term: where a carrier meets a pole it takes some 40
SLOTS = 64  # of a table at first: twice as many as it holds, or more
STATES_OF_A_RUN = range(a.CURRENT, a.AFTER + 1, a.STATE_INTS)

Measure = Callable[[np.ndarray, np.ndarray, int], None]


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
        self.channels = ChannelArrays(levels)
        self.forget()

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.levels,)  # what is unpickled begins anew

    def lent(self, piece: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The buffers, for questions between two advances of a run, which then puts its state there again.

        piece: the last one of the channels that they are about.
        """
        self.channels.reserve_until(self.buffers, piece)
        self.owner = None
        return self.buffers.all

    @property
    def full(self) -> bool:
        """Whether the arrays have become too large."""
        return self.buffers.size > ARRAY_BYTES and len(self.loaded) > FEWEST_LEVELS

    def forget(self) -> None:
        """Begin anew, without any level."""
        self.buffers = Buffers()
        self.loaded: dict[int, LoadedLevel] = {}
        self._offsets: dict[int, int] = {}  # of levels in the ints, by number
        self._levels: dict[tuple[int, ...], int] = {}  # numbers by key
        self._maps: dict[tuple[int, int], int] = {}  # records by their levels
        self._shown: set[int] = set()  # levels and maps that the loop finds, and does not ask for
        self._most = 0, 0, 0  # coordinates, exponentials and exits for which there is scratch memory
        self._ring: int | None = None
        self._recorded = 0, 0  # coordinates and exits for which the record has room
        self._base = 0  # where the base stands among the levels, in the ints
        self._powers = POWERS  # of a response to one term, for which there is room
        self._describe_elements()
        self.channels.describe(self.buffers)
        self.ints[a.FORCED_ROOM] = self._powers

    @property
    def ints(self) -> np.ndarray:
        """The ints."""
        return self.buffers.ints

    @property
    def numbers(self) -> np.ndarray:
        """The numbers."""
        return self.buffers.numbers

    def ring(self, count: int) -> int:
        """Where the ring of a chatter check begins, so many numbers."""
        if self._ring is None:
            self._ring = self.ints[a.RING] = self.buffers.take("numbers", count)
        return self._ring

    def set_start(self, displacement: np.ndarray, velocity: np.ndarray, key: Sequence[int], held: np.ndarray) -> None:
        """The start of a run: y, y' (m,), the states of elements, those contacts closed that touch or penetrate.

        held: places (h,) that links hold.
        """
        self._base = self._base or self._add_base()
        m, q = len(displacement), int(self.ints[a.PRESCRIBED])
        states = int(self.ints[self._base + a.STATES])
        self.ints[states : states + len(key)] = key
        self.ints[a.GIVEN + a.LEVEL], self.ints[a.STARTING] = self._base, a.FRESH
        drive = self.numbers[self.ints[a.DRIVE] :][: 2 * q].reshape(2, q)
        for part, *values in ((a.PLACE, displacement, drive[0], held), (a.SPEED, velocity, drive[1], 0 * held)):
            start = int(self.ints[a.GIVEN + part])
            self.numbers[start : start + m + q + len(held)] = np.concatenate(values)

    def set_state(
        self, level: int, place: np.ndarray, speed: np.ndarray, phases: Sequence[int], measured: Measure = measure
    ) -> None:
        """The current state: xi, xi' (n,) in a level, the phases of its exits; measured: ``measure``, or compiled."""
        n, state = len(place), a.CURRENT
        self.ints[state + a.LEVEL] = level
        for part, values in ((a.PLACE, place), (a.SPEED, speed)):
            start = int(self.ints[state + part])
            self.numbers[start : start + n] = values
        start = int(self.ints[state + a.PHASES])
        self.ints[start : start + len(phases)] = phases
        self.ints[state + a.SETTLED] = int(not any(phases))
        self.ints[a.STARTING] = 0
        measured(self.ints, self.numbers, state)

    @property
    def outgrown(self) -> bool:
        """Whether a level has come that is larger than the record has room for."""
        n, _, exits = self._most
        return self._recorded[0] < n or self._recorded[1] < exits

    def begin_record(self) -> None:
        """An empty record to write to."""
        n, _, exits = self._most
        room, events = self.room, max(self.room, self._changes)
        if self.outgrown:
            wanted = {
                a.SEGMENT_INTS: ("ints", a.SEGMENT_WIDTH * room),
                a.SEGMENT_NUMBERS: ("numbers", a.SEGMENT_WIDTH_NUMBERS * room),
                a.COORDINATE_NUMBERS: ("numbers", 2 * n * room),
                a.PHASE_INTS: ("ints", exits * room),
                a.EVENT_INTS: ("ints", a.EVENT_WIDTH * events),
                a.EVENT_NUMBERS: ("numbers", a.EVENT_WIDTH_NUMBERS * events),
            }
            for slot, (name, count) in wanted.items():
                self.ints[slot] = self.buffers.take(name, count)
        self._recorded = n, exits
        self.ints[a.SEGMENT_ROOM], self.ints[a.EVENT_ROOM] = room, events
        for slot in (a.SEGMENT_COUNT, a.COORDINATE_COUNT, a.PHASE_COUNT, a.EVENT_COUNT):
            self.ints[slot] = 0

    @property
    def _changes(self) -> int:
        """Changes at one instant for which there is room: more are an endless exchange."""
        return ROUNDS * (3 * len(self.levels.model.contacts) + 1)

    def level(self, states: Sequence[int]) -> int:
        """Where the level of elements in these states stands in the ints, packed if it was not."""
        key = tuple(states)
        if key not in self._levels:
            self._add(self.levels.level(key))
        record = self._offsets[self._levels[key]]
        if record not in self._shown:
            self._show_level(record)
        return record

    def hide(self) -> None:
        """Let the loop ask once more for every level and map, which are changed before they are used again."""
        self._shown.clear()
        for table, slots, width in ((a.LEVELS, a.LEVEL_SLOTS, 1), (a.MAPS, a.MAP_SLOTS, a.MAP_ENTRY)):
            start = self.ints[table]
            self.ints[start : start + width * self.ints[slots]] = 0

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
        else:
            self._supply_room()

    def _supply_room(self) -> None:
        """Room for the powers that a response to a term has taken."""
        self._powers = self.ints[a.FORCED_ROOM] = 2 * int(self.ints[a.FORCED_WANTED])
        self.ints[a.FORCED_WANTED] = 0
        n, _, exits = self._most
        self._reserve(n, max(self._exponentials(level.modal.response) for level in self.loaded.values()), exits)

    # ------------------------------------------------------------------ elements and scratch memory

    def _describe_elements(self) -> None:
        """The run record, and what is known of the elements."""
        model, put, take = self.levels.model, self.buffers.put, self.buffers.take
        take("ints", a.RUN_INTS)
        take("numbers", a.RUN_NUMBERS)
        base, c = model.base, len(model.contacts)
        viscous = base.dampings > 0
        kinds = np.where(np.isinf(base.stiffnesses), a.RIGID, np.where(viscous, a.VISCOUS, a.COMPLIANT))[:c]
        kinds[[i for i in model.held if i < c]] = a.SLIDING
        chains = np.full(c, -1)
        for number, chain in enumerate(model.chains):
            chains[list(chain)] = number
        lengths = np.linalg.norm(base.directions, axis=0)
        units = base.directions / np.where(lengths > 0, lengths, 1.0)
        given = {
            a.ELEMENTS: c,
            a.COORDINATES: base.modes.count,
            a.WHOLE: int(model.whole),
            a.KINDS: put("ints", kinds),
            a.CHAINS: put("ints", chains),
            a.CHAIN_COUNT: len(model.chains),
            a.STIFFNESSES: put("numbers", np.where(np.isinf(base.stiffnesses), 0.0, base.stiffnesses)[:c]),
            a.DIRECTIONS: put("numbers", units[:, :c].T),
            **self._frictions(),
        }
        for slot, value in given.items():
            self.ints[slot] = value
        self.numbers[a.INDEPENDENCE] = INDEPENDENT
        self._rehash(SLOTS, SLOTS)
        self._reserve_sets(c, int(np.sum(kinds == a.RIGID)))

    def _frictions(self) -> dict[int, int]:
        """What the elements with a held link do with its spring."""
        model, put = self.levels.model, self.buffers.put
        found = np.array([friction_spring(element) for element in model.contacts]).reshape(-1, 4)
        places = [links[int(row[1])] for links, row in zip(model.link_places, found, strict=True)]
        return {
            a.STICKS: put("ints", found[:, 0]),
            a.HELD_LINKS: put("ints", places),
            a.SPRINGS: put("numbers", found[:, 2]),
            a.DROPS: put("numbers", found[:, 3]),
        }

    def _reserve_sets(self, c: int, rigid: int) -> None:
        """Scratch memory that depends on the number of elements alone."""
        take, m = self.buffers.take, int(self.ints[a.COORDINATES])
        struck, changes = max(2 * rigid, 1), self._changes
        sizes = {
            "ints": dict.fromkeys((*range(a.ASKING, a.RESTING_LIST + 1), a.NEEDED_KEY, a.CAUSED_BY), 2 * c + 1)
            | {a.CHAIN_MARKS: len(self.levels.model.chains), a.LEAST_INTS: least_distance_ints(struck)}
            | {a.CHANGES: a.CHANGE_WIDTH * changes},
            "numbers": dict.fromkeys((a.IMPULSES, a.FURTHER, a.LEAST, a.LEAST_SIZES, a.RESTING_SIZES), struck)
            | {a.PUSHED: c, a.JOIN_NUMBERS: m * max(1, min(rigid, m)), a.CHANGE_IMPULSES: changes}
            | {a.FOUND: zero_crossing.RESULT},
        }
        for name, slots in sizes.items():
            for slot, count in slots.items():
                self.ints[slot] = take(name, count)
        self.ints[a.CHANGE_ROOM] = changes

    def _reserve(self, n: int, p: int, exits: int) -> None:
        """Scratch memory for levels of n coordinates, p exponentials and so many exits."""
        n, p, exits = map(max, (n, p, exits), self._most)
        if (n, p, exits) == self._most:
            return
        self._most = n, p, exits
        for name, slots in self._scratch(n, p, max(2 * exits, 1)).items():
            for slot, count in slots.items():
                self.ints[slot] = self.buffers.take(name, count)
        self._reserve_flow(p)
        for state in STATES_OF_A_RUN:
            old = self.ints[state : state + a.STATE_INTS].copy()
            for part in range(a.PLACE, a.SWING + 1):
                self.ints[state + part] = self.buffers.take("numbers", n)
            self.ints[state + a.PHASES] = self.buffers.take("ints", exits)
            if old[a.LEVEL]:
                self._carry_over(state, old)

    def _reserve_flow(self, p: int) -> None:
        """A record for the basis of a motion with channels, of p exponentials."""
        take, record = self.buffers.take, self.buffers.take("ints", basis_arrays.BASIS)
        given = {basis_arrays.POWERS: take("ints", p), basis_arrays.RATES: take("waves", p)}
        given[basis_arrays.SCALES] = take("numbers", 3)
        for slot, value in given.items():
            self.ints[record + slot] = value
        self.ints[a.FLOW_RECORD] = record

    def _scratch(self, n: int, p: int, signals: int) -> dict[str, dict[int, int]]:
        """How much of each buffer every part of the scratch memory takes, that depends on the levels.

        Impacts happen in all modes too, at the start.
        """
        kinds = self.ints[self.ints[a.KINDS] :][: self.ints[a.ELEMENTS]]
        rigid, wide = int(np.sum(kinds == a.RIGID)), int(self.ints[a.COORDINATES] + self.ints[a.CHANNELS])
        struck, wide = max(2 * rigid, 1), max(wide, n) if rigid else n
        q, terms = int(self.ints[a.PRESCRIBED]), self.channels.terms
        room = max(self._powers, terms) if self.ints[a.CHANNELS] else 0
        return {
            "numbers": dict.fromkeys((a.ACCELERATION, a.ACCELERATION_TERMS, a.RELEASED_TERMS), n)
            | {a.ROWS: struck * wide, a.LEAST_NUMBERS: least_distance_numbers(struck, wide), a.CHANGE: wide}
            | {a.FLOW_TERMS: p, a.SET_SIZES: 2 * n, a.FLOW_STATE: 4 * n}
            | {a.CONSTANTS: signals, a.NOISES: signals}
            | {a.SEARCH_NUMBERS: max(zero_crossing.scratch_numbers(p, signals), 2 * p)},
            "ints": {a.WAITING: 2 * signals, a.FALLEN: signals},
            "waves": {a.FLOW_WAVES: p, a.SIGNALS: signals * p, a.WORK_WAVES: 2 * p}
            | {a.SEARCH_WAVES: zero_crossing.scratch_waves(p, signals)}
            | {a.FORCES: terms * n, a.FORCED: room * n, a.FORCED_WORK: (2 + p) * room, a.FLOW_FORCED: q * room * n},
        }

    def _carry_over(self, state: int, old: np.ndarray) -> None:
        """A state from the scratch memory that was too small."""
        level = int(old[a.LEVEL])
        n = int(self.ints[level + a.MODES] + self.ints[a.CHANNELS])
        for part in range(a.PLACE, a.SWING + 1):
            start, end = int(old[part]), int(self.ints[state + part])
            self.numbers[end : end + n] = self.numbers[start : start + n]
        start, end, exits = int(old[a.PHASES]), int(self.ints[state + a.PHASES]), self.ints[level + a.EXIT_COUNT]
        self.ints[end : end + exits] = self.ints[start : start + exits]

    # ------------------------------------------------------------------ levels

    def _add_base(self) -> int:
        """The base as a level in which all contacts are open, where runs start, and memory for what happens there."""
        base, put, take = self.levels.model.base, self.buffers.put, self.buffers.take
        omega, parts = base.modes.omega, base_parts(base, self.levels.excitation)
        m, record = len(omega), self.buffers.take("ints", a.LEVEL_INTS)
        periods = np.divide(1.0, omega, out=np.zeros(m), where=omega > 0)
        given = {
            a.MODES: m,
            a.STATES: take("ints", int(self.ints[a.ELEMENTS])),
            a.FREQUENCIES: put("numbers", omega),
            a.PERIODS: put("numbers", periods),
            a.CARRIED: -1,
            a.MOBILITY: -1,
            **{slot: put("numbers", values) for slot, values in parts.items()},
        }
        given[a.SPEEDS] = given[a.GAPS]
        for slot, value in given.items():
            self.ints[record + slot] = value
        for state in (a.GIVEN, a.SLOWED):
            for part in range(a.PLACE, a.SWING + 1):
                self.ints[state + part] = take("numbers", m + int(self.ints[a.CHANNELS]))
            self.ints[state + a.PHASES] = take("ints", int(self.ints[a.ELEMENTS]))
        return record

    def _add(self, level: LoadedLevel) -> None:
        own, put, q = level.level, self.buffers.put, int(self.ints[a.CHANNELS])
        modal, exits = level.modal, exits_of(level)
        parts, r = level_parts(level), modal.modes
        self._reserve(r + q, self._exponentials(modal.response), len(exits))
        record = self.buffers.take("ints", a.LEVEL_INTS)
        firsts = np.searchsorted([i for i, _ in exits], range(len(level.states) + 1))
        ends = [k for i in self.levels.ends(level.states) for k in range(firsts[i], firsts[i + 1])]
        omega = modal.omega
        periods = np.divide(1.0, omega, out=np.zeros(r), where=omega > 0)
        given = {
            a.NUMBER: self._count,
            a.MODES: r,
            a.STATES: put("ints", level.states),
            a.RESPONSE: self._response(modal),
            a.FORCE: put("numbers", level.asymptotic.drive) if level.driven else -1,
            a.EXITS: self._exits(level, exits),
            a.EXIT_COUNT: len(exits),
            a.FIRST_EXITS: put("ints", firsts),
            a.ENDS: put("ints", ends),
            a.END_COUNT: len(ends),
            a.FREQUENCIES: put("numbers", omega),
            a.PERIODS: put("numbers", periods),
            a.HIGHEST_FREQUENCY: put("numbers", [own.highest_frequency]),
            a.CARRIED: -1,
            a.MOBILITY: -1,
            a.FOLLOW_COUNT: len(parts[a.FOLLOWS]),
            **{slot: put("numbers", values) for slot, values in parts.items()},
        }
        given.setdefault(a.SPEEDS, given[a.GAPS])
        for slot, value in given.items():
            self.ints[record + slot] = value
        self._levels[level.states] = self._count
        self._offsets[self._count] = record
        self.loaded[self._count] = level
        self._count += 1

    def _show_level(self, record: int) -> None:
        if self.held is not None:
            self.held.change_level(record)
        self._shown.add(record)
        self._enter_level(record)

    def add_powers(self, level: int) -> None:
        """Pack the power of damping, of what varies and of friction in a level that stands in the ints."""
        if not self.ints[level + a.DISSIPATION]:
            damping, varying, rubbing, pairs = powers(self.loaded[int(self.ints[level + a.NUMBER])])
            self.ints[level + a.DISSIPATION] = self.buffers.put("numbers", (damping + damping.T) / 2)
            self.ints[level + a.POWER] = self.buffers.put("numbers", varying)
            self.ints[level + a.RUBBING] = self.buffers.put("numbers", np.append(rubbing, pairs))
            self.ints[level + a.RUBBINGS] = len(pairs)

    @property
    def most(self) -> tuple[int, int]:
        """The largest numbers of coordinates and of exponentials of the levels packed."""
        return self._most[:2]

    def _exponentials(self, response: ModalResponse) -> int:
        """The largest number of exponentials of a motion in a level."""
        return len(response.basis.rates) + int(self.ints[a.PRESCRIBED]) * self._powers

    def _response(self, level: Level) -> int:
        """The record of a level's response (response_arrays.py)."""
        response, put = level.response, self.buffers.put
        maps = (response.from_displacement, response.from_velocity, response.from_force, response.shapes.T)
        basis, reached = self._basis(response.basis), self.buffers.take("ints", 2 * len(response.poles))
        places = [put("waves", values) for values in maps]
        places += [put("numbers", level.squares), put("numbers", np.diagonal(level.damping) / 2)]
        chains = [len(response.chains)]
        for chain in response.chains:
            parts = chain.mixing, chain.shapes.T, chain.pushes
            chains += [len(chain.mixing), *(put("waves", part) for part in parts)]
        places += [put("ints", response.alone), put("ints", response.poles), put("ints", chains)]
        record = put("ints", [level.modes, basis, reached, *places])
        response_arrays.reached_modes(self.ints, self.buffers.waves, record)
        return record

    def _basis(self, basis: Exponentials) -> int:
        """The record of a basis (basis_arrays.py)."""
        put = self.buffers.put
        powers, rates, scales = put("ints", basis.powers), put("waves", basis.rates), put("numbers", [basis.unit, 0, 0])
        record = put("ints", [len(basis.rates), powers, rates, scales, 0, 0])
        basis_arrays.describe_basis(*self.buffers.all, record)
        return record

    def _exits(self, level: LoadedLevel, exits: Sequence[tuple[int, Exit]]) -> int:
        """Records of the exits of a level."""
        records = self.buffers.take("ints", a.EXIT_INTS * len(exits))
        for k, (i, exit_) in enumerate(exits):
            asked = after(level, i, exit_)[i]
            values = [i, asked, exit_.firmness, *self._signal(level, signal_row(level, i, exit_)), -1]
            values += self._turn(level, i, exit_)
            self.ints[records + a.EXIT_INTS * k : records + a.EXIT_INTS * (k + 1)] = values
        return records

    def _turn(self, level: LoadedLevel, element: int, exit_: Exit) -> list[int]:
        """The signal of the speed that may turn an exit, and the states that it asks for then."""
        if exit_.turn is None:
            return [-1] * (a.EXIT_INTS - a.TURN)
        speed = signal_row(level, element, Exit(exit_.asked, further=(Share(exit_.turn.link, rate=1.0),)))
        asked = [after(level, element, Exit(name))[element] for name in (exit_.turn.forward, exit_.turn.backward)]
        return [*self._signal(level, speed), *asked]

    def _signal(self, level: LoadedLevel, row: Row) -> list[int]:
        """A signal's record."""
        r, shapes = level.modal.modes, level.modal.response.shapes
        at = self.buffers.put("numbers", np.concatenate([row.position, row.rate, [row.constant]]))
        waves = self.buffers.put("waves", np.concatenate([row.position[:r] @ shapes, row.rate[:r] @ shapes]))
        return [at, waves, int(np.any(row.rate))]

    def _add_entered(self, source: int, exit_number: int) -> None:
        """The signal that an exit's element would have in the level entered alone."""
        level = self.loaded[int(self.ints[source + a.NUMBER])]
        element, exit_ = exits_of(level)[exit_number]
        entered = self.level(after(level, element, exit_))  # may make the buffers anew
        target = self.loaded[int(self.ints[entered + a.NUMBER])]
        row = entered_row(self.levels.transition(level, target), element)
        signal = self.buffers.put("ints", self._signal(level, row))
        record = int(self.ints[source + a.EXITS]) + a.EXIT_INTS * exit_number
        self.ints[record + a.ENTERED] = signal
        if self.held is not None:
            self.held.change_entered(source, record)

    # ------------------------------------------------------------------ maps and tables

    def _add_map(self, source: int, target: int) -> None:
        if (source, target) not in self._maps:
            self._maps[source, target] = self._map(source, target)
        record = self._maps[source, target]
        if self.held is not None:
            self.held.change_map(source, target, record)
        self._shown.add(record)
        if 2 * len(self._maps) > self.ints[a.MAP_SLOTS]:
            self._rehash(int(self.ints[a.LEVEL_SLOTS]), 2 * int(self.ints[a.MAP_SLOTS]))
        else:
            self._enter_map(source, target, record)

    def _map(self, source: int, target: int) -> int:
        """The record of the map between two levels."""
        put, level = self.buffers.put, self.loaded[int(self.ints[target + a.NUMBER])]
        sizes, terms = list[float](), None
        if source == self._base:
            matrix, offset, rate_matrix, sizes = from_base(level)
        else:
            move = self.levels.transition(self.loaded[int(self.ints[source + a.NUMBER])], level)
            matrix, offset, rate_matrix, terms = move.matrix, move.offset, move.velocity_matrix, move.terms
        at = put("numbers", matrix)
        rates = at if np.array_equal(rate_matrix, matrix) else put("numbers", rate_matrix)
        known = -1 if terms is None else put("numbers", terms)
        return put("ints", [at, put("numbers", offset), rates, -1, put("numbers", sizes), known])

    def _enter_level(self, record: int) -> None:
        if 2 * len(self.loaded) > self.ints[a.LEVEL_SLOTS]:
            self._rehash(2 * int(self.ints[a.LEVEL_SLOTS]), int(self.ints[a.MAP_SLOTS]))
            return
        slots = int(self.ints[a.LEVEL_SLOTS])
        slot = level_hash(self.ints, int(self.ints[record + a.STATES])) % slots
        while self.ints[self.ints[a.LEVELS] + slot]:
            slot = (slot + 1) % slots
        self.ints[self.ints[a.LEVELS] + slot] = record

    def _enter_map(self, source: int, target: int, record: int) -> None:
        slots = int(self.ints[a.MAP_SLOTS])
        slot = map_hash(source, target) % slots
        while self.ints[self.ints[a.MAPS] + a.MAP_ENTRY * slot]:
            slot = (slot + 1) % slots
        at = int(self.ints[a.MAPS]) + a.MAP_ENTRY * slot
        self.ints[at : at + a.MAP_ENTRY] = source, target, record

    def _rehash(self, levels: int, maps: int) -> None:
        """Tables of so many slots."""
        self.ints[a.LEVELS] = self.buffers.take("ints", levels)
        self.ints[a.MAPS] = self.buffers.take("ints", a.MAP_ENTRY * maps)
        self.ints[a.LEVEL_SLOTS], self.ints[a.MAP_SLOTS] = levels, maps
        for record in self._shown.intersection(self._offsets.values()):
            self._enter_level(record)
        for (source, target), record in self._maps.items():
            if record in self._shown:
                self._enter_map(source, target, record)
