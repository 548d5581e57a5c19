"""Lines of a law: the straight segments that approximate the function of a force law, or those of its table.

The knots lie on the law, and the zero of F nearest to q = 0 is one of them. piecewise_linear_fit.py determines their
number.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mathematics.functions.piecewise_linear_fit import MOST_SEGMENTS, spread, with_segments
from multiphi_exudyn.mechanics.structures.arguments import is_real

__all__ = ["Function", "LawLines"]

Function = Callable[[Any], Any]

SAMPLES = 2**14  # of a law on either side of its central knot; knots are samples
ZERO_FORCE = 1e-14  # of the largest force: a smaller one counts as zero


@dataclass(frozen=True)
class LawLines:
    """Arguments of a ``ForceLaw``, from which the segments follow; label: name of the law in errors."""

    label: str
    law: Function | Sequence[Any]
    tolerance: float | None
    span: tuple[float, float] | None
    segments: int | None

    def knots_and_forces(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Knots (k,) [m], F (k,) [N] there, the centre [m], and the error relative to the largest F."""
        return self._from_function() if callable(self.law) else self._from_table()

    def _from_table(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        unused = {"tolerance": self.tolerance, "segments": self.segments, "span": self.span}
        for name, value in unused.items():
            if value is not None:
                raise MultiPhiValueError(f"{self.label} {name}: got {value!r} for a table, need none")
        try:
            knots, forces = (np.array(column, dtype=float) for column in self.law)  # type: ignore[union-attr]
        except (TypeError, ValueError) as error:
            needed = "need a function, or two arrays: q ascending, and F"
            raise MultiPhiTypeError(f"{self.label} law: got {type(self.law).__name__}, {needed}") from error
        if knots.ndim != 1 or knots.shape != forces.shape or len(knots) < 2:
            raise MultiPhiValueError(f"{self.label} law: got shapes {knots.shape} and {forces.shape}, need (k,) twice")
        if not (np.all(np.isfinite(knots)) and np.all(np.isfinite(forces)) and np.all(np.diff(knots) > 0)):
            raise MultiPhiValueError(f"{self.label} law: got a table of q and F, need finite numbers and q ascending")
        centre = _centre(knots, forces)
        if centre not in knots:
            index = int(np.searchsorted(knots, centre))
            value = float(np.interp(centre, knots, forces))
            knots, forces = np.insert(knots, index, centre), np.insert(forces, index, value)
        return knots, forces, centre, 0.0

    def _from_function(self) -> tuple[np.ndarray, np.ndarray, float, float]:
        low, high = self._checked_span()
        accuracy = self._checked_accuracy()
        q = np.linspace(low, high, SAMPLES + 1)
        centre = _centre(q, self.sampled(q))
        sides = [
            q for q in (np.linspace(low, centre, SAMPLES + 1), np.linspace(centre, high, SAMPLES + 1)) if q[-1] > q[0]
        ]
        values = [self.sampled(side) for side in sides]
        largest = max(float(np.max(np.abs(value))) for value in values)
        if isinstance(accuracy, int):
            chosen = with_segments(sides, values, max(accuracy, len(sides)), 2 * largest)
        else:
            chosen = self._within(sides, values, accuracy * largest)
        knots = np.concatenate([side[index[first:]] for first, (side, index) in _numbered(sides, chosen)])
        forces = np.concatenate([value[index[first:]] for first, (value, index) in _numbered(values, chosen)])
        between = np.concatenate([(side[1:] + side[:-1]) / 2 for side in sides])
        error = np.max(np.abs(self.sampled(between) - np.interp(between, knots, forces)))
        return knots, forces, centre, float(error / largest) if largest else 0.0

    def _within(self, sides: list[np.ndarray], values: list[np.ndarray], error: float) -> list[np.ndarray]:
        count = sum(len(index) - 1 for index in spread(sides, values, error))
        if count > MOST_SEGMENTS:
            raise MultiPhiValueError(
                f"{self.label} tolerance: got {self.tolerance!r}, which needs more than {MOST_SEGMENTS} segments, "
                "need a larger one"
            )
        return with_segments(sides, values, count, error)

    def _checked_span(self) -> tuple[float, float]:
        span = self.span
        if not (isinstance(span, (tuple, list, np.ndarray)) and len(span) == 2 and all(map(is_real, span))):
            raise MultiPhiTypeError(f"{self.label} span: got {span!r}, need (q_lo, q_hi) for a function")
        low, high = float(span[0]), float(span[1])
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise MultiPhiValueError(f"{self.label} span: got {span!r}, need finite q_lo < q_hi")
        return low, high

    def _checked_accuracy(self) -> int | float:
        """Number of segments (int), or the tolerance."""
        if (self.tolerance is None) == (self.segments is None):
            received = f"got tolerance {self.tolerance!r} and segments {self.segments!r}"
            raise MultiPhiValueError(f"{self.label}: {received}, need exactly one of them for a function")
        if self.segments is None:
            if not is_real(self.tolerance):
                raise MultiPhiTypeError(f"{self.label} tolerance: got {self.tolerance!r}, need a number")
            if not (self.tolerance is not None and 0 < self.tolerance < 1):
                raise MultiPhiValueError(f"{self.label} tolerance: got {self.tolerance!r}, need 0 < tolerance < 1")
            return float(self.tolerance)
        if not isinstance(self.segments, (int, np.integer)) or isinstance(self.segments, bool):
            raise MultiPhiTypeError(f"{self.label} segments: got {self.segments!r}, need an integer")
        if not 2 <= self.segments <= MOST_SEGMENTS:
            raise MultiPhiValueError(f"{self.label} segments: got {self.segments!r}, need 2 to {MOST_SEGMENTS}")
        return int(self.segments)

    def sampled(self, q: np.ndarray) -> np.ndarray:
        """F (k,) [N] at q (k,) [m], from a function of arrays or of numbers."""
        assert callable(self.law), "a table has no samples"
        try:
            values = np.asarray(self.law(q), dtype=float)
        except (TypeError, ValueError):
            values = np.array([], dtype=float)
        if values.shape != q.shape:
            values = self._one_by_one(q)
        if not np.all(np.isfinite(values)):
            worst = float(q[np.argmin(np.isfinite(values))])
            raise MultiPhiValueError(f"{self.label} law: gives no finite force at q = {worst:g}, need one on the span")
        return values

    def _one_by_one(self, q: np.ndarray) -> np.ndarray:
        assert callable(self.law), "a table has no samples"
        try:
            return np.array([float(self.law(each)) for each in q.tolist()])
        except (TypeError, ValueError, ArithmeticError) as error:
            raise MultiPhiTypeError(f"{self.label} law: fails ({error}), need a function of q [m] in N") from error


def _centre(q: np.ndarray, forces: np.ndarray) -> float:
    """Zero of the lines through (q, F) nearest to q = 0; without a zero, the point nearest to q = 0."""
    nearest = float(np.clip(0.0, q[0], q[-1]))
    small = np.abs(forces) <= ZERO_FORCE * np.max(np.abs(forces))
    if abs(np.interp(nearest, q, forces)) <= ZERO_FORCE * np.max(np.abs(forces)):
        return nearest
    crossing = np.flatnonzero(np.sign(forces[:-1]) * np.sign(forces[1:]) < 0)
    rise = forces[crossing + 1] - forces[crossing]
    zeros = np.concatenate([q[small], q[crossing] - forces[crossing] * (q[crossing + 1] - q[crossing]) / rise])
    return float(zeros[np.argmin(np.abs(zeros))]) if len(zeros) else nearest


def _numbered(columns: list[np.ndarray], chosen: list[np.ndarray]) -> list[tuple[int, tuple[np.ndarray, np.ndarray]]]:
    """For every column and its knots: 1 if it begins with the last sample of the previous column, else 0."""
    return [(min(i, 1), pair) for i, pair in enumerate(zip(columns, chosen, strict=True))]
