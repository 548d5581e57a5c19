"""A study's pictures: error against time, convergence, indicator against error, along the scene's axes, the response.

Every function takes a result and returns a Figure, None where there is nothing to draw.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from multiphi_exudyn.study.accuracy.along_axis import FINER, Series, numeric_axes, series, tables_along
from multiphi_exudyn.study.accuracy.analysis import (
    front,
    full_methods,
    indicators,
    rank_correlation,
    references_at,
    settings,
    settings_at,
    uncertainty,
    words,
)
from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE
from multiphi_exudyn.study.accuracy.study_result import StudyResult
from multiphi_exudyn.study.comparison.figure_style import (
    COLOURS,
    FULL,
    LINE,
    STYLE,
    WIDTH,
    Style,
    legend_below,
    panels,
    percent_axis,
    seconds_axis,
    uncertainty_band,
)
from multiphi_exudyn.study.comparison.figure_style import REFERENCE as BLACK
from multiphi_exudyn.study.comparison.wording import seconds
from multiphi_exudyn.study.comparison.zoom import zoom_line, zoom_plot

__all__ = [
    "along_figure",
    "convergence_figure",
    "error_against_time",
    "indicator_figure",
    "pareto_figure",
    "response_figure",
    "styles",
]

MARKERS = ("o", "D", "^", "v", "<", ">", "p", "h")
FULL_COLOURS, FULL_MARKERS = (BLACK, FULL, "#4D4D4D"), ("s", "d", "X")
MOST_ORDERS = 5  # written one by one
MOST_TICKS = 10
WIDE = 10.0  # ratio of largest to smallest value from which an axis is logarithmic
BRIGHTEST = 0.85  # of the colour map: yellow is hard to see on white
MOST_COLUMNS, MOST_ROWS = 4, 4  # panels of the response
QUANTITIES = {  # label and scale of what is drawn of points and contacts
    "largest": ("largest displacement\n{} [mm]", 1e3),
    "inner_losses": ("losses of contact\nin the first phase\n{}", 1.0),
    "largest_force": ("largest force\n{} [N]", 1.0),
}
LABEL_LENGTH = 42  # characters of a legend's line


def styles(result: StudyResult) -> dict[str, Style]:
    """One style per method, then those of the reference and its coarser copy."""
    neutral = zip(itertools.cycle(FULL_COLOURS), itertools.cycle(FULL_MARKERS), strict=False)
    coloured = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=False)
    full = full_methods(result)
    own = {name: Style(*next(neutral if name in full else coloured)) for name in settings(result).method.unique()}
    return own | {REFERENCE: Style(BLACK, "None", "--"), COARSER: Style(FULL, "None", ":")}


@rc_context(STYLE)
def pareto_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure:
    """Error against online time: every setting faint, each method's front strong, failures on the upper edge."""
    figure, (axes,) = panels([6.2])
    drawn = settings_at(result, at)
    axes.set(xscale="log", yscale="log", xlabel="online time of one run", ylabel=_error_label(result))
    for name, style in styles(result).items():
        own = drawn[(drawn.method == name) & drawn.online_s.notna()]
        if len(own):
            best = front(own)
            axes.plot(own.online_s, 100 * own.error, style.marker, color=style.colour, ms=5, mew=0, alpha=0.28)
            axes.plot(best.online_s, 100 * best.error, **style.marks | style.lines | {"ms": 8, "lw": 2}, label=name)
            _failures(axes, own.online_s[own.error.isna()], style)
    _tolerances(axes, result, at, drawn)
    for time in _reference(references_at(result, at)).online_s.dropna():
        axes.axvline(time, color=BLACK, ls="--", lw=1, label="the reference itself")
    axes.margins(x=0.08)
    seconds_axis(axes.xaxis)
    percent_axis(axes.yaxis)
    failed = drawn[drawn.error.isna()]
    count = f"; × failed: {len(failed)}" if len(failed) else ""
    untimed = failed.online_s.isna().sum()
    hidden = f", {untimed} of them not shown: without a time" if untimed else ""
    axes.set_title(f"Lower left is better. Faint: every setting{count}{hidden}", pad=12)
    legend_below(figure, [axes])
    return figure


@rc_context(STYLE)
def convergence_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure | None:
    """Error along each field of the methods' settings, the others at their finest, with observed orders."""
    drawn = settings_at(result, at)
    lines = {
        axis: [line for name in drawn.method.unique() if (line := series(drawn, name, axis))]
        for axis in numeric_axes(drawn, "setting")
    }
    if not lines:
        return None
    figure, all_axes = panels([max(3.5, 0.4 * len(each) + 0.5) for each in lines.values()])
    for axes, (axis, each) in zip(all_axes, lines.items(), strict=True):
        for line in each:
            style, table = styles(result)[line.method], line.table
            axes.plot(table.value, 100 * table.error, **style.marks | style.lines, label=_series_label(line))
            _failures(axes, table.value[table.error.isna()], style)
        axes.set(yscale="log", ylabel=_error_label(result))
        percent_axis(axes.yaxis)
        _value_axis(axes, axis, pd.concat([line.table.value for line in each]))
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        uncertainty_band(axes, uncertainty(result, at))
    return figure


@rc_context(STYLE)
def indicator_figure(result: StudyResult) -> Figure | None:
    """A model's own prediction of its error against its error, every run."""
    pairs = indicators(result)
    if pairs.empty:
        return None
    figure, (axes,) = panels([4.6])
    axes.set(xscale="log", yscale="log", ylabel=_error_label(result))
    axes.set_xlabel("indicator: the model's own prediction of its error")
    for name, found in pairs[(pairs.indicator > 0) & (pairs.error > 0)].groupby("method", sort=False):
        axes.plot(100 * found.indicator, 100 * found.error, **styles(result)[str(name)].marks, label=name)
    line = axes.dataLim.intervalx if axes.has_data() else (1.0, 1.0)
    axes.plot(line, line, color=LINE, lw=1, label="equal", zorder=0)
    coefficient, runs = rank_correlation(pairs)
    size = "unknown" if coefficient is None else f"{coefficient:.2f}"
    axes.set_title(f"Spearman's rank correlation {size}, {runs} runs")
    percent_axis(axes.xaxis)
    percent_axis(axes.yaxis)
    axes.legend()
    return figure


@rc_context(STYLE)
def along_figure(result: StudyResult, axis: str) -> Figure:
    """Error, largest displacements and forces, and losses of contact, along one of the scene's axes."""
    tables = tables_along(result, axis)
    drawn = [quantity for quantity in tables if quantity.partition(".")[0] in QUANTITIES]
    figure, all_axes = panels([3.2] * (1 + len(drawn)), sharex=True)
    for axes, quantity in zip(all_axes, ["error", *drawn], strict=True):
        table, (kind, _, name) = tables[quantity], quantity.partition(".")
        label, scale = QUANTITIES.get(kind, (_error_label(result), 100.0))
        for method, style in styles(result).items():
            if method in table.index:
                axes.plot(table.columns, scale * table.loc[method], **style.marks | style.lines, label=method)
        axes.set_ylabel(label.format(name))
        if quantity == "error":
            axes.set_yscale("log")
            percent_axis(axes.yaxis)
        else:
            axes.yaxis.set_major_locator(MaxNLocator(integer=kind == "inner_losses"))
    _value_axis(all_axes[-1], axis, tables["error"].columns.astype(float))
    legend_below(figure, all_axes)
    return figure


@rc_context(STYLE)
def response_figure(result: StudyResult) -> Figure | None:
    """Largest displacements and forces of the reference along two or three axes; None for fewer, or without any.

    The first axis is drawn along, lines are values of the second, columns of the third; others at their first value.
    """
    runs = _reference(result.table)
    axes = numeric_axes(runs, "at")
    measures = pd.json_normalize(runs.measures.tolist(), max_level=1)
    known = [f"largest.{point}" for point in result.judged_points]
    known += [name for name in map(str, measures) if name.startswith("largest_force.")]
    rows = [name for name in known if name in measures][:MOST_ROWS]
    if len(axes) < 2 or not rows:
        return None
    frame = measures[rows].join(pd.DataFrame(runs["at"].tolist()))
    for axis in axes[3:]:
        frame = frame[frame[axis] == frame[axis].iloc[0]]
    parts: list[tuple[Any, pd.DataFrame]] = [(None, frame)]
    if len(axes) > 2:
        parts = list(frame.groupby(axes[2]))[:MOST_COLUMNS]
    figure = Figure(figsize=(WIDTH, 2.3 * len(rows) + 0.9))
    grid = figure.subplots(len(rows), len(parts), squeeze=False, sharex=True, sharey="row")
    for panels_of_row, row in zip(grid, rows, strict=True):
        quantity, _, name = row.partition(".")
        label, scale = QUANTITIES[quantity]
        for axes_of_part, (value, part) in zip(panels_of_row, parts, strict=True):
            _family(axes_of_part, scale * part.pivot_table(row, axes[0], axes[1], dropna=False).astype(float))
            _value_axis(axes_of_part, axes[0], part[axes[0]])
            axes_of_part.set_title("" if value is None or row != rows[0] else f"{axes[2]} = {value:g}")
            axes_of_part.set_ylabel(label.format(name), fontsize=9)
            axes_of_part.label_outer()
    legend_below(figure, [grid[0, 0]], columns=6, title=axes[1])
    return figure


def error_against_time(result: StudyResult, at: Mapping[str, Any], number: int) -> dict[str, Any]:
    """The picture of error and time as a plot that zooms, the ``number``-th of the page, marks with their settings."""
    known = settings_at(result, at).query("error > 0 and online_s > 0")
    lines = []
    for name, style in styles(result).items():
        own = known[known.method == name]
        if len(own):
            best, notes = front(own), [words(setting) or name for setting in own.setting]
            faint = {"mark": 5, "faint": True, "notes": notes}
            lines.append(zoom_line(name, style.colour, 100 * own.error, 1e3 * own.online_s, **faint))
            lines.append(zoom_line(name, style.colour, 100 * best.error, 1e3 * best.online_s, mark=8, width=2))
    x = {"label": "online time of one run [ms]", "group": f"time at {number}", "log": True}
    label = f"NRMSE to {result.window:g} s [%], worst of {', '.join(result.judged_points)}"
    own_uncertainty = uncertainty(result, at)
    return zoom_plot(label, x, lines, log=True, below=None if own_uncertainty is None else 100 * own_uncertainty)


def _error_label(result: StudyResult) -> str:
    return f"NRMSE to {result.window:g} s\nworst of {', '.join(result.judged_points)}"


def _reference(table: pd.DataFrame) -> pd.DataFrame:
    return table[table.method == REFERENCE]


def _failures(axes: Axes, places: pd.Series, style: Style) -> None:
    """Crosses on the upper edge."""
    if len(places):
        edge: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(places, np.ones(len(places)), "x", color=style.colour, ms=7, mew=1.8, zorder=6, **edge)


def _tolerances(axes: Axes, result: StudyResult, at: Mapping[str, Any], drawn: pd.DataFrame) -> None:
    """Room for all errors and the reference's own uncertainty, and a line for each tolerance between them."""
    own = uncertainty(result, at)
    known = 100 * drawn.error[(drawn.error > 0) & (drawn.online_s > 0)]
    if own:
        known = pd.concat([known, pd.Series([100 * own])])
    if len(known):
        axes.set_ylim(known.min() / 2.5, known.max() * 2)
    uncertainty_band(axes, own)
    lowest, highest = axes.get_ylim()
    for height in [100 * tolerance for tolerance in result.study.tolerances if lowest < 100 * tolerance < highest]:
        axes.axhline(height, color=LINE, lw=0.8, zorder=1)
        axes.text(1.0, height, f" {height:g} %", transform=axes.get_yaxis_transform(), va="center", fontsize=9)


def _value_axis(axes: Axes, axis: str, values: Iterable[float]) -> None:
    """The values themselves as ticks; logarithmic where they are far apart."""
    ticks = sorted({float(value) for value in values})
    if ticks[0] > 0 and (axis in FINER or ticks[-1] / ticks[0] >= WIDE):
        axes.set_xscale("log")
    shown = ticks[:: -(-len(ticks) // MOST_TICKS)]
    axes.set_xticks(shown, [seconds(tick) if axis == "step" else f"{tick:g}" for tick in shown])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("modes r" if axis == "modes" else axis)


def _family(axes: Axes, table: pd.DataFrame) -> None:
    """A line for each column, dark to bright."""
    for shade, value in zip(colormaps["viridis"](np.linspace(0, BRIGHTEST, table.shape[1])), table, strict=True):
        axes.plot(table.index, table[value], color=shade, marker="o", ms=4, label=f"{value:g}")


def _series_label(line: Series) -> str:
    """Method, its other fields, and the observed orders below them."""
    fixed = f" ({words(line.fixed)})" if line.fixed else ""
    orders = line.table.order.dropna()
    told = f"order {', '.join(f'{order:.1f}' for order in orders)}" if len(orders) else ""
    if len(orders) > MOST_ORDERS:
        told = f"order {orders.min():.1f} to {orders.max():.1f}, median {orders.median():.1f}"
    return "\n".join(textwrap.fill(each, LABEL_LENGTH) for each in (f"{line.method}{fixed}", told) if each)
