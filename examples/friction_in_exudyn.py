"""The rig's beam with a friction ring: Exudyn's own friction connector on the full beam, and that system reduced.

Run: python examples/friction_in_exudyn.py [FIGURE.png]
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import matplotlib.figure
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import reduce
from multiphi_exudyn.mechanics.structure import damping_matrix
from reference_models.beam_system import build_beam_system
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.full_run import FullRun
from reference_models.laid_beam import DEFLECTION
from reference_models.rig import rig_beam, rig_damping

RING = mp.Friction("ring", "node2", limit=3.0, stiffness=2e4)
LOAD = mp.HarmonicLoad("node3", 5.0, 12.0, -np.pi / 2)
T_END = 0.5  # s
STEPS = (2e-4, 1e-4, 5e-5, 2.5e-5)  # s, of the full beam; the finest is what others are compared with
POINTS = ("node2", "node3")


@dataclass(frozen=True)
class Results:
    """Runs of the full beam by step, and the reduced one with its time [s]."""

    full: dict[float, FullRun]
    reduced: mp.Trajectory
    reduced_s: float

    def error(self, points: dict[str, np.ndarray]) -> float:
        """Largest relative difference of histories to the finest full run's, on its times."""
        finest = self.full[STEPS[-1]].points
        return max(float(np.linalg.norm(points[n] - finest[n]) / np.linalg.norm(finest[n])) for n in POINTS)


def full_beam(step: float) -> tuple[FullBeam, np.ndarray]:
    """An ANCF beam with the ring, and its damping matrix."""
    beam = FullBeam(rig_beam(), (), FullBeamSettings(elements=8, step=step), frictions=[RING])
    return beam, damping_matrix(replace(beam.structure, damping=rig_damping()))


def solved() -> Results:
    """The full beam at each step, and its Exudyn system reduced to six modes."""
    runs = {}
    for step in STEPS:
        beam, damping = full_beam(step)
        runs[step] = beam.run(T_END, damping=damping, loads=[LOAD], progress=False)
    full = beam.structure.coordinates @ damping @ beam.structure.coordinates.T
    system = build_beam_system(beam.beams, beam.settings, damping=full, frictions=beam.frictions)
    points = {name: (system.nodes[number], DEFLECTION) for name, number in system.points.items()}
    reduction = reduce(system.mbs, modes=6, points=points, strict=True)
    print(reduction.report)
    trajectory = reduced_run(reduction.model)  # with a check of its linear range beside the system itself
    alone = mp.MultiPhiModel(reduction.structure, reduction.model.contacts, modes=6)
    seconds = [timed(alone) for _ in range(6)]
    return Results(runs, trajectory, min(seconds[1:]))  # the first one builds the levels


def reduced_run(model: mp.MultiPhiModel) -> mp.Trajectory:
    """Under the same load, from rest."""
    return mp.simulate(model, T_END, loads=[LOAD])


def timed(model: mp.MultiPhiModel) -> float:
    """Time of a run [s]."""
    started = time.perf_counter()
    reduced_run(model)
    return time.perf_counter() - started


def draw(found: Results, path: str) -> None:
    """The tip and the ring's loop, full and reduced."""
    figure = matplotlib.figure.Figure(figsize=(10, 4.2), layout="constrained")
    tip, loop = figure.subplots(1, 2, width_ratios=(1.5, 1))
    run, reduced = found.full[STEPS[-1]], found.reduced
    for axes, x, y in (
        (tip, run.time, 1e3 * run.points["node3"]),
        (loop, 1e3 * run.points["node2"], run.friction_force["ring"]),
    ):
        axes.plot(x, y, color="0.75", linewidth=4, label="full Exudyn beam")
    tip.plot(run.time, 1e3 * reduced.at("node3", run.time), color="#0072B2", linewidth=1, label="reduced, 6 modes")
    loop.plot(1e3 * reduced.at("node2", run.time), reduced.friction_force("ring", run.time), color="#0072B2")
    for start, end in reduced.stick_intervals("ring"):
        tip.axvspan(start, end, color="#D55E00", alpha=0.15, linewidth=0)
    tip.set_xlabel("time in s (shaded: the ring sticks)")
    tip.set_ylabel("tip in mm")
    loop.set_xlabel("beam at the ring in mm")
    loop.set_ylabel("friction force in N")
    figure.legend(*tip.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    figure.savefig(path, dpi=120)


def main() -> Results:
    """The comparison in words, and the figure where a path is given."""
    found = solved()
    for step in STEPS[:-1]:
        run = found.full[step]
        share = found.error(dict(run.points))
        print(f"full beam, step {1e6 * step:g} us: {run.online_s:.2f} s, {100 * share:.2g} % from the finest")
    own = {name: np.asarray(found.reduced.at(name, found.full[STEPS[-1]].time)) for name in POINTS}
    stuck = sum(end - start for start, end in found.reduced.stick_intervals("ring")) / T_END
    print(f"reduced, 6 modes: {1e3 * found.reduced_s:.2g} ms, {100 * found.error(own):.2g} % from the finest full beam")
    print(f"the ring sticks {100 * stuck:.0f} % of the time; energy it took: {found.reduced.ledger.friction:.3g} J")
    if len(sys.argv) > 1:
        draw(found, sys.argv[1])
    return found


if __name__ == "__main__":
    main()
