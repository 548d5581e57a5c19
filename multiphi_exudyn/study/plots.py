"""Figures of reports, their style, and their encoding for a page.

Colours are Okabe and Ito's colour-blind-safe set, one for each model in all pictures of a page. The reference is black,
its coarser copy and the other full runs are grey. In grey areas the reference is in contact, as in Figs 38.8 to 38.10;
in scenes without contacts its friction sticks. Functions that draw use ``@rc_context(STYLE)``.

Time-frequency maps: amplitudes in dB, 20 log10(a / a_max), down to -60, a_max being the larger of a row's two maxima,
so that equal colours mean equal amplitudes. Hatched: the cone of influence, where the ends of the record show. Strip
on top: in contact.
"""

from __future__ import annotations

import base64
import io
import itertools
import math
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter
from matplotlib.typing import LineStyleType

from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.study.compare import Comparison
from multiphi_exudyn.study.details import BeamShapes, Course, Intervals, LevelModes, MapPair, coefficients
from multiphi_exudyn.study.measures import Map, union
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.setup import Setup
from multiphi_exudyn.study.wording import seconds

__all__ = [
    "BAND",
    "COLOURS",
    "FULL",
    "LINE",
    "NOTE",
    "REFERENCE",
    "STYLE",
    "WIDTH",
    "Style",
    "contact_figure",
    "data_uri",
    "energy_figure",
    "error_time_figure",
    "first_contact_span",
    "friction_figure",
    "grey_spans",
    "history_figure",
    "initial_figure",
    "legend_below",
    "long_figure",
    "many_contacts_figure",
    "map_figure",
    "milliseconds_axis",
    "mode_figure",
    "note",
    "panels",
    "percent_axis",
    "plotted_runs",
    "png",
    "seconds_axis",
    "styles",
    "uncertainty_band",
]


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9", "#7F3C8D", "#E69F00")
REFERENCE, FULL = "#000000", "#7A7A7A"
BAND, LINE, NOTE = "#E3E3E3", "#B0B0B0", "#555555"
WIDTH = 9.2  # inches
STYLE: Any = {  # rcParams
    "figure.dpi": 120,
    "figure.constrained_layout.use": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "grid.color": "#EEEEEE",
    "legend.frameon": False,
    "legend.fontsize": 8,
}


@dataclass(frozen=True)
class Style:
    """Colour, marker, line style and line width [points] of one model."""

    colour: str
    marker: str
    line: LineStyleType = "-"
    width: float = 1.5

    @property
    def lines(self) -> dict[str, Any]:
        """Keywords of a plot with a line and no markers."""
        return {"color": self.colour, "ls": self.line, "lw": self.width}

    @property
    def marks(self) -> dict[str, Any]:
        """Keywords of a plot with markers and no line."""
        return {"color": self.colour, "ls": "None", "marker": self.marker, "ms": 6.5, "mec": "white", "mew": 0.7}


def panels(heights: Sequence[float], sharex: bool = False) -> tuple[Figure, list[Axes]]:
    """A figure with panels of these heights [inches], one below the other."""
    figure = Figure(figsize=(WIDTH, sum(heights)))
    return figure, list(figure.subplots(len(heights), 1, squeeze=False, sharex=sharex, height_ratios=heights)[:, 0])


def png(figure: Figure) -> bytes:
    """Return the figure as a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def data_uri(figure: Figure) -> str:
    """Return the figure as a data URI for a page."""
    return f"data:image/png;base64,{base64.b64encode(png(figure)).decode('ascii')}"


def note(axes: Axes, text: str, at: tuple[float, float], **placing: Any) -> None:
    """Write a remark at a position in axes fractions, or in the coordinates given in ``placing``."""
    axes.annotate(text, at, fontsize=8, color=NOTE, **{"xycoords": "axes fraction"} | placing)


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3, **more: Any) -> None:
    """Draw one legend for all panels, each label once."""
    handles = {label: handle for each in axes for handle, label in zip(*each.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns, **more)


def uncertainty_band(axes: Axes, own: float | None) -> None:
    """Grey band of errors [%] below the reference's own uncertainty ``own`` (a fraction)."""
    if own:
        lowest, highest = axes.get_ylim()
        axes.axhspan(min(lowest, 100 * own) / 1e3, 100 * own, color=BAND, lw=0, zorder=0)
        axes.set_ylim(min(lowest, 50 * own), max(highest, 200 * own))
        note(axes, "grey: below the reference's own uncertainty", (0.01, 0.01), va="bottom")


def percent_axis(axis: Axis) -> None:
    """Write the values [%] of a logarithmic axis with their unit."""
    _set_formatter(axis, lambda value: f"{value:g} %")


def milliseconds_axis(axes: Axes) -> None:
    """Write the times [s] of a linear x axis in ms."""
    axes.xaxis.set_major_formatter(lambda value, _: f"{1e3 * value:g}")
    axes.set_xlabel("time [ms]")


def seconds_axis(axis: Axis) -> None:
    """Write the times [s] of a logarithmic axis in µs, ms or s."""
    _set_formatter(axis, seconds)


class _TextFormatter(LogFormatter):
    """Tick labels of a logarithmic axis, also between the decades where these are few."""

    def __init__(self, text: Callable[[float], str]) -> None:
        super().__init__()
        self.text = text

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.text(x) if super().__call__(x, pos) else ""


def _set_formatter(axis: Axis, text: Callable[[float], str]) -> None:
    axis.set_major_formatter(_TextFormatter(text))
    axis.set_minor_formatter(_TextFormatter(text))


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
BEAM_SPACING = 2.3  # between beams drawn over each other, of the largest value of a mode
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


LOWEST = -60.0  # dB
LEVEL_COLOURS = ("#FFFFFF", "#E69F00", "#CC79A7")
LINE_LENGTH = 48  # characters of a title
STRIP = (1.015, 0.035)  # bottom and height, in heights of the axes


@rc_context(STYLE | {"axes.grid": False, "axes.titlelocation": "center", "legend.facecolor": "#00224E"})
def map_figure(pairs: Sequence[MapPair]) -> Figure:
    """The maps of one reduced model."""
    figure = Figure(figsize=(WIDTH, 2.7 * len(pairs) + 1.0))
    grid = figure.subplots(len(pairs), 2, squeeze=False, sharex=True, sharey=True)
    for row, pair in zip(grid, pairs, strict=True):
        most = max(float(np.max(pair.full.amplitude)), float(np.max(pair.reduced.amplitude))) or 1.0
        mesh = _map(row[0], pair.full, most, pair.full_contacts)
        _map(row[1], pair.reduced, most, pair.reduced_contacts)
        row[0].set_ylabel(f"{pair.point}: frequency [Hz]")
        for axes in row:
            _levels(axes, pair.frequencies)
    for axes, title in zip(grid[0], ("the reference", pairs[0].label), strict=True):
        axes.set_title(textwrap.fill(title, LINE_LENGTH), pad=12)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    figure.colorbar(mesh, ax=list(grid[:, 1]), label="amplitude [dB of the point's largest]", shrink=0.8)
    legend_below(figure, [grid[0, 0]], columns=1, frameon=True, labelcolor="linecolor")
    return figure


def _map(axes: Axes, drawn: Map, most: float, contacts: Intervals) -> QuadMesh:
    decibels = 20 * np.log10(np.maximum(drawn.amplitude / most, 10 ** (LOWEST / 20)))
    scale: dict[str, Any] = {"vmin": LOWEST, "vmax": 0, "cmap": "cividis"}
    mesh = axes.pcolormesh(drawn.time, drawn.frequencies, decibels, rasterized=True, **scale)
    start, end = drawn.time[0], drawn.time[-1]
    cone = np.minimum(drawn.cone, (end - start) / 2)
    for edge, inside in ((start, start + cone), (end, end - cone)):
        axes.fill_betweenx(drawn.frequencies, edge, inside, fc="#BBBBBB", ec="#FFFFFF", alpha=0.3, hatch="///", lw=0)
    bars = [(closed, opened - closed) for closed, opened in contacts]
    axes.broken_barh(bars, STRIP, transform=axes.get_xaxis_transform(), color=FULL, lw=0, clip_on=False)
    axes.set(xlim=(start, end), yscale="log", ylim=(drawn.frequencies[0], drawn.frequencies[-1]))
    axes.yaxis.set_major_formatter("{x:g}")
    return mesh


def _levels(axes: Axes, frequencies: Mapping[str, Sequence[float]]) -> None:
    """Natural frequencies of each level as dashed lines; the legend has their values."""
    for (level, values), colour in zip(frequencies.items(), itertools.cycle(LEVEL_COLOURS), strict=False):
        label = f"{level}: {', '.join(f'{value:.3g}' for value in values)} Hz"
        inside = [value for value in values if axes.get_ylim()[0] <= value <= axes.get_ylim()[1]]
        for value in inside:
            axes.axhline(value, color=colour, ls=(0, (4, 4)), lw=0.9, label=label)


@rc_context(STYLE)
def mode_figure(levels: Sequence[LevelModes]) -> Figure:
    """The lowest mode shapes of every level: its beams, from top to bottom, along x."""
    figure = Figure(figsize=(WIDTH, (1.2 + 0.9 * len(levels[0].beams)) * len(levels) + 0.3))
    for part, level in zip(figure.subfigures(len(levels), 1, squeeze=False)[:, 0], levels, strict=True):
        held = "" if level.share is None else f": {100 * level.share:.3g} % of the reference's run"
        part.suptitle(level.name + held, x=0.01, ha="left", fontsize=10)
        row = part.subplots(1, len(level.frequencies), sharex=True, sharey=True, squeeze=False)[0]
        for mode, axes in enumerate(row):
            _draw_mode(axes, level, mode)
        names = [beam.name for beam in level.beams] if len(level.beams) > 1 else []
        row[0].set_yticks(-BEAM_SPACING * np.arange(len(names)), names, fontsize=9)
    return figure


def _draw_mode(axes: Axes, level: LevelModes, mode: int) -> None:
    for number, beam in enumerate(level.beams):
        zero, shape = -BEAM_SPACING * number, beam.shapes[mode]
        axes.plot(beam.x[[0, -1]], [zero, zero], color=LINE, lw=0.8)
        axes.plot(beam.x, zero + shape, color=COLOURS[0], lw=1.6)
        for places, marker, colour in ((beam.masses, "s", "#000000"), (beam.contacts, "^", "#D55E00")):
            axes.plot(places, zero + np.interp(places, beam.x, shape), marker, color=colour, ms=6)
    axes.set_title(f"mode {mode + 1}, {level.frequencies[mode]:.2f} Hz", fontsize=9)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("x [m]", fontsize=9)
    axes.grid(visible=False)


@rc_context(STYLE)
def initial_figure(setup: Setup, beams: Sequence[BeamShapes]) -> Figure:
    """Every beam as the start's load holds it, over its undeformed axis; dashed: what a lone point can strike."""
    figure, each = panels([2.2] * len(beams), sharex=True)
    start = setup.scene.file.start
    for axes, beam in zip(each, beams, strict=True):
        shape = 1e3 * beam.shapes[0]
        axes.plot(beam.x, np.zeros_like(shape), color=LINE, lw=4, label="undeformed")
        axes.plot(beam.x, shape, color=COLOURS[0], lw=2.5, label="held by the load, at t = 0")
        axes.plot(beam.masses, np.interp(beam.masses, beam.x, shape), "s", color=REFERENCE, ms=7)
        axes.set_ylabel(f"{beam.name} w [mm]".strip())
    for contact in setup.mechanics.contacts:
        factors = coefficients(contact)
        if len(beams) == 1 and len(factors) == 1 and setup.mechanics.beams is not None:
            ((point, factor),) = factors.items()
            height = -1e3 * contact.gap / factor
            mark = "^" if factor > 0 else "v"
            each[0].plot(
                setup.mechanics.beams.points[point][1], height, mark, color="#D55E00", ms=9, label=contact.name
            )
    if start is not None and len(beams) == 1 and setup.mechanics.beams is not None:
        x = setup.mechanics.beams.points[start.load_at][1]
        height = float(np.interp(x, beams[0].x, 1e3 * beams[0].shapes[0]))
        each[0].plot(x, height, "o", mfc="none", mec="#D55E00", ms=9, label=f"load at {start.load_at}")
    each[0].margins(y=0.15)
    each[0].legend(ncols=2)
    each[-1].set_xlabel("x [m]")
    return figure


@rc_context(STYLE)
def long_figure(courses: Sequence[Course]) -> Figure:
    """Motion long after the release, and how far its phase is ahead of the open structure's first mode."""
    figure, (motion, phase) = panels([3.0, 3.0], sharex=True)
    for k, course in enumerate(courses):
        style: dict[str, Any] = {"color": COLOURS[k], "lw": WIDEST - 0.8 * k}
        motion.plot(course.time, 1e3 * course.displacement, **style, label=course.label)
        phase.plot(course.crossings, course.phase, **style, label=course.label)
        phase.axvline(course.last, color=COLOURS[k], ls=":", lw=1)
    motion.set(ylabel=f"{courses[0].point} [mm]", title="The motion long after the release")
    phase.set(xlabel="time [s]", ylabel="cycles ahead", xlim=(0, courses[0].time[-1]))
    phase.set_title("Phase, in cycles of the open first mode; dotted: the last contact ends")
    motion.legend()
    return figure
