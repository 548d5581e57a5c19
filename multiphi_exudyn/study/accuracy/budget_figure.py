"""The picture of error budgets, from their stored values: parts, their uncertainties, and the total.

One panel per budget; in it, for each window and each ladder, a group of bars: the size of every part on a logarithmic
axis with a whisker of its uncertainty and its share above, the total as a line across the group. A pale bar is no
larger than its uncertainty. Colours by cause; grey: the joined causes on both sides of a missing rung.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.accuracy.budget import CAUSES, Budget
from multiphi_exudyn.study.comparison.figure_style import COLOURS, FULL, NOTE, REFERENCE, STYLE, WIDTH

__all__ = ["budget_figure"]

PANEL_HEIGHT = 3.0  # inches
COLUMNS = 2  # of panels, where there are several
PALE = 0.35  # opacity of a bar no larger than its uncertainty
FLOOR = 1e-13  # of ||y_ref||: round-off; smaller bars lie below the picture
HIGHEST = 50.0  # of ||y_ref||: room for shares and causes above the largest differences
LINE_LENGTH = 110  # characters of a missing rung's cause
COLOUR_OF = dict(zip(CAUSES, COLOURS, strict=False))
ON_WHITE = {"facecolor": "white", "edgecolor": "none", "pad": 0.4}  # of a share that the line of the total crosses
TOTAL: dict[str, Any] = {"color": REFERENCE, "ls": "--", "lw": 1.4}


@rc_context(STYLE)
def budget_figure(budgets: Mapping[str, Any] | Budget | Sequence[Mapping[str, Any] | Budget]) -> Figure:
    """Panels of one or several budgets, given as such or as their values."""
    given = [budgets] if isinstance(budgets, (Mapping, Budget)) else list(budgets)
    if not given:
        raise MultiPhiValueError("budgets: got none, need at least one")
    values = [each.values() if isinstance(each, Budget) else each for each in given]
    columns = min(COLUMNS, len(values))
    rows = math.ceil(len(values) / columns)
    figure = Figure(figsize=(WIDTH * (1 + columns) / 2, PANEL_HEIGHT * rows + 0.6))
    panels = figure.subplots(rows, columns, sharey=True, squeeze=False).ravel()
    causes: set[str] = set()
    for axes, each in zip(panels, values, strict=False):
        causes |= _panel(axes, each)
    for axes in panels[len(values) :]:
        axes.set_visible(False)
    handles: list[Any] = [Patch(color=COLOUR_OF[cause], label=cause) for cause in CAUSES if cause in causes]
    handles += [Patch(color=FULL, label=cause) for cause in sorted(causes - set(CAUSES))]
    handles.append(Line2D([], [], **TOTAL, label="total, full beam to user object; above bars: shares of it [%]"))
    handles.append(Line2D([], [], color=REFERENCE, lw=0.9, marker="_", label="uncertainty; pale: larger than the part"))
    figure.legend(handles=handles, loc="outside lower center", ncols=3)
    return figure


def _panel(axes: Axes, values: Mapping[str, Any]) -> set[str]:
    """All groups of bars of one budget; the causes that are drawn."""
    left, places, causes = 0.0, {}, set[str]()
    for until, ladders in values["windows"].items():
        for ladder, groups in ladders.items():
            if groups["all"] is not None:
                parts = pd.DataFrame(groups["all"]["parts"])
                _bars(axes, left + np.arange(len(parts)), parts, groups["all"]["total"])
                places[left + (len(parts) - 1) / 2] = f"{ladder} contacts\nto {until} s"
                left += len(parts) + 1
                causes |= set(parts.cause)
    axes.set(yscale="log", ylim=(100 * FLOOR, 100 * HIGHEST), ylabel="difference [% of the reference]")
    axes.set_xticks(list(places), list(places.values()))
    axes.tick_params(axis="x", length=0)
    axes.tick_params(labelsize=8)
    axes.grid(visible=False, axis="x")
    axes.set_title(_title(values))
    axes.label_outer()
    axes.text(0.01, 0.99, _missing(values), transform=axes.transAxes, fontsize=7, va="top", color=NOTE)
    return causes


def _bars(axes: Axes, places: np.ndarray, parts: pd.DataFrame, total: float) -> None:
    heights = 100 * np.maximum(parts["size"], FLOOR)
    spread = 100 * parts.uncertainty.astype(float)
    whiskers = [np.minimum(spread, heights - 100 * FLOOR), spread]
    pairs = zip(parts.cause, parts.significant, strict=True)
    colours = [to_rgba(COLOUR_OF.get(cause, FULL), PALE if known is False else 1.0) for cause, known in pairs]
    bars = axes.bar(places, heights, 0.8, yerr=whiskers, color=colours, error_kw={"lw": 0.9, "capsize": 2})
    shares = [round(share) for share in 100 * parts.share.astype(float).fillna(0.0)]
    texts = [f"{share:+d}" if share else "0" for share in shares]
    axes.bar_label(bars, texts, padding=2, fontsize=6.5, bbox=ON_WHITE)
    axes.plot(places[[0, -1]] + [-0.5, 0.5], [100 * total] * 2, **TOTAL)


def _title(values: Mapping[str, Any]) -> str:
    start = values["start"]
    size = f"{1e3 * start['displacement']:+g} mm" if "displacement" in start else f"{start['force']:+g} N"
    return f"{values['scene']}, {size}, r = {values['modes']}"


def _missing(values: Mapping[str, Any]) -> str:
    """One line for each rung that failed, with its cause."""
    failed = [f"missing: {r['label']}: {r['message']}" for r in values["rungs"].values() if r["status"] != "ok"]
    return "\n".join(textwrap.shorten(each, LINE_LENGTH, placeholder=" …") for each in failed)
