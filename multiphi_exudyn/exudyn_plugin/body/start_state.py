"""Start state: what a body takes from the system as it stands at the start of a run."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.events.state import State
from multiphi_exudyn.exudyn_plugin.body.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel

__all__ = ["start_state"]


class StartingBody(Protocol):
    """What is needed of a body."""

    coordinates: Coordinates

    def stepped_level(self, states: tuple[int, ...]) -> SteppedLevel:
        """The level of elements in these states as the solver has it."""

    def force_vector(self, stepped: SteppedLevel) -> np.ndarray:
        """Constant force (s,) of the object in a level, at the present time."""


def start_state(
    body: StartingBody, own: OwnLoads, mbs: Any, time: float, step: float, alone: bool, fresh: bool
) -> State:
    """The state at a time [s], where a run begins in steps of this length [s], under ``own`` loads.

    The system gets the accelerations that belong to it. alone: whether nothing else acts on the body. fresh: whether it
    starts as it was made: only now the force is known, which the velocity of matched modes contains.
    """
    here = body.coordinates
    stepped, (q, q_t, q_tt) = here.stepped, here.views
    states, entered, held = here.stored()
    if states != stepped.states or not np.array_equal(held, here.held):  # accelerations are of stale matrices
        here.held, stepped = held, body.stepped_level(states)
        here.enter(mbs, stepped, body.force_vector(stepped))
        if not alone:
            q_tt[:] = stepped.acceleration(q, q_t, _acting(here, mbs, step)[: stepped.size])
    force = own.forces(states, np.array([time]))[0] if alone else here.force(here.read())[: stepped.size]
    if fresh:
        q_t += stepped.from_force @ force
    if fresh or alone:
        q_tt[:] = stepped.acceleration(q, q_t, force)
    here.write(stepped, held, here.views)
    r, eta_t = stepped.modes, stepped.velocity(q, q_t, force)
    xi, xi_t = np.concatenate([q[:r], held]), np.concatenate([eta_t[:r], 0 * held])
    state = State(own.levels.level(states), xi, xi_t, entered)
    return replace(state, phases=own.phases_of(state, time))


def _acting(here: Coordinates, mbs: Any, step: float) -> np.ndarray:
    """(p, f) in the present state of the system, with what constraints and inertia make of it on an interface."""
    if here.surroundings is None:
        return here.applied(mbs)
    return here.seen(here.surroundings.accelerations(step)).acting
