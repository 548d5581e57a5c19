"""Law warnings: what the straight segments of a force law do to the motion of a run.

A law is known to a share of its largest force on the span. Its motion is not known to that share: e = F - segments has
mostly one sign at one amplitude, so it changes the frequency, and the phase drifts for the whole run. For an
oscillation the balance of the first harmonic gives

    d omega / omega = <e q> / (2 <F q>) = <e q> / (4 <kinetic energy>),   omega^2 = <q'^2> / <q^2>

with q less its mean. The phase is off by d omega t, and displacements, as a root mean square over the run, by
d omega T / sqrt(3). Against 152 random runs of the exact laws (cubic, Hertz, magnets, softening, one to four degrees of
freedom) the ratio of this estimate to the error was 1.1 in the middle, and 0.5 to 2.3 for eight of ten.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.elements.force_law import ForceLaw
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["approximated_laws", "law_warnings"]

OFF = 0.02  # of the motion: threshold of the estimate; no run that was wrong by 5 % was below
AIM = 0.005  # of the motion, of the tolerance that the warning names
SAMPLES = 256  # of the motion


def approximated_laws(model: MultiPhiModel) -> tuple[ForceLaw, ...]:
    """The force laws whose segments are not the law itself."""
    return tuple(law for law in model.contacts if isinstance(law, ForceLaw) and law.error > 0)


def law_warnings(trajectory: Trajectory) -> Iterator[str]:
    """One sentence on the law that moves a run most by what its segments leave out."""
    found = [(_motion_error(trajectory, law), law.name, law) for law in approximated_laws(trajectory.model)]
    if found and (worst := max(found, key=lambda entry: entry[:2]))[0] > OFF:
        error, name, law = worst
        yield (
            f"force law: {name!r} is approximated to {per_cent(law.error)} of its largest force on its span, which may "
            f"move this run by {per_cent(min(error, 1.0))} of its motion; give it "
            f"tolerance={law.error * AIM / error:.1g}"
        )


@np.errstate(over="ignore", invalid="ignore")  # of a run that grew without end
def _motion_error(trajectory: Trajectory, law: ForceLaw) -> float:
    """Estimate of the relative error of displacements."""
    times = np.linspace(trajectory.t_start, trajectory.t_end, SAMPLES + 1)[1:]
    q = law.centre + np.asarray(trajectory.gap(law.name, times))
    x_t = trajectory.velocity(times)
    speed = trajectory.model.structure.row(law.at) @ x_t
    y_t = trajectory.model.base.coordinates(x_t)
    kinetic, swing = 0.5 * float(np.mean(np.sum(y_t**2, axis=0))), q - np.mean(q)
    if not (0 < kinetic < math.inf and np.any(swing)):
        return 0.0
    omega = math.sqrt(float(np.mean(speed**2)) / float(np.mean(swing**2)))
    shift = abs(float(np.mean(law.deviation(q) * swing))) / (4 * kinetic)
    return shift * omega * (trajectory.t_end - trajectory.t_start) / math.sqrt(3)
