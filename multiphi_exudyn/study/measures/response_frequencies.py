"""Natural frequencies told from a response alone, level by level.

While one level holds, every point moves as a sum of damped exponentials about x_inf:

    y_p(t) = x_inf,p + sum_k a_pk exp(lambda_k t),   f_k = |lambda_k| / 2 pi,   zeta_k = -Re lambda_k / |lambda_k|

All points share the poles lambda_k [1/s]. ESPRIT finds them: the Hankel matrix of the samples has as many singular
values above the noise as there are poles, and its leading left singular vectors U obey U_up Z = U_down, where Z has
the eigenvalues exp(lambda_k dt). Histories sampled far above their frequencies are thinned first, by a filter of finite
length used inside the record only: exponentials leave it as exponentials. The amplitudes a_pk [m] are then fitted by
least squares to samples as they were, at uneven times, where an alias fits nothing. Kept is a pole that

- stands out of what that fit leaves over,
- and whose frequency has a small standard deviation (Cramer-Rao bound at the size of what is left over).

x_inf is a pole at zero; it and every other real pole are left out.

Source: Y. Hua, T. K. Sarkar, Matrix pencil method for estimating parameters of exponentially damped/undamped
sinusoids in noise, IEEE Trans. ASSP 38 (1990); R. Roy, T. Kailath, ESPRIT, IEEE Trans. ASSP 37 (1989).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.running.runs import ModelRun

__all__ = ["ResponseModes", "level_frequencies", "level_name", "response_frequencies"]

MOST_FREQUENCIES = 12  # of a level
FEWEST_SAMPLES = 12  # of an interval: with fewer nothing is tried
MOST_SAMPLES = 600  # after thinning: bounds the cost of a long record
MOST_LAGS = 100  # rows of the Hankel matrix: likewise
MOST_STARTS = 200  # its columns from one history: likewise
MOST_FITTED = 400  # samples the amplitudes are fitted to: likewise
QUIET = 1e-5  # of a history's spectrum: less than this is left above the band that thinning keeps
SAMPLING = 4  # samples per period of that band's highest frequency, after thinning
FILTER = 6  # length of the thinning filter in thinned samples: its first zero is at half their rate
ROUND_OFF = 1e-15  # of the largest singular value, and of the largest sample: below lies no information
ABOVE_NOISE = 10.0  # times the singular values' lower quartile: what noise alone does not reach
CONSTANT = 0.05  # |lambda| times the interval's length: a slower pole cannot be told from x_inf
HIGHEST = 0.9  # of half the thinned sampling rate: what shows nearer to it lies on either side
STEEPEST = 300.0  # |Re lambda| times the interval's length: a steeper pole is gone within a few samples
SIGNIFICANT = 6.0  # standard deviations of an amplitude
SURE = 0.01 / 3  # of a frequency, its largest standard deviation: three of them are 1 %


@dataclass(frozen=True)
class ResponseModes:
    """Frequencies (m,) [Hz], ascending, and damping ratios (m,) of the modes that a response shows."""

    frequencies: np.ndarray
    ratios: np.ndarray


@dataclass(frozen=True)
class _Fit:
    """Histories (points, k) at times (k,) as sums of exponentials; the first of the poles (m,) is that of x_inf, zero.

    basis: (k, m), columns of mean square 1; amplitudes: (points, m) of these columns [m]; residual: standard
    deviation [m] of what is left over, not below round-off.
    """

    times: np.ndarray
    poles: np.ndarray
    basis: np.ndarray
    amplitudes: np.ndarray
    residual: float

    @property
    def sizes(self) -> np.ndarray:
        """Root mean square (m,) [m] of each pole's part, over times and points."""
        return np.sqrt(np.mean(np.abs(self.amplitudes) ** 2, axis=0))

    @property
    def significant(self) -> np.ndarray:
        """Whether each pole (m,) stands out of the residual."""
        return self.sizes > SIGNIFICANT * self.residual * _deviations(self.basis)

    @property
    def uncertainties(self) -> np.ndarray:
        """Standard deviations (m,) [1/s] of the poles, all amplitudes being unknown too: their Cramer-Rao bound."""
        slopes = self.times[:, None] * self.basis
        known = np.linalg.qr(self.basis)[0]
        slopes -= known @ (known.conj().T @ slopes)
        changes = (self.amplitudes[:, None, :] * slopes).reshape(-1, len(self.poles))
        return self.residual * np.append(0.0, _deviations(changes[:, 1:]))


def response_frequencies(
    time: np.ndarray, histories: np.ndarray, interval: tuple[float, float], most: int
) -> ResponseModes:
    """Modes of ``histories`` (points, k) [m] at equally spaced times (k,) [s] within ``interval``, its ends excluded.

    The ``most`` strongest, of those that can be told; none from an interval that is too short or at rest.
    """
    if histories.ndim != 2 or histories.shape[1] != len(time):
        raise MultiPhiValueError(f"histories: got shape {histories.shape}, need (points, {len(time)})")
    inside = slice(np.searchsorted(time, interval[0], "right"), np.searchsorted(time, interval[1], "left"))
    times, samples = time[inside], histories[:, inside]
    if len(times) < FEWEST_SAMPLES or not np.any(np.ptp(samples, axis=1)):
        return ResponseModes(np.zeros(0), np.zeros(0))
    times = times - times[0]
    every = _thinning(samples)
    step = every * times[-1] / (len(times) - 1)
    poles = _esprit(_thinned(samples, every), step)
    return _told(*_uneven(times, samples), poles[_resolved(poles, step, times[-1])], most)


def level_frequencies(
    run: ModelRun, contacts: Sequence[str], window: tuple[float, float] | None = None
) -> dict[str, list[float]]:
    """Level's name -> frequencies [Hz], from the longest interval of every level that the run visits.

    window [s]: only what lies in it; None for the whole run.
    """
    histories = np.array(list(run.points.values())).reshape(-1, len(run.time))
    ends = (float(run.time[0]), float(run.time[-1])) if window is None else window
    return {
        level_name(closed): response_frequencies(run.time, histories, interval, MOST_FREQUENCIES).frequencies.tolist()
        for closed, interval in _longest_intervals(run, contacts, ends).items()
    }


def level_name(closed: Sequence[str]) -> str:
    """The name of a level in tables: its closed contacts, or "open"."""
    return "+".join(closed) or "open"


# ------------------------------------------------------------------ poles


def _thinning(samples: np.ndarray) -> int:
    """How many samples become one: as many as the histories' band allows, more where there are too many."""
    count = samples.shape[1]
    window = np.hanning(count) ** 2
    power = np.abs(np.fft.rfft(window * (samples - samples.mean(axis=1, keepdims=True)))) ** 2
    above = np.cumsum(power[:, ::-1], axis=1)[:, ::-1]
    band = np.flatnonzero(np.any(above > QUIET**2 * above[:, :1], axis=0))[-1]
    return max(1, count // (SAMPLING * max(1, int(band))), math.ceil(count / MOST_SAMPLES))


def _thinned(samples: np.ndarray, every: int) -> np.ndarray:
    """Every ``every``-th of the low-pass filtered samples; the filter never leaves the record."""
    if every == 1:
        return samples
    weights = np.hanning(FILTER * every + 1) ** 2
    windows = np.lib.stride_tricks.sliding_window_view(samples, len(weights), axis=1)
    return windows[:, ::every] @ (weights / np.sum(weights))


def _esprit(samples: np.ndarray, step: float) -> np.ndarray:
    """Poles (m,) [1/s] that all histories share; as many as singular values stand above the noise."""
    points, count = samples.shape
    lags = min(count * min(points, 2) // (min(points, 2) + 1), MOST_LAGS)
    starts = np.lib.stride_tricks.sliding_window_view(samples, lags, axis=1)
    starts = starts[:, :: math.ceil((count - lags + 1) / MOST_STARTS)]
    left, values, _ = np.linalg.svd(np.asarray(np.linalg.qr(starts.reshape(-1, lags), mode="r")).T)
    noise = 3 * len(values) // 4
    order = min(noise, np.count_nonzero(values > max(ROUND_OFF * values[0], ABOVE_NOISE * values[noise])))
    shift = np.linalg.lstsq(left[:-1, :order], left[1:, :order], rcond=None)[0]
    factors = np.linalg.eigvals(shift).astype(complex)
    return np.log(factors[factors != 0]) / step


def _resolved(poles: np.ndarray, step: float, length: float) -> np.ndarray:
    """Whether each pole is neither constant over the interval's ``length`` [s], nor gone at once, nor too fast."""
    lasting = (np.abs(poles) * length > CONSTANT) & (np.abs(poles.real) * length < STEEPEST)
    return lasting & (np.abs(poles.imag) * step < HIGHEST * math.pi)


# ------------------------------------------------------------------ amplitudes, and what is sure


def _uneven(times: np.ndarray, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The samples, or where they are many a fixed choice of them at uneven times."""
    if len(times) <= MOST_FITTED:
        return times, samples
    chosen = np.sort(np.random.default_rng(0).choice(len(times), MOST_FITTED, replace=False))
    return times[chosen], samples[:, chosen]


def _told(times: np.ndarray, samples: np.ndarray, poles: np.ndarray, most: int) -> ResponseModes:
    """The modes among ``poles`` that the samples are sure of."""
    fit = _fitted(times, samples, np.append(0.0, poles))
    fit = _fitted(times, samples, fit.poles[fit.significant | (fit.poles == 0)])
    sure = (fit.poles.imag > 0) & (fit.uncertainties < SURE * np.abs(fit.poles))
    strongest = np.argsort(-fit.sizes[sure])[:most]
    kept = np.array(sorted(fit.poles[sure][strongest], key=abs), dtype=complex)
    return ResponseModes(np.abs(kept) / (2 * math.pi), -kept.real / np.abs(kept))


def _fitted(times: np.ndarray, samples: np.ndarray, poles: np.ndarray) -> _Fit:
    """Least squares for the amplitudes of given poles."""
    basis = np.exp(np.outer(times, poles))
    basis /= np.sqrt(np.mean(np.abs(basis) ** 2, axis=0))
    amplitudes = np.linalg.lstsq(basis, samples.T, rcond=None)[0].T
    left_over = samples - (amplitudes @ basis.T).real
    freedom = len(samples) * max(1, len(times) - len(poles))
    residual = math.sqrt(np.sum(left_over**2) / freedom)
    return _Fit(times, poles, basis, amplitudes, max(residual, ROUND_OFF * float(np.max(np.abs(samples)))))


def _deviations(matrix: np.ndarray) -> np.ndarray:
    """Standard deviations (m,) of least-squares unknowns of a ``matrix`` (k, m), the data's being 1."""
    lengths = np.maximum(np.linalg.norm(matrix, axis=0), np.finfo(float).tiny)
    with np.errstate(divide="ignore", invalid="ignore"):
        _, values, rows = np.linalg.svd(np.linalg.qr(matrix / lengths, mode="r"))
        return np.linalg.norm(rows / values[:, None], axis=0) / lengths


# ------------------------------------------------------------------ levels of a run


def _longest_intervals(
    run: ModelRun, contacts: Sequence[str], ends: tuple[float, float]
) -> dict[tuple[str, ...], tuple[float, float]]:
    """Set of closed contacts -> longest interval [s] in which just these are closed, in order of the first visit.

    ends [s]: what lies outside them does not count.
    """
    given = [run.contact_intervals[name] for name in contacts]
    edges = np.unique(np.concatenate([ends, *(np.clip(np.ravel(times), *ends) for times in given)]))
    middles = (edges[:-1] + edges[1:]) / 2
    closed = [np.searchsorted(of[:, 0], middles) > np.searchsorted(of[:, 1], middles) for of in given]
    longest: dict[tuple[str, ...], tuple[float, float]] = {}
    for level, pieces in itertools.groupby(range(len(middles)), lambda k: tuple(bool(of[k]) for of in closed)):
        held = list(pieces)
        interval = float(edges[held[0]]), float(edges[held[-1] + 1])
        names = tuple(itertools.compress(contacts, level))
        longest[names] = max(longest.get(names, interval), interval, key=lambda ends: ends[1] - ends[0])
    return longest
