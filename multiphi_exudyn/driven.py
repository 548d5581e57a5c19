"""Driven motion: a run under loads and stops that vary in time, exact from event to event like any other.

In the coordinates xi = (eta, w) of excitation.py the motion from a state is again a sum of exponentials,

    xi(t) = Re V (c exp(lambda t)) + Re sum_j exp(mu_j t) sum_k x_jk t^k

the free response and the closed-form response to the present piece of every load (forced_response.py), so events are
certified as they are elsewhere. Where a piece ends, the motion goes on in the same level with the next one; a load
that jumps there may make contacts change, by the same rule.

The work of what varies is that of the loads, of the stops of compliant contacts and of those of rigid ones,

    f.y' + lambda s w' + (Y w').(M y'' + C y' + K y - f)

integrated by Gauss-Legendre quadrature, exact to round-off on panels short beside the shortest period.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from multiphi_exudyn.courses import Smooth, Sweep
from multiphi_exudyn.event_rule import EventRule
from multiphi_exudyn.excitation import Drive, DrivenLevel, DrivenTransition, Excitation
from multiphi_exudyn.first_root import DescentFinder
from multiphi_exudyn.forced_response import particular
from multiphi_exudyn.history import differentiated
from multiphi_exudyn.loads import Load
from multiphi_exudyn.modal_response import Exponentials
from multiphi_exudyn.motion import Motion
from multiphi_exudyn.recent import Recent
from multiphi_exudyn.state import Phase, SignalTable, State
from multiphi_exudyn.trajectory import Segment, Trajectory
from multiphi_exudyn.transition import LoadedLevel, Transition

__all__ = ["DrivenMotion", "DrivenRule", "DrivenSegment", "DrivenState", "to_tolerance"]

NODES = 20  # of the quadrature on a panel
PANEL = 6.0  # rad, the phase of the fastest exponential on it: products of two have twice that
CHUNK = 512  # panels evaluated at a time
REFINEMENTS = 2  # of smooth courses; the second corrects for what the first has changed
SAFETY = 1.5  # on the factor by which they are refined
SAMPLES = 257  # of the energy, for its largest value
Basis = tuple[tuple[complex, int], ...]  # carriers and numbers of powers


@dataclass(frozen=True)
class Flow:
    """xi(t) = Re shapes (coefficients * basis) from a state on. key: what distinguishes its basis in its level."""

    basis: Exponentials
    shapes: np.ndarray
    coefficients: np.ndarray
    key: Basis

    @classmethod
    def of(cls, level: DrivenLevel, xi: np.ndarray, xi_t: np.ndarray, drive: Drive, horizon: float) -> Flow:
        """The motion from xi, xi' under a drive, good for [0, horizon]."""
        own = level.plain.level
        response, q = own.response, level.excitation.channels
        blocks, key = list[np.ndarray](), list[tuple[complex, int]]()
        for rate, given in drive.terms:
            forces = given @ level.force.T
            if np.any(level.force_rate):
                forces = forces + differentiated(rate, given) @ level.force_rate.T
            x = particular(own.squares, own.damping, response, rate, forces, horizon)
            block = np.zeros((max(len(x), len(given)), own.modes + q), complex)
            block[: len(x), : own.modes], block[: len(given), own.modes :] = x, given
            blocks.append(block)
            key.append((rate, len(block)))
        at_once = sum(block[0] for block in blocks).real
        rate_at_once = sum(differentiated(k[0], block)[0] for k, block in zip(key, blocks, strict=True)).real
        (eta, _), (eta_t, _) = level.split(xi - at_once), level.split(xi_t - rate_at_once)
        steady = level.plain.asymptotic.drive if level.plain.driven else None
        free = response.coefficients(eta, eta_t, steady)
        forced = np.concatenate(blocks).T
        shapes = np.hstack([np.vstack([response.shapes, np.zeros((q, len(free)))]), forced])
        coefficients = np.concatenate([free, np.ones(forced.shape[1])])
        return cls(_basis(response.basis, tuple(key)), shapes, coefficients, tuple(key))

    @property
    def rows(self) -> np.ndarray:
        """xi = Re rows phi(t), (r + q, p)."""
        return self.shapes * self.coefficients

    def at(self, t: np.ndarray | float, derivative: int = 0) -> np.ndarray:
        """xi or a derivative, (r + q,) for a scalar, (r + q, k) for (k,) times from the state on."""
        rows = self.rows
        for _ in range(derivative):
            rows = self.basis.derivative(rows)
        return np.asarray((rows @ self.basis.at(t).T).real)


@dataclass(frozen=True)
class DrivenState(State):
    """A state xi, xi' of a driven level, with the drive from its instant on, that is looked at up to ``until`` [s]."""

    level: DrivenLevel
    drive: Drive
    until: float
    finders: Recent[tuple[tuple[int, ...], Basis], DescentFinder]

    @functools.cached_property
    def flow(self) -> Flow:
        """The motion that starts here."""
        horizon = _bucket(min(self.drive.until, self.until) - self.drive.time)
        return Flow.of(self.level, self.displacement, self.velocity, self.drive, horizon)

    @property
    def plain(self) -> State:
        """eta, eta' alone, in the level under static loads."""
        eta, eta_t = self.level.split(self.displacement)[0], self.level.split(self.velocity)[0]
        return State(self.level.plain, eta, eta_t, self.phases)

    @functools.cached_property
    def acceleration(self) -> np.ndarray:
        """xi'' (r + q,)."""
        (eta, w), (eta_t, w_t) = self.level.split(self.displacement), self.level.split(self.velocity)
        forced = self.level.force @ w + self.level.force_rate @ w_t
        return np.concatenate([self.level.plain.acceleration(eta, eta_t) + forced, self.drive.values[2]])

    @property
    def basis(self) -> Exponentials:
        """The exponentials of the motion that starts here."""
        return self.flow.basis

    @property
    def shapes(self) -> np.ndarray:
        """xi is the real part of these times coefficients times exponentials."""
        return self.flow.shapes

    @property
    def finder(self) -> DescentFinder:
        """Event location on these exponentials."""
        key = self.closed, self.flow.key
        return self.finders.find(key) or self.finders.keep(key, DescentFinder(self.flow.basis))

    def coefficients(self) -> np.ndarray:
        """Coefficients (p,) of the exponentials for the motion that starts here."""
        return self.flow.coefficients

    def after(self, coefficients: np.ndarray, t: float) -> DrivenState:
        """The state a time t [s] later."""
        return replace(self, displacement=self.flow.at(t), velocity=self.flow.at(t, 1), drive=self.drive.after(t))


class DrivenRule(EventRule):
    """The rule ``plain`` under an excitation as well, for motions from ``time`` to ``until`` [s].

    drive: at ``time``.
    """

    def __init__(self, plain: EventRule, excitation: Excitation, time: float, until: float) -> None:
        super().__init__(plain.model, plain.load)
        self.plain = plain
        self.excitation = excitation
        self.set_out(time, until)
        self.finders = Recent[tuple[tuple[int, ...], Basis], DescentFinder](plain.model.most_levels)

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
        eta = vectors @ (displacement - level.asymptotic.configuration - shown @ w)
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


@dataclass(frozen=True)
class DrivenSegment(Segment):
    """Motion in one driven level; flow: its closed form. entry_work: work [J] of what jumped where it begins."""

    flow: Flow
    entry_work: float

    @property
    def basis(self) -> Exponentials:
        """The exponentials phi (p,) of the motion."""
        return self.flow.basis

    @property
    def rows(self) -> np.ndarray:
        """xi = Re rows phi(t - start), (r + q, p)."""
        return self.flow.rows

    def force_integral(self, contact: int, start: float, end: float) -> float:
        """Integral of the force of a closed contact [N s]."""
        return sum(float(weights @ self.force(contact, times)) for times, weights in self._quadrature(start, end))

    def damping_work(self) -> float:
        """Integral of y'^T C y' and of what viscous contacts take up [J]."""
        if not np.any(self.level.level.damping):
            return 0.0
        return sum(float(weights @ self._dissipation(t)) for t, weights in self._quadrature(self.start, self.end))

    def varying_work(self) -> float:
        """Work [J] of loads and stops that vary in time."""
        parts = self._quadrature(self.start, self.end)
        return self.entry_work + sum(float(weights @ self._power(times)) for times, weights in parts)

    @property
    def _driven(self) -> DrivenLevel:
        assert isinstance(self.level, DrivenLevel)
        return self.level

    def _dissipation(self, times: np.ndarray) -> np.ndarray:
        xi_t = self.modal(times, 1)
        moved, dampers = self._driven.motion(xi_t), self._dampers(xi_t)
        coefficients = self._driven.level.base.dampings[list(self._driven.level.indices)]
        viscous = np.divide(dampers.T**2, coefficients, out=np.zeros_like(dampers.T), where=coefficients > 0)
        return np.asarray(np.sum(moved * (self._driven.level.base.damping @ moved), axis=0) + np.sum(viscous, axis=1))

    def _dampers(self, xi_t: np.ndarray) -> np.ndarray:
        """c g' (k, times) [N] of the closed contacts: what their dampers hold against opening."""
        index = list(self._driven.level.indices)
        return np.asarray(
            self._driven.level.base.dampings[index][:, None] * (self._driven.level.speed_rows[index] @ xi_t)
        )

    def _power(self, times: np.ndarray) -> np.ndarray:
        """Power (k,) [W] of the channels."""
        level, base = self._driven, self._driven.level.base
        xi, xi_t = self.modal(times), self.modal(times, 1)
        w, w_t = level.split(xi)[1], level.split(xi_t)[1]
        varying = level.excitation.patterns @ w
        power = np.sum(varying * (level.level.vectors @ xi_t), axis=0)
        index = list(level.level.indices)
        stiffness = np.where(np.isinf(base.stiffnesses[index]), 0.0, base.stiffnesses[index])
        gaps = level.level.gap_rows[index] @ xi + level.gap_constants[index][:, None]
        springs = stiffness[:, None] * gaps + self._dampers(xi_t)
        power -= np.sum(springs * (level.excitation.stops[index] @ w_t), axis=0)
        if np.any(level.carried):
            moved, accelerated = level.motion(xi_t), level.motion(self.modal(times, 2))
            y = level.configuration(xi)
            load = (level.excitation.static + base.preload)[:, None] + varying
            residual = accelerated + base.damping @ moved + (base.modes.omega**2 * y.T).T - load
            residual += base.directions[:, index] @ springs
            power += np.sum((level.carried @ w_t) * residual, axis=0)
        return np.asarray(power)

    def _quadrature(self, start: float, end: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Times and weights of the integral from start to end, in parts."""
        fastest = float(np.max(np.abs(self.flow.basis.rates), initial=0.0))
        panels = max(1, math.ceil(fastest * (end - start) / PANEL))
        width, (nodes, weights) = (end - start) / panels, _gauss_legendre()
        for first in range(0, panels, CHUNK):
            lefts = start + width * np.arange(first, min(panels, first + CHUNK))
            yield (lefts[:, None] + width * nodes).ravel(), np.tile(width * weights, len(lefts))


@dataclass
class DrivenMotion(Motion):
    """A run under an excitation."""

    work: float = field(default=0.0, init=False)  # of what varies, at instants, since the last segment began

    def _begin(self) -> None:
        super()._begin()
        self.work = self._varying_work(self.start.displacement, self._state)

    @property
    def _state(self) -> DrivenState:
        assert isinstance(self.state, DrivenState)
        return self.state

    def _continue(self, end: float) -> None:
        """On to the end of the present pieces, and into the next ones."""
        if self.time >= self._state.drive.until:
            self._next_piece()
        self._one_segment(min(end, self._state.drive.until))

    def _next_piece(self) -> None:
        """The same state under the drive that follows; a load that jumps may make contacts ask."""
        before, level = self._state, self._state.level
        assert isinstance(self.rule, DrivenRule)
        drive = self.rule.excitation.drive(self.time)
        w, w_t, _ = drive.values
        (eta, _), (eta_t, old_w_t) = level.split(before.displacement), level.split(before.velocity)
        eta_t = eta_t + level.plain.level.vectors.T @ (level.carried @ (old_w_t - w_t))
        displacement, velocity = np.concatenate([eta, w]), np.concatenate([eta_t, w_t])
        after = replace(before, displacement=displacement, velocity=velocity, drive=drive)
        moved = level.configuration(after.displacement) - level.configuration(before.displacement)
        self.work += _energy(after) - _energy(before) - float(self.rule.load @ moved)
        self.state = after
        functions = ((i, self.rule.function(level, i)) for i, p in enumerate(after.phases) if p is Phase.ARMED)
        asking = {i for i, s in functions if s.sign(after.displacement, after.velocity, after.reach) < 0}
        if asking:
            self._decide(asking)

    def _decide(self, asking: set[int]) -> None:
        before = self._state.level.configuration(self._state.displacement)
        super()._decide(asking)
        self.work += self._varying_work(before, self._state)

    def _varying_work(self, before: np.ndarray, state: DrivenState) -> float:
        """Work [J] of the varying loads where the configuration jumps from y (m,) to that of a state."""
        _, w = state.level.split(state.displacement)
        moved = state.level.configuration(state.displacement) - before
        return float((state.level.excitation.patterns @ w) @ moved)

    def _segment(self, started: float, coefficients: np.ndarray, armed_at: float) -> Segment:
        state, entry_work, self.work = self._state, self.work, 0.0
        given = started, self.time, state.level, coefficients, state.phases, armed_at
        return DrivenSegment(*given, flow=state.flow, entry_work=entry_work)

    def _work_since(self) -> float:
        return self.work


def to_tolerance(run: Callable[[float], Trajectory], loads: Sequence[Load]) -> Trajectory:
    """The run, with smooth courses so fine that the response has their tolerance: ``run`` takes them finer by a factor.

    A modal force that is off by dp leaves z = (omega eta, eta') off by no more than the integral of |dp|, whatever the
    level. What a course's interpolation leaves, times |P| and the length of the run, is compared with the largest |z|.
    Sensitivity to events is not in this bound: it separates any two motions that are not the same.
    """
    trajectory, finer = run(1.0), 1.0
    courses = [getattr(load, "course", None) for load in loads]
    wanted = [course.tolerance for course in courses if isinstance(course, (Smooth, Sweep))]
    for _ in range(REFINEMENTS if wanted else 0):
        if trajectory.status != "ok" or (error := _interpolation_error(trajectory)) <= min(wanted):
            return trajectory
        finer *= SAFETY * error / min(wanted)
        trajectory = run(finer)
    if wanted and trajectory.status == "ok" and (error := _interpolation_error(trajectory)) > min(wanted):
        told = f"smooth loads: the response is certain to {error:.2g} of its largest value, not to {min(wanted):g}"
        return replace(trajectory, message=told)
    return trajectory


def _interpolation_error(trajectory: Trajectory) -> float:
    """Bound of the error of z that interpolated courses leave, relative to its largest value."""
    level = trajectory.segments[0].level
    assert isinstance(level, DrivenLevel)
    errors = np.array([history.error for history in level.excitation.histories])
    lasting = trajectory.t_end * float(np.linalg.norm(np.abs(level.force) @ errors))
    if lasting == 0:
        return 0.0
    energies = np.asarray(trajectory.energy(np.linspace(0.0, trajectory.t_end, SAMPLES)))
    return lasting / max(math.sqrt(2 * float(np.max(energies))), np.finfo(float).tiny)


def _energy(state: DrivenState) -> float:
    return float(state.level.kinetic(state.velocity) + state.level.strain(state.displacement))


def _basis(free: Exponentials, key: Basis) -> Exponentials:
    """The exponentials of the free response and t^k exp(mu t) of every carrier."""
    rates = np.concatenate([free.rates, *(np.full(count, rate) for rate, count in key)])
    return Exponentials(rates, np.concatenate([free.powers, *(np.arange(count) for _, count in key)]))


def _bucket(duration: float) -> float:
    """The power of two above a duration: bases are shared among pieces of about the same length."""
    return math.ldexp(1.0, math.frexp(duration)[1])


@functools.cache
def _gauss_legendre() -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return (nodes + 1) / 2, weights / 2
