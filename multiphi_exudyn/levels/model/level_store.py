"""Level store: the base that models of one structure and the same contacts share."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.levels.base.build_base import COMPLETE, build_base
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.levels.model.mode_choice import FIRST
from multiphi_exudyn.mathematics.blas_threads import one_blas_thread
from multiphi_exudyn.mathematics.lowest_modes import missing_flexibility
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.element import Element
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["LevelStore", "differ_in_gaps"]

CACHE_BYTES = 2**30  # of the cached levels of a model, with their data: 1 GiB, which leaves room on a laptop
FEWEST_LEVELS = 8  # cached whatever their size: a run that alternates between them would else rebuild them


class LevelStore:
    """Base of a structure with contacts, built on first use.

    first: number of modes for which an incomplete base is built if no number is given. chosen: the number chosen then,
    None before. base: None before it is built. load_rows: rows (k, n) of loads for the base. narrow: the model without
    these rows. earlier: a store whose modes and rows are reused, if it is of the same structure.
    """

    def __init__(
        self, structure: LinearStructure, contacts: Sequence[Element], earlier: LevelStore | None = None
    ) -> None:
        self.structure, self.contacts = structure, contacts
        self.first, self.chosen = FIRST, None  # type: int, int | None
        self.base: ModalBase | None = None
        self.load_rows: np.ndarray | None = None
        self.narrow: Any = None
        self._previous_base: ModalBase | None = None
        self._missing: dict[bytes, float] = {}
        self._made: dict[Hashable, core.ModalLevels] = {}  # by what modes they keep
        self._lent: dict[Hashable, core.ModalLevels] = {}
        if earlier is not None and earlier.structure is structure:
            self.load_rows, self.narrow, self._previous_base = (
                earlier.load_rows,
                earlier.narrow,
                earlier.base or earlier._previous_base,
            )

    def borrow(self, other: LevelStore) -> None:
        """Use the base and the levels of a store whose contacts differ in their gaps alone."""
        assert other.base is not None, "there is nothing to borrow"
        self.first, self.chosen, self.base = other.first, other.chosen, other.base.with_gaps_of(self.contacts)
        self._lent = {**other._lent, **other._made}

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_made": {}, "_lent": {}}  # a copy builds its own

    def levels_of(self, kept: Hashable, make: Callable[[], core.ModalLevels]) -> core.ModalLevels:
        """Return the levels in the core, those of a model with other gaps if it has some that keep the same modes."""
        levels = self._lent.get(kept) or make()
        self._made[kept] = levels
        return levels

    def built_base(self, modes: int | None) -> ModalBase:
        """Return the base, built on first use for levels with so many modes, None for all."""
        if self.base is None:
            given = self.structure, self.contacts, modes or "all", self._previous_base, self.load_rows
            with one_blas_thread() if self.structure.n <= COMPLETE else nullcontext():
                self.base = build_base(*given)
            self._previous_base = None
        return self.base

    def serves(self, modes: int | None) -> bool:
        """Return whether the base is good for levels with so many modes, None for all."""
        base = self.base
        return base is not None and (base.complete or (modes is not None and modes <= base.most_level_modes))

    def cache_capacity(self, r: int) -> int:
        """Return the number of levels with r modes that fit into ``CACHE_BYTES``, with their data."""
        assert self.base is not None, "levels need a base"
        numbers_per_mode = self.base.modes.count + 30 * r + 2 * len(self.base.links)
        return max(FEWEST_LEVELS, CACHE_BYTES // (8 * r * numbers_per_mode))

    def outside(self, row: np.ndarray) -> float:
        """Return the share of the static flexibility at a row (n,) that the base does not represent."""
        base, key = self.base, row.tobytes()
        if base is None or base.complete:
            return 0.0
        if key not in self._missing:
            shares = missing_flexibility(self.structure.mass, self.structure.stiffness, base.modes, row[None, :])
            self._missing[key] = float(shares[0])
        return self._missing[key]


def differ_in_gaps(some: Sequence[Element], others: Sequence[Element]) -> bool:
    """Return whether the elements of two models are the same but for the gaps of contacts."""
    return len(some) == len(others) and all(map(_alike_but_gap, some, others))


def _alike_but_gap(one: Element, other: Element) -> bool:
    if one is other:
        return True
    if not isinstance(one, UnilateralContact) or type(one) is not type(other):
        return False
    names = [field.name for field in dataclasses.fields(UnilateralContact) if field.name != "gap"]
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)
