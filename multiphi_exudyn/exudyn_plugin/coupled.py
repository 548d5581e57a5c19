"""Modal force that is constant for the length of a step.

A constant force p on the coordinates eta of a level only shifts the centre of their motion,

    eta'' + D eta' + S (eta - d) = drive + p_0,   d = S^-1 p,   p_0 = (1 - S S^-1) p

S is diag(omega^2) and the coupling by friction (sliding.py), S^-1 its inverse on the modes of nonzero frequency, p_0
the force on the others. A force on coordinate k acts on mode k of the present level. If p comes from forces f on
points, closed rigid contacts have the reactions L f in addition, which the modes of the level do not contain. Masses
attached to the points take part in impacts (attached.py). The core has the levels under such forces
(core/held_forces.hpp).

Exact motion of a body within a step, from event to event, under constant forces, by the core.

All bodies in the same levels share those under such forces: what has been made for one step serves all later ones, only
its constants change. So the forces have to be set before every advance, where another body may have set its own.

Surroundings: forces of the system on a body at an event within a step, and effects of the event on the system.

    (p, f) right after an event = (p, f) before it + change of the system's forces from the state before to that after

p (s,) acts on the coordinates of the body, f (m,) on its points. With connectors and loads alone, the change is read
from the system's forces. With masses or constraints attached to the points, the accelerations of the whole system are
computed, and reactions of rigid contacts cause forces on the points (attached.py).

Exact step: a step of the solver computed again by the core, from event to event.

    before the first event   the mean of the forces at both ends of the step, transformed to the modes of each level
    after it                 the same, plus the change of reactions, loads, connectors and inertia at the event

The forces of constraints at the end of a step are not used: the trapezoidal rule makes them alternate, and only their
mean is right. To find what the event changes in the system, the states right before and right after it are written into
it (coupled.py). An impact is one of the body together with all that is attached to its interface
(attached.py). At the end of the step, body and attached parts get one velocity at the points, with equal and
opposite impulses.

Step by step: one run of a body that is coupled to other items of the system, or acted on by them.

After every step a certified test (step_test.py) shows that no event can have occurred in it. Where the test fails,
the core computes the step again from its start (coupled.py), with the mean force of the step held
constant. If an event occurred, its result replaces Exudyn's coordinates, matrices and level. The accelerations that are
written belong to the forces of loads and connectors in the new level.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.attached import AttachedParts, PointInertia, Reactions, SystemMatrices
from multiphi_exudyn.exudyn_plugin.discretised_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.solver import bodies_of
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP, Coordinates, RunRecord
from multiphi_exudyn.exudyn_plugin.step_test import OwnLoads, step_test
from multiphi_exudyn.levels.core_model import core_model
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mathematics.bounded_cache import BoundedCache
from multiphi_exudyn.mathematics.round_off import INDEPENDENT
from multiphi_exudyn.mechanics.element import Element, event_kind
from multiphi_exudyn.time.law_warnings import laws_at_an_end
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.motion import failure, limits
from multiphi_exudyn.time.state import Event, Loss, Phase, State

LEVEL_BYTES = 2**29  # of all levels under held forces: with more they are made anew
CORE_PHASES = {phase: getattr(core.Phase, phase.name.lower()) for phase in Phase}
PHASES = {number: phase for phase, number in CORE_PHASES.items()}
NEGLIGIBLE = 1e-9  # of the accelerations: a smaller modal force is the residual of Newton's iterations
UNRESOLVED = 0.1  # of the largest energy at an event: error of the work of a force that is held constant
DRIVEN = 1e-3  # of its terms: a gap that is more negative is not due to drift of constraints


class LevelForces(NamedTuple):
    """Forces in a level: a modal force (s,), and the direct reactions L f (k,) [N] of its links to forces on points."""

    force: np.ndarray
    reactions: np.ndarray


class Inertia(Protocol):
    """Inertia of masses and constraints that are attached to a structure."""

    independence: float  # of directions of length one: those whose remaining part is smaller count as redundant

    def mobility(self, states: tuple[int, ...]) -> np.ndarray:
        """F (r, r) of a level's B = F F^T."""

    def velocity_map(self, source: tuple[int, ...], target: tuple[int, ...], matrix: np.ndarray) -> np.ndarray:
        """Matrix of eta'_m from eta'_l; ``matrix`` is that without attached inertia."""

    def directions(self, units: np.ndarray) -> np.ndarray:
        """Directions (c, b) of contacts, reduced by the attached inertia."""

    @property
    def immovable(self) -> set[int]:
        """Indices of contacts that the attached inertia leaves no mobility."""


@dataclass(frozen=True)
class AdvanceResult:
    """Result of an advance: ``state`` at ``time`` [s], and the state right before its last event.

    changed: whether an event occurred, or a trial failed.
    """

    time: float
    state: State
    changed: bool
    state_before: State


class ExactMotion:
    """Motions in these levels under held forces, in a run that begins at ``time`` [s]; name: for messages of failures.

    Its states are those under static loads alone, without the forces.
    """

    def __init__(self, levels: LoadedLevels, name: str, time: float) -> None:
        self._model, self._static_levels, self._name = levels.model, levels.alone, name
        self._levels = levels.held = levels.held or _held_levels(levels)
        self._run = core.Run(self._levels, *limits(self._model), time)
        self._run.sums_works = self._run.keeps_summary = False  # a body does not report them
        self._attached: Inertia | None = None
        self._any_rigid = any(element.rigid and not element.held for element in self._model.contacts)
        self.events: list[Event] = []

    def set_forces(self, forces: Callable[[tuple[int, ...]], LevelForces], inertia: Inertia | None) -> None:
        """Set the forces, a function of a level's states, and the inertia that is attached to the structure."""
        if self._levels.bytes > LEVEL_BYTES:
            self._levels.forget()
        self._levels.set_forces(forces, None if inertia is None else (inertia.mobility, inertia.velocity_map))
        if self._any_rigid and inertia is not self._attached:
            self._run.set_attached(*_attached(self._levels, inertia))
            self._attached = inertia

    def advance(
        self, state: State, time: float, until: float, stop: bool = False, trial: bool = False
    ) -> AdvanceResult:
        """Advance from a state at ``time`` [s] to ``until`` [s]; stop: end at the first event.

        trial: the events are not recorded, as the advance will be repeated. A trial that fails ends in the state right
        before the failure.
        """
        run, chatter = self._run, self._run.chatter if trial else None
        try:
            with np.errstate(all="ignore"):
                run.begin_step(time, _core_state(state))
                told = run.advance(until, stop)
            if told is not None and not trial:
                raise failure(self._model, told, run.present.key)
        except (MultiPhiError, np.linalg.LinAlgError) as error:
            singular = "" if isinstance(error, MultiPhiError) else "linear algebra of a level or an impact fails: "
            raise NumericalFailure(f"{self._name}: at t = {run.time:.9g} s: {singular}{error}") from error
        finally:
            events = _events(run.trajectory, self._model.contacts)
            if chatter is None:
                self.events.extend(events)
            else:
                run.chatter = chatter
        after, changed = self._state(run.present), told is not None or bool(events)
        return AdvanceResult(run.time, after, changed, self._state(run.reached) if stop else after)

    def _state(self, state: core.StepState) -> State:
        phases = tuple([PHASES[phase] for phase in state.phases])
        return State(self._static_levels.level(state.key), state.displacement, state.velocity, phases)


def _held_levels(levels: LoadedLevels) -> core.HeldLevels:
    """Levels under held forces, each built on first use."""
    return core.HeldLevels(core_model(levels.model), levels.core_excitation(), levels.lasting)


def _core_state(state: State) -> core.StepState:
    phases = [CORE_PHASES[phase] for phase in state.phases]
    return core.StepState(state.level.states, state.displacement, state.velocity, phases)


def _attached(levels: core.HeldLevels, inertia: Inertia | None) -> tuple[np.ndarray, float, list[int]]:
    """Directions of the links under attached inertia, empty without it, which of them are redundant, and immovable."""
    if inertia is None:
        return np.zeros((0, 0)), INDEPENDENT, []
    directions, elements = levels.model.unit_directions, levels.model.size
    directions[:elements] = inertia.directions(directions[:elements])
    return directions, inertia.independence, list(inertia.immovable)


def _events(trajectory: core.Trajectory, elements: Sequence[Element]) -> list[Event]:
    """Events of a trajectory; an impulse on a contact that stays closed belongs to the next one."""
    events, shared = list[Event](), list[tuple[str, float]]()
    names = "times", "elements", "entered", "left", "impulses", "losses"
    columns = (getattr(trajectory, f"event_{name}").tolist() for name in names)
    for time, index, entered, left, impulse, loss in zip(*columns, strict=True):
        element = elements[index]
        if entered == core.SHARED:
            shared.append((element.name, impulse))
            continue
        kind = event_kind(element.states, left, entered)
        state = element.states[entered].name
        events.append(Event(time, element.name, kind, Loss(*loss), impulse, tuple(shared), state))
        shared.clear()
    return events


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
        eta_tt = state.level.asymptotic.static_drive + force[:r]
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


class StepwiseRun:
    """One run of ``body`` under its own ``loads``, from a time [s] on in steps of length ``step`` [s].

    motion: computes steps again. record: of levels and energies, for the warnings. running: until another solver
    begins. state: after the last step with an event, or at the start of the run.
    """

    def __init__(
        self,
        body: BodyInStep,
        loads: OwnLoads,
        motion: ExactMotion,
        record: RunRecord,
        time: float,
        step: float,
        state: State,
    ) -> None:
        self.running, self.state = True, state
        self._body, self._loads, self._motion, self._record = body, loads, motion, record
        self._announced_end, self._largest_energy = time, 0.0
        self._tests = BoundedCache[tuple[int, ...], core.StepTest](body.model.most_levels)
        self._prepare(step)
        self._begin(time, body.coordinates.copy_state())

    @property
    def time(self) -> float:
        """End of the last finished step [s]."""
        return self._test.time

    @property
    def events(self) -> Sequence[Event]:
        """Events of the run so far."""
        return self._motion.events

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

    def check(self, mbs: Any, t: float) -> None:
        """Compute the step that ends at t [s] again if an event may have occurred in it."""
        if self._loads.varies and self._announced_end != t:
            raise MultiPhiValueError(
                f"PreStepUserFunction: got a function that replaced the one of {self._body.name!r}, which applies its "
                "loads; need yours set before CreateMultiPhiBody, then both are called"
            )
        if self._body.coordinates.interface is not None:
            self._body.coordinates.interface.record_angles()
        if not self._test.is_step_clear(t):
            self._repeat(mbs, t)
            self._begin(t, self._body.coordinates.copy_state())
        self._record_laws(t)

    def restart_step(self) -> None:
        """Take the present state as the start of the next step."""
        self._begin(self.time, self._body.coordinates.copy_state())

    def _repeat(self, mbs: Any, t: float) -> None:
        """Compute the step that ends at t [s] again, exactly."""
        coordinates, start_time = self._body.coordinates, self.time
        load_jumps = self._loads.has_jump(start_time, t, self._rounding)
        step = Step(
            start_time, t, self._test.start, coordinates.copy_state(), self.state, self._largest_energy, load_jumps
        )
        outcome = exact_step(self._body, mbs, self._motion, step)
        self._largest_energy, self.state = outcome.largest_energy, outcome.state
        self._record.include_state(outcome.state)
        self._choose_test()
        coordinates.write_level_data(coordinates.layout.from_state(outcome.state))
        self._body.include_step_error(t)
        bodies = bodies_of(mbs)
        bodies.others_disturbed = bodies.others_disturbed or outcome.disturbs_others

    def _prepare(self, step: float) -> None:
        """Prepare loads and test for a step size [s]."""
        self._step_size, self._rounding = step, SAME_STEP * step
        self._loads.set_step(step)
        self._tests.clear()
        self._choose_test()

    def _begin(self, time: float, x: np.ndarray) -> None:
        """Begin a step at a time [s] with the state x."""
        armed = all(phase is Phase.ARMED for phase in self.state.phases)
        channels = (self._loads.channels_at(time),) if self._loads.varies else ()
        self._test.begin(time, np.concatenate([x, self.state.held, *channels]), armed)

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
        coordinates = self._body.coordinates
        stepped, times = coordinates.stepped, np.array([t])
        q = coordinates.views[0][: stepped.modes]
        if not self._loads.varies and np.abs(self._span_rows.dot(q) + self._span_offsets).max() <= 1.0:
            return
        level, xi, _ = self._loads.level_coordinates(
            stepped, q[:, None], 0 * q[:, None], self.state.held[:, None], times
        )
        self._record.include_places(level, xi, times)

    def _prepare_spans(self) -> None:
        """Prepare the places of force laws in a last segment, -1 to 1 inside their spans, for constant loads."""
        laws = laws_at_an_end(self._body.model, [self.state.states])
        self._is_at_end = bool(laws)
        if not laws or self._loads.varies:
            return
        level, r = self._loads.loaded_levels.level(self.state.states), self._body.coordinates.stepped.modes
        indices = [self._body.model.index(law.name) for law in laws]
        ends = np.array([[law.knots[0], law.knots[-1]] for law in laws])
        middles, halves = np.mean(ends, axis=1), np.diff(ends, axis=1)[:, 0] / 2
        rows, centres = level.level.gap_rows[indices], np.array([law.centre for law in laws])
        places = centres + level.gap_constants[indices] + rows[:, r:] @ self.state.held
        self._span_rows, self._span_offsets = rows[:, :r] / halves[:, None], (places - middles) / halves

    def _choose_test(self) -> None:
        self._prepare_spans()
        self._test = self._tests.get_or_build(self.state.states, self._new_test)

    def _new_test(self) -> core.StepTest:
        coordinates = self._body.coordinates
        indices = [] if coordinates.interface is None else coordinates.interface.multipliers.tolist()
        conditions = self._loads.conditions(
            coordinates.stepped, self._step_size, coordinates.direct_reactions(coordinates.stepped)
        )
        return step_test(
            conditions, self._step_size, self._rounding, (*coordinates.views, coordinates.multipliers), indices
        )
