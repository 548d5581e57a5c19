"""The event rule under an excitation: its levels, transitions and signals are those in xi = (eta, w)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import Phase, SignalTable, State
from multiphi_exudyn.events.transition import LoadedLevel, Transition
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.first_descent import DescentFinder
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.time.driven.excitation import Excitation
from multiphi_exudyn.time.driven.flow import Basis
from multiphi_exudyn.time.driven.level import DrivenLevel, DrivenTransition
from multiphi_exudyn.time.driven.state import DrivenState

__all__ = ["DrivenRule"]


class DrivenRule(EventRule):
    """The rule ``plain`` under an excitation as well, for motions from ``time`` to ``until`` [s].

    drive: at ``time``.
    """

    def __init__(self, plain: EventRule, excitation: Excitation, time: float, until: float) -> None:
        super().__init__(plain.model, plain.load)
        self.plain = plain
        self.excitation = excitation
        self.set_out(time, until)
        self.finders = BoundedCache[tuple[tuple[int, ...], Basis], DescentFinder](plain.model.most_levels)

    def set_out(self, time: float, until: float) -> None:
        """Take another time and end [s] for the motions that follow."""
        self.drive, self.until = self.excitation.drive(time), until

    def level(self, closed: Iterable[int]) -> DrivenLevel:
        """The level with these contacts closed, under the static loads and the excitation."""
        level = super().level(closed)
        assert isinstance(level, DrivenLevel)
        return level

    def _loaded(self, closed: tuple[int, ...]) -> DrivenLevel:
        return DrivenLevel.under(self.plain.level(closed), self.excitation)

    def _map(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        assert isinstance(source, DrivenLevel)
        assert isinstance(target, DrivenLevel)
        return DrivenTransition(source, target)

    def watch(self, state: State, phases: tuple[Phase, ...]) -> tuple[list[tuple[int, bool]], SignalTable]:
        """Signals whose first descent is next, with (contact, whether it then asks to change or is armed)."""
        waiting, rows, rates = self.watched(state.level, phases)
        return waiting, SignalTable(state.basis, state.shapes, rows, rates)

    @property
    def stop_speeds(self) -> np.ndarray:
        """Velocities (c,) [m/s] of the stops at the start, along h."""
        return np.asarray(self.excitation.stops @ self.drive.values[1])

    def potential(self, displacement: np.ndarray, penetrating: Sequence[int]) -> float:
        """Strain energy less the potential of the loads [J] at the start of a configuration y (m,)."""
        base, values = self.model.base, self.drive.values[0]
        strain = base.strain(displacement, penetrating, base.gaps - self.excitation.stops @ values)
        return strain - float(self.excitation.load(values) @ displacement)

    def _entered(self, level: LoadedLevel, displacement: np.ndarray, velocity: np.ndarray) -> State:
        assert isinstance(level, DrivenLevel)
        (w, w_t, _), modes = self.drive.values, level.plain.level.modes
        vectors, shown = level.plain.level.vectors.T, level.level.vectors[:, modes:]
        rest = level.asymptotic.configuration
        size = np.linalg.norm(displacement) + np.linalg.norm(rest) + np.linalg.norm(shown @ w)
        eta = drop_round_off(vectors @ (displacement - rest - shown @ w), size)
        eta_t = vectors @ (velocity - level.carried @ w_t)
        return self.state(State(level.plain, eta, eta_t, (Phase.ARMED,) * len(self._rigid)))

    def state(self, plain: State) -> DrivenState:
        """A state eta, eta' of a level under static loads as one under the drive."""
        w, w_t, _ = self.drive.values
        return DrivenState(
            level=self.level(plain.closed),
            displacement=np.concatenate([plain.displacement, w]),
            velocity=np.concatenate([plain.velocity, w_t]),
            phases=plain.phases,
            drive=self.drive,
            until=self.until,
            finders=self.finders,
        )

    @staticmethod
    def _free(level: LoadedLevel) -> int:
        assert isinstance(level, DrivenLevel)
        return level.plain.level.modes

    @staticmethod
    def _plastic(lost: float, speeds: np.ndarray, impulses: np.ndarray) -> float:
        return -0.5 * float(impulses @ speeds)
