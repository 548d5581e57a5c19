"""Motion: a run in progress, which the core advances from event to event.

A failure ends the run early, with its cause.
"""

from __future__ import annotations

import copy
from typing import cast

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import Loss, State
from multiphi_exudyn.time.core_levels import core_levels
from multiphi_exudyn.time.record.record import PHASES, Record
from multiphi_exudyn.time.record.recorded_segments import Events, Recorded
from multiphi_exudyn.time.run.chatter import limits
from multiphi_exudyn.time.run.failures import failure
from multiphi_exudyn.time.start_conditions import Start
from multiphi_exudyn.time.trajectory.final_state import NUMBERS, FinalState
from multiphi_exudyn.time.trajectory.trajectory import Rerun, Trajectory

__all__ = ["Motion", "core_start"]


class Motion:
    """A run in progress in ``levels``; collects segments and events.

    time: present time [s]. message: cause of a failure, or "". The run begins with ``process_start`` or ``advance``.
    """

    def __init__(self, levels: LoadedLevels, start: Start, sums_works: bool = True) -> None:
        self.levels, self.start, self.model = levels, start, levels.model
        self.time, self.message = start.time, ""
        self._sums_works = sums_works
        self._levels = core_levels(levels)
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
        ledger = copy.copy(self._run.trajectory.ledger)
        return FinalState(self.record, self._state(), ledger, self.model.levels_built)

    def trajectory(self, end: float, again: Rerun | None = None) -> Trajectory:
        """Trajectory of the segments and events so far; again: see Trajectory."""
        final = self._final()
        return Trajectory(
            model=self.model,
            segments=Recorded(final.record),
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
