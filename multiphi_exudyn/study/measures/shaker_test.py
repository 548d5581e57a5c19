"""Shaker test: frequencies and damping ratios identified from a measured force and measured responses alone.

The frequency response functions of a record that begins at rest and ends when the response has died away are

    H_p(f) = A_p(f) / F(f)

A, F the discrete Fourier transforms of responses and force. Near a mode, in a band around the peak f_0, they are

    H_p = (b_p0 + b_p1 s + b_p2 s^2) / (s - lambda),   s = 2 pi i (f - f_0)

with one pole lambda for all responses; the polynomial holds the residue and what the other modes add. Multiplied by
s - lambda the equations are linear in lambda and b (E. C. Levy, IRE Trans. Automatic Control 4, 1959). The band
follows from the pole by iteration: it ends half way to the next peak, or at WIDTHS half widths of the peak.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.signal

from multiphi_exudyn.errors import MultiPhiValueError

__all__ = ["ResponseModes", "frequency_response_functions", "identified_modes"]

PROMINENCE = 10.0  # dB by which a peak of all responses together stands out of its surroundings
FIRST_BAND = 0.1  # half band at most, as a fraction of the peak's frequency
WIDTHS = 4.0  # half band in units of zeta f, the half width of the peak
FEWEST_LINES = 8  # spectral lines in a half band at least
ROUNDS = 4  # iterations: the band follows from the pole, the pole from the band
DEGREE = 2  # of b_p, in the last band
HIGHEST_RATIO = 0.2  # damping ratio above which a peak is no resonance


@dataclass(frozen=True)
class ResponseModes:
    """Frequencies (m,) [Hz], ascending, and damping ratios (m,) of the modes that a response shows."""

    frequencies: np.ndarray
    ratios: np.ndarray


def frequency_response_functions(
    force: np.ndarray, responses: np.ndarray, step: float
) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies (k,) [Hz] and H (points, k) of a force (n,) and responses (points, n), sampled every ``step`` [s]."""
    if responses.ndim != 2 or force.shape != responses.shape[1:]:
        raise MultiPhiValueError(f"responses: got shape {responses.shape}, need (points, {len(force)})")
    spectrum = np.fft.rfft(force)
    if not np.all(spectrum):
        raise MultiPhiValueError("force: got a spectrum with zeros, need one that reaches every frequency")
    return np.fft.rfftfreq(len(force), step), np.fft.rfft(responses) / spectrum


def identified_modes(frequencies: np.ndarray, functions: np.ndarray, lowest: float, highest: float) -> ResponseModes:
    """Modes that stand out between two frequencies [Hz] of frequency response functions H (points, k)."""
    band = (frequencies >= lowest) & (frequencies <= highest)
    if np.sum(band) <= 2 * FEWEST_LINES:
        raise MultiPhiValueError(
            f"frequencies: got {np.sum(band)} between the limits, need more than {2 * FEWEST_LINES}"
        )
    f, h = frequencies[band], functions[:, band]
    level = 10 * np.log10(np.sum(np.abs(h) ** 2, axis=0))
    peaks = scipy.signal.find_peaks(level, prominence=PROMINENCE)[0]
    poles = [_pole(f, h, float(f[peak]), _half_band(f[peaks], float(f[peak]))) for peak in peaks]
    modes = sorted((abs(pole) / (2 * math.pi), -pole.real / abs(pole)) for pole in poles)
    kept = [(hz, ratio) for hz, ratio in modes if lowest <= hz <= highest and 0 < ratio < HIGHEST_RATIO]
    return ResponseModes(np.array([hz for hz, _ in kept]), np.array([ratio for _, ratio in kept]))


def _half_band(peaks: np.ndarray, peak: float) -> float:
    """Half band [Hz] around a peak that ends half way to the next peak."""
    others = np.abs(peaks[peaks != peak] - peak)
    return float(np.min(others / 2, initial=FIRST_BAND * peak))


def _pole(f: np.ndarray, h: np.ndarray, peak: float, most: float) -> complex:
    """The pole [1/s] near a peak [Hz], from a half band of ``most`` [Hz] or less."""
    fewest = FEWEST_LINES * float(f[1] - f[0])
    half, centre, pole = max(most, fewest), peak, 0j
    for _ in range(ROUNDS):
        use = np.abs(f - centre) <= half
        pole = 2j * math.pi * centre + 2 * math.pi * half * _fitted_pole((f[use] - centre) / half, h[:, use])
        centre = pole.imag / (2 * math.pi)
        half = max(min(WIDTHS * abs(pole.real) / (2 * math.pi), most), fewest)
    return pole


def _fitted_pole(positions: np.ndarray, h: np.ndarray) -> complex:
    """The pole of H (points, k) at s = 1j times positions (k,) in -1 ... 1."""
    s = 1j * positions
    polynomials = np.kron(np.eye(len(h)), np.vander(s, DEGREE + 1))
    matrix = np.column_stack([h.ravel(), polynomials])
    return complex(np.linalg.lstsq(matrix, (h * s).ravel())[0][0])
