"""Rule of contacts with springs, for runs that are integrated step by step (stepwise.py), without the code of events.

    s = g open, s = -g closed;   s = row . z + constant,   z = (eta, eta'),   z' = A z + b   in a level

A contact is armed while s >= 0, and asks where s falls through zero. It changes unless s in the level it would enter is
negative and falling; of several that may not together, the first that may alone. Where s is negative after a change it
recovers while s rises, and where it asked in vain it is refused: it waits for s, or for s in the level it would enter,
to rise to zero. A sign is that of the first derivative that is not round-off.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Phase, State
from multiphi_exudyn.events.transition import Transition
from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["Signal", "SpringRule"]

ROUND_OFF = 1e-13  # of its terms: a sum below it has no sign
DERIVATIVES = 6  # that are asked for a sign
ROUNDS = 20  # of decisions at one instant


@dataclass(frozen=True)
class Signal:
    """row . z + constant, row (2 r,)."""

    row: np.ndarray
    constant: float

    def __neg__(self) -> Signal:
        return Signal(-self.row, -self.constant)

    @property
    def rate(self) -> Signal:
        """Its time derivative, where it does not depend on velocities."""
        return Signal(np.concatenate([np.zeros(len(self.row) // 2), self.row[: len(self.row) // 2]]), 0.0)

    def at(self, z: np.ndarray) -> float:
        """Its value."""
        return float(self.row @ z) + self.constant


@dataclass(frozen=True)
class _Motion:
    """z and its derivatives (k, 2 r) at an instant, and of which terms they are the sums."""

    values: np.ndarray
    sizes: np.ndarray

    def signs(self, signal: Signal) -> list[int]:
        """Signs of a signal and its derivatives, zero for round-off."""
        constants = np.eye(len(self.values))[0] * signal.constant
        values, sizes = self.values @ signal.row + constants, self.sizes @ np.abs(signal.row) + np.abs(constants)
        return np.where(np.abs(values) <= ROUND_OFF * sizes, 0, np.sign(values)).astype(int).tolist()


class SpringRule:
    """The rule for a model without loads whose contacts all have springs."""

    def __init__(self, model: MultiPhiModel) -> None:
        self.model = model
        self._levels: dict[tuple[int, ...], LoadedLevel] = {}
        self._ways: dict[tuple[tuple[int, ...], tuple[int, ...]], Transition] = {}

    def start(self, displacement: np.ndarray) -> State:
        """The first state of a run from rest at y (m,) in base coordinates."""
        base = self.model.base
        level = self.level(np.flatnonzero(base.directions.T @ displacement + base.gaps < 0).tolist())
        eta = level.level.vectors.T @ (displacement - level.asymptotic.configuration)
        return self._settled(self._standing(State(level, eta, np.zeros_like(eta), ())), set())

    def decide(self, state: State, asking: set[int]) -> State:
        """The state right after an instant at which these contacts ask to change."""
        return self._settled(self._answered(state, asking), set(asking))

    def level(self, closed: Iterable[int]) -> LoadedLevel:
        """The level with these contacts closed."""
        key = tuple(sorted(closed))
        if key not in self._levels:
            self._levels[key] = LoadedLevel.of(self.model.level_at(key), np.zeros(self.model.base.modes.count))
        return self._levels[key]

    def signal(self, level: LoadedLevel, contact: int) -> Signal:
        """s of a contact in a level."""
        own = level.level
        open_ = Signal(np.pad(own.gap_rows[contact], (0, own.modes)), float(level.gap_constants[contact]))
        return -open_ if contact in own.indices else open_

    def entered_signal(self, level: LoadedLevel, contact: int) -> Signal:
        """s that it would have after a change, of the state in the level before."""
        target = self.level({contact}.symmetric_difference(level.level.indices))
        move, there = self._way(level, target), self.signal(target, contact)
        row = there.row[: target.level.modes]
        return Signal(np.pad(row @ move.matrix, (0, level.level.modes)), there.constant + float(row @ move.offset))

    def _way(self, source: LoadedLevel, target: LoadedLevel) -> Transition:
        key = source.level.indices, target.level.indices
        if key not in self._ways:
            self._ways[key] = Transition(source, target)
        return self._ways[key]

    def _settled(self, state: State, heard: set[int]) -> State:
        """The state after all who are refused at its instant have been heard too."""
        for _ in range(ROUNDS):
            unheard = {i for i, phase in enumerate(state.phases) if phase is Phase.REFUSED} - heard
            if not unheard:
                return state
            heard |= unheard
            state = self._answered(state, unheard)
        raise NumericalFailure("contacts: no set of closed contacts is admissible at this instant")

    def _answered(self, state: State, asking: set[int]) -> State:
        """Those that ask change, or those of them, or the first of them, that the level they enter admits."""
        wishes = [asking]
        while wishes:
            wished = wishes.pop(0)
            entered = self._standing(self._moved(state, wished))
            denied = {i for i in wished if entered.phases[i] is Phase.REFUSED}
            if not denied:
                return entered
            if denied < wished:
                wishes = [wished - denied]
            elif len(wished) > 1:
                wishes = [{i} for i in sorted(wished)]
        return self._standing(state, asking)

    def _moved(self, state: State, changing: set[int]) -> State:
        """The state in the level in which these contacts have changed (eq. 38.6)."""
        level = self.level(changing.symmetric_difference(state.level.level.indices))
        move = self._way(state.level, level)
        displacement, velocity = move.displacement(state.displacement), move.velocity(state.velocity)
        return replace(state, level=level, displacement=displacement, velocity=velocity)

    def _standing(self, state: State, refused: Iterable[int] = ()) -> State:
        """The state with the phase of every contact; ``refused``: those that asked in vain."""
        motion = _motion(state)
        phases = [self._phase(motion, state, contact) for contact in range(len(self.model.contacts))]
        for contact in refused:
            phases[contact] = Phase.ARMED if phases[contact] is Phase.ARMED else Phase.REFUSED
        return replace(state, phases=tuple(phases))

    def _phase(self, motion: _Motion, state: State, contact: int) -> Phase:
        value, *derivatives = motion.signs(self.signal(state.level, contact))
        rate = next((sign for sign in derivatives if sign), 0)
        if value > 0 or (value == 0 and rate >= 0):
            return Phase.ARMED
        return Phase.RECOVERING if rate > 0 else Phase.REFUSED


def _motion(state: State) -> _Motion:
    """z, A z + b, A (A z + b), ... at a state.

    Of a state between swings either half may be round-off: what the other one makes of it, by omega, counts too.
    """
    own, (eta, eta_t) = state.level.level, (state.displacement, state.velocity)
    identity, omega = np.eye(own.modes), own.omega
    a = np.block([[0 * identity, identity], [-np.diag(omega**2), -own.damping]])
    periods = np.divide(1.0, omega, out=np.zeros(own.modes), where=omega > 0)
    values = [np.concatenate([eta, eta_t])]
    sizes = [np.concatenate([np.abs(eta) + periods * np.abs(eta_t), np.abs(eta_t) + omega * np.abs(eta)])]
    constant = np.concatenate([np.zeros(own.modes), state.level.asymptotic.drive])
    for _ in range(DERIVATIVES):
        values.append(a @ values[-1] + constant)
        sizes.append(np.abs(a) @ sizes[-1] + np.abs(constant))
        constant = np.zeros(2 * own.modes)
    return _Motion(np.array(values), np.array(sizes))
