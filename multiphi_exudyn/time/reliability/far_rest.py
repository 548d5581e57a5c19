"""Far rest: what a run loses because a level rests far away from where the structure moves.

    eps |y_inf| sqrt(N + 1) > LOST |y|

A level moves about its static response y_inf under constant forces. Where hardly anything holds a mode, y_inf =
p / omega^2 may lie a million times farther away than the structure comes, and y, the sum of both, has the round-off
eps |y_inf|. Each of N events makes a new one; being independent, they add up as their root. |y| is the root mean
square of the run.

LOST is calibrated on 1277 nearly free structures of the campaign (tests/campaign, kind "nearly free") against brute
force: 71 displacements were off by a millionth and more, and had 7e-8 or more but for one of few digits and one that
is sensitive by itself; right ones had 3e-8 at most. Extreme cases of the catalogue have less than 1e-11.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg.blas import dnrm2

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["FarRest"]

EPSILON = float(np.finfo(float).eps)
LOST = 5e-8  # of the displacements: a larger round-off may grow to a millionth of them
GROWN = 3.0  # root mean squares: where a motion ends that grows with t^2, and more
SAMPLES = 257  # of the displacements, for their root mean square


@dataclass(frozen=True)
class FarRest:
    """The largest |y_inf| of some levels, and the frequency omega [rad/s] of the mode along which it mainly lies."""

    distance: float
    omega: float

    @classmethod
    def of(cls, levels: Sequence[LoadedLevel]) -> FarRest:
        """The farthest rest of these levels."""
        distances = [float(np.linalg.norm(level.asymptotic.configuration)) for level in levels]
        level = levels[int(np.argmax(distances))]
        along = np.abs(level.modal.vectors.T @ level.asymptotic.configuration)
        return cls(max(distances), float(level.modal.omega[np.argmax(along)]) if len(along) else 0.0)

    def warnings(self, trajectory: Trajectory) -> Iterator[str]:
        """At most one warning of a run in these levels."""
        level, events = trajectory.ending.level, len(trajectory.events)
        round_off = EPSILON * self.distance * math.sqrt(events + 1)
        if level is None:
            return
        last = level.configuration(trajectory.ending.displacement)
        if GROWN * round_off <= LOST * math.sqrt(last.dot(last)):  # most runs end far beyond it
            return
        times = np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES)
        places = trajectory.model.base.coordinates(trajectory.displacement(times))
        size = max(round_off, float(dnrm2(places.ravel())) / math.sqrt(SAMPLES))  # does not overflow
        if round_off > LOST * size:
            more = f", and more where its {events} events enlarge it" if events else ""
            yield (
                f"slow mode: a mode of {self.omega / (2 * math.pi):.3g} Hz rests {self.distance / size:.2g} times as "
                f"far away as the structure moves, so {per_cent(round_off / size)} of the motion is round-off{more}; "
                "hold it, or make its stiffness exactly zero"
            )
