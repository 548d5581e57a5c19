"""Simulation: exact modal motion from event to event (eqs. 38.3, 38.6). There is no time step.

Within a level the motion is a sum of exponentials; the next event is the certified first root of a few of them
(first_root.py); the event rule (event_rule.py) gives the state that follows. What comes out is a Trajectory of
analytic segments. A failure on the way ends the trajectory early, with a status and its cause.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.event_rule import EventRule
from multiphi_exudyn.loads import ConstantLoad
from multiphi_exudyn.model import MultiPhiModel, Tolerance
from multiphi_exudyn.state import Change, Event, Loss, Phase, State
from multiphi_exudyn.structure import is_real
from multiphi_exudyn.trajectory import Segment, Start, Statistics, Trajectory
from multiphi_exudyn.truncation import adapted

__all__ = ["Motion", "simulate"]

TOUCHING = 1e-9  # of the gap and of the displacements that make it: closer than this is in touch
EVENTS_PER_PERIOD = 20  # of the highest kept mode: more, over CHATTER_WINDOW events, is chatter
CHATTER_WINDOW = 200


def simulate(
    model: MultiPhiModel,
    t_end: float,
    displacement: np.ndarray | None = None,
    velocity: np.ndarray | None = None,
    loads: Sequence[ConstantLoad] = (),
    compiled: bool | None = None,
) -> Trajectory:
    """Motion of ``model`` from 0 to t_end [s].

    displacement, velocity: x, x' (n,) at t = 0, None for zero; not modified. loads: constant loads.
    compiled: whether the compiled loop runs, None: where numba is installed; the answer is the same to round-off.
    A model with a Tolerance is run until its modes suffice; they are those of the trajectory's model.
    The trajectory's status is "ok", or "failed" with the cause in its message; it then ends early. The message of a run
    that is ok says where a Tolerance could not be reached.
    Raises MultiPhiValueError or MultiPhiTypeError for bad input, and for a start inside a rigid stop.
    """
    if isinstance(model.modes, Tolerance):
        return adapted(model, lambda chosen: simulate(chosen, t_end, displacement, velocity, loads, compiled))
    end = _time("t_end", t_end)
    load = _static_load(model, loads)
    start = _start(model, displacement, velocity)
    motion = _motion(model, _rule(model, load), start, compiled)
    motion.advance(end)
    return motion.trajectory(end, loads)


@dataclass
class Motion:
    """A run under way: advances the state and collects segments and events."""

    model: MultiPhiModel
    rule: EventRule
    start: Start
    time: float = 0.0
    segments: list[Segment] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    message: str = ""
    start_loss: Loss = field(default_factory=Loss)

    def __post_init__(self) -> None:
        self._evaluated, self._transitions = self.model.evaluations, self.rule.transitions
        try:
            self.state, self.start_loss, changes = self.rule.start(
                self.start.displacement, self.start.velocity, self.start.penetrating, self.start.touching
            )
            if changes:
                self._record(changes, self.start_loss)
                self.start_loss = Loss()
        except NumericalFailure as failure:
            self.message = f"at t = 0 s: {failure}"

    def advance(self, end: float) -> None:
        """Carries the state to ``end``, or to the failure that stops it."""
        try:
            while not self.message and self.time < end:
                self._continue(end)
        except MultiPhiError as failure:
            self.message = f"at t = {self.time:.9g} s: {failure}"

    def trajectory(self, end: float, loads: Sequence[ConstantLoad]) -> Trajectory:
        """What has been collected."""
        segments, events = self._collected()
        return Trajectory(
            model=self.model,
            segments=segments,
            events=events,
            t_end=self.time if self.message else end,
            status="failed" if self.message else "ok",
            message=self.message,
            start=self.start,
            start_loss=self.start_loss,
            load=self.rule.load,
            stats=Statistics(
                levels_built=self.model.levels_built,
                levels_possible=2 ** len(self.model.contacts),
                transitions=self.rule.transitions - self._transitions,
                events=len(events),
                segments=len(segments),
                function_evaluations=self.model.evaluations - self._evaluated,
            ),
        )

    def _continue(self, end: float) -> None:
        """Some way towards ``end``."""
        self._one_segment(end)

    def _collected(self) -> tuple[Sequence[Segment], Sequence[Event]]:
        return tuple(self.segments), tuple(self.events)

    def _keep(self, segment: Segment) -> None:
        self.segments.append(segment)

    def _keep_event(self, event: Event) -> None:
        self.events.append(event)

    def _count(self) -> int:
        return len(self.segments)

    def _recent(self) -> list[tuple[float, float]]:
        """Start [s] and highest frequency [Hz] of the segments that the chatter check is about."""
        return [(segment.start, segment.level.level.highest_frequency) for segment in self.segments[-CHATTER_WINDOW:]]

    def _one_segment(self, end: float) -> None:
        """One level's motion up to the next decision, or to ``end``; contacts are armed on the way."""
        state, horizon = self.state, end - self.time
        own = state.level.level
        coefficients = state.coefficients()
        reached, asking, armed_at = 0.0, set[int](), 0.0
        phases = state.phases
        while not asking:
            waiting, table = self.rule.watch(state.level, phases)
            signals = table.signals(coefficients)
            found = own.finder.first(signals, horizon, reached)
            if found is None:
                reached = horizon
                break
            reached = found.time
            alone = len(phases) == 1  # one contact's signals exclude each other
            fallen = [waiting[s] for s in ([found.signal] if alone else own.finder.simultaneous(signals, found))]
            asking = {contact for contact, asks in fallen if asks}
            if not asking:
                armed, armed_at = {contact for contact, _ in fallen}, reached
                phases = tuple(Phase.ARMED if i in armed else phase for i, phase in enumerate(phases))
        started, self.time = self.time, end if reached == horizon else self.time + reached
        self._keep(Segment(started, self.time, state.level, coefficients, state.phases, armed_at))
        self.state = State(state.level, *own.response.state(coefficients, reached), phases)
        if asking:
            self.state, loss, changes = self.rule.decide(self.state, asking)
            self._record(changes, loss)
            self._check_chatter()

    def _record(self, changes: list[Change], loss: Loss) -> None:
        for change in changes:
            name = self.model.contacts[change.contact].name
            self._keep_event(Event(self.time, name, change.kind, loss, change.impulse))
            loss = Loss()

    def _check_chatter(self) -> None:
        if self._count() <= CHATTER_WINDOW:
            return
        starts, frequencies = zip(*self._recent(), strict=True)
        elapsed, highest = self.time - starts[0], max(frequencies)
        if elapsed == 0 or 0 < highest * elapsed < CHATTER_WINDOW / EVENTS_PER_PERIOD:
            raise NumericalFailure(
                f"chatter: {CHATTER_WINDOW} events in {elapsed:g} s, more than {EVENTS_PER_PERIOD} "
                f"in a period of the highest kept mode ({highest:g} Hz)"
            )


@dataclass
class _CompiledMotion(Motion):
    """A run that the compiled loop carries; the NumPy loop takes the segments which that one leaves."""

    loop: Any = None
    record: Any = None

    def __post_init__(self) -> None:
        self.record = self.loop.record()
        super().__post_init__()

    def _continue(self, end: float) -> None:
        given = self.state, self.time, end, self.record, CHATTER_WINDOW, EVENTS_PER_PERIOD
        self.state, self.time, chatter = self.loop.advance(*given)
        if chatter:
            self._check_chatter()
        if self.time < end:
            self._one_segment(end)

    def _collected(self) -> tuple[Sequence[Segment], Sequence[Event]]:
        return self.record.segments, self.record.events

    def _keep(self, segment: Segment) -> None:
        self.record.add(segment)

    def _keep_event(self, event: Event) -> None:
        self.record.add_event(event)

    def _count(self) -> int:
        return self.record.count

    def _recent(self) -> list[tuple[float, float]]:
        return self.record.recent(CHATTER_WINDOW)


def _motion(model: MultiPhiModel, rule: EventRule, start: Start, compiled: bool | None) -> Motion:
    """The run, in the loop that is wanted and can be had."""
    if compiled is not False and rule.compiled is None:
        rule.compiled = _compiled_loop(rule, compiled)
    if compiled is False or rule.compiled is None:
        return Motion(model, rule, start)
    return _CompiledMotion(model, rule, start, loop=rule.compiled)


def _compiled_loop(rule: EventRule, needed: bool | None) -> Any:
    """The compiled loop, None without numba; that is an error where it is needed."""
    try:
        return importlib.import_module("multiphi_exudyn.compiled.loop").CompiledLoop(rule)
    except ImportError as error:
        if needed:
            raise MultiPhiError(
                "compiled: got True without numba, need it: pip install multiphi-exudyn[fast]"
            ) from error
        return None


def _rule(model: MultiPhiModel, load: np.ndarray) -> EventRule:
    """The model's event rule under this load, kept by the model: its maps between levels serve every run."""
    key = load.tobytes()
    if key not in model.rules:
        model.rules[key] = EventRule(model, load)
    rule: EventRule = model.rules[key]
    return rule


def _start(model: MultiPhiModel, displacement: np.ndarray | None, velocity: np.ndarray | None) -> Start:
    base = model.base
    y, v = _base_vector("displacement", displacement, model), _base_vector("velocity", velocity, model)
    gaps = (y @ base.directions + base.gaps).tolist()
    directions, initial = base.magnitudes
    scales = (TOUCHING * (initial + np.abs(y) @ directions)).tolist()
    penetrating, touching = list[int](), list[int]()
    for i, (contact, gap, scale) in enumerate(zip(model.contacts, gaps, scales, strict=True)):
        if contact.rigid and gap < -scale:
            raise MultiPhiValueError(
                f"displacement: lies {-gap:g} m inside the rigid contact {contact.name!r}, need a gap >= 0 "
                "(static_equilibrium gives an admissible start)"
            )
        if contact.rigid and gap <= scale:
            touching.append(i)
        elif gap < -scale:
            penetrating.append(i)
    return Start(y, v, tuple(penetrating), tuple(touching))


def _static_load(model: MultiPhiModel, loads: Sequence[ConstantLoad]) -> np.ndarray:
    total = np.zeros(model.base.modes.count)
    for load in loads:
        if not isinstance(load, ConstantLoad):
            raise MultiPhiTypeError(f"loads: got {type(load).__name__}, need ConstantLoad")
        total += load.force * (model.base.modes.shapes.T @ model.structure.row(load.at))
    return total


def _base_vector(name: str, given: np.ndarray | None, model: MultiPhiModel) -> np.ndarray:
    """A given vector (n,) in base coordinates."""
    if given is None:
        return np.zeros(model.base.modes.count)
    return model.base.weights @ model.structure.vector(name, given)


def _time(name: str, value: float) -> float:
    if not is_real(value):
        raise MultiPhiTypeError(f"{name}: got {value!r}, need a time in s")
    if not (math.isfinite(value) and value > 0):
        raise MultiPhiValueError(f"{name}: got {value!r}, need a finite time > 0 s")
    return float(value)
