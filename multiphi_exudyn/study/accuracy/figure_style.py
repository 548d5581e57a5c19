"""How a study's pictures look: one colour and one marker per method, axes in percent, marks of failures.

Colours are Okabe and Ito's colour-blind-safe set; full models are black and grey, the reference and its coarser copy
lines without marks. Grey bands: errors below the reference's own uncertainty.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter
from matplotlib.transforms import Transform

from multiphi_exudyn.study.accuracy.along_axis import FINEST
from multiphi_exudyn.study.accuracy.analysis import full_methods, names_of, settings
from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE
from multiphi_exudyn.study.accuracy.study_result import StudyResult
from multiphi_exudyn.study.comparison.plots import CONTACT, RESOLUTION, WIDTH
from multiphi_exudyn.study.comparison.wording import seconds

__all__ = [
    "COLOURS",
    "GRID",
    "LINE",
    "NOTE",
    "WIDE",
    "Style",
    "error_label",
    "gaps",
    "legend_below",
    "marks",
    "note",
    "panels_of",
    "percent_axis",
    "seconds_axis",
    "single",
    "styles",
    "uncertainty_band",
    "value_axis",
]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9", "#7F3C8D", "#E69F00")
MARKERS = ("o", "D", "^", "v", "<", ">", "p", "h")
FULL_COLOURS = ("#000000", "#7A7A7A", "#4D4D4D")
FULL_MARKERS = ("s", "P", "X")
GRID, LINE, NOTE = "#EEEEEE", "#B0B0B0", "#555555"
FIELD_LABELS = {"modes": "modes r"}
MOST_TICKS = 10
WIDE = 10.0  # ratio of largest to smallest value from which an axis is logarithmic


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


def single(height: float) -> tuple[Figure, Axes]:
    """One panel of a given height [inches]."""
    figure, axes = panels_of([height])
    return figure, axes[0]


def panels_of(heights: Sequence[float], sharex: bool = False) -> tuple[Figure, list[Axes]]:
    """Panels of given heights [inches] under each other."""
    figure = Figure(figsize=(WIDTH, sum(heights)), dpi=RESOLUTION, layout="constrained")
    FigureCanvasAgg(figure)
    axes = list(figure.subplots(len(heights), 1, squeeze=False, sharex=sharex, height_ratios=heights)[:, 0])
    for each in axes:
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def marks(style: Style) -> dict[str, Any]:
    """A method's marker as keywords of a plot."""
    return {"marker": style.marker, "color": style.colour, "ms": 6.5, "mec": "white", "mew": 0.7}


def gaps(axes: Axes, places: Sequence[float], style: Style) -> None:
    """Crosses on the upper edge."""
    if places:
        edge: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(places, np.ones(len(places)), "x", color=style.colour, ms=7, mew=1.8, zorder=6, **edge)


def uncertainty_band(axes: Axes, own: float | None) -> None:
    """Errors that the reference cannot tell from none."""
    if own:
        lowest, highest = axes.get_ylim()
        axes.axhspan(min(lowest, 100 * own) / 1e3, 100 * own, color=CONTACT, lw=0, zorder=0)
        axes.set_ylim(min(lowest, 50 * own), max(highest, 200 * own))
        note(axes, "grey: below the reference's own uncertainty", (0.01, 0.0), axes.transAxes, (0, 4), va="bottom")


def note(
    axes: Axes, text: str, at: tuple[float, float], system: Transform, offset: tuple[float, float], **placing: Any
) -> None:
    """A remark at a point of a coordinate system, ``offset`` in points."""
    shift: dict[str, Any] = {"xytext": offset, "textcoords": "offset points", "color": NOTE, "fontsize": 9}
    axes.annotate(text, at, xycoords=system, **shift, **placing)


class _Worded(LogFormatter):
    """Ticks of a logarithmic axis in words, between its decades too where these are few."""

    def __init__(self, word: Callable[[float], str]) -> None:
        super().__init__()
        self.word = word

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.word(x) if super().__call__(x, pos) else ""


def percent_axis(axis: Axis) -> None:
    """Values of a logarithmic axis that are percents already, written as such."""
    _write(axis, lambda value: f"{value:g} %")


def seconds_axis(axis: Axis) -> None:
    """Values of a logarithmic axis in s, with the units that read best."""
    _write(axis, seconds)


def _write(axis: Axis, word: Callable[[float], str]) -> None:
    axis.set_major_formatter(_Worded(word))
    axis.set_minor_formatter(_Worded(word))


def value_axis(axes: Axes, axis: str, values: Sequence[float]) -> None:
    """The values themselves as ticks; logarithmic where they are far apart."""
    ticks = sorted(set(values))
    if ticks[0] > 0 and (axis in FINEST or ticks[-1] / ticks[0] >= WIDE):
        axes.set_xscale("log")
    shown = ticks[:: -(-len(ticks) // MOST_TICKS)]
    axes.set_xticks(shown, [seconds(tick) if axis == "step" else f"{tick:g}" for tick in shown])
    axes.set_xticks([], minor=True)
    axes.set_xlabel(FIELD_LABELS.get(axis, axis))


def error_label(result: StudyResult) -> str:
    """Which error an axis shows."""
    return f"NRMSE to {result.window:g} s\nworst of {', '.join(result.judged_points)}"


def legend_below(figure: Figure, panels: Sequence[Axes]) -> None:
    """One for all panels."""
    found = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=3, fontsize=9, frameon=False)
