"""The report's pictures, from the data of a comparison; nothing is computed here.

Every function returns a Figure. One colour per model in all of them (Okabe and Ito's colour-blind-safe
set), the reference black, its coarser copy and the other full runs grey. Grey areas: the reference is in
contact, as in Figs 38.8 to 38.10; in scenes without contacts its friction sticks.
"""

from __future__ import annotations

import base64
import io
import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.typing import LineStyleType

from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.direct_labels import Label, place_labels
from multiphi_exudyn.study.comparison.placement import coefficient, meeting
from multiphi_exudyn.study.measures.metrics import union
from multiphi_exudyn.study.running.runs import ModelRun

__all__ = [
    "COLOURS",
    "CONTACT",
    "canvas",
    "data_uri",
    "error_time_figure",
    "first_contact_span",
    "greyed",
    "history_figure",
    "panels",
    "pictured",
    "png",
    "styles",
]

COLOURS = ("#0072B2", "#56B4E9", "#D55E00", "#E69F00", "#009E73", "#CC79A7", "#8A6D00", "#7F3C8D")
REFERENCE, FULL, CONTACT = "#000000", "#7A7A7A", "#E3E3E3"
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
WIDTH = 9.2  # inches
RESOLUTION = 120  # dots per inch
SMALLEST = 1e-5  # of a history's peak: smaller differences lie below the picture, unless there are no larger ones
SPAN = 0.01  # of the largest difference: smaller ones may lie below the picture


@dataclass(frozen=True)
class Style:
    """How one model is drawn."""

    colour: str
    line: LineStyleType
    width: float
    marker: str


def styles(comparison: Comparison) -> dict[str, Style]:
    """One style per model."""
    drawn, colours = {}, itertools.cycle(COLOURS)
    for name, run in comparison.runs.items():
        if run is comparison.reference:
            drawn[name] = Style(REFERENCE, "-", 2.0, MARKERS[run.kind])
        elif run.kind == "full":
            drawn[name] = Style(FULL, "-", 1.0, MARKERS[run.kind])
        elif run.kind == "user-object":
            drawn[name] = Style(next(colours), ":", 2.2, MARKERS[run.kind])
        else:
            drawn[name] = Style(next(colours), "-", 1.3, MARKERS[run.kind])
    return drawn


def history_figure(comparison: Comparison, point: str) -> Figure:
    """A point's history, its detail in the first contact if there are contacts, its difference to the reference."""
    touches = bool(comparison.reference.contact_intervals)
    heights = (1.0, 1.2, 1.0) if touches else (1.0, 1.0)
    figure, (whole, *detail, difference) = panels(9.0 if touches else 6.0, len(heights), heights=heights)
    shown = [comparison.reference, *pictured(comparison)]
    _lines(whole, comparison, shown, point, per_second=1.0)
    whole.set_xlim(0, comparison.bench.t_end)
    whole.set_xlabel("time [s]")
    _, grey = greyed(comparison.reference)
    whole.set_title(f"Displacement of {point}{grey and f'; grey: {grey}'}", fontsize=10)
    for axes in detail:
        _lines(axes, comparison, shown, point, per_second=1e3)
        _detail(axes, comparison, shown, point)
    _differences(difference, comparison, point)
    _legend(figure, comparison, shown + [run for run in reduced(comparison) if run not in shown])
    return figure


def error_time_figure(comparison: Comparison) -> Figure:
    """Worst NRMSE of the judged points against online time, with the reference's own uncertainty.

    Hollow: rigid levels against stiff stops.
    """
    figure, (axes,) = panels(4.6, 1)
    until = comparison.headline_window
    style = styles(comparison)
    nearby = comparison.cheapest[1:]
    at = {name: (run.online_s, 100 * comparison.worst_error(run, until)) for name, run in comparison.measured.items()}
    stiff = {name: (run.online_s, 100 * comparison.stiff_error(run, until)) for name, run in comparison.rigid.items()}
    for name, (time, error) in at.items():
        axes.loglog(time, error, style[name].marker, color=style[name].colour, markersize=9, mec="white")
    for name, (time, error) in stiff.items():
        axes.loglog(time, error, style[name].marker, mfc="none", mec=style[name].colour, markersize=9)
    _error_time_frame(axes, comparison, until)
    named = [name for name, run in comparison.measured.items() if run not in nearby and at[name][1] > 0]
    labels = [Label(name, style[name].colour, [at[name]]) for name in named]
    place_labels(figure, axes, labels, [*at.values(), *stiff.values()])
    return figure


def png(figure: Figure) -> bytes:
    """The figure as PNG."""
    buffer = io.BytesIO()
    FigureCanvasAgg(figure).print_png(buffer)
    return buffer.getvalue()


def data_uri(figure: Figure) -> str:
    """The figure as a page holds it."""
    return f"data:image/png;base64,{base64.b64encode(png(figure)).decode('ascii')}"


def reduced(comparison: Comparison) -> list[ModelRun]:
    """Reduced models and user objects that can be measured."""
    return [run for run in comparison.measured.values() if run.kind != "full"]


def pictured(comparison: Comparison) -> list[ModelRun]:
    """Those drawn over the reference: with the scene's own number of modes, all where none has it."""
    specs, modes = comparison.bench.scene.models, comparison.bench.scene.file.modes
    own = [run for run in reduced(comparison) if getattr(specs[run.name], "modes", None) == modes]
    return own or reduced(comparison)


def greyed(reference: ModelRun) -> tuple[np.ndarray, str]:
    """Spans (k, 2) [s] that are drawn grey, and what happens in them; nothing where nothing touches or rubs."""
    if reference.contact_intervals:
        return union(reference.contact_intervals.values()), "the reference is in contact"
    sticks = reference.stick_intervals
    return union(sticks.values()), "friction sticks in the reference" if sticks else ""


def first_contact_span(comparison: Comparison, contacts: Iterable[str] | None = None) -> tuple[float, float]:
    """Start and end [s] of the detail around the reference's first contact phase, of some contacts or of all."""
    names = comparison.reference.contact_intervals if contacts is None else contacts
    phases = [comparison.first_phase(comparison.reference, name) for name in names]
    phases = [phase for phase in phases if len(phase)]
    if not phases:
        return 0.0, comparison.bench.t_end
    start, end = min(phase[0, 0] for phase in phases), max(phase[-1, 1] for phase in phases)
    margin = 0.25 * (end - start)
    return max(0.0, start - margin), min(comparison.bench.t_end, end + margin)


def canvas(height: float) -> Figure:
    """An empty figure of a report, of this height [inches]."""
    figure = Figure(figsize=(WIDTH, height), dpi=RESOLUTION, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def panels(height: float, rows: int, heights: Sequence[float] = (1.0,)) -> tuple[Figure, list[Axes]]:
    """Panels under each other in a figure of a given height [inches]; heights: their ratios."""
    figure = canvas(height)
    axes = list(figure.subplots(rows, 1, squeeze=False, height_ratios=heights)[:, 0])
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _lines(axes: Axes, comparison: Comparison, runs: Sequence[ModelRun], point: str, per_second: float) -> None:
    style = styles(comparison)
    for run in runs:
        drawn = style[run.name]
        time = per_second * run.time
        axes.plot(time, 1e3 * run.points[point], drawn.line, color=drawn.colour, lw=drawn.width)
    for start, end in per_second * greyed(comparison.reference)[0]:
        axes.axvspan(start, end, color=CONTACT, lw=0, zorder=0)
    axes.set_ylabel(f"{point} [mm]")


def _detail(axes: Axes, comparison: Comparison, shown: Sequence[ModelRun], point: str) -> None:
    start, end = first_contact_span(comparison)
    inside = (comparison.bench.time >= start) & (comparison.bench.time <= end)
    values = np.array([1e3 * run.points[point][inside] for run in shown])
    margin = 0.06 * np.ptp(values) + 1e-9
    axes.set_xlim(1e3 * start, 1e3 * end)
    axes.set_ylim(np.min(values) - margin, np.max(values) + margin)
    for contact in comparison.bench.mechanics.contacts:
        if meeting(contact) == (point,):
            level = -1e3 * contact.gap / coefficient(contact)
            axes.axhline(level, color="#444444", linestyle="--", linewidth=0.8)
            place = {"xycoords": ("axes fraction", "data"), "xytext": (0, 3), "textcoords": "offset points"}
            _note(axes, f"{contact.name}, {level:g} mm", (0.005, level), va="bottom", **place)
    axes.set_title("Detail of the first contact phase", fontsize=10)
    axes.set_xlabel("time [ms]")


def _differences(axes: Axes, comparison: Comparison, point: str) -> None:
    style, reference = styles(comparison), comparison.reference.points[point]
    shown = [_largest_so_far(run, point, reference) for run in reduced(comparison)]
    peak, largest = np.max(np.abs(reference), initial=1e-12), max((values[-1] for values in shown), default=math.inf)
    lowest = max(min(SMALLEST * 1e3 * float(peak), SPAN * float(largest)), np.finfo(float).tiny)
    if comparison.coarser is not None:
        band = _largest_so_far(comparison.coarser, point, reference)
        axes.fill_between(comparison.bench.time, lowest / 10, np.maximum(band, lowest / 10), color=CONTACT, lw=0)
    for run, values in zip(reduced(comparison), shown, strict=True):
        drawn = style[run.name]
        axes.plot(run.time, np.maximum(values, lowest / 10), drawn.line, color=drawn.colour, lw=drawn.width)
    axes.set_yscale("log")
    axes.set_ylim(lowest, None)
    axes.set_xlim(0, comparison.bench.t_end)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("largest so far [mm]")
    axes.set_title("Difference to the reference; grey: the reference to its coarser copy", fontsize=10)


def _largest_so_far(run: ModelRun, point: str, reference: np.ndarray) -> np.ndarray:
    """Largest difference [mm] up to each time."""
    return np.asarray(1e3 * np.maximum.accumulate(np.abs(run.points[point] - reference)))


def _error_time_frame(axes: Axes, comparison: Comparison, until: float) -> None:
    own, reference = comparison.coarser, comparison.reference
    if own is not None and own.name in comparison.measured:
        axes.axhspan(1e-9, 100 * comparison.worst_error(own, until), color=CONTACT, zorder=0)
        _note(axes, "the reference's own uncertainty", (0.5, 0.03), ha="center", va="bottom")
    if reference.ok:
        axes.axvline(reference.online_s, color=REFERENCE, linestyle="--", linewidth=1)
        place = {"xycoords": ("data", "axes fraction"), "ha": "right", "va": "top", "rotation": 90}
        _note(axes, "online time of the reference", (reference.online_s, 0.98), **place)
    errors = [100 * comparison.worst_error(run, until) for run in comparison.measured.values()]
    errors += [100 * comparison.stiff_error(run, until) for run in comparison.rigid.values()]
    errors = [error for error in errors if error > 0]
    if errors:
        axes.set_ylim(min(errors) / 4, max(errors) * 3)
    axes.margins(x=0.12)
    axes.set_xlabel("online time [s]")
    axes.set_ylabel(f"NRMSE to {until:g} s [%]\nworst of {', '.join(comparison.bench.judged_points)}")
    axes.grid(which="both", color="#EEEEEE")
    axes.set_axisbelow(True)


def _note(axes: Axes, text: str, at: tuple[float, float], **placing: Any) -> None:
    axes.annotate(text, at, fontsize=8, color="#444444", **{"xycoords": "axes fraction"} | placing)


def _legend(figure: Figure, comparison: Comparison, runs: Sequence[ModelRun]) -> None:
    drawn = styles(comparison)
    handles = [
        Line2D([], [], color=style.colour, linestyle=style.line, linewidth=style.width)
        for style in (drawn[run.name] for run in runs)
    ]
    labels = [run.label for run in runs]
    figure.legend(handles, labels, loc="outside lower center", ncols=2, fontsize=8, frameon=False)
