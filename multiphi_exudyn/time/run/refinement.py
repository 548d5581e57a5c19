"""Refinement: smooth courses interpolated so finely that the response has their tolerance.

A modal force that is off by dp leaves z = (omega eta, eta') off by no more than the integral of |dp|, whatever the
level. What a course's interpolation leaves, times |P| and the length of the run, is compared with the largest |z|.
Sensitivity to events is not in this bound: it separates any two motions that are not the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.mechanics.loads import Load
from multiphi_exudyn.mechanics.time_functions import Smooth, Sweep
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["refined", "to_tolerance"]

REFINEMENTS = 2  # of smooth courses; the second corrects for what the first has changed
SAFETY = 1.5  # on the factor by which they are refined
SAMPLES = 257  # of the energy, for its largest value


def to_tolerance(run: Callable[[float], Trajectory], loads: Sequence[Load]) -> Trajectory:
    """The run, with smooth courses fine enough: ``run`` takes them finer by a factor."""
    trajectory, finer = run(1.0), 1.0
    if not loads:
        return trajectory
    wanted = [course.tolerance for course in refined(loads)]
    for _ in range(REFINEMENTS if wanted else 0):
        if trajectory.status != "ok" or (error := _interpolation_error(trajectory)) <= min(wanted):
            return trajectory
        finer *= SAFETY * error / min(wanted)
        trajectory = run(finer)
    if wanted and trajectory.status == "ok" and (error := _interpolation_error(trajectory)) > min(wanted):
        told = f"smooth loads: the response is accurate to {error:.2g} of its largest value, not to {min(wanted):g}"
        return replace(trajectory, message=told)
    return trajectory


def refined(loads: Sequence[Load]) -> list[Smooth | Sweep]:
    """The smooth courses of loads."""
    courses = [getattr(load, "course", None) for load in loads]
    return [course for course in courses if isinstance(course, (Smooth, Sweep))]


def _interpolation_error(trajectory: Trajectory) -> float:
    """Bound of the error of z that interpolated courses leave, relative to its largest value."""
    level = trajectory.segments[0].level
    errors = np.array([history.error for history in level.excitation.histories])
    lasting = trajectory.t_end * float(np.linalg.norm(np.abs(level.channels.force[:, : len(errors)]) @ errors))
    if lasting == 0:
        return 0.0
    energies = np.asarray(trajectory.energy(np.linspace(trajectory.start.time, trajectory.t_end, SAMPLES)))
    return lasting / max(math.sqrt(2 * float(np.max(energies))), np.finfo(float).tiny)
