"""Exits: the ways out of the states of a level's elements, and what their signals say of the level's motion.

    s = gap q + rate q' + force lambda + constant,   q, lambda linear in xi, xi'    (mechanics/element.py)

An exit whose element may not leave asks what it would say in the level entered: that of the exit that leads back.
"""

from __future__ import annotations

import numpy as np

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.events.transition import Transition
from multiphi_exudyn.mathematics.round_off import drop_round_off, sign_of
from multiphi_exudyn.mechanics.element import ElementState, Exit

__all__ = [
    "after",
    "asked_alone",
    "entered_row",
    "exits_of",
    "force_shares",
    "signal_row",
    "signal_rows",
    "state_of",
    "way_back",
]


def state_of(level: LoadedLevel, element: int) -> ElementState:
    """The state in which an element is in a level."""
    return level.level.base.contacts[element].states[level.states[element]]


def exits_of(level: LoadedLevel) -> list[tuple[int, Exit]]:
    """All exits of a level, in the order of its elements, with their positions."""
    return [(i, exit_) for i in range(len(level.states)) for exit_ in state_of(level, i).exits]


def after(level: LoadedLevel, element: int, exit_: Exit) -> tuple[int, ...]:
    """The states of all elements after one has taken an exit."""
    names = [state.name for state in level.level.base.contacts[element].states]
    states = list(level.states)
    states[element] = names.index(exit_.asked)
    return tuple(states)


def asked_alone(exit_: Exit) -> Exit:
    """The exit by which an element is asked in the level entered alone.

    A contact that would slide is asked where it does: to stick would take its speed away.
    """
    return exit_ if exit_.turn is None else Exit(exit_.turn.forward)


def signal_row(level: LoadedLevel, element: int, exit_: Exit) -> Row:
    """s of an element's exit in a level; a load that is a limit leaves no round-off of both."""
    own, terms = level.level, [exit_.constant]
    position, rate = np.zeros(own.modes), np.zeros(own.modes)
    for share in exit_.shares:
        link = own.base.link_places[element][share.link]
        position, rate = position + share.gap * own.gap_rows[link], rate + share.rate * own.gap_rows[link]
        terms.append(share.gap * float(level.gap_constants[link]))
    for k, force in force_shares(level, element, exit_):
        position, rate = position + force * own.force_rows[k], rate + force * own.force_rate_rows[k]
        terms.append(force * float(level.asymptotic.forces[k]))
    return Row(position, rate, float(drop_round_off(np.sum(terms), np.sum(np.abs(terms)))))


def force_shares(level: LoadedLevel, element: int, exit_: Exit) -> list[tuple[int, float]]:
    """Of the forces of links that hold in a level, by their places among these, what counts in an exit's signal."""
    links, places = level.level.base.link_places[element], level.level.indices
    return [(places.index(links[share.link]), share.force) for share in exit_.shares if share.force]


def signal_rows(level: LoadedLevel) -> list[Row]:
    """s of all exits of a level, which keeps them."""
    if "signals" not in level.entries:
        level.entries["signals"] = [signal_row(level, element, exit_) for element, exit_ in exits_of(level)]
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
