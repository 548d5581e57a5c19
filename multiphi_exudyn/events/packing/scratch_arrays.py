"""Scratch memory of the loop in buffers (arrays.py): sets of elements, states, and memory of a flow and a search."""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.law.decision import ROUNDS
from multiphi_exudyn.events.transitions.work_forms import MOST_COEFFICIENTS
from multiphi_exudyn.mathematics.complementarity.principal_pivoting import lay_out, problem_ints, problem_numbers
from multiphi_exudyn.mathematics.response import basis_arrays
from multiphi_exudyn.mathematics.search import zero_crossing

__all__ = ["ScratchArrays"]

POWERS = 96  # of a response to one term: where a carrier meets a pole it takes some 40
OF_ELEMENTS = (*range(a.ASKING, a.RESTING_LIST + 1), a.NEEDED_KEY, a.CAUSED_BY, a.LASTS, a.GROUPS, a.ENTERS)
OF_A_PROBLEM = (a.VALUES, a.VALUE_SIZES, a.LOWEST, a.HIGHEST, a.RATIOS, a.WANTED)
STATES_OF_A_RUN = range(a.CURRENT, a.AFTER + 1, a.STATE_INTS)


class ScratchArrays:
    """Scratch memory for the elements that ``buffers`` describe, and for their levels.

    coordinates, exponentials, exits: the most of a level for which there is memory. changes: the most at one instant;
    more are an endless exchange of states. powers: the most of a response to one term for which there is memory.
    """

    def __init__(self, buffers: Buffers, terms: int) -> None:
        ints = buffers.ints
        self._buffers, self._terms = buffers, terms
        self._elements = int(ints[a.ELEMENTS])
        self._rigid = int(np.sum(ints[ints[a.KINDS] :][: self._elements] == a.RIGID))
        sliding = np.count_nonzero(buffers.numbers[ints[a.LIMITS] :][: self._elements])
        self._rough = int(np.count_nonzero(buffers.numbers[ints[a.STATIC_FRICTIONS] :][: self._elements]))
        self._struck = max(2 * self._rigid + self._rough, int(sliding), 1)
        self._together = self._rigid + int(
            np.sum(ints[ints[a.STICKS] :][: self._elements] >= 0)
        )  # the most links held at once
        self.coordinates = self.exponentials = self.exits = 0
        self.changes = ROUNDS * (3 * self._elements + 1) + int(ints[a.KNOTS])
        self.powers = ints[a.FORCED_ROOM] = POWERS
        self._take(self._sets())
        buffers.ints[a.CHANGE_ROOM] = self.changes

    def reserve(self, n: int, free: int, exits: int) -> None:
        """Reserve memory for levels of n coordinates, so many exponentials of the free response and so many exits."""
        p = free + int(self._buffers.ints[a.PRESCRIBED]) * self.powers
        reserved = self.coordinates, self.exponentials, self.exits
        n, p, exits = map(max, (n, p, exits), reserved)
        if (n, p, exits) == reserved:
            return
        self.coordinates, self.exponentials, self.exits = n, p, exits
        self._take(self._of_levels(n, p, max(2 * exits, 1)))
        if not self._rough:
            self._buffers.ints[a.PUSHING] = self._buffers.ints[a.ROWS]
        self._reserve_problem(n)
        self._reserve_flow(p)
        for state in STATES_OF_A_RUN:
            old = self._buffers.ints[state : state + a.STATE_INTS].copy()
            self.reserve_state(state, n, exits)
            if old[a.LEVEL]:
                self._carry_over(state, old)
        self.reserve_state(a.COMPRESSED, self._wide(n), max(exits, self._elements))

    def reserve_state(self, state: int, n: int, exits: int) -> None:
        """Reserve memory for a state of n coordinates and so many exits."""
        for part in range(a.PLACE, a.SWING + 1):
            place = self._buffers.take("numbers", n)
            self._buffers.ints[state + part] = place
        place = self._buffers.take("ints", exits)
        self._buffers.ints[state + a.PHASES] = place

    def reserve_powers(self, free: int) -> None:
        """Enlarge the memory to the powers that a response has, for levels of at most ``free`` exponentials."""
        wanted = 2 * int(self._buffers.ints[a.FORCED_WANTED])
        self.powers = self._buffers.ints[a.FORCED_ROOM] = wanted
        self._buffers.ints[a.FORCED_WANTED] = 0
        self.reserve(self.coordinates, free, self.exits)

    def _take(self, sizes: dict[str, dict[int, int]]) -> None:
        """Reserve memory of each buffer for every slot."""
        for name, slots in sizes.items():
            for slot, count in slots.items():
                place = self._buffers.take(name, count)
                self._buffers.ints[slot] = place

    def _sets(self) -> dict[str, dict[int, int]]:
        """Return the sizes of the memory that depends on the elements alone."""
        ints, c, struck, changes = self._buffers.ints, self._elements, self._struck, self.changes
        m = int(ints[a.COORDINATES])
        return {
            "ints": dict.fromkeys(OF_ELEMENTS, 2 * c + 1)
            | {a.SMALL_PROBLEM: problem_ints(struck), a.LEADERS: struck}
            | {a.CHANGES: a.CHANGE_WIDTH * changes},
            "numbers": dict.fromkeys((*OF_A_PROBLEM, a.IMPULSES, a.FURTHER, a.RESTING_SIZES), struck)
            | {a.PUSHED: c, a.JOIN_NUMBERS: m * max(1, min(self._together, m)), a.CHANGE_IMPULSES: changes}
            | {a.FOUND: zero_crossing.RESULT},
        }

    def _of_levels(self, n: int, p: int, signals: int) -> dict[str, dict[int, int]]:
        """Return the sizes of the memory that depends on the levels. Impacts happen in all modes too, at the start."""
        ints, struck, terms = self._buffers.ints, self._struck, self._terms
        wide = self._wide(n)
        q, room = int(ints[a.PRESCRIBED]), max(self.powers, terms) if ints[a.CHANNELS] else 0
        return {
            "numbers": dict.fromkeys((a.ACCELERATION, a.ACCELERATION_TERMS, a.RELEASED_TERMS), n)
            | {a.ROWS: struck * wide, a.PUSHING: struck * wide if self._rough else 0, a.MOVED: wide, a.CHANGE: wide}
            | {a.WORK_NUMBERS: 8 * n + 12 * MOST_COEFFICIENTS}
            | {a.FLOW_TERMS: p, a.SET_SIZES: 2 * n, a.FLOW_STATE: 2 * n}
            | {a.CONSTANTS: signals, a.NOISES: signals}
            | {a.SEARCH_NUMBERS: max(zero_crossing.scratch_numbers(p, signals), 2 * p)},
            "ints": {a.WAITING: 2 * signals, a.FALLEN: signals},
            "waves": {a.FLOW_WAVES: p, a.SIGNALS: signals * p, a.WORK_WAVES: 3 * p}
            | {a.SEARCH_WAVES: zero_crossing.scratch_waves(p, signals)}
            | {a.FORCES: terms * n, a.FORCED: room * n, a.FORCED_WORK: (2 + p) * room, a.FLOW_FORCED: q * room * n},
        }

    def _wide(self, n: int) -> int:
        """Return the largest number of unknowns of an impact; it may happen in all modes too."""
        ints = self._buffers.ints
        return max(int(ints[a.COORDINATES] + ints[a.CHANNELS]), n) if self._rigid else n

    def _reserve_problem(self, n: int) -> None:
        """Reserve memory for the small problem of impacts (principal_pivoting.py)."""
        memory = self._buffers.take("numbers", problem_numbers(self._struck, self._wide(n)))
        lay_out(self._buffers.ints, int(self._buffers.ints[a.SMALL_PROBLEM]), self._struck, self._wide(n), memory)

    def _reserve_flow(self, p: int) -> None:
        """Reserve a record for the basis of a motion with channels, of p exponentials."""
        take, record = self._buffers.take, self._buffers.take("ints", basis_arrays.BASIS)
        slots = {basis_arrays.POWERS: take("ints", p), basis_arrays.RATES: take("waves", p)}
        slots[basis_arrays.SCALES] = take("numbers", 3)
        for slot, value in slots.items():
            self._buffers.ints[record + slot] = value
        self._buffers.ints[a.FLOW_RECORD] = record

    def _carry_over(self, state: int, old: np.ndarray) -> None:
        """Copy a state from the memory that was too small."""
        ints, numbers, level = self._buffers.ints, self._buffers.numbers, int(old[a.LEVEL])
        n, exits = int(ints[level + a.MODES] + ints[a.CHANNELS]), int(ints[level + a.EXIT_COUNT])
        for part in range(a.PLACE, a.SWING + 1):
            start, end = int(old[part]), int(ints[state + part])
            numbers[end : end + n] = numbers[start : start + n]
        start, end = int(old[a.PHASES]), int(ints[state + a.PHASES])
        ints[end : end + exits] = ints[start : start + exits]
