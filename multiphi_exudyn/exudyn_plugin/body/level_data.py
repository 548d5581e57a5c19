"""Level data: what the data node of a body holds of its level.

the number of every element's state (c,): of a contact 0 open, 1 closed,
the phase of every exit (e,): 0 armed, 1 recovering, 2 refused, 3 held back; behind those of a level zeros,
the places that links hold (h,) [m]
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.state import Phase, State
from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["LevelData"]

PHASES = tuple(Phase)


class LevelData:
    """The layout of a model's level data; width: c + e + h, e the most exits of a level; places: h."""

    def __init__(self, model: MultiPhiModel) -> None:
        self._exits = [[len(state.exits) for state in contact.states] for contact in model.contacts]
        self._count, most = len(self._exits), sum(max(exits) for exits in self._exits)
        self._places = slice(self._count + most, self._count + most + len(model.held))
        self.width, self.places = self._places.stop, len(model.held)

    def of(self, state: State) -> np.ndarray:
        """The data (width,) of a state."""
        phases = np.array([[PHASES.index(phase) for phase in state.phases]])
        return self.rows(state.states, phases, state.held[None])[0]

    def rows(self, states: Sequence[int], phases: np.ndarray, held: np.ndarray) -> np.ndarray:
        """The data (n, width) of n states of one level, with phases (n, k) in numbers and places (n, h)."""
        found = np.zeros((len(held), self.width))
        found[:, : self._count], found[:, self._places] = states, held
        found[:, self._count : self._count + phases.shape[1]] = phases
        return found

    def states(self, data: np.ndarray) -> np.ndarray:
        """Numbers (.., c) of states in data (.., width)."""
        return np.rint(data[..., : self._count]).astype(int)

    def held(self, data: np.ndarray) -> np.ndarray:
        """Places (.., h) [m] in data (.., width)."""
        return np.asarray(data[..., self._places])

    def read(self, data: np.ndarray) -> tuple[tuple[int, ...], tuple[Phase, ...], np.ndarray]:
        """States, phases and places of data (width,)."""
        states = tuple(self.states(data).tolist())
        exits = sum(self._exits[i][state] for i, state in enumerate(states))
        phases = data[self._count : self._count + exits].tolist()
        return states, tuple(PHASES[round(phase)] for phase in phases), self.held(data).copy()
