"""Exits: the ways out of the states of a level's elements, and their signals as functions of the level's motion.

    s = gap q + rate q' + force lambda + constant,   q, lambda linear in xi, xi'    (mechanics/element.py)

A refused exit also has the signal of the level that it would enter: that of the exit that leads back.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, compiled, entry
from multiphi_exudyn.mathematics.round_off import ZERO, drop_round_off, sign_of
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
    "signal_parts",
    "signal_row",
    "signal_rows",
    "signal_table",
    "state_of",
    "write_signal",
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
    own, shares = level.level, ExitShares.of(level.level.base.link_indices, exits)
    table = np.zeros((len(exits), 2 * level.width + 1))
    held, parts = np.array(own.indices, int), np.concatenate(signal_parts(level), axis=None)
    fill_signals(table.ravel(), parts, held, shares.links, shares.numbers, *own.gap_rows.shape, len(held), len(exits))
    return table


def rows_of(table: np.ndarray) -> list[Row]:
    """Return the rows of a table of signals as separate rows."""
    n = table.shape[1] // 2
    return [Row(row[:n], row[n:-1], float(row[-1])) for row in table]


@dataclass(frozen=True)
class ExitShares:
    """Shares of gaps, rates and forces of links in the signals of e exits, as arrays for ``write_signal``.

    links: where the shares of every exit begin, and where the last ones end (e + 1,), then the link of each share.
    numbers: the constant of every exit (e,), then the parts that each share has of q, q' and lambda (., 3).
    """

    links: np.ndarray
    numbers: np.ndarray

    @classmethod
    def of(cls, link_indices: Sequence[Sequence[int]], exits: Sequence[tuple[int, Exit]]) -> ExitShares:
        """Return the shares of exits, given with the indices of their elements."""
        firsts = [0, *itertools.accumulate(len(exit_.shares) for _, exit_ in exits)]
        shares = [(link_indices[element][link], parts) for element, exit_ in exits for link, *parts in exit_.shares]
        constants = [exit_.constant for _, exit_ in exits]
        numbers = np.array(constants + [part for _, parts in shares for part in parts], float)
        return cls(np.array(firsts + [link for link, _ in shares], int), numbers)


def signal_parts(level: LoadedLevel) -> tuple[np.ndarray, ...]:
    """Return what signals are made of: rows (l, n) and constants (l,) of gaps, rows and constants of forces (k,)."""
    own, forces = level.level, level.asymptotic.forces
    return own.gap_rows, level.gap_constants, own.force_rows, own.force_rate_rows, forces


@compiled
def write_signal(
    result: Numbers,
    row: int,
    parts: Numbers,
    start: int,
    held: Ints,
    first_held: int,
    exits: Ints,
    shares: Numbers,
    links: int,
    n: int,
    k: int,
    count: int,
    exit_: int,
) -> None:
    """Set the signal of an exit, a row (2 n + 1,) of (xi, xi', 1) that is zero before.

    parts: ``signal_parts`` one after the other, from ``start``, of l ``links``; held: the k links that hold, from
    ``first_held``; exits, shares: ``ExitShares`` of ``count`` exits. A constant that is the difference of a load and a
    limit is zero if it is round-off of them.
    """
    constants, forces = start + links * n, start + links * (n + 1)
    constant, size = shares[exit_], abs(shares[exit_])
    for share in range(exits[exit_], exits[exit_ + 1]):
        link, part = exits[count + 1 + share], count + 3 * share
        for i in range(n):
            result[row + i] += shares[part] * parts[start + link * n + i]
            result[row + n + i] += shares[part + 1] * parts[start + link * n + i]
        constant += shares[part] * parts[constants + link]
        size += abs(shares[part] * parts[constants + link])
        if shares[part + 2] != 0.0:
            place = 0
            while held[first_held + place] != link:
                place += 1
            for i in range(n):
                result[row + i] += shares[part + 2] * parts[forces + place * n + i]
                result[row + n + i] += shares[part + 2] * parts[forces + (k + place) * n + i]
            constant += shares[part + 2] * parts[forces + 2 * k * n + place]
            size += abs(shares[part + 2] * parts[forces + 2 * k * n + place])
    result[row + 2 * n] = constant if abs(constant) > ZERO * size else 0.0


@compiled
def write_signals(
    result: Numbers, parts: Numbers, held: Ints, exits: Ints, shares: Numbers, links: int, n: int, k: int, count: int
) -> None:
    """Set the signals of all exits, rows (count, 2 n + 1)."""
    for exit_ in range(count):
        row = exit_ * (2 * n + 1)
        write_signal(result, row, parts, 0, held, 0, exits, shares, links, n, k, count, exit_)


fill_signals = entry(write_signals)


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
