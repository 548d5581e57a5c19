"""How the pictures of reports look, and how a page holds them.

Colours are Okabe and Ito's colour-blind-safe set, one for each model in all pictures of a page; references and full
models are black and grey. ``STYLE`` goes round whatever draws: ``@rc_context(STYLE)``.
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
    """How one model is drawn: its colour and marker, its line and the line's width [points]."""

    colour: str
    marker: str
    line: LineStyleType = "-"
    width: float = 1.5

    @property
    def lines(self) -> dict[str, Any]:
        """As keywords of a plot, without marks."""
        return {"color": self.colour, "ls": self.line, "lw": self.width}

    @property
    def marks(self) -> dict[str, Any]:
        """As keywords of a plot, without a line."""
        return {"color": self.colour, "ls": "None", "marker": self.marker, "ms": 6.5, "mec": "white", "mew": 0.7}


def panels(heights: Sequence[float], sharex: bool = False) -> tuple[Figure, list[Axes]]:
    """Panels of given heights [inches] under each other."""
    figure = Figure(figsize=(WIDTH, sum(heights)))
    return figure, list(figure.subplots(len(heights), 1, squeeze=False, sharex=sharex, height_ratios=heights)[:, 0])


def png(figure: Figure) -> bytes:
    """The figure as PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


def data_uri(figure: Figure) -> str:
    """The figure as a page holds it."""
    return f"data:image/png;base64,{base64.b64encode(png(figure)).decode('ascii')}"


def note(axes: Axes, text: str, at: tuple[float, float], **placing: Any) -> None:
    """A remark at a place in shares of the axes, or in the coordinates that ``placing`` names."""
    axes.annotate(text, at, fontsize=8, color=NOTE, **{"xycoords": "axes fraction"} | placing)


def legend_below(figure: Figure, axes: Sequence[Axes], columns: int = 3, **more: Any) -> None:
    """One for all panels, each label once."""
    found = {label: handle for each in axes for handle, label in zip(*each.get_legend_handles_labels(), strict=True)}
    figure.legend(found.values(), found.keys(), loc="outside lower center", ncols=columns, **more)


def uncertainty_band(axes: Axes, own: float | None) -> None:
    """Grey where errors [%] are smaller than the reference can tell; ``own``: its own uncertainty, a share."""
    if own:
        lowest, highest = axes.get_ylim()
        axes.axhspan(min(lowest, 100 * own) / 1e3, 100 * own, color=BAND, lw=0, zorder=0)
        axes.set_ylim(min(lowest, 50 * own), max(highest, 200 * own))
        note(axes, "grey: below the reference's own uncertainty", (0.01, 0.01), va="bottom")


def percent_axis(axis: Axis) -> None:
    """Values of a logarithmic axis that are percents already, written as such."""
    _write(axis, lambda value: f"{value:g} %")


def seconds_axis(axis: Axis) -> None:
    """Values of a logarithmic axis in s, with the units that read best."""
    _write(axis, seconds)


class _Worded(LogFormatter):
    """Ticks of a logarithmic axis in words, between its decades too where these are few."""

    def __init__(self, word: Callable[[float], str]) -> None:
        super().__init__()
        self.word = word

    def __call__(self, x: float, pos: int | None = None) -> str:
        return self.word(x) if super().__call__(x, pos) else ""


def _write(axis: Axis, word: Callable[[float], str]) -> None:
    axis.set_major_formatter(_Worded(word))
    axis.set_minor_formatter(_Worded(word))
