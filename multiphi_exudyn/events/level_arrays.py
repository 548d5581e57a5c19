"""Levels, maps and signals of one model under its loads as arrays (arrays.py), packed when the loop asks for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.admissibility import ContactFunctions
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.flat_rule import ROUNDS
from multiphi_exudyn.events.flat_state import level_hash, map_hash, measure
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.mathematics import flat_basis, flat_response, zero_crossing
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.flat_least_distance import least_distance_ints, least_distance_numbers
from multiphi_exudyn.mathematics.free_response import ModalResponse

__all__ = ["LevelArrays"]

ROOM = 1024  # segments, and events, that the loop records before they are taken
SLOTS = 64  # of a table at first: twice as many as it holds, or more
STATES_OF_A_RUN = range(a.CURRENT, a.AFTER + 1, a.STATE_INTS)


class LevelArrays:
    """What the loop knows of the levels of ``rule``; ``loaded``: the levels themselves, by their number.

    owner: the run whose state stands in the arrays.
    """

    def __init__(self, rule: ContactFunctions) -> None:
        self.rule = rule
        self.owner: Callable[[], Any] | None = None
        self._count = 0  # of levels packed so far
        self.forget()

    def forget(self) -> None:
        """Begin anew, without any level."""
        self.buffers = Buffers()
        self.loaded: dict[int, LoadedLevel] = {}
        self._offsets: dict[int, int] = {}  # of levels in the ints, by number
        self._levels: dict[tuple[int, ...], int] = {}  # numbers by closed contacts
        self._maps: list[tuple[int, int, int]] = []
        self._most = 0, 0, 0  # coordinates, exponentials and exits for which there is scratch memory
        self._ring: int | None = None
        self._recorded = 0  # coordinates for which the record has room
        self._describe_elements()

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

    def set_state(self, level: int, place: np.ndarray, speed: np.ndarray, phases: Sequence[int]) -> None:
        """The current state: xi, xi' (n,) in a level, and the phases of its exits."""
        n, state = len(place), a.CURRENT
        self.ints[state + a.LEVEL] = level
        for part, values in ((a.PLACE, place), (a.SPEED, speed)):
            start = int(self.ints[state + part])
            self.numbers[start : start + n] = values
        start = int(self.ints[state + a.PHASES])
        self.ints[start : start + len(phases)] = phases
        self.ints[state + a.SETTLED] = int(not any(phases))
        measure(self.ints, self.numbers, state)

    @property
    def outgrown(self) -> bool:
        """Whether a level has come that is larger than the record has room for."""
        return self._recorded < self._most[0]

    def begin_record(self) -> None:
        """An empty record to write to."""
        n, c = self._most[0], int(self.ints[a.ELEMENTS])
        events = max(ROOM, self._changes)
        wanted = {
            a.SEGMENT_INTS: ("ints", a.SEGMENT_WIDTH * ROOM),
            a.SEGMENT_NUMBERS: ("numbers", a.SEGMENT_WIDTH_NUMBERS * ROOM),
            a.COORDINATE_NUMBERS: ("numbers", 2 * n * ROOM),
            a.PHASE_INTS: ("ints", c * ROOM),
            a.EVENT_INTS: ("ints", a.EVENT_WIDTH * events),
            a.EVENT_NUMBERS: ("numbers", a.EVENT_WIDTH_NUMBERS * events),
        }
        for slot, (name, count) in wanted.items() if self.outgrown else ():
            self.ints[slot] = self.buffers.take(name, count)
        self._recorded = n
        self.ints[a.SEGMENT_ROOM], self.ints[a.EVENT_ROOM] = ROOM, events
        for slot in (a.SEGMENT_COUNT, a.COORDINATE_COUNT, a.PHASE_COUNT, a.EVENT_COUNT):
            self.ints[slot] = 0

    @property
    def _changes(self) -> int:
        """Changes at one instant for which there is room: more are an endless exchange."""
        return ROUNDS * (3 * len(self.rule.model.contacts) + 1)

    def level(self, closed: Sequence[int]) -> int:
        """Where the level with these contacts closed stands in the ints, packed if it was not."""
        key = tuple(closed)
        if key not in self._levels:
            self._add(self.rule.level(key))
        return self._offsets[self._levels[key]]

    def supply(self) -> None:
        """Pack what the loop needs."""
        key = self.ints[self.ints[a.NEEDED_KEY] :][: self.ints[a.ELEMENTS]]
        closed, source = np.flatnonzero(key == a.CLOSE).tolist(), int(self.ints[a.NEEDED_FROM])
        if self.ints[a.NEEDED] == a.NEED_LEVEL:
            self.level(closed)
        elif self.ints[a.NEEDED] == a.NEED_MAP:
            self._add_map(source, self.level(closed))
        elif self.ints[a.NEEDED] == a.NEED_ENTERED:
            self._add_entered(source, int(key[0]))
        else:
            self._supply_channels()

    def _supply_channels(self) -> None:
        """Pack what the loop needs of channels."""
        raise AssertionError("there are no channels")

    def _plain(self, level: LoadedLevel) -> LoadedLevel:
        """A level without its channels."""
        return level

    # ------------------------------------------------------------------ elements and scratch memory

    def _describe_elements(self) -> None:
        """The run record, and what is known of the elements."""
        model, put, take = self.rule.model, self.buffers.put, self.buffers.take
        take("ints", a.RUN_INTS)
        take("numbers", a.RUN_NUMBERS)
        base, c = model.base, len(model.contacts)
        viscous = base.dampings > 0
        kinds = np.where(np.isinf(base.stiffnesses), a.RIGID, np.where(viscous, a.VISCOUS, a.COMPLIANT))
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
            a.STIFFNESSES: put("numbers", np.where(np.isinf(base.stiffnesses), 0.0, base.stiffnesses)),
            a.DIRECTIONS: put("numbers", units.T),
        }
        for slot, value in given.items():
            self.ints[slot] = value
        self._rehash(SLOTS, SLOTS)
        self._reserve_sets(c, int(np.sum(kinds == a.RIGID)))

    def _reserve_sets(self, c: int, rigid: int) -> None:
        """Scratch memory that depends on the number of elements alone."""
        take, m = self.buffers.take, int(self.ints[a.COORDINATES])
        struck, changes = max(2 * rigid, 1), self._changes
        sizes = {
            "ints": dict.fromkeys((*range(a.ASKING, a.RESTING_LIST + 1), a.NEEDED_KEY, a.CAUSED_BY), 2 * c + 1)
            | {a.CHAIN_MARKS: len(self.rule.model.chains), a.LEAST_INTS: least_distance_ints(struck)}
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
        for name, slots in self._scratch(n, p, 2 * exits).items():
            for slot, count in slots.items():
                self.ints[slot] = self.buffers.take(name, count)
        for state in STATES_OF_A_RUN:
            old = self.ints[state : state + a.STATE_INTS].copy()
            for part in range(a.PLACE, a.SWING + 1):
                self.ints[state + part] = self.buffers.take("numbers", n)
            self.ints[state + a.PHASES] = self.buffers.take("ints", exits)
            if old[a.LEVEL]:
                self._carry_over(state, old)

    def _scratch(self, n: int, p: int, signals: int) -> dict[str, dict[int, int]]:
        """How much of each buffer every part of the scratch memory takes, that depends on the levels."""
        kinds = self.ints[self.ints[a.KINDS] :][: self.ints[a.ELEMENTS]]
        struck = max(2 * int(np.sum(kinds == a.RIGID)), 1)
        return {
            "numbers": dict.fromkeys((a.ACCELERATION, a.ACCELERATION_TERMS, a.RELEASED_TERMS, a.CHANGE), n)
            | {a.ROWS: struck * n, a.LEAST_NUMBERS: least_distance_numbers(struck, n), a.FLOW_TERMS: p}
            | {a.CONSTANTS: signals, a.NOISES: signals}
            | {a.SEARCH_NUMBERS: max(zero_crossing.scratch_numbers(p, signals), 2 * p)},
            "ints": {a.WAITING: 2 * signals, a.FALLEN: signals},
            "waves": {a.FLOW_WAVES: p, a.SIGNALS: signals * p, a.WORK_WAVES: 2 * p}
            | {a.SEARCH_WAVES: zero_crossing.scratch_waves(p, signals)},
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

    def _add(self, level: LoadedLevel) -> None:
        own, put, q = level.level, self.buffers.put, int(self.ints[a.CHANNELS])
        plain, contacts = self._plain(level).level, range(len(self.rule.model.contacts))
        parts, r = self._parts(level), plain.modes
        self._reserve(r + q, self._exponentials(plain.response), len(contacts))
        record = self.buffers.take("ints", a.LEVEL_INTS)
        states = [int(i in own.indices) for i in contacts]
        ends = self.rule.ends(own.indices)
        omega = plain.omega
        periods = np.divide(1.0, omega, out=np.zeros(r), where=omega > 0)
        exits = self._exits(level, states)
        given = {
            a.NUMBER: self._count,
            a.MODES: r,
            a.STATES: put("ints", states),
            a.RESPONSE: self._response(plain),
            a.FORCE: put("numbers", level.asymptotic.drive) if level.driven else -1,
            a.EXITS: exits,
            a.EXIT_COUNT: len(contacts),
            a.FIRST_EXITS: put("ints", range(len(contacts) + 1)),
            a.ENDS: put("ints", ends),
            a.END_COUNT: len(ends),
            a.FREQUENCIES: put("numbers", omega),
            a.PERIODS: put("numbers", periods),
            a.HIGHEST_FREQUENCY: put("numbers", [own.highest_frequency]),
            a.CARRIED: -1,
            **{slot: put("numbers", values) for slot, values in parts.items()},
        }
        given.setdefault(a.SPEEDS, given[a.GAPS])
        for slot, value in given.items():
            self.ints[record + slot] = value
        self._levels[own.indices] = self._count
        self._offsets[self._count] = record
        self.loaded[self._count] = level
        self._count += 1
        self._enter_level(record)

    def _parts(self, level: LoadedLevel) -> dict[int, np.ndarray]:
        """What describes a level's motion, gaps and energies."""
        own, rest = level.level, level.asymptotic
        motion = np.column_stack([-np.diag(own.squares), -own.damping, rest.drive])
        return {
            a.MOTION: motion,
            a.GAPS: np.column_stack([own.gap_rows, level.gap_constants]),
            a.POTENTIAL: np.concatenate([[rest.potential], -rest.drive, own.squares]),
        }

    def _exponentials(self, response: ModalResponse) -> int:
        """The largest number of exponentials of a motion in a level."""
        return len(response.basis.rates)

    def _response(self, level: Level) -> int:
        """The record of a level's response (flat_response.py)."""
        response, put = level.response, self.buffers.put
        maps = (response.from_displacement, response.from_velocity, response.from_force, response.shapes.T)
        alone = (level.squares == 0) & ~np.any(level.damping, axis=1) | response.diagonal
        poles = np.any(response.from_velocity, axis=1) & ~np.any(response.shapes[alone], axis=0)
        basis, reached = self._basis(response.basis), self.buffers.take("ints", 2 * len(poles))
        places = [put("waves", values) for values in maps]
        places += [put("numbers", level.squares), put("numbers", np.diagonal(level.damping) / 2)]
        places += [put("ints", alone), put("ints", poles)]
        record = put("ints", [level.modes, basis, reached, *places])
        flat_response.reached_modes(self.ints, self.buffers.waves, record)
        return record

    def _basis(self, basis: Exponentials) -> int:
        """The record of a basis (flat_basis.py)."""
        put = self.buffers.put
        powers, rates, scales = put("ints", basis.powers), put("waves", basis.rates), put("numbers", [basis.unit, 0, 0])
        record = put("ints", [len(basis.rates), powers, rates, scales, 0, 0])
        flat_basis.describe_basis(*self.buffers.all, record)
        return record

    def _exits(self, level: LoadedLevel, states: list[int]) -> int:
        """Records of the exits of a level: every contact has one, into its other state."""
        kinds = self.ints[self.ints[a.KINDS] :]
        records = self.buffers.take("ints", a.EXIT_INTS * len(states))
        for i, state in enumerate(states):
            stays = kinds[i] == a.VISCOUS or (kinds[i] == a.RIGID and state == a.CLOSE)
            values = [
                i,
                a.OPEN if state == a.CLOSE else a.CLOSE,
                stays,
                *self._signal(level, self.rule.function(level, i)),
            ]
            self.ints[records + a.EXIT_INTS * i : records + a.EXIT_INTS * (i + 1)] = [*values, -1]
        return records

    def _signal(self, level: LoadedLevel, row: Row) -> list[int]:
        """A signal's record."""
        plain = self._plain(level).level
        r, shapes = plain.modes, plain.response.shapes
        at = self.buffers.put("numbers", np.concatenate([row.position, row.rate, [row.constant]]))
        waves = self.buffers.put("waves", np.concatenate([row.position[:r] @ shapes, row.rate[:r] @ shapes]))
        return [at, waves, int(np.any(row.rate))]

    def _add_entered(self, source: int, exit_number: int) -> None:
        """The signal that an exit's element would have in the level entered alone."""
        level = self.loaded[int(self.ints[source + a.NUMBER])]
        record = int(self.ints[source + a.EXITS]) + a.EXIT_INTS * exit_number
        row = self.rule.entered_function(level, int(self.ints[record + a.ELEMENT]))
        entered = self.buffers.put("ints", self._signal(level, row))
        self.ints[record + a.ENTERED] = entered

    # ------------------------------------------------------------------ maps and tables

    def _add_map(self, source: int, target: int) -> None:
        put = self.buffers.put
        ends = [self.loaded[int(self.ints[end + a.NUMBER])] for end in (source, target)]
        move = self.rule.transition(*ends)
        matrix = put("numbers", move.matrix)
        rates = matrix if move.velocity_matrix is move.matrix else put("numbers", move.velocity_matrix)
        record = put("ints", [matrix, put("numbers", move.offset), rates, -1])
        self._maps.append((source, target, record))
        if 2 * len(self._maps) > self.ints[a.MAP_SLOTS]:
            self._rehash(int(self.ints[a.LEVEL_SLOTS]), 2 * int(self.ints[a.MAP_SLOTS]))
        else:
            self._enter_map(source, target, record)

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
        for record in self._offsets.values():
            self._enter_level(record)
        for entry in self._maps:
            self._enter_map(*entry)
