"""Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 holds q, ObjectGenericODE2 the matrices of the level, NodeGenericData the level: for every contact
0 open or 1 closed, then for every contact its phase (event_rule.py: 0 armed, 1 recovering, 2 refused).

After every step a certified test (step_test.py) says whether a contact can have asked to change. If so, the step is
repeated from its start exactly, by the machinery of ``simulate``, with the force of the step's mean held constant;
where something happened, Exudyn's coordinates, matrices and level are replaced by what came out. The accelerations
that are written carry the force which loads and connectors give in the new level. Halving the step divides the
difference to ``simulate`` by four; matched to the step (stepped_level.py) it is round-off for a body on its own.

A load or connector at coordinate k of the node acts on mode k of whichever level holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.event_rule import EventRule
from multiphi_exudyn.exudyn_plugin.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.modal_force import ForcedRule, shift
from multiphi_exudyn.exudyn_plugin.step_test import Lookahead, StepTest
from multiphi_exudyn.exudyn_plugin.stepped_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.switching import nothing_acts_on, running_solver
from multiphi_exudyn.motion import Motion
from multiphi_exudyn.recent import Recent
from multiphi_exudyn.state import Event, Phase, State
from multiphi_exudyn.transition import LoadedLevel

__all__ = ["MultiPhiBody"]

NEGLIGIBLE = 1e-9  # of the accelerations: what Newton's iterations leave unbalanced is no modal force
SAME_STEP = 1e-6  # relative change of the step size that is rounding of the times
LOOK_AGAIN = 8  # steps to wait after a lookahead that could not decide

ForceIn = Callable[[tuple[int, ...]], np.ndarray]  # a modal force (s,) by the closed contacts of a level


class MultiPhiBody:
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
        self._rule = self._plain_rule()
        self._size = self._rule.level(()).level.modes
        self._state = self._plain(motion.state)
        most = self.model.most_levels
        self._stepped_levels: Recent[tuple[int, ...], SteppedLevel] = Recent(most)
        self._tests: Recent[tuple[int, ...], tuple[StepTest, Lookahead]] = Recent(most)
        self._step = self._rounding = self._ahead = self._speed = math.nan
        self._alone, self._clear, self._wait = False, 0, 0
        self._x = np.zeros(0)
        stepped, state = self._stepped(self._state.closed), self._state
        self.coordinates = Coordinates(self.items, stepped)
        self._given = stepped.state(state.displacement, state.velocity, np.zeros(self._size))
        self._given_events = tuple(motion.events)

    @property
    def events(self) -> list[Event]:
        """Closings and openings with their exact times."""
        return self._motion.events

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, phases; the last two after an event or at the start of a run."""
        return self._state

    @property
    def start(self) -> tuple[np.ndarray, np.ndarray]:
        """Initial coordinates and velocities (s,) of the node."""
        return self._given[0], self._given[1]

    def stepped_level(self, closed: Sequence[int]) -> SteppedLevel:
        """The level of closed contacts as the solver has it."""
        return self._stepped(tuple(closed))

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Constant force (s,) of the object in a level, at the present time."""
        return stepped.drive

    def shown(
        self, stepped: SteppedLevel, eta: np.ndarray, eta_t: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level and coordinates (.., k), with their rates, in which configurations and forces are read."""
        return stepped.loaded, eta, eta_t

    def _plain_rule(self) -> EventRule:
        """The event rule under static loads."""
        return self._motion.rule

    def _plain(self, state: State) -> State:
        """A state of the motion as one of the level under static loads."""
        return state

    def _own_force(self, closed: tuple[int, ...], time: float) -> np.ndarray:
        """Modal force (s,) of the body's own varying loads at a time, in a level."""
        return np.zeros(self._size)

    # ------------------------------------------------------------------ a step

    def before_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn before a step that ends at t."""

    def after_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn when a step is done, and at the start."""
        if not abs(t - self.time - self._step) <= self._rounding and not self._is_step(mbs, t):
            return
        self.time, begun = t, self.time
        if self._clear:
            self._clear -= 1
            if not self._clear:
                self._sample()
            return
        x = self.coordinates.read()
        least, ahead, speed = self._test.at(x)
        limit = speed if speed > self._speed else self._speed
        if self._test.directly:
            limit += self._test.half_change(self._x, x)
        if not (least > limit and self._ahead > limit):
            self._repeat(mbs, begun, self._x, x)
            self._sample()
            return
        self._x, self._ahead, self._speed = x, ahead, speed
        self._wait -= 1
        if not self._wait:
            self._look_ahead()

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
        if self._clear:
            self._x = self._lookahead.after(self._x, self._lookahead.steps - self._clear)
            self._clear = 0
        self._take_step(t - self.time)
        return True

    def _take_step(self, step: float) -> None:
        """Prepare for steps of this length [s]."""
        if self.matched_step is not None and abs(step - self.matched_step) > SAME_STEP * step:
            raise MultiPhiValueError(
                f"matchedStepSize of {self.name!r}: got {self.matched_step:g} s and a solver's step of "
                f"{step:g} s, need the same (beside contacts of Exudyn too: discontinuous.useRecommendedStepSize=False)"
            )
        self._step, self._rounding = step, SAME_STEP * step
        self._tests.clear()
        self._choose_test()
        _, self._ahead, self._speed = self._test.at(self._x)

    def _sample(self) -> None:
        """Take the present state as the start of the next step."""
        self._x = self.coordinates.read()
        _, self._ahead, self._speed = self._test.at(self._x)
        if any(phase is not Phase.ARMED for phase in self._state.phases):
            self._ahead = -math.inf  # what ends such a phase is looked for exactly
        elif self._alone:
            self._look_ahead()

    def _look_ahead(self) -> None:
        """Skip the test of steps that are clear already; only for a body on which nothing acts."""
        clear = self._lookahead.clear(self._x, self._speed)
        self._clear = self._lookahead.steps if clear else 0
        self._wait = LOOK_AGAIN

    def _repeat(self, mbs: Any, begun: float, before: np.ndarray, after: np.ndarray) -> None:
        """Do the step from ``before`` again, exactly, and write what came out if anything happened in it.

        After the event the force of the mean acts, and what the event changed in loads and connectors. Forces of
        constraints at the end of a step would not do: the trapezoidal rule lets them alternate, true in the mean.
        """
        here, start, known = self.coordinates, self._state, len(self.events)
        own = here.stepped
        given = self._own_force(start.closed, begun) + self._own_force(start.closed, self.time)
        force = self._significant((own.force(before) + own.force(after) - given) / 2, after)
        state = self._travel(before, begun, force, force, own)
        if len(self.events) == known and state.closed == start.closed:
            self._keep(replace(start, phases=state.phases))
            return
        if self._alone:
            self._write(mbs, state, force)
            return
        rest = force + self._own_force(start.closed, self.time) - here.applied(mbs)
        entered = self._stepped(state.closed)
        self._write(mbs, state, here.carried(force, own, entered))
        outside = here.applied(mbs) + here.carried(rest, own, entered) - self._own_force(state.closed, self.time)
        present = self._significant(outside, after)
        if np.any(present != force):
            del self.events[known:]
            self._state = start
            self._write(mbs, self._travel(before, begun, force, present, entered), present)

    def _travel(
        self, before: np.ndarray, begun: float, force: np.ndarray, entered: np.ndarray, given: SteppedLevel
    ) -> State:
        """State now, of the exact motion from ``before`` under ``force`` until a contact changes, then ``entered``.

        given: the level in whose modes ``entered`` is told.
        """
        closed = self._state.closed

        def after(level: tuple[int, ...]) -> np.ndarray:
            return self.coordinates.carried(entered, given, self._stepped(level))

        def until(level: tuple[int, ...]) -> np.ndarray:
            return force if level == closed else after(level)

        q, q_t, _ = self.coordinates.split(before)
        eta_t = self._stepped(closed).velocity(q, q_t, force + self._own_force(closed, begun))
        loaded = self._rule.level(closed)
        r = loaded.level.modes
        state = State(loaded, q[:r], eta_t[:r], self._state.phases)
        if not (np.any(force) or np.any(entered)):
            return self._advanced(state, begun, None)
        changed = self._advanced(state, begun, until, to_change=entered is not force)
        return changed if self._motion.time == self.time else self._advanced(changed, self._motion.time, after)

    def _advanced(self, state: State, begun: float, force_in: ForceIn | None, to_change: bool = False) -> State:
        """The state now, or at the first event before, of the exact motion under modal forces by levels."""
        motion = self._motion
        rule = self._rule if force_in is None else ForcedRule(self._rule, force_in, self._direct)

        def centre(level: tuple[int, ...]) -> np.ndarray | float:
            return 0.0 if force_in is None else shift(rule.level(level).level, force_in(level))

        shifted = replace(state, level=rule.level(state.closed), displacement=state.displacement - centre(state.closed))
        motion.rule, motion.state, motion.time = *self._set_out(rule, shifted, begun), begun
        motion.advance(self.time, to_change)
        if motion.message:
            raise NumericalFailure(f"body {self.name!r}: {motion.message}")
        if motion.time == self.time:
            motion.segments.pop()  # those that remain end with events: the chatter check counts them
        del motion.segments[: -motion.window - 1]
        end = self._plain(motion.state)
        return State(self._rule.level(end.closed), end.displacement + centre(end.closed), end.velocity, end.phases)

    def _direct(self, closed: tuple[int, ...]) -> np.ndarray:
        """L (k, s) in a level, see Coordinates."""
        return self.coordinates.direct(self._stepped(closed))

    def _set_out(self, rule: EventRule, state: State, time: float) -> tuple[EventRule, State]:
        """Rule and state of an exact motion from a time on."""
        return rule, state

    def _significant(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The modal force; zeros where it is what an iterative solver leaves of the accelerations in x, and alone."""
        q_tt = x[2 * self._size : -1]
        acts = not self._alone and force.dot(force) > NEGLIGIBLE**2 * q_tt.dot(q_tt)
        return force if acts else np.zeros(self._size)

    # ------------------------------------------------------------------ start of a run

    def _begin_static(self, mbs: Any) -> None:
        """Give a static solution the level that the system has at its start, whatever the last run ended in."""
        self.coordinates.attach(mbs)
        closed, _ = self.coordinates.stored()
        if closed != self.coordinates.stepped.closed:
            self._load(mbs, closed)

    def _begin(self, mbs: Any, t: float) -> None:
        """Take state and level from the system as it stands at the start of a run."""
        self._check_settings(mbs)
        here = self.coordinates
        here.attach(mbs)
        self._alone = nothing_acts_on(mbs, self.items["nGenericODE2"], self.items["oGenericODE2"])
        self._clear = self._wait = 0
        self._motion.segments.clear()
        stepped, (q, q_t, q_tt) = here.stepped, here.views
        closed, phases = here.stored()
        if closed != stepped.closed:  # the accelerations have been computed with stale matrices
            stepped = self._enter(mbs, closed)
            q_tt[:] = stepped.acceleration(q, q_t, here.applied(mbs))
        force = stepped.force(here.read())
        fresh = np.array_equal(q, self._given[0]) and np.array_equal(q_t, self._given[1])
        self.events[:] = [replace(event, time=t) for event in self._given_events] if fresh else []
        if fresh:  # only now the force is known, which the velocity of matched modes contains
            q_t += stepped.from_force @ force
            q_tt[:] = stepped.acceleration(q, q_t, force)
        here.write(here.views)
        r, eta_t = stepped.loaded.level.modes, stepped.velocity(q, q_t, force)
        self._state = State(self._rule.level(closed), q[:r].copy(), eta_t[:r], phases)
        self._x = here.read()
        self._take_step(mbs.sys["dynamicSolver"].it.currentStepSize)
        self._sample()
        self.time = t

    def _check_settings(self, mbs: Any) -> None:
        integration = mbs.sys["simulationSettings"].timeIntegration.generalizedAlpha
        if not integration.useNewmark and integration.spectralRadius != 1:
            raise MultiPhiValueError(
                f"spectralRadius: got {integration.spectralRadius:g}, need 1 (or TrapezoidalIndex2) "
                f"with the Multi-Phi body {self.name!r}"
            )
        if self.coordinates.interface is not None and not integration.useIndex2Constraints:
            raise MultiPhiValueError(
                f"solverType: got constraints of index 3, need TrapezoidalIndex2 with the interface of {self.name!r}"
            )
        if self.coordinates.interface is not None and any(contact.rigid for contact in self.model.contacts):
            self.coordinates.interface.check_impacts()

    def check_called(self, mbs: Any, t: float) -> None:
        """Raises if a step has been made without ``after_step``: somebody else's PostStep function is installed."""
        solver = mbs.sys.get("dynamicSolver")
        if self.time == t or solver is None or solver.it.currentStepIndex == 0 or solver.it.currentTime != t:
            return
        raise MultiPhiValueError(
            f"PostStepUserFunction: got a function that replaced the switching of {self.name!r}, need it set "
            "before CreateMultiPhiBody (it is then called after the switching)"
        )

    # ------------------------------------------------------------------ levels in Exudyn

    def _write(self, mbs: Any, state: State, force: np.ndarray) -> None:
        """Put a state at the end of a step into the system, with the acceleration under a modal force."""
        stepped = self.coordinates.stepped
        if state.closed != stepped.closed:
            stepped = self._enter(mbs, state.closed)
        force = force + self._own_force(state.closed, self.time)
        self.coordinates.write(stepped.state(state.displacement, state.velocity, force))
        self._keep(state)

    def _enter(self, mbs: Any, closed: tuple[int, ...]) -> SteppedLevel:
        """Make a level that of the dynamic solver at work."""
        stepped = self._load(mbs, closed)
        if self.matched_step is not None:  # a solver may take the mass matrix for constant and keep it
            mbs.sys["dynamicSolver"].ComputeMassMatrix(mbs)
        mbs.solverSignalJacobianUpdate = True
        return stepped

    def _load(self, mbs: Any, closed: tuple[int, ...]) -> SteppedLevel:
        """Give the system the matrices of a level."""
        stepped = self._stepped(closed)
        self.coordinates.load(mbs, stepped, self.force_vector(stepped))
        return stepped

    def _keep(self, state: State) -> None:
        """Remember a state, choose its test, and write its level into the data node."""
        self._state = state
        self._choose_test()
        self.coordinates.store(state)

    def _choose_test(self) -> None:
        self._test, self._lookahead = self._tests.made(self._state.closed, self._new_tests)

    def _new_tests(self) -> tuple[StepTest, Lookahead]:
        closed = self._state.closed
        rows = [self._rule.function(self._state.level, contact) for contact in self._rule.ends(closed)]
        given, direct = (self._stepped(closed), rows, self._step), np.zeros((len(rows), self._size))
        for k, contact in enumerate(self._rule.ends(closed)):
            if contact in closed:
                direct[k] = self._direct(closed)[closed.index(contact)]
        return StepTest(*given, direct), Lookahead(*given)

    def _stepped(self, closed: tuple[int, ...]) -> SteppedLevel:
        return self._stepped_levels.made(
            closed, lambda: SteppedLevel.of(self._rule.level(closed), self._size, self.matched_step)
        )
