"""History figure: displacements, contact forces below them, and in grey the times of closed or sticking contacts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from multiphi_exudyn.display import names

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["history_figure"]

GREY, LINE = "0.85", 1.0
SIZE = (9.0, 3.0)  # inches, of one panel


def history_figure(
    times: np.ndarray,
    displacements: Mapping[str, np.ndarray],
    forces: Mapping[str, np.ndarray],
    intervals: Mapping[str, Sequence[tuple[float, float]]],
) -> Figure:
    """Panels over times (k,) [s]: displacements by point, forces by contact, in the structure's own units.

    intervals: what holds in the times [s] drawn grey -> these, such as "stop closed".
    """
    from matplotlib.figure import Figure

    panels = [(displacements, "displacement"), *(((forces, "force"),) if forces else ())]
    figure = Figure(figsize=(SIZE[0], SIZE[1] * len(panels)), layout="constrained")
    axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axis, (curves, label) in zip(axes, panels, strict=True):
        _shade(axis, (interval for of_one in intervals.values() for interval in of_one))
        for name, values in curves.items():
            axis.plot(times, values, lw=LINE, label=name)
        axis.set_ylabel(label)
        axis.margins(x=0)
        if curves:
            axis.legend(loc="upper right", frameon=False, ncols=3)
    axes[-1].set_xlabel("time [s]" + (f"; grey: {names(list(intervals))}" if intervals else ""))
    return figure


def _shade(axis: Axes, intervals: Iterable[tuple[float, float]]) -> None:
    for start, end in intervals:
        axis.axvspan(start, end, color=GREY, lw=0)
