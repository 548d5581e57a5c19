"""Excitation: time-varying loads and moving supports of one run, and levels under them (eqs. 38.1, 38.4).

Everything that varies is a channel w_k(t), k = 1 ... q, a history each:

    load          f = ... + b_k w_k                 b_k a pattern (m,) in base coordinates
    moving stop   g_i = h_i.x + gap_i - s_ik w_k    s_k (c,); for rigid and viscous contacts w_k' is a channel too

A level carries them as prescribed coordinates: xi = (eta, w), x = Psi eta + y_inf + R w, with

    R w = (K_l^-1 - Psi omega^-2 Psi^T) (b w + k h s w)  +  Y w

The first part is the quasi-static deflection of the modes left out (its inertia is neglected, its strain and the work
of the load on it are not). Y holds the motion of rigid stops, the static shapes of eq. (38.5) with x_k(t); it has
inertia:

    eta'' + D eta' + omega^2 eta = P w + Q w',   P = Psi^T (b + k h s),   on w' as a channel of its own
                                                 P = Psi^T (c h s - C Y),   Q = -Psi^T Y

In xi every gap and contact force is again linear, so rows, maps between levels, events and energies are those of
levels under static loads, with q more columns.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.courses import Course, Sampled
from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.force_law import LawSpring
from multiphi_exudyn.history import History, differentiated, translated
from multiphi_exudyn.level import Level, cleared
from multiphi_exudyn.loads import BaseMotion, ConstantLoad, Gravity, Load, StopMotion, VaryingLoad
from multiphi_exudyn.model import MultiPhiModel
from multiphi_exudyn.transition import LoadedLevel, Transition

__all__ = ["Drive", "DrivenLevel", "DrivenTransition", "Excitation", "ExtendedLevel", "static_load"]


@dataclass(frozen=True)
class Drive:
    """The channels from an instant on: w(time + t) = Re sum_j exp(mu_j t) sum_d a_jd t^d up to ``until`` [s].

    terms: (mu_j, a_j (D + 1, q)).
    """

    time: float
    until: float
    terms: tuple[tuple[complex, np.ndarray], ...]

    @functools.cached_property
    def values(self) -> np.ndarray:
        """w, w', w'' (3, q) at the instant."""
        result = np.zeros((3, self.terms[0][1].shape[1]))
        for rate, given in self.terms:
            first = differentiated(rate, given)
            result += np.array([given[0], first[0], differentiated(rate, first)[0]]).real
        return result

    def after(self, t: float) -> Drive:
        """The same from a time t [s] later."""
        return Drive(self.time + t, self.until, tuple((rate, translated(rate, a, t)) for rate, a in self.terms))


@dataclass(frozen=True, eq=False)
class Excitation:
    """See the module's docstring.

    static: constant loads (m,) in base coordinates. patterns: b (m, q). stops: s (c, q). histories: w (q,).
    rate_of: for every channel the channel that is its derivative, -1 where none is needed.
    """

    static: np.ndarray
    patterns: np.ndarray
    stops: np.ndarray
    histories: tuple[History, ...]
    rate_of: tuple[int, ...]

    @classmethod
    def of(cls, model: MultiPhiModel, loads: Sequence[Load], end: float, finer: float = 1.0) -> Excitation:
        """The loads of a run of ``model`` until ``end`` [s], smooth courses to their tolerance / finer."""
        if not isinstance(loads, Iterable):
            raise MultiPhiTypeError(f"loads: got {type(loads).__name__}, need a sequence of loads")
        base, channels = model.base, _Channels(model, end, finer)
        for load in loads:
            channels.add(load)
        channels.add_static(static_load(model, loads))
        patterns = _columns(channels.patterns, base.modes.count)
        stops = _columns(channels.stops, len(model.contacts))
        return cls(channels.static, patterns, stops, tuple(channels.histories), tuple(channels.rate_of))

    @property
    def channels(self) -> int:
        """Number of channels q."""
        return len(self.histories)

    def drive(self, time: float) -> Drive:
        """The channels from a time on, until the first of their pieces ends."""
        pieces = [history.local(time) for history in self.histories]
        terms = {}
        for rate in dict.fromkeys(piece.rate for piece in pieces):
            degree = max(len(piece.coefficients) for piece in pieces if piece.rate == rate)
            terms[rate] = np.zeros((degree, len(pieces)), complex)
        for channel, piece in enumerate(pieces):
            terms[piece.rate][: len(piece.coefficients), channel] = piece.coefficients
        return Drive(time, min(piece.until for piece in pieces), tuple(terms.items()))

    @property
    def stop_ways(self) -> np.ndarray:
        """Bound (c,) [m] of how far every stop moves."""
        return np.asarray(np.abs(self.stops) @ np.array([history.largest for history in self.histories]))

    def values(self, times: np.ndarray) -> np.ndarray:
        """w, w' (k, 2, q) at times (k,)."""
        found = [(history.at(times), history.derivative.at(times)) for history in self.histories]
        return np.array(found).reshape(self.channels, 2, len(times)).transpose(2, 1, 0)

    def load(self, values: np.ndarray) -> np.ndarray:
        """All loads (m,) at an instant with channels w (q,)."""
        return np.asarray(self.static + self.patterns @ values)


class _Channels:
    """Loads as channels, one after the other."""

    def __init__(self, model: MultiPhiModel, end: float, finer: float) -> None:
        self._model, self._end, self._finer = model, end, finer
        self.patterns: list[np.ndarray] = []
        self.stops: list[np.ndarray] = []
        self.histories: list[History] = []
        self.rate_of: list[int] = []

    def add(self, load: Load) -> None:
        """One load's channels; static loads have none."""
        if isinstance(load, VaryingLoad):
            self._append(self._row(load.at), self._no_stop(), self._history(load.course))
        elif isinstance(load, StopMotion):
            self._check_stop(load.contact)
            stop = self._no_stop()
            stop[self._model.index(load.contact)] = 1.0
            self._move(stop, load.course)
        elif isinstance(load, BaseMotion):
            self._shake(load)
        elif not isinstance(load, (ConstantLoad, Gravity)):
            raise MultiPhiTypeError(
                f"loads: got {type(load).__name__}, need ConstantLoad, Gravity, HarmonicLoad, SampledLoad, "
                "FunctionLoad, SweepLoad, StopMotion or BaseMotion"
            )

    def add_static(self, load: np.ndarray) -> None:
        """Constant loads (m,); those that pull at damped rigid-body motion are a channel too.

        Its free response reads p t / d - p (1 - exp(-d t)) / d^2, which loses round-off / (d t)^2 for little damping d;
        the response to a channel does not.
        """
        base, self.static = self._model.base, load
        rigid = base.modes.rigid
        if np.any(base.damping[:rigid]) and np.any(load[:rigid]):
            self._append(load, self._no_stop(), History.constant(1.0))
            self.static = np.zeros_like(load)

    def _shake(self, load: BaseMotion) -> None:
        """Inertia of the moving frame, and the stops that do not move with it."""
        structure = self._model.structure
        moved = structure.row(load.direction)
        inertia = -(self._model.base.modes.shapes.T @ (structure.mass @ moved))
        self._append(inertia, self._no_stop(), load.course.acceleration(self._end, self._finer))
        fixed = self._no_stop()
        for name in load.fixed_stops:
            self._check_stop(name)
            i = self._model.index(name)
            fixed[i] = -float(structure.row(self._model.contacts[i].direction) @ moved)
        if np.any(fixed):
            self._move(fixed, load.course)

    def _check_stop(self, name: str) -> None:
        contact = self._model.contacts[self._model.index(name)]
        if isinstance(contact, LawSpring):
            raise MultiPhiTypeError(f"stop motion of {name!r}: got a spring of a force law, need a contact")

    def _move(self, stop: np.ndarray, course: Course) -> None:
        """Stops that move by their entries of (c,) times the course."""
        history, nothing = self._history(course), np.zeros(self._model.base.modes.count)
        self._append(nothing, stop, history)
        moving = [contact for contact, moves in zip(self._model.contacts, stop, strict=True) if moves]
        rigid = [contact.name for contact in moving if contact.rigid]
        if rigid and isinstance(course, Sampled):
            raise MultiPhiTypeError(
                f"stop motion of the rigid contact {rigid[0]!r}: got Sampled, whose speed jumps, need a smooth course"
            )
        if rigid or any(contact.damping for contact in moving):
            self.rate_of[-1] = len(self.histories)
            self._append(nothing, self._no_stop(), history.derivative)

    def _append(self, pattern: np.ndarray, stop: np.ndarray, history: History) -> None:
        self.patterns.append(pattern)
        self.stops.append(stop)
        self.histories.append(history)
        self.rate_of.append(-1)

    def _row(self, at: Any) -> np.ndarray:
        return np.asarray(self._model.base.modes.shapes.T @ self._model.structure.row(at))

    def _no_stop(self) -> np.ndarray:
        return np.zeros(len(self._model.contacts))

    def _history(self, course: Course) -> History:
        return course.history(self._end, self._finer)


def static_load(model: MultiPhiModel, loads: Sequence[Load]) -> np.ndarray:
    """The constant loads among ``loads``, (m,) in base coordinates."""
    rows = [load.row(model.structure) for load in loads if isinstance(load, (ConstantLoad, Gravity))]
    if not rows:
        return np.zeros(model.base.modes.count)
    return np.asarray(model.base.modes.shapes.T @ np.sum(rows, axis=0))


@dataclass(frozen=True)
class ExtendedLevel(Level):
    """A level in the coordinates xi = (eta, w) (r + q): its rows and vectors have q more columns.

    speeds: gap velocities (c, r + q) without the quasi-static part. squares and damping are zero on w.
    """

    speeds: np.ndarray

    @property
    def speed_rows(self) -> np.ndarray:
        """Gap velocities (c, r + q) as impacts see them."""
        return self.speeds


@dataclass(frozen=True)
class DrivenLevel(LoadedLevel):
    """A level under static and varying loads, in the coordinates xi = (eta, w).

    plain: the level under the static loads alone. force, force_rate: P, Q (r, q). carried: Y (m, q).
    excitation: of the run.
    """

    plain: LoadedLevel
    force: np.ndarray
    force_rate: np.ndarray
    carried: np.ndarray
    excitation: Excitation

    @classmethod
    def under(cls, plain: LoadedLevel, excitation: Excitation) -> DrivenLevel:
        """``plain`` with the channels of an excitation."""
        own = plain.level
        parts = _prescribed(own, excitation)
        directions, sizes = own.base.directions.T, own.base.magnitudes[0].T
        gap_columns = directions @ parts.shapes - excitation.stops
        speeds = directions @ parts.carried - excitation.stops
        none = np.zeros(excitation.channels)
        level = ExtendedLevel(
            closed=own.closed,
            indices=own.indices,
            base=own.base,
            squares=np.concatenate([own.squares, none]),
            vectors=np.hstack([own.vectors, parts.shapes]),
            damping=np.pad(own.damping, (0, excitation.channels)),
            gap_rows=np.hstack([own.gap_rows, cleared(gap_columns, sizes @ parts.terms + np.abs(excitation.stops))]),
            force_rows=np.hstack([own.force_rows, parts.contact_force]),
            force_rate_rows=np.hstack([own.force_rate_rows, parts.contact_force_rate]),
            neutral=own.neutral,
            speeds=np.hstack([own.gap_rows, cleared(speeds, sizes @ np.abs(parts.carried) + np.abs(excitation.stops))]),
        )
        return cls(
            level=level,
            asymptotic=plain.asymptotic,
            gap_constants=plain.gap_constants,
            plain=plain,
            force=parts.force,
            force_rate=parts.force_rate,
            carried=parts.carried,
            excitation=excitation,
        )

    def split(self, xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """eta (r, ...) and w (q, ...) of xi."""
        r = self.plain.level.modes
        return xi[:r], xi[r:]

    def motion(self, velocity: np.ndarray) -> np.ndarray:
        """y' (m, ...) of xi', without the quasi-static part: Psi eta' + Y w'."""
        eta_t, w_t = self.split(velocity)
        return np.asarray(self.plain.level.vectors @ eta_t + self.carried @ w_t)

    def kinetic(self, velocity: np.ndarray) -> np.ndarray:
        """Kinetic energy [J] of (r + q,) or of every column."""
        if not np.any(self.carried):
            return self.plain.kinetic(self.split(velocity)[0])
        return np.asarray(0.5 * np.sum(self.motion(velocity) ** 2, axis=0))

    def strain(self, displacement: np.ndarray) -> np.ndarray:
        """Strain energy [J] as ``Base.strain`` has it, for (r + q,) or every column."""
        base, index = self.level.base, list(self.level.indices)
        y = self.configuration(displacement)
        springs = base.stiffnesses[index]
        springs = np.where(np.isinf(springs), 0.0, springs)
        gaps = (self.level.gap_rows[index] @ displacement).T + self.gap_constants[index]
        bent = 0.5 * (np.sum((base.modes.omega * y.T) ** 2, axis=-1) + gaps**2 @ springs)
        return np.asarray(bent - y.T @ base.preload + base.datum)

    def potential(self, displacement: np.ndarray) -> float:
        """Strain energy less the potential f.x of the loads [J] at their present values."""
        load = self.excitation.load(self.split(displacement)[1])
        return float(self.strain(displacement) - load @ self.configuration(displacement))

    def configuration(self, displacement: np.ndarray) -> np.ndarray:
        """y (m, ...) in base coordinates."""
        moved = self.level.vectors @ displacement
        return np.asarray((moved.T + self.asymptotic.configuration).T)


@dataclass(frozen=True)
class DrivenTransition(Transition):
    """The map of eq. (38.6) between levels in the coordinates xi; w stays what it is."""

    source: DrivenLevel
    target: DrivenLevel

    @functools.cached_property
    def matrix(self) -> np.ndarray:
        """[[Psi_m^T Psi_l, Psi_m^T (R_l - R_m)], [0, 1]]."""
        return self._map(
            self.source.level.vectors[:, self._modes :], self.target.level.vectors[:, self._target_modes :]
        )

    @functools.cached_property
    def velocity_matrix(self) -> np.ndarray:
        """[[Psi_m^T Psi_l, Psi_m^T (Y_l - Y_m)], [0, 1]]."""
        return self._map(self.source.carried, self.target.carried)

    @functools.cached_property
    def offset(self) -> np.ndarray:
        """c (r_m + q,)."""
        jump = self.source.asymptotic.configuration - self.target.asymptotic.configuration
        return np.concatenate([self.target.plain.level.vectors.T @ jump, np.zeros(self.source.excitation.channels)])

    @property
    def _modes(self) -> int:
        return self.source.plain.level.modes

    @property
    def _target_modes(self) -> int:
        return self.target.plain.level.modes

    def _map(self, source: np.ndarray, target: np.ndarray) -> np.ndarray:
        project = self.target.plain.level.vectors.T
        modal, prescribed = project @ self.source.plain.level.vectors, project @ (source - target)
        q = self.source.excitation.channels
        return np.block([[modal, prescribed], [np.zeros((q, self._modes)), np.eye(q)]])


@dataclass(frozen=True)
class _Prescribed:
    """What a level makes of the channels: see DrivenLevel; shapes: R (m, q), and of which terms they are the sum."""

    shapes: np.ndarray
    terms: np.ndarray
    carried: np.ndarray
    force: np.ndarray
    force_rate: np.ndarray
    contact_force: np.ndarray
    contact_force_rate: np.ndarray


def _prescribed(level: Level, excitation: Excitation) -> _Prescribed:
    base, index = level.base, list(level.indices)
    rigid = np.isinf(base.stiffnesses[index])
    stops, directions = excitation.stops[index], base.directions[:, index]
    springs = np.where(rigid, 0.0, base.stiffnesses[index])
    force = level.vectors.T @ excitation.patterns + level.vectors.T @ (directions @ (springs[:, None] * stops))
    squares = level.squares[:, None]
    centre = np.divide(force, squares, out=np.zeros_like(force), where=squares != 0)
    at_rest = [level.rest(excitation.patterns[:, k], -stops[:, k]) for k in range(excitation.channels)]
    held = [level.rest(np.zeros(base.modes.count), np.where(rigid, -stops[:, k], 0.0)) for k in range(len(at_rest))]
    carried = _columns([y for _, y in held], base.modes.count)
    total = _columns([y for _, y in at_rest], base.modes.count)
    contact_force = _columns([forces for forces, _ in at_rest], len(index)) - level.force_rows @ centre
    shapes = total - level.vectors @ centre
    rate, contact_rate = np.zeros_like(force), np.zeros_like(contact_force)
    pinned = directions[:, rigid]
    for k, derivative in enumerate(excitation.rate_of):
        if derivative >= 0:
            pressed = base.dampings[index] * (stops[:, k] - directions.T @ carried[:, k])  # of dampers, at w' = 1
            damped = base.damping @ carried[:, k] - directions @ pressed
            force[:, derivative] -= level.vectors.T @ damped
            rate[:, derivative] -= level.vectors.T @ carried[:, k]
            contact_force[~rigid, derivative] += pressed[~rigid]
            contact_force[rigid, derivative] += np.linalg.lstsq(pinned, damped, rcond=None)[0]
            contact_rate[rigid, derivative] += np.linalg.lstsq(pinned, carried[:, k], rcond=None)[0]
    terms = np.abs(total) + np.abs(level.vectors) @ np.abs(centre)
    return _Prescribed(shapes, terms, carried, force, rate, contact_force, contact_rate)


def _columns(vectors: list[np.ndarray], length: int) -> np.ndarray:
    return np.array(vectors).reshape(len(vectors), length).T
