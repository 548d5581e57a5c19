"""Exit table: the description of the exits of a model's elements in all of their states, made once.

The exits of a level are those of the states of its elements, in the order of the elements.
"""

from __future__ import annotations

import itertools
import operator
from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.transitions.exits import ExitShares
from multiphi_exudyn.mechanics.elements.element import Element, Exit, link_indices

__all__ = ["ExitTable"]


class ExitTable:
    """All exits of elements, in the order of the elements and of their states.

    described: (e, 4) the element and state of each, the number of the state requested, and its firmness. shares: of
    their signals. rated: whether a signal has a share of a link's q'.
    """

    def __init__(self, elements: Sequence[Element]) -> None:
        entries = [
            (i, state, exit_)
            for i, element in enumerate(elements)
            for state, element_state in enumerate(element.states)
            for exit_ in element_state.exits
        ]
        numbers = [{state.name: number for number, state in enumerate(element.states)} for element in elements]
        described = [(i, state, numbers[i][exit_.asked], exit_.firmness) for i, state, exit_ in entries]
        self.described = np.array(described, int).reshape(-1, 4)
        self.shares = ExitShares.of(link_indices(elements), [(i, exit_) for i, _, exit_ in entries])
        self.rated = any(share.rate for _, _, exit_ in entries for share in exit_.shares)
        self._counts = [[len(state.exits) for state in element.states] for element in elements]
        self._turns = any(exit_.turn is not None for _, _, exit_ in entries)
        self._elements = elements

    def count(self, states: Sequence[int]) -> int:
        """Return the number of exits of elements in these states."""
        return sum(itertools.starmap(operator.getitem, zip(self._counts, states, strict=True)))

    def turning(self, states: Sequence[int]) -> list[tuple[int, int, Exit]]:
        """Return the exits in these states whose requested state depends on a velocity: their numbers and elements."""
        if not self._turns:
            return []
        given = enumerate(zip(self._elements, states, strict=True))
        exits = [(i, exit_) for i, (element, state) in given for exit_ in element.states[state].exits]
        return [(number, i, exit_) for number, (i, exit_) in enumerate(exits) if exit_.turn is not None]
