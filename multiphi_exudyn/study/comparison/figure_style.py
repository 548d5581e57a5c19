"""Style of the figures in reports, and their encoding for a page.

Colours are Okabe and Ito's colour-blind-safe set, one for each model in all pictures of a page; references and full
models are black and grey. Functions that draw use ``@rc_context(STYLE)``.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter
from matplotlib.typing import LineStyleType

from multiphi_exudyn.study.comparison.wording import seconds

__all__ = [
    "BAND",
    "COLOURS",
    "FULL",
    "LINE",
    "NOTE",
    "REFERENCE",
    "STYLE",
    "WIDTH",
    "Style",
    "data_uri",
    "legend_below",
    "milliseconds_axis",
    "note",
    "panels",
    "percent_axis",
    "png",
    "seconds_axis",
    "uncertainty_band",
]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#8A6D00", "#56B4E9", "#7F3C8D", "#E69F00")
REFERENCE, FULL = "#000000", "#7A7A7A"
BAND, LINE, NOTE = "#E3E3E3", "#B0B0B0", "#555555"
WIDTH = 9.2  # inches
STYLE: Any = {  # rcParams
    "figure.dpi": 120,
    "figure.constrained_layout.use": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "grid.color": "#EEEEEE",
    "legend.frameon": False,
    "legend.fontsize": 8,
}


@dataclass(frozen=True)
class Style:
    """Colour, marker, line style and line width [points] of one model."""

    colour: str
    marker: str
    line: LineStyleType = "-"
    width: float = 1.5

    @property
    def lines(self) -> dict[str, Any]:
        """Keywords of a plot with a line and no markers."""
        return {"color": self.colour, "ls": self.line, "lw": self.width}

    @property
    def marks(self) -> dict[str, Any]:
        """Keywords of a plot with markers and no line."""
        return {"color": self.colour, "ls": "None", "marker": self.marker, "ms": 6.5, "mec": "white", "mew": 0.7}


def panels(heights: Sequence[float], sharex: bool = False) -> tuple[Figure, list[Axes]]:
    """A figure with panels of these heights [inches], one below the other."""
    figure = Figure(figsize=(WIDTH, sum(heights)))
    return figure, list(figure.subplots(len(heights), 1, squeeze=False, sharex=sharex, height_ratios=heights)[:, 0])


def png(figure: Figure) -> bytes:
    """Return the figure as a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def data_uri(figure: Figure) -> str:
    """Return the figure as a data URI for a page."""
    return f"data:image/png;base64,{base64.b64encode(png(figure)).decode('ascii')}"


def note(axes: Axes, text: str, at: tuple[float, float], **placing: Any) -> None:
    """Write a remark at a position in axes fractions, or in the coordinates given in ``placing``."""
    axes.annotate(text, at, fontsize=8, color=NOTE, **{"xycoords": "axes fraction"} | placing)


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3, **more: Any) -> None:
    """Draw one legend for all panels, each label once."""
    handles = {label: handle for each in axes for handle, label in zip(*each.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns, **more)


def uncertainty_band(axes: Axes, own: float | None) -> None:
    """Grey band of errors [%] below the reference's own uncertainty ``own`` (a fraction)."""
    if own:
        lowest, highest = axes.get_ylim()
        axes.axhspan(min(lowest, 100 * own) / 1e3, 100 * own, color=BAND, lw=0, zorder=0)
        axes.set_ylim(min(lowest, 50 * own), max(highest, 200 * own))
        note(axes, "grey: below the reference's own uncertainty", (0.01, 0.01), va="bottom")


def percent_axis(axis: Axis) -> None:
    """Write the values [%] of a logarithmic axis with their unit."""
    _set_formatter(axis, lambda value: f"{value:g} %")


def milliseconds_axis(axes: Axes) -> None:
    """Write the times [s] of a linear x axis in ms."""
    axes.xaxis.set_major_formatter(lambda value, _: f"{1e3 * value:g}")
    axes.set_xlabel("time [ms]")


def seconds_axis(axis: Axis) -> None:
    """Write the times [s] of a logarithmic axis in µs, ms or s."""
    _set_formatter(axis, seconds)


class _TextFormatter(LogFormatter):
    """Tick labels of a logarithmic axis, also between the decades where these are few."""

    def __init__(self, text: Callable[[float], str]) -> None:
        super().__init__()
        self.text = text

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.text(x) if super().__call__(x, pos) else ""


def _set_formatter(axis: Axis, text: Callable[[float], str]) -> None:
    axis.set_major_formatter(_TextFormatter(text))
    axis.set_minor_formatter(_TextFormatter(text))
