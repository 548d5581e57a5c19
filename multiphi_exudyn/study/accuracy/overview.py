"""All points of a scene's axes at once: each setting over all of them, and what the reference does along the axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multiphi_exudyn.study.accuracy.along_axis import numeric_axes
from multiphi_exudyn.study.accuracy.analysis import references, settings, words
from multiphi_exudyn.study.accuracy.figure_style import GRID, value_axis
from multiphi_exudyn.study.accuracy.study_file import REFERENCE
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.comparison.plots import RESOLUTION, WIDTH

__all__ = ["over_all_points", "response_figure"]

BRIGHTEST = 0.85  # of the colour map: yellow is hard to see on white
MOST_COLUMNS, MOST_ROWS = 4, 4  # panels
DRAWN: dict[str, tuple[str, float]] = {
    "largest": ("largest displacement\n{} [mm]", 1e3),
    "largest_force": ("largest force\n{} [N]", 1.0),
}


def over_all_points(result: StudyResult) -> pd.DataFrame:
    """Of each setting, method by method: points with an error, its median and largest, and the median time [s]."""
    cells = [(s.method, words(s.setting) or "–", s.error, s.online_s) for s in settings(result)]
    frame = pd.DataFrame(cells, columns=["method", "setting", "error", "online_s"])
    frame = frame.astype({"error": float, "online_s": float})
    of_setting = frame.groupby(["method", "setting"], sort=False)
    return of_setting.agg(
        points=("error", "count"), median=("error", "median"), worst=("error", "max"), online_s=("online_s", "median")
    ).reset_index()


def response_figure(result: StudyResult) -> Figure | None:
    """Largest displacements and forces of the reference along two or three axes; None for fewer, or without any.

    The first axis is drawn along, lines are values of the second, columns of the third; others at their first value.
    """
    runs = [setting for setting in references(result) if setting.method == REFERENCE]
    axes = numeric_axes(runs, of_scene=True)
    rows = _quantities(result, runs)[:MOST_ROWS]
    if len(axes) < 2 or not rows:
        return None
    frame = pd.DataFrame(
        [{**run.at, **{".".join(row): run.values.get(row[0], {}).get(row[1]) for row in rows}} for run in runs]
    )
    for axis in axes[3:]:
        frame = frame[frame[axis] == frame[axis].iloc[0]]
    columns: list[tuple[Any, pd.DataFrame]] = (
        list(frame.groupby(axes[2]))[:MOST_COLUMNS] if len(axes) > 2 else [(None, frame)]
    )
    figure = Figure(figsize=(WIDTH, 2.3 * len(rows) + 0.9), dpi=RESOLUTION, layout="constrained")
    grid = figure.subplots(len(rows), len(columns), squeeze=False, sharex=True, sharey="row")
    for panels, row in zip(grid, rows, strict=True):
        for panel, (value, part) in zip(panels, columns, strict=True):
            _panel(panel, part, axes, row)
            if row is rows[0] and value is not None:
                panel.set_title(f"{axes[2]} = {value:g}", fontsize=9)
        label, _ = DRAWN[row[0]]
        panels[0].set_ylabel(label.replace("{}", row[1]), fontsize=9)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, title=axes[1], loc="outside lower center", ncols=6, fontsize=9, frameon=False)
    return figure


def _quantities(result: StudyResult, runs: Sequence[Setting]) -> list[tuple[str, str]]:
    """Quantity and name of the point or contact, of those that a run has."""
    known: Mapping[str, Mapping[str, float]] = next((run.values for run in runs if run.values), {})
    points = [("largest", point) for point in result.judged_points if point in known.get("largest", {})]
    return points + [("largest_force", contact) for contact in known.get("largest_force", {})]


def _panel(panel: Axes, part: pd.DataFrame, axes: Sequence[str], row: tuple[str, str]) -> None:
    _, scale = DRAWN[row[0]]
    table = scale * part.pivot_table(".".join(row), axes[0], axes[1], dropna=False).astype(float)
    for shade, value in zip(colormaps["viridis"](np.linspace(0, BRIGHTEST, table.shape[1])), table, strict=True):
        panel.plot(table.index, table[value], color=shade, marker="o", ms=4, lw=1.5, label=f"{value:g}")
    panel.grid(color=GRID)
    panel.spines[["top", "right"]].set_visible(False)
    value_axis(panel, axes[0], [float(value) for value in table.index])
    panel.label_outer()
