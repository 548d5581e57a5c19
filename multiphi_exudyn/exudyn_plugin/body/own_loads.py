"""Own loads of a body: what of them varies in time, in one run, as modal forces and as channels (excitation.py).

    p = P w(t) + Q w'(t)

Without loads that vary there are no channels, and p is zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.events.exits import exits_of, force_shares, signal_rows
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.loaded_levels import LoadedLevels
from multiphi_exudyn.events.state import Phase, State
from multiphi_exudyn.exudyn_plugin.body.certified_step import Conditions, conditions_of, jump_times
from multiphi_exudyn.exudyn_plugin.coupling.stepped_level import SteppedLevel
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.mechanics.loads import Load

__all__ = ["OwnLoads"]

FINER = 10.0  # smooth courses of loads are taken to a tenth of their tolerance
CHUNK = 256  # steps whose channels are evaluated at once


class OwnLoads:
    """Loads on a body of ``size`` coordinates from a time until ``end`` [s].

    loaded: the levels under all of them. levels: those under the static ones. varies: whether any varies in time, or a
    surface that elements rub on moves.
    """

    def __init__(self, model: MultiPhiModel, loads: Sequence[Load], size: int, time: float, end: float) -> None:
        self.excitation = Excitation.of(model, loads, end, FINER)
        self.loaded = LoadedLevels.under(model, self.excitation, time, end)
        self.varies = self.excitation.prescribed > 0
        self.levels = self.loaded.alone
        self._size = size
        self._jumps = jump_times(self.excitation) if self.varies else np.zeros(0)
        self._step = self._begun = math.nan
        self._values = np.zeros((0, 2, self.excitation.prescribed))

    def take_step(self, step: float) -> None:
        """Steps are of this length [s] from now on."""
        self._step = step

    def forces(self, states: tuple[int, ...], times: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) at times (k,) [s], in a level."""
        if not self.varies:
            return np.zeros((len(times), self._size))
        return self._forces(states, self.excitation.values(times))

    def force_at(self, states: tuple[int, ...], time: float) -> np.ndarray:
        """The same (s,) at the end of a step."""
        return self._forces(states, self._channels(time)[None])[0] if self.varies else np.zeros(self._size)

    def channels_at(self, time: float) -> np.ndarray:
        """w, w' (2 q,) at the end of a step, of which many are evaluated at once."""
        return self._channels(time).ravel() if self.varies else np.zeros(0)

    def jump(self, begun: float, end: float, rounding: float) -> bool:
        """Whether a load jumps in a step, its ends included: their times are rounded, in a force as in the solver."""
        first = int(np.searchsorted(self._jumps, begun - rounding))
        return first < len(self._jumps) and bool(self._jumps[first] <= end + rounding)

    def shown(
        self, stepped: SteppedLevel, eta: np.ndarray, eta_t: np.ndarray, held: np.ndarray, time: np.ndarray
    ) -> tuple[LoadedLevel, np.ndarray, np.ndarray]:
        """Level and coordinates xi, xi' (r + q, k) in which configurations and forces at times (k,) are read.

        held: places (h, k) that links hold.
        """
        w, w_t = self.excitation.values(time).transpose(1, 2, 0)
        return self.loaded.level(stepped.states), np.vstack([eta, w, held]), np.vstack([eta_t, w_t, 0 * held])

    def stepped(self, states: tuple[int, ...], step: float | None) -> SteppedLevel:
        """The level under the static loads as a solver takes it; step [s]: to which it is matched, or None."""
        levels = self.levels
        return levels.further(
            states, ("stepped", step), lambda: SteppedLevel.of(levels.level(states), self._size, step)
        )

    def conditions(self, stepped: SteppedLevel, step: float, direct: np.ndarray) -> Conditions:
        """What a step has to meet to be clear in a level; direct: L (k, m) of its links."""
        key = "conditions", stepped.step, step, direct.shape, direct.tobytes()
        return self.loaded.further(stepped.states, key, lambda: self._conditions(stepped, step, direct))

    def _conditions(self, stepped: SteppedLevel, step: float, direct: np.ndarray) -> Conditions:
        level = self.loaded.level(stepped.states)
        rows = signal_rows(level)
        carried = np.zeros((len(rows), direct.shape[1]))
        for k, (element, exit_) in enumerate(exits_of(level)):
            for place, force in force_shares(level, element, exit_):
                carried[k] += force * direct[place]
        return conditions_of(stepped, level, rows, step, carried)

    def phases_of(self, state: State, time: float) -> tuple[Phase, ...]:
        """Phases of a state that was entered with others: who has risen since is armed again, or still lands."""
        if all(phase is Phase.ARMED for phase in state.phases):
            return state.phases
        level, r, drive = self.loaded.level(state.states), state.level.modal.modes, self.excitation.drive(time)
        given = (state.displacement, drive.values[0]), (state.velocity, drive.values[1]), (state.reach, drive.sizes[0])
        xi, xi_t, reach = (np.concatenate([x[:r], w, x[r:]]) for x, w in given)
        signs = (row.sign(xi, xi_t, reach) for row in signal_rows(level))
        standing = zip(signs, state.phases, strict=True)
        return tuple(phase if sign <= 0 or phase is Phase.LANDING else Phase.ARMED for sign, phase in standing)

    def _forces(self, states: tuple[int, ...], values: np.ndarray) -> np.ndarray:
        """Modal forces (k, s) of w, w' (k, 2, q) in a level."""
        level, forces, q = self.loaded.level(states), np.zeros((len(values), self._size)), values.shape[2]
        force, rate = level.channels.force[:, :q], level.channels.force_rate[:, :q]
        driven = level.asymptotic.drive - level.alone.asymptotic.drive  # what a channel takes of the stepped level's
        forces[:, : level.modal.modes] = values[:, 0] @ force.T + values[:, 1] @ rate.T + driven
        return forces

    def _channels(self, t: float) -> np.ndarray:
        """(2, q) at a time."""
        place = (t - self._begun) / self._step
        index = round(place) if math.isfinite(place) else -1
        if not (0 <= index < len(self._values) and abs(place - index) <= 1e-9 * max(1.0, t / self._step)):
            if not math.isfinite(self._step):
                return np.asarray(self.excitation.values(np.array([t]))[0])
            self._begun, index = t, 0
            self._values = self.excitation.values(t + self._step * np.arange(CHUNK))
        return np.asarray(self._values[index])
