"""Refinement: interpolation of smooth load courses that is fine enough for their tolerance of the response.

An error dp of a modal force changes z = (omega eta, eta') by no more than the integral of |dp|, in every level. The
error of the interpolated courses, times |P| and the length of the run, is compared with the largest |z|. The bound does
not include the sensitivity to events, which separates any two motions that differ.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.mechanics.loads.loads import Load
from multiphi_exudyn.mechanics.loads.time_functions import Smooth, Sweep
from multiphi_exudyn.time.segments.segment import Segment, as_segments
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["refined", "to_tolerance"]

REFINEMENTS = 2  # of smooth courses; the second corrects for the changes by the first
SAFETY = 1.5  # on the factor by which they are refined
SAMPLES = 257  # of the energy, for its largest value


def to_tolerance(run: Callable[[float], Trajectory], loads: Sequence[Load]) -> Trajectory:
    """Run with smooth courses that are fine enough; ``run`` takes the factor by which they are refined."""
    trajectory, finer = run(1.0), 1.0
    if not loads:
        return trajectory
    tolerances = [course.tolerance for course in refined(loads)]
    for _ in range(REFINEMENTS if tolerances else 0):
        if trajectory.status != "ok" or (error := _interpolation_error(trajectory)) <= min(tolerances):
            return trajectory
        finer *= SAFETY * error / min(tolerances)
        trajectory = run(finer)
    if tolerances and trajectory.status == "ok" and (error := _interpolation_error(trajectory)) > min(tolerances):
        reached = f"smooth loads: the response is accurate to {error:.2g} of its largest value"
        return replace(trajectory, message=f"{reached}, not to {min(tolerances):g}")
    return trajectory


def refined(loads: Sequence[Load]) -> list[Smooth | Sweep]:
    """The smooth courses of loads."""
    courses = [getattr(load, "course", None) for load in loads]
    return [course for course in courses if isinstance(course, (Smooth, Sweep))]


def _interpolation_error(trajectory: Trajectory) -> float:
    """Bound of the error of z due to interpolated courses, relative to the largest |z|."""
    level = trajectory.segments[0].level
    errors = np.array([history.error for history in level.excitation.histories])
    error_bound = trajectory.t_end * float(np.linalg.norm(np.abs(level.channels.force[:, : len(errors)]) @ errors))
    if error_bound == 0:
        return 0.0
    times = np.linspace(trajectory.start.time, trajectory.t_end, SAMPLES)
    energies = as_segments(trajectory.segments).evaluated(times, "right", _size_of_energy)
    return error_bound / max(math.sqrt(2 * float(np.max(energies))), np.finfo(float).tiny)


def _size_of_energy(segment: Segment, times: np.ndarray) -> np.ndarray:
    """Kinetic energy and the size of strain energy (k,) [J], which force laws may make negative."""
    level = segment.level
    return np.asarray(level.kinetic(segment.modal(times, 1)) + np.abs(level.strain(segment.modal(times))))
