"""A model's base and its number of modes, shared with other models of the same structure and contacts."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from multiphi_exudyn.levels.level_store import LevelStore
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.mode_choice import SMALL, TRIED, Tolerance, UpTo, chosen_modes
from multiphi_exudyn.mechanics.element_table import ElementTable
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["SharedBase"]


class SharedBase(ElementTable):
    """What a model (model.py) takes from its store, and says of its number of modes."""

    structure: LinearStructure
    modes: int | str | UpTo | Tolerance | None
    _store: LevelStore | None
    _decisions: list[Any]

    @functools.cached_property
    def base(self) -> ModalBase:
        """Coordinates common to all levels, built on first use."""
        _ = self._chosen if self.modes is None else None  # it may need a larger one
        return self._shared_base()

    def _shared_base(self) -> ModalBase:
        """The base of all models that share levels with this one."""
        store = self._shared
        return store.base or store.built(store.first if self.modes is None else self.most_modes)

    @property
    def _shared(self) -> LevelStore:
        """What is shared with other models."""
        assert self._store is not None, "a model begins with a store"
        return self._store

    def _begin_anew(self) -> LevelStore:
        """A store without levels; what is known of the structure is taken over."""
        store = LevelStore(self.structure, self.contacts, self._store)
        object.__setattr__(self, "_store", store)
        return store

    @property
    def most_modes(self) -> int | None:
        """The largest number of modes that a level is asked for, chosen where none was given; None: it has all of them.

        Of a Tolerance that has not decided yet it is the number that its runs begin with.
        """
        if self.modes is None:
            return self._chosen
        if self._decisions:
            return self._decisions[0].most_modes
        if isinstance(self.modes, str):
            return None
        most = self.modes.most if isinstance(self.modes, (UpTo, Tolerance)) else int(self.modes)
        most = min(most, TRIED) if isinstance(self.modes, Tolerance) else most
        return most if most < self.structure.n else None

    @property
    def _chosen(self) -> int | None:
        """The number of modes where none was given."""
        if self.structure.n <= SMALL:
            return None
        while self._shared.chosen is None:
            base = self._shared_base()
            found = chosen_modes(self.structure, base, self._shared.level)
            if self._shared.serves(found):
                self._shared.chosen = found
            else:
                self._begin_anew().first = found
        return self._shared.chosen

    @property
    def whole(self) -> bool:
        """Whether no level leaves out a mode of the structure."""
        return self.most_modes is None and not isinstance(self.modes, UpTo) and self.base.complete

    def lacking(self, rows: np.ndarray) -> list[np.ndarray]:
        """Those of some rows (k, n) for which an incomplete base has not been made, zero ones left out."""
        if self.base.complete:
            return []
        links = [self.structure.row(link.direction) for link in self.links]
        known = np.vstack([self.base.further, self.structure.point_rows, *links])
        return [row for row in rows if np.any(row) and not np.any(np.all(row == known, axis=1))]

    def outside(self, row: np.ndarray) -> float:
        """Share of the static flexibility at a row (n,) that the base does not hold."""
        _ = self.base
        return self._shared.outside(row)

    def _can_share(self) -> bool:
        """Whether the levels built for another number of modes serve this model too."""
        store = self._store
        if store is None or store.structure is not self.structure or store.contacts != self.contacts:
            return False
        return store.base is not None and (self.modes is None or store.serves(self.most_modes))
