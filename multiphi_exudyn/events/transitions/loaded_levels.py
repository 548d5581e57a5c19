"""Loaded levels: those of one model under the loads of a run, and the maps between them.

All of it is made when it is asked for, and kept as long as the model's bound allows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import State
from multiphi_exudyn.events.transitions.transition import Transition
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.search.signal_bounds import power_of_two_above

__all__ = ["LoadedLevels"]

STARTS = 4  # ends of runs for which it is kept what starts are judged by
TOLD = 16  # of what was told of runs
FURTHER = 8  # of a level: of two steps of a solver, with what is attached at two places

T = TypeVar("T")


@dataclass
class _Known:
    """What is kept of a level: ``links`` that hold in it, maps to other levels by their states.

    further: what others make of it, by their keys.
    """

    level: LoadedLevel
    links: tuple[int, ...]
    ways: dict[tuple[int, ...], Transition] = field(default_factory=dict)
    further: BoundedCache[Hashable, Any] = field(default_factory=lambda: BoundedCache(FURTHER))


class LoadedLevels:
    """Levels of ``model`` under an excitation, for motions from ``time`` to ``until`` [s]; drive: at ``time``.

    A level goes by the states of all elements, a number each. alone: those under its static loads alone, with held
    places for channels, which outlast a run; these where nothing varies.
    lasting: the longest time [s] that a motion takes.
    arrays: what the loop keeps of them, for later runs (level_arrays.py). held: the same under forces that bodies hold
    for a step (modal_force.py). starts: what starts are judged by, by the end [s] of their run (simulate.py). told:
    what is told alike of runs in the same levels (run_warnings.py).
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
        self.set_out(time, until)
        self.arrays: Any = None
        self.held: Any = None
        self.starts = BoundedCache[float, Any](STARTS)
        self.told = BoundedCache[Hashable, Any](TOLD)
        self._known = BoundedCache[tuple[int, ...], _Known](model.most_levels, self._close)
        self._pushed = BoundedCache[tuple[int, ...], LoadedLevel](model.most_levels)

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "arrays": None, "held": None}

    @classmethod
    def static(cls, model: MultiPhiModel, load: np.ndarray, lasting: float = math.inf) -> LoadedLevels:
        """Levels under a static ``load`` (m,) in base coordinates alone, for motions of a time [s] at most."""
        return cls(model, Excitation.constant(load, len(model.links), model.held), lasting=lasting)

    @classmethod
    def under(
        cls, model: MultiPhiModel, excitation: Excitation, time: float, end: float, lasting: float = math.inf
    ) -> LoadedLevels:
        """Levels under an excitation, for motions from a time [s] to an end, each of a time [s] at most.

        Those under its static loads are kept by the model: the maps between them serve every run.
        """
        load, longest = excitation.static, _longest(model, lasting)
        key = load.tobytes(), longest
        alone: LoadedLevels = model.loaded.get_or_build(key, lambda: cls.static(model, load, longest))
        return cls(model, excitation, time, end, alone) if excitation.prescribed else alone

    def set_out(self, time: float, until: float) -> None:
        """Take another time and end [s] for the motions that follow."""
        self.drive, self.until = self.excitation.drive(time), until

    @property
    def kept_arrays(self) -> list[Any]:
        """Those that are kept, under held forces too."""
        return [arrays for arrays in (self.arrays, getattr(self.held, "arrays", None)) if arrays is not None]

    def let_go(self, arrays: Any) -> None:
        """Keep these arrays no longer; who works on them has them still."""
        if self.arrays is arrays:
            self.arrays = None
        else:
            self.held = None

    @property
    def isolated(self) -> bool:
        """Whether nothing works on the structure from outside, so that it has no more energy than at its start."""
        return self.excitation.nothing and not (self.model.general or self.model.overrides)

    @property
    def load(self) -> np.ndarray:
        """The static load (m,)."""
        return self.excitation.static

    def level(self, states: Sequence[int]) -> LoadedLevel:
        """The level of elements in these states, under the loads and what they push."""
        known = self._of(tuple(states))
        self.model.level_at(known.links)  # of the levels that the model keeps it is now the one used last
        return known.level

    def further(self, states: tuple[int, ...], key: Hashable, make: Callable[[], T]) -> T:
        """What others make of a level, by a key of theirs that says all it depends on; kept with the level."""
        made: T = self._of(states).further.get_or_build(key, make)
        return made

    def forget(self, links: tuple[int, ...]) -> None:
        """Let go of what is kept of the levels in which these links hold."""
        for states in [states for states, known in self._known.items() if known.links == links]:
            self._known.drop(states)
        for states in [states for states, level in self._pushed.items() if level.level.indices == links]:
            self._pushed.drop(states)

    def _of(self, states: tuple[int, ...]) -> _Known:
        return self._known.get_or_build(states, lambda: self._loaded(states))

    def _loaded(self, states: tuple[int, ...]) -> _Known:
        level = self.alone.pushed(states)
        links = level.level.indices
        under = self.alone is not self or self.model.general
        return _Known(level.under(self.excitation) if under else level, links)

    def pushed(self, states: tuple[int, ...]) -> LoadedLevel:
        """The level under the static loads and what elements push, without any channel; kept for all excitations.

        What elements push is among its loads, and not among those of a level with channels.
        """
        return self._pushed.get_or_build(states, lambda: self._made(states))

    def _made(self, states: tuple[int, ...]) -> LoadedLevel:
        level = self.model.level_at(self.model.active_links(states))
        if self.model.general:
            return LoadedLevel.of(level, self.load + self.model.push(states), states, lasting=self.lasting)
        return LoadedLevel.of(level, self.load, states, self.excitation, self.lasting)

    def with_channels(self, state: State) -> State:
        """A state under the static loads alone as one of these levels, at the time at which they set out."""
        level, r = self.level(state.level.states), state.level.modal.modes
        w, w_t, _ = self.drive.values
        x, v = state.displacement, state.velocity
        xi, xi_t = np.concatenate([x[:r], w, x[r:]]), np.concatenate([v[:r], w_t, v[r:]])
        return State(level, xi, xi_t, state.phases)

    def without_channels(self, state: State) -> State:
        """eta, the held places, and their rates alone, in the level under static loads alone."""
        r, places = state.level.modal.modes, self.excitation.prescribed
        x, v = (np.delete(xi, slice(r, r + places)) for xi in (state.displacement, state.velocity))
        return State(self.alone.level(state.level.states), x, v, state.phases)

    def _close(self, states: tuple[int, ...], gone: _Known) -> None:
        """The ways to a level that is not kept any more."""
        for _, known in self._known.items():
            known.ways.pop(states, None)

    @property
    def levels_kept(self) -> int:
        """Number of levels of which something is kept."""
        return len(self._known)

    @property
    def ways(self) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
        """From and to which levels, by their states, maps are kept."""
        return [(source, target) for source, known in self._known.items() for target in known.ways]

    def transition(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        """The map between two levels, computed once as long as they are kept."""
        ways = self._of(source.states).ways
        if target.states not in ways:
            ways[target.states] = Transition(source, target)
        return ways[target.states]


def _longest(model: MultiPhiModel, lasting: float) -> float:
    """A power of two [s] above a time, at which motions of that time are looked at; infinite where it does not count.

    It counts where the structure, or an element, may damp zero-frequency modes.
    """
    base = model.base
    rigid = base.modes.rigid
    damped = rigid > 0 and (np.any(base.damping[:rigid, :rigid]) or np.any(base.dampings))
    return power_of_two_above(lasting) if damped and lasting < math.inf else math.inf
