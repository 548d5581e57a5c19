"""Looking: the size of a motion while it goes on, for the warnings of its run: the mean of |y|^2, the largest energy.

Both are taken at SAMPLES instants evenly spaced between the start of a run and its end. The loop looks at those that
lie in a segment while its flow stands there, as soon as truncation has taken what may be told; where an instant has
passed before, sampling.py looks at them all, if somebody asks.
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
from multiphi_exudyn.events.states.flow import state_at, step_on
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mathematics.response.basis_arrays import PURE

__all__ = ["INDICATOR", "SAMPLES", "begin_look", "is_small", "keep_look", "look", "see"]

SAMPLES = 25  # of the motion, for its mean square: known to a tenth, as an estimate of an error needs it
HALVES = math.sqrt(2 * SAMPLES)
INDICATOR = 0.03  # of the motion, from which truncation is told where every contact that is struck is compliant


@compiled
def is_small(lost: float, limit: float, square: float) -> int:
    """1 where the indicator of a sum of |defect|^2 is below a limit, as |y|^2 at the start tells already.

    A defect has changed |y| there by no more than its size; it is the first of the samples, which count by half.
    """
    return 1 if lost * (1.0 + HALVES / limit) ** 2 < square else 0


@compiled
def begin_look(ints: Ints, numbers: Numbers, given: int, end: float) -> None:
    """Instants from the present time to ``end`` [s]; given: the state of the start in all modes, -1 for none."""
    square = 0.0
    for i in range(ints[COORDINATES] if given >= 0 else 0):
        square += numbers[ints[given + PLACE] + i] * numbers[ints[given + PLACE] + i]
    numbers[GIVEN_SQUARE], numbers[LOOK_FIRST], numbers[LOOK_END] = square, numbers[TIME], end
    for part in range(LOOK_WIDTH):
        numbers[LOOKED + part] = 0.0


@compiled
def look(ints: Ints, numbers: Numbers, waves: Waves) -> None:
    """SEEN: what was LOOKED at, and what there is in the segment from CURRENT to the instant.

    Until the first decision nobody knows what truncation will take, so all is looked at but a segment that ends the
    run. What a size is read from is packed when somebody has asked for it in a level (sampling.py), not before.
    """
    first, end, level, passed = numbers[LOOK_FIRST], numbers[LOOK_END], ints[CURRENT + LEVEL], 0
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
        if passed > 0 and ints[ints[FLOW_BASIS] + PURE] == 1:
            step, again = (end - first) / (SAMPLES - 1), 1 if passed > 1 else 0
            step_on(ints, numbers, waves, level, step, again, ints[AFTER + PLACE], ints[AFTER + SPEED])
            weigh(ints, numbers, level, weight)
        else:
            see(ints, numbers, waves, level, t - numbers[TIME], weight)
        passed += 1


@compiled
def see(ints: Ints, numbers: Numbers, waves: Waves, level: int, delay: float, weight: float) -> None:
    """Count the flow a ``delay`` [s] after its state: how many were SEEN, their weighted mean |y|^2, largest energy."""
    ints[AFTER + LEVEL] = level
    state_at(ints, numbers, waves, level, delay, ints[AFTER + PLACE], ints[AFTER + SPEED])
    weigh(ints, numbers, level, weight)


@compiled
def weigh(ints: Ints, numbers: Numbers, level: int, weight: float) -> None:
    """Count the state AFTER, of a level."""
    x, n, row = ints[AFTER + PLACE], ints[level + MODES] + ints[CHANNELS], ints[level + SIZES]
    square = 0.0
    for line in range(n + 1):
        size = numbers[row + n]
        for c in range(line, n):
            size += numbers[row + c] * numbers[x + c]
        square += size * size
        row += n + 1
    strained = energy(ints, numbers, AFTER) + numbers[row + n]
    for c in range(n):
        strained += numbers[row + c] * numbers[x + c]
    numbers[SEEN] += 1.0
    numbers[SEEN + 1] += weight * square / (SAMPLES - 1)
    numbers[SEEN + 2] = max(numbers[SEEN + 2], abs(strained))


@compiled
def keep_look(numbers: Numbers) -> None:
    """What was SEEN counts: its segment is recorded."""
    for part in range(LOOK_WIDTH):
        numbers[LOOKED + part] = numbers[SEEN + part]
