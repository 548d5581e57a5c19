"""Labels written beside the curves they name, where they hide the least.

Every label has a few anchors (points of its curve) and may stand at any side of each. Labels are placed one after the
other, each where it covers the fewest points and labels, and reaches least beyond the axes.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

__all__ = ["Label", "place_labels"]

FONT_SIZE = 10.0  # points
CHARACTER, LINE = 0.70, 1.25  # width and height of a character, in font sizes
DISTANCE = 9.0  # points, from anchor to label
SIDES = ((1, 1), (-1, -1), (1, -1), (-1, 1), (1, 0), (-1, 0), (0, 1), (0, -1))
ON_LABEL, OUTSIDE, ON_POINT = 100.0, 40.0, 1.0  # cost of covering a label, of leaving the axes, of covering a point
LATER = 0.05  # cost of each anchor passed over
HALO = 3.0  # points, white around a label: what it has to cover does not run into its letters
ALIGNED = {-1: "right", 0: "center", 1: "left"}
RAISED = {-1: "top", 0: "center", 1: "bottom"}

Box = tuple[float, float, float, float]  # left, bottom, right, top [pixels]


@dataclass(frozen=True)
class Label:
    """A text, its colour, and the points in data coordinates it may stand beside, the best first."""

    text: str
    colour: str
    anchors: Sequence[tuple[float, float]]


def place_labels(figure: Figure, axes: Axes, labels: Sequence[Label], obstacles: Sequence[tuple[float, float]]) -> None:
    """Write the labels; ``obstacles`` are points in data coordinates that had better stay visible.

    What is written in the axes already, and the axes' ticks and titles, are kept clear of as other labels are.
    """
    figure.draw_without_rendering()
    points = axes.transData.transform(np.array(obstacles).reshape(-1, 2))
    written = [text.get_window_extent() for text in axes.texts]
    written += [box for axis in (axes.xaxis, axes.yaxis) if (box := axis.get_tightbbox()) is not None]
    taken: list[Box] = [(box.x0, box.y0, box.x1, box.y1) for box in written]
    for label in labels:
        anchors = [(anchor, axes.transData.transform(anchor)) for anchor in label.anchors]
        places = [(i, side, *anchor) for (i, anchor), side in itertools.product(enumerate(anchors), SIDES)]
        boxes = [_box(label.text, pixel, side, figure.dpi) for _, side, _, pixel in places]
        costs = [_cost(axes, box, points, taken) + LATER * place[0] for box, place in zip(boxes, places, strict=True)]
        best = int(np.argmin(costs))
        taken.append(boxes[best])
        _write(axes, label, places[best][2], places[best][1])


def _write(axes: Axes, label: Label, anchor: tuple[float, float], side: tuple[int, int]) -> None:
    text = axes.annotate(
        label.text,
        anchor,
        (DISTANCE * side[0], DISTANCE * side[1]),
        textcoords="offset points",
        ha=ALIGNED[side[0]],
        va=RAISED[side[1]],
        color=label.colour,
        fontsize=FONT_SIZE,
        fontweight="bold",
        zorder=10,
        path_effects=[withStroke(linewidth=HALO, foreground="white")],
    )
    text.set_in_layout(False)


def _box(text: str, pixel: np.ndarray, side: tuple[int, int], dpi: float) -> Box:
    """Where the text would stand."""
    unit = dpi / 72
    lines = text.split("\n")
    width, height = CHARACTER * FONT_SIZE * unit * max(map(len, lines)), LINE * FONT_SIZE * unit * len(lines)
    x, y = pixel[0] + DISTANCE * unit * side[0], pixel[1] + DISTANCE * unit * side[1]
    left, bottom = x - width * (1 - side[0]) / 2, y - height * (1 - side[1]) / 2
    return left, bottom, left + width, bottom + height


def _cost(axes: Axes, box: Box, points: np.ndarray, taken: Sequence[Box]) -> float:
    left, bottom, right, top = box
    covered = (points[:, 0] > left) & (points[:, 0] < right) & (points[:, 1] > bottom) & (points[:, 1] < top)
    frame = axes.bbox
    outside = left < frame.x0 or right > frame.x1 or bottom < frame.y0 or top > frame.y1
    overlaps = sum(left < b[2] and right > b[0] and bottom < b[3] and top > b[1] for b in taken)
    return ON_POINT * np.count_nonzero(covered) + OUTSIDE * outside + ON_LABEL * overlaps
