"""Estimate of the root of a monotone function in an interval, from its values and derivatives at both ends."""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled

__all__ = ["estimate"]

NEWTON_STEPS = 3  # for the root of a polynomial: two correct digits become all


@compiled
def estimate(numbers: Numbers, at_left: int, at_right: int, width: float) -> float:
    """Return the root of a monotone function as a fraction of its interval, by inverse cubic Hermite interpolation.

    It is improved by Newton steps for the polynomial that has its first three derivatives at both ends, too.
    """
    rise = numbers[at_right] - numbers[at_left]
    slope_left, slope_right = numbers[at_left + 1], numbers[at_right + 1]
    s = -numbers[at_left] / rise if rise != 0.0 else 0.5
    if slope_left * rise > 0.0 and slope_right * rise > 0.0:
        toward_left, toward_right = rise / (slope_left * width), rise / (slope_right * width)
        s = s * s * (3 - 2 * s) + s * (1 - s) * ((1 - s) * toward_left - s * toward_right)
    return septic_root(numbers, at_left, at_right, width, min(max(s, 0.01), 0.99))


@compiled
def septic_root(numbers: Numbers, at_left: int, at_right: int, width: float, u: float) -> float:
    """Return the root near ``u`` of the septic with the value and three derivatives of both ends.

    Return ``u`` if the septic does not cross zero in the direction of the interval: a function that starts at zero, but
    for round-off, has another root there.

    a_0 + a_1 u + a_2 u^2 + a_3 u^3 + u^4 (b_0 + b_1 v + b_2 v^2 + b_3 v^3),   v = u - 1
    """
    second, third = width * width / 2, width * width * width / 6
    a0, a1 = numbers[at_left], width * numbers[at_left + 1]
    a2, a3 = second * numbers[at_left + 2], third * numbers[at_left + 3]
    b0 = numbers[at_right] - a0 - a1 - a2 - a3
    b1 = width * numbers[at_right + 1] - a1 - 2 * a2 - 3 * a3 - 4 * b0
    b2 = second * numbers[at_right + 2] - a2 - 3 * a3 - 4 * b1 - 6 * b0
    b3 = third * numbers[at_right + 3] - a3 - 4 * b2 - 6 * b1 - 4 * b0
    improved, slope = u, 0.0
    for _ in range(NEWTON_STEPS):
        v, square = improved - 1.0, improved * improved
        rest, rest_slope = b0 + v * (b1 + v * (b2 + v * b3)), b1 + v * (2 * b2 + 3 * v * b3)
        value = a0 + improved * (a1 + improved * (a2 + improved * a3)) + square * square * rest
        slope = a1 + improved * (2 * a2 + 3 * improved * a3) + square * improved * (4 * rest + improved * rest_slope)
        improved -= value / slope if slope != 0.0 else 0.0
    is_reversed = slope * (numbers[at_right] - numbers[at_left]) <= 0.0
    return u if is_reversed or not 0.0 < improved < 1.0 else improved
