"""Exits: the ways out of the states of a level's elements, and their signals as functions of the level's motion.

    s = gap q + rate q' + force lambda + constant,   q, lambda linear in xi, xi'

The shares gap, rate and force of the links are data of the elements (mechanics/element.py).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.mathematics.round_off import ZERO
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = ["asked_state", "exits_of", "force_shares", "signal_rows", "signal_table", "state_of"]


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


def signal_table(level: LoadedLevel, exits: Sequence[tuple[int, Exit]]) -> np.ndarray:
    """Return the signals s of exits of elements in a level, rows (e, 2 n + 1) of (xi, xi', 1)."""
    table = np.zeros((len(exits), 2 * level.width + 1))
    for row, (element, exit_) in zip(table, exits, strict=True):
        _write_signal(row, level, element, exit_)
    return table


def _write_signal(row: np.ndarray, level: LoadedLevel, element: int, exit_: Exit) -> None:
    """Set the signal of an exit, a row (2 n + 1,) that is zero before.

    A constant that is the difference of a load and a limit is zero if it is round-off of them.
    """
    own, n, links = level.level, level.width, level.level.base.link_indices[element]
    constants = [exit_.constant]
    for share in exit_.shares:
        link = links[share.link]
        row[:n] += share.gap * own.gap_rows[link]
        row[n:-1] += share.rate * own.gap_rows[link]
        constants.append(share.gap * level.gap_constants[link])
        if share.force:
            k = own.indices.index(link)
            row[:n] += share.force * own.force_rows[k]
            row[n:-1] += share.force * own.force_rate_rows[k]
            constants.append(share.force * level.asymptotic.forces[k])
    constant = sum(constants)
    row[-1] = constant if abs(constant) > ZERO * sum(map(abs, constants)) else 0.0


def signal_rows(level: LoadedLevel) -> list[Row]:
    """Return the signals s of all exits of a level; the level keeps them."""
    if "signals" not in level.entries:
        n, table = level.width, signal_table(level, exits_of(level))
        level.entries["signals"] = [Row(row[:n], row[n:-1], float(row[-1])) for row in table]
    rows: list[Row] = level.entries["signals"]
    return rows


def force_shares(level: LoadedLevel, element: int, exit_: Exit) -> list[tuple[int, float]]:
    """Return the shares of link forces in an exit's signal, with their indices among the links that hold."""
    links, places = level.level.base.link_indices[element], level.level.indices
    return [(places.index(links[share.link]), share.force) for share in exit_.shares if share.force]
