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
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.modal_response import Exponentials

__all__ = ["TABLES", "TABLE_NUMBERS", "ZERO", "Descent", "DescentFinder", "Signals"]

ZERO = 1e-13  # of sum |a_j^(k)|: a k-th derivative below it is round-off
DERIVATIVES = 7  # g and its derivatives up to the sixth
SAMPLED = 5  # of them, known at every point
INTERVALS = 64  # in a block
TABLES = 8  # sample tables kept for a basis: their steps are powers of two, most events need one of a few
TABLE_NUMBERS = 2 * (4 * INTERVALS + 2)  # floats in a sample table for an exponential
RESOLUTION = 0.02  # wanted remainder of a block's intervals, of the signal's typical size
NARROWEST = 1e-13  # of the horizon or block: an interval in doubt is not divided below this
HERMITE = 1 / 384
LIFTED = 1 / 162  # max of u (1 - u)^2 / 24 on [0, 1]
WINDOW = 1.0  # of the time in which the fastest growing exponential grows e-fold: bounds hold no longer than twice this
TIME_ROUND_OFF = 1e-15  # of the time itself: a root is not sought closer
SIMULTANEOUS = 1e-11  # of sum |a_j|: a falling signal this near to zero at another's root has its root there too


@dataclass(frozen=True)
class Signals:
    """s signals on one basis: coefficients (s, p) complex, constants (s,)."""

    coefficients: np.ndarray
    constants: np.ndarray


@dataclass(frozen=True)
class Descent:
    """time of a first descent, and the position of the signal that falls."""

    time: float
    signal: int


class DescentFinder:
    """Finds first descents of signals on one basis of exponentials; keeps that basis' sample tables.

    refine: factor on the density of the samples (the answer does not depend on it; the work does). The compiled loop
    takes it when it first meets the level.
    """

    def __init__(self, basis: Exponentials, refine: float = 1.0) -> None:
        self.basis = basis
        self.refine = refine
        self.evaluations = 0
        self._decay = np.minimum(basis.rates.real, 0.0)
        self._growth = np.maximum(basis.rates.real, 0.0)
        self._eternal = basis.pure and not np.any(self._growth)
        self._window = WINDOW / float(np.max(self._growth)) if np.any(self._growth) else math.inf
        self._orders = basis.rates ** np.arange(DERIVATIVES)[:, None]
        self._magnitudes = np.abs(basis.rates[:, None]) ** np.arange(DERIVATIVES)
        self._tables: dict[float, _Table] = {}

    def first(self, signals: Signals, horizon: float, start: float = 0.0) -> Descent | None:
        """First descent of any of the signals in (start, horizon], None if there is none."""
        if len(signals.constants) == 0:
            return None
        constants: list[float] = signals.constants.tolist()
        while start < horizon:
            until = min(horizon, start + self._window)
            latest = 2 * until - start  # a block may end behind
            bounds = self._bounds(signals.coefficients, start, latest)
            if self._eternal and all(c > bound[0] for c, bound in zip(constants, bounds, strict=True)):
                return None
            if not math.isfinite(sum([bound[0] + bound[-1] for bound in bounds])):
                raise NumericalFailure("the motion is not finite")
            if start == 0.0 and (near := self._near(signals.coefficients, constants, bounds, latest)) is not None:
                return near if near.time <= horizon else None
            step = self._step(constants, bounds, until - start)
            found = self._search_block(signals.coefficients, constants, bounds, start, step, horizon)
            if found is not None:
                return found
            start += INTERVALS * step
        return None

    def simultaneous(self, signals: Signals, found: Descent) -> list[int]:
        """The signals that reach zero at a first descent, its own among them."""
        if len(signals.constants) == 1:
            return [found.signal]
        coefficients, values = signals.coefficients, self.basis.at(found.time)
        reached = (coefficients @ values).real + signals.constants
        slopes = (self.basis.derivative(coefficients) @ values).real
        noise = SIMULTANEOUS * (np.abs(coefficients) @ np.abs(values) + np.abs(signals.constants))
        down = (reached <= noise) & (slopes <= 0)
        down[found.signal] = True
        result: list[int] = down.nonzero()[0].tolist()
        return result

    def signs(self, signals: Signals) -> list[int]:
        """For each signal: +1 or -1 as it is, or becomes at once, positive or negative at t = 0; 0 if it vanishes."""
        derivatives = self._derivatives(signals.coefficients, DERIVATIVES)
        values = (derivatives @ self.basis.at(0.0)).real
        values[0] += signals.constants
        noise = ZERO * (np.abs(derivatives) @ np.abs(self.basis.at(0.0)))  # t^d, d > 0, is zero and has none
        noise[0] += ZERO * np.abs(signals.constants)
        decided = np.abs(values) > noise
        first = np.argmax(decided, axis=0)
        return [int(np.sign(values[order, s])) if decided[order, s] else 0 for s, order in enumerate(first)]

    def _derivatives(self, coefficients: np.ndarray, count: int) -> np.ndarray:
        """Coefficients of g, g', ...: (count, ..., p)."""
        if self.basis.pure and coefficients.ndim == 1:
            return np.asarray(coefficients * self._orders[:count])
        stack = [coefficients]
        for _ in range(count - 1):
            stack.append(self.basis.derivative(stack[-1]))
        return np.array(stack)

    def _bounds(self, coefficients: np.ndarray, start: float, horizon: float) -> list[list[float]]:
        """For every signal, upper bounds of |g|, |g'|, ..., |g^(6)| on [start, horizon], constants left out."""
        if self._eternal and start == 0.0:
            found: list[list[float]] = (np.abs(coefficients) @ self._magnitudes).tolist()
            return found
        with np.errstate(over="ignore", invalid="ignore"):  # what has grown out of all bounds is not finite
            envelope = np.exp(self._decay * start + self._growth * horizon)
            if self.basis.pure:
                found = (np.abs(coefficients) @ (envelope[:, None] * self._magnitudes)).tolist()
                return found
            envelope = envelope * horizon**self.basis.powers
            found = (np.abs(self._derivatives(coefficients, DERIVATIVES)) @ envelope).T.tolist()
            return found

    def _near(
        self, coefficients: np.ndarray, constants: list[float], bounds: list[list[float]], valid: float
    ) -> Descent | None:
        """A first descent near t = 0 that Taylor's theorem certifies at once, None if it is not that plain.

        valid: how long the bounds hold, for ever where nothing grows.

        2 g max|g''| < g'^2 (Kantorovich) gives a falling g one root before 2 g / |g'|; the others stay above zero.
        """
        if len(constants) == 1 or not self.basis.pure:
            return None
        values: list[float] = coefficients.sum(axis=1).real.tolist()
        slopes: list[float] = (coefficients @ self.basis.rates).real.tolist()
        for s, (constant, bound) in enumerate(zip(constants, bounds, strict=True)):
            value, slope = values[s] + constant, slopes[s]
            if not (value > 0 and slope < 0 and 2 * value * bound[2] < slope**2):
                continue
            latest = -2 * value / slope
            if latest > valid and not self._eternal:
                continue
            if all(
                o == s or values[o] + constants[o] > bounds[o][1] * latest or slopes[o] > bounds[o][2] * latest
                for o in range(len(constants))
            ):
                search = _Search(self, self._derivatives(coefficients[s], SAMPLED), constant, bound)
                return Descent(search.root(latest), s)
        return None

    def _step(self, constants: list[float], bounds: list[list[float]], remaining: float) -> float:
        """Sample distance of the next block: a power of two, at which the remainder is small beside the signals.

        Never more than what takes the block to the horizon, where it ends at once.
        """
        longest = _power_of_two_above(remaining / INTERVALS)
        step = math.inf
        for constant, bound in zip(constants, bounds, strict=True):
            if bound[4] > 0:
                wanted = RESOLUTION * (abs(constant) + bound[0]) / HERMITE
                step = min(step, math.sqrt(math.sqrt(wanted / bound[4])))
        return min(longest, _power_of_two_above(step / self.refine) / 2) if math.isfinite(step) else longest

    def _table(self, step: float) -> _Table:
        if step not in self._tables:
            if len(self._tables) >= TABLES:
                self._tables.clear()
            self._tables[step] = _Table.of(self.basis, step)
        return self._tables[step]

    def _search_block(
        self,
        coefficients: np.ndarray,
        constants: list[float],
        bounds: list[list[float]],
        start: float,
        step: float,
        horizon: float,
    ) -> Descent | None:
        """First descent in a block of intervals; all signals are sampled in one product."""
        local = coefficients if start == 0 else self.basis.shifted(coefficients, start)
        table = self._table(step)
        controls = _parts(local) @ table.controls
        self.evaluations += INTERVALS + 1
        suspects = _doubtful(controls, constants, bounds, step)
        first: Descent | None = None
        end = horizon - start
        for k, s in sorted(suspects):  # the earliest doubt first: a descent found ends the search for others sooner
            if max(0, (k - 1) // 3) * step >= end:
                break
            search = _Search(self, self._derivatives(local[s], SAMPLED), constants[s], bounds[s])
            found = search.in_block(_intervals(suspects[k, s]), table, step, end)
            if found is not None and (first is None or found < end or s > first.signal):
                first = Descent(start + found, s)
                end = first.time - start
        return first


@dataclass(frozen=True)
class _Table:
    """Samples of a basis at 0, h, ..., as real rows for the products with ``_parts``.

    values: (2p, INTERVALS + 1), phi. controls: (2p, 3 INTERVALS + 1), the Bernstein control values of every interval
    in their order, a sample shared by the two intervals that it bounds.
    """

    values: np.ndarray
    controls: np.ndarray

    @classmethod
    def of(cls, basis: Exponentials, step: float) -> _Table:
        """The table of one sample distance h [s]."""
        identity = np.eye(len(basis.rates), dtype=complex)
        samples = basis.at(step * np.arange(INTERVALS + 1)).T
        slopes = (basis.derivative(identity) @ samples) * (step / 3)
        controls = np.empty((len(samples), 3 * INTERVALS + 1), complex)
        controls[:, ::3] = samples
        controls[:, 1::3] = samples[:, :-1] + slopes[:, :-1]
        controls[:, 2::3] = samples[:, 1:] - slopes[:, 1:]
        return cls(*(np.ascontiguousarray(np.ascontiguousarray(c.T).view(float).T) for c in (samples, controls)))


def _doubtful(
    controls: np.ndarray, constants: list[float], bounds: list[list[float]], step: float
) -> dict[tuple[int, int], list[int]]:
    """Control values (s, 3 INTERVALS + 1) that leave room for a root: by (the first of them, signal), ascending."""
    limits = [HERMITE * step**4 * bound[4] - constant for constant, bound in zip(constants, bounds, strict=True)]
    rows, places = (controls <= np.array(limits)[:, None]).nonzero()
    found: dict[tuple[int, int], list[int]] = {}
    firsts = np.searchsorted(rows, np.arange(len(constants) + 1)).tolist()
    every: list[int] = places.tolist()
    for s, constant in enumerate(constants):
        doubtful = every[firsts[s] : firsts[s + 1]]
        if doubtful and doubtful[0] < 3 and _lifts_off(controls[s, :4].tolist(), constant, step, bounds[s]):
            doubtful = [k for k in doubtful if k > 2]
        if doubtful:
            found[doubtful[0], s] = doubtful
    return found


def _intervals(controls: list[int]) -> Iterator[int]:
    """The intervals, ascending, whose control values are among these."""
    last = -1
    for k in controls:
        interval, position = divmod(k, 3)
        for candidate in (interval - 1, interval) if position == 0 else (interval,):
            if last < candidate < INTERVALS:
                last = candidate
                yield candidate


class _Search:
    """Search for the first descent of one signal, with bounds (7,) that hold on every interval it is asked about.

    derivatives: coefficients (5, p) of g and its first four derivatives.
    """

    def __init__(self, finder: DescentFinder, derivatives: np.ndarray, constant: float, bounds: list[float]) -> None:
        self._finder = finder
        self._basis = finder.basis
        self._rates = finder.basis.rates if finder.basis.pure else None
        self._rows = _parts(derivatives)
        self._constant = constant
        self._bounds = bounds
        self._noise = ZERO * (bounds[0] + abs(constant)), ZERO * bounds[1], ZERO * bounds[2]

    def in_block(self, intervals: Iterable[int], table: _Table, step: float, end: float) -> float | None:
        """First descent in these intervals of a block, up to ``end``, from the block's start."""
        for interval in intervals:
            left = interval * step
            if left >= end:
                return None
            ends = (self._rows @ table.values[:, interval : interval + 2]).T.tolist()
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
        self._finder.evaluations += 1
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


def _lifts_off(controls: list[float], constant: float, width: float, bounds: list[float]) -> bool:
    """``_Search._rises`` by the Bernstein coefficients of an interval, without their constant."""
    left, inner_left, inner_right, right = controls
    if left + constant < -ZERO * (bounds[0] + abs(constant)):
        return False
    lifted = min(3 * (inner_left + constant), 1.5 * (inner_right + constant), right + constant)
    return lifted > LIFTED * width**4 * bounds[4]


def _parts(coefficients: np.ndarray) -> np.ndarray:
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


def _power_of_two_above(value: float) -> float:
    """The smallest power of two that is greater than ``value``."""
    return math.ldexp(1.0, math.frexp(value)[1])
