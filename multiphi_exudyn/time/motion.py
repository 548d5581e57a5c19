"""Motion: a run in progress, which the core advances from event to event.

A failure ends the run early, with its cause as a sentence that names the contacts and what is needed. Chatter, more
events in a short time than modes and loads can follow, is one.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import cast

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.force_law import ForceLaw
from multiphi_exudyn.time.ledger import NUMBERS, Counts, FinalState
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.record import PHASES, Events, Record
from multiphi_exudyn.time.start import Start
from multiphi_exudyn.time.state import Loss, State
from multiphi_exudyn.time.trajectory import Rerun, Trajectory

__all__ = ["Motion", "core_start", "failure", "limits"]


ACCUMULATED = 1e-6  # of the time so far: a window of events within it is chatter (core/run.cpp)
EVENTS_PER_PERIOD = 20  # of the fastest mode or load, for each contact: more, over CHATTER_WINDOW, is chatter
CHATTER_WINDOW = 200  # events, for each contact
PASSES_PER_PERIOD, PASSES_IN_WINDOW = 2, 20  # of every knot of a force law: an oscillation passes it twice


class Motion:
    """A run in progress in ``levels``; collects segments and events.

    time: present time [s]. message: cause of a failure, or "". The run begins with ``process_start`` or ``advance``.
    """

    def __init__(self, levels: LoadedLevels, start: Start, sums_works: bool = True) -> None:
        self.levels, self.start, self.model = levels, start, levels.model
        self.time, self.message = start.time, ""
        self._sums_works = sums_works
        self._levels = levels.in_core
        self._run = self._new_run(start.time)
        if start.state is None:
            self._run.begin(core_start(levels, start))
        else:
            self._run.go_on_from(_core_state(start.state, start.time), loads_differ=True)
        self._last = start.state

    @classmethod
    def ended(cls, levels: LoadedLevels, built: core.Levels, start: Start, run: core.BatchRun) -> Motion:
        """Return the motion of a run that has been done in a batch."""
        motion = cls.__new__(cls)
        motion.levels, motion.start, motion.model = levels, start, levels.model
        motion._levels, motion._run, motion._last = built, cast(core.Run, run), None  # it has the record of a run
        assert run.final_state is not None, "a run that is complete has a final state"
        motion.time, motion.message, motion._sums_works = run.final_state.time, "", True
        return motion

    def _new_run(self, time: float) -> core.Run:
        run = core.Run(self._levels, *limits(self.model), time)
        run.sums_works = self._sums_works
        if self.levels.excitation.pushes:
            run.trajectory.ledger.start_potential = self.levels.excitation.static.dot(self.start.displacement)
        return run

    def process_start(self) -> Motion:
        """Process the events at the start, and return the motion."""
        self._advance(self.time)
        return self

    @property
    def state(self) -> State:
        """The present state; there is none after a failure at the start."""
        state = self._state()
        assert state is not None, self.message
        return state

    def _state(self) -> State | None:
        """The present state, None before the first one."""
        final = self._run.final_state
        if final is None:
            return self._last
        level, phases = self.levels.level(final.key), [PHASES[phase.value] for phase in final.phases]
        return State(level, np.asarray(final.displacement), np.asarray(final.velocity), tuple(phases))

    @property
    def record(self) -> Record:
        """Segments and events so far."""
        return Record(self.levels, self._levels, self._run.trajectory)

    @property
    def start_loss(self) -> Loss:
        """Energies [J] lost at the start that no event records."""
        return self._final().start_loss

    @property
    def events(self) -> Events:
        """Events so far."""
        return Events(self.record)

    def continue_from(self, state: State, time: float) -> None:
        """Drop the collected segments and events, and continue from a state and a time [s]."""
        before = self._run.final_state
        self.time, self.message = time, ""
        self._run = self._new_run(time)
        interval, age = (0, 0.0) if before is None else (before.interval, before.age)
        self._run.go_on_from(_core_state(state, time, interval, age), loads_differ=False)

    @property
    def static_state(self) -> State:
        """The present state as a state under static loads alone."""
        return self.levels.without_channels(self.state)

    def advance(self, end: float, to_change: bool = False) -> None:
        """Advance the state to ``end`` [s] or a failure; with ``to_change`` no further than the first event."""
        if not self.message and self.time < end:
            self._advance(end, to_change)

    def _advance(self, end: float, to_change: bool = False) -> None:
        """Advance to ``end`` [s]; a failure ends the run, with its instant and its cause."""
        try:
            told = self._run.advance(end, to_change)
            if told is not None:
                final = self._run.final_state
                raise failure(self.model, told, () if final is None else final.key)
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            singular = "" if isinstance(error, MultiPhiError) else "linear algebra of a level fails: "
            self.message = f"at t = {self._run.time:.9g} s: {singular}{error}"
        self.time = self._run.time

    def _final(self) -> FinalState:
        kept = self._run.trajectory
        counts = Counts(self.model.levels_built, kept.transitions, kept.evaluations, kept.memory, self._levels.bytes)
        return FinalState(self.record, self._state(), copy.copy(kept.ledger), counts)

    def trajectory(self, end: float, again: Rerun | None = None) -> Trajectory:
        """Trajectory of the segments and events so far; again: see Trajectory."""
        final = self._final()
        return Trajectory(
            model=self.model,
            segments=final.record,
            events=Events(final.record),
            t_end=self.time if self.message else end,
            status="failed" if self.message else "ok",
            message=self.message,
            start=self.start,
            ending=final,
            load=self.levels.excitation.static,
            again=again,
        )


def core_start(levels: LoadedLevels, start: Start) -> core.Start:
    """Return a start as the core takes it, with the strain energy of the links that act by their springs."""
    return core.Start(start.displacement, start.velocity, start.held, start.states, _spring_energy(levels, start))


def _spring_energy(levels: LoadedLevels, start: Start) -> float:
    """Return the strain energy [J] of the links that act by their springs at the start."""
    base = levels.model.base
    links = [k for k in start.penetrating if np.isfinite(base.stiffnesses[k])]
    if not links:
        return 0.0
    channels = np.concatenate([levels.drive.values[0], start.held])
    gaps = start.displacement @ base.directions[:, links] + base.gaps[links]
    gaps = gaps - levels.excitation.stops[links] @ channels
    return 0.5 * float(base.stiffnesses[links] @ (gaps * gaps))


def _core_state(state: State, time: float, interval: int = 0, age: float = 0.0) -> core.FinalState:
    """Return a state as the core takes it."""
    phases = [core.Phase(NUMBERS[phase]) for phase in state.phases]
    return core.FinalState(time, state.states, state.displacement, state.velocity, phases, interval, age)


def failure(model: MultiPhiModel, told: core.Failure, states: Sequence[int]) -> NumericalFailure:
    """Return the error of a run that the core has ended; states: of the elements in the level where it failed."""
    facts, names = told.details, ", ".join(model.contacts[i].name for i in sorted(set(told.elements)))
    complete = model.level_at(()).modes == model.base.modes.count
    window, limit = limits(model)
    sentences = {
        core.Cause.not_finite: "the motion is not finite" + _laws_at_an_end(model, states),
        core.Cause.search_too_long: "search for the next event: got motion of up to "
        f"{facts[0] / (2 * math.pi):g} Hz, whose samples every {facts[1]:g} s until the end, in {facts[2]:g} s, would "
        "take too long; need fewer modes or a shorter run",
        core.Cause.chatter: f"chatter: {window} events in {facts[0]:g} s, more than {limit} in a period of the "
        f"highest kept mode or load ({facts[1]:g} Hz), or all within {ACCUMULATED:g} of the time so far; need "
        + ("" if complete else 'MultiPhiModel(..., boundary="residual"), which has no impacts, or ')
        + "contacts of finite stiffness",
        core.Cause.not_admissible: f"contacts {names}: no set of closed contacts is admissible at this instant",
        core.Cause.squeezed: f"rigid contacts {names}: their stops move against each other and leave no way out"
        + ("" if complete else " in the kept modes, need more of them"),
        core.Cause.unsettled: "no contact forces were found that agree with the motion: round-off decides which "
        "contacts push, or friction is too high for a unique answer, need a smaller coefficient of friction",
        core.Cause.mixed_restitution: f"rigid contacts {names}: struck together, but their restitutions differ, need "
        "one value",
        core.Cause.gaining_energy: f"rigid contacts {names}: an impact with friction and different restitutions would "
        "create energy, need one value of restitution",
        core.Cause.record_full: f"record: got {facts[0] / 1e9:.2g} GB of {facts[1]:.0f} segments, need at most "
        f"{facts[2] / 1e9:.2g} GB: make the run shorter and continue it (start=), or give loads fewer samples",
    }
    return NumericalFailure(sentences[told.cause])


def _laws_at_an_end(model: MultiPhiModel, states: Sequence[int]) -> str:
    """Return what is said of force laws that are continued beyond their spans where a run has failed."""
    laws = [
        law
        for law, state in zip(model.contacts, states, strict=False)
        if isinstance(law, ForceLaw) and law.is_last(state)
    ]
    spans = ", ".join(f"{law.name!r} ({law.knots[0]:g}, {law.knots[-1]:g})" for law in laws)
    return f"; force laws whose last segments would be continued beyond their spans: {spans}" if laws else ""


def limits(model: MultiPhiModel) -> tuple[int, float]:
    """Window of the chatter check [events], and largest number of events in a period of the highest mode or load.

    Both grow with the number of contacts: stops side by side are all struck in a small part of a period, once each.
    They grow with that of knots: a law of many, close to each other, passes them all in a small part of a period.
    """
    contacts = max(1, len(model.contacts) - len(model.force_laws))  # that are no force laws
    knots = sum(law.levels for law in model.force_laws)
    window = CHATTER_WINDOW * contacts + PASSES_IN_WINDOW * knots
    return window, EVENTS_PER_PERIOD * contacts + PASSES_PER_PERIOD * knots
