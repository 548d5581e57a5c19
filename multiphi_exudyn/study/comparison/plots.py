"""Figures of a comparison: histories, error against time, contact, friction, energy.

The reference is black, its coarser copy and the other full runs are grey. In grey areas the reference is in contact, as
in Figs 38.8 to 38.10; in scenes without contacts its friction sticks.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.study.comparison.beam_places import coefficients
from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.figure_style import (
    BAND,
    COLOURS,
    FULL,
    REFERENCE,
    STYLE,
    Style,
    legend_below,
    milliseconds_axis,
    note,
    panels,
    percent_axis,
    seconds_axis,
    uncertainty_band,
)
from multiphi_exudyn.study.measures.metrics import union
from multiphi_exudyn.study.running.runs import ModelRun

__all__ = [
    "contact_figure",
    "energy_figure",
    "error_time_figure",
    "first_contact_span",
    "friction_figure",
    "grey_spans",
    "history_figure",
    "many_contacts_figure",
    "plotted_runs",
    "styles",
]

MARKERS = {
    "reduced": "o",
    "user-object": "D",
    "full": "s",
    "craig-bampton": "^",
    "solve-ivp": "v",
    "global-basis": "P",
    "pod-basis": "X",
    "splitting": "<",
}
LOSSES = {  # row of the ledger -> label and colour
    "final": ("still in motion", "#0072B2"),
    "damping": ("damping", "#56B4E9"),
    "impact": ("plastic impact", "#D55E00"),
    "friction": ("friction", "#009E73"),
    "truncation_kinetic": ("truncation, kinetic", "#E69F00"),
    "truncation_strain": ("truncation, strain", "#CC79A7"),
}
SMALLEST = 1e-5  # of a history's peak: lower end of the axis of differences, unless all differences are smaller
SPAN = 0.01  # of the largest difference: the axis shows at least those above it
THIN = 0.6  # edge of a bar or a grey area [points]: an interval of a long run is narrower than a pixel
WIDEST, NARROWEST = 2.4, 1.0  # of lines [points]
DOT, DOTS = 2.2, (0.0, (1.0, 4.0))  # width of a dot [points], its length and its distance to the next in widths
BAR = 0.72  # height of a bar, as a fraction of the distance between rows


def styles(comparison: Comparison) -> dict[str, Style]:
    """Style of each model: each line is narrower than those drawn before it, which show beside it where they coincide.

    A user object, which moves as its model does alone, is a row of dots on it.
    """
    drawn, colours, width = {}, itertools.cycle(COLOURS), WIDEST
    for name, run in comparison.runs.items():
        if run is comparison.reference:
            drawn[name] = Style(REFERENCE, MARKERS[run.kind], width=WIDEST + 1)
        elif run.kind == "full" or name in comparison.nearby:
            drawn[name] = Style(FULL, MARKERS[run.kind], width=NARROWEST)
        elif run.kind == "user-object":
            drawn[name] = Style(next(colours), MARKERS[run.kind], DOTS, DOT)
        else:
            drawn[name] = Style(next(colours), MARKERS[run.kind], width=width)
            width = max(NARROWEST, width - 0.4)
    return drawn


@rc_context(STYLE)
def history_figure(comparison: Comparison, point: str) -> Figure:
    """Displacement of a point, its detail in the first contact phase, and its difference to the reference."""
    has_contacts = bool(comparison.reference.contact_intervals)
    figure, (whole, *detail, difference) = panels([3.0, 3.4, 3.0] if has_contacts else [3.2, 3.0])
    shown, style = [comparison.reference, *plotted_runs(comparison)], styles(comparison)
    spans, meaning = grey_spans(comparison.reference)
    for axes in (whole, *detail):
        for run in shown:
            axes.plot(run.time, 1e3 * run.points[point], **style[run.name].lines, label=run.label)
        _shade(axes, spans)
        axes.set(xlabel="time [s]", ylabel=f"{point} [mm]")
    whole.set(xlim=(0, comparison.setup.t_end), title=f"Displacement of {point}{meaning and f'; grey: {meaning}'}")
    for axes in detail:
        _detail(axes, comparison, shown, point)
    _differences(difference, comparison, point)
    legend_below(figure, [whole, difference], columns=2)
    return figure


@rc_context(STYLE)
def error_time_figure(comparison: Comparison) -> Figure:
    """Worst NRMSE of the judged points against online time, with the reference's own uncertainty.

    Hollow markers: NRMSE of rigid levels to stiff stops.
    """
    figure, (axes,) = panels([5.0])
    until, style = comparison.headline_window, styles(comparison)
    axes.set(xscale="log", yscale="log", xlabel="online time")
    axes.margins(0.12)
    for name, run in comparison.measured.items():
        label = None if name in comparison.nearby else run.label
        axes.plot(run.online_s, 100 * comparison.worst_error(run, until), **style[name].marks, label=label)
    for name, run in comparison.rigid.items():
        hollow = style[name].marks | {"mfc": "none", "mec": style[name].colour}
        axes.plot(run.online_s, 100 * comparison.stiff_error(run, until), **hollow)
    own = comparison.coarser
    uncertainty_band(axes, comparison.worst_error(own, until) if own else None)
    if comparison.reference.ok:
        axes.axvline(
            comparison.reference.online_s, color=REFERENCE, ls="--", lw=1, label="online time of the reference"
        )
    axes.set_ylabel(f"NRMSE to {until:g} s\nworst of {', '.join(comparison.setup.judged_points)}")
    percent_axis(axes.yaxis)
    seconds_axis(axes.xaxis)
    legend_below(figure, [axes], columns=2)
    return figure


@rc_context(STYLE)
def contact_figure(comparison: Comparison, contact: str) -> Figure:
    """Contact intervals of all models, over the whole run and in the first contact phase."""
    runs = [run for run in comparison.runs.values() if run.ok]
    figure, both = panels([0.8 + 0.23 * len(runs)] * 2)
    for axes in both:
        for row, run in enumerate(runs):
            _bars(axes, run.contact_intervals[contact], row, styles(comparison)[run.name])
        axes.set_yticks(range(len(runs)), [run.name for run in runs], fontsize=8)
        axes.set(ylim=(len(runs) - 0.5, -0.5), xlabel="time [s]")
        axes.grid(visible=False, axis="y")
    milliseconds_axis(both[1])
    both[0].set(
        xlim=(0, comparison.setup.t_end), title=f"Contact {contact}: the whole run, and its first contact phase"
    )
    both[1].set_xlim(*first_contact_span(comparison, [contact]))
    return figure


@rc_context(STYLE)
def many_contacts_figure(comparison: Comparison) -> Figure:
    """Contact intervals of every contact (one row each) in the reference and in a reduced model."""
    runs = [comparison.reference, *plotted_runs(comparison)[:1]]
    figure, rows = panels([2.8] * len(runs), sharex=True)
    for axes, run in zip(rows, runs, strict=True):
        for number, intervals in enumerate(run.contact_intervals.values(), start=1):
            _bars(axes, intervals, number, styles(comparison)[run.name])
        axes.set(title=run.label, xlim=(0, comparison.setup.t_end), ylabel="number of the contact")
    rows[-1].set_xlabel("time [s]")
    return figure


@rc_context(STYLE)
def friction_figure(comparison: Comparison, friction: str) -> Figure:
    """Force and slip of a friction over time; grey areas: the reference sticks."""
    figure, both = panels([3.2, 3.2], sharex=True)
    for run in [comparison.reference, *plotted_runs(comparison)]:
        for axes, values in zip(both, (run.friction_force[friction], 1e3 * run.slip[friction]), strict=True):
            axes.plot(run.time, values, **styles(comparison)[run.name].lines, label=run.label)
    for axes, label in zip(both, ("friction force [N]", "slip [mm]"), strict=True):
        _shade(axes, comparison.reference.stick_intervals[friction])
        axes.set(xlim=(0, comparison.setup.t_end), ylabel=label)
    both[0].set_title(f"Friction {friction}; grey: the reference sticks")
    both[0].legend()
    both[1].set_xlabel("time [s]")
    return figure


@rc_context(STYLE)
def energy_figure(comparison: Comparison) -> Figure:
    """Energy over time, and the energy balance at the end of the run."""
    figure, (curves, bars) = panels([3.6, 4.0])
    for run in [comparison.reference, *plotted_runs(comparison)]:
        if len(run.energy):
            share = 100 * run.energy / (comparison.energy_scale(run) or run.energy[0])
            curves.plot(run.energy_time, share, **styles(comparison)[run.name].lines, label=run.label)
    curves.set(xlim=(0, comparison.setup.t_end), xlabel="time [s]", ylim=(0, None))
    curves.set_ylabel(f"energy [% of the {comparison.energy_scale_name}]")
    curves.legend()
    runs = [run for run in comparison.runs.values() if run.ok and run.ledger and comparison.energy_scale(run)]
    left = np.zeros(len(runs))
    for row, (label, colour) in LOSSES.items():
        share = np.array([100 * run.ledger.get(row, 0.0) / comparison.energy_scale(run) for run in runs])
        if np.any(share > 0):
            bars.barh([run.name for run in runs], share, left=left, color=colour, height=BAR, label=label)
        left = left + share
    bars.invert_yaxis()
    bars.set_xlabel(f"share of the {comparison.energy_scale_name} at the end of the run [%]")
    bars.set_xlim(0, np.max(left, initial=100.0))
    bars.legend(ncols=len(LOSSES), loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return figure


def plotted_runs(comparison: Comparison) -> list[ModelRun]:
    """Runs drawn with the reference: those with the scene's own number of modes, or all if no model has it."""
    specs, modes = comparison.setup.scene.models, comparison.setup.scene.file.modes
    own = [run for run in _reduced(comparison) if getattr(specs[run.name], "modes", None) == modes]
    return own or _reduced(comparison)


def grey_spans(reference: ModelRun) -> tuple[np.ndarray, str]:
    """Intervals (k, 2) [s] drawn grey, and their meaning; empty without contact and friction."""
    if reference.contact_intervals:
        return union(reference.contact_intervals.values()), "the reference is in contact"
    sticks = reference.stick_intervals
    return union(sticks.values()), "friction sticks in the reference" if sticks else ""


def first_contact_span(comparison: Comparison, contacts: Iterable[str] | None = None) -> tuple[float, float]:
    """Start and end [s] of the detail around the reference's first contact phase; ``contacts``: None for all."""
    names = comparison.reference.contact_intervals if contacts is None else contacts
    phases = [phase for name in names if len(phase := comparison.first_phase(comparison.reference, name))]
    if not phases:
        return 0.0, comparison.setup.t_end
    start, end = min(phase[0, 0] for phase in phases), max(phase[-1, 1] for phase in phases)
    margin = 0.25 * (end - start)
    return max(0.0, start - margin), min(comparison.setup.t_end, end + margin)


def _reduced(comparison: Comparison) -> list[ModelRun]:
    """Runs, with an error, of all models but full ones."""
    return [run for name, run in comparison.measured.items() if run.kind != "full" and name not in comparison.nearby]


def _shade(axes: Axes, spans: np.ndarray) -> None:
    for start, end in spans:
        axes.axvspan(start, end, color=BAND, lw=THIN, zorder=0)


def _bars(axes: Axes, intervals: np.ndarray, row: float, style: Style) -> None:
    bars = [(start, end - start) for start, end in intervals]
    axes.broken_barh(bars, (row - BAR / 2, BAR), color=style.colour, lw=THIN)


def _detail(axes: Axes, comparison: Comparison, shown: Sequence[ModelRun], point: str) -> None:
    """Limit a panel to the first contact phase, and draw the stops that act on this point alone."""
    start, end = first_contact_span(comparison)
    inside = (comparison.setup.time >= start) & (comparison.setup.time <= end)
    values = np.array([1e3 * run.points[point][inside] for run in shown])
    margin = 0.06 * np.ptp(values) + 1e-9
    axes.set(xlim=(start, end), ylim=(np.min(values) - margin, np.max(values) + margin))
    milliseconds_axis(axes)
    axes.set_title("Detail of the first contact phase")
    for contact in comparison.setup.mechanics.contacts:
        if list(coefficients(contact)) == [point]:
            _stop(axes, contact, -1e3 * contact.gap / coefficients(contact)[point])


def _stop(axes: Axes, contact: UnilateralContact, height: float) -> None:
    axes.axhline(height, color=REFERENCE, ls="--", lw=0.8)
    place = {"xycoords": ("axes fraction", "data"), "xytext": (0, 3), "textcoords": "offset points"}
    note(axes, f"{contact.name}, {height:g} mm", (0.005, height), va="bottom", **place)


def _differences(axes: Axes, comparison: Comparison, point: str) -> None:
    reference = comparison.reference.points[point]

    def largest_so_far(run: ModelRun) -> np.ndarray:
        return np.asarray(1e3 * np.maximum.accumulate(np.abs(run.points[point] - reference)))

    shown = [(run, largest_so_far(run)) for run in _reduced(comparison)]
    largest = max((values[-1] for _, values in shown), default=math.inf)
    lowest = max(min(SMALLEST * 1e3 * np.max(np.abs(reference), initial=1e-12), SPAN * largest), np.finfo(float).tiny)
    if comparison.coarser is not None:
        band = np.maximum(largest_so_far(comparison.coarser), lowest / 10)
        axes.fill_between(comparison.setup.time, lowest / 10, band, color=BAND, lw=0)
    for run, values in shown:
        axes.plot(run.time, np.maximum(values, lowest / 10), **styles(comparison)[run.name].lines, label=run.label)
    axes.set(yscale="log", ylim=(lowest, None), xlim=(0, comparison.setup.t_end), xlabel="time [s]")
    axes.set_ylabel("largest so far [mm]")
    axes.set_title("Difference to the reference; grey: the reference to its coarser copy")
