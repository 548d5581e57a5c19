"""Estimate of the root of a monotone function in an interval, from its values and slopes at both ends."""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled

__all__ = ["estimate"]


@compiled
def estimate(numbers: Numbers, at_left: int, at_right: int, width: float) -> float:
    """Return the root of a monotone function as a fraction of its interval, by inverse cubic Hermite interpolation."""
    rise = numbers[at_right] - numbers[at_left]
    slope_left, slope_right = numbers[at_left + 1], numbers[at_right + 1]
    s = -numbers[at_left] / rise if rise != 0.0 else 0.5
    if slope_left * rise > 0.0 and slope_right * rise > 0.0:
        toward_left, toward_right = rise / (slope_left * width), rise / (slope_right * width)
        s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right)
    return min(max(s, 0.01), 0.99)
