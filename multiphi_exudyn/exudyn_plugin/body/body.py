"""Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 holds q, ObjectGenericODE2 the matrices of the level, NodeGenericData the level: the states of all
elements, phases of their exits, and the places that links hold (level_data.py).

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
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Event, Loss, Phase, State
from multiphi_exudyn.exudyn_plugin.body.certified_step import StepTest
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP, Coordinates
from multiphi_exudyn.exudyn_plugin.body.exact_step import Step, exact_step
from multiphi_exudyn.exudyn_plugin.body.known_motion import KnownMotion
from multiphi_exudyn.exudyn_plugin.body.level_data import LevelData
from multiphi_exudyn.exudyn_plugin.body.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.body.run_ahead import RunAhead
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of, nothing_acts_on, running_solver
from multiphi_exudyn.exudyn_plugin.coupling.exact_motion import ExactMotion
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.motion import Motion, motion_of
from multiphi_exudyn.time.recorded import Events
from multiphi_exudyn.time.reliability import warnings_of_body

__all__ = ["MultiPhiBody"]

ROUND_OFF = 1e-12  # of the energy at the start: an impact that takes less is none


class MultiPhiBody:
    """One Multi-Phi body of an Exudyn system: its items, its present state, and what happened to it.

    Made by ``CreateMultiPhiBody``, and found as ``mbs.variables["multiPhi"][name]``.

    Parameters
    ----------
    name : str
        Of the body.
    motion : Motion
        Of the model, at its start.
    loads : sequence of loads
        Its own, as of ``simulate``.
    end : float
        Of the run [s] that they are prepared for.
    matched_step : float or None
        Step [s] that its modes are matched to.
    outside : tuple of str, default ()
        Warnings of what the base of a large structure leaves out.

    Attributes
    ----------
    model : MultiPhiModel
        What it moves by.
    items : dict
        Typed indices of its items in the system.
    coordinates : Coordinates
        Its part of the system's coordinates.

    Raises
    ------
    MultiPhiValueError
        For loads at points or contacts that there are not.

    Examples
    --------
    >>> import numpy as np
    >>> import exudyn as exu
    >>> import multiphi_exudyn as mp
    >>> from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> container = exu.SystemContainer()
    >>> mbs = container.AddSystem()
    >>> pulled = model.static_equilibrium({"tip": 100.0})
    >>> given = {"displacement": pulled, "matchedStepSize": 1e-3}
    >>> items = CreateMultiPhiBody(mbs, model, name="chain", **given)
    >>> mbs.Assemble()
    >>> settings = exu.SimulationSettings()
    >>> settings.solution.file.write = False
    >>> settings.timeIntegration.endTime = 0.1
    >>> settings.timeIntegration.numberOfSteps = 100
    >>> solver = exu.DynamicSolverType.TrapezoidalIndex2
    >>> done = mbs.SolveDynamic(settings, solverType=solver)
    >>> body = mbs.variables["multiPhi"]["chain"]
    >>> body.events[0].contact, body.warnings
    ('stop', ())
    """

    def __init__(
        self,
        name: str,
        motion: Motion,
        loads: Sequence[Load],
        end: float,
        matched_step: float | None,
        outside: tuple[str, ...] = (),
    ) -> None:
        self.name = name
        self.model = motion.model
        self.items: dict[str, Any] = {}
        self.matched_step = matched_step
        self._time, self._told = math.nan, 0.0
        self._motion, self._loads, self._outside = motion, tuple(loads), outside
        self._size = self.model.level_at(()).modes
        self._own = OwnLoads(self.model, loads, self._size, 0.0, end)
        self._state = motion.static_state
        most = self.model.most_levels
        self._stepped_levels: BoundedCache[tuple[int, ...], SteppedLevel] = BoundedCache(most)
        self._tests: BoundedCache[tuple[int, ...], StepTest] = BoundedCache(most)
        self._step = self._rounding = math.nan
        self._test: StepTest | None = None
        self._run_ahead: RunAhead | None = None
        self._exact: ExactMotion | None = None
        self._most = 0.0
        self._record = RunRecord(self._state, motion.start_loss)
        stepped, state = self._stepped(self._state.states), self._state
        layout, matched = LevelData(self.model), matched_step is not None
        self.coordinates = Coordinates(self.items, stepped, state.held, layout, most, matched)
        self._given = stepped.state(state.displacement, state.velocity, np.zeros(self._size))
        self._given_events = tuple(Events(motion.record))
        self._events = list(self._given_events)

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, phases; the last two after an event or at the start of a run."""
        return self._state

    @property
    def events(self) -> list[Event]:
        """Closings and openings with their exact times."""
        return self._events + ([] if self._run_ahead is None else self._run_ahead.events)

    @property
    def time(self) -> float:
        """Of the last step [s] that is done."""
        return self._time if self._test is None else self._test.time

    @property
    def next_time(self) -> float:
        """When [s] it has something to do next, infinite where its ``clear`` says, -inf before a run."""
        ahead = self._run_ahead
        if ahead is not None and ahead.running:
            return ahead.next_time
        return -math.inf if self._test is None else math.inf

    @property
    def clear(self) -> Callable[[float], int] | None:
        """Says at the end of every step whether there is nothing to do, None where the time says it."""
        interface = self.coordinates.interface
        if self._test is not None and interface is not None and interface.turns:
            return self._seen_clear
        return None if self._test is None else self._test.clear

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""
        return self._own.varies

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
        interface = self.coordinates.interface
        turned = () if interface is None else interface.warnings
        return (*warnings_of_body(self.model, self._record.of(self._events, truncated)), *self._outside, *turned)

    def stepped_level(self, states: Sequence[int]) -> SteppedLevel:
        """The level of elements in these states as the solver has it."""
        return self._stepped(tuple(states))

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Constant force (s,) of the object in a level, at the present time."""
        return stepped.drive + self._own.force_at(stepped.states, 0.0 if math.isnan(self.time) else self.time)

    def own_forces(self, states: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of its own varying loads at times (k,) [s], in a level."""
        return self._own.forces(states, times)

    def own_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """(p, f) of the same at the end of a step."""
        return np.concatenate([self._own.force_at(states, time), np.zeros(self.coordinates.points)])

    def shown(
        self, stepped: SteppedLevel, eta: np.ndarray, eta_t: np.ndarray, held: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level and coordinates (.., k), with their rates, in which configurations and forces are read."""
        return self._own.shown(stepped, eta, eta_t, held, time)

    # ------------------------------------------------------------------ a step

    def before_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn before a step that ends at t: beside others, the force of own loads that will then act."""
        if not self.varies or self._run_ahead is not None:
            return
        self._told = t
        if self._test is not None and not self._own.jump(self._test.time, t, self._rounding):
            self._test.tell(t, self._own.channels_at(t))
        stepped = self.coordinates.stepped
        force = stepped.drive + self._own.force_at(stepped.states, t)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)

    def after_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn when a step is done in which something may be to do, and at the start."""
        ahead = self._run_ahead
        if ahead is not None and ahead.running and ahead.time < t:
            if t < ahead.next_time:
                return
            index = mbs.sys["dynamicSolver"].it.currentStepIndex
            if index > ahead.index:
                self._time = t
                ahead.arrive(mbs, t, index)
                return
        if abs(t - self.time - self._step) <= self._rounding or self._is_step(mbs, t):
            self._check_step(mbs, t)

    def _check_step(self, mbs: Any, t: float) -> None:
        """Do the step that ends at a time [s] again exactly where something may have happened in it."""
        test = self._test
        assert test is not None
        if self.varies and self._told != t:
            raise MultiPhiValueError(
                f"PreStepUserFunction: got a function that replaced the loads of {self.name!r}, need it set before "
                "CreateMultiPhiBody (it is then called after them)"
            )
        if self.coordinates.interface is not None:
            self.coordinates.interface.look()
        if not test.clear(t):
            self._repeat(mbs, test.time, t, test.start)
            self._begin_step(t, self.coordinates.read())

    def _seen_clear(self, t: float) -> int:
        """``clear`` of a body whose interface may turn."""
        assert self._test is not None
        assert self.coordinates.interface is not None
        self.coordinates.interface.look()
        return self._test.clear(t)

    def _repeat(self, mbs: Any, begun: float, t: float, before: np.ndarray) -> None:
        """Do a step again exactly; before: x at its start."""
        assert self._exact is not None
        jumped = self._own.jump(begun, t, self._rounding)
        step = Step(begun, t, before, self.coordinates.read(), self._state, self._most, jumped)
        found = exact_step(self, mbs, self._exact, step)
        self._most, self._state = found.most, found.state
        self._events += found.events
        self._record.see(found.state)
        self._choose_test()
        self.coordinates.store(self.coordinates.layout.of(found.state))
        bodies = bodies_of(mbs)
        bodies.disturbed = bodies.disturbed or found.disturbed

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
        before = self._test
        self._step, self._rounding = step, SAME_STEP * step
        self._own.take_step(step)
        self._tests.clear()
        self._choose_test()
        if before is not None:
            self._begin_step(before.time, before.start)

    def check_matched(self, step: float) -> None:
        """Raises where steps of this length [s] are not those to which modes are matched."""
        if self.matched_step is not None and abs(step - self.matched_step) > SAME_STEP * step:
            raise MultiPhiValueError(
                f"matchedStepSize of {self.name!r}: got {self.matched_step:g} s and a solver's step of "
                f"{step:g} s, need the same (beside contacts of Exudyn too: discontinuous.useRecommendedStepSize=False)"
            )

    def _begin_step(self, time: float, x: np.ndarray) -> None:
        """A step begins at a time [s] with x."""
        assert self._test is not None
        armed = all(phase is Phase.ARMED for phase in self._state.phases)
        channels = (self._own.channels_at(time),) if self.varies else ()
        self._test.begin(time, np.concatenate([x, self._state.held, *channels]), armed)

    def look_again(self) -> None:
        """Take the present state as the start of the next step: another body's event may have moved this one."""
        if self._test is not None:
            self._begin_step(self._test.time, self.coordinates.read())

    # ------------------------------------------------------------------ start of a run

    def _begin_static(self, mbs: Any) -> None:
        """Give a static solution the level that the system has at its start, whatever the last run ended in."""
        self.coordinates.attach(mbs)
        self._test = None
        if self._run_ahead is not None:
            self._run_ahead.running = False
        states, _, self.coordinates.held = self.coordinates.stored()
        stepped = self._stepped(states)
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
        self._run_ahead, self._test, self._most, self._time, self._told = None, None, 0.0, t, t
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        if self.varies:
            self._own = OwnLoads(self.model, self._loads, self._size, t, end)
        fresh = all(np.array_equal(view, given) for view, given in zip(here.views[:2], self.start, strict=True))
        self._events = [replace(event, time=t) for event in self._given_events] if fresh else []
        self._state = self._taken(mbs, step, alone, fresh)
        self._record = RunRecord(self._state, self._motion.start_loss if fresh else Loss())
        if alone:
            self._set_out(mbs, step, end)
        else:
            self._set_out_beside(step)
        bodies_of(mbs).end = end - SAME_STEP * step

    def _taken(self, mbs: Any, step: float, alone: bool, fresh: bool) -> State:
        """The state at the start of a run from the system, which gets the accelerations that belong to it.

        fresh: whether it starts as the body was made: only now the force is known, which the velocity of matched modes
        contains.
        """
        here, t = self.coordinates, self.time
        stepped, (q, q_t, q_tt) = here.stepped, here.views
        states, entered, held = here.stored()
        if states != stepped.states or not np.array_equal(held, here.held):  # accelerations are of stale matrices
            here.held, stepped = held, self._stepped(states)
            here.enter(mbs, stepped, self.force_vector(stepped))
            if not alone:
                q_tt[:] = stepped.acceleration(q, q_t, self._acting(mbs, step)[: self._size])
        force = self.own_forces(states, np.array([t]))[0] if alone else here.force(here.read())[: self._size]
        if fresh:
            q_t += stepped.from_force @ force
        if fresh or alone:
            q_tt[:] = stepped.acceleration(q, q_t, force)
        here.write(stepped, held, here.views)
        r, eta_t = stepped.modes, stepped.velocity(q, q_t, force)
        xi, xi_t = np.concatenate([q[:r], held]), np.concatenate([eta_t[:r], 0 * held])
        state = State(self._own.levels.level(states), xi, xi_t, entered)
        return replace(state, phases=self._own.phases_of(state, t))

    def _acting(self, mbs: Any, step: float) -> np.ndarray:
        """(p, f) in the present state of the system, with what constraints and inertia make of it on an interface."""
        here = self.coordinates
        if here.surroundings is None:
            return here.applied(mbs)
        return here.seen(here.surroundings.accelerations(step)).acting

    def _set_out_beside(self, step: float) -> None:
        """Look at every step of this length [s] from now on."""
        if self._exact is None or self.varies:
            self._motion.levels = self._own.loaded
            self._exact = ExactMotion(self._motion, self._own.levels, f"body {self.name!r}")
        self._exact.begin(self._time)
        self._take_step(step)
        self._begin_step(self._time, self.coordinates.read())

    def _set_out(self, mbs: Any, step: float, end: float) -> None:
        """Compute the motion ahead, from the present state and time on."""
        alone = motion_of(self._own.loaded, self._motion.start).begin()
        motion, here = KnownMotion(alone, self._state, self.time), self.coordinates
        here.enter(mbs, here.stepped, here.stepped.drive)
        self._step = math.nan
        self._run_ahead = RunAhead(self, motion, self._record, self.time, step, end)
        self._run_ahead.begin(mbs)

    def check_integration(self, settings: Any, trapezoidal: bool) -> None:
        """Raises for settings of an implicit solver that make the body wrong; TrapezoidalIndex2 has its own."""
        integration = settings.timeIntegration.generalizedAlpha
        if not (trapezoidal or integration.useNewmark) and integration.spectralRadius != 1:
            other = "" if self.coordinates.interface is not None else " (or spectralRadius = 1)"
            raise MultiPhiValueError(
                f"solver: got GeneralizedAlpha with spectralRadius {integration.spectralRadius:g} (Exudyn's default is "
                f"0.9), with which events of the Multi-Phi body {self.name!r} are not exact; need TrapezoidalIndex2"
                f"{other}: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
            )
        if self.coordinates.interface is not None and not (trapezoidal or integration.useIndex2Constraints):
            raise MultiPhiValueError(
                f"solver: got GeneralizedAlpha of index 3, with which the interface of {self.name!r} is unstable; need "
                "TrapezoidalIndex2: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
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
        attached = around.hanging(around.present(), here.stepped.mass).attached
        lost = sum(event.loss.impact for event in self._given_events)
        q_t = here.views[1]
        fresh = np.array_equal(here.views[:2], self._given[:2])
        struck = fresh and lost > ROUND_OFF * (lost + 0.5 * float(q_t @ q_t))
        if struck and np.any(attached.impedance(np.eye(len(attached.mass)))):
            raise MultiPhiValueError(
                f"start of {self.name!r}: got a velocity into a rigid contact, with masses or constraints on the "
                "interface, need one that does not strike at the start"
            )

    # ------------------------------------------------------------------ levels in Exudyn

    def _choose_test(self) -> None:
        self._test = self._tests.get_or_build(self._state.states, self._new_test)

    def _new_test(self) -> StepTest:
        here = self.coordinates
        places = () if here.interface is None else here.interface.multipliers
        conditions = self._own.conditions(here.stepped, self._step, here.direct(here.stepped))
        return StepTest(conditions, self._step, self._rounding, (*here.views, here.multipliers), places)

    def _stepped(self, states: tuple[int, ...]) -> SteppedLevel:
        return self._stepped_levels.get_or_build(states, lambda: self._own.stepped(states, self.matched_step))
