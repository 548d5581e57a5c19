"""Motion: a run under way, from event to event.

Within a level the motion is a sum of exponentials; the next event is the certified first root of a few of them
(first_descent.py); the event rule (events/rule.py) gives the state that follows. A failure on the way ends the run
early, with its cause.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import Change, Event, Loss, Phase, State
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.time.segment import Segment
from multiphi_exudyn.time.trajectory import Start, Statistics, Trajectory

__all__ = ["Motion"]

EVENTS_PER_PERIOD = 20  # of the highest kept mode, for every contact: more, over CHATTER_WINDOW events, is chatter
CHATTER_WINDOW = 200  # events, for every contact
ACCUMULATED = 1e-6  # of the time so far: CHATTER_WINDOW events within it are chatter, also where no mode oscillates


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
        self._evaluations, self._transitions = 0, self.rule.transitions
        self._decided, self._last_decision = deque[tuple[float, float]](maxlen=self.window + 1), 0.0
        with self._failing():
            self._begin()

    def go_on_from(self, state: State, time: float) -> None:
        """Forget what has been collected, and go on from a state and a time [s]."""
        self.state, self.time, self.message, self.start_loss = state, time, "", Loss()
        self.segments, self.events = [], []
        self._decided.clear()
        self._last_decision = time

    @contextmanager
    def _failing(self) -> Iterator[None]:
        """A failure ends the run, with its instant and its cause."""
        try:
            yield
        except (MultiPhiError, np.linalg.LinAlgError) as failure:
            singular = "" if isinstance(failure, MultiPhiError) else "linear algebra of a level or an impact fails: "
            self.message = f"at t = {self.time:.9g} s: {singular}{failure}"

    def _begin(self) -> None:
        """First state, with the events of the start."""
        self.state, self.start_loss, changes = self.rule.start(
            self.start.displacement, self.start.velocity, self.start.penetrating, self.start.touching
        )
        if changes:
            self._record(changes, self.start_loss)
            self.start_loss = Loss()

    def advance(self, end: float, to_change: bool = False) -> None:
        """Carries the state to ``end``, or to the failure that stops it; if asked, no further than a first event."""
        known = len(self.events)
        with self._failing():
            while not self.message and self.time < end and not (to_change and len(self.events) > known):
                self._continue(end)

    def trajectory(self, end: float) -> Trajectory:
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
            final=self.state if segments else None,
            final_work=self._work_since(),
            load=self.rule.load,
            stats=Statistics(
                levels_built=self.model.levels_built,
                levels_possible=self.model.levels_possible,
                transitions=self.rule.transitions - self._transitions,
                events=len(events),
                segments=len(segments),
                function_evaluations=self._evaluations,
            ),
        )

    def _work_since(self) -> float:
        """Work [J] of what varies in time since the last segment ended."""
        return 0.0

    def _continue(self, end: float) -> None:
        """Some way towards ``end``."""
        self._one_segment(end)

    def _collected(self) -> tuple[Sequence[Segment], Sequence[Event]]:
        return tuple(self.segments), tuple(self.events)

    def _keep(self, segment: Segment) -> None:
        self.segments.append(segment)

    def _keep_event(self, event: Event) -> None:
        self.events.append(event)

    def _recent(self) -> Sequence[tuple[float, float]]:
        """(since when [s], highest frequency [Hz] before it) of a ``window`` of decisions, none before there are more.

        Pieces of a load are no decisions.
        """
        return list(self._decided)[1:] if len(self._decided) > self.window else ()

    def _one_segment(self, end: float) -> None:
        """One level's motion up to the next decision, or to ``end``; contacts are armed on the way."""
        state, horizon = self.state, end - self.time
        finder, coefficients = state.finder, state.coefficients()
        evaluated = finder.evaluations
        reached, asking, armed_at = 0.0, set[int](), 0.0
        phases = state.phases
        while not asking:
            waiting, table = self.rule.watch(state, phases)
            signals = table.signals(coefficients, state)
            found = finder.first(signals, horizon, reached)
            if found is None:
                reached = horizon
                break
            reached = found.time
            alone = len(phases) == 1  # one contact's signals exclude each other
            fallen = [waiting[s] for s in ([found.signal] if alone else finder.simultaneous(signals, found))]
            asking = {contact for contact, asks in fallen if asks}
            if not asking:
                armed, armed_at = waiting[found.signal][0], reached  # the next one at its own instant, maybe at once
                phases = tuple(Phase.ARMED if i == armed else phase for i, phase in enumerate(phases))
        self._evaluations += finder.evaluations - evaluated
        started, self.time = self.time, end if reached == horizon else self.time + reached
        self._keep(self._segment(started, coefficients, armed_at))
        self.state = replace(state.after(coefficients, reached), phases=phases)
        if asking:
            self._decided.append((self._last_decision, state.level.level.highest_frequency))
            self._last_decision = self.time
            at_once = reached <= finder.instant and not self.model.whole  # all modes have an answer
            self._decide(asking, {i for i in asking if at_once and phases[i] is Phase.REFUSED})
            self._check_chatter()

    def _segment(self, started: float, coefficients: np.ndarray, armed_at: float) -> Segment:
        """The motion from the present state up to now."""
        return Segment(started, self.time, self.state.level, coefficients, self.state.phases, armed_at)

    def _decide(self, asking: set[int], again: Iterable[int] = ()) -> None:
        """These contacts ask to change at this instant; ``again``: those that were refused at it before."""
        self.state, loss, changes = self.rule.decide(self.state, asking, again)
        self._record(changes, loss)

    def _record(self, changes: list[Change], loss: Loss) -> None:
        for change in changes:
            names = self.model.contacts
            shared = tuple((names[i].name, impulse) for i, impulse in change.shared)
            self._keep_event(Event(self.time, names[change.contact].name, change.kind, loss, change.impulse, shared))
            loss = Loss()

    @property
    def window(self) -> int:
        """How many of the last events the chatter check is about, so many for every contact.

        Stops side by side are all struck in a small part of a period, once each.
        """
        return CHATTER_WINDOW * self._plain

    @property
    def _allowed(self) -> float:
        """How many of them a period of the highest kept mode may hold; a swing passes every spring of a law twice."""
        return EVENTS_PER_PERIOD * self._plain + 2 * sum(map(len, self.model.chains))

    @property
    def _plain(self) -> int:
        """Number of contacts that are no springs of a law, at least 1."""
        return max(1, len(self.model.contacts) - sum(map(len, self.model.chains)))

    def _check_chatter(self) -> None:
        window, allowed, recent = self.window, self._allowed, self._recent()
        if len(recent) < window:
            return
        starts, frequencies = zip(*recent, strict=True)
        elapsed, highest = self.time - starts[0], max(frequencies)
        if elapsed <= ACCUMULATED * self.time or 0 < highest * elapsed < window / allowed:
            raise NumericalFailure(
                f"chatter: {window} events in {elapsed:g} s, more than {allowed} in a period of the highest "
                f"kept mode ({highest:g} Hz) or all within {ACCUMULATED:g} of the time so far"
            )
