"""Rule of contacts with springs, for runs that are integrated step by step (stepwise.py), without the code of events.

    s = g open, s = -g closed;   s = row . z + constant,   z = (eta, eta'),   z' = A z + b   in a level

A contact is armed while s >= 0, and requests a change when s falls through zero. It changes unless s in the new level
is negative and falling; if several cannot change together, the first that can change alone does. If s is negative after
a change, the contact recovers while s rises. A contact whose request was refused waits until s, or s in the level of
its request, has risen to zero. The sign of s is that of its first derivative that is not round-off.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.state import Phase, State

__all__ = ["Signal", "SpringRule"]

ROUND_OFF = 1e-13  # of its terms: a smaller sum has no sign
DERIVATIVES = 6  # number of derivatives for the sign
ROUNDS = 20  # of decisions at one instant


@dataclass(frozen=True)
class Signal:
    """Signal s = row . z + constant, row (2 r,)."""

    row: np.ndarray
    constant: float

    def __neg__(self) -> Signal:
        return Signal(-self.row, -self.constant)

    @property
    def rate(self) -> Signal:
        """Time derivative of a signal that does not depend on velocities."""
        return Signal(np.concatenate([np.zeros(len(self.row) // 2), self.row[: len(self.row) // 2]]), 0.0)

    def at(self, z: np.ndarray) -> float:
        """Value at the state z (2 r,)."""
        return float(self.row @ z) + self.constant


@dataclass(frozen=True)
class _Motion:
    """z and its derivatives (k, 2 r) at an instant, and the sizes of their terms."""

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
        self._levels = LoadedLevels.static(model, np.zeros(model.base.modes.count))

    def start(self, displacement: np.ndarray) -> State:
        """The first state of a run from rest at y (m,) in base coordinates."""
        base = self.model.base
        level = self.level(np.flatnonzero(base.directions.T @ displacement + base.gaps < 0).tolist())
        eta = level.level.vectors.T @ (displacement - level.asymptotic.configuration)
        return self._resolve_refused(self._with_phases(State(level, eta, np.zeros_like(eta), ())), set())

    def decide(self, state: State, requesting: set[int]) -> State:
        """State right after an instant at which these contacts request a change."""
        return self._resolve_refused(self._change_requested(state, requesting), set(requesting))

    def level(self, closed: Iterable[int]) -> LoadedLevel:
        """The level with these contacts closed."""
        states = np.zeros(len(self.model.contacts), int)
        states[list(closed)] = 1
        return self._levels.level(states.tolist())

    def signal(self, level: LoadedLevel, contact: int) -> Signal:
        """s of a contact in a level."""
        plain = level.level
        open_ = Signal(np.pad(plain.gap_rows[contact], (0, plain.modes)), float(level.gap_constants[contact]))
        return -open_ if contact in plain.indices else open_

    def entered_signal(self, level: LoadedLevel, contact: int) -> Signal:
        """s of a contact after its change, as a signal of the state before the change."""
        target = self.level({contact}.symmetric_difference(level.level.indices))
        (matrix, offset), there = _transition(level, target), self.signal(target, contact)
        row = there.row[: target.level.modes]
        return Signal(np.pad(row @ matrix, (0, level.level.modes)), there.constant + float(row @ offset))

    def _resolve_refused(self, state: State, treated: set[int]) -> State:
        """State after the requests of all contacts that are refused at this instant."""
        for _ in range(ROUNDS):
            untreated = {i for i, phase in enumerate(state.phases) if phase is Phase.REFUSED} - treated
            if not untreated:
                return state
            treated |= untreated
            state = self._change_requested(state, untreated)
        raise NumericalFailure("contacts: no set of closed contacts is admissible at this instant")

    def _change_requested(self, state: State, requesting: set[int]) -> State:
        """State after a change of the requesting contacts, or of those, or the first one, that the new level admits."""
        candidates = [requesting]
        while candidates:
            changing = candidates.pop(0)
            entered = self._with_phases(self._after_change(state, changing))
            refused = {i for i in changing if entered.phases[i] is Phase.REFUSED}
            if not refused:
                return entered
            if refused < changing:
                candidates = [changing - refused]
            elif len(changing) > 1:
                candidates = [{i} for i in sorted(changing)]
        return self._with_phases(state, requesting)

    def _after_change(self, state: State, changing: set[int]) -> State:
        """State in the level after the change of these contacts (eq. 38.6)."""
        level = self.level(changing.symmetric_difference(state.level.level.indices))
        matrix, offset = _transition(state.level, level)
        displacement, velocity = matrix @ state.displacement + offset, matrix @ state.velocity
        return replace(state, level=level, displacement=displacement, velocity=velocity)

    def _with_phases(self, state: State, refused: Iterable[int] = ()) -> State:
        """State with the phase of every contact; refused: contacts whose request was refused."""
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

    At a turning point displacement or velocity may be round-off, so the sizes include the other one, scaled by omega.
    """
    plain, (eta, eta_t) = state.level.level, (state.displacement, state.velocity)
    identity, omega = np.eye(plain.modes), plain.omega
    a = np.block([[0 * identity, identity], [-np.diag(omega**2), -plain.damping]])
    periods = np.divide(1.0, omega, out=np.zeros(plain.modes), where=omega > 0)
    values = [np.concatenate([eta, eta_t])]
    sizes = [np.concatenate([np.abs(eta) + periods * np.abs(eta_t), np.abs(eta_t) + omega * np.abs(eta)])]
    constant = np.concatenate([np.zeros(plain.modes), state.level.asymptotic.drive])
    for _ in range(DERIVATIVES):
        values.append(a @ values[-1] + constant)
        sizes.append(np.abs(a) @ sizes[-1] + np.abs(constant))
        constant = np.zeros(2 * plain.modes)
    return _Motion(np.array(values), np.array(sizes))


def _transition(source: LoadedLevel, target: LoadedLevel) -> tuple[np.ndarray, np.ndarray]:
    """T = Psi_m^T Psi_l and c = Psi_m^T (y_l - y_m) of eq. (38.6)."""
    jump = source.asymptotic.configuration - target.asymptotic.configuration
    return target.level.vectors.T @ source.level.vectors, target.level.vectors.T @ jump
