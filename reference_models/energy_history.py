"""Energy of a full beam after its run, from the states that were kept.

E = T + V + sum 1/2 k_i min(0, g_i)^2,   W_d(t) = integral of v.C v
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from exudyn.advancedUtilities import SystemEnergy
from scipy.integrate import cumulative_trapezoid

from reference_models.histories import Histories
from reference_models.point_contact import PointContact
from reference_models.recorder import Recorder

__all__ = ["dissipated_energy", "energy_history"]


def energy_history(
    mbs: Any, recorder: Recorder, contacts: Sequence[PointContact], steps: Histories
) -> tuple[np.ndarray, np.ndarray]:
    """Times (j,) [s] and energies (j,) [J] of the states kept; the system is left in the last of them."""
    time = np.array(recorder.state_times)
    time = time[time <= steps.time[-1]]
    total = SystemEnergy(mbs)
    energy = np.array([_energy(mbs, total, *state) for state in recorder.states[: len(time)]])
    kept = np.searchsorted(steps.time, time)
    for contact in contacts:
        energy += contact.energy(steps.gaps[contact.name][kept])
    return time, energy


def dissipated_energy(recorder: Recorder, damping: np.ndarray | None, time: np.ndarray) -> np.ndarray:
    """Energy [J] the damping matrix (n_full, n_full) has dissipated by the times (j,).

    The power of a step is taken at the mean of its two velocities, where the trapezoidal rule has it: at
    the ends the modes that a step does not resolve seem to dissipate several times as much.
    """
    if damping is None or len(recorder.velocities) < 2:
        return np.zeros(len(time))
    steps, velocities = np.array(recorder.velocity_steps), np.array(recorder.velocities)
    adjacent = np.flatnonzero(np.diff(steps) == 1)
    mean = (velocities[adjacent] + velocities[adjacent + 1]) / 2
    middle = (np.array(recorder.times)[steps[adjacent]] + np.array(recorder.times)[steps[adjacent + 1]]) / 2
    with np.errstate(over="ignore", invalid="ignore"):  # a run that has blown up
        power = np.einsum("ti,ti->t", mean @ damping, mean)
    return np.interp(time, middle, cumulative_trapezoid(power, middle, initial=0))


def _energy(mbs: Any, total: SystemEnergy, q: np.ndarray, q_t: np.ndarray) -> float:
    mbs.systemData.SetODE2Coordinates(q)
    mbs.systemData.SetODE2Coordinates_t(q_t)
    return total.ComputeSystemEnergies()[-1]
