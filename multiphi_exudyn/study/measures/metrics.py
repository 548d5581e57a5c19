"""Measures of the difference between two histories, with label, unit and definition.

Histories are values at the times of one common grid, (k,); windows start at 0 and end at ``until``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

__all__ = [
    "METRICS",
    "Metric",
    "agreement_horizon",
    "by_window",
    "closed_time",
    "first_contact",
    "first_phase",
    "inner_losses",
    "level_durations",
    "max_difference",
    "nrmse",
    "number",
    "running_nrmse",
    "union",
]

SMALLEST_NORM = 0.01  # of ||ref|| of the whole run: a smaller norm is round-off of a point at rest
LEAVING = 0.25  # of the open level's longest period: an opening longer than this ends a contact phase


@dataclass(frozen=True)
class Metric:
    """Label, unit and definition of a measure, for tables and figures."""

    label: str
    unit: str
    definition: str


METRICS = {
    "dofs": Metric("degrees of freedom", "count", "coordinates that the model integrates in time."),
    "steps": Metric("steps", "count", "time steps of the run; events where a model has no steps."),
    "nrmse": Metric(
        "difference (NRMSE)",
        "1",
        "||y - ref|| / ||ref|| over the samples from 0 to the window's end, y and ref being one point's "
        "displacements; 0.01 is 1 %. Not divided by a range or a standard deviation.",
    ),
    "stiff_nrmse": Metric(
        "difference to stiff stops (NRMSE)",
        "1",
        "the NRMSE of models with rigid levels to the linear structure with all modes on very stiff stops. Three stop "
        "stiffnesses are used: the power of ten above the scene's own stops and above 1e5 times the structure's static "
        "stiffness at a contact, and 10 and 100 times that value. The largest of the three differences counts. The "
        "uncertainty of this reference is the largest difference between two of the three runs.",
    ),
    "max_difference": Metric(
        "largest difference",
        "m",
        "largest |y - ref| of one point's displacements over the samples from 0 to the window's end.",
    ),
    "spectral_difference": Metric(
        "spectral difference",
        "1",
        "|| |Y| - |Yref| || / || |Yref| || of the Hann-windowed amplitude spectra of one point's displacements from 0 "
        "to the window's end. A shift in phase does not change it.",
    ),
    "horizon": Metric(
        "agreement horizon",
        "s",
        "the first time to which the NRMSE, taken from 0 to that time, of any judged point exceeds the "
        "tolerance; the end of the run where that never happens. ||ref|| is taken as at least a hundredth of that "
        "of the whole run, so that round-off of a point still at rest does not count.",
    ),
    "horizon_s": Metric(
        "sensitivity horizon",
        "s",
        "the first time at which a reduced run and the same run with its start changed by 1e-12 differ by more than "
        "the tolerance, relative to their displacements; the end of the run where that never happens. It needs no "
        "reference. Runs on other processors or by other codes may differ by as much after this time.",
    ),
    "warnings": Metric(
        "warnings",
        "text",
        "doubts of a reduced model about its own result, each with a remedy in one sentence, which begins with the "
        "kind of warning and a colon.",
    ),
    "pointwise_until": Metric(
        "pointwise until",
        "s",
        "the agreement horizon between the reference and its coarser or slightly perturbed copy. After this time a "
        "pointwise difference of the size of the tolerance is no error of a model.",
    ),
    "largest": Metric("largest displacement", "m", "largest |y| of one point over all samples of the run."),
    "largest_force": Metric(
        "largest contact force",
        "N",
        "largest force over all samples of the run; an impact has an impulse and no force.",
    ),
    "first_contact": Metric("first contact", "s", "start of the first contact interval after the release."),
    "intervals": Metric(
        "contact intervals",
        "s",
        "start and end of every time in contact; one that lasts to the end of the run ends there.",
    ),
    "contact_count": Metric("contacts made", "count", "number of contact intervals."),
    "closed_time": Metric("time in contact", "s", "sum of the contact intervals' lengths."),
    "inner_losses": Metric(
        "losses of contact inside the first contact phase",
        "count",
        "the first contact phase begins with the first contact and ends with the first opening that lasts "
        "longer than a quarter of the open level's longest period; counted are the openings inside it.",
    ),
    "impulse": Metric(
        "contact impulse", "N s", "time integral of the contact force from 0 to the end, impacts included."
    ),
    "energy_end": Metric(
        "energy at the end", "J", "kinetic and strain energy at the end of the run, compliant contacts included."
    ),
    "ledger": Metric(
        "energy ledger",
        "J",
        "balance of the initial energy and the work of loads, row by row; the residual is what no row accounts for.",
    ),
}


def number(value: float) -> float | None:
    """The value for JSON: None where it is not finite."""
    return float(value) if math.isfinite(value) else None


def by_window(
    windows: Iterable[float], points: Iterable[str], measure: Callable[[str, float], float]
) -> dict[str, dict[str, float | None]]:
    """Values of ``measure(point, end)``: end of the window [s] -> point -> value."""
    return {f"{end:g}": {point: number(measure(point, end)) for point in points} for end in windows}


def nrmse(values: np.ndarray, reference: np.ndarray, time: np.ndarray, until: float) -> float:
    """||values - reference|| / ||reference|| over the samples with time <= until; nan without a reference."""
    window = time <= until * (1 + 1e-9)
    size = np.linalg.norm(reference[window])
    return float(np.linalg.norm((values - reference)[window]) / size) if size > 0 else math.nan


def max_difference(values: np.ndarray, reference: np.ndarray, time: np.ndarray, until: float) -> float:
    """Largest |values - reference| [m] over the samples with time <= until."""
    return float(np.max(np.abs(values - reference)[time <= until * (1 + 1e-9)]))


def running_nrmse(values: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """NRMSE (k,) from the first sample to each sample; 0 for a zero reference.

    ||ref|| is at least SMALLEST_NORM times that of the whole run.
    """
    size = np.maximum(np.cumsum(reference**2), SMALLEST_NORM**2 * np.sum(reference**2))
    difference = np.cumsum((values - reference) ** 2)
    return np.sqrt(np.divide(difference, size, out=np.zeros_like(size), where=size > 0))


def agreement_horizon(pairs: Sequence[tuple[np.ndarray, np.ndarray]], time: np.ndarray, tolerance: float) -> float:
    """First time [s] to which the NRMSE of any (values, reference) pair exceeds ``tolerance``."""
    worst = np.max([running_nrmse(values, reference) for values, reference in pairs], axis=0)
    beyond = np.flatnonzero(worst > tolerance)
    return float(time[beyond[0]] if len(beyond) else time[-1])


def first_contact(intervals: np.ndarray) -> float | None:
    """Start [s] of the first of the contact intervals (k, 2); None without contact."""
    return float(intervals[0, 0]) if len(intervals) else None


def first_phase(intervals: np.ndarray, longest_period: float) -> np.ndarray:
    """Contact intervals (m, 2) of the first contact phase; ``longest_period`` [s]: of the open level."""
    if not len(intervals):
        return intervals
    openings = intervals[1:, 0] - intervals[:-1, 1]
    leaving = np.flatnonzero(openings > LEAVING * longest_period)
    return intervals[: leaving[0] + 1] if len(leaving) else intervals


def inner_losses(intervals: np.ndarray, longest_period: float) -> int:
    """Number of losses of contact inside the first contact phase."""
    return max(0, len(first_phase(intervals, longest_period)) - 1)


def closed_time(intervals: np.ndarray) -> float:
    """Sum [s] of the lengths of the contact intervals (k, 2)."""
    return float(np.sum(intervals[:, 1] - intervals[:, 0])) if len(intervals) else 0.0


def union(intervals: Iterable[np.ndarray]) -> np.ndarray:
    """Intervals (m, 2) in which any of several contacts, (k, 2) each, is closed; ascending, apart from each other."""
    joined: list[list[float]] = []
    for start, end in sorted(pair for each in intervals for pair in each.tolist()):
        if joined and start <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([start, end])
    return np.reshape(joined, (-1, 2))


def level_durations(intervals: Mapping[str, np.ndarray], t_end: float) -> dict[tuple[str, ...], float]:
    """Time [s] from 0 to t_end in each set of closed contacts; intervals: (k, 2) of each contact."""
    edges = np.unique(
        np.clip(np.concatenate([[0.0, t_end], *(np.ravel(each) for each in intervals.values())]), 0, t_end)
    )
    middle = (edges[:-1] + edges[1:]) / 2
    inside = {name: np.any((each[:, :1] < middle) & (middle < each[:, 1:]), axis=0) for name, each in intervals.items()}
    durations: dict[tuple[str, ...], float] = {}
    for i, length in enumerate(np.diff(edges)):
        closed = tuple(name for name, during in inside.items() if during[i])
        durations[closed] = durations.get(closed, 0.0) + float(length)
    return durations
