"""Your own Exudyn system, reduced in three lines, run on its own, and put back into Exudyn as a body.

The system here is one of Exudyn's published tests, a soft cable under its weight that comes down on stops below its
nodes (ANCFcontactCircleTest, load and distance a thousandth of the published ones so that it stays in their range).

Run: python examples/reduce_your_model.py [FIGURE.png]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import exudyn as exu
import matplotlib.figure
import numpy as np

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import BodyHistories, CreateMultiPhiBody, Reduction, body_histories, reduce
from reference_models.published_systems import OwnRun, PublishedSystem, cable_on_nodal_stops

STEP = 1e-4  # s, of the body in Exudyn
MODES = 16  # all that bend; the others stretch the cable


@dataclass(frozen=True)
class Runs:
    """The reduction and its motion three ways: on its own, as a body in Exudyn, and the full system's."""

    reduction: Reduction
    alone: mp.Trajectory
    body: BodyHistories
    full: OwnRun
    point: str

    def full_at(self, time: np.ndarray) -> np.ndarray:
        """The point in the full system, (k,) [m]."""
        row = self.reduction.structure.coordinates @ self.reduction.structure.row(self.point)
        return np.interp(time, self.full.time, self.full.of_row(row))

    def errors(self, end: float) -> dict[str, float]:
        """Largest distance from the full system up to ``end`` [s], of its largest displacement."""
        time = self.body.time[self.body.time <= end * (1 + 1e-9)]
        full, alone = self.full_at(time), self.alone.at(self.point, np.minimum(time, end))
        both = {"on its own": alone, "as a body in Exudyn": self.body.points[self.point][: len(time)]}
        return {name: float(np.max(np.abs(run - full)) / np.max(np.abs(full))) for name, run in both.items()}


def put_back(reduction: Reduction, end: float) -> BodyHistories:
    """The reduced model as a body in a new Exudyn system; your other bodies and connectors would go there too."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(
        mbs, reduction.model, name="cable", velocity=reduction.velocity, loads=reduction.loads, matchedStepSize=STEP
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = STEP
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = end, round(end / STEP)
    settings.timeIntegration.verboseMode = 0
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    return body_histories(mbs, items)


def runs(system: PublishedSystem) -> Runs:
    """The three lines, then the body and the full system."""
    reduction = reduce(system.mbs, modes=MODES)
    print(reduction.report)
    alone = mp.simulate(reduction.model, system.end, velocity=reduction.velocity, loads=reduction.loads)
    print(reduction.report_of(alone))
    return Runs(reduction, alone, put_back(reduction, system.end), OwnRun.of(system), system.point)


def draw(found: Runs, end: float, path: str) -> None:
    """The point three ways, and when each stop is closed."""
    figure = matplotlib.figure.Figure(figsize=(9, 6), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    time = np.linspace(0.0, end, 1500)
    above.plot(1e3 * time, 1e3 * found.full_at(time), color="black", lw=3, alpha=0.35, label="full Exudyn system")
    above.plot(1e3 * time, 1e3 * found.alone.at(found.point, time), color="#0072B2", lw=1.2, label="Multi-Phi, alone")
    body = found.body
    above.plot(
        1e3 * body.time[::40], 1e3 * body.points[found.point][::40], "o", ms=3, color="#D55E00", label="body in Exudyn"
    )
    above.set(ylabel=f"{found.point} [mm]", title="A published Exudyn system, reduced: cable on eight stops")
    above.legend(frameon=False)
    _draw_intervals(below, found)
    below.set(xlabel="time [ms]")
    for axis in (above, below):
        axis.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=100)


def _draw_intervals(axis: matplotlib.axes.Axes, found: Runs) -> None:
    """Closed stops: blue by the model, grey by the full system."""
    structure, contacts = found.reduction.structure, found.reduction.model.contacts
    for level, contact in enumerate(contacts):
        row = structure.coordinates @ structure.row(contact.direction)
        full = found.full.negative(found.full.of_row(row) + contact.gap)
        for intervals, shift, colour in (
            (full, 0.05, "0.6"),
            (found.alone.contact_intervals(contact.name), -0.3, "#0072B2"),
        ):
            bars = [(1e3 * a, 1e3 * (b - a)) for a, b in intervals]
            axis.broken_barh(bars, (level + shift, 0.25), color=colour)
    axis.set_yticks(range(len(contacts)), [contact.name for contact in contacts], fontsize=8)
    axis.set(ylim=(-0.6, len(contacts) - 0.4), title="closed stops")


def main(arguments: list[str]) -> Runs:
    """All runs, the errors printed, and the figure if a path is given."""
    exu.config.printToConsole = False
    system = cable_on_nodal_stops()
    found = runs(system)
    for end in (0.15, 0.2, system.end):
        told = ", ".join(f"{name} {100 * error:.3f} %" for name, error in found.errors(end).items())
        print(f"largest distance from the full system to {end:g} s: {told}")
    if arguments:
        draw(found, system.end, arguments[0])
    return found


if __name__ == "__main__":
    main(sys.argv[1:])
