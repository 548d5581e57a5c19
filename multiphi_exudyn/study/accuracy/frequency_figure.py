"""A study's picture of frequencies: the levels' own and the repetition rate along the axis, and window by window."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from multiphi_exudyn.study.accuracy.analysis import REFERENCE, StudyResult, is_number
from multiphi_exudyn.study.accuracy.direct_labels import Label, place_labels
from multiphi_exudyn.study.accuracy.figure_style import (
    COLOURS,
    GRID,
    LINE,
    WIDE,
    marks,
    panels_of,
    percent_axis,
    styles,
)
from multiphi_exudyn.study.accuracy.frequency_changes import (
    OPEN,
    Mode,
    Shown,
    asked_of,
    axis_of,
    rate_uncertainty,
    shown_of,
    values_of,
)
from multiphi_exudyn.study.accuracy.frequency_findings import SAME, value_words
from multiphi_exudyn.study.comparison.plots import CONTACT

__all__ = ["frequency_figure"]

BEYOND = 10.0  # times the largest number: where a value that is a word stands on a logarithmic axis
DARKEST, BRIGHTEST = 0.0, 0.85  # of the colour map: yellow is hard to see on white
BETWEEN = 20  # points of a piece of line that labels keep clear of
AGAINST = {"rise": "above the run's own free one", "change": "against the ideal run's"}
DASHES = ("-", "--", "-.", ":")  # of the levels


def frequency_figure(result: StudyResult) -> Figure | None:
    """Shifts of the levels, where there are any; of the repetition rate the early rise, the change and the course."""
    everything = shown_of(result)
    own = [shown for shown in everything if shown.method == REFERENCE]
    if not own:
        return None
    moved = any(abs(shift) > SAME for shown in own for shift in shown.shifts.values())
    figure, panels = panels_of([4.0] * moved + [3.2, 2.4, 3.6])
    for axes in panels:
        axes.grid(color=GRID)
        percent_axis(axes)
    if moved:
        _levels(figure, panels[0], result, own)
    _along(panels[-3], result, everything, "rise")
    _along(panels[-2], result, own, "change")
    _course(panels[-1], result, own)
    return figure


def _levels(figure: Figure, axes: Axes, result: StudyResult, own: Sequence[Shown]) -> None:
    """Shift of every mode of every level along the axis."""
    places = _places(values_of(result))
    labels, obstacles = [], []
    for (level, number), line in _lines(own, places).items():
        colour = COLOURS[(number - 1) % len(COLOURS)]
        style = DASHES[list(own[0].natural).index(level) % len(DASHES)]
        axes.plot(*zip(*line, strict=True), style, color=colour, marker="o", ms=4)
        obstacles += [point for ends in pairwise(line) for point in _between(*ends)]
        if max(abs(y) for _, y in line) > 100 * SAME:
            labels.append(Label(f"{'free' if level == OPEN else level} {number}", colour, line))
    axes.set_ylabel("natural frequencies of the levels\nagainst the ideal ones")
    _value_axis(axes, axis_of(result), places)
    place_labels(figure, axes, labels, obstacles)


def _between(one: tuple[float, float], two: tuple[float, float]) -> list[tuple[float, float]]:
    """Points along a straight piece of a line, in logarithmic steps where it has no zero."""
    steps = np.linspace(0, 1, BETWEEN)
    places = one[0] * (two[0] / one[0]) ** steps if one[0] * two[0] > 0 else one[0] + (two[0] - one[0]) * steps
    return [(float(x), float(y)) for x, y in zip(places, one[1] + (two[1] - one[1]) * steps, strict=True)]


def _lines(own: Sequence[Shown], places: Mapping[Any, float]) -> dict[Mode, list[tuple[float, float]]]:
    """Mode -> points of its line, shifts in %."""
    lines: dict[Mode, list[tuple[float, float]]] = {}
    for shown in own:
        for mode, shift in shown.shifts.items():
            lines.setdefault(mode, []).append((places[shown.value], 100 * shift))
    return {mode: sorted(line) for mode, line in lines.items()}


def _along(axes: Axes, result: StudyResult, everything: Sequence[Shown], quantity: str) -> None:
    """Mean of the first windows along the axis; grey: no larger than the reference's own uncertainty."""
    early, places = asked_of(result).early, _places(values_of(result))
    for name, style in styles(result).items():
        found = {places[s.value]: s.mean(quantity, early) for s in everything if s.method == name}
        if found:
            x, y = zip(*sorted(found.items()), strict=True)
            drawn = marks(style) | ({"marker": "s"} if name == REFERENCE else {})
            axes.plot(x, [math.nan if each is None else 100 * each for each in y], style.line, **drawn, label=name)
    own = 100 * (rate_uncertainty(result) or 0.0)
    axes.axhspan(-own, own, color=CONTACT, lw=0, zorder=0)
    axes.set_ylabel(f"repetition rate, first {early:g} s,\n{AGAINST[quantity]}")
    _value_axis(axes, axis_of(result), places)
    _legend(axes)


def _course(axes: Axes, result: StudyResult, own: Sequence[Shown]) -> None:
    """The reference's rise in every window, one line per value."""
    shades = colormaps["viridis"](np.linspace(DARKEST, BRIGHTEST, len(own)))
    for shown, shade in zip(own, shades, strict=True):
        edges = [0.0, *(window.end for window in shown.windows)]
        heights = [math.nan if w.rise is None else 100 * w.rise for w in shown.windows]
        axes.stairs(heights, edges, baseline=None, color=to_hex(shade), lw=2, label=value_words(shown.value))
    axes.axhline(0.0, color=LINE, lw=1, zorder=1)
    axes.set_ylabel(f"repetition rate, reference,\n{AGAINST['rise']}")
    axes.set_xlabel("time [s], window by window")
    axes.set_xlim(left=0.0)
    _legend(axes, axis_of(result).rpartition(".")[-1])


def _legend(axes: Axes, title: str | None = None) -> None:
    axes.legend(frameon=False, fontsize=8, title=title, title_fontsize=8, loc="center left", bbox_to_anchor=(1.01, 0.5))


def _places(values: Sequence[Any]) -> dict[Any, float]:
    """Value -> its place on the axis; words stand behind the largest number."""
    last = max((value for value in values if is_number(value)), default=1.0)
    return {value: float(value) if is_number(value) else BEYOND * last for value in values}


def _value_axis(axes: Axes, axis: str, places: Mapping[Any, float]) -> None:
    """Logarithmic where the values are far apart, ticks at the values themselves."""
    if min(places.values()) > 0 and max(places.values()) / min(places.values()) >= WIDE:
        axes.set_xscale("log")
        axes.set_xticks([], minor=True)
    axes.set_xticks(list(places.values()), [value_words(value) for value in places])
    axes.set_xlabel(axis)
