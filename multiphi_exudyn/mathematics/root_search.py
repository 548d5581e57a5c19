"""Root search: the first descent of one signal in an interval, by certified bounds of g, g' and g''.

    g(t) = constant + Re sum_j a_j (t/T)^d_j exp(lambda_j t),   max|g^(k)| <= bound_k, k = 0 ... 6

An interval is divided until monotony or curvature of certified sign decides, and Newton finishes; the bounds and their
source are those of first_descent.py.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["HERMITE", "LIFTED", "SAMPLED", "TIME_ROUND_OFF", "RootSearch", "lifts_off", "real_parts"]

SAMPLED = 5  # g and its derivatives up to the fourth, known at every point
NARROWEST = 1e-13  # of the horizon or block: an interval in doubt is not divided below this
HERMITE = 1 / 384
LIFTED = 1 / 162  # max of u (1 - u)^2 / 24 on [0, 1]
TIME_ROUND_OFF = 1e-15  # of the time itself: a root is not sought closer


class RootSearch:
    """Search for the first descent of one signal, with bounds (7,) that hold on every interval it is asked about.

    derivatives: coefficients (5, p) of g and its first four derivatives. evaluations: times at which it was sampled.
    noise: |g| that is round-off of what g is the sum of, beside that of its exponentials.
    """

    def __init__(
        self, basis: Exponentials, derivatives: np.ndarray, constant: float, bounds: list[float], noise: float = 0.0
    ) -> None:
        self.evaluations = 0
        self._basis = basis
        self._rates = basis.rates if basis.pure else None
        self._rows = real_parts(derivatives)
        self._constant = constant
        self._bounds = bounds
        self._noise = max(ZERO * (bounds[0] + abs(constant)), noise), ZERO * bounds[1], ZERO * bounds[2]

    def in_block(self, intervals: Iterable[int], samples: np.ndarray, step: float, end: float) -> float | None:
        """First descent in these intervals of a block, up to ``end``, from the block's start."""
        for interval in intervals:
            left = interval * step
            if left >= end:
                return None
            ends = (self._rows @ samples[:, interval : interval + 2]).T.tolist()
            for values in ends:
                values[0] += self._constant
            found = self._descent(left, left + step, *ends)
            if found is not None:
                return found if found <= end else None
        return None

    def root(self, latest: float) -> float:
        """The one root in (0, latest] of a signal that falls all the way."""
        return self._root(0, 0.0, latest, self._point(0.0), self._point(latest))

    def _descent(self, left: float, right: float, at_left: list[float], at_right: list[float]) -> float | None:
        """First descent in [left, right], by division until every interval is decided.

        at_left, at_right: g and its first four derivatives at the ends.
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
        """g and its first four derivatives at t."""
        self.evaluations += 1
        samples = self._basis.at(t) if self._rates is None else np.exp(self._rates * t)
        values: list[float] = self._rows.dot(samples.view(float)).tolist()
        values[0] += self._constant
        return values

    def _decide(
        self, left: float, right: float, at_left: list[float], at_right: list[float], narrowest: float
    ) -> tuple[bool, float | None]:
        """(decided, root): what certified bounds of g, g', g'' say about a descent in [left, right]."""
        width = right - left
        low, high = self._range(0, at_left, at_right, width)
        if low > 0 or max(-low, high) <= self._noise[0] or self._rises(at_left, at_right, width):
            return True, None
        slope_low, slope_high = self._range(1, at_left, at_right, width)
        if at_left[0] < -self._noise[0]:
            return True, left
        if slope_low > 0:
            return True, None
        crosses = at_right[0] < -self._noise[0]
        if slope_high < 0 or width < narrowest:
            return True, self._root(0, left, right, at_left, at_right) if crosses else None
        curvature_low, curvature_high = self._range(2, at_left, at_right, width)
        if curvature_high < 0:
            return True, self._root(0, left, right, at_left, at_right) if crosses else None
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

    def _rises(self, at_left: list[float], at_right: list[float], width: float) -> bool:
        """True where g starts at zero or above and stays above it.

        By g/t: the Bernstein coefficients of (g - g0 (1 - u)^3) / u, u = t / h, exceed the remainder, at most
        h^4/162 max|g^(4)| u; or by the first derivative that counts, with Taylor's remainder.
        """
        if at_left[0] < -self._noise[0]:
            return False
        inner_left, inner_right = at_left[0] + width * at_left[1] / 3, at_right[0] - width * at_right[1] / 3
        if min(3 * inner_left, 1.5 * inner_right, at_right[0]) > LIFTED * width**4 * self._bounds[4]:
            return True
        for order in range(1, 4):
            if at_left[order] > self._bounds[order + 1] * width:
                return True
            if order < 3 and at_left[order] < -self._noise[order]:
                return False
        return False

    def _convex(self, left: float, right: float, at_left: list[float], at_right: list[float]) -> float | None:
        """First descent of a convex piece: it lies before the minimum, if the minimum lies below zero."""
        if at_left[1] >= -self._noise[1]:
            return None
        if at_right[1] > 0:
            right = self._root(1, left, right, at_left, at_right)
            at_right = self._point(right)
        return self._root(0, left, right, at_left, at_right) if at_right[0] < -self._noise[0] else None

    def _root(self, order: int, left: float, right: float, at_left: list[float], at_right: list[float]) -> float:
        """Root in [left, right] of g (order 0, falling) or g' (order 1, rising).

        Inverse Taylor series to third order, kept inside the bracket, from inverse Hermite interpolation.
        """
        sign = 1.0 if order == 0 else -1.0
        t = left + (right - left) * _guess(right - left, at_left[order : order + 2], at_right[order : order + 2])
        tolerance = TIME_ROUND_OFF * right
        for _ in range(100):
            value, slope, curvature, third = self._point(t)[order : order + 4]
            if sign * value >= 0:
                left = t
            else:
                right = t
            if slope:
                newton, c2, c3 = value / slope, curvature / (2 * slope), third / (6 * slope)
                following = t - newton - c2 * newton**2 - (2 * c2**2 - c3) * newton**3
                left_out = 5 * abs(c2) * (c2**2 + abs(c3)) + self._bounds[order + 4] / (24 * abs(slope))
                if left_out * newton**4 <= tolerance or abs(newton) <= tolerance:
                    return min(max(following, left), right)
            t = following if slope and left < following < right else (left + right) / 2
        return t


def lifts_off(controls: list[float], constant: float, width: float, bounds: list[float], noise: float) -> bool:
    """``RootSearch`` on a signal that rises, by the Bernstein coefficients of an interval, without their constant."""
    left, inner_left, inner_right, right = controls
    if left + constant < -max(ZERO * (bounds[0] + abs(constant)), noise):
        return False
    lifted = min(3 * (inner_left + constant), 1.5 * (inner_right + constant), right + constant)
    return lifted > LIFTED * width**4 * bounds[4]


def real_parts(coefficients: np.ndarray) -> np.ndarray:
    """Real rows (..., 2p) whose product with the interleaved parts of phi is Re(coefficients phi)."""
    return coefficients.conj().view(float)


def _guess(width: float, at_left: list[float], at_right: list[float]) -> float:
    """Where in its interval, as a fraction, a monotone function is zero: inverse cubic Hermite interpolation."""
    (left, slope_left), (right, slope_right) = at_left, at_right
    rise = right - left
    s = -left / rise if rise else 0.5
    if slope_left * rise > 0 and slope_right * rise > 0:
        toward_left, toward_right = rise / (slope_left * width), rise / (slope_right * width)
        s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right)
    return min(max(s, 0.01), 0.99)
