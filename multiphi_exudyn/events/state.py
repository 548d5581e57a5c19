"""State of the reduced model at an instant, the events that change it, and the signals they are read from."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np

from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.first_descent import DescentFinder, Signals
from multiphi_exudyn.mathematics.round_off import CLEAR, sign_of

__all__ = ["Change", "Event", "Loss", "Phase", "Row", "Rows", "SignalTable", "State", "event_table"]


class Phase(Enum):
    """What a contact waits for; see events/rule.py."""

    ARMED = "armed"
    RECOVERING = "recovering"
    REFUSED = "refused"
    HELD_BACK = "held back"


@dataclass(frozen=True)
class State:
    """level, modal displacement and velocity (r,), phase of every contact (c,)."""

    level: LoadedLevel
    displacement: np.ndarray
    velocity: np.ndarray
    phases: tuple[Phase, ...]

    @property
    def closed(self) -> tuple[int, ...]:
        """Positions of the closed contacts."""
        return self.level.level.indices

    @property
    def kinetic(self) -> float:
        """Kinetic energy [J]."""
        return float(self.level.kinetic(self.velocity))

    @property
    def potential(self) -> float:
        """Strain energy less the potential of static loads [J]; a transition can only lower it."""
        return self.level.potential(self.displacement)

    @functools.cached_property
    def reach(self) -> np.ndarray:
        """How far (r,) the velocities carry the modes: |eta'| / omega, zero where nothing oscillates."""
        omega = self.level.level.omega
        return np.divide(np.abs(self.velocity), omega, out=np.zeros(len(omega)), where=omega > 0)

    @functools.cached_property
    def swing(self) -> np.ndarray:
        """How fast (r,) the displacements make the modes: omega |eta|."""
        return np.abs(self.level.level.omega * self.displacement)

    @functools.cached_property
    def acceleration(self) -> np.ndarray:
        """eta'' (r,)."""
        return self.level.acceleration(self.displacement, self.velocity)

    @functools.cached_property
    def accelerating(self) -> np.ndarray:
        """Of which terms (r,) the accelerations are the sums, and omega |eta'|, how large the velocities make them."""
        own = self.level.level
        speeds = np.abs(self.velocity)
        forced = np.abs(self.level.asymptotic.drive) + np.abs(own.damping) @ speeds
        return np.asarray(np.abs(own.squares * self.displacement) + own.omega * speeds + forced)

    @property
    def basis(self) -> Exponentials:
        """The exponentials of the motion that starts here."""
        return self.level.level.response.basis

    @property
    def shapes(self) -> np.ndarray:
        """V (r, p): eta is the real part of V times coefficients times exponentials."""
        return self.level.level.response.shapes

    @property
    def finder(self) -> DescentFinder:
        """Event location on these exponentials."""
        return self.level.level.finder

    def coefficients(self) -> np.ndarray:
        """Coefficients (p,) of the exponentials for the motion that starts here."""
        drive = self.level.asymptotic.drive
        return self.level.level.response.coefficients(
            self.displacement, self.velocity, drive if self.level.driven else None
        )

    @property
    def terms(self) -> np.ndarray:
        """Of which terms (p,) the coefficients are the sums."""
        return np.abs(self.coefficients())

    def after(self, coefficients: np.ndarray, t: float) -> State:
        """The state a time t [s] later, of the motion with these coefficients."""
        displacement, velocity = self.level.level.response.state(coefficients, t)
        return State(self.level, displacement, velocity, self.phases)


@dataclass(frozen=True)
class Loss:
    """Energy [J] that left the model at an event: plastic impact, and what truncated bases dropped.

    stop_work: what moving stops, or what hangs on its points in Exudyn, put into it by impulses, no loss. damping: the
    strain of viscous contacts that change inside their stop (contact.py).
    """

    impact: float = 0.0
    truncation_kinetic: float = 0.0
    truncation_strain: float = 0.0
    stop_work: float = 0.0
    damping: float = 0.0

    def __add__(self, other: Loss) -> Loss:
        return Loss(
            self.impact + other.impact,
            self.truncation_kinetic + other.truncation_kinetic,
            self.truncation_strain + other.truncation_strain,
            self.stop_work + other.stop_work,
            self.damping + other.damping,
        )

    @property
    def total(self) -> float:
        """Sum of all that was lost [J]."""
        return self.impact + self.truncation_kinetic + self.truncation_strain + self.damping


@dataclass(frozen=True)
class Change:
    """One contact's change of state at an instant: its position, "close" | "open", impulse of its impact [N s].

    shared: position and impulse of contacts that stay closed in that impact, carried by the first change.
    """

    contact: int
    kind: str
    impulse: float = 0.0
    shared: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class Event:
    """A contact changed state.

    time [s]; contact: its name; kind: "close" | "open"; loss: the energy [J] of the whole instant, carried by its
    first event; impulse [N s] of the impact. A rebound within one instant is a "close" and an "open" of equal time.
    shared: name and impulse of contacts that are closed and stay so in the impact, carried by its first event.
    """

    time: float
    contact: str
    kind: str
    loss: Loss
    impulse: float = 0.0
    shared: tuple[tuple[str, float], ...] = ()

    @property
    def energy_loss(self) -> float:
        """Total energy lost [J]."""
        return self.loss.total


def event_table(events: Sequence[Event], index: Callable[[str], int]) -> np.ndarray:
    """Time [s], position of the contact, impulse [N s] and energy lost to truncation [J] of every event, (k, 4).

    Some events are kept in arrays (time/record.py).
    """
    kept = getattr(events, "table", None)
    if kept is not None:
        return np.asarray(kept())
    lost = ((e.loss.truncation_kinetic + e.loss.truncation_strain, e) for e in events)
    return np.array([(e.time, index(e.contact), e.impulse, energy) for energy, e in lost]).reshape(-1, 4)


@dataclass(frozen=True)
class Row:
    """A linear function of a level's modal state: position.eta + rate.eta' + constant."""

    position: np.ndarray
    rate: np.ndarray
    constant: float

    def __neg__(self) -> Row:
        return Row(-self.position, -self.rate, -self.constant)

    def __call__(self, displacement: np.ndarray, velocity: np.ndarray) -> float:
        return float(self.position @ displacement + self.rate @ velocity) + self.constant

    def sign(self, displacement: np.ndarray, velocity: np.ndarray, reach: np.ndarray) -> int:
        """Sign of the value, zero where it is round-off of its terms; reach: displacements (r,) of the motion.

        At the root of a signal all displacements may be round-off of what they were before.
        """
        terms, size = self.position * displacement, float(self._sizes.dot(reach))
        return sign_of(terms + self.rate * velocity if self._rated else terms, self.constant, size)

    def rate_sign(self, velocity: np.ndarray, acceleration: np.ndarray, swing: np.ndarray) -> int:
        """Sign of the time derivative, zero where it is round-off of its terms; swing: speeds (r,) of the motion.

        At a turning point all velocities may be round-off of what they were before.
        """
        terms = self.position * velocity
        size = float(self._sizes.dot(swing))
        return sign_of(terms + self.rate * acceleration if self._rated else terms, 0.0, size)

    @functools.cached_property
    def _rated(self) -> bool:
        return bool(np.any(self.rate))

    @functools.cached_property
    def _sizes(self) -> np.ndarray:
        return np.abs(self.position)


@dataclass(frozen=True)
class Rows:
    """Linear functions of one level's modal state together: position (k, r), rate (k, r) or None for none, constant.

    What most contacts need at most instants, whether a value is positive beyond doubt, is one product for all.
    """

    position: np.ndarray
    rate: np.ndarray | None
    constant: np.ndarray

    @classmethod
    def of(cls, rows: Sequence[Row], modes: int) -> Rows:
        """``rows`` of a level with so many modes."""
        position = np.array([row.position for row in rows]).reshape(len(rows), modes)
        rate = np.array([row.rate for row in rows]).reshape(len(rows), modes)
        return cls(position, rate if np.any(rate) else None, np.array([row.constant for row in rows]))

    def beside(self, others: Rows) -> Rows:
        """These, then the others."""
        known = [rows.rate if rows.rate is not None else np.zeros_like(rows.position) for rows in (self, others)]
        rate = None if self.rate is None and others.rate is None else np.vstack(known)
        position = np.vstack([self.position, others.position])
        return Rows(position, rate, np.concatenate([self.constant, others.constant]))

    def some(self, places: list[int]) -> Rows:
        """Those at these places."""
        rate = None if self.rate is None else self.rate[places]
        return Rows(self.position[places], rate if np.any(rate) else None, self.constant[places])

    def clear(self, displacement: np.ndarray, velocity: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """Which of them (k,) ``Row.sign`` calls positive, whatever the order in which their terms are added."""
        value = self.position @ displacement + self.constant
        if self.rate is not None:
            value = value + self.rate @ velocity
        return np.asarray(value > CLEAR * self.sizes(displacement, velocity, reach))

    def sizes(self, displacement: np.ndarray, velocity: np.ndarray, reach: np.ndarray) -> np.ndarray:
        """Of which terms (k,) their values are the sums, as in ``Row.sign``."""
        position, rate = self._magnitudes
        size = position @ (np.abs(displacement) + reach) + np.abs(self.constant)
        return np.asarray(size if rate is None else size + rate @ np.abs(velocity))

    def rate_sizes(self, velocity: np.ndarray, acceleration: np.ndarray, swing: np.ndarray) -> np.ndarray:
        """Of which terms (k,) their time derivatives are the sums, as in ``Row.rate_sign``."""
        position, rate = self._magnitudes
        size = position @ (np.abs(velocity) + swing)
        return np.asarray(size if rate is None else size + rate @ np.abs(acceleration))

    @functools.cached_property
    def _magnitudes(self) -> tuple[np.ndarray, np.ndarray | None]:
        return np.abs(self.position), None if self.rate is None else np.abs(self.rate)


class SignalTable:
    """Linear functions of a level's state, ready to become signals of time for any motion on its basis.

    basis, shapes: exponentials and V (r, p), as in State. rows: the functions.
    rates: those whose time derivative is meant.
    """

    def __init__(self, basis: Exponentials, shapes: np.ndarray, rows: Rows, rates: list[bool]) -> None:
        self._basis = basis
        self._rows = rows
        self._position = rows.position @ shapes
        self._rate = None if rows.rate is None else rows.rate @ shapes
        self._rates = np.flatnonzero(rates)
        self._constants = np.where(rates, 0.0, rows.constant)

    def sizes(self, state: State) -> np.ndarray:
        """Of which terms (k, p) the coefficients of the signals are the sums; of none is the rate meant."""
        terms = np.abs(self._position) * state.terms
        return (
            terms if self._rate is None else terms + self._basis.bounding.derivative(np.abs(self._rate) * state.terms)
        )

    def signals(self, coefficients: np.ndarray, state: State) -> Signals:
        """The signals of the motion with these coefficients (p,), which starts at ``state``."""
        values = self._position * coefficients
        if self._rate is not None:
            values = values + self._basis.derivative(self._rate * coefficients)
        noise = CLEAR * self._rows.sizes(state.displacement, state.velocity, state.reach)
        if len(self._rates):
            values[self._rates] = self._basis.derivative(values[self._rates])
            meant = self._rows.some(self._rates.tolist())
            noise[self._rates] = CLEAR * meant.rate_sizes(state.velocity, state.acceleration, state.swing)
        return Signals(values, self._constants, noise)
