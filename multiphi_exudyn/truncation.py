"""Truncation: how far an answer with r modes can be from the answer with all of them, read off the answer itself.

Inside a level every kept mode moves as it would among all modes, so what a truncated answer lacks came in where a level
was entered. There the state before, y and v, is known in all modes of the base, and so is what the level with all its
modes would hold of it (P: without the motion that its rigid contacts prevent). The difference is the defect

    d = P (y - y_inf) - Psi eta,   w = P v - Psi eta',   |defect|^2 = |d|^2 + |w / Omega|^2

in the displacement norm of the mass matrix: w / Omega is the displacement that a lost velocity would have become.
At the start it is the static residual of the starting configuration. The indicator adds the defects like independent
errors and relates them to the motion:

    indicator(T) = sqrt( sum over levels entered until T of |defect|^2 / mean of |y|^2 over [0, T] )

It predicts an error, it does not bound it: it knows nothing of how fast neighbouring motions separate, and what one
level holds and the next one drops weighs little in it (keep the levels' highest frequencies near each other).
A level's static residual, the part of a contact's flexibility that its modes do not hold, is known before any run:

    rho = 1 - (sum over kept modes of (h.psi)^2 / omega^2) / (the same over all modes that may be taken)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError
from multiphi_exudyn.level import Level
from multiphi_exudyn.mode_choice import Tolerance, UpTo
from multiphi_exudyn.model import MultiPhiModel
from multiphi_exudyn.segment import Segment
from multiphi_exudyn.trajectory import Trajectory

__all__ = ["Defect", "adapted", "defects", "truncation_indicator"]

SAMPLES = 200  # of the motion, for its mean square
FEWEST = 3  # modes the open level starts with
GROWTH = 0.25  # of its modes it is given more, at least one
ABOVE = 1 + 1e-9  # of its last mode's frequency: the cut-off that keeps this mode


@dataclass(frozen=True)
class Defect:
    """What the level entered at ``time`` [s] could not hold; closed: its contacts; size: of the defect [m sqrt(kg)]."""

    time: float
    closed: tuple[str, ...]
    size: float


def defects(trajectory: Trajectory) -> Iterator[Defect]:
    """The defect of the start, and of every transition to another level, in order of time."""
    before = trajectory.start.displacement, trajectory.start.velocity
    previous = None
    for segment in trajectory.segments:
        if segment.level is not previous:
            yield Defect(segment.start, segment.level.level.closed, _size(segment, *before))
        before, previous = _state(segment, segment.end), segment.level


def truncation_indicator(trajectory: Trajectory, until: float | None = None) -> float:
    """Estimate of the relative error of displacements that truncation has made from 0 to ``until`` [s] (the end)."""
    if not isinstance(trajectory, Trajectory):
        raise MultiPhiTypeError(f"trajectory: got {type(trajectory).__name__}, need a Trajectory")
    end = trajectory.t_end if until is None else until
    lost = sum(defect.size**2 for defect in defects(trajectory) if defect.time <= end)
    amplitude = _amplitude(trajectory, end)
    if amplitude == 0:
        return math.inf if lost else 0.0
    return math.sqrt(lost) / amplitude


def adapted(model: MultiPhiModel, run: Callable[[MultiPhiModel], Trajectory]) -> Trajectory:
    """``run`` of the model at the cut-off frequency that its Tolerance needs, which is that of ``Trajectory.model``.

    The open level begins with the modes that hold the static flexibility of every contact, and is given more until
    the indicator is below the tolerance; every other level has its modes up to the same frequency.
    """
    tolerance, most = model.modes, model.most_modes
    assert isinstance(tolerance, Tolerance), "who calls this has looked"
    assert most is not None, "a tolerance has a largest number"
    level = replace(model, modes=most).level(())
    rigid = int(np.sum(level.omega == 0))
    if rigid == level.modes:
        return run(replace(model, modes=rigid))
    count = max(_holding(level, tolerance.error), rigid + 1)
    while True:
        count = min(count, level.modes)
        trajectory = run(replace(model, modes=UpTo(ABOVE * float(level.frequencies[count - 1]), most)))
        if trajectory.status != "ok":
            return trajectory
        indicator = truncation_indicator(trajectory)
        if indicator <= tolerance.error:
            return trajectory
        if count == level.modes:
            told = f"truncation: the indicator is {indicator:.2g} with {count} modes, the tolerance {tolerance.error:g}"
            return replace(trajectory, message=told)
        count += max(1, round(GROWTH * count))


def _holding(level: Level, error: float) -> int:
    """Smallest number of modes that leaves of every contact's flexibility a static residual below the error."""
    elastic = level.omega > 0
    flexibility = np.zeros_like(level.gap_rows)
    flexibility[:, elastic] = (level.gap_rows[:, elastic] / level.omega[elastic]) ** 2
    held = np.cumsum(flexibility, axis=1)
    enough = held >= (1 - error) * held[:, -1:]
    return max(FEWEST, 1 + int(np.max(np.argmax(enough, axis=1), initial=0)))


def _size(segment: Segment, displacement: np.ndarray, velocity: np.ndarray) -> float:
    own = segment.level
    base = own.level.base
    held = [i for i in own.level.indices if np.isinf(base.stiffnesses[i])]
    after = _state(segment, segment.start)
    d = _admissible(base.directions[:, held], displacement - after[0])
    w = _admissible(base.directions[:, held], velocity - after[1])
    omega = base.modes.omega
    elastic = omega > 0
    lost = np.where(elastic, w, 0.0) / np.where(elastic, omega, 1.0)
    return float(np.sqrt(d @ d + lost @ lost))


def _admissible(directions: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """The part of a motion (m,) that closed rigid contacts (m, k) allow."""
    if directions.shape[1] == 0:
        return vector
    return vector - directions @ np.linalg.lstsq(directions, vector, rcond=None)[0]


def _state(segment: Segment, time: float) -> tuple[np.ndarray, np.ndarray]:
    """y and y' (m,) at a time of the segment."""
    t = np.array([time])
    vectors = segment.level.level.vectors
    return segment.level.configuration(segment.modal(t)[:, 0]), vectors @ segment.modal(t, 1)[:, 0]


def _amplitude(trajectory: Trajectory, end: float) -> float:
    """Root of the mean square of y over [0, end]."""
    moved = trajectory.model.base.coordinates(trajectory.displacement(np.linspace(0.0, end, SAMPLES)))
    return float(np.sqrt(np.mean(np.sum(moved**2, axis=0))))
