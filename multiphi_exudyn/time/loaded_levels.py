"""Loaded levels: the levels of one model under the loads of a run.

The core builds each when it is first used, and keeps those of static loads for later runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.levels.core_model import core_model
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.round_off import power_of_two_above
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.state import State

__all__ = ["LoadedLevels"]

DERIVED_KEPT = 8  # derived values of a level: two step sizes of a solver, attachments at two positions
MOST_BYTES = 2**29  # of the core's levels that are kept between runs: half of what a model may keep

T = TypeVar("T")


@dataclass
class _LevelEntry:
    """A level, and values derived from it elsewhere, by their keys."""

    level: LoadedLevel
    further: BoundedCache[Hashable, Any] = field(default_factory=lambda: BoundedCache(DERIVED_KEPT))


class LoadedLevels:
    """Levels of ``model`` under an excitation, for motions from ``time`` to ``until`` [s]; drive: at ``time``.

    The key of a level is the state numbers of all elements. alone: the levels under the static loads alone, with held
    displacements as channels, which are kept longer than a run; it is these levels if nothing varies. lasting: the
    longest duration [s] of a motion. held: the same under forces that bodies hold for a step (coupled.py).
    """

    def __init__(
        self,
        model: MultiPhiModel,
        excitation: Excitation,
        time: float = 0.0,
        until: float = math.inf,
        alone: LoadedLevels | None = None,
        lasting: float = math.inf,
    ) -> None:
        self.model = model
        self.excitation = excitation
        self.alone = alone or self
        self.lasting = lasting
        self.set_interval(time, until)
        self.held: Any = None
        self._entries = BoundedCache[tuple[int, ...], _LevelEntry](model.most_levels)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "held": None, "_core": None}  # a copy makes its own

    @classmethod
    def static(cls, model: MultiPhiModel, load: np.ndarray, lasting: float = math.inf) -> LoadedLevels:
        """Return levels under a static ``load`` (m,) in base coordinates, for motions of a duration [s] at most."""
        return cls(model, Excitation.constant(load, len(model.links), model.held), lasting=lasting)

    @classmethod
    def under(
        cls, model: MultiPhiModel, excitation: Excitation, time: float, end: float, lasting: float = math.inf
    ) -> LoadedLevels:
        """Return levels under an excitation, for motions from a time [s] to an end, of a duration [s] at most.

        The model keeps those under its static loads: they serve every run.
        """
        load, longest = excitation.static, _longest_motion(model, lasting)
        key = load.tobytes(), longest
        alone: LoadedLevels = model.loaded.get_or_build(key, lambda: cls.static(model, load, longest))
        return cls(model, excitation, time, end, alone, longest) if excitation.prescribed else alone

    def set_interval(self, time: float, until: float) -> None:
        """Set the time and end [s] of the motions that follow."""
        self.drive, self.until = self.excitation.drive(time), until
        self._core: core.Levels | None = None

    @property
    def in_core(self) -> core.Levels:
        """The core's levels for these motions, kept for later runs up to a bound."""
        if self._core is None or self._core.bytes > MOST_BYTES:
            self._core = core.Levels(core_model(self.model), self.core_excitation(), self.lasting)
        return self._core

    def core_excitation(self) -> core.Excitation:
        """Return the static and varying loads, from the start of the motions until these end."""
        return self.excitation.in_core(self.drive.time, self.until, self.isolated)

    @property
    def isolated(self) -> bool:
        """Whether no load acts on the structure, so that its energy never exceeds that at its start."""
        return self.excitation.nothing and not (self.model.general or self.model.overrides)

    @property
    def load(self) -> np.ndarray:
        """The static load (m,)."""
        return self.excitation.static

    def level(self, states: Sequence[int]) -> LoadedLevel:
        """Return the level of elements in these states, under the loads and the constant forces of elements."""
        return self._entry(tuple(states)).level

    def kept(self, states: tuple[int, ...]) -> LoadedLevel | None:
        """Return the level of elements in these states if it is among those that are kept."""
        entry = self._entries.find(states)
        return None if entry is None else entry.level

    def further(self, states: tuple[int, ...], key: Hashable, make: Callable[[], T]) -> T:
        """Return a value derived from a level, by a key of all it depends on; made once, kept with the level."""
        value: T = self._entry(states).further.get_or_build(key, make)
        return value

    def _entry(self, states: tuple[int, ...]) -> _LevelEntry:
        return self._entries.get_or_build(states, lambda: self._build_entry(states))

    def _build_entry(self, states: tuple[int, ...]) -> _LevelEntry:
        of_core = self.in_core.level(states)
        return _LevelEntry(LoadedLevel(self.model.level_at(of_core.links), self.excitation, of_core))

    def with_channels(self, state: State) -> State:
        """Return a state under the static loads alone as a state of these levels, at the start of their interval."""
        level, r = self.level(state.level.states), state.level.modal.modes
        w, w_t, _ = self.drive.values
        x, v = state.displacement, state.velocity
        xi, xi_t = np.concatenate([x[:r], w, x[r:]]), np.concatenate([v[:r], w_t, v[r:]])
        return State(level, xi, xi_t, state.phases)

    def without_channels(self, state: State) -> State:
        """Return eta, the held displacements and their rates alone, in the level under static loads alone."""
        r, places = state.level.modal.modes, self.excitation.prescribed
        x, v = (np.delete(xi, slice(r, r + places)) for xi in (state.displacement, state.velocity))
        return State(self.alone.level(state.level.states), x, v, state.phases)

    @property
    def levels_kept(self) -> int:
        """Number of levels that are kept."""
        return len(self._entries)


def _longest_motion(model: MultiPhiModel, lasting: float) -> float:
    """Return a power of two [s] above a duration, for motions of that duration at most; infinite if it does not matter.

    It matters if the structure, or an element, may damp zero-frequency modes.
    """
    base = model.base
    rigid = base.modes.rigid
    damped = rigid > 0 and (np.any(base.damping[:rigid, :rigid]) or np.any(base.dampings))
    return power_of_two_above(lasting) if damped and lasting < math.inf else math.inf
