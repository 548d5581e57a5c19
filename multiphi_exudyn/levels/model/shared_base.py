"""A model's base and its number of modes, shared with other models of the same structure and contacts."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.model.level_store import LevelStore, differ_in_gaps
from multiphi_exudyn.levels.model.mode_choice import SMALL, TRIED, Tolerance, UpTo, choose_mode_count
from multiphi_exudyn.mechanics.element_table import ElementTable
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["SharedBase"]


class SharedBase(ElementTable):
    """The part of a model (model.py) that holds its base and its number of modes, from its level store."""

    structure: LinearStructure
    modes: int | str | UpTo | Tolerance | None
    _store: LevelStore | None
    _decisions: list[Any]

    @functools.cached_property
    def base(self) -> ModalBase:
        """Coordinates common to all levels, built on first use."""
        _ = self._chosen_modes if self.modes is None else None  # the choice may need a larger base
        return self._shared_base()

    def _shared_base(self) -> ModalBase:
        """Return the base of all models that share levels with this one."""
        store = self._shared_store
        return store.base or store.built_base(store.first if self.modes is None else self.most_modes)

    @property
    def _shared_store(self) -> LevelStore:
        """Store that this model shares with other models."""
        assert self._store is not None, "a model has a store"
        return self._store

    def _new_store(self) -> LevelStore:
        """Replace the store by one without levels, which reuses the modes of the structure, and return it."""
        store = LevelStore(self.structure, self.contacts, self._store)
        object.__setattr__(self, "_store", store)
        return store

    @property
    def most_modes(self) -> int | None:
        """Largest number of modes of a level, chosen where none was given; None for all.

        For a Tolerance without a run it is the number of modes of its first run.
        """
        if self.modes is None:
            return self._chosen_modes
        if self._decisions:
            return self._decisions[0].most_modes
        if isinstance(self.modes, str):
            return None
        most = self.modes.most if isinstance(self.modes, (UpTo, Tolerance)) else int(self.modes)
        most = min(most, TRIED) if isinstance(self.modes, Tolerance) else most
        return most if most < self.structure.n else None

    @property
    def _chosen_modes(self) -> int | None:
        """Number of modes, chosen where none was given; None for all."""
        if self.structure.n <= SMALL:
            return None
        while self._shared_store.chosen is None:
            base = self._shared_base()
            count = choose_mode_count(self.structure, base)
            if self._shared_store.serves(count):
                self._shared_store.chosen = count
            else:
                self._new_store().first = count
        return self._shared_store.chosen

    @property
    def whole(self) -> bool:
        """Whether every level has all modes of the structure."""
        return self.most_modes is None and not isinstance(self.modes, UpTo) and self.base.complete

    def lacking(self, rows: np.ndarray) -> list[np.ndarray]:
        """Return those rows (k, n), without zero ones, that an incomplete base does not represent."""
        if self.base.complete:
            return []
        links = [self.structure.row(link.direction) for link in self.links]
        represented = np.vstack([self.base.load_rows, self.structure.point_rows, *links])
        return [row for row in rows if np.any(row) and not np.any(np.all(row == represented, axis=1))]

    def outside(self, row: np.ndarray) -> float:
        """Return the share of the static flexibility at a row (n,) that the base does not represent."""
        _ = self.base
        return self._shared_store.outside(row)

    def _differs_in_gaps_from(self, store: LevelStore) -> bool:
        """Return whether this model can use what a store has for contacts with other gaps."""
        if store.structure is not self.structure or store.base is None or store.contacts == self.contacts:
            return False
        if not differ_in_gaps(self.contacts, store.contacts):
            return False
        return self.modes is None or store.serves(self.most_modes)

    def _can_share(self) -> bool:
        """Return whether this model can use the levels that its store has for another number of modes."""
        store = self._store
        if store is None or store.structure is not self.structure or store.contacts != self.contacts:
            return False
        return store.base is not None and (self.modes is None or store.serves(self.most_modes))
