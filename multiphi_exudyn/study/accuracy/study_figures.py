"""A study's pictures: error against time, convergence, indicator against error, errors along a scene's axis.

Every function takes a result and returns a Figure, None where there is nothing to draw.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from multiphi_exudyn.study.accuracy.along_axis import Series, numeric_axes, series, tables_along
from multiphi_exudyn.study.accuracy.analysis import front, names_of, references, settings_at, uncertainty, words
from multiphi_exudyn.study.accuracy.figure_style import (
    GRID,
    LINE,
    Style,
    error_label,
    gaps,
    legend_below,
    marks,
    note,
    panels_of,
    percent_axis,
    seconds_axis,
    single,
    styles,
    uncertainty_band,
    value_axis,
)
from multiphi_exudyn.study.accuracy.indicator import indicators, rank_correlation
from multiphi_exudyn.study.accuracy.study_file import REFERENCE
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.comparison.direct_labels import Label, place_labels

__all__ = ["along_figure", "convergence_figure", "indicator_figure", "pareto_figure"]

MOST_ORDERS = 5  # written one by one
LABEL_LENGTH = 42  # characters of a legend's line
NAME_LENGTH = 24  # characters of a line of a label beside its curve
DRAWN = {  # along an axis of the scene: label and scale
    "error": ("", 100.0),
    "largest": ("largest displacement [mm]", 1e3),
    "inner_losses": ("losses of contact\nin the first phase", 1.0),
    "largest_force": ("largest contact force [N]", 1.0),
}
BETWEEN = 30  # points of a front's line that labels keep clear of, per segment


def pareto_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure:
    """Error against online time: every setting faint, each method's front strong, failures on the upper edge."""
    figure, axes = single(5.9)
    drawn, fronts = settings_at(result, at), {}
    axes.set(xscale="log", yscale="log")
    for name, style in styles(result).items():
        own = [setting for setting in drawn if setting.method == name and setting.online_s is not None]
        if own:
            fronts[name] = _method(axes, own, style)
    _time_error_frame(axes, result, at, [100 * s.error for s in drawn if s.error and s.online_s])
    written = {name: textwrap.fill(name, NAME_LENGTH) for name in fronts}
    labels = [Label(written[n], styles(result)[n].colour, _anchors(line)) for n, line in fronts.items() if len(line)]
    faint = [(s.online_s, 100 * s.error) for s in drawn if s.error is not None and s.online_s is not None]
    place_labels(figure, axes, labels, [*(point for line in fronts.values() for point in _along(line)), *faint])
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
    figure, axes = panels_of([max(3.5, 0.4 * len(lines) + 0.5) for lines in panels.values()])
    for each, (axis, lines) in zip(axes, panels.items(), strict=True):
        _convergence(each, result, axis, lines)
        uncertainty_band(each, uncertainty(result, at))
    return figure


def indicator_figure(result: StudyResult) -> Figure | None:
    """A model's own prediction of its error against its error, every run."""
    pairs = indicators(result)
    if pairs.empty:
        return None
    coefficient, runs = rank_correlation(pairs)
    figure, axes = single(4.6)
    axes.set(xscale="log", yscale="log")
    for name, found in pairs[(pairs.indicator > 0) & (pairs.error > 0)].groupby("method", sort=False):
        axes.plot(
            100 * found.indicator, 100 * found.error, linestyle="None", **marks(styles(result)[str(name)]), label=name
        )
    line = axes.dataLim.intervalx if axes.has_data() else (1.0, 1.0)
    axes.plot(line, line, color=LINE, lw=1, label="equal", zorder=0)
    size = "unknown" if coefficient is None else f"{coefficient:.2f}"
    axes.set_title(f"Spearman's rank correlation {size}, {runs} runs", fontsize=11, loc="left")
    axes.set_xlabel("indicator: the model's own prediction of its error")
    axes.set_ylabel(error_label(result))
    percent_axis(axes.xaxis)
    percent_axis(axes.yaxis)
    axes.legend(frameon=False, fontsize=9)
    return figure


def along_figure(result: StudyResult, axis: str) -> Figure:
    """Error, largest displacements and forces, and losses of contact, along one of the scene's axes."""
    tables = [table for table in tables_along(result, axis) if table.quantity in DRAWN]
    figure, panels = panels_of([3.2] * len(tables), sharex=True)
    for axes, table in zip(panels, tables, strict=True):
        label, scale = DRAWN[table.quantity]
        for name, style in styles(result).items():
            if name in table.frame.index:
                heights = scale * table.frame.loc[name]
                axes.plot(heights.index, heights, style.line, **marks(style), label=name)
        axes.grid(color=GRID)
        if table.quantity == "error":
            axes.set_yscale("log")
            axes.set_ylabel(error_label(result))
            percent_axis(axes.yaxis)
        else:
            axes.set_ylabel(f"{label}\n{table.contact}")
            axes.yaxis.set_major_locator(MaxNLocator(integer=table.quantity == "inner_losses"))
    value_axis(panels[-1], axis, [float(value) for value in tables[-1].frame.columns])
    legend_below(figure, panels)
    return figure


def _method(axes: Axes, own: Sequence[Setting], style: Style) -> np.ndarray:
    """Draw one method's settings; its front as (k, 2) of time [s] and error [%]."""
    known = np.array([(s.online_s, 100 * s.error) for s in own if s.error is not None]).reshape(-1, 2)
    line = np.array([(s.online_s, 100 * s.error) for s in front(own) if s.error is not None]).reshape(-1, 2)
    axes.plot(*known.T, style.marker, color=style.colour, ms=5, mew=0, alpha=0.28, zorder=3)
    axes.plot(*line.T, "-", marker=style.marker, color=style.colour, lw=2.0, ms=8, mec="white", mew=0.9, zorder=5)
    gaps(axes, [s.online_s for s in own if s.error is None and s.online_s], style)
    return line


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
    uncertainty_band(axes, own)
    lowest, highest = axes.get_ylim()
    for height in [100 * tolerance for tolerance in result.study.tolerances if lowest < 100 * tolerance < highest]:
        axes.axhline(height, color=LINE, lw=0.8, zorder=1)
        note(axes, f"{height:g} %", (1.0, height), axes.get_yaxis_transform(), (4, 0), va="center")
    for time in [s.online_s for s in references(result) if s.method == REFERENCE and s.at == at and s.online_s]:
        axes.axvline(time, color="#000000", ls="--", lw=1, zorder=1)
        beside = {"rotation": 90, "ha": "right", "va": "top"}
        note(axes, "the reference itself", (time, 0.97), axes.get_xaxis_transform(), (-4, 0), **beside)
    axes.margins(x=0.08)
    axes.grid(color=GRID)
    axes.set_axisbelow(True)
    axes.set_xlabel("online time of one run, median", fontsize=11)
    seconds_axis(axes.xaxis)
    axes.set_ylabel(error_label(result), fontsize=11)
    axes.tick_params(labelsize=10)
    percent_axis(axes.yaxis)
    axes.set_title(_heading(result, at), fontsize=11, loc="left", pad=12)


def _heading(result: StudyResult, at: Mapping[str, Any]) -> str:
    failed = [setting for setting in settings_at(result, at) if setting.error is None]
    untimed = sum(setting.online_s is None for setting in failed)
    count = f"; × failed: {len(failed)}" if failed else ""
    hidden = f", {untimed} of them not shown: without a time" if untimed else ""
    return f"Lower left is better. Faint: every setting{count}{hidden}"


def _convergence(axes: Axes, result: StudyResult, axis: str, lines: Sequence[Series]) -> None:
    for line in lines:
        style = styles(result)[line.method]
        heights = [np.nan if error is None else 100 * error for error in line.errors]
        axes.plot(line.values, heights, style.line, **marks(style), label=_series_label(line))
        gaps(axes, [value for value, error in zip(line.values, line.errors, strict=True) if error is None], style)
    axes.set_yscale("log")
    axes.set_ylabel(error_label(result))
    axes.grid(color=GRID)
    percent_axis(axes.yaxis)
    value_axis(axes, axis, [value for line in lines for value in line.values])
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))


def _series_label(line: Series) -> str:
    """Method, its other fields, and the observed orders below them."""
    fixed = f" ({words(line.fixed_setting)})" if line.fixed_setting else ""
    orders = _order_words([order for order in line.orders if order is not None])
    return "\n".join(textwrap.fill(each, LABEL_LENGTH) for each in (f"{line.method}{fixed}", orders) if each)


def _order_words(orders: Sequence[float]) -> str:
    if len(orders) > MOST_ORDERS:
        return f"order {min(orders):.1f} to {max(orders):.1f}, median {np.median(orders):.1f}"
    return f"order {', '.join(f'{order:.1f}' for order in orders)}" if orders else ""
