"""All measures of one run as JSON values; ``metrics.METRICS`` defines them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from multiphi_exudyn.study.measures import metrics
from multiphi_exudyn.study.measures.spectra import spectral_difference
from multiphi_exudyn.study.running.runs import ModelRun
from multiphi_exudyn.study.setup import Setup

__all__ = ["horizons", "measures"]

Difference = Callable[[np.ndarray, np.ndarray, np.ndarray, float], float]  # values, reference, time, until
DIFFERENCES: dict[str, Difference] = {
    "nrmse": metrics.nrmse,
    "max_difference": metrics.max_difference,
    "spectral_difference": spectral_difference,
}


def measures(setup: Setup, run: ModelRun, reference: ModelRun | None) -> dict[str, Any]:
    """All measures of a run: differences to ``reference`` by window or tolerance, the others by point or contact.

    A number that does not exist is None; a table is {} where there is nothing to measure.
    """
    return {
        "label": run.label,
        "kind": run.kind,
        "dofs": run.dofs,
        "steps": run.steps,
        **_differences(setup, run, reference),
        "largest": {name: metrics.number(np.max(np.abs(values))) for name, values in run.points.items()},
        **_contacts(setup, run),
        "energy_end": metrics.number(run.energy[-1]) if len(run.energy) else None,
        "ledger": {row: metrics.number(value) for row, value in run.ledger.items()},
        "horizon_s": {tolerance: metrics.number(end) for tolerance, end in run.horizon_s.items()},
        "warnings": list(run.warnings),
    }


def horizons(setup: Setup, run: ModelRun, reference: ModelRun) -> dict[str, float]:
    """Tolerance -> agreement horizon [s] of the judged points.

    For the reference and its coarser copy this is ``pointwise_until``.
    """
    pairs = [(run.points[point], reference.points[point]) for point in setup.judged_points]
    tolerances = setup.scene.file.outputs.tolerances
    return {f"{each:g}": metrics.agreement_horizon(pairs, run.time, each) for each in tolerances}


def _differences(setup: Setup, run: ModelRun, reference: ModelRun | None) -> dict[str, Any]:
    if reference is None or not (run.ok and reference.ok):
        return {name: {} for name in (*DIFFERENCES, "horizon")}

    def table(difference: Difference) -> dict[str, dict[str, float | None]]:
        def measure(point: str, until: float) -> float:
            return difference(run.points[point], reference.points[point], run.time, until)

        return metrics.by_window(setup.windows, setup.points, measure)

    tables = {name: table(difference) for name, difference in DIFFERENCES.items()}
    return {**tables, "horizon": horizons(setup, run, reference)}


def _contacts(setup: Setup, run: ModelRun) -> dict[str, dict[str, Any]]:
    intervals = run.contact_intervals
    return {
        "first_contact": {name: metrics.first_contact(times) for name, times in intervals.items()},
        "contact_count": {name: len(times) for name, times in intervals.items()},
        "closed_time": {name: metrics.closed_time(times) for name, times in intervals.items()},
        "intervals": {name: times.tolist() for name, times in intervals.items()},
        "largest_force": {name: metrics.number(np.max(force)) for name, force in run.contact_force.items()},
        "impulse": {name: metrics.number(value) for name, value in run.impulse.items()},
        "inner_losses": {name: metrics.inner_losses(times, setup.longest_period) for name, times in intervals.items()},
    }
