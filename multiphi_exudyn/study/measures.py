"""Measures of a run, with label, unit and definition: differences to a reference, contact, spectra, stiff stops.

Histories are values at the times of one common grid, (k,); windows start at 0 and end at ``until``.

**Spectra.** The spectral difference compares amplitude spectra |Y| of Hann-windowed histories, so that a shift in phase
has no effect. The map is the continuous wavelet transform with the complex Morlet wavelet

    psi(t) = (pi B)^(-1/2) exp(-t^2 / B) exp(2 pi i C t),   B = 3 (bandwidth), C = 1 (centre frequency),

stretched by C / f, as a product of spectra: of the history's and of the wavelet's, exp(-B (pi C (F / f - 1))^2). Its
envelope is C sqrt(B / 2) / f = 1.2 / f. Amplitudes are normalised such that A sin(2 pi f t) has A on its ridge.
Source: C. Torrence, G. P. Compo, A practical guide to wavelet analysis, Bull. Am. Meteorol. Soc. 79 (1998).

**Stiff stops**: a second reference for models with rigid levels. For large stop stiffness k results converge, about as
k^-1/2, to those of rigid levels. From a soft stop rigid levels differ by its compliance, whatever the number of modes;
their own error shows against a stiff stop. The second reference is the same linear structure with all modes and stops
of k, 10 k and 100 k, where k is the power of ten above the scene's own stops and above STIFF times the structure's
static stiffness at any contact,

    1 / sum (a / omega)^2,  a = Phi^T h, over the elastic modes of the open level.                              [N/m]

The largest of the three differences counts, since with many contacts a single one may be small by chance. The
uncertainty is the largest difference between two of the three runs: effect of the stiffness, and sensitivity of the
motion. Geometric nonlinearity is not included.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.fft

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.setup import Setup, start_configuration
from multiphi_exudyn.time.model_warnings import kept_back
from multiphi_exudyn.time.simulate import simulate

__all__ = [
    "FEWEST",
    "FREQUENCIES",
    "METRICS",
    "Map",
    "Metric",
    "StiffStops",
    "agreement_horizon",
    "by_window",
    "closed_time",
    "first_contact",
    "first_phase",
    "horizons",
    "inner_losses",
    "level_durations",
    "max_difference",
    "measures_of",
    "nrmse",
    "number",
    "rigid_models",
    "running_nrmse",
    "spectral_difference",
    "stiff_stops",
    "union",
    "wavelet_map",
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


FREQUENCIES = np.geomspace(2.0, 500.0, 160)  # Hz
FREQUENCIES.flags.writeable = False
BANDWIDTH, CENTRE = 3.0, 1.0  # B, C
FEWEST = 4  # samples per period of the record at least
MOST_COLUMNS = 600  # of a map


@dataclass(frozen=True)
class Map:
    """Amplitude (f, k), in the history's unit, at frequencies (f,) [Hz]; columns are means around time (k,) [s]."""

    time: np.ndarray
    frequencies: np.ndarray
    amplitude: np.ndarray

    @property
    def cone(self) -> np.ndarray:
        """Cone of influence (f,) [s]: distance from the ends of the record within which these affect the map."""
        return math.sqrt(BANDWIDTH) * CENTRE / self.frequencies


def spectral_difference(values: np.ndarray, reference: np.ndarray, time: np.ndarray, until: float) -> float:
    """|| |Y| - |Yref| || / || |Yref| || of the samples with time <= until; nan without a reference."""
    count = np.count_nonzero(time <= until * (1 + 1e-9))
    window = np.hanning(count)
    spectra = np.stack([values[:count], reference[:count]]) * window
    spectrum, reference_spectrum = np.abs(scipy.fft.rfft(spectra, scipy.fft.next_fast_len(count, real=True)))
    size = np.linalg.norm(reference_spectrum)
    return float(np.linalg.norm(spectrum - reference_spectrum) / size) if size > 0 else math.nan


def wavelet_map(values: np.ndarray, time: np.ndarray, frequencies: np.ndarray = FREQUENCIES) -> Map:
    """Amplitude of a history (k,) at equally spaced times (k,) [s] over time and frequency; its mean is left out."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    _check(frequencies, step)
    count = scipy.fft.next_fast_len(2 * len(time))  # as many zeros: the end does not run into the beginning
    spectrum = scipy.fft.fft(values - np.mean(values), count)
    lines = scipy.fft.fftfreq(count, step)
    starts = np.array([column[0] for column in np.array_split(np.arange(len(time)), min(MOST_COLUMNS, len(time)))])
    counts = np.diff([*starts, len(time)])
    amplitude = np.empty((len(frequencies), len(starts)))
    for row, frequency in enumerate(frequencies):
        wavelet = np.where(lines > 0, np.exp(-BANDWIDTH * (math.pi * CENTRE * (lines / frequency - 1)) ** 2), 0.0)
        envelope = 2 * np.abs(scipy.fft.ifft(spectrum * wavelet))[: len(time)]
        amplitude[row] = np.add.reduceat(envelope, starts) / counts
    return Map(np.add.reduceat(time, starts) / counts, frequencies, amplitude)


def _check(frequencies: np.ndarray, step: float) -> None:
    highest = 1 / (FEWEST * step)
    invalid = frequencies[~((frequencies > 0) & (frequencies <= highest * (1 + 1e-9)))]
    if len(invalid):
        need = f"need above 0 and at most {highest:g} Hz ({FEWEST} samples per period)"
        raise MultiPhiValueError(f"frequencies: got {invalid[0]:g} Hz, {need}")


STIFF = 1e5  # static stiffnesses: above, more stiffness changes the rig's motion as little as a perturbed start
FACTORS = (1.0, 10.0, 100.0)  # of the softest of the stiff stops

Histories = Mapping[str, np.ndarray]  # point -> displacements (k,) [m] on the common grid


@dataclass(frozen=True)
class StiffStops:
    """Runs with stiff stops.

    stiffness: of the stops [N/m], ascending. histories: one entry for each; empty if a run failed for the cause
    ``message``.
    """

    stiffness: tuple[float, ...]
    histories: tuple[Histories, ...]
    message: str = ""

    @property
    def ok(self) -> bool:
        """Whether all runs reached their end."""
        return not self.message

    def error(self, run: ModelRun, points: Sequence[str], until: float) -> float:
        """Largest NRMSE of the points from 0 to ``until`` [s] to the runs with stiff stops."""
        return max(_largest_nrmse(run.points, stiff, points, run.time, until) for stiff in self.histories)

    def uncertainty(self, time: np.ndarray, points: Sequence[str], until: float) -> float:
        """Largest NRMSE of the points between two runs with stiff stops, from 0 to ``until`` [s]."""
        pairs = itertools.combinations(self.histories, 2)
        return max(_largest_nrmse(softer, stiffer, points, time, until) for softer, stiffer in pairs)

    def values(self, setup: Setup, runs: Mapping[str, ModelRun]) -> dict[str, Any]:
        """JSON values: uncertainty by window and point, and the errors of ``runs`` by name."""

        def uncertainty(point: str, until: float) -> float:
            return self.uncertainty(setup.time, (point,), until)

        def errors(run: ModelRun) -> dict[str, dict[str, float | None]]:
            return by_window(setup.windows, setup.points, lambda point, until: self.error(run, (point,), until))

        return {
            "stiffness": list(self.stiffness),
            "message": self.message,
            "uncertainty": by_window(setup.windows, setup.points, uncertainty) if self.ok else {},
            "errors": {name: errors(run) for name, run in runs.items() if self.ok and run.ok},
        }


def rigid_models(setup: Setup) -> tuple[str, ...]:
    """Names of the models in which every contact is rigid; empty where levels have printed frequencies."""
    if setup.overrides or not setup.mechanics.contacts:
        return ()
    all_rigid = all(contact.rigid for contact in setup.mechanics.contacts)
    models = setup.scene.models
    return tuple(name for name in models if all_rigid or models[name].rigid)


def stiff_stops(setup: Setup) -> StiffStops | None:
    """Run the linear structure against stiff stops; None where no model of the scene has rigid levels."""
    if not rigid_models(setup):
        return None
    softest = 10.0 ** math.ceil(math.log10(_least_stiffness(setup)))
    stiffness = tuple(factor * softest for factor in FACTORS)
    try:
        return StiffStops(stiffness, tuple(_histories(setup, each) for each in stiffness))
    except MultiPhiError as error:
        return StiffStops(stiffness, (), str(error))


def _largest_nrmse(
    values: Histories, reference: Histories, points: Sequence[str], time: np.ndarray, until: float
) -> float:
    return max(nrmse(values[point], reference[point], time, until) for point in points)


def _least_stiffness(setup: Setup) -> float:
    """Lower bound of the stiffness of the stops [N/m]; 1 for a structure without stiffness."""
    level = MultiPhiModel(setup.structure, setup.contacts(rigid=True), modes="all").level(())
    elastic = level.squares > 0
    flexibilities = level.gap_rows[:, elastic] ** 2 @ (1 / level.squares[elastic])
    stiffnesses = [contact.stiffness for contact in setup.mechanics.contacts if not contact.rigid]
    return float(max([*stiffnesses, *(STIFF / flexibilities[flexibilities > 0])], default=1.0))


def _histories(setup: Setup, stiffness: float) -> Histories:
    """Displacements of the structure with all modes and this stiffness [N/m] of every stop."""
    contacts = [replace(contact, stiffness=stiffness) for contact in setup.contacts(rigid=True)]
    model = MultiPhiModel(setup.structure, [*contacts, *setup.mechanics.force_laws], modes="all")
    with kept_back():
        run = simulate(model, setup.t_end, displacement=start_configuration(setup, model), loads=setup.loads)
    if run.status != "ok":
        raise NumericalFailure(f"a stop of {stiffness:g} N/m: {run.status}, {run.message}")
    return {point: np.asarray(run.at(point, setup.time)) for point in setup.points}


Difference = Callable[[np.ndarray, np.ndarray, np.ndarray, float], float]  # values, reference, time, until
DIFFERENCES: dict[str, Difference] = {
    "nrmse": nrmse,
    "max_difference": max_difference,
    "spectral_difference": spectral_difference,
}


def measures_of(setup: Setup, run: ModelRun, reference: ModelRun | None) -> dict[str, Any]:
    """All measures of a run: differences to ``reference`` by window or tolerance, the others by point or contact.

    A number that does not exist is None; a table is {} where there is nothing to measure.
    """
    return {
        "label": run.label,
        "kind": run.kind,
        "dofs": run.dofs,
        "steps": run.steps,
        **_differences(setup, run, reference),
        "largest": {name: number(np.max(np.abs(values))) for name, values in run.points.items()},
        **_contacts(setup, run),
        "energy_end": number(run.energy[-1]) if len(run.energy) else None,
        "ledger": {row: number(value) for row, value in run.ledger.items()},
        "horizon_s": {tolerance: number(end) for tolerance, end in run.horizon_s.items()},
        "warnings": list(run.warnings),
    }


def horizons(setup: Setup, run: ModelRun, reference: ModelRun) -> dict[str, float]:
    """Tolerance -> agreement horizon [s] of the judged points.

    For the reference and its coarser copy this is ``pointwise_until``.
    """
    pairs = [(run.points[point], reference.points[point]) for point in setup.judged_points]
    tolerances = setup.scene.file.outputs.tolerances
    return {f"{each:g}": agreement_horizon(pairs, run.time, each) for each in tolerances}


def _differences(setup: Setup, run: ModelRun, reference: ModelRun | None) -> dict[str, Any]:
    if reference is None or not (run.ok and reference.ok):
        return {name: {} for name in (*DIFFERENCES, "horizon")}

    def table(difference: Difference) -> dict[str, dict[str, float | None]]:
        def measure(point: str, until: float) -> float:
            return difference(run.points[point], reference.points[point], run.time, until)

        return by_window(setup.windows, setup.points, measure)

    tables = {name: table(difference) for name, difference in DIFFERENCES.items()}
    return {**tables, "horizon": horizons(setup, run, reference)}


def _contacts(setup: Setup, run: ModelRun) -> dict[str, dict[str, Any]]:
    intervals = run.contact_intervals
    return {
        "first_contact": {name: first_contact(times) for name, times in intervals.items()},
        "contact_count": {name: len(times) for name, times in intervals.items()},
        "closed_time": {name: closed_time(times) for name, times in intervals.items()},
        "intervals": {name: times.tolist() for name, times in intervals.items()},
        "largest_force": {name: number(np.max(force)) for name, force in run.contact_force.items()},
        "impulse": {name: number(value) for name, value in run.impulse.items()},
        "inner_losses": {name: inner_losses(times, setup.longest_period) for name, times in intervals.items()},
    }
