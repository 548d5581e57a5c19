"""Exits: the ways out of the states of a level's elements, and what their signals say of the level's motion.

    s = gap q + rate q' + force lambda + constant,   q, lambda linear in xi, xi'    (mechanics/element.py)

An exit whose element may not leave asks what it would say in the level entered: that of the exit that leads back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.mathematics.round_off import drop_round_off, sign_of
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = [
    "ExitShares",
    "after",
    "asked_alone",
    "asked_state",
    "entered_row",
    "exits_of",
    "force_shares",
    "rows_of",
    "signal_row",
    "signal_rows",
    "signal_table",
    "signals_of",
    "state_of",
    "way_back",
]


def state_of(level: LoadedLevel, element: int) -> ElementState:
    """The state in which an element is in a level."""
    return level.level.base.contacts[element].states[level.states[element]]


def exits_of(level: LoadedLevel) -> list[tuple[int, Exit]]:
    """All exits of a level, in the order of its elements, with their positions."""
    return [(i, exit_) for i in range(len(level.states)) for exit_ in state_of(level, i).exits]


def asked_state(level: LoadedLevel, element: int, exit_: Exit) -> int:
    """The number of the state that an exit of an element asks for."""
    states = level.level.base.contacts[element].states
    return next(number for number, state in enumerate(states) if state.name == exit_.asked)


def after(level: LoadedLevel, element: int, exit_: Exit) -> tuple[int, ...]:
    """The states of all elements after one has taken an exit."""
    states = list(level.states)
    states[element] = asked_state(level, element, exit_)
    return tuple(states)


def asked_alone(exit_: Exit) -> Exit:
    """The exit by which an element is asked in the level entered alone.

    A contact that would slide is asked where it does: to stick would take its speed away.
    """
    return exit_ if exit_.turn is None else Exit(exit_.turn.forward)


def signal_row(level: LoadedLevel, element: int, exit_: Exit) -> Row:
    """s of an element's exit in a level."""
    return rows_of(signal_table(level, [(element, exit_)]))[0]


def signal_table(level: LoadedLevel, exits: Sequence[tuple[int, Exit]]) -> np.ndarray:
    """s of exits of elements in a level, rows (e, 2 n + 1) of (xi, xi', 1)."""
    return signals_of(level, ExitShares.of(level.level.base.link_indices, exits))


def rows_of(table: np.ndarray) -> list[Row]:
    """The rows of a table of signals, each by itself."""
    n = table.shape[1] // 2
    return [Row(row[:n], row[n:-1], float(row[-1])) for row in table]


@dataclass(frozen=True)
class ExitShares:
    """What the signals of e exits are sums of. constants: (e,).

    links, shares: (e, 3) the first link of each, and the shares of its q, q' and lambda. further: the same of other
    links, of the exits with these numbers.
    """

    constants: np.ndarray
    links: np.ndarray
    shares: np.ndarray
    further: tuple[np.ndarray, np.ndarray, np.ndarray]

    @classmethod
    def of(cls, link_indices: Sequence[Sequence[int]], exits: Sequence[tuple[int, Exit]]) -> ExitShares:
        """Of exits with the positions of their elements."""
        links = np.array([link_indices[element][0] for element, _ in exits], int)
        shares = np.array([exit_.shares[0][1:] for _, exit_ in exits], float).reshape(-1, 3)
        given = [
            (k, link_indices[element][share.link], *share[1:])
            for k, (element, exit_) in enumerate(exits)
            for share in exit_.further
        ]
        table = np.array(given, float).reshape(-1, 5)
        numbers, others = table[:, :2].astype(int).T
        constants = np.array([exit_.constant for _, exit_ in exits], float)
        return cls(constants, links, shares, (numbers, others, table[:, 2:]))

    def taken(self, kept: np.ndarray) -> ExitShares:
        """Of those exits that are ``kept`` (e,) alone."""
        numbers, links, shares = self.further
        if not len(numbers):
            return ExitShares(self.constants[kept], self.links[kept], self.shares[kept], self.further)
        rows, counted = kept[numbers], np.cumsum(kept) - 1
        further = counted[numbers[rows]], links[rows], shares[rows]
        return ExitShares(self.constants[kept], self.links[kept], self.shares[kept], further)


def signals_of(level: LoadedLevel, exits: ExitShares) -> np.ndarray:
    """s of exits in a level, rows (e, 2 n + 1) of (xi, xi', 1).

    A load that is a limit leaves no round-off of both.
    """
    table, sizes = _linked(level, exits.links, exits.shares)
    numbers, links, shares = exits.further
    if len(numbers):
        added, further = _linked(level, links, shares)
        np.add.at(table, numbers, added)
        np.add.at(sizes, numbers, further)
    table[:, -1] += exits.constants
    sizes += np.abs(exits.constants)
    table[:, -1] = drop_round_off(table[:, -1], sizes)
    return table


def _linked(level: LoadedLevel, links: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What links (s,) have in signals by their shares (s, 3): rows (s, 2 n + 1) of (xi, xi', 1), and their sizes (s,).

    These are of the terms of which the last column is the sum.
    """
    own, n = level.level, level.width
    rows, table = own.gap_rows[links], np.zeros((len(links), 2 * n + 1))
    np.multiply(rows, shares[:, :1], out=table[:, :n])
    if np.count_nonzero(shares[:, 1]):
        np.multiply(rows, shares[:, 1:2], out=table[:, n:-1])
    np.multiply(level.gap_constants[links], shares[:, 0], out=table[:, -1])
    sizes, pressing = np.abs(table[:, -1]), shares[:, 2].nonzero()[0]
    if len(pressing):
        place = np.zeros(len(level.gap_constants), int)
        place[list(own.indices)] = range(len(own.indices))
        held, share = place[links[pressing]], shares[pressing, 2]
        table[pressing, :n] += share[:, None] * own.force_rows[held]
        table[pressing, n:-1] += share[:, None] * own.force_rate_rows[held]
        forces = share * level.asymptotic.forces[held]
        table[pressing, -1] += forces
        sizes[pressing] += np.abs(forces)
    return table, sizes


def force_shares(level: LoadedLevel, element: int, exit_: Exit) -> list[tuple[int, float]]:
    """Of the forces of links that hold in a level, by their places among these, what counts in an exit's signal."""
    links, places = level.level.base.link_indices[element], level.level.indices
    return [(places.index(links[share.link]), share.force) for share in exit_.shares if share.force]


def signal_rows(level: LoadedLevel) -> list[Row]:
    """s of all exits of a level, which keeps them."""
    if "signals" not in level.entries:
        level.entries["signals"] = rows_of(signal_table(level, exits_of(level)))
    rows: list[Row] = level.entries["signals"]
    return rows


def way_back(level: LoadedLevel, element: int, exit_: Exit) -> Exit:
    """The exit of the state that an exit leads to by which the element would come back."""
    states = level.level.base.contacts[element].states
    return _way_back(state_of(level, element), next(state for state in states if state.name == exit_.asked))


def _way_back(here: ElementState, there: ElementState) -> Exit:
    return next((exit_ for exit_ in there.exits if exit_.asked == here.name), there.exits[0])


def entered_row(move: Transition, element: int) -> Row:
    """s that an element would have after a transition, as a function of the states of its source."""
    back = _way_back(state_of(move.source, element), state_of(move.target, element))
    there = signal_row(move.target, element, back)
    terms = there.position * move.offset
    constant = 0.0 if sign_of(terms, there.constant) == 0 else there.constant + float(np.sum(terms))
    return Row(
        drop_round_off(there.position @ move.matrix, np.abs(there.position) @ np.abs(move.matrix)),
        there.rate @ move.velocity_matrix,
        constant,
    )
