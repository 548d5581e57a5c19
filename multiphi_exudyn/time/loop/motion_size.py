"""Motion size: mean of |y|^2 and largest energy of a run, for its warnings.

Both are sampled at SAMPLES instants, evenly spaced between the start of a run and its end. The loop samples those in a
segment while the flow of the segment is in the arrays, from the moment when the truncation may be worth a warning.
Where an instant has passed before that moment, sampling.py samples them all when they are requested.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    AFTER,
    CHANNELS,
    COORDINATES,
    CURRENT,
    DEFECTS,
    FLOW_BASIS,
    GIVEN_SQUARE,
    INSTANT_TIME,
    ISOLATED,
    LAST_DECISION,
    LEVEL,
    LOOK_END,
    LOOK_FIRST,
    LOOK_WIDTH,
    LOOKED,
    MODES,
    PLACE,
    SEEN,
    SIZES,
    SPEED,
    TIME,
)
from multiphi_exudyn.events.states.energies import energy
from multiphi_exudyn.events.states.flow import next_state, state_at
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import PURE

__all__ = [
    "INDICATOR",
    "SAMPLES",
    "add_sample_at",
    "begin_size_samples",
    "is_small",
    "keep_size_samples",
    "sample_motion_size",
]

SAMPLES = 17  # of the motion: on 150 random models its root mean square is off by 3 % (one standard deviation)
HALVES = math.sqrt(2 * SAMPLES)
INDICATOR = 0.03  # of the motion: threshold of the truncation warning where every contact that is struck is compliant


@compiled
def is_small(lost: float, limit: float, square: float) -> int:
    """Return 1 where |y|^2 at the start shows that the indicator of a sum of |defect|^2 is below a limit, else 0.

    A defect has changed |y| there by no more than its size; it is the first of the samples, which count by half.
    """
    return 1 if lost * (1.0 + HALVES / limit) ** 2 < square else 0


@compiled
def begin_size_samples(ints: Ints, numbers: Numbers, start: int, end: float) -> None:
    """Begin the samples from the present time to ``end`` [s]; start: its state in all modes, -1 for none."""
    square = 0.0
    for i in range(ints[COORDINATES] if start >= 0 else 0):
        square += numbers[ints[start + PLACE] + i] * numbers[ints[start + PLACE] + i]
    numbers[GIVEN_SQUARE], numbers[LOOK_FIRST], numbers[LOOK_END] = square, numbers[TIME], end
    for part in range(LOOK_WIDTH):
        numbers[LOOKED + part] = 0.0


@compiled
def sample_motion_size(ints: Ints, numbers: Numbers, waves: Waves) -> None:
    """Set SEEN to the samples LOOKED so far and those in the segment from CURRENT to the instant.

    Before the first decision the later truncation is unknown, so every segment is sampled but one that ends the run.
    A level has the rows of its size (SIZES) only once they were requested there (sampling.py); without them sampling
    ends. Where no load acts the energy is largest at the start, and is not sampled.
    """
    first, end, level, samples_here = numbers[LOOK_FIRST], numbers[LOOK_END], ints[CURRENT + LEVEL], 0
    loaded = 1 - ints[ISOLATED]
    for part in range(LOOK_WIDTH):
        numbers[SEEN + part] = numbers[LOOKED + part]
    while end > first and numbers[SEEN] < SAMPLES:
        last = numbers[SEEN] == SAMPLES - 1
        t = end if last else first + (end - first) * numbers[SEEN] / (SAMPLES - 1)
        if t > numbers[INSTANT_TIME] or (t == numbers[INSTANT_TIME] and not last):
            return
        small = is_small(numbers[DEFECTS], INDICATOR, numbers[GIVEN_SQUARE]) == 1
        if ints[level + SIZES] == 0 or (small and (numbers[LAST_DECISION] > first or numbers[INSTANT_TIME] >= end)):
            numbers[LOOK_END] = first
            return
        weight = 1.0 if numbers[SEEN] > 0 and not last else 0.5
        if samples_here > 0 and ints[ints[FLOW_BASIS] + PURE] == 1:
            step, again = (end - first) / (SAMPLES - 1), 1 if samples_here > 1 else 0
            next_state(ints, numbers, waves, level, step, again, ints[AFTER + PLACE], ints[AFTER + SPEED])
            add_sample(ints, numbers, level, weight, loaded)
        else:
            add_sample_at(ints, numbers, waves, level, t - numbers[TIME], weight, loaded)
        samples_here += 1


@compiled
def add_sample_at(
    ints: Ints, numbers: Numbers, waves: Waves, level: int, delay: float, weight: float, has_energy: int
) -> None:
    """Add the flow a ``delay`` [s] after its state to SEEN: number of samples, weighted mean |y|^2, largest energy.

    has_energy: 0 where its energy is not asked for.
    """
    ints[AFTER + LEVEL] = level
    state_at(ints, numbers, waves, level, delay, ints[AFTER + PLACE], ints[AFTER + SPEED])
    add_sample(ints, numbers, level, weight, has_energy)


@compiled
def add_sample(ints: Ints, numbers: Numbers, level: int, weight: float, has_energy: int) -> None:
    """Add the state AFTER, of a level, to SEEN."""
    x, n, row = ints[AFTER + PLACE], ints[level + MODES] + ints[CHANNELS], ints[level + SIZES]
    square = 0.0
    for line in range(n + 1):
        size = numbers[row + n]
        for c in range(line, n):
            size += numbers[row + c] * numbers[x + c]
        square += size * size
        row += n + 1
    numbers[SEEN] += 1.0
    numbers[SEEN + 1] += weight * square / (SAMPLES - 1)
    if has_energy == 0:
        return
    total_energy = energy(ints, numbers, AFTER) + numbers[row + n]
    for c in range(n):
        total_energy += numbers[row + c] * numbers[x + c]
    numbers[SEEN + 2] = max(numbers[SEEN + 2], abs(total_energy))


@compiled
def keep_size_samples(numbers: Numbers) -> None:
    """Make SEEN the samples LOOKED, as their segment is recorded."""
    for part in range(LOOK_WIDTH):
        numbers[LOOKED + part] = numbers[SEEN + part]
