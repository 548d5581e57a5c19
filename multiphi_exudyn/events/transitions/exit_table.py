"""Exit table: what describes the exits of a model's elements in all of their states, made once.

A level's are those of the states that its elements are in, in the order of the elements.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.transitions.exits import ExitShares
from multiphi_exudyn.mechanics.element import Element, Exit, link_indices

__all__ = ["ExitTable"]


class ExitTable:
    """All exits of elements, in the order of these and of their states.

    described: (e, 3) the element of each, the number of the state that it asks for, and its firmness.
    """

    def __init__(self, elements: Sequence[Element]) -> None:
        given = [
            (i, state, exit_)
            for i, element in enumerate(elements)
            for state, own in enumerate(element.states)
            for exit_ in own.exits
        ]
        self._numbers = np.arange(len(elements) + 1)
        self._exits = [exit_ for _, _, exit_ in given]
        self._turns = [k for k, exit_ in enumerate(self._exits) if exit_.turn is not None]
        self._states = np.array([state for _, state, _ in given], int)
        self._shares = ExitShares.of(link_indices(elements), [(i, exit_) for i, _, exit_ in given])
        numbers = [{state.name: number for number, state in enumerate(element.states)} for element in elements]
        described = [(i, numbers[i][exit_.asked], exit_.firmness) for i, _, exit_ in given]
        self.described = np.array(described, int).reshape(-1, 3)

    def of(self, states: Sequence[int]) -> np.ndarray:
        """Which of them (e,) are exits of elements in these states."""
        return np.asarray(self._states == np.array(states, int)[self.described[:, 0]])

    def shares(self, kept: np.ndarray) -> ExitShares:
        """What the signals of those that are ``kept`` (e,) are sums of."""
        return self._shares.taken(kept)

    def firsts(self, kept: np.ndarray) -> np.ndarray:
        """The first one (c + 1,) of every element among those that are kept, and how many these are."""
        return self.described[kept, 0].searchsorted(self._numbers)

    def turning(self, kept: np.ndarray) -> list[tuple[int, Exit]]:
        """Those that a speed may turn, by their numbers among those that are kept."""
        if not self._turns:
            return []
        numbers = np.cumsum(kept) - 1
        return [(int(numbers[k]), self._exits[k]) for k in self._turns if kept[k]]
