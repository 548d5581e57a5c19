"""First descent of a sum of exponentials through zero, certified: no crossing is stepped over.

    g(t) = constant + Re sum_j a_j t^d_j exp(lambda_j t) >= 0 at t = 0;   wanted: the first t with g falling below 0

Between two samples a distance h apart g differs from its cubic Hermite interpolant by at most
h^4/384 max|g''''|, and max|g^(k)| <= sum_j |a_j^(k)| t^d_j exp(Re lambda_j t) is known in closed form. A cubic
lies above the smallest of its four Bernstein coefficients, so

    min(g0, g0 + h g0'/3, g1 - h g1'/3, g1) > h^4/384 max|g''''|

proves that the interval holds no root. Whole blocks of intervals are tested at once; an interval that
stays in doubt is divided until monotony or curvature of certified sign decides, and Newton finishes.
A touch without crossing is no descent. The answer does not depend on the samples.

Source of the bounds: P. J. Davis, Interpolation and Approximation, 1963, ch. 3; G. Farin, Curves and Surfaces
for CAGD, ch. 5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.modal_response import Exponentials

__all__ = ["DescentFinder", "Signals", "ZERO"]

ZERO = 1e-13  # of sum |a_j^(k)|: a k-th derivative below it is round-off
INTERVALS = 32  # in a block
RESOLUTION = 0.02  # wanted remainder of a block's intervals, of the signal's typical size
NARROWEST = 1e-13  # of the horizon or block: an interval in doubt is not divided below this
HERMITE = 1 / 384
SIMULTANEOUS = 1e-11  # of sum |a_j|: a falling signal this near to zero at another's root has its root there too


@dataclass(frozen=True)
class Signals:
    """s signals on one basis: coefficients (s, p) complex, constants (s,)."""

    coefficients: np.ndarray
    constants: np.ndarray


class DescentFinder:
    """Finds first descents of signals on one basis of exponentials; keeps that basis' sample tables.

    refine: factor on the density of the samples (the answer does not depend on it; the work does).
    """

    def __init__(self, basis: Exponentials, refine: float = 1.0) -> None:
        self.basis = basis
        self.refine = refine
        self.evaluations = 0
        self._decay = np.minimum(basis.rates.real, 0.0)
        self._growth = np.maximum(basis.rates.real, 0.0)
        self._eternal = not np.any(basis.powers) and not np.any(basis.rates.real > 0)
        self._tables: dict[float, np.ndarray] = {}

    def first(self, signals: Signals, horizon: float) -> float | None:
        """Time of the first descent of any of the signals in (0, horizon], None if there is none."""
        if len(signals.constants) == 0:
            return None
        derivatives = self._derivatives(signals.coefficients)
        start = 0.0
        while start < horizon:
            if self._settled(derivatives[0], signals.constants, start):
                return None
            step = self._step(derivatives, signals.constants, start, horizon)
            found = self._search_block(derivatives, signals.constants, start, step, horizon)
            if found is not None:
                return found if found <= horizon else None
            start += INTERVALS * step
        return None

    def fallen(self, signals: Signals, t: float) -> np.ndarray:
        """Which signals (s,) have reached zero at t, the time of a first descent: simultaneous events are one."""
        coefficients = signals.coefficients
        values = self.basis.at(t)
        reached = (coefficients @ values).real + signals.constants
        slopes = (self.basis.derivative(coefficients) @ values).real
        noise = SIMULTANEOUS * (np.abs(coefficients) @ np.abs(values) + np.abs(signals.constants))
        down = (reached <= noise) & (slopes <= 0)
        if not np.any(down):
            down[np.argmin(reached - noise)] = True
        return np.asarray(down)

    def signs(self, signals: Signals) -> list[int]:
        """For each signal: +1 or -1 as it is, or becomes at once, positive or negative at t = 0; 0 if it vanishes."""
        derivatives = self._derivatives(signals.coefficients)
        start = self.basis.at(0.0)
        values = (derivatives @ start).real
        values[0] += signals.constants
        noise = ZERO * np.abs(derivatives).sum(axis=2)
        noise[0] += ZERO * np.abs(signals.constants)
        decided = np.abs(values) > noise
        return [
            int(np.sign(values[order, s])) if decided[order, s] else 0
            for s, order in enumerate(np.argmax(decided[:5], axis=0))
        ]

    def _derivatives(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients of g, g', ..., g^(6): (7, s, p)."""
        stack = np.empty((7, *coefficients.shape), complex)
        stack[0] = coefficients
        for order in range(6):
            stack[order + 1] = self.basis.derivative(stack[order])
        return stack

    def _settled(self, coefficients: np.ndarray, constants: np.ndarray, start: float) -> bool:
        """True where every signal stays positive from ``start`` on for ever, by its decaying envelope."""
        if not self._eternal:
            return False
        envelope = np.abs(coefficients) @ np.exp(self.basis.rates.real * start)
        return bool(np.all(constants > envelope))

    def _bounds(self, coefficients: np.ndarray, left: float, right: float) -> np.ndarray:
        """Upper bounds of |Re sum coefficients phi| on [left, right], one for each row."""
        envelope = np.exp(self._decay * left + self._growth * right)
        if not self._eternal:
            envelope = envelope * right**self.basis.powers
        return np.abs(coefficients) @ envelope

    def _step(self, derivatives: np.ndarray, constants: np.ndarray, start: float, horizon: float) -> float:
        """Sample distance, a power of two, at which the remainder is small beside the signals."""
        remaining = horizon - start
        size = self._bounds(derivatives[0], start, start + remaining if not self._eternal else start)
        curvature = self._bounds(derivatives[4], start, start + remaining if not self._eternal else start)
        typical = np.abs(constants) + size
        with np.errstate(divide="ignore"):
            step = float(np.min((RESOLUTION * typical / (HERMITE * curvature)) ** 0.25)) / self.refine
        step = min(step, remaining / INTERVALS)
        return 2.0 ** math.floor(math.log2(step)) if step > 0 else remaining

    def _table(self, step: float) -> np.ndarray:
        """phi at the block's samples, (INTERVALS + 1, p), from its start."""
        if step not in self._tables:
            if len(self._tables) > 64:
                self._tables.clear()
            self._tables[step] = self.basis.at(step * np.arange(INTERVALS + 1))
        return self._tables[step]

    def _search_block(
        self, derivatives: np.ndarray, constants: np.ndarray, start: float, step: float, horizon: float
    ) -> float | None:
        local = derivatives[:2] if start == 0 else self.basis.shifted(derivatives[:2], start)
        samples = (local @ self._table(step).T).real
        self.evaluations += INTERVALS + 1
        values = samples[0] + constants[:, None]
        slopes = samples[1] * (step / 3)
        remainder = HERMITE * step**4 * self._bounds(derivatives[4], start, start + INTERVALS * step)
        lowest = np.minimum(values[:, :-1], values[:, 1:])
        np.minimum(lowest, values[:, :-1] + slopes[:, :-1], out=lowest)
        np.minimum(lowest, values[:, 1:] - slopes[:, 1:], out=lowest)
        doubtful = lowest <= remainder[:, None]
        for interval in np.flatnonzero(doubtful.any(axis=0)):
            left = start + interval * step
            if left >= horizon:
                return None
            right = min(left + step, horizon)
            found = [
                root
                for s in np.flatnonzero(doubtful[:, interval])
                if (root := self._descent(derivatives[:, s], float(constants[s]), left, right)) is not None
            ]
            if found:
                return min(found)
        return None

    def _descent(self, derivatives: np.ndarray, constant: float, left: float, right: float) -> float | None:
        """First descent in [left, right] by division until an interval is decided."""
        narrowest = NARROWEST * max(right, right - left)
        intervals = [(left, right, self._point(derivatives, constant, left), self._point(derivatives, constant, right))]
        while intervals:
            left, right, at_left, at_right = intervals.pop()
            decided, root = self._decide(derivatives, constant, left, right, at_left, at_right, narrowest)
            if root is not None:
                return root
            if not decided:
                middle = (left + right) / 2
                at_middle = self._point(derivatives, constant, middle)
                intervals.append((middle, right, at_middle, at_right))
                intervals.append((left, middle, at_left, at_middle))
        return None

    def _point(self, derivatives: np.ndarray, constant: float, t: float) -> np.ndarray:
        """g, g', g'', g''' at t."""
        self.evaluations += 1
        values = (derivatives[:4] @ self.basis.at(t)).real
        values[0] += constant
        return values

    def _decide(
        self,
        derivatives: np.ndarray,
        constant: float,
        left: float,
        right: float,
        at_left: np.ndarray,
        at_right: np.ndarray,
        narrowest: float,
    ) -> tuple[bool, float | None]:
        """(decided, root): what certified bounds of g, g', g'' say about a descent in [left, right]."""
        width = right - left
        bounds = self._bounds(derivatives, left, right)
        noise = ZERO * bounds
        noise[0] += ZERO * abs(constant)
        remainder = HERMITE * width**4
        low, _ = _hermite_range(at_left[0], at_right[0], at_left[1], at_right[1], width, remainder * bounds[4])
        if low > 0 or _rises(at_left, bounds, noise, width):
            return True, None
        crosses = at_right[0] < -noise[0]
        slope_low, slope_high = _hermite_range(
            at_left[1], at_right[1], at_left[2], at_right[2], width, remainder * bounds[5]
        )
        if slope_low > 0 and at_left[0] >= -noise[0]:
            return True, None
        if at_left[0] < -noise[0]:
            return True, left
        if slope_high < 0 or width < narrowest:
            return True, self._newton(derivatives, constant, left, right) if crosses else None
        curvature_low, curvature_high = _hermite_range(
            at_left[2], at_right[2], at_left[3], at_right[3], width, remainder * bounds[6]
        )
        if curvature_high < 0:
            return True, self._newton(derivatives, constant, left, right) if crosses else None
        if curvature_low > 0:
            return True, self._convex(derivatives, constant, left, right, at_left, at_right, noise)
        return False, None

    def _convex(
        self,
        derivatives: np.ndarray,
        constant: float,
        left: float,
        right: float,
        at_left: np.ndarray,
        at_right: np.ndarray,
        noise: np.ndarray,
    ) -> float | None:
        """First descent of a convex piece: it lies before the minimum, if the minimum lies below zero."""
        if at_left[1] >= -noise[1]:
            return None
        bottom = right
        if at_right[1] > 0:
            bottom = self._newton(-derivatives[1:], 0.0, left, right)
        lowest = self._point(derivatives, constant, bottom)[0]
        return self._newton(derivatives, constant, left, bottom) if lowest < -noise[0] else None

    def _newton(self, derivatives: np.ndarray, constant: float, left: float, right: float) -> float:
        """Root in [left, right] of a signal >= 0 at left and < 0 at right: Newton kept inside its bracket."""
        t = (left + right) / 2
        tolerance = 4 * np.finfo(float).eps * right
        for _ in range(100):
            values = (derivatives[:2] @ self.basis.at(t)).real
            self.evaluations += 1
            value, slope = float(values[0]) + constant, float(values[1])
            if value >= 0:
                left = t
            else:
                right = t
            if value == 0.0:
                break
            following = t - value / slope if slope else left
            if not left < following < right:
                following = (left + right) / 2
            if abs(following - t) <= tolerance:
                break
            t = following
        return t


def _hermite_range(
    left: float, right: float, slope_left: float, slope_right: float, width: float, remainder: float
) -> tuple[float, float]:
    """Certified range of a function on an interval from its ends' values and slopes."""
    inner_left, inner_right = left + width * slope_left / 3, right - width * slope_right / 3
    coefficients = (left, inner_left, inner_right, right)
    return min(coefficients) - remainder, max(coefficients) + remainder


def _rises(at_left: np.ndarray, bounds: np.ndarray, noise: np.ndarray, width: float) -> bool:
    """True where g starts at zero or above and its first derivative that counts stays positive."""
    for order in range(1, 4):
        if at_left[order - 1] < -noise[order - 1]:
            return False
        if at_left[order] > bounds[order + 1] * width:
            return True
    return False
