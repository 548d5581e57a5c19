"""Stepwise reference: the reduced equations of every level by scipy's solve_ivp, with contacts as terminal events.

    z = (eta, eta'),   z' = [0, I; -diag(omega^2), -D] z + (0, drive)                                       (38.3)

Levels and transitions (38.6) are those of the reduced model. Different are the integration, by an error tolerance
instead of closed forms, the detection of events, by a change of a signal's sign between the two ends of a step, and the
code of the rule (spring_rule.py). Contacts have springs only. An event is not detected again at its own instant, where
the value of the signal is round-off: the sign there is given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.state import Phase, State
from reference_models.spring_rule import Signal, SpringRule

__all__ = ["StepwiseHistories", "StepwiseRun", "solve_stepwise"]

INSTANT = 64 * np.finfo(float).eps  # of time, and in s: solve_ivp locates events to 4 epsilons
CHATTER = 200  # events in a row, in less than
CHATTER_PERIODS = 10  # periods of the highest kept mode, are chatter

UNSTABLE = 2.0  # times the energy at the start: a run with more energy is unstable and is ended

Function = Callable[[float, np.ndarray], Any]


@dataclass(frozen=True)
class StepwiseSegment:
    """Motion in one level: solution(t) is z (2 r,) for t between its first and last step [s]."""

    level: LoadedLevel
    solution: OdeSolution

    @property
    def start(self) -> float:
        """Start of the segment [s]."""
        return float(self.solution.ts[0])

    @property
    def end(self) -> float:
        """End of the segment [s]."""
        return float(self.solution.ts[-1])


@dataclass(frozen=True)
class StepwiseHistories:
    """Histories (k,) of displacements [m] by point, gaps [m] and forces [N] by contact, and of the energy [J]."""

    points: dict[str, np.ndarray]
    gaps: dict[str, np.ndarray]
    contact_force: dict[str, np.ndarray]
    energy: np.ndarray


@dataclass(frozen=True)
class StepwiseRun:
    """Result of ``solve_stepwise``: segments, message of an early end or "", evaluations of the right-hand side."""

    model: MultiPhiModel
    segments: tuple[StepwiseSegment, ...]
    message: str
    evaluations: int

    @property
    def steps(self) -> int:
        """Number of accepted steps."""
        return sum(len(segment.solution.ts) - 1 for segment in self.segments)

    def histories(self, points: Sequence[str], time: np.ndarray) -> StepwiseHistories:
        """Histories at ascending times (k,) [s], at an event the limit from the right."""
        base = self.model.base
        rows = np.array([base.modes.shapes.T @ self.model.structure.row(point) for point in points])
        rows = rows.reshape(len(points), base.modes.count)
        values = np.zeros((len(points) + 2 * len(base.contacts) + 1, len(time)))
        owner = np.searchsorted([segment.start for segment in self.segments], time, side="right") - 1
        for i in np.unique(owner):
            values[:, owner == i] = _of_segment(self.segments[i], rows, time[owner == i])
        displacements, gaps, forces, energy = np.split(values, np.cumsum([len(points)] + 2 * [len(base.contacts)]))
        names = [contact.name for contact in base.contacts]
        return StepwiseHistories(
            points=dict(zip(points, displacements, strict=True)),
            gaps=dict(zip(names, gaps, strict=True)),
            contact_force=dict(zip(names, forces, strict=True)),
            energy=energy[0],
        )

    def contact_intervals(self, contact: str) -> list[tuple[float, float]]:
        """[(closed at, opened at), ...] [s]."""
        i = self.model.index(contact)
        intervals: list[tuple[float, float]] = []
        for segment in self.segments:
            if i in segment.level.level.indices:
                joined = bool(intervals) and intervals[-1][1] == segment.start
                start = intervals.pop()[0] if joined else segment.start
                intervals.append((start, segment.end))
        return intervals


def solve_stepwise(
    model: MultiPhiModel, t_end: float, displacement: np.ndarray, *, method: str, rtol: float
) -> StepwiseRun:
    """Motion from rest at x = ``displacement`` (n,) to t_end [s].

    method: of solve_ivp. rtol: its relative tolerance; the absolute one is rtol times the size of the start,
    |x|_M for displacements and the velocity of its whole strain energy for velocities.
    """
    for contact in model.contacts:
        if contact.rigid:
            raise MultiPhiValueError(f"contact {contact.name!r} stiffness: got inf, need a finite one")
        if contact.damping:
            raise MultiPhiValueError(f"contact {contact.name!r} damping: got {contact.damping:g}, need 0")
    base = model.base
    y = base.coordinates(displacement)
    rule = SpringRule(model)
    size = np.linalg.norm(y), np.linalg.norm(base.modes.omega * y)
    integration = _Integration(rule, method, rtol, (float(size[0]), float(size[1])))
    with np.errstate(over="ignore", invalid="ignore"):  # a run that blows up
        return integration.run(rule.start(y), t_end)


@dataclass(frozen=True)
class _Integration:
    """Integration with a rule of the contacts; method, rtol: of solve_ivp; size: of displacement and velocity."""

    rule: SpringRule
    method: str
    rtol: float
    size: tuple[float, float]

    def run(self, state: State, t_end: float) -> StepwiseRun:
        """Integrate from ``state`` at t = 0, with a restart in the next level after every event."""
        segments: list[StepwiseSegment] = []
        evaluations, message, time, energy_limit = 0, "", 0.0, UNSTABLE * (state.kinetic + state.potential)
        while time < t_end and not message:
            found, requesting = self._segment(state, time, t_end)
            segments.append(StepwiseSegment(state.level, found.sol))
            evaluations, time, message = evaluations + found.nfev, float(found.t[-1]), self._failure(found, segments)
            if requesting and not message:
                modes = state.level.level.modes
                end_state = found.y[:, -1]
                before = replace(state, displacement=end_state[:modes], velocity=end_state[modes:])
                state, message = self._after_event(before, requesting, time, energy_limit)
        return StepwiseRun(self.rule.model, tuple(segments), message, evaluations)

    def _after_event(self, state: State, requesting: set[int], time: float, energy_limit: float) -> tuple[State, str]:
        """State after an event, or the failure there; energy_limit: energy [J] beyond which a run is unstable."""
        if not state.kinetic + state.potential <= energy_limit:
            return state, f"at t = {time:.9g} s: energy gained, the integration is unstable at this tolerance"
        try:
            return self.rule.decide(state, self._simultaneous(state, requesting, time)), ""
        except NumericalFailure as failure:
            return state, f"at t = {time:.9g} s: {failure}"

    def _segment(self, state: State, time: float, t_end: float) -> tuple[Any, set[int]]:
        """Result of solve_ivp in one level, and the contacts that request a change at its end."""
        modes = state.level.level.modes
        motion, matrix = _right_hand_side(state.level)
        monitored = _monitored_events(self.rule, state, time)
        implicit: dict[str, Any] = {"jac": (lambda _, __: matrix) if self.method == "LSODA" else matrix}
        found = solve_ivp(
            motion,
            (time, t_end),
            np.concatenate([state.displacement, state.velocity]),
            method=self.method,
            dense_output=True,
            events=[event for _, event in monitored],
            rtol=self.rtol,
            atol=self.rtol * np.repeat(self.size, modes),
            **(implicit if self.method in ("Radau", "BDF", "LSODA") else {}),
        )
        times = found.t_events if found.status == 1 else [()] * len(monitored)
        return found, {contact for (contact, _), at in zip(monitored, times, strict=True) if len(at)}

    def _failure(self, found: Any, segments: Sequence[StepwiseSegment]) -> str:
        """Reason why the run cannot continue, or ""."""
        time = float(found.t[-1])
        if found.status < 0:
            return f"at t = {time:.9g} s: {' '.join(str(found.message).split())}"
        recent = segments[-CHATTER:]
        highest = max(segment.level.level.highest_frequency for segment in recent)
        if len(segments) > CHATTER and highest * (time - recent[0].start) < CHATTER_PERIODS:
            return f"at t = {time:.9g} s: chatter, {CHATTER} events within {CHATTER_PERIODS} periods of {highest:g} Hz"
        return ""

    def _simultaneous(self, state: State, requesting: set[int], time: float) -> set[int]:
        """The contacts with those that solve_ivp omits as their signals are zero at the same instant."""
        found = set(requesting)
        for contact, phase in enumerate(state.phases):
            plain, z = self.rule.signal(state.level, contact), np.concatenate([state.displacement, state.velocity])
            value, rate = plain.at(z), plain.rate.at(z)
            if phase is Phase.ARMED and rate < 0 and abs(value) <= -rate * INSTANT * (1 + time):
                found.add(contact)
        return found


def _right_hand_side(level: LoadedLevel) -> tuple[Function, np.ndarray]:
    """z'(t, z) and its constant matrix (2 r, 2 r)."""
    plain = level.level
    matrix = np.block([[np.zeros((plain.modes,) * 2), np.eye(plain.modes)], [-np.diag(plain.omega**2), -plain.damping]])
    if not level.driven:
        return lambda _, z: matrix.dot(z), matrix
    constant = np.concatenate([np.zeros(plain.modes), level.asymptotic.drive])
    return lambda _, z: matrix.dot(z) + constant, matrix


def _monitored_events(rule: SpringRule, state: State, time: float) -> list[tuple[int, Function]]:
    """Pairs (contact, event) of all possible requests: s, as in the event rule, falls through zero.

    A contact with negative s also requests a change when s begins to fall, or after a refusal when s in the requested
    level has risen to zero. time: of the restart.
    """
    monitored = []
    for contact, phase in enumerate(state.phases):
        plain = rule.signal(state.level, contact)
        monitored.append((contact, _falling(plain, time, positive=phase is Phase.ARMED)))
        if phase is Phase.RECOVERING:
            monitored.append((contact, _falling(plain.rate, time, while_negative=plain)))
        elif phase is Phase.REFUSED:
            entered = rule.entered_signal(state.level, contact)
            monitored.append((contact, _falling(-entered, time, while_negative=plain)))
    return monitored


def _falling(signal: Signal, time: float, *, positive: bool = True, while_negative: Signal | None = None) -> Function:
    """Terminal event: ``signal`` falls through zero, while the other signal, if given, is negative.

    positive: whether the signal counts as positive at the restart, where its value is round-off.
    """
    vector, constant, first = signal.row, signal.constant, 1.0 if positive else -1.0
    if while_negative is None:

        def event(t: float, z: np.ndarray) -> float:
            return vector.dot(z) + constant if t > time else first

    else:
        other, shift = while_negative.row, while_negative.constant

        def event(t: float, z: np.ndarray) -> float:
            return vector.dot(z) + constant if t > time and other.dot(z) + shift < 0 else first

    event.terminal, event.direction = True, -1.0  # type: ignore[attr-defined]
    return event


def _of_segment(segment: StepwiseSegment, rows: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Displacements of rows (p, m) in base coordinates, gaps, contact forces and energy, stacked, (p + 2 c + 1, k)."""
    level, plain = segment.level, segment.level.level
    state = segment.solution(time)
    displacement, velocity = state[: plain.modes], state[plain.modes :]
    displacements = (rows @ plain.vectors) @ displacement + (rows @ level.asymptotic.configuration)[:, None]
    gaps = plain.gap_rows @ displacement + level.gap_constants[:, None]
    forces = np.zeros_like(gaps)
    closed = list(plain.indices)
    forces[closed] = -plain.base.stiffnesses[closed, None] * gaps[closed]
    energy = 0.5 * np.sum(velocity**2, axis=0) + level.strain(displacement)
    return np.vstack([displacements, gaps, forces, energy])
