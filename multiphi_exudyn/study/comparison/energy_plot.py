"""The picture of the energy: over time, and where it is at the end."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.plots import panels, pictured, styles

__all__ = ["energy_figure"]

LOSSES = {
    "final": ("still in motion", "#0072B2"),
    "damping": ("damping", "#56B4E9"),
    "impact": ("plastic impact", "#D55E00"),
    "friction": ("friction", "#009E73"),
    "truncation_kinetic": ("truncation, kinetic", "#E69F00"),
    "truncation_strain": ("truncation, strain", "#CC79A7"),
}


def energy_figure(comparison: Comparison) -> Figure:
    """Energy over time, and where it is at the end."""
    figure, (curves, bars) = panels(7.6, 2, heights=(1.0, 1.1))
    style = styles(comparison)
    for run in [comparison.reference, *pictured(comparison)]:
        if len(run.energy):
            share = 100 * run.energy / (comparison.energy_scale(run) or run.energy[0])
            drawn = style[run.name]
            curves.plot(run.energy_time, share, drawn.line, color=drawn.colour, lw=drawn.width, label=run.label)
    curves.set_xlim(0, comparison.bench.t_end)
    curves.set_xlabel("time [s]")
    curves.set_ylabel(f"energy [% of the {comparison.energy_scale_name}]")
    curves.set_ylim(0, None)
    curves.legend(frameon=False, fontsize=8)
    _ledger_bars(bars, comparison)
    return figure


def _ledger_bars(axes: Axes, comparison: Comparison) -> None:
    runs = [run for run in comparison.runs.values() if run.ok and run.ledger and comparison.energy_scale(run)]
    left = np.zeros(len(runs))
    for row, (label, colour) in LOSSES.items():
        share = np.array([100 * run.ledger.get(row, 0.0) / comparison.energy_scale(run) for run in runs])
        if np.any(share > 0):
            axes.barh(range(len(runs)), share, left=left, color=colour, height=0.7, label=label)
        left = left + share
    axes.set_yticks(range(len(runs)), [run.name for run in runs], fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel(f"share of the {comparison.energy_scale_name} at the end of the run [%]")
    axes.set_xlim(0, 100 if not len(left) else max(100.0, float(np.max(left))))
    axes.legend(frameon=False, fontsize=8, ncols=len(LOSSES), loc="lower center", bbox_to_anchor=(0.5, 1.0))
