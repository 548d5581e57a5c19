"""Exits: the ways out of the states of a level's elements, and their signals as functions of the level's motion.

    s = gap q + rate q' + force lambda + constant,   q, lambda linear in xi, xi'    (mechanics/element.py)

A refused exit also has the signal of the level that it would enter: that of the exit that leads back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.mathematics.round_off import drop_round_off, sign_of
from multiphi_exudyn.mechanics.elements.element import ElementState, Exit

__all__ = [
    "ExitShares",
    "after",
    "asked_state",
    "entered_row",
    "entering_exit",
    "exits_of",
    "force_shares",
    "return_exit",
    "rows_of",
    "signal_row",
    "signal_rows",
    "signal_table",
    "signals_of",
    "state_of",
]


def state_of(level: LoadedLevel, element: int) -> ElementState:
    """Return the state of an element in a level."""
    return level.level.base.contacts[element].states[level.states[element]]


def exits_of(level: LoadedLevel) -> list[tuple[int, Exit]]:
    """Return all exits of a level, in the order of its elements, with the index of the element."""
    return [(i, exit_) for i in range(len(level.states)) for exit_ in state_of(level, i).exits]


def asked_state(level: LoadedLevel, element: int, exit_: Exit) -> int:
    """Return the number of the state that an exit of an element requests."""
    states = level.level.base.contacts[element].states
    return next(number for number, state in enumerate(states) if state.name == exit_.asked)


def after(level: LoadedLevel, element: int, exit_: Exit) -> tuple[int, ...]:
    """Return the states of all elements after one has taken an exit."""
    states = list(level.states)
    states[element] = asked_state(level, element, exit_)
    return tuple(states)


def entering_exit(exit_: Exit) -> Exit:
    """Return the exit of the level that an element would enter alone.

    For a contact that would slide it is the exit to slip: entering stick would remove its slip velocity.
    """
    return exit_ if exit_.turn is None else Exit(exit_.turn.forward)


def signal_row(level: LoadedLevel, element: int, exit_: Exit) -> Row:
    """Return the signal s of an element's exit in a level."""
    return rows_of(signal_table(level, [(element, exit_)]))[0]


def signal_table(level: LoadedLevel, exits: Sequence[tuple[int, Exit]]) -> np.ndarray:
    """Return the signals s of exits of elements in a level, rows (e, 2 n + 1) of (xi, xi', 1)."""
    return signals_of(level, ExitShares.of(level.level.base.link_indices, exits))


def rows_of(table: np.ndarray) -> list[Row]:
    """Return the rows of a table of signals as separate rows."""
    n = table.shape[1] // 2
    return [Row(row[:n], row[n:-1], float(row[-1])) for row in table]


@dataclass(frozen=True)
class ExitShares:
    """Shares of gaps, rates and forces of links in the signals of e exits. constants: (e,).

    links, shares: (e, 3) the first link of each exit, and the shares of its q, q' and lambda. further: the exits'
    indices, links and shares of further links.
    """

    constants: np.ndarray
    links: np.ndarray
    shares: np.ndarray
    further: tuple[np.ndarray, np.ndarray, np.ndarray]

    @classmethod
    def of(cls, link_indices: Sequence[Sequence[int]], exits: Sequence[tuple[int, Exit]]) -> ExitShares:
        """Return the shares of exits, given with the indices of their elements."""
        links = np.array([link_indices[element][0] for element, _ in exits], int)
        shares = np.array([exit_.shares[0][1:] for _, exit_ in exits], float).reshape(-1, 3)
        entries = [
            (k, link_indices[element][share.link], *share[1:])
            for k, (element, exit_) in enumerate(exits)
            for share in exit_.further
        ]
        table = np.array(entries, float).reshape(-1, 5)
        numbers, others = table[:, :2].astype(int).T
        constants = np.array([exit_.constant for _, exit_ in exits], float)
        return cls(constants, links, shares, (numbers, others, table[:, 2:]))

    def selected(self, kept: np.ndarray) -> ExitShares:
        """Return the shares of the exits that are ``kept`` (e,) alone."""
        numbers, links, shares = self.further
        if not len(numbers):
            return ExitShares(self.constants[kept], self.links[kept], self.shares[kept], self.further)
        rows, counted = kept[numbers], np.cumsum(kept) - 1
        further = counted[numbers[rows]], links[rows], shares[rows]
        return ExitShares(self.constants[kept], self.links[kept], self.shares[kept], further)


def signals_of(level: LoadedLevel, exits: ExitShares) -> np.ndarray:
    """Return the signals s of exits in a level, rows (e, 2 n + 1) of (xi, xi', 1).

    A constant that is the difference of a load and a limit is zero if it is round-off of them.
    """
    table, sizes = _link_parts(level, exits.links, exits.shares)
    numbers, links, shares = exits.further
    if len(numbers):
        added, further = _link_parts(level, links, shares)
        np.add.at(table, numbers, added)
        np.add.at(sizes, numbers, further)
    table[:, -1] += exits.constants
    sizes += np.abs(exits.constants)
    table[:, -1] = drop_round_off(table[:, -1], sizes)
    return table


def _link_parts(level: LoadedLevel, links: np.ndarray, shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the parts of links (s,) in signals by their shares (s, 3): rows (s, 2 n + 1) of (xi, xi', 1), and sizes.

    The sizes (s,) are those of the terms of which the last column is the sum.
    """
    own, n = level.level, level.width
    rows, table = own.gap_rows[links], np.zeros((len(links), 2 * n + 1))
    np.multiply(rows, shares[:, :1], out=table[:, :n])
    if np.count_nonzero(shares[:, 1]):
        np.multiply(rows, shares[:, 1:2], out=table[:, n:-1])
    np.multiply(level.gap_constants[links], shares[:, 0], out=table[:, -1])
    sizes, pressing = np.abs(table[:, -1]), shares[:, 2].nonzero()[0]
    if len(pressing):
        active = [own.indices.index(link) for link in links[pressing].tolist()]
        pressed = np.concatenate(
            [own.force_rows[active], own.force_rate_rows[active], level.asymptotic.forces[active, None]], axis=1
        )
        pressed *= shares[pressing, 2:]
        table[pressing] += pressed
        sizes[pressing] += np.abs(pressed[:, -1])
    return table, sizes


def force_shares(level: LoadedLevel, element: int, exit_: Exit) -> list[tuple[int, float]]:
    """Return the shares of link forces in an exit's signal, with their indices among the links that hold."""
    links, places = level.level.base.link_indices[element], level.level.indices
    return [(places.index(links[share.link]), share.force) for share in exit_.shares if share.force]


def signal_rows(level: LoadedLevel) -> list[Row]:
    """Return the signals s of all exits of a level; the level keeps them."""
    if "signals" not in level.entries:
        level.entries["signals"] = rows_of(signal_table(level, exits_of(level)))
    rows: list[Row] = level.entries["signals"]
    return rows


def return_exit(level: LoadedLevel, element: int, exit_: Exit) -> Exit:
    """Return the exit by which an element would come back from the state that an exit leads to."""
    states = level.level.base.contacts[element].states
    return _return_exit(state_of(level, element), next(state for state in states if state.name == exit_.asked))


def _return_exit(here: ElementState, there: ElementState) -> Exit:
    return next((exit_ for exit_ in there.exits if exit_.asked == here.name), there.exits[0])


def entered_row(move: Transition, element: int) -> Row:
    """Return the signal s of an element after a transition, as a function of the states of its source."""
    exit_ = _return_exit(state_of(move.source, element), state_of(move.target, element))
    target_row = signal_row(move.target, element, exit_)
    terms = target_row.position * move.offset
    constant = 0.0 if sign_of(terms, target_row.constant) == 0 else target_row.constant + float(np.sum(terms))
    return Row(
        drop_round_off(target_row.position @ move.matrix, np.abs(target_row.position) @ np.abs(move.matrix)),
        target_row.rate @ move.velocity_matrix,
        constant,
    )
