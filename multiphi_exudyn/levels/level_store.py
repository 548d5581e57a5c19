"""Level store: the base and the levels that models of one structure and the same contacts share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from multiphi_exudyn.levels.build_base import build_base
from multiphi_exudyn.levels.build_level import build_level
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.mode_choice import FIRST
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.eigenproblems.lowest_modes import left_out
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["LevelStore"]

CACHE_BYTES = 2**30  # that the levels of a model may take, with what is kept beside them: 1 GiB leaves room on a laptop
FEWEST_LEVELS = 8  # kept whatever they take: a run that goes to and fro between a few would build them at every event


class LevelStore:
    """Base and levels of a structure with contacts, built when they are asked for.

    first: modes that an incomplete base is built for where no number is given. chosen: the number chosen then, None
    before. base: None before it is built. further: rows (k, n) of loads that the base is to hold. narrow: the model of
    which this store's is the same with those rows. earlier: a store whose modes and rows are taken over, if it is of
    the same structure.
    """

    def __init__(
        self, structure: LinearStructure, contacts: Sequence[Element], earlier: LevelStore | None = None
    ) -> None:
        self.structure, self.contacts = structure, contacts
        self.first, self.chosen = FIRST, None  # type: int, int | None
        self.base: ModalBase | None = None
        self.further: np.ndarray | None = None
        self.narrow: Any = None
        self._less: ModalBase | None = None
        self._levels: BoundedCache[tuple[int, ...], Level] | None = None
        self._outside: dict[bytes, float] = {}
        if earlier is not None and earlier.structure is structure:
            self.further, self.narrow, self._less = earlier.further, earlier.narrow, earlier.base or earlier._less

    def built(self, modes: int | None) -> ModalBase:
        """The base, built for levels with so many modes at first use, None for all."""
        if self.base is None:
            self.base = build_base(self.structure, self.contacts, modes or "all", self._less, self.further)
            self._less = None
        return self.base

    def serves(self, modes: int | None) -> bool:
        """Whether levels with so many modes may be taken from the base, None for all."""
        base = self.base
        return base is not None and (base.complete or (modes is not None and modes <= base.served))

    def most_kept(self, r: int) -> int:
        """Number of levels with r modes that ``CACHE_BYTES`` hold, with what is kept beside them."""
        assert self.base is not None, "levels are kept where there is a base"
        of_a_mode = self.base.modes.count + 30 * r + 2 * len(self.base.links)
        return max(FEWEST_LEVELS, CACHE_BYTES // (8 * r * of_a_mode))

    def level(self, indices: tuple[int, ...], modes: int) -> Level:
        """A level with its lowest so many modes at least, or all that it has."""
        base, levels = self.base, self._levels
        assert base is not None, "levels are built where there is a base"
        if levels is None:
            levels = self._levels = BoundedCache(self.most_kept(modes))
        most = base.modes.count - sum(base.links[i].rigid for i in indices)
        needed, found, further = min(modes, most), levels.find(indices), 1
        while found is None or (found.modes < most and (found.modes < needed or found.apart(needed) is None)):
            wanted = needed + further
            found = levels.keep(indices, build_level(base, indices, wanted if wanted < most else None))
            further *= 2
        return found

    def outside(self, row: np.ndarray) -> float:
        """Share of the static flexibility at a row (n,) that the base does not hold."""
        base, key = self.base, row.tobytes()
        if base is None or base.complete:
            return 0.0
        if key not in self._outside:
            found = left_out(self.structure.mass, self.structure.stiffness, base.modes, row[None, :])
            self._outside[key] = float(found[0])
        return self._outside[key]
