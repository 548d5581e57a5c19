"""A friction ring on the paper's cantilever: stick and slip, the loop of its force, and how few modes suffice.

Run: python examples/friction_ring.py [FIGURE.png]
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence

import matplotlib.figure
import numpy as np
from matplotlib.axes import Axes

import multiphi_exudyn as mp
from reference_models.global_basis import global_basis
from reference_models.massless_boundary import massless_boundary
from reference_models.rig import rig_beam, rig_damping

LIMIT, SPRING = 0.6, 5e3  # N, N/m: of the ring at node2, and of the spring of the second one
LOAD = mp.HarmonicLoad("node3", 0.5, 3.0, -math.pi / 2)  # N, Hz: on the tip, from rest
T_END, POINTS, MODES = 1.0, ("node1", "node2", "node3"), (3, 4, 6, 8, 12)
OWN, MASSLESS, ONE = "own modes of every state", "one basis, massless boundary", "one basis, open and stuck modes"
COLOURS = {OWN: "#0072B2", MASSLESS: "#D55E00", ONE: "#009E73"}
Errors = dict[str, dict[int, float]]


def beam() -> mp.LinearStructure:
    """The rig without its stop: 86 degrees of freedom."""
    return mp.planar_beam(rig_beam(), elements=40, damping=rig_damping())


def ring(stiffness: float = math.inf) -> mp.Friction:
    """Where the paper has its stop."""
    return mp.Friction("ring", "node2", LIMIT, stiffness=stiffness)


def run(structure: mp.LinearStructure, modes: int | str, stiffness: float = math.inf) -> mp.Trajectory:
    """From rest under the load."""
    return mp.simulate(mp.MultiPhiModel(structure, [ring(stiffness)], modes=modes), T_END, loads=[LOAD])


def study(structure: mp.LinearStructure, reference: mp.Trajectory) -> Errors:
    """Error of the worst point to T_END, by method and number of modes."""
    t = np.linspace(0, T_END, 4001)
    true = [np.asarray(reference.at(point, t)) for point in POINTS]
    errors: Errors = {OWN: {}, MASSLESS: {}, ONE: {}}
    for r in MODES:
        own, massless = run(structure, r), massless_boundary(structure, ring(), LOAD, r, T_END)
        errors[OWN][r] = worst([np.asarray(own.at(point, t)) for point in POINTS], true)
        errors[MASSLESS][r] = worst([massless.at(point, t) for point in POINTS], true)
        if r % 2 == 0:
            one = run(global_basis(structure, [ring()], r // 2), "all")
            errors[ONE][r] = worst([np.asarray(one.at(point, t)) for point in POINTS], true)
    return errors


def worst(found: Sequence[np.ndarray], true: Sequence[np.ndarray]) -> float:
    """The largest |found - true| / |true|."""
    return max(float(np.linalg.norm(x - y) / np.linalg.norm(y)) for x, y in zip(found, true, strict=True))


def draw(runs: Mapping[str, mp.Trajectory], errors: Errors, path: str) -> None:
    """Histories with stick in grey, the loops, and errors against modes."""
    figure = matplotlib.figure.Figure(figsize=(10, 8), layout="constrained")
    panels = figure.subplot_mosaic(
        [["motion", "motion"], ["force", "force"], ["loop", "modes"]], height_ratios=[1, 0.8, 1.5]
    )
    panels["force"].sharex(panels["motion"])
    draw_histories(panels["motion"], panels["force"], runs["rigid"])
    draw_loops(panels["loop"], runs)
    draw_errors(panels["modes"], errors)
    for axes in panels.values():
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=120)


def draw_histories(motion: Axes, force: Axes, trajectory: mp.Trajectory) -> None:
    """Tip and ring, and the force of the ring."""
    t = np.unique(np.concatenate([np.linspace(0, T_END, 2001), [event.time for event in trajectory.events]]))
    for point, label, colour, width in (("node3", "tip", "0.45", 1.0), ("node2", "ring", "#0072B2", 1.8)):
        x = 1e3 * np.asarray(trajectory.at(point, t))
        motion.plot(t, x, color=colour, linewidth=width)
        motion.annotate(label, (T_END, x[-1]), (5, -3), textcoords="offset points", color=colour, annotation_clip=False)
    force.plot(t, trajectory.friction_force("ring", t), color="#0072B2", linewidth=1.2)
    for axes in (motion, force):
        axes.axhline(0, color="0.8", linewidth=0.6, zorder=0)
        for start, end in trajectory.stick_intervals("ring"):
            axes.axvspan(start, end, color="0.88", linewidth=0, zorder=-1)
    title = "A ring on the rig's beam slips at 0.6 N, under 0.5 N at 3 Hz on the tip; grey: it sticks"
    motion.set_title(title, loc="left")
    motion.set_ylabel("displacement [mm]")
    motion.tick_params(labelbottom=False)
    motion.set_xlim(0, T_END)
    force.set_ylabel("friction force [N]")
    force.set_xlabel("time [s]")


def draw_loops(axes: Axes, runs: Mapping[str, mp.Trajectory]) -> None:
    """Friction force over the displacement of the ring, over the last period and a half."""
    t = np.linspace(T_END - 1.5 / LOAD.frequency_hz, T_END, 4001)
    for name, colour in (("rigid", "#0072B2"), ("sprung", "#D55E00")):
        x = 1e3 * np.asarray(runs[name].at("node2", t))
        axes.plot(x, runs[name].friction_force("ring", t), color=colour, linewidth=1.3, label=name)
    axes.set_ylim(-0.68, 0.92)
    axes.set_yticks([-LIMIT, -LIMIT / 2, 0, LIMIT / 2, LIMIT])
    axes.set_title("Loops of the last 0.5 s", loc="left")
    axes.set_xlabel("displacement of the ring [mm]")
    axes.set_ylabel("friction force [N]")
    axes.legend(["without a spring", f"on a spring of {SPRING / 1e3:g} N/mm"], frameon=False, loc="upper left")


def draw_errors(axes: Axes, errors: Errors) -> None:
    """Errors in per cent."""
    for name, found in errors.items():
        axes.semilogy(list(found), [100 * e for e in found.values()], "o-", color=COLOURS[name], label=name)
    axes.set_title("Error of the worst point to 1 s", loc="left")
    axes.set_xlabel("modes r")
    axes.set_ylabel("NRMSE [%], to all 86 modes")
    axes.set_xticks(MODES)
    axes.set_yticks([0.001, 0.01, 0.1, 1], ["0.001", "0.01", "0.1", "1"])
    axes.grid(axis="y", color="0.92")
    axes.legend(frameon=False, loc="lower left")


def main() -> Errors:
    """Errors and the ledger, and the figure where a path is given."""
    structure = beam()
    runs = {"rigid": run(structure, "all"), "sprung": run(structure, "all", SPRING)}
    errors = study(structure, runs["rigid"])
    for name, found in errors.items():
        print(f"{name}: " + ", ".join(f"{r}: {100 * error:.3g} %" for r, error in found.items()))
    for name, trajectory in runs.items():
        ledger, stuck = trajectory.ledger, np.sum(np.diff(trajectory.stick_intervals("ring")))
        taken, given = 1e3 * ledger.friction, 1e3 * ledger.work_of_loads
        print(f"{name}: {len(trajectory.events)} events, sticks {stuck:.3f} s, takes {taken:.4g} mJ of {given:.4g} mJ")
    if len(sys.argv) > 1:
        draw(runs, errors, sys.argv[1])
    return errors


if __name__ == "__main__":
    main()
