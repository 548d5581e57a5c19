"""Exact step: a step of the solver done again by the machinery of ``simulate``, from event to event.

    force of the step's mean, told in the modes of every level          until a contact changes,
    with what changes at that instant in reactions, loads, connectors and inertia     from then on

The states right before and right after the event are put into the system to see what it changes there. An impact is one
of the body and of all that hangs on its interface (attached_inertia.py, system_matrices.py), which then follows the
body.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.events.rule import EventRule
from multiphi_exudyn.events.state import State
from multiphi_exudyn.exudyn_plugin.body.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.switching import bodies_of
from multiphi_exudyn.exudyn_plugin.coupling.attached_inertia import AttachedRule
from multiphi_exudyn.exudyn_plugin.coupling.modal_force import ForcedRule, InLevel, centre_of
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.time.motion import Motion
from multiphi_exudyn.time.segment import Segment

__all__ = ["ExactStep"]

NEGLIGIBLE = 1e-9  # of the accelerations: what Newton's iterations leave unbalanced is no modal force
UNRESOLVED = 0.1  # of the largest energy at an event: work that a force which is held constant may miss
DRIVEN = 1e-3  # of its terms: a gap below minus that is no drift of constraints


@dataclass(frozen=True)
class _Instant:
    """Of the first event in a step: its time [s], eta and eta' (r,) right before, the state right after."""

    time: float
    before: tuple[np.ndarray, np.ndarray]
    after: State


class ExactStep(ABC):
    """What a body does within a step; ``MultiPhiBody`` says when, and holds what is used here."""

    name: str
    coordinates: Coordinates
    time: float
    _motion: Motion
    _rule: EventRule
    _state: State
    _size: int
    _step: float
    _most: float

    @abstractmethod
    def _write(self, mbs: Any, state: State, force: np.ndarray) -> None:
        """Put a state at the end of a step into the system, with the acceleration under forces (p, f)."""

    @abstractmethod
    def _keep(self, state: State) -> None:
        """Remember a state, choose its test, and write its level into the data node."""

    @abstractmethod
    def own_forces(self, closed: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of its own varying loads at times (k,) [s], in a level."""

    @abstractmethod
    def _stepped(self, closed: tuple[int, ...]) -> SteppedLevel:
        """A level as the solver has it."""

    def _plain(self, state: State) -> State:
        """A state of the motion as one of the level under static loads."""
        return state

    def _own_force(self, closed: tuple[int, ...], time: float) -> np.ndarray:
        """(p, f) of the body's own varying loads at a time, in a level."""
        return np.concatenate([self.own_forces(closed, np.array([time]))[0], np.zeros(self.coordinates.points)])

    def _repeat(self, mbs: Any, begun: float, before: np.ndarray, after: np.ndarray, jumped: bool = False) -> None:
        """Do the step from ``before`` again, exactly, and write what came out if anything happened in it.

        Forces of constraints at the end of a step would not do: the trapezoidal rule lets them alternate, true in the
        mean. jumped: whether an own load jumped in the step, which that rule would take for a ramp.
        """
        here, start, known = self.coordinates, self._state, len(self._motion.events)
        own = here.stepped
        given = self._own_force(start.closed, begun) + self._own_force(start.closed, self.time)
        force = self._significant((here.force(before) + here.force(after) - given) / 2, after)
        here.mark(after)
        self._check_driven(after)
        state, instant = self._travel(before, begun, force, force, own)
        if instant is None:
            self._keep(replace(start, phases=state.phases))
            if not jumped:
                return
        if instant is None:
            self._write(mbs, state, force)
            return
        present, entered = self._present(mbs, instant, force, own), self._stepped(instant.after.closed)
        present = self._significant(present, after)
        del self._motion.events[known:]
        self._state = start
        here.look_back(self.time - instant.time)
        state, _ = self._travel(before, begun, force, present, entered)
        self._write(mbs, state, here.told(present, entered, self._stepped(state.closed)))
        if here.interface is not None:
            held = here.told(present, entered, here.stepped)
            reached = here.settled(self.time - instant.time, self._step)
            self._check_resolved(instant, own, state, (reached - held)[: self._size])
            self._write(mbs, state, reached)
            bodies_of(mbs).disturbed = True

    def _check_resolved(self, instant: _Instant, own: SteppedLevel, state: State, missed: np.ndarray) -> None:
        """Raises where a force that is held from an event to the end of its step does not tell what happens there.

        That is where the force (s,) that it missed in the end would have done a work that counts, or where body and
        attached masses are left with more than twice the energy they had.
        """
        eta, eta_t = instant.before
        before = replace(self._state, level=own.loaded, displacement=eta, velocity=eta_t)
        bent = 0.5 * float(np.abs(own.loaded.level.squares) @ eta**2)
        self._most = max(self._most, self._carried_kinetic(before) + bent)
        doubtful = self._carried_kinetic(state) + state.potential - self._carried_kinetic(before) - before.potential
        if state.closed == instant.after.closed:
            moved = state.displacement - instant.after.displacement
            doubtful = max(doubtful, abs(float(missed[: len(moved)] @ moved)) / (2 * UNRESOLVED))
        if doubtful > self._most:
            raise NumericalFailure(
                f"body {self.name!r}: at t = {instant.time:.9g} s: steps of {self._step:g} s do not resolve what hangs "
                "on its interface, need shorter steps, fewer modes, or constraints in place of stiff connectors"
            )

    def _carried_kinetic(self, state: State) -> float:
        """Kinetic energy [J] of the body and of what its points carry."""
        attached = self.coordinates.attached
        assert attached is not None
        speeds = self._interface_rows(state.closed) @ state.velocity
        return state.kinetic + 0.5 * float(speeds @ attached.mass @ speeds)

    def _check_driven(self, x: np.ndarray) -> None:
        """Raises where what is attached drives a contact that it holds into its stop."""
        here, loaded = self.coordinates, self.coordinates.stepped.loaded
        if here.attached is None or here.interface is None or not here.rigid:
            return
        base, eta = loaded.level.base, here.split(x)[0][: loaded.level.modes]
        for i in here.attached.immovable(base, here.interface.in_base(base)) - set(loaded.level.indices):
            terms = np.append(loaded.level.gap_rows[i] * eta, loaded.gap_constants[i])
            if np.sum(terms) < -DRIVEN * np.sum(np.abs(terms)):
                name = self._rule.model.contacts[i].name
                raise NumericalFailure(f"body {self.name!r}: what is tied to it drives contact {name!r} into its stop")

    def _present(self, mbs: Any, instant: _Instant, force: np.ndarray, own: SteppedLevel) -> np.ndarray:
        """(p, f) right after an event, from those before it, ``force`` in the level ``own``."""
        here, after, now = self.coordinates, instant.after, self.time
        here.write(own.state(*instant.before, (force + self._own_force(own.closed, now))[: own.size]))
        acting = here.acting(mbs, self._step) - self._own_force(own.closed, now)
        self._write(mbs, after, here.told(force, own, self._stepped(after.closed)))
        changed = here.changed(mbs, self._step) - self._own_force(after.closed, now)
        return changed + here.carried(force - acting, own, here.stepped)

    def _travel(
        self, before: np.ndarray, begun: float, force: np.ndarray, entered: np.ndarray, given: SteppedLevel
    ) -> tuple[State, _Instant | None]:
        """State now, of the exact motion from ``before`` under ``force`` until a contact changes, then ``entered``.

        given: the level in whose modes ``entered`` is told.
        """
        closed, known = self._state.closed, len(self._motion.events)

        def after(level: tuple[int, ...]) -> np.ndarray:
            return self.coordinates.told(entered, given, self._stepped(level))

        def until(level: tuple[int, ...]) -> np.ndarray:
            return force if level == closed else after(level)

        first = self._forced(until)
        then = first if entered is force else self._forced(after)
        q, q_t, _ = self.coordinates.split(before)
        acting = (force + self._own_force(closed, begun))[: self._size]
        eta_t = self._stepped(closed).velocity(q, q_t, acting)
        loaded = self._rule.level(closed)
        r = loaded.level.modes
        state, segment = self._advanced(State(loaded, q[:r], eta_t[:r], self._state.phases), begun, first, True)
        instant = None
        if len(self._motion.events) > known:
            times = np.array([segment.end])
            moved = segment.modal(times)[:r, 0] + centre_of(first, closed), segment.modal(times, 1)[:r, 0]
            instant = _Instant(segment.end, moved, state)
        if self._motion.time < self.time:
            state, _ = self._advanced(state, self._motion.time, then)
        return state, instant

    def _advanced(self, state: State, begun: float, rule: EventRule, to_change: bool = False) -> tuple[State, Segment]:
        """The state now, or at the first event before, of the exact motion by a rule; and the last part of the way."""
        motion = self._motion
        shifted = replace(
            state, level=rule.level(state.closed), displacement=state.displacement - centre_of(rule, state.closed)
        )
        motion.rule, motion.state, motion.time = *self._departing(rule, shifted, begun), begun
        motion.advance(self.time, to_change)
        if motion.message:
            raise NumericalFailure(f"body {self.name!r}: {motion.message}")
        last = motion.segments[-1]
        if motion.time == self.time:
            motion.segments.pop()  # those that remain end with events: the chatter check counts them
        del motion.segments[: -motion.window - 1]
        end = self._plain(motion.state)
        moved = end.displacement + centre_of(rule, end.closed)
        return State(self._rule.level(end.closed), moved, end.velocity, end.phases), last

    def _forced(self, force_in: InLevel) -> EventRule:
        """The event rule under modal forces by levels, and with what hangs on the interface."""
        attached = self.coordinates.attached
        if attached is None:
            return ForcedRule(self._rule, force_in, self._direct)
        assert self.coordinates.interface is not None
        in_base = self.coordinates.interface.in_base(self._rule.model.base)
        return AttachedRule(self._rule, force_in, self._direct, attached, self._interface_rows, in_base)

    def _interface_rows(self, closed: tuple[int, ...]) -> np.ndarray:
        """R (m, r) in a level."""
        stepped, interface = self._stepped(closed), self.coordinates.interface
        assert interface is not None
        return interface.of(stepped).rows[:, : stepped.loaded.level.modes]

    def _direct(self, closed: tuple[int, ...]) -> np.ndarray:
        """L (k, m) in a level, see Coordinates."""
        return self.coordinates.direct(self._stepped(closed))

    def _departing(self, rule: EventRule, state: State, time: float) -> tuple[EventRule, State]:
        """Rule and state of an exact motion from a time on."""
        return rule, state

    def _significant(self, force: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(p, f), with p = 0 where it is what an iterative solver leaves of the accelerations in x."""
        modal, q_tt = force[: self._size], x[2 * self._size : 3 * self._size]
        if modal.dot(modal) <= NEGLIGIBLE**2 * q_tt.dot(q_tt):
            modal[:] = 0.0
        return force
