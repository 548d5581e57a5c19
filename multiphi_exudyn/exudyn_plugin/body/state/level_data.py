"""Level data: the numbers in the data node of a body, which describe its level.

(c,)      number of every element's state: of a contact 0 open, 1 closed
(e,)      phase of every exit: 0 armed, 1 recovering, 2 refused, 3 held back; zeros beyond the exits of the level
(h,) [m]  stick positions of the links that have one
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.transitions.state import Phase, State
from multiphi_exudyn.levels.model.model import MultiPhiModel

__all__ = ["LevelData"]

PHASES = tuple(Phase)


class LevelData:
    """Layout of a model's level data; width: c + e + h, e the largest number of exits of a level; held_count: h."""

    def __init__(self, model: MultiPhiModel) -> None:
        self._exits = [[len(state.exits) for state in contact.states] for contact in model.contacts]
        self._count, exit_count = len(self._exits), sum(max(exits) for exits in self._exits)
        self._held_slice = slice(self._count + exit_count, self._count + exit_count + len(model.held))
        self.width, self.held_count = self._held_slice.stop, len(model.held)

    def from_state(self, state: State) -> np.ndarray:
        """Data (width,) of a state."""
        phases = np.array([[PHASES.index(phase) for phase in state.phases]])
        return self.rows(state.states, phases, state.held[None])[0]

    def rows(self, states: Sequence[int], phases: np.ndarray, held: np.ndarray) -> np.ndarray:
        """Data (n, width) of n states of one level, with phase numbers (n, k) and stick positions (n, h)."""
        data = np.zeros((len(held), self.width))
        data[:, : self._count], data[:, self._held_slice] = states, held
        data[:, self._count : self._count + phases.shape[1]] = phases
        return data

    def states(self, data: np.ndarray) -> np.ndarray:
        """Numbers (.., c) of the elements' states in data (.., width)."""
        return np.rint(data[..., : self._count]).astype(int)

    def held(self, data: np.ndarray) -> np.ndarray:
        """Stick positions (.., h) [m] in data (.., width)."""
        return np.asarray(data[..., self._held_slice])

    def read(self, data: np.ndarray) -> tuple[tuple[int, ...], tuple[Phase, ...], np.ndarray]:
        """States, phases and stick positions in data (width,)."""
        states = tuple(self.states(data).tolist())
        exits = sum(self._exits[i][state] for i, state in enumerate(states))
        phases = data[self._count : self._count + exits].tolist()
        return states, tuple(PHASES[round(phase)] for phase in phases), self.held(data).copy()
