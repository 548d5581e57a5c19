"""The paper's cantilever: pulled to +20 mm, let go, struck by its support; rigid and compliant levels.

Run: python examples/paper_rig.py [FIGURE.png]
"""

from __future__ import annotations

import math
import sys

import matplotlib.figure
import numpy as np

import multiphi_exudyn as mp
from reference_models.rig import rig_beam, rig_contact, rig_damping

TIP = 0.020  # m, assumed: the paper's figure with the initial displacement is lost


def simulate_rig(stiffness: float, modes: int = 6, t_end: float = 1.0) -> mp.Trajectory:
    """Free motion from the static deflection under a force at the tip mass."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes=modes)
    unit = model.static_equilibrium({"node3": 1e-3})  # N; small, so that the contact is open
    start = unit * (TIP / float(structure.row("node3") @ unit))
    return mp.simulate(model, t_end, displacement=start)


def draw(trajectories: dict[str, mp.Trajectory], path: str) -> None:
    """Displacement of the three measured points, grey where the rigid model is in contact."""
    figure = matplotlib.figure.Figure(figsize=(9, 7), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for axis, point in zip(axes, ("node1", "node2", "node3"), strict=True):
        for label, trajectory in trajectories.items():
            t = np.linspace(0, trajectory.t_end, 4001)
            axis.plot(t, 1e3 * np.asarray(trajectory.at(point, t)), label=label, linewidth=1)
        for start, end in trajectories["rigid"].contact_intervals("support"):
            axis.axvspan(start, end, color="0.85", linewidth=0)
        axis.set_ylabel(f"{point} [mm]")
    axes[0].legend(loc="upper right", ncols=2)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=120)


def main() -> dict[str, mp.Trajectory]:
    """Both contact laws; the first contacts of each."""
    trajectories = {"rigid": simulate_rig(math.inf), "compliant, 1e6 N/m": simulate_rig(1e6)}
    for label, trajectory in trajectories.items():
        intervals = trajectory.contact_intervals("support")
        first = ", ".join(f"{1e3 * start:.2f}-{1e3 * end:.2f}" for start, end in intervals[:4])
        print(f"{label}: {trajectory.status}, {len(intervals)} contact intervals, the first at {first} ms")
    if len(sys.argv) > 1:
        draw(trajectories, sys.argv[1])
    return trajectories


if __name__ == "__main__":
    main()
