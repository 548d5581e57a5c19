"""Settled state: the steady state of a run under a harmonic load, with its amplitudes and contact times."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.display import Shown, kinds
from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.mechanics.loads.loads import HarmonicLoad
from multiphi_exudyn.mechanics.loads.moving_supports import BaseMotion
from multiphi_exudyn.mechanics.loads.time_functions import Harmonic
from multiphi_exudyn.mechanics.structures.structure import At
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["HIGHEST_ORDER", "SAMPLES", "PeriodicLoad", "SteadyState", "course_of", "frequency"]

HIGHEST_ORDER = 8  # highest order of a sub-harmonic response
SAMPLES = 64  # per period of the load, for the size of the motion; HIGHEST_ORDER times as many for extremes
ZOOM_SAMPLES = 32  # samples between the neighbours of an extreme, in every step of the refinement
ZOOM_STEPS = 3  # of the refinement: the error of an extreme is of the order ((2 / ZOOM_SAMPLES)^ZOOM_STEPS / SAMPLES)^2
PeriodicLoad: TypeAlias = "HarmonicLoad | BaseMotion"


@dataclass(frozen=True, repr=False)
class SteadyState(Shown):
    """Result of ``steady_state``: the steady state of a run under a harmonic load.

    Attributes
    ----------
    status : str
        "periodic", "not settled" or "failed".
    message : str
        Cause if the state is not periodic, else empty.
    load : HarmonicLoad or BaseMotion
        Load of the run.
    order : int
        Periods of the load in one period of the response, 2 and more for a sub-harmonic one, 0 if it is not periodic.
    residual : float
        Difference of states ``order`` periods apart, relative to the size of the motion, both in sqrt(energy); if it is
        not periodic, the smallest of all orders.
    multiplier : float
        Largest growth factor of a small disturbance in a period of the load; NaN if the run settled without Newton's
        method. Stick positions of friction that never slips are left out.
    periods : int
        Number of periods of the load in the run.
    trajectory : Trajectory
        One period of the response, or the last 16 periods of the load if it is not periodic; a failed run ends early.
    displacement, velocity : array (n,)
        x [m, rad] and x' [m/s, rad/s] at the end of the run, from which another run can continue.
    warnings : tuple of str
        Warnings about the accuracy of the trajectory, and of earlier chunks of the run.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> stop = mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)
    >>> model = mp.MultiPhiModel(chain, [stop])
    >>> state = mp.steady_state(model, mp.HarmonicLoad("tip", 20.0, 12.0))
    >>> state.status, state.order
    ('periodic', 1)
    >>> round(state.duty("stop"), 3)  # part of the time in which the stop is closed
    0.039
    """

    status: str
    message: str
    load: PeriodicLoad
    order: int
    residual: float
    multiplier: float
    periods: int
    trajectory: Trajectory
    displacement: np.ndarray
    velocity: np.ndarray
    warnings: tuple[str, ...] = ()

    def _facts(self) -> Iterator[tuple[str, str]]:
        yield "status", f"{self.status}{f', {self.message}' if self.message else ''}"
        yield "load", str(self.load)
        yield "order", str(self.order)
        yield "residual", f"{self.residual:.2g}"
        yield "largest multiplier", f"{self.multiplier:.4g}"
        yield "warnings", kinds(self.warnings)

    def amplitude(self, point: At) -> float:
        """Half the range of the displacement [m] of a point; NaN if failed."""
        if self.status == "failed":
            return math.nan
        return _half_range(self.trajectory, point, 0.0, self.trajectory.t_end)

    def amplitudes(self, point: At) -> np.ndarray:
        """Half the range (k,) of the displacement [m] of a point in every period of the trajectory; NaN if failed."""
        if self.status == "failed":
            return np.array([math.nan])
        ends = np.linspace(0.0, self.trajectory.t_end, 1 + max(1, round(self.trajectory.t_end * frequency(self.load))))
        return np.array([_half_range(self.trajectory, point, *period) for period in itertools.pairwise(ends.tolist())])

    def duty(self, contact: str) -> float:
        """Part of the time in which a contact is closed, 0 to 1; NaN if failed."""
        if self.status == "failed":
            return math.nan
        intervals = self.trajectory.contact_intervals(contact)
        return sum(end - start for start, end in intervals) / self.trajectory.t_end


def _half_range(trajectory: Trajectory, point: At, start: float, end: float) -> float:
    """Half the range of a point's displacement, with refined sampling around the largest and the smallest sample."""
    return sum(_largest(trajectory, point, sign, start, end) for sign in (1.0, -1.0)) / 2


def _largest(trajectory: Trajectory, point: At, sign: float, start: float, end: float) -> float:
    """Largest value of sign times the displacement; in a periodic motion it may also lie next to either end."""
    times = np.linspace(start, end, SAMPLES * HIGHEST_ORDER + 1)
    highest = int(np.argmax(sign * np.asarray(trajectory.at(point, times))))
    return max(_peak(trajectory, point, sign, times, k) for k in {0, highest, len(times) - 1})


def _peak(trajectory: Trajectory, point: At, sign: float, times: np.ndarray, k: int) -> float:
    """Largest value between the neighbours of the k-th of these times."""
    for _ in range(ZOOM_STEPS):
        times = np.linspace(times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)], ZOOM_SAMPLES + 1)
        values = sign * np.asarray(trajectory.at(point, times))
        k = int(np.argmax(values))
    return float(values[k])


def frequency(load: PeriodicLoad) -> float:
    """Frequency of a load [Hz]."""
    return course_of(load).frequency_hz


def course_of(load: PeriodicLoad) -> Harmonic:
    if not isinstance(load, (HarmonicLoad, BaseMotion)):
        raise MultiPhiTypeError(f"load: got {type(load).__name__}, need HarmonicLoad or BaseMotion")
    course = load.course
    if not isinstance(course, Harmonic):
        raise MultiPhiTypeError(f"load course: got {type(course).__name__}, need Harmonic")
    return course
