"""The picture of error budgets, from their stored values: parts, their uncertainties, and the total.

One panel per budget; in it, for each window and each ladder, a group of bars: the size of every part on a logarithmic
axis with a whisker of its uncertainty, the total as a line across the group, and above it each part's share. A pale
bar is no larger than its uncertainty. Colours by cause, from the colour-blind-safe set of all pictures; grey: the
joined causes on both sides of a missing rung.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.accuracy.budget import CAUSES, Budget
from multiphi_exudyn.study.comparison.plots import COLOURS, FULL, REFERENCE, RESOLUTION, WIDTH

__all__ = ["budget_figure"]

PANEL_HEIGHT = 3.0  # inches
COLUMNS = 2  # of panels, where there are several
PALE = 0.35  # opacity of a bar no larger than its uncertainty
FLOOR = 1e-13  # of ||y_ref||: round-off; smaller bars lie below the picture
HIGHEST = 50.0  # of ||y_ref||: room for shares and causes above the largest differences
LINE_LENGTH = 110  # characters of a missing rung's cause
COLOUR_OF = dict(zip(CAUSES, COLOURS, strict=False))


@dataclass(frozen=True)
class Group:
    """The bars of one window and ladder, from ``left`` on, one unit apart."""

    until: str
    ladder: str
    left: float
    content: Mapping[str, Any]

    @property
    def middle(self) -> float:
        return self.left + (len(self.content["parts"]) - 1) / 2


def budget_figure(budgets: Mapping[str, Any] | Budget | Sequence[Mapping[str, Any] | Budget]) -> Figure:
    """Panels of one or several budgets, given as such or as their values."""
    given = [budgets] if isinstance(budgets, (Mapping, Budget)) else list(budgets)
    if not given:
        raise MultiPhiValueError("budgets: got none, need at least one")
    values = [each.values() if isinstance(each, Budget) else each for each in given]
    columns = min(COLUMNS, len(values))
    rows = math.ceil(len(values) / columns)
    figure = Figure(
        figsize=(WIDTH * (1 + columns) / 2, PANEL_HEIGHT * rows + 0.6), dpi=RESOLUTION, layout="constrained"
    )
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    for axes, each in zip(panels, values, strict=False):
        _panel(axes, each)
        if axes.get_subplotspec().is_first_col():
            axes.set_ylabel("difference [% of the reference]", fontsize=9)
    for axes in panels[len(values) :]:
        axes.set_visible(False)
    _legend(figure, values)
    return figure


def _groups(values: Mapping[str, Any]) -> Iterator[Group]:
    left = 0.0
    for until, ladders in values["windows"].items():
        for ladder, contents in ladders.items():
            if contents["all"] is not None:
                yield Group(until, ladder, left, contents["all"])
                left += len(contents["all"]["parts"]) + 1


def _panel(axes: Axes, values: Mapping[str, Any]) -> None:
    groups = list(_groups(values))
    for group in groups:
        _bars(axes, group)
    axes.set_yscale("log")
    axes.set_ylim(100 * FLOOR, 100 * HIGHEST)
    axes.set_xticks(
        [group.middle for group in groups], [f"{g.ladder} contacts\nto {g.until} s" for g in groups], fontsize=8
    )
    axes.tick_params(axis="x", length=0)
    axes.tick_params(axis="y", labelsize=8)
    axes.set_title(_title(values), fontsize=10)
    axes.grid(axis="y", color="#EEEEEE")
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    missing = _missing(values)
    if missing:
        axes.text(0.01, 0.99, missing, transform=axes.transAxes, fontsize=7, va="top", color="#444444")


def _bars(axes: Axes, group: Group) -> None:
    for i, part in enumerate(group.content["parts"]):
        x, size, uncertainty = group.left + i, part["size"], part["uncertainty"]
        opacity = PALE if part["significant"] is False else 1.0
        colour = COLOUR_OF.get(part["cause"], FULL)
        axes.bar(x, 100 * max(size, FLOOR), bottom=0, width=0.8, color=colour, alpha=opacity, lw=0)
        if uncertainty is not None:
            ends = 100 * np.array([max(size - uncertainty, FLOOR), max(size + uncertainty, FLOOR)])
            axes.plot([x, x], ends, color=REFERENCE, lw=0.9)
            axes.plot([x - 0.15, x + 0.15], [ends[1]] * 2, color=REFERENCE, lw=0.9)
        if part["share"] is not None:
            share = f"{percent:+d}" if (percent := round(100 * part["share"])) else "0"
            top = max(100 * group.content["total"], 100 * (size + (uncertainty or 0.0)))
            axes.annotate(share, (x, top), (0, 3), textcoords="offset points", ha="center", fontsize=6.5)
    ends = np.array([-0.5, len(group.content["parts"]) - 0.5])
    axes.plot(group.left + ends, [100 * group.content["total"]] * 2, color=REFERENCE, lw=1.4, ls="--")


def _title(values: Mapping[str, Any]) -> str:
    start = values["start"]
    size = f"{1e3 * start['displacement']:+g} mm" if "displacement" in start else f"{start['force']:+g} N"
    return f"{values['scene']}, {size}, r = {values['modes']}"


def _missing(values: Mapping[str, Any]) -> str:
    """One line for each rung that failed, with its cause."""
    failed = [rung for rung in values["rungs"].values() if rung["status"] != "ok"]
    return "\n".join(
        textwrap.shorten(f"missing: {r['label']}: {r['message']}", LINE_LENGTH, placeholder=" …") for r in failed
    )


def _legend(figure: Figure, values: Sequence[Mapping[str, Any]]) -> None:
    shown = {part["cause"] for each in values for group in _groups(each) for part in group.content["parts"]}
    handles: list[Any] = [Patch(color=COLOUR_OF[cause], label=cause) for cause in CAUSES if cause in shown]
    handles += [Patch(color=FULL, label=cause) for cause in sorted(shown - set(CAUSES))]
    handles.append(
        Line2D(
            [], [], color=REFERENCE, ls="--", lw=1.4, label="total, full beam to user object; above: shares of it [%]"
        )
    )
    handles.append(Line2D([], [], color=REFERENCE, lw=0.9, marker="_", label="uncertainty; pale: larger than the part"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
