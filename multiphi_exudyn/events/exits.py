"""Exits: the ways out of the states of a level's elements, and what their signals say of the level's motion.

    s = gap q + rate q' + force lambda + constant,   q, lambda linear in xi, xi'    (mechanics/element.py)

An exit whose element may not leave asks what it would say in the level entered: that of the exit that leads back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.events.transition import Transition
from multiphi_exudyn.mathematics.round_off import drop_round_off, sign_of
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = [
    "after",
    "asked_alone",
    "asked_state",
    "entered_row",
    "exits_of",
    "force_shares",
    "signal_row",
    "signal_rows",
    "signal_table",
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
    position, rate, constant = (part[0] for part in signal_table(level, [(element, exit_)]))
    return Row(position, rate, float(constant))


def signal_table(level: LoadedLevel, exits: Sequence[tuple[int, Exit]]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """s of exits of elements in a level: of xi (e, r), of xi' (e, r) and constant (e,).

    A load that is a limit leaves no round-off of both.
    """
    own, count = level.level, len(exits)
    places = own.base.link_places
    moving = [
        (k, places[element][share.link], share.gap, share.rate)
        for k, (element, exit_) in enumerate(exits)
        for share in exit_.shares
    ]
    pushing = [(k, *given) for k, (element, exit_) in enumerate(exits) for given in force_shares(level, element, exit_)]
    position, rate = np.zeros((2, count, own.modes))
    constant = np.array([exit_.constant for _, exit_ in exits], float)
    size = np.abs(constant)
    k, link, gap, speed = _columns(moving, 4)
    np.add.at(position, k, gap[:, None] * own.gap_rows[link])
    np.add.at(rate, k, speed[:, None] * own.gap_rows[link])
    closing = gap * level.gap_constants[link]
    constant += np.bincount(k, closing, count)
    size += np.bincount(k, np.abs(closing), count)
    k, place, force = _columns(pushing, 3)
    np.add.at(position, k, force[:, None] * own.force_rows[place])
    np.add.at(rate, k, force[:, None] * own.force_rate_rows[place])
    pressing = force * level.asymptotic.forces[place]
    constant += np.bincount(k, pressing, count)
    size += np.bincount(k, np.abs(pressing), count)
    return position, rate, drop_round_off(constant, size)


def _columns(rows: Sequence[tuple[float, ...]], width: int) -> list[np.ndarray]:
    """Columns of a table: two of places, the others of numbers."""
    table = np.array(rows, float).reshape(-1, width).T
    return [table[0].astype(int), table[1].astype(int), *table[2:]]


def force_shares(level: LoadedLevel, element: int, exit_: Exit) -> list[tuple[int, float]]:
    """Of the forces of links that hold in a level, by their places among these, what counts in an exit's signal."""
    links, places = level.level.base.link_places[element], level.level.indices
    return [(places.index(links[share.link]), share.force) for share in exit_.shares if share.force]


def signal_rows(level: LoadedLevel) -> list[Row]:
    """s of all exits of a level, which keeps them."""
    if "signals" not in level.entries:
        table = signal_table(level, exits_of(level))
        level.entries["signals"] = [Row(position, rate, float(c)) for position, rate, c in zip(*table, strict=True)]
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
