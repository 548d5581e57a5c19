"""Exit table: the description of the exits of a model's elements in all of their states, made once.

The exits of a level are those of the states of its elements, in the order of the elements.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.transitions.exits import ExitShares
from multiphi_exudyn.mechanics.elements.element import Element, Exit, link_indices

__all__ = ["ExitTable"]


class ExitTable:
    """All exits of elements, in the order of the elements and of their states.

    described: (e, 3) the element of each, the number of the state requested, and its firmness.
    """

    def __init__(self, elements: Sequence[Element]) -> None:
        entries = [
            (i, state, exit_)
            for i, element in enumerate(elements)
            for state, element_state in enumerate(element.states)
            for exit_ in element_state.exits
        ]
        self._numbers = np.arange(len(elements) + 1)
        self._exits = [exit_ for _, _, exit_ in entries]
        self._turns = [k for k, exit_ in enumerate(self._exits) if exit_.turn is not None]
        self._states = np.array([state for _, state, _ in entries], int)
        self._shares = ExitShares.of(link_indices(elements), [(i, exit_) for i, _, exit_ in entries])
        numbers = [{state.name: number for number, state in enumerate(element.states)} for element in elements]
        described = [(i, numbers[i][exit_.asked], exit_.firmness) for i, _, exit_ in entries]
        self.described = np.array(described, int).reshape(-1, 3)

    def of(self, states: Sequence[int]) -> np.ndarray:
        """Return which of the exits (e,) belong to elements in these states."""
        return np.asarray(self._states == np.array(states, int)[self.described[:, 0]])

    def shares(self, kept: np.ndarray) -> ExitShares:
        """Return the shares of the signals of those that are ``kept`` (e,)."""
        return self._shares.selected(kept)

    def firsts(self, kept: np.ndarray) -> np.ndarray:
        """Return the index (c + 1,) of the first kept exit of every element; the last entry is their number."""
        return self.described[kept, 0].searchsorted(self._numbers)

    def turning(self, kept: np.ndarray) -> list[tuple[int, Exit]]:
        """Return the kept exits whose requested state depends on a velocity, with their indices among those kept."""
        if not self._turns:
            return []
        numbers = np.cumsum(kept) - 1
        return [(int(numbers[k]), self._exits[k]) for k in self._turns if kept[k]]
