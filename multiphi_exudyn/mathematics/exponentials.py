"""Exponentials: the basis functions of a motion between events, their derivatives and integrals.

    phi_j(t) = (t / T)^d_j exp(lambda_j t)

lambda (p,) complex [1/s], T the unit [s] of time in powers: high powers of seconds would overflow or underflow where
a motion lasts microseconds or years. Powers d > 0 belong to nearly critical, rigid-body and resonant motion.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

__all__ = ["Exponentials", "exponential_integrals"]

SERIES_BELOW = 0.5  # |s T| - d under which t^d exp is integrated by its series: by parts d! / |s T|^d is lost
SERIES_ROUND_OFF = 1e-18  # relative: smaller terms of that series are truncated


@dataclass(frozen=True)
class Exponentials:
    """The functions phi_j(t) = (t / unit)^d_j exp(lambda_j t).

    rates: lambda (p,) complex, 1/s. powers: d (p,) int; j with d_j > 0 follows its d_j - 1 directly. unit: T [s].
    """

    rates: np.ndarray
    powers: np.ndarray
    unit: float = 1.0

    @functools.cached_property
    def pure(self) -> bool:
        """True where every power is zero."""
        return not np.any(self.powers)

    @functools.cached_property
    def _chained(self) -> np.ndarray:
        return np.flatnonzero(self.powers)

    def at(self, t: np.ndarray | float) -> np.ndarray:
        """Return phi at t: (p,) for a scalar, (k, p) for (k,) times."""
        times = np.asarray(t, dtype=float)[..., None] if isinstance(t, np.ndarray) else t
        values = np.exp(times * self.rates)
        if not self.pure:
            values[..., self._chained] *= (times / self.unit) ** self.powers[self._chained]
        return np.asarray(values)

    def derivative(self, coefficients: np.ndarray) -> np.ndarray:
        """Return coefficients (..., p) of the time derivative."""
        result = coefficients * self.rates
        if not self.pure:
            chained = self._chained
            result[..., chained - 1] += self.powers[chained] / self.unit * coefficients[..., chained]
        return result

    def integrals(self, duration: float | np.ndarray) -> np.ndarray:
        """Return the integral of every phi_j over [0, duration], (p,), or (k, p) for durations (k, 1)."""
        return exponential_integrals(self.rates, self.powers, duration, self.unit)

    def shifted(self, coefficients: np.ndarray, delay: float) -> np.ndarray:
        """Return coefficients (..., p) of the same function from a later start: f(t) = g(t + delay)."""
        result = coefficients * np.exp(delay * self.rates)
        return result if self.pure else result @ self._translation(delay / self.unit)

    def _translation(self, delay: float) -> np.ndarray:
        """Return the matrix from old to new coefficients of (t + delay)^d in powers of t, times in units."""
        matrix = np.eye(len(self.powers))
        for j in self._chained:
            degree, binomial = int(self.powers[j]), 1.0
            for lower in range(1, degree + 1):
                binomial *= (degree - lower + 1) / lower
                matrix[j, j - lower] = binomial * delay**lower
        return matrix


def exponential_integrals(
    rates: np.ndarray, powers: np.ndarray, duration: float | np.ndarray, unit: float
) -> np.ndarray:
    """Return the integral of (t / unit)^d exp(s t) over [0, duration], elementwise; d small.

    By parts, I_d = (T^d exp(s T) - d I_d-1) / s; for small |s| T by the power series of exp.
    """
    exponents = rates * duration
    rates, duration = rates * unit, duration / unit
    small = np.abs(exponents) < SERIES_BELOW + powers
    safe = np.where(small, 1.0, rates)
    by_parts = np.where(small, 0.0, np.expm1(exponents) / safe)
    series = np.zeros_like(by_parts)
    near, n = np.where(small, exponents, 0.0), 0
    term = np.ones_like(by_parts)
    while np.any(np.abs(term) > SERIES_ROUND_OFF):
        series += term / (n + 1 + powers)
        term = term * near / (n + 1)
        n += 1
    for degree in range(1, int(np.max(powers, initial=0)) + 1):
        raised = (duration**degree * np.exp(exponents) - degree * by_parts) / safe
        by_parts = np.where(powers >= degree, raised, by_parts)
    return unit * np.where(small, series * duration ** (powers + 1.0), by_parts)
