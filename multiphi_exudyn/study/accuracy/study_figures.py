"""A study's pictures: error against time, convergence, indicator against error, errors along a scene's axis.

Every function takes a result and returns a Figure. One colour and one marker per method in all of them (Okabe and Ito's
colour-blind-safe set, full models black and grey). Grey bands: errors below the reference's own uncertainty.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from matplotlib.transforms import Transform

from multiphi_exudyn.study.accuracy.along_axis import FINEST, Series, numeric_axes, series, tables_along
from multiphi_exudyn.study.accuracy.analysis import (
    COARSER,
    REFERENCE,
    Setting,
    StudyResult,
    front,
    full_methods,
    names_of,
    references,
    settings,
    settings_at,
    uncertainty,
    words,
)
from multiphi_exudyn.study.accuracy.direct_labels import Label, place_labels
from multiphi_exudyn.study.accuracy.indicator import indicators, rank_correlation
from multiphi_exudyn.study.comparison.findings import seconds
from multiphi_exudyn.study.comparison.plots import CONTACT, RESOLUTION, WIDTH

__all__ = ["along_figure", "convergence_figure", "indicator_figure", "pareto_figure"]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9", "#7F3C8D", "#E69F00")
FULL_COLOURS = ("#000000", "#7A7A7A", "#4D4D4D")
FULL_MARKERS = ("s", "P", "X")
MARKERS = ("o", "D", "^", "v", "<", ">", "p", "h")
GRID, LINE, NOTE = "#EEEEEE", "#B0B0B0", "#555555"
FIELD_LABELS = {"modes": "modes r", "elements": "elements", "step": "step"}
MOST_TICKS = 10
LABEL_LENGTH = 42  # characters of a legend's line
WIDE = 10.0  # ratio of largest to smallest value from which an axis is logarithmic
BETWEEN = 30  # points of a front's line that labels keep clear of, per segment


@dataclass(frozen=True)
class Style:
    """How one method is drawn."""

    colour: str
    marker: str
    line: str = "-"


def styles(result: StudyResult) -> dict[str, Style]:
    """One style per method, then those of the reference and its coarser copy."""
    neutral = zip(itertools.cycle(FULL_COLOURS), itertools.cycle(FULL_MARKERS), strict=False)
    coloured = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=False)
    full = full_methods(result)
    own = {name: Style(*next(neutral if name in full else coloured)) for name in names_of(settings(result))}
    return own | {REFERENCE: Style("#000000", "None", "--"), COARSER: Style("#7A7A7A", "None", ":")}


def pareto_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure:
    """Error against online time: every setting faint, each method's front strong, failures on the upper edge."""
    figure, axes = _single(5.9)
    drawn, fronts = settings_at(result, at), {}
    axes.set(xscale="log", yscale="log")
    for name, style in styles(result).items():
        own = [setting for setting in drawn if setting.method == name and setting.online_s is not None]
        if own:
            fronts[name] = _method(axes, own, style)
    _time_error_frame(axes, result, at, [100 * s.error for s in drawn if s.error and s.online_s])
    labels = [Label(name, styles(result)[name].colour, _anchors(line)) for name, line in fronts.items() if len(line)]
    place_labels(figure, axes, labels, [point for line in fronts.values() for point in _along(line)])
    return figure


def convergence_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure | None:
    """Error along each field of the methods' settings, the others at their finest, with observed orders."""
    drawn = settings_at(result, at)
    panels = {
        axis: [line for name in names_of(drawn) if (line := series(drawn, name, axis))]
        for axis in numeric_axes(drawn, of_scene=False)
    }
    if not panels:
        return None
    figure, axes = _figure(3.5 * len(panels), len(panels))
    for each, (axis, lines) in zip(axes, panels.items(), strict=True):
        _convergence(each, result, axis, lines)
        _uncertainty_band(each, uncertainty(result, at))
    return figure


def indicator_figure(result: StudyResult) -> Figure | None:
    """A model's own prediction of its error against its error, every run."""
    pairs = indicators(result)
    everything = [pair for found in pairs.values() for pair in found]
    if not everything:
        return None
    correlation = rank_correlation(*zip(*everything, strict=True))
    figure, axes = _single(4.6)
    axes.set(xscale="log", yscale="log")
    for name, found in pairs.items():
        known = np.array([(100 * i, 100 * e) for i, e in found if i and e]).reshape(-1, 2)
        axes.plot(*known.T, linestyle="None", **_marks(styles(result)[name]), label=name)
    line = axes.dataLim.intervalx if axes.has_data() else (1.0, 1.0)
    axes.plot(line, line, color=LINE, lw=1, label="equal", zorder=0)
    coefficient = "unknown" if correlation.coefficient is None else f"{correlation.coefficient:.2f}"
    axes.set_title(f"Spearman's rank correlation {coefficient}, {correlation.runs} runs", fontsize=11, loc="left")
    axes.set_xlabel("indicator: the model's own prediction of its error")
    axes.set_ylabel(_error_label(result))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} %"))
    _percent_axis(axes)
    axes.legend(frameon=False, fontsize=9)
    return figure


def along_figure(result: StudyResult, axis: str) -> Figure:
    """Error, and losses of contact inside the first phase, along one of the scene's axes."""
    tables = [table for table in tables_along(result, axis) if table.quantity in ("error", "inner_losses")]
    figure, panels = _figure(2.9 * len(tables) + 0.8, len(tables), sharex=True)
    for axes, table in zip(panels, tables, strict=True):
        scale = 100 if table.quantity == "error" else 1
        for name, style in styles(result).items():
            cells = table.columns.get(name, ())
            heights = [np.nan if cell is None else scale * cell for cell in cells]
            axes.plot(table.values[: len(cells)], heights, style.line, **_marks(style), label=name)
        axes.grid(color=GRID)
        if table.quantity == "error":
            axes.set_yscale("log")
            axes.set_ylabel(_error_label(result))
            _percent_axis(axes)
        else:
            axes.set_ylabel(f"losses of contact\nin the first phase, {table.contact}")
    _value_axis(panels[-1], axis, tables[-1].values)
    _legend(figure, panels)
    return figure


def _method(axes: Axes, own: Sequence[Setting], style: Style) -> np.ndarray:
    """Draw one method's settings; its front as (k, 2) of time [s] and error [%]."""
    known = np.array([(s.online_s, 100 * s.error) for s in own if s.error is not None]).reshape(-1, 2)
    line = np.array([(s.online_s, 100 * s.error) for s in front(own) if s.error is not None]).reshape(-1, 2)
    axes.plot(*known.T, style.marker, color=style.colour, ms=5, mew=0, alpha=0.28, zorder=3)
    axes.plot(*line.T, "-", marker=style.marker, color=style.colour, lw=2.0, ms=8, mec="white", mew=0.9, zorder=5)
    _gaps(axes, [s.online_s for s in own if s.error is None and s.online_s], style)
    return line


def _gaps(axes: Axes, places: Sequence[float], style: Style) -> None:
    """Crosses on the upper edge."""
    if places:
        edge: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(places, np.ones(len(places)), "x", color=style.colour, ms=7, mew=1.8, zorder=6, **edge)


def _anchors(line: np.ndarray) -> list[tuple[float, float]]:
    """Ends first: there a label is read with its curve, not between two."""
    order = [len(line) - 1, *range(len(line) - 1)]
    return [(float(line[i, 0]), float(line[i, 1])) for i in order]


def _along(line: np.ndarray) -> list[tuple[float, float]]:
    """Points on a front's line, in logarithmic steps."""
    if len(line) < 2:
        return [(float(x), float(y)) for x, y in line]
    places = np.linspace(0, len(line) - 1, BETWEEN * (len(line) - 1) + 1)
    logs = [np.exp(np.interp(places, np.arange(len(line)), np.log(np.maximum(column, 1e-300)))) for column in line.T]
    return [(float(x), float(y)) for x, y in zip(*logs, strict=True)]


def _time_error_frame(axes: Axes, result: StudyResult, at: Mapping[str, Any], errors: Sequence[float]) -> None:
    own = uncertainty(result, at)
    known = [*errors, *([100 * own] if own else [])]
    if known:
        axes.set_ylim(min(known) / 2.5, max(known) * 2)
    _uncertainty_band(axes, own)
    lowest, highest = axes.get_ylim()
    for height in [100 * tolerance for tolerance in result.study.tolerances if lowest < 100 * tolerance < highest]:
        axes.axhline(height, color=LINE, lw=0.8, zorder=1)
        _note(axes, f"{height:g} %", (1.0, height), axes.get_yaxis_transform(), (4, 0), va="center")
    for time in [s.online_s for s in references(result) if s.method == REFERENCE and s.at == at and s.online_s]:
        axes.axvline(time, color="#000000", ls="--", lw=1, zorder=1)
        beside = {"rotation": 90, "ha": "right", "va": "top"}
        _note(axes, "the reference itself", (time, 0.97), axes.get_xaxis_transform(), (0, 0), **beside)
    axes.margins(x=0.08)
    axes.grid(color=GRID)
    axes.set_axisbelow(True)
    axes.set_xlabel("online time of one run, median", fontsize=11)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: seconds(value)))
    axes.set_ylabel(_error_label(result), fontsize=11)
    axes.tick_params(labelsize=10)
    _percent_axis(axes)
    axes.set_title(_heading(result, at), fontsize=11, loc="left", pad=12)


def _heading(result: StudyResult, at: Mapping[str, Any]) -> str:
    failed = [setting for setting in settings_at(result, at) if setting.error is None]
    untimed = sum(setting.online_s is None for setting in failed)
    where = f"; {words(at)}" if at else ""
    gaps = f"; × failed: {len(failed)}" if failed else ""
    gaps += f", {untimed} of them without a time" if untimed else ""
    return f"Lower left is better. Faint: every setting{gaps}{where}"


def _convergence(axes: Axes, result: StudyResult, axis: str, lines: Sequence[Series]) -> None:
    for line in lines:
        style = styles(result)[line.method]
        heights = [np.nan if error is None else 100 * error for error in line.errors]
        axes.plot(line.values, heights, style.line, **_marks(style), label=_series_label(line))
        _gaps(axes, [value for value, error in zip(line.values, line.errors, strict=True) if error is None], style)
    axes.set_yscale("log")
    axes.set_ylabel(_error_label(result))
    axes.grid(color=GRID)
    _percent_axis(axes)
    _value_axis(axes, axis, [value for line in lines for value in line.values])
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))


def _series_label(line: Series) -> str:
    """Method, its other fields, and the observed orders below them."""
    fixed = f" ({words(line.fixed_setting)})" if line.fixed_setting else ""
    orders = [f"{order:.1f}" for order in line.orders if order is not None]
    lines = [f"{line.method}{fixed}", *([f"order {', '.join(orders)}"] if orders else [])]
    return "\n".join(textwrap.fill(each, LABEL_LENGTH) for each in lines)


def _uncertainty_band(axes: Axes, own: float | None) -> None:
    """Errors that the reference cannot tell from none."""
    if own:
        lowest, highest = axes.get_ylim()
        axes.axhspan(min(lowest, 100 * own) / 1e3, 100 * own, color=CONTACT, lw=0, zorder=0)
        axes.set_ylim(min(lowest, 50 * own), max(highest, 200 * own))
        _note(axes, "the reference's own uncertainty", (0.01, 100 * own), axes.get_yaxis_transform(), (0, -3), va="top")


def _note(
    axes: Axes, text: str, at: tuple[float, float], system: Transform, offset: tuple[float, float], **placing: Any
) -> None:
    """A remark at a point of a coordinate system, ``offset`` in points."""
    shift: dict[str, Any] = {"xytext": offset, "textcoords": "offset points", "color": NOTE, "fontsize": 9}
    axes.annotate(text, at, xycoords=system, **shift, **placing)


def _marks(style: Style) -> dict[str, Any]:
    return {"marker": style.marker, "color": style.colour, "ms": 6.5, "mec": "white", "mew": 0.7}


def _percent_axis(axes: Axes) -> None:
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g} %"))


def _value_axis(axes: Axes, axis: str, values: Sequence[float]) -> None:
    """Logarithmic where the values are far apart, with the values themselves as ticks."""
    ticks = sorted(set(values))
    if ticks[0] > 0 and (axis in FINEST or ticks[-1] / ticks[0] >= WIDE):
        axes.set_xscale("log")
        shown = ticks[:: -(-len(ticks) // MOST_TICKS)]
        axes.set_xticks(shown, [seconds(tick) if axis == "step" else f"{tick:g}" for tick in shown])
        axes.set_xticks([], minor=True)
    axes.set_xlabel(FIELD_LABELS.get(axis, axis))


def _error_label(result: StudyResult) -> str:
    return f"NRMSE to {result.window:g} s\nworst of {', '.join(result.judged_points)}"


def _single(height: float) -> tuple[Figure, Axes]:
    figure, axes = _figure(height, 1)
    return figure, axes[0]


def _figure(height: float, rows: int, sharex: bool = False) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(WIDTH, height), dpi=RESOLUTION, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(rows, 1, squeeze=False, sharex=sharex)[:, 0])
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """One for all panels."""
    found = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=3, fontsize=9, frameon=False)
