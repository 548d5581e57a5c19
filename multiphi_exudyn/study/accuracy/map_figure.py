"""Time-frequency maps of the reference and of a reduced model side by side, one row per point.

Amplitudes in dB, 20 log10(a / a_max), down to -60, a_max being the larger of a row's two maxima, so that equal colours
mean equal amplitudes. Hatched: the cone of influence, where the ends of the record show. Strip on top: in contact.
"""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from multiphi_exudyn.study.accuracy.study_result import Intervals, MapPair
from multiphi_exudyn.study.comparison.plots import RESOLUTION, WIDTH
from multiphi_exudyn.study.measures.spectra import Map

__all__ = ["map_figure"]

LOWEST = -60.0  # dB
LEVEL_COLOURS = (("#FFFFFF", "#000000"), ("#E69F00", "#B87A00"), ("#CC79A7", "#A0417C"))  # of line and of text
APART = 0.035  # heights of the axes between two values that stand beside a map
LINE_LENGTH = 48  # characters of a title
STRIP = (1.015, 0.035)  # bottom and height, in heights of the axes


def map_figure(pairs: Sequence[MapPair]) -> Figure:
    """The maps of one reduced model."""
    figure = Figure(figsize=(WIDTH, 2.7 * len(pairs) + 0.7), dpi=RESOLUTION, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(len(pairs), 2, squeeze=False, sharex=True, sharey=True)
    for row, pair in zip(grid, pairs, strict=True):
        most = max(float(np.max(pair.full.amplitude)), float(np.max(pair.reduced.amplitude))) or 1.0
        mesh = _map(row[0], pair.full, most, pair.full_contacts)
        _map(row[1], pair.reduced, most, pair.reduced_contacts)
        row[0].set_ylabel(f"{pair.point}: frequency [Hz]")
        for axes in row:
            _levels(axes, pair.frequencies, pair.full, named=axes is grid[0, 1])
    for axes, title in zip(grid[0], ("the reference", pairs[0].label), strict=True):
        axes.set_title(textwrap.fill(title, LINE_LENGTH), fontsize=10, pad=12)
    for axes in grid[-1]:
        axes.set_xlabel("time [s]")
    figure.colorbar(mesh, ax=list(grid[:, 1]), label="amplitude [dB of the point's largest]", shrink=0.8)
    return figure


def _map(axes: Axes, drawn: Map, most: float, contacts: Intervals) -> QuadMesh:
    decibels = 20 * np.log10(np.maximum(drawn.amplitude / most, 10 ** (LOWEST / 20)))
    mesh = axes.pcolormesh(
        drawn.time, drawn.frequencies, decibels, vmin=LOWEST, vmax=0, cmap="cividis", rasterized=True
    )
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    start, end = drawn.time[0], drawn.time[-1]
    cone = np.minimum(drawn.cone, (end - start) / 2)
    for edge, inside in ((start, start + cone), (end, end - cone)):
        axes.fill_betweenx(drawn.frequencies, edge, inside, fc="#BBBBBB", ec="#FFFFFF", alpha=0.3, hatch="///", lw=0)
    bars = [(closed, opened - closed) for closed, opened in contacts]
    axes.broken_barh(bars, STRIP, transform=axes.get_xaxis_transform(), color="#7A7A7A", lw=0, clip_on=False)
    axes.set_xlim(start, end)
    axes.set_ylim(drawn.frequencies[0], drawn.frequencies[-1])
    return mesh


def _levels(axes: Axes, frequencies: Mapping[str, Sequence[float]], drawn: Map, named: bool) -> None:
    """Natural frequencies of each level as dashed lines; their values stand beside one of the maps."""
    lowest, highest = drawn.frequencies[0], drawn.frequencies[-1]
    taken: list[float] = []
    for (level, values), (colour, dark) in zip(frequencies.items(), itertools.cycle(LEVEL_COLOURS), strict=False):
        inside = [value for value in values if lowest <= value <= highest]
        for i, value in enumerate(inside):
            axes.axhline(value, color=colour, ls=(0, (4, 4)), lw=0.9)
            height = math.log(value / lowest) / math.log(highest / lowest)
            if named and all(abs(height - other) > APART for other in taken):
                taken.append(height)
                name = f"{level} {value:.3g}" if i == 0 else f"{value:.3g}"
                axes.text(1.01, height, name, color=dark, va="center", fontsize=7.5, transform=axes.transAxes)
