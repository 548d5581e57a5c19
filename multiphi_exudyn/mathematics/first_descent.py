"""First descent of a sum of exponentials through zero, certified: no crossing is stepped over.

    g(t) = constant + Re sum_j a_j (t/T)^d_j exp(lambda_j t) >= 0 at t = 0;   wanted: the first t with g falling below 0

Between two samples a distance h apart g differs from its cubic Hermite interpolant by at most
h^4/384 max|g''''|, and max|g^(k)| <= sum_j |a_j^(k)| (t/T)^d_j exp(Re lambda_j t) is known in closed form. A cubic
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
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.root_search import HERMITE, SAMPLED, RootSearch, lifts_off, real_parts
from multiphi_exudyn.mathematics.round_off import ZERO

__all__ = ["TABLES", "TABLE_NUMBERS", "Descent", "DescentFinder", "Signals"]

DERIVATIVES = 7  # g and its derivatives up to the sixth
INTERVALS = 64  # in a block
TABLES = 8  # sample tables kept for a basis: their steps are powers of two, most events need one of a few
TABLE_NUMBERS = 2 * (4 * INTERVALS + 2)  # floats in a sample table for an exponential
RESOLUTION = 0.02  # wanted remainder of a block's intervals, of the signal's typical size
PATIENCE = 1000  # blocks, less than a second, after which a search looks at how many are left,
MOST_BLOCKS = 1_000_000  # of which it takes so many at most: minutes
WINDOW = 1.0  # of the time in which the fastest growing exponential grows e-fold: bounds hold no longer than twice this
SIMULTANEOUS = 1e-11  # of sum |a_j|: a falling signal farther from zero at another's root has its own later,
INSTANT = 1e-9  # of 1 / max |lambda|: and so has one that is nearer but takes longer, unless it is round-off


@dataclass(frozen=True)
class Signals:
    """s signals on one basis: coefficients (s, p) complex, constants (s,).

    noise: (s,) what is round-off of the sums that the signals are, None where that of their exponentials is all.
    """

    coefficients: np.ndarray
    constants: np.ndarray
    noise: np.ndarray | None = None


@dataclass(frozen=True)
class Descent:
    """time of a first descent, and the position of the signal that falls."""

    time: float
    signal: int


class DescentFinder:
    """Finds first descents of signals on one basis of exponentials; keeps that basis' sample tables.

    refine: factor on the density of the samples (the answer does not depend on it; the work does). The compiled loop
    takes it when it first meets the level. instant: time [s] in which nothing moves.
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
        self._fastest = float(np.max(np.abs(basis.rates), initial=0.0))
        self.instant = INSTANT / self._fastest if self._fastest else 0.0
        self._magnitudes = np.abs(basis.rates[:, None]) ** np.arange(DERIVATIVES)
        self._tables: dict[float, _Table] = {}

    def first(self, signals: Signals, horizon: float, start: float = 0.0) -> Descent | None:
        """First descent of any of the signals in (start, horizon], None if there is none.

        Raises NumericalFailure where the motion is not finite, or so fast that the search would take for ever.
        """
        searched = 0
        if len(signals.constants) == 0:
            return None
        constants: list[float] = signals.constants.tolist()
        noise: list[float] = [0.0] * len(constants) if signals.noise is None else signals.noise.tolist()
        while start < horizon:
            until = min(horizon, start + self._window)
            latest = 2 * until - start  # a block may end behind
            bounds = self._bounds(signals.coefficients, start, latest)
            if self._eternal and all(c > bound[0] for c, bound in zip(constants, bounds, strict=True)):
                return None
            if not math.isfinite(sum([bound[0] + bound[-1] for bound in bounds])):
                raise NumericalFailure("the motion is not finite")
            if (
                start == 0.0
                and (near := self._near(signals.coefficients, constants, bounds, noise, latest)) is not None
            ):
                return near if near.time <= horizon else None
            step = self._step(constants, bounds, until - start)
            searched += 1
            if searched > PATIENCE and horizon - start > MOST_BLOCKS * INTERVALS * step:
                raise NumericalFailure(
                    f"search for the next event: got motion of up to {self._fastest / (2 * math.pi):g} Hz, whose "
                    f"samples every {step:g} s until the end, in {horizon - start:g} s, would take for ever; "
                    "need fewer modes or a shorter run"
                )
            found = self._search_block(signals.coefficients, constants, bounds, noise, start, step, horizon)
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
        terms = np.abs(coefficients) @ np.abs(values) + np.abs(signals.constants)
        soon = np.maximum(ZERO * terms, -slopes * self.instant)
        down = (reached <= np.minimum(SIMULTANEOUS * terms, soon)) & (slopes <= 0) & (terms > 0)  # nothing never falls
        down[found.signal] = True
        result: list[int] = down.nonzero()[0].tolist()
        return result

    def signs(self, signals: Signals, sizes: np.ndarray, since: int = 0) -> list[int]:
        """For each signal: +1 or -1 as it is, or becomes at once, positive or negative at t = 0; 0 if it vanishes.

        sizes: (s, p) of which terms the coefficients are sums. since: derivatives of a lower order are zero.
        """
        derivatives = self._derivatives(signals.coefficients, DERIVATIVES)
        values = (derivatives @ self.basis.at(0.0)).real
        values[0] += signals.constants
        at_once = np.abs(self.basis.at(0.0))  # t^d, d > 0, is zero and has no round-off
        noise = np.zeros_like(values)
        for order in range(DERIVATIVES):
            noise[order] = ZERO * (sizes @ at_once)
            sizes = self.basis.bounding.derivative(sizes)
        noise[0] += ZERO * np.abs(signals.constants)
        decided = np.abs(values) > noise
        decided[:since] = False
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
            envelope = envelope * (horizon / self.basis.unit) ** self.basis.powers
            found = (np.abs(self._derivatives(coefficients, DERIVATIVES)) @ envelope).T.tolist()
            return found

    def _near(
        self,
        coefficients: np.ndarray,
        constants: list[float],
        bounds: list[list[float]],
        noise: list[float],
        valid: float,
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
                search = RootSearch(self.basis, self._derivatives(coefficients[s], SAMPLED), constant, bound, noise[s])
                found = search.root(latest)
                self.evaluations += search.evaluations
                return Descent(found, s)
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
        noise: list[float],
        start: float,
        step: float,
        horizon: float,
    ) -> Descent | None:
        """First descent in a block of intervals; all signals are sampled in one product."""
        local = coefficients if start == 0 else self.basis.shifted(coefficients, start)
        table = self._table(step)
        controls = real_parts(local) @ table.controls
        self.evaluations += INTERVALS + 1
        suspects = _doubtful(controls, constants, bounds, noise, step)
        first: Descent | None = None
        end = horizon - start
        for k, s in sorted(suspects):  # the earliest doubt first: a descent found ends the search for others sooner
            if max(0, (k - 1) // 3) * step >= end:
                break
            search = RootSearch(self.basis, self._derivatives(local[s], SAMPLED), constants[s], bounds[s], noise[s])
            found = search.in_block(_intervals(suspects[k, s]), table.values, step, end)
            self.evaluations += search.evaluations
            if found is not None and (first is None or found < end or s > first.signal):
                first = Descent(start + found, s)
                end = first.time - start
        return first


@dataclass(frozen=True)
class _Table:
    """Samples of a basis at 0, h, ..., as real rows for the products with ``real_parts``.

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
    controls: np.ndarray, constants: list[float], bounds: list[list[float]], noise: list[float], step: float
) -> dict[tuple[int, int], list[int]]:
    """Control values (s, 3 INTERVALS + 1) that leave room for a root: by (the first of them, signal), ascending."""
    limits = [HERMITE * step**4 * bound[4] - constant for constant, bound in zip(constants, bounds, strict=True)]
    rows, places = (controls <= np.array(limits)[:, None]).nonzero()
    found: dict[tuple[int, int], list[int]] = {}
    firsts = np.searchsorted(rows, np.arange(len(constants) + 1)).tolist()
    every: list[int] = places.tolist()
    for s, constant in enumerate(constants):
        doubtful = every[firsts[s] : firsts[s + 1]]
        if doubtful and doubtful[0] < 3 and lifts_off(controls[s, :4].tolist(), constant, step, bounds[s], noise[s]):
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


def _power_of_two_above(value: float) -> float:
    """The smallest power of two that is greater than ``value``."""
    return math.ldexp(1.0, math.frexp(value)[1])
