"""Where in an interval a monotone function is about zero, from its values and derivatives at both ends."""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled

__all__ = ["guess"]

NEWTON_STEPS = 3  # towards the zero of a polynomial: a guess of two digits becomes one of all


@compiled
def guess(numbers: Numbers, at_left: int, at_right: int, width: float) -> float:
    """Where in its interval, as a fraction, a monotone function is zero: inverse cubic Hermite interpolation.

    Bettered by Newton's steps towards the zero of the polynomial that has its first three derivatives at both ends too.
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
    """The zero near ``u`` of the septic with the value and three derivatives of both ends, where it has the sense of
    the interval, or ``u``: what begins at zero by round-off has another zero there.

    a_0 + a_1 u + a_2 u^2 + a_3 u^3 + u^4 (b_0 + b_1 v + b_2 v^2 + b_3 v^3),   v = u - 1
    """
    second, third = width * width / 2, width * width * width / 6
    a0, a1 = numbers[at_left], width * numbers[at_left + 1]
    a2, a3 = second * numbers[at_left + 2], third * numbers[at_left + 3]
    b0 = numbers[at_right] - a0 - a1 - a2 - a3
    b1 = width * numbers[at_right + 1] - a1 - 2 * a2 - 3 * a3 - 4 * b0
    b2 = second * numbers[at_right + 2] - a2 - 3 * a3 - 4 * b1 - 6 * b0
    b3 = third * numbers[at_right + 3] - a3 - 4 * b2 - 6 * b1 - 4 * b0
    better, slope = u, 0.0
    for _ in range(NEWTON_STEPS):
        v, square = better - 1.0, better * better
        rest, bent = b0 + v * (b1 + v * (b2 + v * b3)), b1 + v * (2 * b2 + 3 * v * b3)
        value = a0 + better * (a1 + better * (a2 + better * a3)) + square * square * rest
        slope = a1 + better * (2 * a2 + 3 * better * a3) + square * better * (4 * rest + better * bent)
        better -= value / slope if slope != 0.0 else 0.0
    turns = slope * (numbers[at_right] - numbers[at_left]) <= 0.0
    return u if turns or not 0.0 < better < 1.0 else better
