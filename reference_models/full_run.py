"""What a run of the full beam gives back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reference_models.full_beam_settings import FullBeamSettings

__all__ = ["ENERGY_GAIN", "EnergyBalance", "FullRun", "closed_intervals"]

ENERGY_GAIN = 0.01  # of the initial energy; a run that gains more than this is a failure


@dataclass(frozen=True)
class EnergyBalance:
    """Energy of a run [J].

    dissipated: by the damping matrix, the integral of v.C v, sampled at output_step, and by viscous contacts.
    friction: what friction has dissipated. work: of loads, and of supports and counter-surfaces that move.
    scale: the initial energy; where something acts, the largest one of the run.
    worst_gain: largest rise of energy + dissipated + friction - work above an earlier value of it, relative to scale.
    worst_gain_at: when that was [s]; gain_at: when the gain first exceeded ENERGY_GAIN, or None.
    """

    initial: float
    final: float
    dissipated: float
    worst_gain: float
    worst_gain_at: float
    gain_at: float | None
    work: float
    scale: float
    friction: float = 0.0

    @classmethod
    def of(
        cls,
        time: np.ndarray,
        energy: np.ndarray,
        dissipated: np.ndarray,
        work: np.ndarray | None = None,
        rubbed: np.ndarray | None = None,
    ) -> EnergyBalance:
        """The balance of energies (k,) [J] at times (k,) [s] with what had been dissipated and done by then.

        work: None where nothing acts. rubbed: by friction.
        """
        done = np.zeros(len(energy)) if work is None else work
        lost = np.zeros(len(energy)) if rubbed is None else rubbed
        balance = energy + dissipated + lost - done
        scale = energy[0] if work is None else float(np.max(energy)) or 1.0  # nothing has moved: nothing is gained
        with np.errstate(over="ignore", invalid="ignore"):  # a run that has blown up
            gain = (balance - np.minimum.accumulate(balance)) / scale
        beyond = np.flatnonzero(~(gain <= ENERGY_GAIN))
        worst = int(np.argmax(gain))
        return cls(
            initial=float(energy[0]),
            final=float(energy[-1]),
            dissipated=float(dissipated[-1]),
            worst_gain=float(gain[worst]),
            worst_gain_at=float(time[worst]),
            gain_at=float(time[beyond[0]]) if len(beyond) else None,
            work=float(done[-1]),
            scale=float(scale),
            friction=float(lost[-1]),
        )


@dataclass(frozen=True)
class FullRun:
    """Histories of a full beam; k samples at multiples of output_step.

    status: "ok" or "failed"; message: cause and time of a failure, else ""; failed_at [s] or None.
    time (k,) [s]; points: name -> deflection (k,) [m]; gaps: contact -> g (k,) [m], open where > 0;
    contact_force: contact -> lambda (k,) [N]; contact_intervals: contact -> ((t_close, t_open), ...) [s],
    from the gaps of all steps, crossings interpolated linearly.
    friction_force: friction -> T (k,) [N]; slip: friction -> way (k,) [m] of its patch on the counter-surface.
    energy_time (j,) [s], energy (j,) [J]: kinetic, strain and contact springs; balance: its summary.
    start_force [N], zero for a start at rest where it is straight; steps: accepted time steps; dofs: free coordinates.
    offline_s: building and static start; online_s: the dynamic solver alone; CPU time [s].
    """

    status: str
    message: str
    failed_at: float | None
    time: np.ndarray
    points: Mapping[str, np.ndarray]
    contact_force: Mapping[str, np.ndarray]
    gaps: Mapping[str, np.ndarray]
    contact_intervals: Mapping[str, tuple[tuple[float, float], ...]]
    friction_force: Mapping[str, np.ndarray]
    slip: Mapping[str, np.ndarray]
    energy_time: np.ndarray
    energy: np.ndarray
    balance: EnergyBalance | None
    start_force: float
    steps: int
    offline_s: float
    online_s: float
    dofs: int
    settings: FullBeamSettings


def closed_intervals(time: np.ndarray, gap: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Intervals (t_close, t_open) [s] in which a sampled gap is negative, crossings interpolated linearly.

    One that is closed at the first or last sample begins or ends there.
    """
    closed = gap < 0
    change = np.flatnonzero(closed[1:] != closed[:-1])
    crossings = time[change] - gap[change] * np.diff(time)[change] / np.diff(gap)[change]
    edges = [*time[:1][closed[:1]], *crossings, *time[-1:][closed[-1:]]]
    return tuple((float(a), float(b)) for a, b in zip(edges[::2], edges[1::2], strict=True))
