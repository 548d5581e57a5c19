"""The reduced equations of every level integrated step by step by scipy's solve_ivp, contacts as terminal events.

    z = (eta, eta'),   z' = [0, I; -diag(omega^2), -D] z + (0, drive)                                       (38.3)

What the levels are and how a state passes from one to the next (38.6) is that of the reduced model; what differs is the
integration, an error tolerance instead of closed forms, with events that are seen only where a signal's sign differs at
the two ends of a step, and the code of the rule (spring_rule.py). Contacts with springs only. An event is not found
again at the instant of the restart: it has a direction, and there its sign is known while its value is round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import OdeSolution, solve_ivp

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Phase, State
from multiphi_exudyn.levels.model import MultiPhiModel
from reference_models.spring_rule import Signal, SpringRule

__all__ = ["StepwiseHistories", "StepwiseRun", "solve_stepwise"]

INSTANT = 64 * np.finfo(float).eps  # of time, and s: solve_ivp locates events to 4 of these epsilons
CHATTER = 200  # events in a row, in less than
CHATTER_PERIODS = 10  # periods of the highest kept mode, are chatter

UNSTABLE = 2.0  # times the energy of the start: a run that has gained as much is not worth its end

Function = Callable[[float, np.ndarray], Any]


@dataclass(frozen=True)
class StepwiseSegment:
    """Motion in one level: solution(t) is z (2 r,) for t between its first and last step [s]."""

    level: LoadedLevel
    solution: OdeSolution

    @property
    def start(self) -> float:
        """Where it begins [s]."""
        return float(self.solution.ts[0])

    @property
    def end(self) -> float:
        """Where it ends [s]."""
        return float(self.solution.ts[-1])


@dataclass(frozen=True)
class StepwiseHistories:
    """Of every point and contact asked for: displacement, gap [m] and force [N], (k,) each; energy (k,) [J]."""

    points: dict[str, np.ndarray]
    gaps: dict[str, np.ndarray]
    contact_force: dict[str, np.ndarray]
    energy: np.ndarray


@dataclass(frozen=True)
class StepwiseRun:
    """segments: one after the other. message: why it ended early, or "". evaluations: of the right-hand side."""

    model: MultiPhiModel
    segments: tuple[StepwiseSegment, ...]
    message: str
    evaluations: int

    @property
    def steps(self) -> int:
        """Steps accepted."""
        return sum(len(segment.solution.ts) - 1 for segment in self.segments)

    def histories(self, points: Sequence[str], time: np.ndarray) -> StepwiseHistories:
        """Everything on ascending times (k,) [s], at an event the limit from the right."""
        base = self.model.base
        rows = np.array([base.modes.shapes.T @ self.model.structure.row(point) for point in points])
        rows = rows.reshape(len(points), base.modes.count)
        values = np.zeros((len(points) + 2 * len(base.contacts) + 1, len(time)))
        owner = np.searchsorted([segment.start for segment in self.segments], time, side="right") - 1
        for i in np.unique(owner):
            values[:, owner == i] = _of_segment(self.segments[i], rows, time[owner == i])
        moved, gaps, forces, energy = np.split(values, np.cumsum([len(points)] + 2 * [len(base.contacts)]))
        names = [contact.name for contact in base.contacts]
        return StepwiseHistories(
            points=dict(zip(points, moved, strict=True)),
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
    """rule: of the contacts. method, rtol: of solve_ivp. size: of the start's displacement and velocity."""

    rule: SpringRule
    method: str
    rtol: float
    size: tuple[float, float]

    def run(self, state: State, t_end: float) -> StepwiseRun:
        """From ``state`` at t = 0, restarted in the next level after every event."""
        segments: list[StepwiseSegment] = []
        evaluations, message, time, most = 0, "", 0.0, UNSTABLE * (state.kinetic + state.potential)
        while time < t_end and not message:
            found, asking = self._segment(state, time, t_end)
            segments.append(StepwiseSegment(state.level, found.sol))
            evaluations, time, message = evaluations + found.nfev, float(found.t[-1]), self._failure(found, segments)
            if asking and not message:
                modes = state.level.level.modes
                reached = found.y[:, -1]
                arrived = replace(state, displacement=reached[:modes], velocity=reached[modes:])
                state, message = self._decided(arrived, asking, time, most)
        return StepwiseRun(self.rule.model, tuple(segments), message, evaluations)

    def _decided(self, state: State, asking: set[int], time: float, most: float) -> tuple[State, str]:
        """State after an event, or the failure there; most: energy [J] beyond which a run is unstable."""
        if not state.kinetic + state.potential <= most:
            return state, f"at t = {time:.9g} s: energy gained, the integration is unstable at this tolerance"
        try:
            return self.rule.decide(state, self._together(state, asking, time)), ""
        except NumericalFailure as failure:
            return state, f"at t = {time:.9g} s: {failure}"

    def _segment(self, state: State, time: float, t_end: float) -> tuple[Any, set[int]]:
        """solve_ivp's result in one level, and the contacts that ask to change at its end."""
        modes = state.level.level.modes
        motion, matrix = _right_hand_side(state.level)
        watched = _watched(self.rule, state, time)
        implicit: dict[str, Any] = {"jac": (lambda _, __: matrix) if self.method == "LSODA" else matrix}
        found = solve_ivp(
            motion,
            (time, t_end),
            np.concatenate([state.displacement, state.velocity]),
            method=self.method,
            dense_output=True,
            events=[event for _, event in watched],
            rtol=self.rtol,
            atol=self.rtol * np.repeat(self.size, modes),
            **(implicit if self.method in ("Radau", "BDF", "LSODA") else {}),
        )
        times = found.t_events if found.status == 1 else [()] * len(watched)
        return found, {contact for (contact, _), at in zip(watched, times, strict=True) if len(at)}

    def _failure(self, found: Any, segments: Sequence[StepwiseSegment]) -> str:
        """Why the run cannot go on, or ""."""
        time = float(found.t[-1])
        if found.status < 0:
            return f"at t = {time:.9g} s: {' '.join(str(found.message).split())}"
        recent = segments[-CHATTER:]
        highest = max(segment.level.level.highest_frequency for segment in recent)
        if len(segments) > CHATTER and highest * (time - recent[0].start) < CHATTER_PERIODS:
            return f"at t = {time:.9g} s: chatter, {CHATTER} events within {CHATTER_PERIODS} periods of {highest:g} Hz"
        return ""

    def _together(self, state: State, asking: set[int], time: float) -> set[int]:
        """With those that reach zero at the same instant, as far as roots are resolved: solve_ivp leaves them out."""
        found = set(asking)
        for contact, phase in enumerate(state.phases):
            own, z = self.rule.signal(state.level, contact), np.concatenate([state.displacement, state.velocity])
            value, rate = own.at(z), own.rate.at(z)
            if phase is Phase.ARMED and rate < 0 and abs(value) <= -rate * INSTANT * (1 + time):
                found.add(contact)
        return found


def _right_hand_side(level: LoadedLevel) -> tuple[Function, np.ndarray]:
    """z'(t, z) and its constant matrix (2 r, 2 r)."""
    own = level.level
    matrix = np.block([[np.zeros((own.modes,) * 2), np.eye(own.modes)], [-np.diag(own.omega**2), -own.damping]])
    if not level.driven:
        return lambda _, z: matrix.dot(z), matrix
    constant = np.concatenate([np.zeros(own.modes), level.asymptotic.drive])
    return lambda _, z: matrix.dot(z) + constant, matrix


def _watched(rule: SpringRule, state: State, time: float) -> list[tuple[int, Function]]:
    """(contact, event) of all that may ask to change: s falls through zero, s being as in the event rule.

    A contact whose s is negative asks also where s turns down or, refused before, where s in the level it would
    enter has risen to zero. ``time``: of the restart.
    """
    watched = []
    for contact, phase in enumerate(state.phases):
        own = rule.signal(state.level, contact)
        watched.append((contact, _falling(own, time, positive=phase is Phase.ARMED)))
        if phase is Phase.RECOVERING:
            watched.append((contact, _falling(own.rate, time, while_negative=own)))
        elif phase is Phase.REFUSED:
            entered = rule.entered_signal(state.level, contact)
            watched.append((contact, _falling(-entered, time, while_negative=own)))
    return watched


def _falling(signal: Signal, time: float, *, positive: bool = True, while_negative: Signal | None = None) -> Function:
    """Terminal event: ``signal`` falls through zero, looked for only while another one is negative.

    positive: its sign at the restart, where the value itself is round-off.
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
    level, own = segment.level, segment.level.level
    state = segment.solution(time)
    displacement, velocity = state[: own.modes], state[own.modes :]
    moved = (rows @ own.vectors) @ displacement + (rows @ level.asymptotic.configuration)[:, None]
    gaps = own.gap_rows @ displacement + level.gap_constants[:, None]
    forces = np.zeros_like(gaps)
    closed = list(own.indices)
    forces[closed] = -own.base.stiffnesses[closed, None] * gaps[closed]
    energy = 0.5 * np.sum(velocity**2, axis=0) + level.strain(displacement)
    return np.vstack([moved, gaps, forces, energy])
