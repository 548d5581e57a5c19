"""Corners: instants at which a function of time jumps or has a kink, found to round-off.

Beside a single corner the function continues a smooth one on either side. Both follow from the intervals before and
after, u_-(t) and u_+(t), polynomials of degree DEGREE; halving an interval by which of them is nearer to the function
leads to the corner, whether the value jumps there or its slope does:

    u(t) = u_-(t) for t < t_c,   u_+(t) for t >= t_c

A steep smooth function agrees with neither, and is not taken for a jump.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.polynomial.chebyshev as chebyshev

__all__ = ["INSTANT", "corners_in", "distinct"]

DEGREE = 4  # of the polynomials beside a corner; extrapolation over one interval multiplies round-off by 600
INSTANT = 4 * np.finfo(float).eps  # of the end of time: closer times are one instant
HALVINGS = 60  # of an interval, after which it contains no further number
CHECKS = 12  # places of an interval in which function and polynomials have to agree

Function = Callable[[np.ndarray], np.ndarray]


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
    x = np.cos(np.linspace(np.pi, 0.0, DEGREE + 1))
    t = np.clip(starts[:, None] + widths[:, None] * (x + 1) / 2, 0.0, end)
    series = function(t.ravel()).reshape(t.shape) @ np.linalg.inv(chebyshev.chebvander(x, DEGREE)).T

    def at(t: np.ndarray) -> np.ndarray:
        places = (2 * (t.T - starts) / widths - 1).T
        return np.asarray(np.einsum("k...d,kd->k...", chebyshev.chebvander(places, DEGREE), series))

    return at
