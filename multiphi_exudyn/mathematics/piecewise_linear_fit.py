"""Piecewise linear fit: straight segments between samples of a function, all of the same error.

Knots are placed so that all segments have the same error: from one end to the next knot as far as that error allows,
with the smallest error that so many segments can have. The error falls with the square of their number.
Source: H. G. Burchard, Splines (with optimal knots) are better, Applicable Analysis 3 (1974) 309.
"""

from __future__ import annotations

import numpy as np

__all__ = ["MOST_SEGMENTS", "spread", "with_segments"]

MOST_SEGMENTS = 2**10  # a law that needs more is refused
BALANCED = 1e-3  # of the smallest error that so many segments can have: accuracy of the search
NONE_LEFT = 1e-14  # of an error that is known to suffice: below it the segments are the function itself


def spread(sides: list[np.ndarray], values: list[np.ndarray], error: float) -> list[np.ndarray]:
    """Return the samples that are knots on every side, each segment as long as this error [N] allows."""
    return [_knots(q, value, error) for q, value in zip(sides, values, strict=True)]


def _knots(q: np.ndarray, values: np.ndarray, error: float) -> np.ndarray:
    chosen, last = [0], len(q) - 1
    while chosen[-1] < last and len(chosen) <= MOST_SEGMENTS + 1:
        start, reach = chosen[-1], 1
        while start + reach < last and _error(q, values, start, min(start + 2 * reach, last)) <= error:
            reach *= 2
        low, high = min(start + reach, last), min(start + 2 * reach, last)
        while high - low > 1:
            middle = (low + high) // 2
            if _error(q, values, start, middle) <= error:
                low = middle
            else:
                high = middle
        chosen.append(high if _error(q, values, start, high) <= error else low)
    return np.array(chosen)


def _error(q: np.ndarray, values: np.ndarray, a: int, b: int) -> float:
    """Return the largest error [N] of the straight line between samples a and b."""
    line = values[a] + (values[b] - values[a]) / (q[b] - q[a]) * (q[a : b + 1] - q[a])
    return float(np.max(np.abs(values[a : b + 1] - line)))


def with_segments(sides: list[np.ndarray], values: list[np.ndarray], count: int, error: float) -> list[np.ndarray]:
    """Return the knots of at most ``count`` segments with the smallest error [N]; ``error`` is known to suffice."""
    high, low, best = error, 0.0, spread(sides, values, error)
    while high - low > BALANCED * high:
        middle = (low + high) / 2 if low else high / 4  # segments grow with error^-1/2
        knots = spread(sides, values, middle)
        if sum(len(index) - 1 for index in knots) <= count:
            high, best = middle, knots
        else:
            low = middle
        if high <= NONE_LEFT * error:
            break
    return best
