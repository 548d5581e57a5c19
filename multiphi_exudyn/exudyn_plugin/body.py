"""Start state of a body in a run, from the present state of the Exudyn system.

Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 has q, ObjectGenericODE2 the matrices of the level, and NodeGenericData the level itself: the states of
all elements, the phases of their exits, and the stick positions (state.py).

A body on which nothing acts but its own loads follows a motion that is computed in advance (alone.py): at the ends
of steps with events its coordinates, matrices and level are those of ``simulate``. Between them Exudyn's steps are of
second order, or exact if the modes are matched to the step (discretised_level.py). With varying loads every step ends
exactly.

A body beside others is tested after every step, and the step is computed again exactly where an event may have occurred
in it (coupled.py). Its error is of second order in the step size.

A load or connector at coordinate k of the node acts on mode k of the present level.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.exudyn_plugin.alone import KnownMotion, RunAhead
from multiphi_exudyn.exudyn_plugin.coupled import ExactMotion, StepwiseRun
from multiphi_exudyn.exudyn_plugin.discretised_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.solver import (
    StaticChange,
    bodies_of,
    check_integration,
    check_level,
    check_matched,
    check_start,
    is_isolated,
    running_solver,
    static_changes,
)
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP, Coordinates, LevelData, RunRecord, StepErrors
from multiphi_exudyn.exudyn_plugin.step_test import OwnLoads
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.run_warnings import warnings_of_body
from multiphi_exudyn.time.state import Event, Loss, State, total_loss


class StartedBody(Protocol):
    """Attributes of a body that its start state needs."""

    coordinates: Coordinates

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The solver's level in which the elements are in these states."""

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Force vector (s,) of the object in a level, at the present time."""


def start_state(
    body: StartedBody, own_loads: OwnLoads, mbs: Any, time: float, step: float, isolated: bool, as_created: bool
) -> State:
    """The state at the start of a run at ``time`` [s], with steps of this length [s]; writes its accelerations.

    isolated: whether nothing but its own loads acts on the body. as_created: whether it starts as it was created; the
    velocity of matched modes depends on the force, which is known only now.
    """
    coordinates = body.coordinates
    stepped, (q, q_t, q_tt) = coordinates.stepped, coordinates.views
    states, phases, held = coordinates.read_level_data()
    if states != stepped.states or not np.array_equal(held, coordinates.held):  # accelerations belong to other matrices
        coordinates.held, stepped = held, body.stepped_level(states)
        coordinates.set_level_in_run(mbs, stepped, body.force_vector(stepped))
        if not isolated:
            q_tt[:] = stepped.acceleration(q, q_t, _external_force(coordinates, mbs, step)[: stepped.size])
    force = (
        own_loads.forces(states, np.array([time]))[0]
        if isolated
        else coordinates.external_force(coordinates.copy_state())[: stepped.size]
    )
    if as_created:
        q_t += stepped.from_force @ force
    if as_created or isolated:
        q_tt[:] = stepped.acceleration(q, q_t, force)
    coordinates.write(stepped, held, coordinates.views)
    r, eta_t = stepped.modes, stepped.velocity(q, q_t, force)
    xi, xi_t = np.concatenate([q[:r], held]), np.concatenate([eta_t[:r], 0 * held])
    state = State(own_loads.static_levels.level(states), xi, xi_t, phases)
    return replace(state, phases=own_loads.phases_of(state, time))


def _external_force(coordinates: Coordinates, mbs: Any, step: float) -> np.ndarray:
    """External forces (p, f) in the present state of the system, those of constraints and attached masses included."""
    if coordinates.system is None:
        return coordinates.external_modal_force(mbs)
    return coordinates.forces_from_accelerations(coordinates.system.accelerations(step)).forces


class MultiPhiBody:
    """One Multi-Phi body of an Exudyn system: its items, its present state, and its events.

    Created by ``CreateMultiPhiBody``, and available as ``mbs.variables["multiPhi"][name]``.

    Parameters
    ----------
    name : str
        Name of the body.
    motion : Motion
        Motion of the model, at its start.
    loads : sequence of loads
        Loads of the body, as of ``simulate``.
    end : float
        End of the run [s] that the loads are prepared for.
    matched_step : float or None
        Step size [s] that the modes are matched to.
    base_warnings : tuple of str, default ()
        Warnings about motions that the modal base of a large structure does not contain.

    Attributes
    ----------
    model : MultiPhiModel
        The reduced model.
    items : dict
        Typed indices of the body's items in the system.
    coordinates : Coordinates
        The body's part of the system's coordinates.
    own_loads : OwnLoads
        The body's loads in the present run.
    start : tuple of array
        Initial coordinates and velocities (s,) of the node.

    Raises
    ------
    MultiPhiValueError
        For loads at points or contacts that do not exist.

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
        base_warnings: tuple[str, ...] = (),
    ) -> None:
        self.name = name
        self.model = motion.model
        self.items: dict[str, Any] = {}
        self.matched_step = matched_step
        self._time = math.nan
        self._motion, self._loads, self._base_warnings = motion, tuple(loads), base_warnings
        self._size = self.model.level_at(()).modes
        self.own_loads = OwnLoads(self.model, loads, self._size, 0.0, end)
        self._state = motion.static_state
        max_levels = self.model.most_levels
        self._stepped_levels: BoundedCache[tuple[int, ...], SteppedLevel] = BoundedCache(max_levels)
        self._static_states: tuple[int, ...] | None = None
        self._step_errors: StepErrors | None = None
        self._end: tuple[tuple[int, ...], np.ndarray] | None = None
        self._run_ahead: RunAhead | None = None
        self._stepwise_run: StepwiseRun | None = None
        self._record = RunRecord(self._state, motion.start_loss)
        stepped, state = self.stepped_level(self._state.states), self._state
        layout, matched = LevelData(self.model), matched_step is not None
        self.coordinates = Coordinates(self.items, stepped, state.held, layout, max_levels, matched)
        q, q_t, _ = stepped.solver_state(state.displacement, state.velocity, np.zeros(self._size))
        self.start = q, q_t
        self._start_events = tuple(motion.events)
        self._events = list(self._start_events)

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, and phases, after the last event or at the start of a run."""
        return self._state if self._stepwise_run is None else self._stepwise_run.state

    @property
    def events(self) -> list[Event]:
        """Events of the last run, with their exact times."""
        run = self._run_ahead or self._stepwise_run
        return [*self._events, *(() if run is None else run.events)]

    @property
    def time(self) -> float:
        """End of the last finished step [s]."""
        return self._time if self._run_in_progress is None else self._run_in_progress.time

    @property
    def _run_in_progress(self) -> StepwiseRun | None:
        """The step-by-step run, if one is in progress."""
        return self._stepwise_run if self._stepwise_run is not None and self._stepwise_run.running else None

    @property
    def next_time(self) -> float:
        """Time [s] of the next action, infinite where ``is_step_clear`` decides, -inf before a run."""
        ahead = self._run_ahead
        if ahead is not None and ahead.running:
            return ahead.next_time
        return -math.inf if self._run_in_progress is None else math.inf

    @property
    def is_step_clear(self) -> Callable[[float], int] | None:
        """Function of the end of a step [s], nonzero if the body needs no action; None where ``next_time`` decides."""
        return None if self._run_in_progress is None else self._run_in_progress.is_step_clear

    @property
    def varies(self) -> bool:
        """Whether the body's loads vary in time."""
        return self.own_loads.varies

    @property
    def rigid(self) -> bool:
        """Whether the body has rigid contacts."""
        return self.coordinates.rigid

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the accuracy of the last run, or of the start before any run, with advice, a sentence each."""
        truncated = 0.0 if self._run_ahead is None else self._run_ahead.update_record()
        loss = total_loss(() if self._stepwise_run is None else self._stepwise_run.events)
        interface = self.coordinates.interface
        rotations = () if interface is None else interface.warnings(self.model.base.modes.rigid > 0)
        delays = () if self._step_errors is None else self._step_errors.warnings
        summary = self._record.summary(total_loss(self._events) + loss, truncated)
        return (*warnings_of_body(self.model, summary), *self._base_warnings, *rotations, *delays)

    def stepped_level(self, states: Sequence[int]) -> SteppedLevel:
        """The solver's level in which the elements are in these states."""
        key = tuple(states)
        return self._stepped_levels.get_or_build(key, lambda: self.own_loads.stepped_level(key, self.matched_step))

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Force vector (s,) of the object in a level, at the present time."""
        return stepped.drive + self.own_loads.force_at(stepped.states, 0.0 if math.isnan(self.time) else self.time)

    def varying_load_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """Force (p, f) of the body's own varying loads at the end of a step [s], in a level."""
        force = np.zeros(self._size + self.coordinates.point_count)
        if self.varies:
            force[: self._size] = self.own_loads.force_at(states, time)
        return force

    # ------------------------------------------------------------------ a step

    def before_step(self, mbs: Any, t: float) -> None:
        """Set the force of varying loads at t [s] before a step that ends there, in a step-by-step run."""
        if not self.varies or self._run_ahead is not None:
            return
        if self._run_in_progress is not None:
            self._run_in_progress.announce_step_end(t)
        stepped = self.coordinates.stepped
        force = stepped.drive + self.own_loads.force_at(stepped.states, t)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)

    def after_step(self, mbs: Any, t: float) -> None:
        """Handle the end of a step at t [s] in which an action may be needed, and the start of a run."""
        ahead = self._run_ahead
        if ahead is not None and ahead.running and ahead.time < t:
            if t < ahead.next_time:
                return
            index = mbs.sys["dynamicSolver"].it.currentStepIndex
            if index > ahead.index:
                self._time = t
                ahead.after_step(mbs, t, index)
                return
        if (self._run_in_progress is not None and self._run_in_progress.is_step_end(t)) or self._is_new_step(mbs, t):
            assert self._run_in_progress is not None
            self._run_in_progress.check(mbs, t)

    def _is_new_step(self, mbs: Any, t: float) -> bool:
        """Whether a new step of another size ends at t [s], which is then taken; begins runs and static solutions."""
        solver = running_solver(mbs, t)
        if solver is None:
            self._begin_static(mbs)
            return False
        if solver.it.currentStepIndex == 0:
            self._begin(mbs, t)
            return False
        if self._run_in_progress is None or not t > self.time:
            return False  # called again for the same step
        check_matched(self, t - self.time)
        if self._step_errors is not None:
            self._step_errors.step = max(self._step_errors.step, t - self.time)
        self._run_in_progress.change_step_size(t - self.time)
        return True

    def restart_step(self) -> None:
        """Take the present state as the start of the next step, as another body's event may have changed it."""
        if self._run_in_progress is not None:
            self._run_in_progress.restart_step()

    # ------------------------------------------------------------------ start of a run

    @property
    def elements(self) -> int:
        """Number of contacts, force laws and friction elements."""
        return len(self.model.contacts)

    def begin_static(self) -> None:
        """Begin a static solution in the level of the data node, whatever the last run ended in."""
        self._static_states = None

    def _begin_static(self, mbs: Any) -> None:
        """Set the level of a static solution, and write it into the data node."""
        self.coordinates.attach(mbs)
        for run in (self._run_ahead, self._stepwise_run):
            if run is not None:
                run.running = False
        coordinates, (states, _, coordinates.held) = self.coordinates, self.coordinates.read_level_data()
        if self._static_states is not None and self._static_states != states:
            states = self._static_states
            no_phases = np.zeros((1, 0))
            coordinates.write_level_data(coordinates.layout.rows(states, no_phases, coordinates.held[None])[0])
        stepped = self.stepped_level(states)
        coordinates.set_level(mbs, stepped, self.force_vector(stepped))

    def static_changes(self) -> list[StaticChange]:
        """Changes of elements whose states do not agree with the present static solution.

        Raises MultiPhiValueError where friction would change its state.
        """
        coordinates, stepped, interface = self.coordinates, self.coordinates.stepped, self.coordinates.interface
        q, held = coordinates.views[0][: stepped.modes, None], coordinates.held[:, None]
        time = np.array([0.0 if math.isnan(self.time) else self.time])
        level, xi, _ = self.own_loads.level_coordinates(stepped, q, 0 * q, held, time)
        reactions = np.zeros(len(level.level.indices))
        if interface is not None:  # SolveStatic has the other sign of multipliers
            reactions = -coordinates.direct_reactions(stepped) @ interface.forces
            interface.record_angles()
            interface.record_static_error(stepped)
        self._record.include_level(level.level)
        self._record.include_places(level, xi, time)
        self._keep_end()
        return static_changes(self.name, level, xi[:, 0], reactions)

    def take_steps(self, mbs: Any, duration: float, step: float) -> None:
        """Take notice of a run of this duration in steps of this length [s], in which the body was not called."""
        self.coordinates.attach(mbs)
        self._begin_step_errors(0.0, step, duration, corrected=False)

    def include_step_error(self, time: float) -> None:
        """Take notice of the present state, after an event at a time [s], for the estimate of the steps' error."""
        if self._step_errors is not None:
            self._step_errors.include(self.coordinates, time)

    def _begin_step_errors(self, time: float, step: float, end: float, corrected: bool) -> None:
        """Begin the estimate of the steps' error, unless the modes are matched or every step ends exactly."""
        unmatched = self.matched_step is None and not (corrected and self.varies)
        self._step_errors = StepErrors(step, time, end, corrected) if unmatched else None
        self.include_step_error(time)

    def end_run(self) -> None:
        """Take notice of the state at the end of a run."""
        self._keep_end()
        if self._step_errors is not None:
            self._step_errors.finish(self.coordinates)

    def _keep_end(self) -> None:
        """Keep the level and the coordinates in which a run or a static solution ends."""
        self._end = self.coordinates.stepped.states, self.coordinates.views[0].copy()

    def change_static_level(self, change: StaticChange) -> None:
        """Take the state of an element in the next static solution."""
        states = list(self.coordinates.stepped.states)
        states[change.element] = change.state
        self._static_states = tuple(states)

    def _begin(self, mbs: Any, t: float) -> None:
        """Begin a run: take state and level from the system."""
        check_integration(self, mbs.sys["simulationSettings"], trapezoidal=False)
        coordinates, step = self.coordinates, float(mbs.sys["dynamicSolver"].it.currentStepSize)
        check_matched(self, step)
        coordinates.attach(mbs)
        items = self.items["nGenericODE2"], self.items["oGenericODE2"]
        isolated = coordinates.interface is None and is_isolated(mbs, *items)
        if coordinates.rigid and not isolated:
            check_start(mbs, self, self.start, sum(event.loss.impact for event in self._start_events))
        self._run_ahead, self._stepwise_run, self._time = None, None, t
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        if self.varies:
            self.own_loads = OwnLoads(self.model, self._loads, self._size, t, end)
        as_created = all(
            np.array_equal(view, start) for view, start in zip(coordinates.views[:2], self.start, strict=True)
        )
        if not as_created and self._end is not None:
            check_level(self, coordinates.read_level_data()[0], *self._end)
        self._events = [replace(event, time=t) for event in self._start_events] if as_created else []
        self._state = start_state(self, self.own_loads, mbs, t, step, isolated, as_created)
        self._record = RunRecord(self._state, self._motion.start_loss if as_created else Loss())
        self._begin_step_errors(t, step, end, isolated)
        if isolated:
            self._begin_run_ahead(mbs, step, end)
        else:
            self._begin_stepwise_run(step)
        bodies_of(mbs).end_time = end - SAME_STEP * step

    def _begin_stepwise_run(self, step: float) -> None:
        """Begin a step-by-step run with steps of this length [s]."""
        exact = ExactMotion(self.own_loads.loaded_levels, f"body {self.name!r}", self._time)
        self._stepwise_run = StepwiseRun(self, self.own_loads, exact, self._record, self._time, step, self._state)

    def _begin_run_ahead(self, mbs: Any, step: float, end: float) -> None:
        """Begin a run along the exact motion from the present state and time on."""
        exact = Motion(self.own_loads.loaded_levels, self._motion.start, sums_works=False)
        motion, coordinates = KnownMotion(exact, self._state, self.time), self.coordinates
        coordinates.set_level_in_run(mbs, coordinates.stepped, coordinates.stepped.drive)
        self._run_ahead = RunAhead(self, motion, self._record, self.time, step, end)
        self._run_ahead.begin(mbs)
