"""Spectra of histories: how much two differ in them, and how they change with time.

The spectral difference compares amplitude spectra |Y| of Hann-windowed histories, so that a shift in phase costs
nothing. The map is the continuous wavelet transform with the complex Morlet wavelet

    psi(t) = (pi B)^(-1/2) exp(-t^2 / B) exp(2 pi i C t),   B = 3 (bandwidth), C = 1 (centre frequency),

stretched by C / f: its amplitude spectrum has the standard deviation f / (pi C sqrt(2 B)) = 0.13 f, its envelope
C sqrt(B / 2) / f = 1.2 / f. Amplitudes are normalised such that A sin(2 pi f t) has A on its ridge. Low frequencies are
transformed at low sampling rates, an octave at a time: the cost is twice that of the highest octave.

Source: C. Torrence, G. P. Compo, A practical guide to wavelet analysis, Bull. Am. Meteorol. Soc. 79 (1998).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pywt
import scipy.fft
import scipy.signal

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["FEWEST", "FREQUENCIES", "Map", "spectral_difference", "wavelet_map"]

FREQUENCIES = np.geomspace(2.0, 500.0, 160)  # Hz
FREQUENCIES.flags.writeable = False
BANDWIDTH, CENTRE = 3.0, 1.0  # B, C
COARSEST = 16  # samples per period: a slower rate is no longer halved
FEWEST = 4  # samples per period that the record itself must have
MOST_COLUMNS = 600  # of a map
PRECISION = 14  # PyWavelets samples the wavelet at 2^14 places: with 2^12 a row shows 1.5 % of a far-off frequency


@dataclass(frozen=True)
class Map:
    """Amplitude (f, k), in the history's unit, at frequencies (f,) [Hz]; columns are means around time (k,) [s]."""

    time: np.ndarray
    frequencies: np.ndarray
    amplitude: np.ndarray

    @property
    def cone(self) -> np.ndarray:
        """Cone of influence (f,) [s]: nearer than this to the record's ends its being cut off shows."""
        return math.sqrt(BANDWIDTH) * CENTRE / self.frequencies


def spectral_difference(values: np.ndarray, reference: np.ndarray, time: np.ndarray, until: float) -> float:
    """|| |Y| - |Yref| || / || |Yref| || of the samples with time <= until; nan without a reference."""
    count = np.count_nonzero(time <= until * (1 + 1e-9))
    window = np.hanning(count)
    spectra = np.stack([values[:count], reference[:count]]) * window
    own, other = np.abs(scipy.fft.rfft(spectra, scipy.fft.next_fast_len(count, real=True)))
    size = np.linalg.norm(other)
    return float(np.linalg.norm(own - other) / size) if size > 0 else math.nan


def wavelet_map(values: np.ndarray, time: np.ndarray, frequencies: np.ndarray = FREQUENCIES) -> Map:
    """Amplitude of a history (k,) at equally spaced times (k,) [s] over time and frequency; its mean is left out."""
    step = (time[-1] - time[0]) / (len(time) - 1)
    _check(frequencies, step)
    columns = np.array_split(np.arange(len(time)), min(MOST_COLUMNS, len(time)))
    starts = np.array([column[0] for column in columns])
    counts = np.array([len(column) for column in columns])
    amplitude = np.empty((len(frequencies), len(columns)))
    for chosen, samples, every in _octaves(values - np.mean(values), frequencies, step):
        places = np.arange(len(samples)) * every
        for row, found in zip(chosen, _amplitudes(samples, frequencies[chosen], every * step), strict=True):
            whole = found if every == 1 else np.interp(np.arange(len(time)), places, found)
            amplitude[row] = np.add.reduceat(whole, starts) / counts
    return Map(np.add.reduceat(time, starts) / counts, frequencies, amplitude)


def _check(frequencies: np.ndarray, step: float) -> None:
    highest = 1 / (FEWEST * step)
    wrong = frequencies[~((frequencies > 0) & (frequencies <= highest * (1 + 1e-9)))]
    if len(wrong):
        need = f"need above 0 and at most {highest:g} Hz ({FEWEST} samples per period)"
        raise MultiPhiValueError(f"frequencies: got {wrong[0]:g} Hz, {need}")


def _octaves(samples: np.ndarray, frequencies: np.ndarray, step: float) -> Iterator[tuple[np.ndarray, np.ndarray, int]]:
    """(indices of frequencies, samples, step in original samples) of every sampling rate that is needed."""
    halvings = np.maximum(0, np.floor(np.log2(1 / (COARSEST * step * frequencies)))).astype(int)
    for octave in range(int(np.max(halvings)) + 1):
        if octave:
            samples = scipy.signal.resample_poly(samples, 1, 2)
        chosen = np.flatnonzero(halvings == octave)
        if len(chosen):
            yield chosen, samples, 2**octave


def _amplitudes(samples: np.ndarray, frequencies: np.ndarray, step: float) -> np.ndarray:
    """2 |W| / sqrt(scale), (f, k); PyWavelets integrates the wavelet over each sample, which the sinc takes back."""
    scales = CENTRE / (frequencies * step)
    found, _ = pywt.cwt(samples, scales, f"cmor{BANDWIDTH}-{CENTRE}", method="fft", precision=PRECISION)
    return np.abs(found) * (2 / (np.sqrt(scales) * np.sinc(CENTRE / scales)))[:, None]
