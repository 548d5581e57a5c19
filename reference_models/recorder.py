"""What is kept while a full beam is integrated, at the least cost per step.

Every step: the time, the watched coordinates, how far loads have moved, and the state of frictions. At
output_step: all velocities at both ends of a step, from which the dissipated energy follows. Every millisecond: all
coordinates and velocities, from which the energy follows after the run. The cost is 1 to 2 us a step, as that
of Exudyn's own sensors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from reference_models.rubbing import Rub

__all__ = ["ENERGY_STEP", "Recorder", "Watched"]

ENERGY_STEP = 1e-3  # s between two energies
BAR_DELAY = 1.0  # s before a progress bar appears
EARLY = 1e-6  # of a sampling step: how much before its time a sample may be taken


@dataclass(frozen=True)
class Watched:
    """Kept at every step: coordinates and speeds, indices of ODE2 coordinates; forces: (n_full, m), of them force.q.

    data: indices of data coordinates. rubs: contacts with friction. The beams' n_full coordinates are the system's
    first ones.
    """

    coordinates: np.ndarray
    speeds: np.ndarray
    forces: np.ndarray
    data: np.ndarray
    rubs: Sequence[Rub] = ()


class Recorder:
    """A PostStep user function; Exudyn calls it at the start and after every accepted step.

    watched: what is kept at every step.
    """

    def __init__(self, mbs: Any, watched: Watched, output_step: float, t_end: float, progress: bool) -> None:
        self.times: list[float] = []
        self.watched: list[np.ndarray] = []
        self.speeds: list[np.ndarray] = []
        self.projections: list[np.ndarray] = []
        self.data: list[np.ndarray] = []
        self.rubbed: list[list[float]] = []
        self.velocity_steps: list[int] = []
        self.velocities: list[np.ndarray] = []
        self.state_times: list[float] = []
        self.states: list[tuple[np.ndarray, np.ndarray]] = []
        self.stopped = False
        self._indices, self._moving, self._forces = watched.coordinates, watched.speeds, watched.forces.T
        self._data_indices, self._rubs, count = watched.data, watched.rubs, len(watched.forces)
        self._output_step = output_step
        self._q = mbs.systemData.GetODE2Coordinates(copy=False)
        self._q_t = mbs.systemData.GetODE2Coordinates_t(copy=False)
        self._beams, self._beams_t = self._q[:count], self._q_t[:count]
        self._data = mbs.systemData.GetDataCoordinates(copy=False)
        self._next_output = self._next_state = 0.0
        self._was_due = False
        self._bar = tqdm(
            total=t_end,
            unit="s",
            delay=BAR_DELAY,
            disable=not progress,
            leave=False,
            bar_format="full beam {percentage:3.0f} %|{bar}| {n:.3f} of {total:g} s, {remaining} left",
        )

    def __call__(self, mbs: Any, t: float) -> bool:
        """Keep the state at time t [s]; False asks the solver to stop."""
        self.times.append(t)
        self.watched.append(self._q[self._indices])
        if len(self._moving):
            self.speeds.append(self._q_t[self._moving])
        if len(self._forces):
            self.projections.append(self._forces @ self._beams)
        if len(self._data_indices):
            self.data.append(self._data[self._data_indices])
        if self._rubs:
            self.rubbed.append([rub.end_step(self._q, t) for rub in self._rubs])
        due = t >= self._next_output
        if due or self._was_due:
            self.velocity_steps.append(len(self.times) - 1)
            self.velocities.append(self._beams_t.copy())
        if due:
            self._next_output = t + self._output_step * (1 - EARLY)
        self._was_due = due
        if t >= self._next_state:
            self._next_state = t + ENERGY_STEP * (1 - EARLY)
            self.keep_state(t)
            self._bar.update(t - self._bar.n)
        return not self.stopped

    def stop(self) -> None:
        """Ask the solver to stop after the step it is in."""
        self.stopped = True

    def keep_state(self, t: float) -> None:
        """Keep all coordinates and velocities as they are now, at t [s]."""
        self.state_times.append(t)
        self.states.append((self._q.copy(), self._q_t.copy()))

    def close(self) -> None:
        """Keep the last state and end the progress bar."""
        self._bar.close()
        if self.times and self.state_times[-1] < self.times[-1]:
            self.keep_state(self.times[-1])
