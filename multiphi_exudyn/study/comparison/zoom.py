"""Plots that zoom in the browser: what templates/zoom.js draws, with its numbers, for a page without a network."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from multiphi_exudyn.study.comparison.compare import MOST_LISTED, Comparison
from multiphi_exudyn.study.comparison.plots import first_contact_span, plotted_runs, styles
from multiphi_exudyn.study.measures.metrics import union
from multiphi_exudyn.study.running.runs import ModelRun

__all__ = ["histories_to_zoom", "zoom_line", "zoom_plot"]

DOTS = [2, 7]  # pixels of a dot and to the next


def histories_to_zoom(comparison: Comparison) -> list[dict[str, Any]]:
    """Displacements of all points, forces of a few contacts: of the reference and of the models drawn over it."""
    return list(_plots(comparison)) if comparison.reference.ok else []


def zoom_plot(label: str, x: dict[str, Any], lines: Sequence[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """A plot. x: label, group of plots that share it, log, and start and step of an even grid if the lines have none.

    more: log for values, shade (k, 2) along x, below: the value under which it is grey, detail: what a button shows.
    """
    return {
        "label": label,
        "x": x,
        "lines": list(lines),
        "log": False,
        "shade": [],
        "below": None,
        "detail": None,
    } | more


def zoom_line(name: str, colour: str, values: ArrayLike, x: ArrayLike | None = None, **more: Any) -> dict[str, Any]:
    """A line, on an x of its own or on the plot's grid.

    more: width (0: none), dash, mark [pixels], faint, and notes: what each point is, told where the mouse is.
    """
    given = {"name": name, "colour": colour, "data": _encoded(values), "x": None if x is None else _encoded(x)}
    return given | {"width": 0, "dash": [], "mark": 0, "faint": False, "notes": None} | more


def _encoded(values: ArrayLike) -> str:
    return base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")


def _plots(comparison: Comparison) -> Iterator[dict[str, Any]]:
    runs, time = [comparison.reference, *plotted_runs(comparison)], comparison.setup.time
    x = {"label": "time [s]", "group": "time", "log": False, "start": time[0], "step": time[1] - time[0]}
    contacts = comparison.reference.contact_intervals
    shade, detail = union(contacts.values()).tolist(), list(first_contact_span(comparison))
    for point in comparison.setup.points:
        lines = [_line(comparison, run, 1e3 * run.points[point]) for run in runs]
        yield zoom_plot(f"{point} [mm]", x, lines, shade=shade, detail=detail)
    for contact, intervals in contacts.items() if len(contacts) <= MOST_LISTED else ():
        lines = [_line(comparison, run, run.contact_force[contact]) for run in runs]
        yield zoom_plot(f"force of {contact} [N]", x, lines, shade=intervals.tolist(), detail=detail)


def _line(comparison: Comparison, run: ModelRun, values: np.ndarray) -> dict[str, Any]:
    style = styles(comparison)[run.name]
    return zoom_line(run.name, style.colour, values, width=style.width, dash=[] if style.line == "-" else DOTS)
