"""Exact step: a step of the solver computed again by the core, from event to event.

    before the first event   the mean of the forces at both ends of the step, transformed to the modes of each level
    after it                 the same, plus the change of reactions, loads, connectors and inertia at the event

The forces of constraints at the end of a step are not used: the trapezoidal rule makes them alternate, and only their
mean is right. To find what the event changes in the system, the states right before and right after it are written into
it (surroundings.py). An impact is one of the body together with all that is attached to its interface
(attached_inertia.py). At the end of the step, body and attached parts get one velocity at the points, with equal and
opposite impulses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events.transitions.state import State
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.stepping.surroundings import Instant, Surroundings, surroundings_of
from multiphi_exudyn.exudyn_plugin.coupling.exact_motion import AdvanceResult, ExactMotion
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import LevelForces
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.model.model import MultiPhiModel

__all__ = ["BodyInStep", "Outcome", "Step", "exact_step"]

NEGLIGIBLE = 1e-9  # of the accelerations: a smaller modal force is the residual of Newton's iterations
UNRESOLVED = 0.1  # of the largest energy at an event: error of the work of a force that is held constant
DRIVEN = 1e-3  # of its terms: a gap that is more negative is not due to drift of constraints


class BodyInStep(Protocol):
    """Attributes of a body that an exact step needs."""

    name: str
    model: MultiPhiModel
    coordinates: Coordinates

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The solver's level in which the elements are in these states."""

    def varying_load_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """Force (p, f) of the body's own varying loads at a time [s], in a level."""

    def include_step_error(self, time: float) -> None:
        """Take notice of the present state, after an event at a time [s]."""


@dataclass(frozen=True)
class Step:
    """A step from ``start_time`` to ``end_time`` [s], with x = (q, q', q'', 1, f) at both ends.

    state: level, phases and stick positions at its start. largest_energy: of body and attached masses at the events so
    far [J]. load_jumps: whether an own load jumps in the step, which the trapezoidal rule takes for a ramp.
    """

    start_time: float
    end_time: float
    x_start: np.ndarray
    x_end: np.ndarray
    state: State
    largest_energy: float
    load_jumps: bool

    @property
    def length(self) -> float:
        """Step size h [s]."""
        return self.end_time - self.start_time


@dataclass(frozen=True)
class Outcome:
    """Result of an exact step: the state at its end, and the largest energy [J] at events so far.

    disturbs_others: whether an event has changed what is attached to the body.
    """

    state: State
    disturbs_others: bool
    largest_energy: float


def exact_step(body: BodyInStep, mbs: Any, motion: ExactMotion, step: Step) -> Outcome:
    """Compute a step again, exactly, and write its end state into the system if anything happened in it."""
    coordinates, start = body.coordinates, step.state
    old = coordinates.stepped
    loads = body.varying_load_force(start.states, step.start_time) + body.varying_load_force(
        start.states, step.end_time
    )
    total = coordinates.external_force(step.x_start) + coordinates.external_force(step.x_end)
    force = _without_solver_residual(coordinates, (total - loads) / 2, step.x_end)
    around = surroundings_of(body, step.x_end)
    _check_not_driven(body, around, step.x_end)
    state = _start_state(body, step, force)
    motion.set_forces(_level_forces(body, lambda states: around.force_in_level(force, old, states)), around.inertia)
    first = motion.advance(state, step.start_time, step.end_time, stop=True, trial=coordinates.depends_on_later_forces)
    if not first.changed:
        if step.load_jumps:
            _write(body, mbs, first.state, force, step.end_time)
        end_state = replace(first.state, level=start.level)
        return Outcome(end_state, disturbs_others=False, largest_energy=step.largest_energy)
    instant = Instant(first.time, step.end_time, step.length, first.state_before, first.state)
    force_after, change = around.force_after_event(mbs, instant, force)
    at_event = around.at_event(instant, force)
    force_after = _without_solver_residual(coordinates, force_after, step.x_end)
    later = _ForcesAfterEvent(body, at_event, force_after, body.stepped_level(first.state.states))
    if coordinates.depends_on_later_forces:  # they determine reactions and accelerations, and so the level after it
        forces = _level_forces(body, lambda states: force if states == start.states else later.in_level(states))
        motion.set_forces(forces, at_event.inertia)
        first = motion.advance(state, step.start_time, step.end_time, stop=True)
    jump = _point_jump(body, at_event, first, force, later)
    end, later, jumps = _advance_to_end(body, motion, first, later, step.end_time, jump)
    force_at_end, largest_energy = later.in_level(end.state.states), step.largest_energy
    end_state = at_event.joined(end.state, force_at_end, instant, change, jumps)
    _write(body, mbs, end_state, force_at_end, step.end_time)
    if coordinates.interface is not None:
        force_at_end = at_event.force_at_step_end(mbs, instant, change)
        error = force_at_end - later.in_level(end_state.states)
        largest_energy = _check_resolved(body, at_event, step, instant, old, end_state, error)
        _write(body, mbs, end_state, force_at_end, step.end_time)
    return Outcome(end_state, disturbs_others=coordinates.interface is not None, largest_energy=largest_energy)


@dataclass(frozen=True)
class _ForcesAfterEvent:
    """Forces from an event on: ``force``, (p, f) in the level that the event enters."""

    body: BodyInStep
    around: Surroundings
    force: np.ndarray
    level: SteppedLevel

    def in_level(self, states: tuple[int, ...]) -> np.ndarray:
        """Force (p, f) in a level."""
        return self.around.force_in_level(self.force, self.level, states)

    def after_event(self, state: State) -> _ForcesAfterEvent:
        """Forces from a further event on, right before which the body is in ``state``."""
        force = self.in_level(state.states)
        around = self.around.with_reactions_at(state, force)
        return _ForcesAfterEvent(self.body, around, force, self.body.stepped_level(state.states))


def _advance_to_end(
    body: BodyInStep,
    motion: ExactMotion,
    first: AdvanceResult,
    later: _ForcesAfterEvent,
    until: float,
    jumps: np.ndarray,
) -> tuple[AdvanceResult, _ForcesAfterEvent, np.ndarray]:
    """Advance from the first event to the end of the step, with all further events; result and forces at the end.

    jumps: of y' (m,) of the points at the first event; those at all further events are added.
    """
    start, has_friction = first, body.coordinates.has_friction
    while start.time < until:
        before = later
        motion.set_forces(_level_forces(body, later.in_level), later.around.inertia)
        result = motion.advance(start.state, start.time, until, stop=True, trial=has_friction)
        if has_friction:
            if result.changed:
                later = later.after_event(result.state_before)
                motion.set_forces(_level_forces(body, later.in_level), later.around.inertia)
            result = motion.advance(start.state, start.time, until, stop=True)
        if result.changed:
            force = before.in_level(result.state_before.states)
            jumps = jumps + _point_jump(body, later.around, result, force, later)
        start = result
    return start, later, jumps


def _point_jump(
    body: BodyInStep, around: Surroundings, result: AdvanceResult, force: np.ndarray, later: _ForcesAfterEvent
) -> np.ndarray:
    """Jump of y' (m,) of the points at the last event of a result; force, later: (p, f) before and after it."""
    if around.inertia is None:
        return np.zeros(body.coordinates.point_count)
    before, after = result.state_before, result.state
    return around.point_velocity(after, later.in_level(after.states)) - around.point_velocity(before, force)


def _level_forces(
    body: BodyInStep, force_in: Callable[[tuple[int, ...]], np.ndarray]
) -> Callable[[tuple[int, ...]], LevelForces]:
    """Modal forces and direct reactions by level, from the force (p, f) by level."""
    coordinates = body.coordinates
    size = coordinates.stepped.size

    def level_forces(states: tuple[int, ...]) -> LevelForces:
        force = force_in(states)
        return LevelForces(force[:size], coordinates.direct_reactions(body.stepped_level(states)) @ force[size:])

    return level_forces


def _start_state(body: BodyInStep, step: Step, force: np.ndarray) -> State:
    """State at the start of a step with the mean force (p, f)."""
    coordinates, held = body.coordinates, step.state.held
    stepped, (q, q_t, _) = body.stepped_level(step.state.states), coordinates.split(step.x_start)
    own = body.varying_load_force(stepped.states, step.start_time)
    modal_force, r = (force + own)[: coordinates.stepped.size], stepped.modes
    xi = np.concatenate([q[:r], held])
    xi_t = np.concatenate([stepped.velocity(q, q_t, modal_force)[:r], 0 * held])
    return replace(step.state, displacement=xi, velocity=xi_t)


def _write(body: BodyInStep, mbs: Any, state: State, force: np.ndarray, time: float) -> None:
    """Write a state at the end of a step into the system, with the acceleration under the force (p, f)."""
    coordinates, own = body.coordinates, body.varying_load_force(state.states, time)
    stepped = body.stepped_level(state.states)
    coordinates.set_level_if_changed(mbs, stepped, state.held, stepped.drive + own[: stepped.size])
    modal_force = (force + own)[: stepped.size]
    coordinates.write(stepped, state.held, stepped.solver_state(state.displacement, state.velocity, modal_force))


def _without_solver_residual(coordinates: Coordinates, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(p, f), with p set to zero in place where it is no more than the residual of the solver's iterations at x."""
    modal, q_tt = force[: coordinates.stepped.size], coordinates.split(x)[2]
    if modal.dot(modal) <= NEGLIGIBLE**2 * q_tt.dot(q_tt):
        modal[:] = 0.0
    return force


# ---------------------------------------------------------------------- checks of the result


def _check_not_driven(body: BodyInStep, around: Surroundings, x: np.ndarray) -> None:
    """Raise where attached masses and constraints drive a contact into its stop, which they leave no mobility."""
    coordinates = body.coordinates
    if around.inertia is None or not coordinates.rigid:
        return
    loaded = coordinates.stepped.loaded
    xi = np.concatenate([coordinates.split(x)[0][: coordinates.stepped.modes], coordinates.held])
    for i in around.inertia.immovable - set(loaded.level.indices):
        terms = np.append(loaded.level.gap_rows[i] * xi, loaded.gap_constants[i])
        if np.sum(terms) < -DRIVEN * np.sum(np.abs(terms)):
            name = body.model.links[i].name
            raise NumericalFailure(
                f"body {body.name!r}: what is attached to its interface drives the closed contact {name!r} into its "
                "stop; give the contact a finite stiffness, or attach by a spring"
            )


def _check_resolved(
    body: BodyInStep,
    around: Surroundings,
    step: Step,
    instant: Instant,
    old: SteppedLevel,
    state: State,
    error: np.ndarray,
) -> float:
    """Return the largest energy [J] so far; raise where a constant force after an event is too poor an approximation.

    That is where the error (p, f) of this force at the end of the step does a work that counts, or where the energy of
    body and attached masses more than doubles.
    """
    before = instant.state_before
    strain = 0.5 * float(np.abs(old.loaded.level.squares) @ before.displacement**2)
    kinetic = around.kinetic_energy(before)
    largest_energy = max(step.largest_energy, kinetic + strain)
    gained = around.kinetic_energy(state) + state.potential - kinetic - before.potential
    if state.states == instant.state_after.states:
        displacement = (state.displacement - instant.state_after.displacement)[: state.level.modal.modes]
        gained = max(gained, abs(float(error[: len(displacement)] @ displacement)) / (2 * UNRESOLVED))
    if gained > largest_energy:
        raise NumericalFailure(
            f"body {body.name!r}: at t = {instant.time:.9g} s: steps of {step.length:g} s are too long for what is "
            "attached to its interface, need shorter steps, fewer modes, or constraints in place of stiff connectors"
        )
    return largest_energy
