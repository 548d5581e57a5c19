"""Continuation: the complete final state of a trajectory as the start of another run.

    eta_n = eta + Psi^T (x_inf + R w - x_inf,n - R_n w_n),   eta'_n = eta' + Psi^T (Y w' - Y_n w'_n)

The level is the same, with x_inf, R, Y under the loads before and x_inf,n, R_n, Y_n under those that follow, with their
channels w_n; the held places of links and the phases of all exits stay. Under the same loads only round-off changes.

Where time begins anew, for periodic loads, so do the motions of counter-surfaces: held places on them keep their
position in space.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.start import Start
from multiphi_exudyn.time.state import State
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["continued_start", "stop_displacements", "with_final_velocity"]

CONTINUOUS = 1e-9  # of the travel of a stop: a smaller difference is within the accuracy of its motion


def continued_start(trajectory: Trajectory, levels: LoadedLevels, rewound: bool = False) -> Start:
    """Start of a run in ``levels`` from the final state of a trajectory; rewound: at t = 0 instead of its end."""
    state, model = trajectory.final, levels.model
    assert state is not None, "a run that is ok has a final state"
    before, r = state.level, _mode_count(state.level)
    level, held_links, held = levels.level(before.states), list(model.held), state.held
    prescribed, rates = levels.drive.values[:2]
    stops_before, stops_now = stop_displacements(state), level.excitation.moved(prescribed)
    if rewound:
        held = held + (stops_before - stops_now)[held_links]
        stops_before[held_links] = stops_now[held_links]
    w, w_t = np.concatenate([prescribed, held]), np.concatenate([rates, np.zeros(len(held))])
    jump = _base_displacement(before, state.displacement[r:]) - _base_displacement(level, w)
    velocity_jump = _carried_velocity(before, state.velocity[r:]) - _carried_velocity(level, w_t)
    vectors = level.modal.inertial
    xi = np.concatenate([state.displacement[:r] + vectors.T @ jump, w])
    xi_t = np.concatenate([state.velocity[:r] + vectors.T @ velocity_jump, w_t])
    _check_stops(level, stops_now, stops_before, _stop_slack(level) + _stop_slack(before))
    gaps = model.base.gaps - stops_now
    gaps[held_links] -= held
    return Start(
        displacement=level.configuration(xi),
        velocity=vectors @ xi_t[:r] + _carried_velocity(level, w_t),
        penetrating=before.level.indices,
        touching=(),
        gaps=gaps,
        states=before.states,
        held=held,
        time=0.0 if rewound else trajectory.t_end,
        state=State(level, xi, xi_t, state.phases),
    )


def with_final_velocity(trajectory: Trajectory, velocity: np.ndarray) -> Trajectory:
    """Trajectory with another velocity y' (m,) in its final state, projected to the modes of the level."""
    state = trajectory.final
    assert state is not None, "a run that is ok has a final state"
    r = _mode_count(state.level)
    vectors = state.level.modal.inertial
    modal_velocity = vectors.T @ (velocity - _carried_velocity(state.level, state.velocity[r:]))
    return trajectory.ending_in(replace(state, velocity=np.concatenate([modal_velocity, state.velocity[r:]])))


def stop_displacements(state: State) -> np.ndarray:
    """Displacements (c,) [m] of stops and counter-surfaces in a state."""
    r, excitation = _mode_count(state.level), state.level.excitation
    return excitation.moved(state.displacement[r : r + excitation.prescribed])


def _check_stops(level: LoadedLevel, now: np.ndarray, earlier: np.ndarray, slack: np.ndarray) -> None:
    """Refuse loads under which the stop of a rigid contact jumps by more than the accuracy ``slack`` of its motions."""
    allowed = slack + CONTINUOUS * (np.abs(now) + np.abs(earlier))
    for contact, jump, most in zip(level.level.base.links, now - earlier, allowed, strict=True):
        if contact.rigid and abs(jump) > most:
            raise MultiPhiValueError(
                f"loads: the stop of the rigid contact {contact.name!r} jumps by {jump:g} m where the run goes "
                "on, need a motion that goes on without a jump"
            )


def _stop_slack(level: LoadedLevel) -> np.ndarray:
    """Accuracy (c,) [m] of the motions of stops: that of their travel, and of the courses interpolated."""
    excitation = level.excitation
    errors = np.array([history.error for history in excitation.histories])
    interpolated = np.abs(excitation.stops[:, : excitation.prescribed]) @ errors
    return np.asarray(CONTINUOUS * excitation.stop_travel + interpolated)


def _mode_count(level: LoadedLevel) -> int:
    """Number of modes r; the other coordinates are channels."""
    return level.modal.modes


def _base_displacement(level: LoadedLevel, w: np.ndarray) -> np.ndarray:
    """x_inf + R w (m,)."""
    return level.configuration(np.concatenate([np.zeros(_mode_count(level)), w]))


def _carried_velocity(level: LoadedLevel, w_t: np.ndarray) -> np.ndarray:
    """Y w' (m,)."""
    return np.asarray(level.channels.carried @ w_t)
