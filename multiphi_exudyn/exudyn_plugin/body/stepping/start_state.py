"""Start state of a body in a run, from the present state of the Exudyn system."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from multiphi_exudyn.events.transitions.state import State
from multiphi_exudyn.exudyn_plugin.body.state.coordinates import Coordinates
from multiphi_exudyn.exudyn_plugin.body.stepping.own_loads import OwnLoads
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel

__all__ = ["start_state"]


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
