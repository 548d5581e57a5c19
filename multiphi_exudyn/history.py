"""Histories: functions of time in pieces, each a polynomial on a carrier.

    u(t) = Re( exp(mu_i s) sum_d a_id s^d ),   s = t - t_i,   on the piece t_i <= t < t_i+1

One form holds everything a load or a moving support does in time: a constant (mu = 0, degree 0), a harmonic
(mu = i omega, degree 0), samples (mu = 0, degree 1), any smooth function (mu = 0, degree DEGREE), and a sweep, whose
carrier is the frequency in the middle of the piece. The response to a piece is known in closed form
(forced_response.py). A history is zero before its first and after its last break.

Smooth functions are interpolated at Chebyshev points of the second kind, the ends of a piece among them; a piece is
halved until the interpolant agrees with the function between its points. Source: L. N. Trefethen, Approximation
Theory and Approximation Practice, 2013, ch. 2 and 16.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.polynomial.chebyshev as chebyshev

from multiphi_exudyn.errors import NumericalFailure

__all__ = ["History", "Piece", "differentiated", "translated"]

DEGREE = 8  # of the polynomials that stand for smooth functions
MOST_PIECES = 2**18  # a function that needs more is not smooth at the asked tolerance
FIRST_PIECES = 64  # into which a smooth function's interval is divided before any comparison
ROUND_OFF = 1e-13  # of the largest value: no interpolant is asked to come closer
PHASE_ROUND_OFF = 2e-15  # of a phase, several roundings: no interpolant is asked to know it better

Function = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Piece:
    """u(t + s) = Re exp(rate s) sum_d coefficients_d s^d up to t + s = ``until`` [s]; the last one ends at infinity."""

    until: float
    rate: complex
    coefficients: np.ndarray


@dataclass(frozen=True)
class History:
    """See the module's docstring. breaks: t_i (n + 1,). rates: mu (n,) complex. coefficients: a (n, D + 1) complex.

    error: how far it may be from the function it stands for.
    """

    breaks: np.ndarray
    rates: np.ndarray
    coefficients: np.ndarray
    error: float = 0.0

    @classmethod
    def constant(cls, value: float) -> History:
        """u = value for ever."""
        return cls(np.array([0.0, math.inf]), np.zeros(1, complex), np.full((1, 1), value, complex))

    @classmethod
    def harmonic(cls, amplitude: float, omega: float, phase: float) -> History:
        """u = amplitude cos(omega t + phase), omega [rad/s]."""
        rate = np.array([1j * omega])
        return cls(np.array([0.0, math.inf]), rate, np.full((1, 1), amplitude * np.exp(1j * phase)))

    @classmethod
    def sampled(cls, time: np.ndarray, values: np.ndarray) -> History:
        """Straight lines between samples (k,) at ascending times (k,); zero before the first and after the last."""
        slopes = np.diff(values) / np.diff(time)
        return cls(time, np.zeros(len(slopes), complex), np.stack([values[:-1], slopes], axis=1).astype(complex))

    @classmethod
    def smooth(cls, function: Function, end: float, tolerance: float) -> History:
        """A function of (k,) times on [0, end] to ``tolerance``, in units of u."""
        return cls._interpolated(function, lambda t: np.zeros_like(t), end, tolerance)

    @classmethod
    def modulated(cls, amplitude: Function, phase: Function, omega: Function, end: float, tolerance: float) -> History:
        """u = Re(amplitude(t) exp(i phase(t))) on [0, end], omega the phase's rate, by which the pieces ride.

        After many cycles a phase is known to its round-off only, and no interpolant comes closer.
        """
        ends = np.array([0.0, end])
        known = PHASE_ROUND_OFF * float(np.max(np.abs(amplitude(ends) * phase(ends))))
        return cls._interpolated(lambda t: amplitude(t) * np.exp(1j * phase(t)), omega, end, max(tolerance, known))

    @classmethod
    def _interpolated(cls, function: Function, omega: Function, end: float, tolerance: float) -> History:
        """Pieces of degree DEGREE on [0, end], halved until they agree with the function."""
        lefts, widths = np.arange(FIRST_PIECES) * (end / FIRST_PIECES), np.full(FIRST_PIECES, end / FIRST_PIECES)
        done: list[tuple[np.ndarray, ...]] = []
        count, worst = 0, 0.0
        while len(lefts):
            carriers = omega(lefts + widths / 2)
            series, errors, size = _fit(function, lefts, widths, carriers)
            good = errors <= max(tolerance, ROUND_OFF * size)
            done.append((lefts[good], widths[good], carriers[good], series[good]))
            lefts, widths = lefts[~good], widths[~good] / 2
            lefts, widths = np.concatenate([lefts, lefts + widths]), np.concatenate([widths, widths])
            count += int(np.sum(good))
            worst = max(worst, float(np.max(errors[good], initial=0.0)))
            if count + len(lefts) > MOST_PIECES or np.any(widths < np.finfo(float).eps * end):
                raise NumericalFailure(
                    f"function of time: not smooth enough for a tolerance of {tolerance:g} near t = {lefts[0]:g} s "
                    f"(more than {MOST_PIECES} polynomials of degree {DEGREE})"
                )
        starts, widths, carriers, series = (np.concatenate(parts) for parts in zip(*done, strict=True))
        order = np.argsort(starts)
        scaled = series[order] @ _power_matrix() / widths[order, None] ** np.arange(DEGREE + 1)
        return cls(np.append(starts[order], end), 1j * carriers[order], scaled, max(worst, ROUND_OFF * size))

    @property
    def pieces(self) -> int:
        """Number of pieces n."""
        return len(self.rates)

    @functools.cached_property
    def derivative(self) -> History:
        """u', piece by piece."""
        steepest = float(np.max(np.abs(self.rates) + 2 * DEGREE**2 / np.diff(self.breaks)))  # Markov's inequality
        changed = differentiated(self.rates, self.coefficients.T).T
        return History(self.breaks, self.rates, changed, self.error * steepest if self.error else 0.0)

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
        """u after less u before every break (n + 1,), the first and the last among them; nothing jumps at infinity."""
        ends = np.diff(self.breaks)
        last = np.zeros(self.pieces, complex)
        finite = np.isfinite(ends)
        for column in self.coefficients[finite].T[::-1]:
            last[finite] = last[finite] * ends[finite] + column
        last[finite] *= np.exp(self.rates[finite] * ends[finite])
        first = self.coefficients[:, 0].real
        return np.append(first, 0.0) - np.concatenate([[0.0], last.real])

    @functools.cached_property
    def largest(self) -> float:
        """A bound of |u|, from the sizes of its terms."""
        ends = np.diff(self.breaks)
        degrees = np.arange(self.coefficients.shape[1])
        reach = np.where(degrees > 0, np.where(np.isfinite(ends), ends, 0.0)[:, None] ** degrees, 1.0)
        return float(np.max(np.sum(np.abs(self.coefficients) * reach, axis=1)))

    def at(self, t: np.ndarray) -> np.ndarray:
        """u at times (k,)."""
        i = np.searchsorted(self.breaks, t, side="right") - 1
        inside = (i >= 0) & (i < self.pieces)
        i = np.clip(i, 0, self.pieces - 1)
        s = t - self.breaks[i]
        values = np.zeros(len(t), complex)
        for column in self.coefficients.T[::-1]:
            values = values * s + column[i]
        return np.where(inside, (values * np.exp(self.rates[i] * s)).real, 0.0)


def differentiated(rate: complex | np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Time derivative of exp(rate s) sum_d a_d s^d, as coefficients (D + 1, ...) of such a sum."""
    result = np.asarray(rate * coefficients)
    result[:-1] += (np.arange(1, len(coefficients)) * coefficients[1:].T).T
    return result


def translated(rate: complex, coefficients: np.ndarray, delay: float) -> np.ndarray:
    """exp(rate s) sum_d a_d s^d of coefficients (D + 1, ...), from a later start: s -> s + delay.

    By repeated synthetic division.
    """
    if delay == 0:
        return coefficients
    moved = coefficients * np.exp(rate * delay)
    for lowest in range(len(moved) - 1):
        for d in range(len(moved) - 2, lowest - 1, -1):
            moved[d] += delay * moved[d + 1]
    return moved


@functools.cache
def _nodes() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Chebyshev points and midway points on [0, 1], values -> Chebyshev series, series -> values midway."""
    angles = np.linspace(math.pi, 0.0, 2 * DEGREE + 1)
    x = np.cos(angles)
    own, between = x[::2], x[1::2]
    fitted = np.linalg.inv(chebyshev.chebvander(own, DEGREE))
    return (own + 1) / 2, (between + 1) / 2, fitted, chebyshev.chebvander(between, DEGREE)


def _fit(
    function: Function, lefts: np.ndarray, widths: np.ndarray, carriers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Chebyshev series (n, D + 1) of every piece on its carrier, its error (n,) midway, the largest value."""
    own, between, fitted, midway = _nodes()

    def sampled(places: np.ndarray) -> np.ndarray:
        offsets = widths[:, None] * places
        values = function((lefts[:, None] + offsets).ravel()).reshape(offsets.shape)
        return np.asarray(values * np.exp(-1j * carriers[:, None] * offsets) if np.any(carriers) else values)

    values, checks = sampled(own), sampled(between)
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(checks))):
        raise NumericalFailure("function of time: gives a value that is not finite")
    series = values @ fitted.T
    errors = np.max(np.abs(series @ midway.T - checks), axis=1)
    return series.astype(complex), errors, float(np.max(np.abs(values)))


@functools.cache
def _power_matrix() -> np.ndarray:
    """Chebyshev series on [0, 1] -> powers of the place in the piece, (D + 1, D + 1)."""
    rows = []
    for k in range(DEGREE + 1):
        powers = np.polynomial.Polynomial(chebyshev.cheb2poly(np.eye(DEGREE + 1)[k]))
        shifted = powers(np.polynomial.Polynomial([-1.0, 2.0]))
        rows.append(np.pad(shifted.coef, (0, DEGREE + 1 - len(shifted.coef))))
    return np.array(rows)
