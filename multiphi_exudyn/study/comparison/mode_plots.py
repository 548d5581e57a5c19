"""The lowest mode shapes of the levels, as a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from multiphi_exudyn.study.comparison.mode_shapes import LevelModes
from multiphi_exudyn.study.comparison.plots import COLOURS, canvas

__all__ = ["mode_figure"]

APART = 2.3  # between beams drawn over each other, of the largest value of a mode


def mode_figure(levels: Sequence[LevelModes]) -> Figure:
    """The lowest mode shapes of every level: its beams, from top to bottom, along x."""
    figure = canvas((1.2 + 0.9 * len(levels[0].beams)) * len(levels) + 0.3)
    for part, level in zip(figure.subfigures(len(levels), 1, squeeze=False)[:, 0], levels, strict=True):
        held = "" if level.share is None else f": {100 * level.share:.3g} % of the reference's run"
        part.suptitle(level.name + held, x=0.01, ha="left", fontsize=10)
        row = part.subplots(1, len(level.frequencies), sharex=True, sharey=True, squeeze=False)[0]
        for i, axes in enumerate(row):
            _mode(axes, level, i)
        names = [beam.name for beam in level.beams] if len(level.beams) > 1 else []
        row[0].set_yticks(-APART * np.arange(len(names)), names, fontsize=9)
    return figure


def _mode(axes: Axes, level: LevelModes, mode: int) -> None:
    for number, beam in enumerate(level.beams):
        zero, shape = -APART * number, beam.shapes[mode]
        axes.plot(beam.x[[0, -1]], [zero, zero], color="#BBBBBB", linewidth=0.8)
        axes.plot(beam.x, zero + shape, color=COLOURS[0], linewidth=1.6)
        for places, marker, colour in ((beam.masses, "s", "#000000"), (beam.contacts, "^", "#D55E00")):
            axes.plot(places, zero + np.interp(places, beam.x, shape), marker, color=colour, ms=6)
    axes.set_title(f"mode {mode + 1}, {level.frequencies[mode]:.2f} Hz", fontsize=9)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("x [m]", fontsize=9)
