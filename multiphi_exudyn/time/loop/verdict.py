"""Verdict: how much truncation took of a run, as two numbers, which the loop has when a run ends.

    the energy lost of the largest energy of the run, whatever its sign at an instant
    the indicator of the motion: sqrt( sum of |defect|^2 / mean of |y|^2 )                    (truncation.py)

Each is zero where it is too small for a warning, and not a number where it is not known yet: the size of the motion,
where the loop has not summed it (motion_size.py), or a defect. The thresholds are calibrated on random truncated models
that are compared with all modes: tests/campaign/truncation_study.py.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    DEFECTS,
    GIVEN_ENERGY,
    GIVEN_POTENTIAL,
    GIVEN_SQUARE,
    KINETIC,
    LOOK_END,
    LOOKED,
    LOST_AT_START,
    STRAIN,
    TRUNCATED,
    VERDICT,
)
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled
from multiphi_exudyn.time.loop.motion_size import SAMPLES, is_small

__all__ = ["indicator", "judge", "share_lost"]

ENERGY_SHARE = 0.01  # of the largest energy of a run


@compiled
def judge(numbers: Numbers, isolated: int, limit: float, end: float) -> None:
    """The VERDICT on a run to ``end`` [s] from its numbers.

    isolated: 1 where it has no more energy than at its start. limit: of the indicator, from which it is told.
    """
    lost = numbers[TRUNCATED] + abs(numbers[LOST_AT_START + KINETIC] + numbers[LOST_AT_START + STRAIN])
    given, defects = abs(numbers[GIVEN_ENERGY] + numbers[GIVEN_POTENTIAL]), numbers[DEFECTS]
    looked = numbers[LOOKED] == SAMPLES and numbers[LOOK_END] == end
    numbers[VERDICT], numbers[VERDICT + 1] = 0.0, 0.0
    if not lost <= ENERGY_SHARE * given:
        largest = given if isolated == 1 else math.nan
        if isolated == 0 and looked:
            largest = max(given, numbers[LOOKED + 2])
        numbers[VERDICT] = share_lost(lost, largest)
    if not (defects <= 0.0 or is_small(defects, limit, numbers[GIVEN_SQUARE]) == 1):
        error = indicator(defects, numbers[LOOKED + 1] if looked else math.nan)
        numbers[VERDICT + 1] = 0.0 if error <= limit else error


@compiled
def share_lost(lost: float, largest: float) -> float:
    """Of the largest energy [J] of a run; all of it where that is zero, as truncation has taken it at the start."""
    if lost <= ENERGY_SHARE * largest:
        return 0.0
    return lost / largest if largest != 0.0 else 1.0


@compiled
def indicator(lost: float, square: float) -> float:
    """The truncation indicator of a sum of |defect|^2 and the mean of |y|^2."""
    if square == 0.0:
        return math.inf if lost != 0.0 else 0.0
    return math.sqrt(lost / square)
