"""Surroundings: forces of the system on a body at an event within a step, and effects of the event on the system.

    (p, f) right after an event = (p, f) before it + change of the system's forces from the state before to that after

p (s,) acts on the coordinates of the body, f (m,) on its points. With connectors and loads alone, the change is read
from the system's forces. With masses or constraints attached to the points, the accelerations of the whole system are
computed, and reactions of rigid contacts cause forces on the points (attached_inertia.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.state import State
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.coupling.attached_inertia import PointInertia, Reactions
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.coupling.system_matrices import AttachedParts, SystemMatrices

__all__ = ["CoupledBody", "Instant", "Surroundings", "surroundings_of"]


class CoupledBody(Protocol):
    """Attributes of a body that its surroundings need."""

    coordinates: Coordinates

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The solver's level in which the elements are in these states."""

    def varying_load_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """Force (p, f) of the body's own varying loads at a time [s], in a level."""


@dataclass(frozen=True)
class Instant:
    """Time [s] of the first event in a step of length ``step`` [s], and the states right before and right after it."""

    time: float
    step_end: float
    step: float
    state_before: State
    state_after: State

    @property
    def elapsed(self) -> float:
        """Time [s] from the event to the end of the step."""
        return self.step_end - self.time


@dataclass(frozen=True)
class Surroundings:
    """The system around a body at the end of a step, in the state that the step without an event gives.

    undisturbed: q, v (2, n) of the system in that state. parts: attached to the points; inertia: of the parts, for the
    body's levels, None where nothing is attached. reactions: forces on the points that reactions of rigid contacts
    cause. All are None without an interface.
    """

    body: CoupledBody
    system: SystemMatrices | None
    undisturbed: np.ndarray
    parts: AttachedParts | None
    inertia: PointInertia | None
    reactions: Reactions | None

    def force_in_level(self, force: np.ndarray, source: SteppedLevel, states: tuple[int, ...]) -> np.ndarray:
        """Force (p, f) of the level ``source`` in another one, with the change of the forces that reactions cause."""
        if states == source.states:
            return force
        coordinates, target = self.body.coordinates, self.body.stepped_level(states)
        transformed = coordinates.transform_force(force, source, target)
        if self.reactions is None or coordinates.interface is None:
            return transformed
        change = self.reactions.at(target.loaded) - self.reactions.at(source.loaded)
        return transformed + np.concatenate([change @ coordinates.interface.map_in(target).rows, change])

    def force_after_event(self, mbs: Any, instant: Instant, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Force (p, f) right after an event, from ``force`` right before it, and the change (n,) in the system.

        The change is one of accelerations where something is attached to the points, else one of forces.
        """
        body, coordinates, system = self.body, self.body.coordinates, self.system
        before, after = instant.state_before, instant.state_after
        old, new = coordinates.stepped, body.stepped_level(after.states)
        own_before = body.varying_load_force(old.states, instant.step_end)
        own_after = body.varying_load_force(after.states, instant.step_end)
        modal_before = (force + own_before)[: old.size]
        coordinates.write(old, before.held, old.solver_state(before.displacement, before.velocity, modal_before))
        modal_after = (self.force_in_level(force, old, after.states) + own_after)[: old.size]
        entered = new.solver_state(after.displacement, after.velocity, modal_after)
        if self.inertia is None or system is None or self.parts is None:
            forces_before = coordinates.external_forces(mbs, old)
            coordinates.write(new, after.held, entered)
            forces_after = coordinates.external_forces(mbs, new)
        else:
            state_before = system.copy_state()
            forces_before = coordinates.forces_from_accelerations(system.accelerations(instant.step))
            coordinates.set_level_if_changed(mbs, new, after.held, new.drive)
            coordinates.write(new, after.held, entered)
            system.move_parts(self.parts, state_before)
            forces_after = coordinates.forces_from_accelerations(system.accelerations(instant.step))
        remainder = coordinates.transform_force(force - forces_before.forces, old, new)
        return forces_after.forces + remainder, forces_after.system_values - forces_before.system_values

    def at_event(self, instant: Instant, force: np.ndarray) -> Surroundings:
        """The surroundings at the event, where joints may have had other angles; force: (p, f) right before it."""
        coordinates = self.body.coordinates
        if self.system is None or self.inertia is None or not coordinates.depends_on_later_forces:
            return self
        parts = self.system.attached_parts(self.undisturbed, coordinates.stepped.mass, instant.elapsed)
        at_event = replace(self, parts=parts, inertia=_point_inertia(self.body, parts))
        return at_event.with_reactions_at(instant.state_before, force)

    def with_reactions_at(self, state: State, force: np.ndarray) -> Surroundings:
        """The surroundings with the reactions that follow from a state in which (p, f) acts.

        Only with one acceleration for both decisions do stick and slip exclude each other.
        """
        if self.parts is None or self.inertia is None or not self.body.coordinates.has_friction:
            return self
        level, r, s = state.level.modal, state.level.modal.modes, self.body.coordinates.stepped.size
        x, v = state.displacement, state.velocity
        eta_tt = state.level.alone.asymptotic.drive + force[:r]
        eta_tt -= level.damping_matrix @ v[:r] + level.squares * x[:r] + level.coupling @ x[:r]
        reactions = _reactions_of(self.body, self.parts, state.level, (x, v, eta_tt), force[s:])
        return replace(self, reactions=reactions)

    def force_at_step_end(self, mbs: Any, instant: Instant, change: np.ndarray) -> np.ndarray:
        """Force (p, f) at the end of the step, after the system has followed the body since the event.

        change: of accelerations or forces (n,) at the event, from ``force_after_event``.
        """
        coordinates, system = self.body.coordinates, self.system
        assert system is not None
        assert self.parts is not None
        if self.inertia is None:
            system.apply_force_jump(self.parts, instant.step, instant.elapsed, change)
            external = coordinates.external_forces(mbs, coordinates.stepped)
            coordinates.set_tie_forces(external.forces[coordinates.stepped.size :])
            return external.forces
        q, v = self.undisturbed
        system.move_parts(self.parts, np.array([q, v + instant.elapsed * change]))
        return coordinates.forces_from_accelerations(system.accelerations(instant.step)).forces

    def point_velocity(self, state: State, force: np.ndarray) -> np.ndarray:
        """y' (m,) of the points in a state of the body, as the solver has it; force: (p, f)."""
        interface, stepped = self.body.coordinates.interface, self.body.stepped_level(state.states)
        assert interface is not None
        q_t = stepped.solver_state(state.displacement, state.velocity, force[: stepped.size])[1]
        return np.asarray(interface.map_in(stepped).rows @ q_t)

    def joined(self, state: State, force: np.ndarray, instant: Instant, change: np.ndarray, jumps: np.ndarray) -> State:
        """State at the end of the step in which the body and what is attached to its points have one velocity there.

        The solver's step moves the attached parts, and the exact step the body. Where the step is long for the body's
        modes, or the force changes within it, their velocities differ at the points. They become one as in an impact,
        with equal and opposite impulses. If the parts followed the body instead, a heavy part would take over every
        vibration of a light body.

        force: (p, f) in this state. change: of accelerations (n,) at the first event. jumps: of y' (m,) at all events,
        in which the attached parts take part.
        """
        interface, stepped = self.body.coordinates.interface, self.body.stepped_level(state.states)
        if self.inertia is None or interface is None:
            return state
        of_parts = self.undisturbed[1] + instant.elapsed * change
        difference = self.point_velocity(state, force) - of_parts[interface.indices] - jumps
        r, velocity = stepped.modes, state.velocity.copy()
        rows = interface.map_in(stepped).rows[:, :r] @ stepped.from_velocity[:r, :r]
        velocity[:r] += self.inertia.joining(rows, difference)
        return replace(state, velocity=velocity)

    def kinetic_energy(self, state: State) -> float:
        """Kinetic energy [J] of the body and of the parts attached to its points."""
        if self.parts is None or self.inertia is None:
            return state.kinetic
        speeds = _point_rows(self.body, state.states) @ state.velocity[: state.level.modal.modes]
        return state.kinetic + 0.5 * float(speeds @ self.parts.inertia.mass @ speeds)


def surroundings_of(body: CoupledBody, x: np.ndarray) -> Surroundings:
    """Surroundings of a body in the present state of the system; x: a copy of the body's part of that state."""
    coordinates = body.coordinates
    system = coordinates.system
    if coordinates.interface is None or system is None:
        return Surroundings(body, None, np.zeros((2, 0)), None, None, None)
    undisturbed = system.copy_state()
    parts = system.attached_parts(undisturbed, coordinates.stepped.mass)
    inertia = _point_inertia(body, parts)
    if inertia is None or not coordinates.depends_on_later_forces:
        return Surroundings(body, system, undisturbed, parts, inertia, None)
    physical = coordinates.stepped.to_physical @ np.concatenate(coordinates.split(x))
    eta, eta_t, eta_tt = (part[: coordinates.stepped.modes] for part in np.split(physical, 3))
    motion = np.concatenate([eta, coordinates.held]), np.concatenate([eta_t, 0 * coordinates.held]), eta_tt
    reactions = _reactions_of(body, parts, coordinates.stepped.loaded, motion, coordinates.interface.forces)
    return Surroundings(body, system, undisturbed, parts, inertia, reactions)


def _reactions_of(
    body: CoupledBody, parts: AttachedParts, loaded: LoadedLevel, motion: Sequence[np.ndarray], points: np.ndarray
) -> Reactions:
    """Forces on points caused by those of elements; motion: xi, xi', eta'' in a level; points: f (m,)."""
    (x, v, eta_tt), level, coordinates = motion, loaded.level, body.coordinates
    assert coordinates.interface is not None
    constant = loaded.asymptotic.forces + coordinates.direct_reactions(body.stepped_level(loaded.states)) @ points
    link_forces = constant + level.force_rows @ x + level.force_rate_rows @ v
    rows = coordinates.interface.in_base(level.base)
    acceleration = loaded.modal.vectors @ eta_tt
    return Reactions(parts.inertia, level.base, rows, acceleration, loaded, link_forces, _spring_forces(loaded, x, v))


def _spring_forces(loaded: LoadedLevel, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Forces -k q - c q' (l,) [N] of all links of finite stiffness, whether they act or not."""
    base, level = loaded.level.base, loaded.level
    springs = np.where(np.isinf(base.stiffnesses), 0.0, base.stiffnesses)
    return np.asarray(-springs * (level.gap_rows @ x + loaded.gap_constants) - base.dampings * (level.gap_rows @ v))


def _point_inertia(body: CoupledBody, parts: AttachedParts) -> PointInertia | None:
    interface = body.coordinates.interface
    if parts.only_forces or interface is None:
        return None
    base = body.coordinates.stepped.loaded.level.base
    return PointInertia(parts.inertia, base, interface.in_base(base), lambda states: _point_rows(body, states))


def _point_rows(body: CoupledBody, states: tuple[int, ...]) -> np.ndarray:
    """Rows R (m, r) of the points in the modes of a level."""
    stepped, interface = body.stepped_level(states), body.coordinates.interface
    assert interface is not None
    return interface.map_in(stepped).rows[:, : stepped.modes]
