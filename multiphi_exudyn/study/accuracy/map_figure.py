"""Time-frequency maps of the reference and of a reduced model side by side, one row per point.

Amplitudes in dB, 20 log10(a / a_max), down to -60, a_max being the larger of a row's two maxima, so that equal colours
mean equal amplitudes. Hatched: the cone of influence, where the ends of the record show. Strip on top: in contact.
"""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from multiphi_exudyn.study.accuracy.study_result import Intervals, MapPair
from multiphi_exudyn.study.comparison.figure_style import FULL, STYLE, WIDTH, legend_below
from multiphi_exudyn.study.measures.spectra import Map

__all__ = ["map_figure"]

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
