"""A cantilever over a bed of 100 stops: 2^100 levels, of which a run builds those that it visits.

The beam is pulled up at its tip and let go; it strikes the stops one after the other, from its tip
towards its root, and leaves them in the same order. Twice, with more elements: levels live in a base whose size is that
of the modes and contacts asked for, so an event works on no array of n numbers.

    python bed_of_stops.py [FILE.png]      400 and 1000 elements; about half a minute
"""

from __future__ import annotations

import dataclasses
import itertools
import sys
import time

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import multiphi_exudyn as mp

LENGTH = 2.0  # m
STOPS = 100
GAP = 1e-3  # m
STIFFNESS = 1e4  # N/m of one stop
MODES = 24
LIFT = 0.05  # m, of the tip at the start
T_END = 0.25  # s
REPEATS = 4  # of the run with the levels built
ELEMENTS = (400, 1000)  # both with an incomplete base; much finer beams lose their lowest modes to round-off


@dataclasses.dataclass(frozen=True)
class Cost:
    """CPU times [s] of one beam with n degrees of freedom: base, a first run, and a run with the levels built.

    The last is the shortest of some: another program on the machine can only lengthen it.
    """

    n: int
    offline: float
    first: float
    again: float
    trajectory: mp.Trajectory

    @property
    def events(self) -> int:
        """Number of events."""
        return len(self.trajectory.events)


def bed(elements: int, stops: int = STOPS) -> mp.MultiPhiModel:
    """The beam with its stops, equally spaced up to the tip."""
    steel = mp.Section.rectangle(0.0, LENGTH, width=0.03, height=0.01, youngs_modulus=2.1e11, density=7850.0)
    places = {f"p{i}": LENGTH * (i + 1) / stops for i in range(stops)}
    beam = mp.planar_beam(mp.Beam([steel], places), elements, mp.RayleighDamping(0.5, 1e-6))
    contacts = [mp.UnilateralContact(f"stop {i}", f"p{i}", GAP, STIFFNESS) for i in range(stops)]
    return mp.MultiPhiModel(beam, contacts, modes=MODES)


def cost(elements: int, stops: int = STOPS, t_end: float = T_END) -> Cost:
    """Builds the base, runs, and runs again."""
    started = time.process_time()
    model = bed(elements, stops)
    tip = f"p{stops - 1}"
    bent = model.base.modes.shapes @ (model.base_load({tip: 1.0}) / model.base.modes.omega**2)
    start = LIFT / (model.structure.row(tip) @ bent) * bent
    model.level(())
    ready = time.process_time()
    trajectory = mp.simulate(model, t_end, displacement=start)
    times = [time.process_time()]
    for _ in range(REPEATS):
        mp.simulate(model, t_end, displacement=start)
        times.append(time.process_time())
    again = min(after - before for before, after in itertools.pairwise(times))
    return Cost(model.structure.n, ready - started, times[0] - ready, again, trajectory)


def plot(costs: list[Cost], path: str) -> None:
    """The beam at some instants, the stops in contact over time, and the cost of an event."""
    figure, (shape, contact, price) = plt.subplots(3, 1, figsize=(8, 10), layout="constrained")
    _plot_shapes(shape, costs[0].trajectory)
    _plot_contacts(contact, costs[0].trajectory)
    _plot_cost(price, costs)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def _plot_shapes(axes: plt.Axes, run: mp.Trajectory) -> None:
    stops = len(run.model.contacts)
    x = LENGTH * np.arange(stops + 1) / stops
    colors = plt.colormaps["viridis"](np.linspace(0, 0.9, 7))
    for t, color in zip(np.linspace(0, run.t_end, 7), colors, strict=True):
        w = [0.0, *(float(run.at(f"p{i}", t)) for i in range(stops))]
        axes.plot(x, 1e3 * np.array(w), color=color, label=f"{1e3 * t:.0f} ms")
    axes.plot(x[1:], np.full(stops, -1e3 * GAP), "k^", markersize=3)
    axes.set(xlabel="x [m]", ylabel="deflection [mm]", title=f"A cantilever over {stops} stops")
    axes.legend(ncols=4, fontsize="small")


def _plot_contacts(axes: plt.Axes, run: mp.Trajectory) -> None:
    for i, stop in enumerate(run.model.contacts):
        intervals = run.contact_intervals(stop.name)
        axes.broken_barh([(1e3 * a, 1e3 * (b - a)) for a, b in intervals], (i + 0.55, 0.9), color="tab:red")
    touched = 1e3 * np.array([interval for stop in run.model.contacts for interval in run.contact_intervals(stop.name)])
    first, last = np.min(touched), np.max(touched)
    title = f"Closed contacts, {first:.0f} to {last:.0f} ms of {1e3 * run.t_end:.0f} ms"
    axes.set(xlabel="time [ms]", ylabel="stop, from the root", title=title)
    axes.set(xlim=(first - 1, last + 1), ylim=(0.5, len(run.model.contacts) + 0.5))


def _plot_cost(axes: plt.Axes, costs: list[Cost]) -> None:
    n = [each.n for each in costs]
    axes.loglog(n, [1e3 * each.first / each.events for each in costs], "o-", label="an event, its level built")
    axes.loglog(n, [1e3 * each.again / each.events for each in costs], "s-", label="an event, levels known")
    axes.loglog(n, [1e3 * each.offline for each in costs], "k:", label="base, once (not per event)")
    axes.set(xlabel="degrees of freedom", ylabel="CPU time [ms]")
    axes.set_title("Cost", loc="left")
    axes.set_xticks(n, [str(each) for each in n])
    axes.minorticks_off()
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize="small")


def main(arguments: list[str], stops: int = STOPS, t_end: float = T_END) -> list[Cost]:
    """Runs, prints and draws."""
    costs = []
    for elements in ELEMENTS:
        each = cost(elements, stops, t_end)
        costs.append(each)
        stats = each.trajectory.stats
        print(
            f"n = {each.n:6d}: {each.trajectory.status}, {each.events} events, {stats.levels_built} levels of "
            f"{stats.levels_possible:.3g}, offline {each.offline:.2f} s, an event {1e3 * each.first / each.events:.2f} "
            f"ms, with its level known {1e3 * each.again / each.events:.2f} ms",
            flush=True,
        )
    plot(costs, arguments[0] if arguments else "bed_of_stops.png")
    return costs


if __name__ == "__main__":
    main(sys.argv[1:])
