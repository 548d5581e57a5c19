"""Coupled run: a body that is coupled to other items of an Exudyn system, or acted on by them.

After every step a certified test (step_test.py) shows that no event can have occurred in it. Where the test fails, the
core computes the step again from its start, from event to event, under the mean force of the step, and writes the
result into Exudyn's state (core/coupled_step.hpp). It asks for Exudyn's forces, masses and constraints where it needs
them: these are dense matrices of the whole system, as an event needs a few solutions of it.

    M a + C^T mu = f(q, v, t),   C a = -d(C v + c_t)/dt at constant v

q, v, a (n,) are coordinates, velocities and accelerations of the whole system, f all forces but those of constraints, C
(k, n) is the Jacobian of all constraints, the ties of interfaces included. The derivative is a difference along the
motion.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP, BodyParts
from multiphi_exudyn.exudyn_plugin.step_test import conditions, step_test
from multiphi_exudyn.levels.core_model import core_model
from multiphi_exudyn.mechanics.element import Element, event_kind
from multiphi_exudyn.time.law_warnings import laws_at_an_end
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.motion import failure, limits
from multiphi_exudyn.time.state import Event, Loss, Phase, State

__all__ = ["CoupledRun", "SystemAround"]

DIFFERENCE = 1e-3  # of a step: half the interval of the difference along the motion
CORE_PHASES = {phase: getattr(core.Phase, phase.name.lower()) for phase in Phase}
PHASES = {number: phase for phase, number in CORE_PHASES.items()}


class SystemAround:
    """The Exudyn system around a body in a run with steps of length ``step`` [s], as the core asks for it.

    exclusive: names of bodies that may not be attached to this one, by the index of their first coordinate.
    """

    def __init__(self, mbs: Any, body: BodyParts, step: float, exclusive: Mapping[int, str]) -> None:
        self.mbs, self.body, self.step = mbs, body, step
        self.solver = mbs.sys["dynamicSolver"]
        self.state = mbs.systemData.GetSystemStateDict(reference=True)
        self.count = len(self.state["ODE2Coords"])
        self.refusal: MultiPhiError | None = None
        self._exclusive, self._other_rows = exclusive, self.solver.GetODE1size()

    # ------------------------------------------------------------------ what the core asks for

    def forces(self) -> np.ndarray:
        """Forces f (n,) in the present state, without those of constraints."""
        self.solver.ComputeODE2RHS(self.mbs)
        return np.asarray(self.solver.GetSystemResidual()[: self.count])

    def mass(self) -> np.ndarray:
        """M (n, n) in the present state."""
        self.solver.ComputeMassMatrix(self.mbs)
        return np.asarray(self.solver.GetSystemMassMatrix()[: self.count, : self.count])

    def jacobian(self) -> np.ndarray:
        """C (k, n) in the present state."""
        first = self.count + self._other_rows
        size = first + len(self.state["AECoords"])
        self.solver.SetSystemJacobian(np.zeros((size, size)))
        self.solver.ComputeJacobianAE(self.mbs, scalarFactor_ODE2=1.0, scalarFactor_ODE2_t=1.0)
        self.mbs.solverSignalJacobianUpdate = True  # the solver's own Jacobian is overwritten
        return np.asarray(self.solver.GetSystemJacobian()[first:, : self.count])

    def constraint_accelerations(self) -> np.ndarray:
        """-d(C v + c_t)/dt (k,) at constant v, by a central difference."""
        q, v = self.state["ODE2Coords"], self.state["ODE2Coords_t"]
        half, data, first = DIFFERENCE * self.step, self.mbs.systemData, self.count + self._other_rows
        present, t, residuals = q.copy(), data.GetTime(), []
        try:
            for shift in (-half, half):
                q[:] = present + shift * v
                data.SetTime(t + shift)
                self.solver.ComputeAlgebraicEquations(self.mbs, velocityLevel=True)
                residuals.append(np.array(self.solver.GetSystemResidual()[first:]))
        finally:
            q[:] = present
            data.SetTime(t)
        return np.asarray((residuals[0] - residuals[1]) / (2 * half))

    def solver_level(self, states: tuple[int, ...]) -> core.SolverLevel:
        """The level of these states in the solver, with the points of the body and the forces of its elements."""
        discretised, interface = self.body.discretised_level(states), self.body.coordinates.interface
        loaded = discretised.loaded
        base, closed = loaded.level.base, loaded.level.indices
        rubbing = list(loaded.rubbing_elements)
        oblique = [next(k for k in base.link_indices[i] if k in base.oblique and k in closed) for i in rubbing]
        point_map = None if interface is None else interface.map_in(discretised)
        none, held = np.zeros((0, discretised.size)), loaded.channels.shapes.shape[1]
        return core.SolverLevel(
            equation=discretised.equation_matrix,
            drive=discretised.drive,
            rates=discretised.rates,
            difference=discretised.velocity_difference,
            velocity_inverse=discretised.velocity_inverse,
            physical=discretised.to_physical,
            from_velocity=discretised.from_velocity,
            rows=none if point_map is None else point_map.rows,
            offset=np.zeros(0) if point_map is None else point_map.constant,
            held_offset=np.zeros((0, held)) if point_map is None else point_map.held_columns,
            reactions=self.body.coordinates.direct_reactions(discretised),
            push=base.directions @ loaded.pushes,
            rubbing=rubbing,
            rubbing_forces=base.pushes[:, oblique] - base.directions[:, oblique],
        )

    def set_level(self, states: tuple[int, ...], held: np.ndarray, force: np.ndarray) -> None:
        """Give Exudyn the matrices of a level, and its ties the points at stick positions (h,) [m]."""
        coordinates = self.body.coordinates
        coordinates.held = held
        coordinates.set_level_in_run(self.mbs, self.body.discretised_level(states), force)

    def own_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """Modal force (s,) of the body's own varying loads at a time [s]."""
        return self.body.own_loads.force_at(states, time)

    def check_attached(self, coordinates: list[int]) -> None:
        """Raise where one of these coordinates, attached to the body, is one of a body with rigid contacts too."""
        for index in sorted(self._exclusive.keys() & set(coordinates)) if self._exclusive else ():
            self.refusal = MultiPhiValueError(
                f"interface: got constraints that tie body {self._exclusive[index]!r} to another, both with rigid "
                "contacts, need contacts of finite stiffness, a spring between, or both structures in one model "
                "(assemble)"
            )
            raise self.refusal

    # ------------------------------------------------------------------ at the start of a run

    def attached_parts(self) -> core.AttachedParts:
        """Masses and constraints attached to the body in the present state."""
        coordinates = self.body.coordinates
        interface = coordinates.interface
        ties = [] if interface is None else interface.multipliers.tolist()
        points = [] if interface is None else interface.indices.tolist()
        jacobian = np.delete(self.jacobian(), ties, axis=0)
        return core.AttachedParts(self.mass(), jacobian, coordinates.first, coordinates.discretised.mass, points)

    def accelerations(self) -> np.ndarray:
        """Accelerations a (n,) in the present state; writes the multipliers, and the accelerations of other parts."""
        coordinates, jacobian = self.body.coordinates, self.jacobian()
        interface, others = coordinates.interface, np.ones(self.count, bool)
        others[coordinates.first : coordinates.first + coordinates.discretised.size] = False
        ties = 0
        if interface is not None:
            others[interface.indices], ties = False, len(interface.multipliers)
        rates = self.constraint_accelerations() if len(jacobian) > ties else np.zeros(len(jacobian))
        solution = core.solve_constrained(self.mass(), jacobian, self.forces(), rates)
        self.state["AECoords"][:] = solution[self.count :]
        self.state["ODE2Coords_tt"][others] = solution[: self.count][others]
        return np.asarray(solution[: self.count])


class CoupledRun:
    """One run of ``body``, from a state at a time [s] on in steps of length ``step`` [s].

    running: until another solver begins. events: of the run so far.
    """

    def __init__(self, body: BodyParts, system: SystemAround, time: float, step: float, state: State) -> None:
        self.running, self.events = True, list[Event]()
        self._body, self._system, self._loads = body, system, body.own_loads
        coordinates = body.coordinates
        levels, interface = self._loads.loaded_levels, coordinates.interface
        levels.held = levels.held or _held_levels(levels)
        q, q_t, q_tt = (system.state[key] for key in ("ODE2Coords", "ODE2Coords_t", "ODE2Coords_tt"))
        window, allowed = limits(body.model)
        self._step = core.CoupledStep(
            levels=levels.held,
            window=window,
            allowed=allowed,
            time=time,
            displacement=q,
            velocity=q_t,
            acceleration=q_tt,
            multipliers=system.state["AECoords"],
            first=coordinates.first,
            points=[] if interface is None else interface.indices.tolist(),
            ties=[] if interface is None else interface.multipliers.tolist(),
            in_base=np.zeros((0, body.model.base.modes.count))
            if interface is None
            else interface.in_base(body.model.base),
            has_varying_loads=self._loads.varies,
            has_friction=coordinates.has_friction,
            has_rigid=coordinates.rigid,
        )
        phases = [CORE_PHASES[phase] for phase in state.phases]
        self._state = core.StepState(state.states, state.displacement, state.velocity, phases)
        self._announced_end, self._largest_energy = time, 0.0
        self._tests: dict[tuple[int, ...], core.StepTest] = {}
        self._prepare(step)
        self._begin(time, coordinates.copy_state())

    @property
    def state(self) -> State:
        """State after the last step with an event, or at the start of the run."""
        state, level = self._state, self._loads.static_levels.level(self._state.key)
        return State(level, state.displacement, state.velocity, tuple(PHASES[phase] for phase in state.phases))

    @property
    def time(self) -> float:
        """End of the last finished step [s]."""
        return self._test.time

    @property
    def is_step_clear(self) -> Callable[[float], int]:
        """Function of the end of a step [s]: nonzero if no event can have occurred in the step."""
        interface = self._body.coordinates.interface
        is_watched = self._is_at_end or (interface is not None and interface.shows_rotations)
        return self._watch_and_test if is_watched else self._test.is_step_clear

    def is_step_end(self, t: float) -> bool:
        """Whether a step of this length ends at t [s]."""
        return abs(t - self.time - self._step_size) <= self._rounding

    def change_step_size(self, step: float) -> None:
        """Take another step size [s], from the present step on."""
        time, start = self._test.time, self._test.start
        self._prepare(step)
        self._begin(time, start)

    def announce_step_end(self, t: float) -> None:
        """Announce, before a step, that it ends at t [s]; needed for loads that vary."""
        self._announced_end = t
        if not self._loads.has_jump(self.time, t, self._rounding):
            self._test.set_end_channels(t, self._loads.channels_at(t))

    def check(self, t: float) -> bool:
        """Compute the step that ends at t [s] again if an event may have occurred in it; whether one moved others."""
        if self._loads.varies and self._announced_end != t:
            raise MultiPhiValueError(
                f"PreStepUserFunction: got a function that replaced the one of {self._body.name!r}, which applies its "
                "loads; need yours set before CreateMultiPhiBody, then both are called"
            )
        coordinates, has_moved_others = self._body.coordinates, False
        if coordinates.interface is not None:
            coordinates.interface.record_angles()
        if not self._test.is_step_clear(t):
            has_moved_others = self._repeat(t) and coordinates.interface is not None
            self._begin(t, coordinates.copy_state())
        self._record_laws(t)
        return has_moved_others

    def restart_step(self) -> None:
        """Take the present state as the start of the next step."""
        self._begin(self.time, self._body.coordinates.copy_state())

    def _repeat(self, t: float) -> bool:
        """Compute the step that ends at t [s] again, exactly; whether an event occurred in it."""
        body, start = self._body, self.time
        load_jumps = self._loads.has_jump(start, t, self._rounding)
        try:
            found = self._step.repeat(
                self._system, start, t, self._test.start, self._state, self._largest_energy, load_jumps
            )
            if isinstance(found, core.Failure):
                raise failure(body.model, found, self._step.key)
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            if error is self._system.refusal:
                raise
            raise NumericalFailure(f"body {body.name!r}: at t = {self._step.time:.9g} s: {error}") from error
        finally:
            self.events.extend(_events(self._step.take_events(), body.model.contacts))
        if found.driven >= 0:
            raise NumericalFailure(
                f"body {body.name!r}: what is attached to its interface drives the closed contact "
                f"{body.model.links[found.driven].name!r} into its stop; give the contact a finite stiffness, or "
                "attach by a spring"
            )
        if found.is_unresolved:
            raise NumericalFailure(
                f"body {body.name!r}: at t = {found.event_time:.9g} s: steps of {t - start:g} s are too long for what "
                "is attached to its interface, need shorter steps, fewer modes, or constraints in place of stiff "
                "connectors"
            )
        self._largest_energy, self._state = found.largest_energy, found.state
        coordinates, key = body.coordinates, found.state.key
        body.record.include_level(body.discretised_level(key).loaded.level)
        body.record.include_energy(found.energy)
        self._choose_test()
        phases = np.array([[phase.value for phase in found.state.phases]])
        coordinates.write_level_data(coordinates.layout.rows(key, phases, coordinates.held[None])[0])
        body.include_step_error(t)
        return bool(found.has_changed)

    def _prepare(self, step: float) -> None:
        """Prepare loads and test for a step size [s]."""
        self._step_size, self._rounding, self._system.step = step, SAME_STEP * step, step
        self._loads.set_step(step)
        self._tests.clear()
        self._choose_test()

    def _begin(self, time: float, x: np.ndarray) -> None:
        """Begin a step at a time [s] with the state x."""
        armed = all(phase == core.Phase.armed for phase in self._state.phases)
        channels = (self._loads.channels_at(time),) if self._loads.varies else ()
        self._test.begin(time, np.concatenate([x, self._body.coordinates.held, *channels]), armed)

    def _watch_and_test(self, t: float) -> int:
        """``is_step_clear`` of a body whose turning, or a force law in a last segment, is recorded."""
        if self._body.coordinates.interface is not None:
            self._body.coordinates.interface.record_angles()
        is_clear = self._test.is_step_clear(t)
        if is_clear:
            self._record_laws(t)
        return is_clear

    def _record_laws(self, t: float) -> None:
        """Record the places of force laws at t [s] if one in a last segment may be beyond its span."""
        if not self._is_at_end:
            return
        coordinates, times = self._body.coordinates, np.array([t])
        discretised = coordinates.discretised
        q = coordinates.views[0][: discretised.modes]
        if not self._loads.varies and np.abs(self._span_rows.dot(q) + self._span_offsets).max() <= 1.0:
            return
        level, xi, _ = self._loads.level_coordinates(
            discretised, q[:, None], 0 * q[:, None], coordinates.held[:, None], times
        )
        self._body.record.include_places(level, xi, times)

    def _prepare_spans(self) -> None:
        """Prepare the places of force laws in a last segment, -1 to 1 inside their spans, for constant loads."""
        laws = laws_at_an_end(self._body.model, [self._state.key])
        self._is_at_end = bool(laws)
        if not laws or self._loads.varies:
            return
        level, coordinates = self._loads.loaded_levels.level(self._state.key), self._body.coordinates
        r, indices = coordinates.discretised.modes, [self._body.model.index(law.name) for law in laws]
        ends = np.array([[law.knots[0], law.knots[-1]] for law in laws])
        middles, halves = np.mean(ends, axis=1), np.diff(ends, axis=1)[:, 0] / 2
        rows, centres = level.level.gap_rows[indices], np.array([law.centre for law in laws])
        places = centres + level.gap_constants[indices] + rows[:, r:] @ coordinates.held
        self._span_rows, self._span_offsets = rows[:, :r] / halves[:, None], (places - middles) / halves

    def _choose_test(self) -> None:
        key, coordinates = self._state.key, self._body.coordinates
        self._prepare_spans()
        if key not in self._tests:
            discretised, interface = coordinates.discretised, coordinates.interface
            rows = conditions(self._loads, discretised, self._step_size, coordinates.direct_reactions(discretised))
            views = *coordinates.views, coordinates.multipliers
            indices = [] if interface is None else interface.multipliers.tolist()
            self._tests[key] = step_test(rows, self._step_size, self._rounding, views, indices)
        self._test = self._tests[key]


def _held_levels(levels: LoadedLevels) -> core.HeldLevels:
    """The levels under held forces, each built on first use: all bodies in the same levels share them."""
    return core.HeldLevels(core_model(levels.model), levels.core_excitation(), levels.lasting)


def _events(rows: Sequence[tuple[Any, ...]], elements: Sequence[Element]) -> list[Event]:
    """Events of the core; an impulse on a contact that stays closed belongs to the next one."""
    events, shared = list[Event](), list[tuple[str, float]]()
    for time, index, entered, left, impulse, loss in rows:
        element = elements[index]
        if entered == core.SHARED:
            shared.append((element.name, impulse))
            continue
        kind, state = event_kind(element.states, left, entered), element.states[entered].name
        events.append(Event(time, element.name, kind, Loss(*loss), impulse, tuple(shared), state))
        shared.clear()
    return events
