"""Own loads of a body during one run: those that vary in time, as modal forces and as channels.

    p = P w(t) + Q w'(t)

w are the channels, the time functions of the loads. Without loads that vary there are none, and p is zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.exudyn_plugin.discretised_level import DiscretisedLevel
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.loaded_levels import LoadedLevels
from multiphi_exudyn.time.state import Phase, Row, State

__all__ = ["OwnLoads", "jump_times"]

FINER = 10.0  # smooth time functions of loads are approximated to a tenth of their tolerance
CHUNK = 256  # steps whose channels are evaluated at once


class OwnLoads:
    """Loads on a body of ``size`` coordinates from a time until ``end`` [s].

    loaded_levels: the levels under all loads. static_levels: those under the static loads alone. varies: whether a load
    varies in time, or a counter-surface moves.
    """

    def __init__(self, model: MultiPhiModel, loads: Sequence[Load], size: int, time: float, end: float) -> None:
        self.excitation = Excitation.of(model, loads, end, FINER)
        self.loaded_levels = LoadedLevels.under(model, self.excitation, time, end)
        self.varies = self.excitation.prescribed > 0
        self.static_levels = self.loaded_levels.alone
        self._size = size
        self._jumps = jump_times(self.excitation) if self.varies else np.zeros(0)
        self._step = self._chunk_start = math.nan
        self._values = np.zeros((0, 2, self.excitation.prescribed))

    def set_step(self, step: float) -> None:
        """Set the step size [s] of the run."""
        self._step = step

    def forces(self, states: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of the varying loads at times (k,) [s], in a level."""
        if not self.varies:
            return np.zeros((len(times), self._size))
        return self._forces(states, self.excitation.values(times))

    def force_at(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """Modal force (s,) of the varying loads at the end of a step."""
        return self._forces(states, self._channels(time)[None])[0] if self.varies else np.zeros(self._size)

    def channels_at(self, time: float) -> np.ndarray:
        """Channels w, w' (2 q,) at the end of a step; those of many steps are evaluated at once."""
        return self._channels(time).ravel() if self.varies else np.zeros(0)

    def has_jump(self, start: float, end: float, rounding: float) -> bool:
        """Whether a load jumps in a step or at its ends; all these times are rounded."""
        first = int(np.searchsorted(self._jumps, start - rounding))
        return first < len(self._jumps) and bool(self._jumps[first] <= end + rounding)

    def level_coordinates(
        self, discretised: DiscretisedLevel, eta: np.ndarray, eta_t: np.ndarray, held: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level under all loads, and its coordinates xi, xi' (r + q + h, k) at times (k,) [s].

        held: stick positions (h, k) [m].
        """
        w, w_t = self.excitation.values(time).transpose(1, 2, 0)
        return (
            self.loaded_levels.level(discretised.states),
            np.vstack([eta, w, held]),
            np.vstack([eta_t, w_t, 0 * held]),
        )

    def discretised_level(self, states: tuple[int, ...], step: float | None) -> DiscretisedLevel:
        """The solver's form of a level under the static loads; step: size [s] its modes are matched to, or None."""
        levels = self.static_levels
        return levels.further(
            states, ("discretised", step), lambda: DiscretisedLevel.of(levels.level(states), self._size, step)
        )

    def phases_of(self, state: State, time: float) -> tuple[Phase, ...]:
        """Phases of a state at a time [s]: as at its entry, but armed again where the exit's signal has risen."""
        if all(phase is Phase.ARMED for phase in state.phases):
            return state.phases
        level, r, drive = self.loaded_levels.level(state.states), state.level.modal.modes, self.excitation.drive(time)
        parts = (state.displacement, drive.values[0]), (state.velocity, drive.values[1]), (state.reach, drive.sizes[0])
        xi, xi_t, reach = (np.concatenate([x[:r], w, x[r:]]) for x, w in parts)
        signs = (row.sign(xi, xi_t, reach) for row in (Row(*signal) for signal in level.signals))
        signs_and_phases = zip(signs, state.phases, strict=True)
        return tuple(phase if sign <= 0 or phase is Phase.LANDING else Phase.ARMED for sign, phase in signs_and_phases)

    def _forces(self, states: tuple[int, ...], values: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of channels w, w' (k, 2, q), in a level."""
        level, forces, q = self.loaded_levels.level(states), np.zeros((len(values), self._size)), values.shape[2]
        force, rate = level.channels.force[:, :q], level.channels.force_rate[:, :q]
        drive_change = (
            level.asymptotic.drive - level.asymptotic.static_drive
        )  # of the discretised level's constant force
        forces[:, : level.modal.modes] = values[:, 0] @ force.T + values[:, 1] @ rate.T + drive_change
        return forces

    def _channels(self, t: float) -> np.ndarray:
        """Channels w, w' (2, q) at a time [s]."""
        position = (t - self._chunk_start) / self._step
        index = round(position) if math.isfinite(position) else -1
        if not (0 <= index < len(self._values) and abs(position - index) <= 1e-9 * max(1.0, t / self._step)):
            if not math.isfinite(self._step):
                return np.asarray(self.excitation.values(np.array([t]))[0])
            self._chunk_start, index = t, 0
            self._values = self.excitation.values(t + self._step * np.arange(CHUNK))
        return np.asarray(self._values[index])


def jump_times(excitation: Excitation) -> np.ndarray:
    """Times at which a channel jumps, ascending [s]."""
    times = np.unique(np.concatenate([history.jump_times() for history in excitation.histories]))
    return np.asarray(times[times > 0])
