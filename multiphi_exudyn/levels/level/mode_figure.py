"""A picture of a level's mode shapes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["mode_figure"]

COLUMNS = 3
SIZE = (3.2, 2.2)  # inches, of one mode


def mode_figure(shapes: np.ndarray, frequencies: np.ndarray, positions: np.ndarray, label: str) -> Figure:
    """One panel for each mode: its shape (k, r) over positions (k,), scaled to 1; frequencies (r,) [Hz]."""
    from matplotlib.figure import Figure

    rows = math.ceil(len(frequencies) / COLUMNS)
    columns = min(COLUMNS, len(frequencies))
    figure = Figure(figsize=(SIZE[0] * columns, SIZE[1] * rows), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for k, panel in enumerate(panels):
        if k >= len(frequencies):
            panel.set_axis_off()
            continue
        largest = float(np.max(np.abs(shapes[:, k]), initial=0.0))
        panel.axhline(0.0, color="0.8", lw=0.8)
        panel.plot(positions, shapes[:, k] / (largest or 1.0), marker="o" if len(positions) < 30 else None, ms=3)
        panel.set_title(f"mode {k + 1}: {frequencies[k]:.4g} Hz", fontsize=10)
    figure.supxlabel(label, fontsize=10)
    return figure
