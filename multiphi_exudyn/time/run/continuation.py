"""Going on: the final state of a trajectory as the start of another run, whole.

    eta_n = eta + Psi^T (x_inf + R w - x_inf,n - R_n w_n),   eta'_n = eta' + Psi^T (Y w' - Y_n w'_n)

The level is the same, with x_inf, R, Y under the loads before and x_inf,n, R_n, Y_n under those that follow, with their
channels w_n; what links hold and the phases of all exits stay. Under the same loads nothing changes but round-off.

Where time begins anew, for loads that repeat, so do the courses of counter-surfaces: places on those stay where they
are in space.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.start_arrays import Start
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.events.transitions.state import State
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["going_on", "nudged", "stops_moved"]

CONTINUOUS = 1e-9  # of where a stop stands: a smaller difference is what its course is followed to


def going_on(trajectory: Trajectory, levels: LoadedLevels, rewound: bool = False) -> Start:
    """The end of a trajectory as the start of a run in other levels; rewound: at t = 0, and not at that end."""
    state, model = trajectory.final, levels.model
    assert state is not None, "a run that is ok has a final state"
    before, r = state.level, _modes(state.level)
    level, places, held = levels.level(before.states), list(model.held), state.held
    prescribed, rates = levels.drive.values[:2]
    before_moved, moved = stops_moved(state), level.excitation.moved(prescribed)
    if rewound:
        held = held + (before_moved - moved)[places]
        before_moved[places] = moved[places]
    w, w_t = np.concatenate([prescribed, held]), np.concatenate([rates, np.zeros(len(held))])
    jump = _at(before, state.displacement[r:]) - _at(level, w)
    slowed = _carried(before, state.velocity[r:]) - _carried(level, w_t)
    vectors = level.level.vectors[:, :r]
    xi = np.concatenate([state.displacement[:r] + vectors.T @ jump, w])
    xi_t = np.concatenate([state.velocity[:r] + vectors.T @ slowed, w_t])
    _check_stops(level, moved, before_moved)
    gaps = model.base.gaps - moved
    gaps[places] -= held
    return Start(
        displacement=level.configuration(xi),
        velocity=vectors @ xi_t[:r] + _carried(level, w_t),
        penetrating=before.level.indices,
        touching=(),
        gaps=gaps,
        states=before.states,
        held=held,
        time=0.0 if rewound else trajectory.t_end,
        state=State(level, xi, xi_t, state.phases),
    )


def nudged(trajectory: Trajectory, velocity: np.ndarray) -> Trajectory:
    """A trajectory whose final state has another velocity y' (m,), as far as its level's modes can."""
    state = trajectory.final
    assert state is not None, "a run that is ok has a final state"
    r = _modes(state.level)
    vectors = state.level.level.vectors[:, :r]
    given = vectors.T @ (velocity - _carried(state.level, state.velocity[r:]))
    return trajectory.ending_in(replace(state, velocity=np.concatenate([given, state.velocity[r:]])))


def stops_moved(state: State) -> np.ndarray:
    """How far (c,) [m] stops and counter-surfaces have moved where a state is."""
    r, excitation = _modes(state.level), state.level.excitation
    return excitation.moved(state.displacement[r : r + excitation.prescribed])


def _check_stops(level: LoadedLevel, moved: np.ndarray, before: np.ndarray) -> None:
    """Refuse loads under which the stop of a rigid contact jumps."""
    for contact, new, old in zip(level.level.base.links, moved.tolist(), before.tolist(), strict=True):
        if contact.rigid and abs(new - old) > CONTINUOUS * (abs(new) + abs(old)):
            raise MultiPhiValueError(
                f"loads: the stop of the rigid contact {contact.name!r} jumps by {new - old:g} m where the run goes "
                "on, need a motion that goes on without a jump"
            )


def _modes(level: LoadedLevel) -> int:
    """Number of modes r; the other coordinates are channels."""
    return level.modal.modes


def _at(level: LoadedLevel, w: np.ndarray) -> np.ndarray:
    """x_inf + R w (m,)."""
    return level.configuration(np.concatenate([np.zeros(_modes(level)), w]))


def _carried(level: LoadedLevel, w_t: np.ndarray) -> np.ndarray:
    """Y w' (m,)."""
    return np.asarray(level.channels.carried @ w_t)
