"""Histories that zoom in the browser: what templates/zoom.js draws, with its samples, for a page without a network."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from multiphi_exudyn.study.comparison.compare import Comparison
from multiphi_exudyn.study.comparison.contact_totals import LISTED
from multiphi_exudyn.study.comparison.plots import first_contact_span, pictured, styles
from multiphi_exudyn.study.measures.metrics import union
from multiphi_exudyn.study.running.runs import ModelRun

__all__ = ["embedded", "zoom_data"]

DASHES = {"-": [], ":": [2, 3], "--": [6, 4]}  # pixels


def zoom_data(comparison: Comparison) -> dict[str, Any]:
    """Displacements of all points, forces of a few contacts: of the reference and of the models drawn over it."""
    time = comparison.bench.time
    return {
        "start": float(time[0]),
        "step": float(time[1] - time[0]),
        "count": len(time),
        "detail": list(first_contact_span(comparison)),
        "plots": list(_plots(comparison)) if comparison.reference.ok else [],
    }


def embedded(data: Mapping[str, Any]) -> str:
    """As JSON inside a script element, which no text in it can end."""
    return json.dumps(data).replace("<", "\\u003c")


def _plots(comparison: Comparison) -> Iterator[dict[str, Any]]:
    runs = [comparison.reference, *pictured(comparison)]
    shade = union(comparison.reference.contact_intervals.values()).tolist()
    for point in comparison.bench.points:
        lines = [_line(comparison, run, 1e3 * run.points[point]) for run in runs]
        yield {"label": f"{point} [mm]", "shade": shade, "lines": lines}
    contacts = comparison.reference.contact_intervals
    for contact in contacts if len(contacts) <= LISTED else ():
        lines = [_line(comparison, run, run.contact_force[contact]) for run in runs]
        yield {"label": f"force of {contact} [N]", "shade": contacts[contact].tolist(), "lines": lines}


def _line(comparison: Comparison, run: ModelRun, values: np.ndarray) -> dict[str, Any]:
    style = styles(comparison)[run.name]
    data = base64.b64encode(np.asarray(values, dtype="<f4").tobytes()).decode("ascii")
    return {
        "name": run.name,
        "colour": style.colour,
        "width": style.width,
        "dash": DASHES.get(str(style.line), []),
        "data": data,
    }
