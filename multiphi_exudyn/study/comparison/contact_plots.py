"""Pictures of contact and friction: of one in all models, and of many contacts in two models."""

from __future__ import annotations

from matplotlib.figure import Figure

from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.plots import CONTACT, first_contact_span, panels, pictured, styles

__all__ = ["contact_figure", "friction_figure", "many_contacts_figure"]


def contact_figure(comparison: Comparison, contact: str) -> Figure:
    """Contact intervals of all models under each other, whole and in the first contact phase."""
    runs = [run for run in comparison.runs.values() if run.ok]
    figure, both = panels(1.6 + 0.46 * len(runs), 2, heights=(1, 1))
    style = styles(comparison)
    for axes in both:
        for row, run in enumerate(runs):
            bars = [(a, b - a) for a, b in run.contact_intervals[contact]]
            axes.broken_barh(bars, (row - 0.36, 0.72), color=style[run.name].colour, linewidth=0)
        axes.set_yticks(range(len(runs)), [run.name for run in runs], fontsize=8)
        axes.set_ylim(len(runs) - 0.5, -0.5)
        axes.grid(axis="x", color="#E8E8E8")
        axes.set_axisbelow(True)
        axes.set_xlabel("time [s]")
    both[0].set_xlim(0, comparison.bench.t_end)
    both[0].set_title(f"Contact {contact}: the whole run, and its first contact phase", fontsize=10)
    both[1].set_xlim(*first_contact_span(comparison, [contact]))
    return figure


def friction_figure(comparison: Comparison, friction: str) -> Figure:
    """Force and slip of a friction over time; grey: the reference sticks."""
    figure, (force, way) = panels(6.4, 2, heights=(1, 1))
    style = styles(comparison)
    for run in [comparison.reference, *pictured(comparison)]:
        drawn = style[run.name]
        for axes, values in ((force, run.friction_force[friction]), (way, 1e3 * run.slip[friction])):
            axes.plot(run.time, values, drawn.line, color=drawn.colour, lw=drawn.width, label=run.label)
    for axes, label in ((force, "friction force [N]"), (way, "slip [mm]")):
        for start, end in comparison.reference.stick_intervals[friction]:
            axes.axvspan(start, end, color=CONTACT, lw=0, zorder=0)
        axes.set_xlim(0, comparison.bench.t_end)
        axes.set_ylabel(label)
    force.set_title(f"Friction {friction}; grey: the reference sticks", fontsize=10)
    force.legend(frameon=False, fontsize=8)
    way.set_xlabel("time [s]")
    return figure


def many_contacts_figure(comparison: Comparison) -> Figure:
    """Every contact a row, in the scene's order: when it is closed, in the reference and in a reduced model."""
    runs = [comparison.reference, *pictured(comparison)[:1]]
    figure, rows = panels(2.6 * len(runs) + 0.4, len(runs), heights=[1.0] * len(runs))
    style = styles(comparison)
    for axes, run in zip(rows, runs, strict=True):
        for number, intervals in enumerate(run.contact_intervals.values(), start=1):
            bars = [(a, b - a) for a, b in intervals]
            axes.broken_barh(bars, (number - 0.5, 1.0), color=style[run.name].colour, linewidth=0)
        axes.set_title(run.label, fontsize=10, loc="left")
        axes.set_xlim(0, comparison.bench.t_end)
        axes.set_ylim(0.5, len(run.contact_intervals) + 0.5)
        axes.set_ylabel("number of the contact")
    rows[-1].set_xlabel("time [s]")
    return figure
