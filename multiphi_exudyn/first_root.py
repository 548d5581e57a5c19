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
DERIVATIVES = 7  # g and its derivatives up to the sixth
SAMPLED = 4  # of them, known at every sample
INTERVALS = 32  # in a block
TABLES = 64  # sample tables kept for a basis
RESOLUTION = 0.02  # wanted remainder of a block's intervals, of the signal's typical size
NARROWEST = 1e-13  # of the horizon or block: an interval in doubt is not divided below this
HERMITE = 1 / 384
TIME_ROUND_OFF = 1e-15  # of the time itself: a root is not sought closer
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
        self._eternal = not np.any(basis.powers) and not np.any(self._growth)
        self._orders = basis.rates ** np.arange(DERIVATIVES)[:, None, None]
        self._ones = np.ones(len(basis.rates))
        self._tables: dict[float, np.ndarray] = {}

    def first(self, signals: Signals, horizon: float, start: float = 0.0) -> float | None:
        """Time of the first descent of any of the signals in (start, horizon], None if there is none."""
        if len(signals.constants) == 0:
            return None
        derivatives = self._derivatives(signals.coefficients)
        magnitudes = np.abs(derivatives)
        constants: list[float] = signals.constants.tolist()
        while start < horizon:
            bounds: list[list[float]] = (magnitudes @ self._envelope(start, horizon)).T.tolist()
            if self._eternal and all(c > bound[0] for c, bound in zip(constants, bounds, strict=True)):
                return None
            step = self._step(constants, bounds, horizon - start)
            found = self._search_block(derivatives, constants, bounds, start, step, horizon)
            if found is not None:
                return found
            start += INTERVALS * step
        return None

    def fallen(self, signals: Signals, t: float) -> list[bool]:
        """Which signals (s,) have reached zero at t, the time of a first descent: simultaneous events are one."""
        coefficients = signals.coefficients
        if len(coefficients) == 1:
            return [True]
        values = self.basis.at(t)
        reached = (coefficients @ values).real + signals.constants
        slopes = (self.basis.derivative(coefficients) @ values).real
        noise = SIMULTANEOUS * (np.abs(coefficients) @ np.abs(values) + np.abs(signals.constants))
        down = (reached <= noise) & (slopes <= 0)
        if not np.any(down):
            down[np.argmin(reached - noise)] = True
        return [bool(fell) for fell in down]

    def signs(self, signals: Signals) -> list[int]:
        """For each signal: +1 or -1 as it is, or becomes at once, positive or negative at t = 0; 0 if it vanishes."""
        derivatives = self._derivatives(signals.coefficients)
        values = (derivatives @ self.basis.at(0.0)).real
        values[0] += signals.constants
        noise = ZERO * np.abs(derivatives).sum(axis=2)
        noise[0] += ZERO * np.abs(signals.constants)
        decided = np.abs(values) > noise
        first = np.argmax(decided, axis=0)
        return [int(np.sign(values[order, s])) if decided[order, s] else 0 for s, order in enumerate(first)]

    def _derivatives(self, coefficients: np.ndarray) -> np.ndarray:
        """Coefficients of g, g', ..., g^(6): (7, s, p)."""
        if self.basis.pure:
            return np.asarray(coefficients * self._orders)
        stack = [coefficients]
        for _ in range(DERIVATIVES - 1):
            stack.append(self.basis.derivative(stack[-1]))
        return np.array(stack)

    def _step(self, constants: list[float], bounds: list[list[float]], remaining: float) -> float:
        """Sample distance of the next block: a power of two, at which the remainder is small beside the signals."""
        step = remaining / INTERVALS
        for constant, bound in zip(constants, bounds, strict=True):
            wanted = RESOLUTION * (abs(constant) + bound[0]) / HERMITE
            if wanted < bound[4] * step**4:
                step = math.sqrt(math.sqrt(wanted / bound[4]))
        return math.ldexp(0.5, math.frexp(step / self.refine)[1])

    def _envelope(self, start: float, horizon: float) -> np.ndarray:
        """Upper bounds of |phi| on [start, horizon], (p,)."""
        if self._eternal:
            return self._ones if start == 0.0 else np.exp(self._decay * start)
        envelope = np.exp(self._decay * start + self._growth * horizon)
        return envelope if self.basis.pure else envelope * horizon**self.basis.powers

    def _table(self, step: float) -> np.ndarray:
        """Parts of phi at the block's samples, (2p, INTERVALS + 1), from its start."""
        if step not in self._tables:
            if len(self._tables) > TABLES:
                self._tables.clear()
            samples = self.basis.at(step * np.arange(INTERVALS + 1))
            self._tables[step] = np.ascontiguousarray(samples.view(float).T)
        return self._tables[step]

    def _search_block(
        self,
        derivatives: np.ndarray,
        constants: list[float],
        bounds: list[list[float]],
        start: float,
        step: float,
        horizon: float,
    ) -> float | None:
        """First descent in a block of intervals; all signals are sampled in one product."""
        local = derivatives[:SAMPLED] if start == 0 else self.basis.shifted(derivatives[:SAMPLED], start)
        orders, count, p = local.shape
        samples = (_parts(local).reshape(orders * count, 2 * p) @ self._table(step)).reshape(orders, count, -1)
        self.evaluations += INTERVALS + 1
        first: float | None = None
        for s in range(count):
            found = self._search_signal(
                derivatives[:, s], samples[:, s], constants[s], bounds[s], start, step, horizon if first is None else first
            )
            first = found if found is not None else first
        return first

    def _search_signal(
        self,
        derivatives: np.ndarray,
        samples: np.ndarray,
        constant: float,
        bounds: list[float],
        start: float,
        step: float,
        horizon: float,
    ) -> float | None:
        """First descent of one signal in a block, up to ``horizon``."""
        samples[0] += constant
        inner = samples[1] * (step / 3)
        values = samples[0]
        lowest = np.minimum(values[:-1], values[1:])
        np.minimum(lowest, values[:-1] + inner[:-1], out=lowest)
        np.minimum(lowest, values[1:] - inner[1:], out=lowest)
        doubtful = (lowest <= HERMITE * step**4 * bounds[4]).nonzero()[0].tolist()
        if not doubtful:
            return None
        search = _Search(self, derivatives, constant, bounds)
        for interval in doubtful:
            left = start + interval * step
            if left >= horizon:
                return None
            at_left, at_right = samples[:, interval : interval + 2].T.tolist()
            found = search.descent(left, left + step, at_left, at_right)
            if found is not None:
                return found if found <= horizon else None
        return None


class _Search:
    """Search for the first descent of one signal, with bounds (7,) that hold on every interval it is asked about."""

    def __init__(self, finder: DescentFinder, derivatives: np.ndarray, constant: float, bounds: list[float]) -> None:
        self._finder = finder
        self._basis = finder.basis
        self._rows = _parts(derivatives[:SAMPLED])
        self._constant = constant
        self._bounds = bounds
        self._noise = ZERO * (bounds[0] + abs(constant)), ZERO * bounds[1], ZERO * bounds[2]

    def descent(self, left: float, right: float, at_left: list[float], at_right: list[float]) -> float | None:
        """First descent in [left, right], by division until every interval is decided.

        at_left, at_right: g and its derivatives to the third at the ends.
        """
        narrowest = NARROWEST * right
        intervals = [(left, right, at_left, at_right)]
        while intervals:
            left, right, at_left, at_right = intervals.pop()
            decided, root = self._decide(left, right, at_left, at_right, narrowest)
            if root is not None:
                return root
            if not decided:
                middle = (left + right) / 2
                at_middle = self._point(middle)
                intervals.append((middle, right, at_middle, at_right))
                intervals.append((left, middle, at_left, at_middle))
        return None

    def _point(self, t: float) -> list[float]:
        """g, g', g'', g''' at t."""
        self._finder.evaluations += 1
        values: list[float] = (self._rows @ self._basis.at(t).view(float)).tolist()
        values[0] += self._constant
        return values

    def _decide(
        self, left: float, right: float, at_left: list[float], at_right: list[float], narrowest: float
    ) -> tuple[bool, float | None]:
        """(decided, root): what certified bounds of g, g', g'' say about a descent in [left, right]."""
        width = right - left
        if self._range(0, at_left, at_right, width)[0] > 0 or self._rises(at_left, width):
            return True, None
        slope_low, slope_high = self._range(1, at_left, at_right, width)
        if at_left[0] < -self._noise[0]:
            return True, left
        if slope_low > 0:
            return True, None
        curvature_low, curvature_high = self._range(2, at_left, at_right, width)
        if slope_high < 0 or curvature_high < 0 or width < narrowest:
            crosses = at_right[0] < -self._noise[0]
            return True, self._newton(0, left, right, at_left, at_right) if crosses else None
        if curvature_low > 0:
            return True, self._convex(left, right, at_left, at_right)
        return False, None

    def _range(self, order: int, at_left: list[float], at_right: list[float], width: float) -> tuple[float, float]:
        """Certified range of the derivative of this order on an interval: Bernstein coefficients and remainder."""
        remainder = HERMITE * width**4 * self._bounds[order + 4]
        left, right = at_left[order], at_right[order]
        inner_left, inner_right = left + width * at_left[order + 1] / 3, right - width * at_right[order + 1] / 3
        low = min(left, right, inner_left, inner_right) - remainder
        return low, max(left, right, inner_left, inner_right) + remainder

    def _rises(self, at_left: list[float], width: float) -> bool:
        """True where g starts at zero or above and its first derivative that counts stays positive."""
        for order in range(1, 4):
            if at_left[order - 1] < -self._noise[order - 1]:
                return False
            if at_left[order] > self._bounds[order + 1] * width:
                return True
        return False

    def _convex(self, left: float, right: float, at_left: list[float], at_right: list[float]) -> float | None:
        """First descent of a convex piece: it lies before the minimum, if the minimum lies below zero."""
        if at_left[1] >= -self._noise[1]:
            return None
        if at_right[1] > 0:
            right = self._newton(1, left, right, at_left, at_right)
            at_right = self._point(right)
        return self._newton(0, left, right, at_left, at_right) if at_right[0] < -self._noise[0] else None

    def _newton(self, order: int, left: float, right: float, at_left: list[float], at_right: list[float]) -> float:
        """Root in [left, right] of g (order 0, falling) or g' (order 1, rising): Newton kept inside its bracket."""
        rows, constant = self._rows[order : order + 2], self._constant if order == 0 else 0.0
        sign = 1.0 if order == 0 else -1.0
        t = left + (right - left) * _guess(right - left, at_left[order : order + 2], at_right[order : order + 2])
        tolerance = TIME_ROUND_OFF * right
        for _ in range(100):
            value, slope = (rows @ self._basis.at(t).view(float)).tolist()
            value += constant
            self._finder.evaluations += 1
            if sign * value >= 0:
                left = t
            else:
                right = t
            following = t - value / slope if slope else left
            correction = abs(following - t)
            # Newton's error after this correction is at most bound/(2 |slope|) correction^2
            if correction <= tolerance or self._bounds[order + 2] * correction**2 <= 2 * abs(slope) * tolerance:
                return min(max(following, left), right)
            t = following if left < following < right else (left + right) / 2
        return t


def _parts(coefficients: np.ndarray) -> np.ndarray:
    """Real rows (..., 2p) whose product with the interleaved parts of phi is Re(coefficients phi)."""
    return np.ascontiguousarray(coefficients.conj()).view(float)


def _guess(width: float, at_left: list[float], at_right: list[float]) -> float:
    """Where in its interval, as a fraction, a monotone function is zero: inverse cubic Hermite interpolation."""
    (left, slope_left), (right, slope_right) = at_left, at_right
    rise = right - left
    s = -left / rise if rise else 0.5
    if slope_left * rise > 0 and slope_right * rise > 0:
        toward_left, toward_right = rise / (slope_left * width), rise / (slope_right * width)
        s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right)
    return min(max(s, 0.01), 0.99)
