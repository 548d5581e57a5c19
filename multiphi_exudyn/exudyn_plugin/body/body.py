"""Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 holds q, ObjectGenericODE2 the matrices of the level, NodeGenericData the level: for every contact
0 open or 1 closed, then for every contact its phase (events/rule.py: 0 armed, 1 recovering, 2 refused).

After every step a certified test (certified_step.py) says whether a contact can have asked to change. If so, the step
is repeated from its start exactly, by the machinery of ``simulate``, with the force of the step's mean held constant;
where something happened, Exudyn's coordinates, matrices and level are replaced by what came out. The accelerations that
are written carry the force which loads and connectors give in the new level. Halving the step divides the difference to
``simulate`` by four; matched to the step (stepped_level.py) it is round-off for a body on its own.

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
from multiphi_exudyn.events.state import Loss, Phase, State
from multiphi_exudyn.events.transition import LoadedLevel
from multiphi_exudyn.exudyn_plugin.body.certified_step import Lookahead, StepTest
from multiphi_exudyn.exudyn_plugin.body.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.exact_step import ExactStep
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of, nothing_acts_on, running_solver
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.reliability import warnings_of_body

__all__ = ["MultiPhiBody"]

ROUND_OFF = 1e-12  # of the energy at the start: an impact that takes less is none
SAME_STEP = 1e-6  # relative change of the step size that is rounding of the times
LOOK_AGAIN = 8  # steps to wait after a lookahead that could not decide


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
        self._tests: BoundedCache[tuple[int, ...], tuple[StepTest, Lookahead]] = BoundedCache(most)
        self._step = self._rounding = self._ahead = self._speed = math.nan
        self._alone, self._clear, self._wait = False, 0, 0
        self._x = np.zeros(0)
        self._record = RunRecord(self._state, motion.start_loss)
        stepped, state = self._stepped(self._state.closed), self._state
        self.coordinates = Coordinates(self.items, stepped)
        self._given = stepped.state(state.displacement, state.velocity, np.zeros(self._size))
        self._given_events = tuple(motion.events)

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, phases; the last two after an event or at the start of a run."""
        return self._state

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
        return warnings_of_body(self.model, self._record.of(self.events))

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

    # ------------------------------------------------------------------ a step

    def _plain_rule(self) -> EventRule:
        """The event rule under static loads."""
        return self._motion.rule

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

    def look_again(self) -> None:
        """Take the present state as the start of the next step: another body's event may have moved this one."""
        if not self._clear:
            self._sample()

    # ------------------------------------------------------------------ start of a run

    def _begin_static(self, mbs: Any) -> None:
        """Give a static solution the level that the system has at its start, whatever the last run ended in."""
        self.coordinates.attach(mbs)
        closed, _ = self.coordinates.stored()
        if closed != self.coordinates.stepped.closed:
            self._load(mbs, closed)

    def _begin(self, mbs: Any, t: float) -> None:
        """Take state and level from the system as it stands at the start of a run."""
        self.check_integration(mbs.sys["simulationSettings"], trapezoidal=False)
        here = self.coordinates
        here.attach(mbs)
        self._alone = nothing_acts_on(mbs, self.items["nGenericODE2"], self.items["oGenericODE2"])
        if here.rigid and not self._alone:
            self._check_start(mbs)
        self._clear = self._wait = 0
        self._motion.segments.clear()
        stepped, (q, q_t, q_tt) = here.stepped, here.views
        closed, phases = here.stored()
        if closed != stepped.closed:  # the accelerations have been computed with stale matrices
            stepped = self._enter(mbs, closed)
            acting = here.acting(mbs, mbs.sys["dynamicSolver"].it.currentStepSize)
            q_tt[:] = stepped.acceleration(q, q_t, acting[: self._size])
        force = here.force(here.read())[: self._size]
        fresh = np.array_equal(q, self._given[0]) and np.array_equal(q_t, self._given[1])
        self.events[:] = [replace(event, time=t) for event in self._given_events] if fresh else []
        if fresh:  # only now the force is known, which the velocity of matched modes contains
            q_t += stepped.from_force @ force
            q_tt[:] = stepped.acceleration(q, q_t, force)
        here.write(here.views)
        r, eta_t = stepped.loaded.level.modes, stepped.velocity(q, q_t, force)
        self._state = State(self._rule.level(closed), q[:r].copy(), eta_t[:r], phases)
        self._record = RunRecord(self._state, self._motion.start_loss if fresh else Loss())
        self._most = 0.0
        self._x = here.read()
        self._take_step(mbs.sys["dynamicSolver"].it.currentStepSize)
        self._sample()
        self.time = t
        bodies_of(mbs).end = float(mbs.sys["simulationSettings"].timeIntegration.endTime) - self._rounding

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
        stepped = self.coordinates.stepped
        if state.closed != stepped.closed:
            stepped = self._enter(mbs, state.closed)
        force = force + self._own_force(state.closed, self.time)
        self.coordinates.write(stepped.state(state.displacement, state.velocity, force[: self._size]))
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
        self._state = state
        self._record.see(state)
        self._choose_test()
        self.coordinates.store(state)

    def _choose_test(self) -> None:
        self._test, self._lookahead = self._tests.get_or_build(self._state.closed, self._new_tests)

    def _new_tests(self) -> tuple[StepTest, Lookahead]:
        closed = self._state.closed
        rows = [self._rule.function(self._state.level, contact) for contact in self._rule.ends(closed)]
        given, known = (self._stepped(closed), rows, self._step), self._direct(closed)
        direct = np.zeros((len(rows), known.shape[1]))
        for k, contact in enumerate(self._rule.ends(closed)):
            if contact in closed:
                direct[k] = known[closed.index(contact)]
        return StepTest(*given, direct), Lookahead(*given)

    def _stepped(self, closed: tuple[int, ...]) -> SteppedLevel:
        return self._stepped_levels.get_or_build(
            closed, lambda: SteppedLevel.of(self._rule.level(closed), self._size, self.matched_step)
        )
