"""First descent of signals near t = 0, from values and slopes there and from bounds of their derivatives.

Signals are as in zero_crossing.py, on flat buffers.
"""

from __future__ import annotations

from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import ETERNAL, POWERS, RATES, SCALES, SIZE
from multiphi_exudyn.mathematics.search.block_search import NONE
from multiphi_exudyn.mathematics.search.doubtful_signal import LEFT, RIGHT, find_root, sample_at, set_suspect
from multiphi_exudyn.mathematics.search.signal_bounds import PER_SIGNAL, round_off

__all__ = ["near_descent", "sample_start", "stay_above"]


@compiled
def sample_start(
    ints: Ints, numbers: Numbers, waves: Waves, basis: int, signals: int, constants: int, bounds: int, count: int
) -> None:
    """Set g and g' of every signal at t = 0, (count, 2), behind the bounds."""
    p, powers, rates, unit = ints[basis + SIZE], ints[basis + POWERS], ints[basis + RATES], ints[basis + SCALES]
    for s in range(count):
        value, slope = numbers[constants + s], 0.0
        for j in range(p):
            a = waves[signals + s * p + j]
            if ints[powers + j] == 0:
                value += a.real
                slope += (a * waves[rates + j]).real
            elif ints[powers + j] == 1:
                slope += a.real / numbers[unit]
        numbers[bounds + PER_SIGNAL * count + 2 * s] = value
        numbers[bounds + PER_SIGNAL * count + 2 * s + 1] = slope


@compiled
def stay_above(numbers: Numbers, constants: int, noise: int, bounds: int, count: int, horizon: float) -> int:
    """Return 1 where values and slopes at t = 0 prove that no signal falls in [0, horizon].

    A signal that starts at zero or above rises while g' > max|g''| t; one that starts above zero is above
    g + g' t - max|g''| t^2 / 2, which is least at one of the ends.
    """
    for s in range(count):
        first, start = bounds + PER_SIGNAL * s, bounds + PER_SIGNAL * count + 2 * s
        value, slope, slope_change = numbers[start], numbers[start + 1], numbers[first + 2] * horizon
        lowest = min(value, value + (slope - slope_change / 2) * horizon)
        touches = value >= -round_off(numbers[first], numbers[constants + s], numbers[noise + s])
        if not lowest > 0.0 and not (touches and slope > slope_change):
            return 0
    return 1


@compiled
def near_descent(
    ints: Ints,
    numbers: Numbers,
    waves: Waves,
    basis: int,
    signals: int,
    constants: int,
    noise: int,
    bounds: int,
    count: int,
    valid: float,
    suspect: int,
    scratch_wave: int,
) -> int:
    """Return the signal with a first descent near t = 0 that Taylor's theorem certifies, NONE if it does not.

    2 g max|g''| < g'^2 (Kantorovich) gives a falling g one root before 2 g / |g'|; the others stay above zero.
    valid: until when the bounds hold, for ever where nothing grows. All powers are zero. g and g' at t = 0 are set.
    """
    p, starts = ints[basis + SIZE], bounds + PER_SIGNAL * count
    for s in range(count):
        value, slope = numbers[starts + 2 * s], numbers[starts + 2 * s + 1]
        if value > 0.0 and slope < 0.0 and 2 * value * numbers[bounds + PER_SIGNAL * s + 2] < slope * slope:
            latest = -2 * value / slope
            if (latest <= valid or ints[basis + ETERNAL] == 1) and others_stay_above(
                numbers, starts, bounds, count, s, latest
            ) == 1:
                set_suspect(
                    ints, numbers, waves, basis, signals + s * p, numbers[constants + s], numbers[noise + s],
                    bounds + PER_SIGNAL * s, 0.0, suspect, scratch_wave,
                )  # fmt: skip
                sample_at(ints, numbers, waves, basis, 0.0, suspect, suspect + LEFT, scratch_wave)
                sample_at(ints, numbers, waves, basis, latest, suspect, suspect + RIGHT, scratch_wave)
                find_root(ints, numbers, waves, basis, 0, 0.0, latest, suspect, suspect + RIGHT, scratch_wave)
                return s
    return NONE


@compiled
def others_stay_above(numbers: Numbers, starts: int, bounds: int, count: int, falling: int, latest: float) -> int:
    """Return 1 where values and slopes at t = 0 prove that no other signal falls before ``latest``."""
    for s in range(count):
        first = bounds + PER_SIGNAL * s
        high = numbers[starts + 2 * s] > numbers[first + 1] * latest
        if s != falling and not high and not numbers[starts + 2 * s + 1] > numbers[first + 2] * latest:
            return 0
    return 1
