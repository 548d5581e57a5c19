"""Energy of a full beam after its run, from the states that were kept.

E = T + V + sum 1/2 k_i min(0, g_i)^2 + sum integral F_j dq_j + sum T_e^2 / (2 k_e),   W_d(t) = integral of v.C v

Loads and stops that move do the work   W(t) = sum integral u_j d(p_j.q) + sum integral lambda_i dz_i,   a viscous
contact dissipates   integral (lambda - k max(0, -g)) d(-g),   friction   integral T_e ds_e   on the way s_e of its
bristle's foot; a counter-surface does   -integral T_e v_e dt.   From step to step they are sums of mean force times
way, which is what the trapezoidal rule has.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from exudyn.advancedUtilities import SystemEnergy
from scipy.integrate import cumulative_trapezoid, quad

from reference_models.actions import Actions
from reference_models.histories import Histories
from reference_models.point_friction import PointFriction
from reference_models.point_law import PointLaw
from reference_models.recorder import Recorder

__all__ = ["contact_losses", "dissipated_energy", "energy_history", "friction_losses", "work_of"]


def energy_history(
    mbs: Any, recorder: Recorder, laws: Sequence[PointLaw], steps: Histories
) -> tuple[np.ndarray, np.ndarray]:
    """Times (j,) [s] and energies (j,) [J] of the states kept; the system is left in the last of them."""
    time = np.array(recorder.state_times)
    time = time[time <= steps.time[-1]]
    total = SystemEnergy(mbs)
    energy = np.array([_energy(mbs, total, *state) for state in recorder.states[: len(time)]])
    kept = np.searchsorted(steps.time, time)
    for contact in steps.contacts:
        energy += contact.energy(steps.gaps[contact.name][kept])
    for name, stiffness in steps.bristles.items():
        energy += steps.tensions[name][kept] ** 2 / (2 * stiffness)
    for law in laws:
        deflection = steps.points[law.point]
        energy += _energy_of(law, deflection[0]) + _summed(law.forces(deflection), deflection)[kept]
    return time, energy


def work_of(
    actions: Actions, recorder: Recorder, frictions: Sequence[PointFriction], steps: Histories, time: np.ndarray
) -> np.ndarray:
    """Work (j,) [J] of loads, moving stops and counter-surfaces by the times (j,), which are among the steps'."""
    total = np.zeros(len(steps.time))
    moved = np.array(recorder.projections).reshape(len(recorder.times), len(actions.courses))[: len(total)]
    for value, way in zip(actions.values(steps.time).T, moved.T, strict=True):
        total += _summed(value, way)
    for name, way in actions.ways.items():
        total += _summed(steps.forces[name], way.at(steps.time))
    speeds = {friction.name: friction.velocity for friction in frictions}
    speeds |= {contact.name: contact.tangent.velocity for contact in steps.contacts if contact.tangent}
    for name, speed in speeds.items():
        total -= _summed(steps.tensions[name], speed * steps.time)
    return total[np.searchsorted(steps.time, time)]


def contact_losses(steps: Histories, time: np.ndarray) -> np.ndarray:
    """Energy (j,) [J] that viscous contacts have dissipated by the times (j,), which are among the steps'."""
    total = np.zeros(len(steps.time))
    for contact in steps.contacts:
        if contact.damping:
            gap = steps.gaps[contact.name]
            total -= _summed(steps.forces[contact.name] - contact.force(gap), gap)
    return total[np.searchsorted(steps.time, time)]


def friction_losses(steps: Histories, time: np.ndarray) -> np.ndarray:
    """Energy (j,) [J] that friction has dissipated by the times (j,), which are among the steps'."""
    total = np.zeros(len(steps.time))
    for name, tension in steps.tensions.items():
        total += _summed(tension, steps.slips[name])
    return total[np.searchsorted(steps.time, time)]


def _summed(force: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Integral (s,) of force (s,) over way (s,)."""
    return np.asarray(cumulative_trapezoid(force, way, initial=0))


def _energy_of(law: PointLaw, deflection: float) -> float:
    """Integral of the law's force from zero to a deflection [J]."""
    return float(quad(law.spring_force, 0.0, deflection)[0])


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
