"""Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 holds q, ObjectGenericODE2 the matrices of the level, NodeGenericData the level: the states of all
elements, phases of their exits, and the places that links hold (level_data.py).

A body on which nothing acts but its own loads follows a motion that is known beforehand (run_ahead.py): at the ends of
steps with events its coordinates, matrices and level are those of ``simulate``. In between Exudyn's steps are of second
order, and exact if matched to the step (stepped_level.py). Of a body whose loads vary every step ends exactly.

Beside others every step is looked at, and done again exactly where a contact may have asked to change
(step_by_step.py). Halving the step divides the error by four.

A load or connector at coordinate k of the node acts on mode k of whichever level holds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from multiphi_exudyn.events.state import Event, Loss, State, total_loss
from multiphi_exudyn.exudyn_plugin.body.coordinates import SAME_STEP, Coordinates
from multiphi_exudyn.exudyn_plugin.body.known_motion import KnownMotion
from multiphi_exudyn.exudyn_plugin.body.level_data import LevelData
from multiphi_exudyn.exudyn_plugin.body.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.body.run_ahead import RunAhead
from multiphi_exudyn.exudyn_plugin.body.run_checks import check_integration, check_matched, check_start
from multiphi_exudyn.exudyn_plugin.body.run_record import RunRecord
from multiphi_exudyn.exudyn_plugin.body.start_state import start_state
from multiphi_exudyn.exudyn_plugin.body.step_by_step import StepByStep
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of, nothing_acts_on, running_solver
from multiphi_exudyn.exudyn_plugin.coupling.exact_motion import ExactMotion
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.motion import Motion, motion_of
from multiphi_exudyn.time.reliability import warnings_of_body

__all__ = ["MultiPhiBody"]


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
    own : OwnLoads
        Its loads in the present run.
    start : tuple of array
        Initial coordinates and velocities (s,) of its node.

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
        self._time = math.nan
        self._motion, self._loads, self._outside = motion, tuple(loads), outside
        self._size = self.model.level_at(()).modes
        self.own = OwnLoads(self.model, loads, self._size, 0.0, end)
        self._state = motion.static_state
        most = self.model.most_levels
        self._stepped_levels: BoundedCache[tuple[int, ...], SteppedLevel] = BoundedCache(most)
        self._run_ahead: RunAhead | None = None
        self._run_beside: StepByStep | None = None
        self._record = RunRecord(self._state, motion.start_loss)
        stepped, state = self.stepped_level(self._state.states), self._state
        layout, matched = LevelData(self.model), matched_step is not None
        self.coordinates = Coordinates(self.items, stepped, state.held, layout, most, matched)
        q, q_t, _ = stepped.state(state.displacement, state.velocity, np.zeros(self._size))
        self.start = q, q_t
        self._given_events = tuple(motion.events)
        self._events = list(self._given_events)

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, phases; the last two after an event or at the start of a run."""
        return self._state if self._run_beside is None else self._run_beside.state

    @property
    def events(self) -> list[Event]:
        """Closings and openings with their exact times."""
        run = self._run_ahead or self._run_beside
        return [*self._events, *(() if run is None else run.events)]

    @property
    def time(self) -> float:
        """Of the last step [s] that is done."""
        return self._time if self._stepping is None else self._stepping.time

    @property
    def _stepping(self) -> StepByStep | None:
        """The run beside others that is under way."""
        return self._run_beside if self._run_beside is not None and self._run_beside.running else None

    @property
    def next_time(self) -> float:
        """When [s] it has something to do next, infinite where its ``clear`` says, -inf before a run."""
        ahead = self._run_ahead
        if ahead is not None and ahead.running:
            return ahead.next_time
        return -math.inf if self._stepping is None else math.inf

    @property
    def clear(self) -> Callable[[float], int] | None:
        """Says at the end of every step whether there is nothing to do, None where the time says it."""
        return None if self._stepping is None else self._stepping.clear

    @property
    def varies(self) -> bool:
        """Whether its loads vary in time."""
        return self.own.varies

    @property
    def rigid(self) -> bool:
        """Whether it has rigid contacts."""
        return self.coordinates.rigid

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to distrust in the last run, before any in the start, and what to do about it, a sentence each."""
        truncated = 0.0 if self._run_ahead is None else self._run_ahead.recorded()
        lost = total_loss(() if self._run_beside is None else self._run_beside.events)
        interface = self.coordinates.interface
        turned = () if interface is None else interface.warnings
        summary = self._record.of(total_loss(self._events) + lost, truncated)
        return (*warnings_of_body(self.model, summary), *self._outside, *turned)

    def stepped_level(self, states: Sequence[int]) -> SteppedLevel:
        """The level of elements in these states as the solver has it."""
        known = tuple(states)
        return self._stepped_levels.get_or_build(known, lambda: self.own.stepped(known, self.matched_step))

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Constant force (s,) of the object in a level, at the present time."""
        return stepped.drive + self.own.force_at(stepped.states, 0.0 if math.isnan(self.time) else self.time)

    def own_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """(p, f) of its own varying loads at the end of a step."""
        force = np.zeros(self._size + self.coordinates.points)
        if self.varies:
            force[: self._size] = self.own.force_at(states, time)
        return force

    # ------------------------------------------------------------------ a step

    def before_step(self, mbs: Any, t: float) -> None:
        """Called by Exudyn before a step that ends at t: beside others, the force of own loads that will then act."""
        if not self.varies or self._run_ahead is not None:
            return
        if self._stepping is not None:
            self._stepping.tell(t)
        stepped = self.coordinates.stepped
        force = stepped.drive + self.own.force_at(stepped.states, t)
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
        if (self._stepping is not None and self._stepping.ends(t)) or self._is_step(mbs, t):
            assert self._stepping is not None
            self._stepping.check(mbs, t)

    def _is_step(self, mbs: Any, t: float) -> bool:
        """Whether t ends a step, and not the start of a run or a static solution; takes the step size."""
        solver = running_solver(mbs, t)
        if solver is None:
            self._begin_static(mbs)
            return False
        if solver.it.currentStepIndex == 0:
            self._begin(mbs, t)
            return False
        if self._stepping is None or not t > self.time:
            return False  # called twice
        check_matched(self, t - self.time)
        self._stepping.follow(t - self.time)
        return True

    def look_again(self) -> None:
        """Take the present state as the start of the next step: another body's event may have moved this one."""
        if self._stepping is not None:
            self._stepping.look_again()

    # ------------------------------------------------------------------ start of a run

    def _begin_static(self, mbs: Any) -> None:
        """Give a static solution the level that the system has at its start, whatever the last run ended in."""
        self.coordinates.attach(mbs)
        for run in (self._run_ahead, self._run_beside):
            if run is not None:
                run.running = False
        states, _, self.coordinates.held = self.coordinates.stored()
        stepped = self.stepped_level(states)
        self.coordinates.load(mbs, stepped, self.force_vector(stepped))

    def _begin(self, mbs: Any, t: float) -> None:
        """Take state and level from the system as it stands at the start of a run."""
        check_integration(self, mbs.sys["simulationSettings"], trapezoidal=False)
        here, step = self.coordinates, float(mbs.sys["dynamicSolver"].it.currentStepSize)
        check_matched(self, step)
        here.attach(mbs)
        nodes = self.items["nGenericODE2"], self.items["oGenericODE2"]
        alone = here.interface is None and nothing_acts_on(mbs, *nodes)
        if here.rigid and not alone:
            check_start(mbs, self, self.start, sum(event.loss.impact for event in self._given_events))
        self._run_ahead, self._run_beside, self._time = None, None, t
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        if self.varies:
            self.own = OwnLoads(self.model, self._loads, self._size, t, end)
        fresh = all(np.array_equal(view, given) for view, given in zip(here.views[:2], self.start, strict=True))
        self._events = [replace(event, time=t) for event in self._given_events] if fresh else []
        self._state = start_state(self, self.own, mbs, t, step, alone, fresh)
        self._record = RunRecord(self._state, self._motion.start_loss if fresh else Loss())
        if alone:
            self._set_out(mbs, step, end)
        else:
            self._set_out_beside(step)
        bodies_of(mbs).end = end - SAME_STEP * step

    def _set_out_beside(self, step: float) -> None:
        """Look at every step of this length [s] from now on."""
        self._motion.levels = self.own.loaded
        exact = ExactMotion(self._motion, self.own.levels, f"body {self.name!r}", self._time)
        self._run_beside = StepByStep(self, self.own, exact, self._record, self._time, step, self._state)

    def _set_out(self, mbs: Any, step: float, end: float) -> None:
        """Compute the motion ahead, from the present state and time on."""
        alone = motion_of(self.own.loaded, self._motion.start)
        alone.sums_works = False  # nobody asks a body for them
        motion, here = KnownMotion(alone, self._state, self.time), self.coordinates
        here.enter(mbs, here.stepped, here.stepped.drive)
        self._run_ahead = RunAhead(self, motion, self._record, self.time, step, end)
        self._run_ahead.begin(mbs)
