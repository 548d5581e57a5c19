"""Surroundings: what the system does to a body at an event in a step, and what the event does to the system.

    (p, f) right after an event = those held before it + what changes in the system between the states before and after

p (s,) acts on the coordinates of the body, f (m,) on its points. Where only connectors and loads act there, they are
read off the system's forces. Where masses or constraints hang on the points, the accelerations of the whole system are
solved for, and reactions of rigid contacts are followed by forces on the points (attached_inertia.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import State
from multiphi_exudyn.exudyn_plugin.body.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.coupling.attached_inertia import PointInertia, Reactions
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.exudyn_plugin.coupling.system_matrices import Hanging, SystemMatrices

__all__ = ["BodyAmongOthers", "Instant", "Surroundings", "surroundings_of"]


class BodyAmongOthers(Protocol):
    """What is needed of a body."""

    coordinates: Coordinates

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The level of elements in these states as the solver has it."""

    def own_force(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """(p, f) of its own varying loads at a time [s], in a level."""


@dataclass(frozen=True)
class Instant:
    """Of the first event in a step of length ``step`` that ends at ``end``: its time [s], the states right
    before and right after."""

    time: float
    end: float
    step: float
    before: State
    after: State

    @property
    def elapsed(self) -> float:
        """Time [s] from the event to the end of the step."""
        return self.end - self.time


@dataclass(frozen=True)
class Surroundings:
    """The system around a body at the end of a step, as it is without an event in it.

    unmoved: q, v (2, n). hanging: what hangs on the points; inertia: the same for the body's levels, None where nothing
    hangs there. reactions: forces that follow those of rigid contacts. All None without an interface.
    """

    body: BodyAmongOthers
    system: SystemMatrices | None
    unmoved: np.ndarray
    hanging: Hanging | None
    inertia: PointInertia | None
    reactions: Reactions | None

    def told(self, force: np.ndarray, given: SteppedLevel, states: tuple[int, ...]) -> np.ndarray:
        """(p, f) of one level in another, with the forces that follow from those of other elements."""
        if states == given.states:
            return force
        here, wanted = self.body.coordinates, self.body.stepped_level(states)
        carried = here.carried(force, given, wanted)
        if self.reactions is None or here.interface is None:
            return carried
        change = self.reactions.at(wanted.loaded) - self.reactions.at(given.loaded)
        return carried + np.concatenate([change @ here.interface.of(wanted).rows, change])

    def changed_by(self, mbs: Any, instant: Instant, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(p, f) right after an event, from ``force`` before it, and what it changes in the system.

        That is of accelerations (n,) where something hangs on the points, else of forces (n,).
        """
        body, here, after = self.body, self.body.coordinates, instant.after
        own, entered = here.stepped, body.stepped_level(after.states)
        given, there = body.own_force(own.states, instant.end), body.own_force(after.states, instant.end)
        before = instant.before
        here.write(own, before.held, own.state(before.displacement, before.velocity, (force + given)[: own.size]))
        shown = entered.state(
            after.displacement, after.velocity, (self.told(force, own, after.states) + there)[: own.size]
        )
        if self.inertia is None or self.system is None or self.hanging is None:
            felt = here.felt(mbs, own)
            here.write(entered, after.held, shown)
            changed = here.felt(mbs, entered)
        else:
            left, felt = self.system.present(), here.seen(self.system.accelerations(instant.step))
            here.enter_with(mbs, entered, after.held, entered.drive)
            here.write(entered, after.held, shown)
            self.system.follow(self.hanging, left)
            changed = here.seen(self.system.accelerations(instant.step))
        return changed.acting + here.carried(force - felt.acting, own, entered), changed.whole - felt.whole

    def at_event(self, instant: Instant, force: np.ndarray) -> Surroundings:
        """The same with what hung on the points at the event: joints may have turned since. force: (p, f) before it."""
        here = self.body.coordinates
        if self.system is None or self.inertia is None or not here.foreseen:
            return self
        hanging = self.system.hanging(self.unmoved, here.stepped.mass, instant.elapsed)
        found = replace(self, hanging=hanging, inertia=_inertia(self.body, hanging))
        return found.deciding(instant.before, force)

    def deciding(self, state: State, force: np.ndarray) -> Surroundings:
        """The same with the forces that go with others in another level right after a state, in which (p, f) acts.

        Stick and slip exclude each other only if they are told from one acceleration.
        """
        if self.hanging is None or self.inertia is None or not self.body.coordinates.slips:
            return self
        own, r, s = state.level.modal, state.level.modal.modes, self.body.coordinates.stepped.size
        x, v = state.displacement, state.velocity
        eta_tt = state.level.alone.asymptotic.drive + force[:r]
        eta_tt -= own.damping_matrix @ v[:r] + own.squares * x[:r] + own.coupling @ x[:r]
        reactions = _reactions_of(self.body, self.hanging, state.level, (x, v, eta_tt), force[s:])
        return replace(self, reactions=reactions)

    def settled(self, mbs: Any, instant: Instant, change: np.ndarray) -> np.ndarray:
        """(p, f) at the end of the step, where all has followed the body since the event; change: what it changed."""
        here, system = self.body.coordinates, self.system
        assert system is not None
        assert self.hanging is not None
        if self.inertia is None:
            system.spread(self.hanging, instant.step, instant.elapsed, change)
            felt = here.felt(mbs, here.stepped)
            here.put_forces(felt.acting[here.stepped.size :])
            return felt.acting
        q, v = self.unmoved
        system.follow(self.hanging, np.array([q, v + instant.elapsed * change]))
        return here.seen(system.accelerations(instant.step)).acting

    def kinetic(self, state: State) -> float:
        """Kinetic energy [J] of the body and of what its points carry."""
        if self.hanging is None or self.inertia is None:
            return state.kinetic
        speeds = _rows_in(self.body, state.states) @ state.velocity[: state.level.modal.modes]
        return state.kinetic + 0.5 * float(speeds @ self.hanging.attached.mass @ speeds)


def surroundings_of(body: BodyAmongOthers, x: np.ndarray) -> Surroundings:
    """What the system is around a body in its present state, of which x is a copy."""
    here = body.coordinates
    system = here.surroundings
    if here.interface is None or system is None:
        return Surroundings(body, None, np.zeros((2, 0)), None, None, None)
    unmoved = system.present()
    hanging = system.hanging(unmoved, here.stepped.mass)
    inertia = _inertia(body, hanging)
    if inertia is None or not here.foreseen:
        return Surroundings(body, system, unmoved, hanging, inertia, None)
    physical = here.stepped.physical @ np.concatenate(here.split(x))
    eta, eta_t, eta_tt = (part[: here.stepped.modes] for part in np.split(physical, 3))
    motion = np.concatenate([eta, here.held]), np.concatenate([eta_t, 0 * here.held]), eta_tt
    reactions = _reactions_of(body, hanging, here.stepped.loaded, motion, here.interface.forces)
    return Surroundings(body, system, unmoved, hanging, inertia, reactions)


def _reactions_of(
    body: BodyAmongOthers, hanging: Hanging, loaded: LoadedLevel, motion: Sequence[np.ndarray], points: np.ndarray
) -> Reactions:
    """Forces that follow those of elements; motion: xi, xi', eta'' in a level; points: f (m,)."""
    (x, v, eta_tt), level, here = motion, loaded.level, body.coordinates
    assert here.interface is not None
    carried = loaded.asymptotic.forces + here.direct(body.stepped_level(loaded.states)) @ points
    pushed = carried + level.force_rows @ x + level.force_rate_rows @ v
    rows = here.interface.in_base(level.base)
    acceleration = loaded.modal.vectors @ eta_tt
    return Reactions(hanging.attached, level.base, rows, acceleration, loaded, pushed, _pressures(loaded, x, v))


def _pressures(loaded: LoadedLevel, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """-k q - c q' (l,) [N] of all links with a finite stiffness, whether they hold or not."""
    base, own = loaded.level.base, loaded.level
    springs = np.where(np.isinf(base.stiffnesses), 0.0, base.stiffnesses)
    return np.asarray(-springs * (own.gap_rows @ x + loaded.gap_constants) - base.dampings * (own.gap_rows @ v))


def _inertia(body: BodyAmongOthers, hanging: Hanging) -> PointInertia | None:
    interface = body.coordinates.interface
    if hanging.only_forces or interface is None:
        return None
    base = body.coordinates.stepped.loaded.level.base
    return PointInertia(hanging.attached, base, interface.in_base(base), lambda states: _rows_in(body, states))


def _rows_in(body: BodyAmongOthers, states: tuple[int, ...]) -> np.ndarray:
    """R (m, r) in a level."""
    stepped, interface = body.stepped_level(states), body.coordinates.interface
    assert interface is not None
    return interface.of(stepped).rows[:, : stepped.modes]
