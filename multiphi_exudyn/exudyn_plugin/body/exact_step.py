"""Exact step: a step of the solver done again by the loop of ``simulate``, from event to event.

    force of the step's mean, told in the modes of every level          until a contact changes,
    with what changes at that instant in reactions, loads, connectors and inertia     from then on

Forces of constraints at the end of a step would not do: the trapezoidal rule lets them alternate, true in the mean.
The states right before and right after the event are put into the system to see what it changes there
(surroundings.py). An impact is one of the body and of all that hangs on its interface (attached_inertia.py), which then
follows the body.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events.state import State
from multiphi_exudyn.exudyn_plugin.body.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.surroundings import Instant, Surroundings, surroundings_of
from multiphi_exudyn.exudyn_plugin.coupling.exact_motion import ExactMotion, Reached
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import Acting
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.model import MultiPhiModel

__all__ = ["BodyInStep", "Outcome", "Step", "exact_step"]

NEGLIGIBLE = 1e-9  # of the accelerations: what Newton's iterations leave unbalanced is no modal force
UNRESOLVED = 0.1  # of the largest energy at an event: work that a force which is held constant may miss
DRIVEN = 1e-3  # of its terms: a gap below minus that is no drift of constraints


class BodyInStep(Protocol):
    """What is needed of a body."""

    name: str
    model: MultiPhiModel
    coordinates: Coordinates

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The level of elements in these states as the solver has it."""

    def own_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """(p, f) of its own varying loads at a time [s], in a level."""


@dataclass(frozen=True)
class Step:
    """From ``begun`` to ``time`` [s] with x = (q, q', q'', 1, f) at both ends. state: at its start, but for x.

    most: the largest energy [J] of body and attached masses at an event so far. jumped: whether an own load jumps in
    the step, which the trapezoidal rule would take for a ramp.
    """

    begun: float
    time: float
    before: np.ndarray
    after: np.ndarray
    state: State
    most: float
    jumped: bool

    @property
    def length(self) -> float:
        """h [s]."""
        return self.time - self.begun


@dataclass(frozen=True)
class Outcome:
    """state: at the end of the step. disturbed: whether what hangs on the body was moved.

    most: as in the step.
    """

    state: State
    disturbed: bool
    most: float


def exact_step(body: BodyInStep, mbs: Any, motion: ExactMotion, step: Step) -> Outcome:
    """Do a step again, exactly, and write what came out if anything happened in it."""
    here, start = body.coordinates, step.state
    own = here.stepped
    given = body.own_force(start.states, step.begun) + body.own_force(start.states, step.time)
    force = _significant(here, (here.force(step.before) + here.force(step.after) - given) / 2, step.after)
    around = surroundings_of(body, step.after)
    _check_driven(body, around, step.after)
    state = _start_of(body, step, force)
    motion.hold(_acting(body, lambda states: around.told(force, own, states)), around.inertia)
    first = motion.advance(state, step.begun, step.time, stop=True, trial=here.foreseen)
    if not first.changed:
        if step.jumped:
            _write(body, mbs, first.state, force, step.time)
        return Outcome(replace(first.state, level=start.level), disturbed=False, most=step.most)
    instant = Instant(first.time, step.time, step.length, first.before, first.state)
    present, change = around.changed_by(mbs, instant, force)
    there = around.at_event(instant, force)
    later = _Later(body, there, _significant(here, present, step.after), body.stepped_level(first.state.states))
    if here.foreseen:  # reactions and accelerations, and with them who holds after it, depend on the forces that follow
        motion.hold(_acting(body, lambda s: force if s == start.states else later.force(s)), there.inertia)
        first = motion.advance(state, step.begun, step.time, stop=True)
    end, later = _last_part(body, motion, first, later, step.time)
    _write(body, mbs, end.state, later.force(end.state.states), step.time)
    most = step.most
    if here.interface is not None:
        reached = there.settled(mbs, instant, change)
        missed = reached - later.force(end.state.states)
        most = _check_resolved(body, there, step, instant, own, end.state, missed)
        _write(body, mbs, end.state, reached, step.time)
    return Outcome(end.state, disturbed=here.interface is not None, most=most)


@dataclass(frozen=True)
class _Later:
    """What acts from an event on: ``present``, (p, f) in the level ``entered``."""

    body: BodyInStep
    around: Surroundings
    present: np.ndarray
    entered: SteppedLevel

    def force(self, states: tuple[int, ...]) -> np.ndarray:
        """(p, f) in a level."""
        return self.around.told(self.present, self.entered, states)

    def at(self, state: State) -> _Later:
        """The same from another instant on, right before which the body is in ``state``."""
        present = self.force(state.states)
        around = self.around.deciding(state, present)
        return _Later(self.body, around, present, self.body.stepped_level(state.states))


def _last_part(
    body: BodyInStep, motion: ExactMotion, first: Reached, later: _Later, until: float
) -> tuple[Reached, _Later]:
    """From the event to the end of the step, with all events; what then acts."""
    reached, slips = first, body.coordinates.slips
    while reached.time < until:
        motion.hold(_acting(body, later.force), later.around.inertia)
        found = motion.advance(reached.state, reached.time, until, stop=slips, trial=slips)
        if slips:
            if found.changed:
                later = later.at(found.before)
                motion.hold(_acting(body, later.force), later.around.inertia)
            found = motion.advance(reached.state, reached.time, until, stop=True)
        reached = found
    return reached, later


def _acting(body: BodyInStep, force_in: Callable[[tuple[int, ...]], np.ndarray]) -> Callable[[tuple[int, ...]], Acting]:
    """What acts in a level, of (p, f) in it."""
    here = body.coordinates
    size = here.stepped.size

    def acting(states: tuple[int, ...]) -> Acting:
        force = force_in(states)
        return Acting(force[:size], here.direct(body.stepped_level(states)) @ force[size:])

    return acting


def _start_of(body: BodyInStep, step: Step, force: np.ndarray) -> State:
    """The state at the start of a step, in which a mean force acts."""
    here, held = body.coordinates, step.state.held
    stepped, (q, q_t, _) = body.stepped_level(step.state.states), here.split(step.before)
    acting, r = (force + body.own_force(stepped.states, step.begun))[: here.stepped.size], stepped.modes
    xi, xi_t = (np.concatenate(parts) for parts in ((q[:r], held), (stepped.velocity(q, q_t, acting)[:r], 0 * held)))
    return replace(step.state, displacement=xi, velocity=xi_t)


def _write(body: BodyInStep, mbs: Any, state: State, force: np.ndarray, time: float) -> None:
    """Put a state at the end of a step into the system, with the acceleration under forces (p, f)."""
    here, own = body.coordinates, body.own_force(state.states, time)
    stepped = body.stepped_level(state.states)
    here.enter_with(mbs, stepped, state.held, stepped.drive + own[: stepped.size])
    here.write(stepped, state.held, stepped.state(state.displacement, state.velocity, (force + own)[: stepped.size]))


def _significant(here: Coordinates, force: np.ndarray, x: np.ndarray) -> np.ndarray:
    """(p, f), with p = 0 where it is what an iterative solver leaves of the accelerations in x."""
    modal, q_tt = force[: here.stepped.size], here.split(x)[2]
    if modal.dot(modal) <= NEGLIGIBLE**2 * q_tt.dot(q_tt):
        modal[:] = 0.0
    return force


# ---------------------------------------------------------------------- what a step cannot resolve


def _check_driven(body: BodyInStep, around: Surroundings, x: np.ndarray) -> None:
    """Raises where what is attached drives a contact that it holds into its stop."""
    here = body.coordinates
    if around.inertia is None or not here.rigid:
        return
    loaded = here.stepped.loaded
    xi = np.concatenate([here.split(x)[0][: here.stepped.modes], here.held])
    for i in around.inertia.held - set(loaded.level.indices):
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
    own: SteppedLevel,
    state: State,
    missed: np.ndarray,
) -> float:
    """The largest energy [J] so far; raises where a force that is held from an event on does not tell what happens.

    That is where the force (p, f) that it missed in the end would have done a work that counts, or where body and
    attached masses are left with more than twice the energy they had.
    """
    before = instant.before
    bent = 0.5 * float(np.abs(own.loaded.level.squares) @ before.displacement**2)
    had = around.kinetic(before)
    most = max(step.most, had + bent)
    doubtful = around.kinetic(state) + state.potential - had - before.potential
    if state.states == instant.after.states:
        moved = (state.displacement - instant.after.displacement)[: state.level.modal.modes]
        doubtful = max(doubtful, abs(float(missed[: len(moved)] @ moved)) / (2 * UNRESOLVED))
    if doubtful > most:
        raise NumericalFailure(
            f"body {body.name!r}: at t = {instant.time:.9g} s: steps of {step.length:g} s are too long for what is "
            "attached to its interface, need shorter steps, fewer modes, or constraints in place of stiff connectors"
        )
    return most
