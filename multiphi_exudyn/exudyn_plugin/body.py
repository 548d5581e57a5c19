"""Multi-Phi body: the reduced model as an object of an Exudyn system.

    M q'' + D q' + K q = drive + (loads and connectors of the system),   q = eta of the present level

NodeGenericODE2 has q, ObjectGenericODE2 the matrices of the level, and NodeGenericData the level itself: the states of
all elements, the phases of their exits, and the stick positions (state.py).

A body on which nothing acts but its own loads follows a motion that is computed in advance (alone.py): at the ends of
steps with events its coordinates, matrices and level are those of ``simulate``. Between them Exudyn's steps are of
second order, or exact if the modes are matched to the step (discretised_level.py). With varying loads every step ends
exactly.

A body beside others is tested after every step, and the step is computed again exactly where an event may have occurred
in it (coupled.py). Its error is of second order in the step size.

A load or connector at coordinate k of the node acts on mode k of the present level.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.alone import RunAhead
from multiphi_exudyn.exudyn_plugin.coupled import CoupledRun, SystemAround
from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.exudyn_plugin.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.state import BodyParts, RunRecord, StepErrors
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.run_warnings import warnings_of_body
from multiphi_exudyn.time.state import Event, Loss, State, total_loss

__all__ = ["MultiPhiBody", "StaticChange"]

ROUND_OFF = 1e-12  # of the energy at the start: an impact with a smaller loss is none
RESIDUAL = 1e-7  # of its terms: a signal that is less negative is the residual of the solver's iterations


class StaticChange(NamedTuple):
    """Change of an element to a state that its signal asks for; signal: relative to its terms, from -1 to 0."""

    signal: float
    element: int
    state: int


class MultiPhiBody(BodyParts):
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
        size, state = motion.model.level_at(()).modes, motion.static_state
        super().__init__(name, OwnLoads(motion.model, loads, size, 0.0, end), state, motion.start_loss, matched_step)
        self._motion, self._loads, self._base_warnings = motion, tuple(loads), base_warnings
        self._time, self._start_state = math.nan, state
        self._run: RunAhead | CoupledRun | None = None
        self._static_states: tuple[int, ...] | None = None
        self._end: tuple[tuple[int, ...], np.ndarray] | None = None
        discretised = self.coordinates.discretised
        q, q_t, _ = discretised.solver_state(state.displacement, state.velocity, np.zeros(size))
        self.start = q, q_t
        self._start_events = tuple(motion.events)
        self._events = list(self._start_events)

    @property
    def state(self) -> State:
        """Level, modal displacement and velocity, and phases, after the last event or at the start of a run."""
        return self._run.state if isinstance(self._run, CoupledRun) else self._start_state

    @property
    def events(self) -> list[Event]:
        """Events of the last run, with their exact times."""
        return [*self._events, *(() if self._run is None else self._run.events)]

    @property
    def time(self) -> float:
        """End of the last finished step [s]."""
        run = self._coupled
        return self._time if run is None else run.time

    @property
    def _coupled(self) -> CoupledRun | None:
        """The coupled run, if one is in progress."""
        return self._run if isinstance(self._run, CoupledRun) and self._run.running else None

    @property
    def next_time(self) -> float:
        """Time [s] of the next action, infinite where ``is_step_clear`` decides, -inf before a run."""
        if isinstance(self._run, RunAhead) and self._run.running:
            return self._run.next_time
        return -math.inf if self._coupled is None else math.inf

    @property
    def is_step_clear(self) -> Callable[[float], int] | None:
        """Function of the end of a step [s], nonzero if the body needs no action; None where ``next_time`` decides."""
        return None if self._coupled is None else self._coupled.is_step_clear

    @property
    def rigid(self) -> bool:
        """Whether the body has rigid contacts."""
        return self.coordinates.rigid

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the accuracy of the last run, or of the start before any run, with advice, a sentence each."""
        run, interface = self._run, self.coordinates.interface
        truncated = run.update_record() if isinstance(run, RunAhead) else 0.0
        loss = total_loss(run.events) if isinstance(run, CoupledRun) else Loss()
        rotations = () if interface is None else interface.warnings(self.model.base.modes.rigid > 0)
        delays = () if self._step_errors is None else self._step_errors.warnings
        summary = self.record.summary(total_loss(self._events) + loss, truncated)
        return (*warnings_of_body(self.model, summary), *self._base_warnings, *rotations, *delays)

    def force_vector(self, discretised: DiscretisedLevel) -> np.ndarray:
        """Force vector (s,) of the object in a level, at the present time."""
        return discretised.drive + self.own_loads.force_at(
            discretised.states, 0.0 if math.isnan(self.time) else self.time
        )

    # ------------------------------------------------------------------ a step

    def before_step(self, mbs: Any, t: float) -> None:
        """Set the force of varying loads at t [s] before a step that ends there, in a coupled run."""
        if not self.varies or isinstance(self._run, RunAhead):
            return
        if self._coupled is not None:
            self._coupled.announce_step_end(t)
        discretised = self.coordinates.discretised
        force = discretised.drive + self.own_loads.force_at(discretised.states, t)
        mbs.SetObjectParameter(self.items["oGenericODE2"], "forceVector", force)

    def after_step(self, mbs: Any, t: float) -> bool:
        """Handle the end of a step at t [s]; whether an event in it has moved others."""
        run = self._run
        if run is None or not run.running or not t > self.time:
            return False  # called again for the same step
        if isinstance(run, RunAhead):
            index = mbs.sys["dynamicSolver"].it.currentStepIndex
            if t >= run.next_time and index > run.index:
                self._time = t
                run.after_step(mbs, t, index)
            return False
        if not run.is_step_end(t):
            step = t - run.time
            self.check_step(step)
            if self._step_errors is not None:
                self._step_errors.step = max(self._step_errors.step, step)
            run.change_step_size(step)
        return run.check(t)

    def restart_step(self) -> None:
        """Take the present state as the start of the next step, as another body's event may have changed it."""
        if self._coupled is not None:
            self._coupled.restart_step()

    # ------------------------------------------------------------------ start and end of a run

    def check_integration(self, settings: Any, trapezoidal: bool) -> None:
        """Raise for settings of an implicit solver with which the body is not exact or unstable.

        trapezoidal: whether the solver is TrapezoidalIndex2, which does not use the settings of GeneralizedAlpha.
        """
        integration, interface = settings.timeIntegration.generalizedAlpha, self.coordinates.interface
        if not (trapezoidal or integration.useNewmark) and integration.spectralRadius != 1:
            other = "" if interface is not None else " (or spectralRadius = 1)"
            raise MultiPhiValueError(
                f"solver: got GeneralizedAlpha with spectralRadius {integration.spectralRadius:g} (Exudyn's default is "
                f"0.9), with which events of the Multi-Phi body {self.name!r} are not exact; need TrapezoidalIndex2"
                f"{other}: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
            )
        if interface is not None and not (trapezoidal or integration.useIndex2Constraints):
            raise MultiPhiValueError(
                f"solver: got GeneralizedAlpha of index 3, with which the interface of {self.name!r} is unstable; need "
                "TrapezoidalIndex2: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
            )

    def begin(self, mbs: Any, t: float, isolated: bool, exclusive: Mapping[int, str]) -> None:
        """Begin a run at t [s]: take state and level from the system.

        isolated: whether nothing of the system acts on the body's node. exclusive: other bodies with rigid contacts, by
        the index of their first coordinate.
        """
        self.check_integration(mbs.sys["simulationSettings"], trapezoidal=False)
        coordinates, step = self.coordinates, float(mbs.sys["dynamicSolver"].it.currentStepSize)
        self.check_step(step)
        coordinates.attach(mbs)
        isolated = isolated and coordinates.interface is None
        around = SystemAround(mbs, self, step, exclusive)
        if coordinates.rigid and not isolated:
            self._check_start(around)
        self._run, self._time = None, t
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        if self.varies:
            self.own_loads = OwnLoads(self.model, self._loads, coordinates.discretised.size, t, end)
        as_created = self._is_as_created
        if not as_created and self._end is not None:
            self._check_level(*self._end)
        self._events = [replace(event, time=t) for event in self._start_events] if as_created else []
        self._start_state = self._state_at_start(around, t, isolated, as_created)
        self.record = RunRecord(self._start_state, self._motion.start_loss if as_created else Loss())
        self._begin_step_errors(t, step, end, isolated)
        if isolated:
            exact = Motion(self.own_loads.loaded_levels, self._motion.start, sums_works=False)
            coordinates.set_level_in_run(mbs, coordinates.discretised, coordinates.discretised.drive)
            self._run = RunAhead(self, exact, self._start_state, t, step, end)
            self._run.begin(mbs)
        else:
            self._run = CoupledRun(self, around, t, step, self._start_state)

    def end_run(self) -> None:
        """Take notice of the state at the end of a run."""
        self._keep_end()
        if self._step_errors is not None:
            self._step_errors.finish(self.coordinates)

    def take_steps(self, mbs: Any, duration: float, step: float) -> None:
        """Take notice of a run of this duration in steps of this length [s], in which the body was not called."""
        self.coordinates.attach(mbs)
        self._begin_step_errors(0.0, step, duration, corrected=False)

    def _begin_step_errors(self, time: float, step: float, end: float, corrected: bool) -> None:
        """Begin the estimate of the steps' error, unless the modes are matched or every step ends exactly."""
        unmatched = self.matched_step is None and not (corrected and self.varies)
        self._step_errors = StepErrors(step, time, end, corrected) if unmatched else None
        self.include_step_error(time)

    @property
    def _is_as_created(self) -> bool:
        """Whether the system has the coordinates and velocities of the creation."""
        return all(np.array_equal(view, start) for view, start in zip(self.coordinates.views, self.start, strict=False))

    def _keep_end(self) -> None:
        """Keep the level and the coordinates in which a run or a static solution ends."""
        self._end = self.coordinates.discretised.states, self.coordinates.views[0].copy()

    def _check_level(self, last_states: tuple[int, ...], last: np.ndarray) -> None:
        """Raise for a start at the coordinates (s,) of the last solution in another level than its own."""
        states = self.coordinates.read_level_data()[0]
        if states != last_states and np.array_equal(self.coordinates.views[0], last):
            raise MultiPhiValueError(
                f"start of {self.name!r}: got the coordinates of the last solution without its level, need its whole "
                "state: updateInitialValues=True, or "
                "mbs.systemData.SetSystemState(mbs.systemData.GetSystemState(), exu.ConfigurationType.Initial)"
            )

    def _check_start(self, around: SystemAround) -> None:
        """Raise for masses and constraints that cannot take part in impacts of a body with rigid contacts."""
        parts = around.attached_parts()
        if parts.acts_on_body:
            raise MultiPhiValueError(
                f"node of {self.name!r}: got a mass or a constraint on the node of a body with rigid contacts, need it "
                "on an interface coordinate or as part of the structure, or contacts of finite stiffness"
            )
        around.check_attached(parts.connected)
        loss, q_t = sum(event.loss.impact for event in self._start_events), self.coordinates.views[1]
        has_impact = self._is_as_created and loss > ROUND_OFF * (loss + 0.5 * float(q_t @ q_t))
        if has_impact and (np.any(parts.inertia) or parts.free.shape[1] < len(parts.free)):
            raise MultiPhiValueError(
                f"start of {self.name!r}: got a velocity into a rigid contact, with masses or constraints on the "
                "interface, need a start without an impact"
            )

    def _state_at_start(self, around: SystemAround, time: float, isolated: bool, as_created: bool) -> State:
        """The state at the start of a run at ``time`` [s]; writes its accelerations.

        isolated: whether nothing but its own loads acts on the body. as_created: whether it starts as it was created;
        the velocity of matched modes depends on the force, which is known only now.
        """
        coordinates, loads = self.coordinates, self.own_loads
        discretised, (q, q_t, q_tt) = coordinates.discretised, coordinates.views
        states, phases, held = coordinates.read_level_data()
        if states != discretised.states or not np.array_equal(held, coordinates.held):
            coordinates.held, discretised = held, self.discretised_level(states)
            coordinates.set_level_in_run(around.mbs, discretised, self.force_vector(discretised))
            if not isolated:  # its accelerations belong to other matrices
                q_tt[:] = discretised.acceleration(q, q_t, self._force_of_others(around))
        force = loads.forces(states, np.array([time]))[0] if isolated else discretised.external_force(q, q_t, q_tt)
        if as_created:
            q_t += discretised.from_force @ force
        if as_created or isolated:
            q_tt[:] = discretised.acceleration(q, q_t, force)
        coordinates.write(discretised, held, coordinates.views)
        r, eta_t = discretised.modes, discretised.velocity(q, q_t, force)
        xi, xi_t = np.concatenate([q[:r], held]), np.concatenate([eta_t[:r], 0 * held])
        state = State(loads.static_levels.level(states), xi, xi_t, phases)
        return replace(state, phases=loads.phases_of(state, time))

    def _force_of_others(self, around: SystemAround) -> np.ndarray:
        """Modal force (s,) of the system in its present state, that of constraints and attached masses included."""
        coordinates, discretised = self.coordinates, self.coordinates.discretised
        (q, q_t, _), own = coordinates.views, slice(coordinates.first, coordinates.first + discretised.size)
        if coordinates.interface is None:
            return around.forces()[own] + discretised.internal_force(q, q_t)
        return discretised.external_force(q, q_t, around.accelerations()[own])

    # ------------------------------------------------------------------ static solutions

    @property
    def elements(self) -> int:
        """Number of contacts, force laws and friction elements."""
        return len(self.model.contacts)

    def begin_static(self) -> None:
        """Begin a static solution in the level of the data node, whatever the last run ended in."""
        self._static_states = None

    def set_static_level(self, mbs: Any) -> None:
        """Set the level of a static solution, and write it into the data node."""
        self.coordinates.attach(mbs)
        if self._run is not None:
            self._run.running = False
        coordinates, (states, _, coordinates.held) = self.coordinates, self.coordinates.read_level_data()
        if self._static_states is not None and self._static_states != states:
            states = self._static_states
            no_phases = np.zeros((1, 0))
            coordinates.write_level_data(coordinates.layout.rows(states, no_phases, coordinates.held[None])[0])
        discretised = self.discretised_level(states)
        coordinates.set_level(mbs, discretised, self.force_vector(discretised))

    def change_static_level(self, change: StaticChange) -> None:
        """Take the state of an element in the next static solution."""
        states = list(self.coordinates.discretised.states)
        states[change.element] = change.state
        self._static_states = tuple(states)

    def static_changes(self) -> list[StaticChange]:
        """Changes of elements whose exits have negative signals in the present static solution, in their order.

        Raises MultiPhiValueError where friction would change its state, or slips at rest.
        """
        coordinates, discretised, interface = self.coordinates, self.coordinates.discretised, self.coordinates.interface
        q, held = coordinates.views[0][: discretised.modes, None], coordinates.held[:, None]
        time = np.array([0.0 if math.isnan(self.time) else self.time])
        level, xi, _ = self.own_loads.level_coordinates(discretised, q, 0 * q, held, time)
        reactions = np.zeros(len(level.level.indices))
        if interface is not None:  # SolveStatic has the other sign of multipliers
            reactions = -coordinates.direct_reactions(discretised) @ interface.forces
            interface.record_angles()
            interface.record_static_error(discretised)
        self.record.include_level(level.level)
        self.record.include_places(level, xi, time)
        self._keep_end()
        base, changes = level.level.base, []
        for (element, exit_), (place, _, constant) in zip(level.exits, level.signals, strict=True):
            shares = [share * reactions[link] for link, share in level.force_shares(element, exit_)]
            terms = np.array([*(place * xi[:, 0]), constant, *shares])
            signal, size = float(np.sum(terms)), float(np.sum(np.abs(terms)))
            comes_to_rest = exit_.asked == "stick" and level.state_of(element).event == "slip"
            if signal >= -RESIDUAL * size and not (comes_to_rest and signal <= 0):
                continue
            if any(base.links[link].held for link in base.link_indices[element]):
                raise MultiPhiValueError(
                    f"static solution of {self.name!r}: got forces that change the state of "
                    f"{base.contacts[element].name!r}, whose friction depends on their path; need "
                    "start=model.equilibrium({point: force}), or a damped run that comes to rest"
                )
            changes.append(StaticChange(signal / size, element, level.asked_state(element, exit_)))
        return changes
