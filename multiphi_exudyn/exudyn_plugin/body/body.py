"""Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 holds q, ObjectGenericODE2 the matrices of the level, NodeGenericData the level: for every contact
0 open or 1 closed, then for every contact its phase (events/rule.py: 0 armed, 1 recovering, 2 refused).

A body on which nothing acts but its own loads follows a motion that is known beforehand (run_ahead.py): at the ends of
steps with events its coordinates, matrices and level are those of ``simulate``. In between Exudyn's steps are of second
order, and exact if matched to the step (stepped_level.py). Of a body whose loads vary every step ends exactly.

Beside others a certified test (certified_step.py) says after every step whether a contact can have asked to change. If
so, the step is repeated from its start exactly, by the machinery of ``simulate``, with the force of the step's mean
held constant; where something happened, Exudyn's coordinates, matrices and level are replaced by what came out. The
accelerations that are written carry the force which loads and connectors give in the new level. Halving the step
divides the error by four.

A load or connector at coordinate k of the node acts on mode k of whichever level holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import Event, Loss, Phase, State
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.exudyn_plugin.body.certified_step import StepTest
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP, Coordinates, flags_of
from multiphi_exudyn.exudyn_plugin.body.exact_step import ExactStep
from multiphi_exudyn.exudyn_plugin.body.known_motion import KnownMotion
from multiphi_exudyn.exudyn_plugin.body.run_ahead import RunAhead
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of, nothing_acts_on, running_solver
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.reliability import warnings_of_body
from multiphi_exudyn.time.simulate import motion_of

__all__ = ["MultiPhiBody"]

ROUND_OFF = 1e-12  # of the energy at the start: an impact that takes less is none


class MultiPhiBody(ExactStep):
    """One body: its items, its present state, and what happened to it.

    name, model; items: typed indices; matched_step: h [s] or None; events: of the last run, in order; coordinates: its
    part of the system.
    """

    def __init__(self, name: str, motion: Motion, matched_step: float | None) -> None:
        self.name = name
        self.model = motion.model
        self.items: dict[str, Any] = {}
        self.matched_step = matched_step
        self.time = math.nan
        self._motion = motion
        self._rule: EventRule = self._plain_rule()
        self._size = self._rule.level(()).level.modes
        self._state = self._plain(motion.state)
        most = self.model.most_levels
        self._stepped_levels: BoundedCache[tuple[int, ...], SteppedLevel] = BoundedCache(most)
        self._tests: BoundedCache[tuple[int, ...], StepTest] = BoundedCache(most)
        self._step = self._rounding = self._clearance = self._speed = math.nan
        self._run_ahead: RunAhead | None = None
        self._x, self._most = np.zeros(0), 0.0
        self._record = RunRecord(self._state, motion.start_loss)
        stepped, state = self._stepped(self._state.closed), self._state
        self.coordinates = Coordinates(self.items, stepped, most, matched_step is not None)
        self._given = stepped.state(state.displacement, state.velocity, np.zeros(self._size))
        self._given_events = tuple(motion.events)

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, phases; the last two after an event or at the start of a run."""
        return self._state

    @property
    def events(self) -> list[Event]:
        """Closings and openings with their exact times."""
        return self._motion.events + ([] if self._run_ahead is None else self._run_ahead.events)

    @property
    def next_time(self) -> float:
        """When [s] it has something to do next, -inf where that is at the end of every step."""
        ahead = self._run_ahead
        return ahead.next_time if ahead is not None and ahead.running else -math.inf

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""
        return False

    @property
    def rigid(self) -> bool:
        """Whether it has rigid contacts."""
        return self.coordinates.rigid

    @property
    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Initial coordinates and velocities (s,) of the node."""
        return self._given[0], self._given[1]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to distrust in the last run, before any in the start, and what to do about it, a sentence each."""
        truncated = 0.0 if self._run_ahead is None else self._run_ahead.recorded()
        return warnings_of_body(self.model, self._record.of(self._motion.events, truncated))

    def stepped_level(self, closed: Sequence[int]) -> SteppedLevel:
        """The level of closed contacts as the solver has it."""
        return self._stepped(tuple(closed))

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Constant force (s,) of the object in a level, at the present time."""
        return stepped.drive

    def own_forces(self, closed: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of its own varying loads at times (k,) [s], in a level."""
        return np.zeros((len(times), self._size))

    def shown(
        self, stepped: SteppedLevel, eta: np.ndarray, eta_t: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level and coordinates (.., k), with their rates, in which configurations and forces are read."""
        return stepped.loaded, eta, eta_t

    # ------------------------------------------------------------------ a step

    def _plain_rule(self) -> EventRule:
        """The event rule under static loads."""
        return self._motion.rule

    def before_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn before a step that ends at t."""

    def after_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn when a step is done, and at the start; one that is alone may not be."""
        ahead = self._run_ahead
        if ahead is not None and ahead.running and ahead.time < t:
            if t < ahead.next_time:
                return
            index = mbs.sys["dynamicSolver"].it.currentStepIndex
            if index > ahead.index:
                self.time = t
                ahead.arrive(mbs, t, index)
                return
        if abs(t - self.time - self._step) <= self._rounding or self._is_step(mbs, t):
            self.time, begun = t, self.time
            self._check_step(mbs, begun)

    def _check_step(self, mbs: Any, begun: float) -> None:
        """Do the step from a time [s] on again exactly where something may have happened in it."""
        x = self.coordinates.read()
        least, ahead, speed = self._test.at(x)
        limit = speed if speed > self._speed else self._speed
        if self._test.directly:
            limit += self._test.half_change(self._x, x)
        if not (least > limit and self._clearance > limit):
            self._repeat(mbs, begun, self._x, x)
            self._sample()
            return
        self._x, self._clearance, self._speed = x, ahead, speed

    def _is_step(self, mbs: Any, t: float) -> bool:
        """Whether t ends a step, and not the start of a run or a static solution; takes the step size."""
        solver = running_solver(mbs, t)
        if solver is None:
            self._step = math.nan
            self._begin_static(mbs)
            return False
        if solver.it.currentStepIndex == 0:
            self._begin(mbs, t)
            return False
        if not t > self.time:
            return False  # called twice
        self._take_step(t - self.time)
        return True

    def _take_step(self, step: float) -> None:
        """Prepare for steps of this length [s]."""
        self.check_matched(step)
        self._step, self._rounding = step, SAME_STEP * step
        self._tests.clear()
        self._choose_test()
        _, self._clearance, self._speed = self._test.at(self._x)

    def check_matched(self, step: float) -> None:
        """Raises where steps of this length [s] are not those to which modes are matched."""
        if self.matched_step is not None and abs(step - self.matched_step) > SAME_STEP * step:
            raise MultiPhiValueError(
                f"matchedStepSize of {self.name!r}: got {self.matched_step:g} s and a solver's step of "
                f"{step:g} s, need the same (beside contacts of Exudyn too: discontinuous.useRecommendedStepSize=False)"
            )

    def _sample(self) -> None:
        """Take the present state as the start of the next step."""
        self._x = self.coordinates.read()
        _, self._clearance, self._speed = self._test.at(self._x)
        if any(phase is not Phase.ARMED for phase in self._state.phases):
            self._clearance = -math.inf  # what ends such a phase is looked for exactly

    def look_again(self) -> None:
        """Take the present state as the start of the next step: another body's event may have moved this one."""
        if self._run_ahead is None:
            self._sample()

    # ------------------------------------------------------------------ start of a run

    def _begin_static(self, mbs: Any) -> None:
        """Give a static solution the level that the system has at its start, whatever the last run ended in."""
        self.coordinates.attach(mbs)
        if self._run_ahead is not None:
            self._run_ahead.running = False
        stepped = self._stepped(self.coordinates.stored()[0])
        self.coordinates.load(mbs, stepped, self.force_vector(stepped))

    def _begin(self, mbs: Any, t: float) -> None:
        """Take state and level from the system as it stands at the start of a run."""
        self.check_integration(mbs.sys["simulationSettings"], trapezoidal=False)
        here, step = self.coordinates, float(mbs.sys["dynamicSolver"].it.currentStepSize)
        self.check_matched(step)
        here.attach(mbs)
        alone = nothing_acts_on(mbs, self.items["nGenericODE2"], self.items["oGenericODE2"])
        if here.rigid and not alone:
            self._check_start(mbs)
        self._run_ahead, self._most, self.time = None, 0.0, t
        self._motion.segments.clear()
        fresh = all(np.array_equal(view, given) for view, given in zip(here.views[:2], self.start, strict=True))
        self._motion.events[:] = [replace(event, time=t) for event in self._given_events] if fresh else []
        self._state = self._taken(mbs, step, alone, fresh)
        self._record = RunRecord(self._state, self._motion.start_loss if fresh else Loss())
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        if alone:
            self._set_out(mbs, step, end)
        else:
            self._x = here.read()
            self._take_step(step)
            self._sample()
        bodies_of(mbs).end = end - SAME_STEP * step

    def _taken(self, mbs: Any, step: float, alone: bool, fresh: bool) -> State:
        """The state at the start of a run from the system, which gets the accelerations that belong to it.

        fresh: whether it starts as the body was made: only now the force is known, which the velocity of matched modes
        contains.
        """
        here, t = self.coordinates, self.time
        stepped, (q, q_t, q_tt) = here.stepped, here.views
        closed, entered = here.stored()
        if closed != stepped.closed:  # the accelerations have been computed with stale matrices
            stepped = self._enter(mbs, closed)
            if not alone:
                q_tt[:] = stepped.acceleration(q, q_t, here.acting(mbs, step)[: self._size])
        force = self.own_forces(closed, np.array([t]))[0] if alone else here.force(here.read())[: self._size]
        if fresh:
            q_t += stepped.from_force @ force
        if fresh or alone:
            q_tt[:] = stepped.acceleration(q, q_t, force)
        here.write(here.views)
        r, eta_t = stepped.loaded.level.modes, stepped.velocity(q, q_t, force)
        phases = self._phases_at(closed, q[:r], eta_t[:r], t, entered)
        return State(self._rule.level(closed), q[:r].copy(), eta_t[:r], phases)

    def _set_out(self, mbs: Any, step: float, end: float) -> None:
        """Compute the motion ahead, from the present state and time on."""
        motion, here = KnownMotion(*self._own_motion(end), self.time), self.coordinates
        here.enter(mbs, here.stepped, here.stepped.drive)
        self._step = math.nan
        self._run_ahead = RunAhead(self, motion, self._record, self.time, step, end)
        self._run_ahead.begin(mbs)

    def _own_motion(self, end: float) -> tuple[Motion, State]:
        """The motion under its own loads alone, up to ``end`` [s] at most, and the present state for it."""
        return motion_of(self.model, self._rule, self._motion.start, None), self._state

    def _phases_at(
        self, closed: tuple[int, ...], eta: np.ndarray, eta_t: np.ndarray, time: float, entered: tuple[Phase, ...]
    ) -> tuple[Phase, ...]:
        """Phases at a time [s] in a level that was entered with others: who has risen since is armed again."""
        phases = list(entered)
        if any(phase is not Phase.ARMED for phase in phases):
            rule, state = self._read_by(State(self._rule.level(closed), eta, eta_t, tuple(phases)), time)
            for contact, phase in enumerate(phases):
                if phase is not Phase.ARMED:
                    s = rule.function(state.level, contact).sign(state.displacement, state.velocity, state.reach)
                    phases[contact] = Phase.ARMED if s > 0 else phase
        return tuple(phases)

    def _read_by(self, state: State, time: float) -> tuple[EventRule, State]:
        """The rule by which a state at a time [s] is read, and the state in its coordinates."""
        return self._rule, state

    def check_integration(self, settings: Any, trapezoidal: bool) -> None:
        """Raises for settings of an implicit solver that make the body wrong; TrapezoidalIndex2 has its own."""
        integration = settings.timeIntegration.generalizedAlpha
        if not (trapezoidal or integration.useNewmark) and integration.spectralRadius != 1:
            raise MultiPhiValueError(
                f"spectralRadius: got {integration.spectralRadius:g}, need 1 with the Multi-Phi body {self.name!r}: "
                "set simulationSettings.timeIntegration.generalizedAlpha.spectralRadius = 1, or "
                "solverType=exu.DynamicSolverType.TrapezoidalIndex2"
            )
        if self.coordinates.interface is not None and not (trapezoidal or integration.useIndex2Constraints):
            raise MultiPhiValueError(
                f"solverType: got constraints of index 3, need TrapezoidalIndex2 with the interface of {self.name!r}"
            )

    def _check_start(self, mbs: Any) -> None:
        """Raises for what cannot be struck together with a body that has rigid contacts."""
        here = self.coordinates
        around = here.surroundings or here.beside(mbs)
        if around.on_body(here.stepped.mass):
            raise MultiPhiValueError(
                f"node of {self.name!r}: got a mass or a constraint on it beside rigid contacts, need it on an "
                "interface coordinate, as part of the structure, or compliant contacts"
            )
        around.apart = {
            mbs.GetNodeODE2Index(other.items["nGenericODE2"]): other.name
            for other in bodies_of(mbs).values()
            if other is not self and other.rigid
        }
        attached, lost = around.mark(), sum(event.loss.impact for event in self._given_events)
        q_t = here.views[1]
        fresh = np.array_equal(here.views[:2], self._given[:2])
        struck = fresh and lost > ROUND_OFF * (lost + 0.5 * float(q_t @ q_t))
        if struck and np.any(attached.impedance(np.eye(len(attached.mass)))):
            raise MultiPhiValueError(
                f"start of {self.name!r}: got a velocity into a rigid contact, with masses or constraints on the "
                "interface, need one that does not strike at the start"
            )

    # ------------------------------------------------------------------ levels in Exudyn

    def _write(self, mbs: Any, state: State, force: np.ndarray) -> None:
        stepped = self.coordinates.stepped
        if state.closed != stepped.closed:
            stepped = self._enter(mbs, state.closed)
        force = force + self._own_force(state.closed, self.time)
        self.coordinates.write(stepped.state(state.displacement, state.velocity, force[: self._size]))
        self._keep(state)

    def _enter(self, mbs: Any, closed: tuple[int, ...]) -> SteppedLevel:
        """Make a level that of the dynamic solver at work."""
        stepped = self._stepped(closed)
        self.coordinates.enter(mbs, stepped, self.force_vector(stepped))
        return stepped

    def _keep(self, state: State) -> None:
        self._state = state
        self._record.see(state)
        self._choose_test()
        self.coordinates.store(flags_of(state.closed, state.phases))

    def _choose_test(self) -> None:
        self._test = self._tests.get_or_build(self._state.closed, self._new_step_test)

    def _new_step_test(self) -> StepTest:
        closed = self._state.closed
        rows = [self._rule.function(self._state.level, contact) for contact in self._rule.ends(closed)]
        known = self._direct(closed)
        direct = np.zeros((len(rows), known.shape[1]))
        for k, contact in enumerate(self._rule.ends(closed)):
            if contact in closed:
                direct[k] = known[closed.index(contact)]
        return StepTest(self._stepped(closed), rows, self._step, direct)

    def _stepped(self, closed: tuple[int, ...]) -> SteppedLevel:
        return self._stepped_levels.get_or_build(
            closed, lambda: SteppedLevel.of(self._rule.level(closed), self._size, self.matched_step)
        )
