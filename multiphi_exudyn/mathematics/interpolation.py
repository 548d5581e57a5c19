"""Interpolation: a function of time as polynomials on carriers, to a tolerance.

    u(t) = Re( exp(i omega_i s) sum_d a_id s^d ),   s = t - t_i,   on the piece t_i <= t < t_i+1

Pieces are interpolated at Chebyshev points of the second kind, their ends among them, and halved until the interpolant
agrees with the function at the points midway between, and at samples of the whole interval that are spread unevenly,
the multiples of the golden ratio: no periodic function hides from them. Details shorter than the gaps between the
samples, 1.2 / number of them, may be missed. A piece that does not converge is searched for a jump or a kink, and the
pieces are built again with that instant as an end.
Source: L. N. Trefethen, Approximation Theory and Approximation Practice, 2013, ch. 2 and 16; V. T. Sos, On the
distribution mod 1 of the sequence n alpha, Ann. Univ. Sci. Budapest 1 (1958) 127.

Corners are found to round-off. Beside a single corner the function continues a smooth one on either side. Both follow
from the intervals before and after, u_-(t) and u_+(t), polynomials of degree SIDE_DEGREE; halving an interval by which
of them is nearer to it leads to the corner, whether the value jumps there or its slope does:

    u(t) = u_-(t) for t < t_c,   u_+(t) for t >= t_c

A steep smooth function agrees with neither, and is not taken for a jump.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.polynomial.chebyshev as chebyshev

from multiphi_exudyn.errors import NumericalFailure

__all__ = [
    "DEGREE",
    "FEW_SAMPLES",
    "INSTANT",
    "MANY_SAMPLES",
    "MOST_PIECES",
    "Function",
    "Interpolant",
    "Samples",
    "corners_in",
    "distinct",
    "interpolated",
]

DEGREE = 8  # of the polynomials that stand for smooth functions
MOST_PIECES = 2**18  # a function that needs more is not smooth at the given tolerance
FIRST_PIECES = 64  # into which a function's interval is divided before any comparison
ROUND_OFF = 1e-13  # of the largest value: least tolerance of an interpolant
SHORT = 2**-10  # of a first piece: one that has not converged may contain a corner
MOST_CORNERS = 2**12  # at once: with more pieces that have not converged, the function is not resolved yet
IMPULSE = 1 / MOST_PIECES  # of tolerance times interval: allowed error of the integral of a piece
PASSES = 8  # that search corners: round-off would give one more each time
MANY_SAMPLES = 28657  # of a function that takes many times at once; Fibonacci numbers divide most evenly
FEW_SAMPLES = 10946  # of one that takes single times, a microsecond or more each

Function = Callable[[np.ndarray], np.ndarray]
SIDE_DEGREE = 4  # of the polynomials beside a corner; extrapolation over one interval multiplies round-off by 600
INSTANT = 4 * np.finfo(float).eps  # of the end of time: closer times are one instant
HALVINGS = 60  # of an interval, after which it contains no further number
CHECKS = 12  # places of an interval in which function and polynomials have to agree


@dataclass(frozen=True)
class Samples:
    """A function at ascending times (k,) of [0, end]."""

    times: np.ndarray
    values: np.ndarray

    @classmethod
    def of(cls, function: Function, end: float, count: int = MANY_SAMPLES) -> Samples:
        """Return ``count`` samples, spread over [0, end] as multiples of the golden ratio."""
        times = end * np.sort(np.arange(0.5, count) * ((math.sqrt(5) - 1) / 2) % 1.0)
        return cls(times, function(np.concatenate([times, [0.0, end]]))[:-2])  # at the ends a number is enough

    @property
    def largest(self) -> float:
        """Largest |u|."""
        return float(np.max(np.abs(self.values), initial=0.0))

    def errors(self, lefts: np.ndarray, rights: np.ndarray, carriers: np.ndarray, series: np.ndarray) -> np.ndarray:
        """Return the largest distance (n,) of the samples from the Chebyshev series of pieces, which do not overlap."""
        order, errors = np.argsort(lefts), np.zeros(len(lefts))
        owner = order[np.maximum(np.searchsorted(lefts[order], self.times, side="right") - 1, 0)]
        inside = (self.times >= lefts[owner]) & (self.times < rights[owner])
        owner, t = owner[inside], self.times[inside]
        places = 2 * (t - lefts[owner]) / (rights[owner] - lefts[owner]) - 1
        approximated = np.sum(chebyshev.chebvander(places, DEGREE) * series[owner], axis=1)
        approximated = approximated * np.exp(1j * carriers[owner] * (t - lefts[owner]))
        np.maximum.at(errors, owner, np.abs(approximated - self.values[inside]))
        return errors


@dataclass(frozen=True)
class Interpolant:
    """Pieces from edge to edge (n + 1,): carriers omega (n,), a (n, D + 1).

    error: the largest, with that of pieces too short to matter spread over the interval.
    """

    edges: np.ndarray
    carriers: np.ndarray
    coefficients: np.ndarray
    error: float


def interpolated(
    function: Function, omega: Function, end: float, tolerance: float, samples: Samples, breaks: np.ndarray
) -> Interpolant:
    """Return the interpolant of a function of (k,) times on [0, end] to ``tolerance``, with carriers omega.

    breaks: known corners. tolerance: in units of u. Raises NumericalFailure where MOST_PIECES are not enough.
    """
    corners = distinct(breaks, end)
    for is_searched in (*[True] * PASSES, False):
        pieces = _Pieces(function, omega, end, tolerance, samples, corners, is_searched)
        new_corners = pieces.halved()
        if not len(new_corners):
            break
        corners = distinct(np.concatenate([corners, new_corners]), end)
    return pieces.interpolant()


class _Pieces:
    """Pieces between known corners, halved until they have a tolerance."""

    def __init__(
        self,
        function: Function,
        omega: Function,
        end: float,
        tolerance: float,
        samples: Samples,
        corners: np.ndarray,
        searched: bool,
    ) -> None:
        self._function, self._omega, self._end, self._tolerance = function, omega, end, tolerance
        self._samples, self._corners, self._searched = samples, corners, searched
        self._size, self._worst = samples.largest, 0.0
        self._done: list[tuple[np.ndarray, ...]] = []
        self._left = 0.0

    def halved(self) -> np.ndarray:
        """Halve pieces until they agree with the function; return the corners (k,) found meanwhile."""
        edges = self._first_edges()
        lefts, rights, count, corners = edges[:-1], edges[1:], 0, list[np.ndarray]()
        while len(lefts):
            carriers = self._omega((lefts + rights) / 2)
            series, errors = self._fit(lefts, rights, carriers)
            is_close, impulses = errors <= self._allowed, errors * (rights - lefts)
            is_good = is_close | (impulses <= IMPULSE * self._allowed * self._end)
            self._worst = max(self._worst, float(np.max(errors[is_close], initial=0.0)))
            self._left += float(np.sum(impulses[is_good & ~is_close]))
            self._done.append(tuple(column[is_good] for column in (lefts, rights, carriers, series)))
            count += int(np.sum(is_good))
            lefts, rights = lefts[~is_good], rights[~is_good]
            new_corners = self._corners_in(lefts, rights)
            corners.append(new_corners[np.isfinite(new_corners)])
            lefts, rights = lefts[np.isnan(new_corners)], rights[np.isnan(new_corners)]
            if count + 2 * len(lefts) > MOST_PIECES or np.any(rights - lefts <= INSTANT * self._end):
                raise NumericalFailure(
                    f"function of time: not smooth enough for a tolerance of {self._tolerance:g} near t = "
                    f"{lefts[0]:g} s (more than {MOST_PIECES} polynomials of degree {DEGREE}), need a larger "
                    "tolerance, or breaks where it or its derivatives jump"
                )
            middles = (lefts + rights) / 2
            lefts, rights = np.concatenate([lefts, middles]), np.concatenate([middles, rights])
        return np.concatenate(corners)

    def interpolant(self) -> Interpolant:
        """The pieces, once they agree."""
        lefts, rights, carriers, series = (np.concatenate(parts) for parts in zip(*self._done, strict=True))
        order = np.argsort(lefts)
        widths = (rights - lefts)[order, None]
        scaled = series[order] @ _power_matrix() / widths ** np.arange(DEGREE + 1)
        edges = np.append(lefts[order], self._end)
        error = max(self._worst, ROUND_OFF * self._size) + self._left / self._end
        return Interpolant(edges, carriers[order], scaled, error)

    @property
    def _allowed(self) -> float:
        return max(self._tolerance, ROUND_OFF * self._size)

    def _first_edges(self) -> np.ndarray:
        even = np.arange(FIRST_PIECES + 1) * (self._end / FIRST_PIECES)
        if not len(self._corners):
            return even
        apart = np.min(np.abs(even[:, None] - self._corners), axis=1) > 2 * INSTANT * self._end
        return np.union1d(even[apart], self._corners)

    def _corners_in(self, lefts: np.ndarray, rights: np.ndarray) -> np.ndarray:
        """Corners of the pieces that are short enough to be searched for one, NaN elsewhere."""
        result = np.full(len(lefts), np.nan)
        indices = np.flatnonzero(rights - lefts <= SHORT * self._end / FIRST_PIECES)
        if self._searched and 0 < len(indices) <= MOST_CORNERS:
            corners = corners_in(self._function, lefts[indices], rights[indices], self._end, self._allowed)
            edges = np.concatenate([[0.0], self._corners, [self._end]])
            apart = np.min(np.abs(corners[:, None] - edges), axis=1) > 2 * INSTANT * self._end
            result[indices] = np.where(apart, corners, np.nan)
        return result

    def _fit(self, lefts: np.ndarray, rights: np.ndarray, carriers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Chebyshev series (n, D + 1) of every piece on its carrier, its error (n,) midway and at the samples."""
        points, between, fitted, midway = _nodes()
        values, checks = (self._sampled(lefts, rights, carriers, places) for places in (points, between))
        self._size = max(self._size, float(np.max(np.abs(values))))
        series = (values @ fitted.T).astype(complex)
        errors = np.max(np.abs(series @ midway.T - checks), axis=1)
        return series, np.maximum(errors, self._samples.errors(lefts, rights, carriers, series))

    def _sampled(self, lefts: np.ndarray, rights: np.ndarray, carriers: np.ndarray, places: np.ndarray) -> np.ndarray:
        """The function without its carrier at places in [0, 1] of every piece, at corners and ends from inside."""
        inset, ends = INSTANT * self._end, np.concatenate([[0.0], self._corners, [self._end]])
        low, high = lefts + inset * np.isin(lefts, ends), rights - inset * np.isin(rights, ends)
        offsets = (rights - lefts)[:, None] * places
        times = np.clip(lefts[:, None] + offsets, low[:, None], high[:, None])
        values = self._function(times.ravel()).reshape(times.shape)
        if not np.all(np.isfinite(values)):
            raise NumericalFailure("function of time: gives a value that is not finite")
        return np.asarray(values * np.exp(-1j * carriers[:, None] * offsets) if np.any(carriers) else values)


@functools.cache
def _nodes() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Chebyshev points and midway points on [0, 1], values -> Chebyshev series, series -> values midway."""
    angles = np.linspace(math.pi, 0.0, 2 * DEGREE + 1)
    x = np.cos(angles)
    points, between = x[::2], x[1::2]
    fitted = np.linalg.inv(chebyshev.chebvander(points, DEGREE))
    return (points + 1) / 2, (between + 1) / 2, fitted, chebyshev.chebvander(between, DEGREE)


@functools.cache
def _power_matrix() -> np.ndarray:
    """Chebyshev series on [0, 1] -> powers of the place in the piece, (D + 1, D + 1)."""
    rows = []
    for k in range(DEGREE + 1):
        powers = np.polynomial.Polynomial(chebyshev.cheb2poly(np.eye(DEGREE + 1)[k]))
        shifted = powers(np.polynomial.Polynomial([-1.0, 2.0]))
        rows.append(np.pad(shifted.coef, (0, DEGREE + 1 - len(shifted.coef))))
    return np.array(rows)


def corners_in(function: Function, lefts: np.ndarray, rights: np.ndarray, end: float, tolerance: float) -> np.ndarray:
    """Return the corner of every interval (k,) of [0, end], NaN where it is not one corner between smooth functions."""
    widths = rights - lefts
    before, after = (_continued(function, starts, widths, end) for starts in (lefts - widths, rights))
    low, high = lefts.copy(), rights.copy()
    for _ in range(HALVINGS):
        t = low + (high - low) / 2
        u = function(t)
        is_left = (np.abs(u - before(t)) <= np.abs(u - after(t))) & (t < high)
        low, high = np.where(is_left, t, low), np.where(is_left | (t == low), high, t)
    t = lefts[:, None] + widths[:, None] * (np.arange(CHECKS) + 0.5) / CHECKS
    expected = np.where(t < high[:, None], before(t), after(t))
    errors = np.max(np.abs(function(t.ravel()).reshape(t.shape) - expected), axis=1)
    return np.where(errors <= tolerance, high, np.nan)


def distinct(times: np.ndarray, end: float) -> np.ndarray:
    """Return ascending instants inside (0, end), the first of each group of equal ones."""
    inside = np.unique(times[(times > INSTANT * end) & (times < end - INSTANT * end)])
    return inside[np.diff(inside, prepend=-end) > INSTANT * end]


def _continued(function: Function, starts: np.ndarray, widths: np.ndarray, end: float) -> Function:
    """Return polynomials through the function on intervals (k,), to be taken at (k,) or (k, c) times."""
    x = np.cos(np.linspace(np.pi, 0.0, SIDE_DEGREE + 1))
    t = np.clip(starts[:, None] + widths[:, None] * (x + 1) / 2, 0.0, end)
    series = function(t.ravel()).reshape(t.shape) @ np.linalg.inv(chebyshev.chebvander(x, SIDE_DEGREE)).T

    def at(t: np.ndarray) -> np.ndarray:
        places = (2 * (t.T - starts) / widths - 1).T
        return np.asarray(np.einsum("k...d,kd->k...", chebyshev.chebvander(places, SIDE_DEGREE), series))

    return at
