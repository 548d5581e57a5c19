"""Spectra of histories: the difference between two spectra, and the change of a spectrum with time.

The spectral difference compares amplitude spectra |Y| of Hann-windowed histories, so that a shift in phase has
no effect. The map is the continuous wavelet transform with the complex Morlet wavelet

    psi(t) = (pi B)^(-1/2) exp(-t^2 / B) exp(2 pi i C t),   B = 3 (bandwidth), C = 1 (centre frequency),

stretched by C / f, as a product of spectra: of the history's and of the wavelet's, exp(-B (pi C (F / f - 1))^2). Its
envelope is C sqrt(B / 2) / f = 1.2 / f. Amplitudes are normalised such that A sin(2 pi f t) has A on its ridge.

Source: C. Torrence, G. P. Compo, A practical guide to wavelet analysis, Bull. Am. Meteorol. Soc. 79 (1998).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.fft

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["FEWEST", "FREQUENCIES", "Map", "spectral_difference", "wavelet_map"]

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
