"""Piecewise exponentials: functions of time in pieces, each a polynomial on a carrier.

    u(t) = Re( exp(mu_i s) sum_d a_id s^d ),   s = t - t_i,   on the piece t_i <= t < t_i+1

One form represents all loads and motions of supports in time: a constant (mu = 0, degree 0), a harmonic
(mu = i omega, degree 0), samples (mu = 0, degree 1), any smooth function (mu = 0, degree DEGREE), and a sweep, whose
carrier is the frequency in the middle of the piece. The response to a piece is known in closed form
(core/forced_response.hpp). A history is zero before its first and after its last break.

How smooth functions and sweeps become pieces is in interpolation.py.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.mathematics.interpolation import DEGREE, Function, Interpolant, Samples, interpolated

__all__ = ["Piece", "PiecewiseExponential", "differentiated", "translated"]

JUMP = 1e-6  # of a bound of a history: smaller steps are no jumps
PHASE_ROUND_OFF = 2e-15  # of a phase, several roundings: least tolerance of its interpolant


@dataclass(frozen=True)
class Piece:
    """u(t + s) = Re exp(rate s) sum_d coefficients_d s^d up to t + s = ``until`` [s]; the last one ends at infinity."""

    until: float
    rate: complex
    coefficients: np.ndarray


@dataclass(frozen=True)
class PiecewiseExponential:
    """See the module's docstring. breaks: t_i (n + 1,). rates: mu (n,) complex. coefficients: a (n, D + 1) complex.

    error: how far it may be from the function it stands for.
    """

    breaks: np.ndarray
    rates: np.ndarray
    coefficients: np.ndarray
    error: float = 0.0

    @classmethod
    def constant(cls, value: float) -> PiecewiseExponential:
        """u = value for ever."""
        return cls(np.array([0.0, math.inf]), np.zeros(1, complex), np.full((1, 1), value, complex))

    @classmethod
    def line(cls, slope: float) -> PiecewiseExponential:
        """u = slope t for ever."""
        return cls(np.array([0.0, math.inf]), np.zeros(1, complex), np.array([[0.0, slope]], complex))

    @classmethod
    def harmonic(cls, amplitude: float, omega: float, phase: float) -> PiecewiseExponential:
        """u = amplitude cos(omega t + phase), omega [rad/s]."""
        rate = np.array([1j * omega])
        return cls(np.array([0.0, math.inf]), rate, np.full((1, 1), amplitude * np.exp(1j * phase)))

    @classmethod
    def sampled(cls, time: np.ndarray, values: np.ndarray) -> PiecewiseExponential:
        """Straight lines between samples (k,) at ascending times (k,); zero before the first and after the last."""
        slopes = np.diff(values) / np.diff(time)
        return cls(time, np.zeros(len(slopes), complex), np.stack([values[:-1], slopes], axis=1).astype(complex))

    @classmethod
    def smooth(
        cls,
        function: Function,
        end: float,
        tolerance: float,
        samples: Samples | None = None,
        breaks: Sequence[float] = (),
    ) -> PiecewiseExponential:
        """A function of (k,) times on [0, end] to ``tolerance``, in units of u.

        samples: of the function, None to take them here. breaks: instants (k,) at which it is not smooth.
        """
        all_samples = Samples.of(function, end) if samples is None else samples
        corners = np.asarray(breaks, dtype=float)
        return cls._interpolated(
            interpolated(function, lambda t: np.zeros_like(t), end, tolerance, all_samples, corners)
        )

    @classmethod
    def modulated(
        cls, amplitude: Function, phase: Function, omega: Function, end: float, tolerance: float
    ) -> PiecewiseExponential:
        """u = Re(amplitude(t) exp(i phase(t))) on [0, end], omega the rate of the phase, carrier of the pieces.

        After many cycles the round-off of the phase limits the accuracy.
        """
        ends = np.array([0.0, end])
        round_off = PHASE_ROUND_OFF * float(np.max(np.abs(amplitude(ends) * phase(ends))))
        none = Samples(np.zeros(0), np.zeros(0))

        def function(t: np.ndarray) -> np.ndarray:
            return np.asarray(amplitude(t) * np.exp(1j * phase(t)))

        return cls._interpolated(interpolated(function, omega, end, max(tolerance, round_off), none, np.zeros(0)))

    @classmethod
    def _interpolated(cls, interpolant: Interpolant) -> PiecewiseExponential:
        return cls(interpolant.edges, 1j * interpolant.carriers, interpolant.coefficients, interpolant.error)

    @property
    def pieces(self) -> int:
        """Number of pieces n."""
        return len(self.rates)

    @property
    def highest_frequency(self) -> float:
        """Highest frequency [Hz] of the carriers, and of straight pieces, two of which make a period."""
        straight = 0.5 / float(np.min(np.diff(self.breaks))) if self.coefficients.shape[1] == 2 else 0.0
        return max(straight, float(np.max(np.abs(self.rates.imag))) / (2 * math.pi))

    @functools.cached_property
    def derivative(self) -> PiecewiseExponential:
        """u', piece by piece; its error spread over the interval, as that of a short piece hardly matters."""
        changed = differentiated(self.rates, self.coefficients.T).T
        if not self.error:
            return PiecewiseExponential(self.breaks, self.rates, changed)
        widths = np.diff(self.breaks)
        steepness = float(np.sum(np.abs(self.rates) * widths + 2 * DEGREE**2) / np.sum(widths))  # Markov's inequality
        return PiecewiseExponential(self.breaks, self.rates, changed, self.error * steepness)

    def integral(self, end: float) -> PiecewiseExponential:
        """The integral of u from the first break on, up to ``end`` at least; of polynomials without carriers."""
        last = float(self.breaks[-1])
        breaks = np.append(self.breaks, 2 * end - last) if end > last else self.breaks
        degrees = np.arange(1, self.coefficients.shape[1] + 1)
        changed = np.zeros((len(breaks) - 1, len(degrees) + 1), complex)
        changed[: self.pieces, 1:] = self.coefficients / degrees
        added = np.sum(changed[: self.pieces, 1:] * np.diff(self.breaks)[:, None] ** degrees, axis=1)
        changed[1:, 0] = np.cumsum(added)[: len(changed) - 1]
        return PiecewiseExponential(breaks, np.zeros(len(changed), complex), changed)

    def local(self, t: float) -> Piece:
        """What holds from t on."""
        i = int(np.searchsorted(self.breaks, t, side="right")) - 1
        if i < 0 or i >= self.pieces:
            return Piece(float(self.breaks[0]) if i < 0 else math.inf, 0j, np.zeros(1, complex))
        rate = complex(self.rates[i])
        coefficients = translated(rate, self.coefficients[i], t - float(self.breaks[i]))
        return Piece(float(self.breaks[i + 1]), rate, coefficients)

    @functools.cached_property
    def jumps(self) -> np.ndarray:
        """u after minus u before every break (n + 1,), including the first and last; zero at infinity."""
        ends = np.diff(self.breaks)
        last = np.zeros(self.pieces, complex)
        finite = np.isfinite(ends)
        for column in self.coefficients[finite].T[::-1]:
            last[finite] = last[finite] * ends[finite] + column
        last[finite] *= np.exp(self.rates[finite] * ends[finite])
        first = self.coefficients[:, 0].real
        return np.append(first, 0.0) - np.concatenate([[0.0], last.real])

    def jump_times(self, error: float = 0.0) -> np.ndarray:
        """Return the breaks (k,) at which u jumps by more than the interpolation error; error: of the integral of u.

        Where a polynomial has the error e on a piece of length w, its derivative is by some 2 D^2 e / w (Markov).
        """
        steepness = np.abs(self.rates) + 2 * DEGREE**2 / np.diff(self.breaks)
        beside = np.maximum(np.append(steepness, 0.0), np.insert(steepness, 0, 0.0))
        allowed = error * beside if error else self.error
        return np.asarray(self.breaks[np.abs(self.jumps) > JUMP * self.largest + 4 * allowed])

    @functools.cached_property
    def largest(self) -> float:
        """Bound of |u|, from the sizes of its terms."""
        ends = np.diff(self.breaks)
        degrees = np.arange(self.coefficients.shape[1])
        reach = np.where(degrees > 0, np.where(np.isfinite(ends), ends, 0.0)[:, None] ** degrees, 1.0)
        return float(np.max(np.sum(np.abs(self.coefficients) * reach, axis=1)))

    def at(self, t: np.ndarray) -> np.ndarray:
        """Return u at times (k,)."""
        i = np.searchsorted(self.breaks, t, side="right") - 1
        inside = (i >= 0) & (i < self.pieces)
        i = np.clip(i, 0, self.pieces - 1)
        s = t - self.breaks[i]
        values = np.zeros(len(t), complex)
        for column in self.coefficients.T[::-1]:
            values = values * s + column[i]
        return np.where(inside, (values * np.exp(self.rates[i] * s)).real, 0.0)


def differentiated(rate: complex | np.ndarray, coefficients: np.ndarray, unit: float = 1.0) -> np.ndarray:
    """Return the time derivative of exp(rate s) sum_d a_d (s / unit)^d, as coefficients (D + 1, ...) of such a sum."""
    result = np.asarray(rate * coefficients)
    result[:-1] += (np.arange(1, len(coefficients)) / unit * coefficients[1:].T).T
    return result


def translated(rate: complex, coefficients: np.ndarray, delay: float) -> np.ndarray:
    """Return the coefficients (D + 1, ...) of exp(rate s) sum_d a_d s^d for a later start, s -> s + delay.

    By repeated synthetic division.
    """
    if delay == 0:
        return coefficients
    shifted = coefficients * np.exp(rate * delay)
    for lowest in range(len(shifted) - 1):
        for d in range(len(shifted) - 2, lowest - 1, -1):
            shifted[d] += delay * shifted[d + 1]
    return shifted
