"""Verdict: the effect of truncation on a run, as two numbers that the loop has when the run ends.

    energy lost to truncation / largest energy of the run, both without their signs
    indicator of the motion: sqrt( sum of |defect|^2 / mean of |y|^2 )                        (truncation.py)

Each is zero where it is too small for a warning. It is not a number where it is not known yet, because the loop has not
sampled the size of the motion (motion_size.py) or has not summed the defects. The thresholds are calibrated on random
truncated models that are compared with all modes: tests/campaign/truncation_study.py.
"""

from __future__ import annotations

import math

from multiphi_exudyn.events.arrays import (
    BY_IMPACT,
    DAMPING,
    DEFECTS,
    FRICTION,
    GIVEN_ENERGY,
    GIVEN_POTENTIAL,
    GIVEN_SQUARE,
    KINETIC,
    LOOK_END,
    LOOKED,
    LOST_AT_START,
    LOST_SO_FAR,
    STOP_WORK,
    STRAIN,
    TRUNCATED,
    VERDICT,
    WORK,
    WORKS,
)
from multiphi_exudyn.mathematics.compiling.compiled import Numbers, compiled
from multiphi_exudyn.time.loop.motion_size import SAMPLES, is_small

__all__ = ["OPEN", "indicator", "is_balanced", "lost_share", "set_verdict"]

ENERGY_SHARE = 0.01  # of the largest energy of a run
OPEN = 1e-6  # of the energies turned over: what a ledger may leave open (time/reliability/ledger_warnings.py)


@compiled
def set_verdict(numbers: Numbers, isolated: int, limit: float, end: float) -> None:
    """Set the VERDICT on a run to ``end`` [s] from its numbers.

    isolated: 1 where the run never has more energy than at its start. limit: threshold of the indicator for a warning.
    """
    lost = numbers[TRUNCATED] + abs(numbers[LOST_AT_START + KINETIC] + numbers[LOST_AT_START + STRAIN])
    start_energy, defects = abs(numbers[GIVEN_ENERGY] + numbers[GIVEN_POTENTIAL]), numbers[DEFECTS]
    sampled = numbers[LOOKED] == SAMPLES and numbers[LOOK_END] == end
    numbers[VERDICT], numbers[VERDICT + 1] = 0.0, 0.0
    if not lost <= ENERGY_SHARE * start_energy:
        largest = start_energy if isolated == 1 else math.nan
        if isolated == 0 and sampled:
            largest = max(start_energy, numbers[LOOKED + 2])
        numbers[VERDICT] = lost_share(lost, largest)
    if not (defects <= 0.0 or is_small(defects, limit, numbers[GIVEN_SQUARE]) == 1):
        error = indicator(defects, numbers[LOOKED + 1] if sampled else math.nan)
        numbers[VERDICT + 1] = 0.0 if error <= limit else error


@compiled
def lost_share(lost: float, largest: float) -> float:
    """Return the share of energy lost in the largest energy [J] of a run, zero where it is below the threshold.

    It is 1 where the largest energy is zero: truncation has then removed all of it at the start.
    """
    if lost <= ENERGY_SHARE * largest:
        return 0.0
    return lost / largest if largest != 0.0 else 1.0


@compiled
def indicator(lost: float, square: float) -> float:
    """Return the truncation indicator of a sum of |defect|^2 and the mean of |y|^2."""
    if square == 0.0:
        return math.inf if lost != 0.0 else 0.0
    return math.sqrt(lost / square)


@compiled
def is_balanced(numbers: Numbers, final: float) -> float:
    """Return 1 where the ledger is closed and friction, damping and impacts have taken energy, else 0.

    final: kinetic and strain energy of the last state less the potential of static loads [J]. Segments whose works are
    left out are missing.
    """
    impact = numbers[LOST_AT_START + BY_IMPACT] + numbers[LOST_SO_FAR + BY_IMPACT]
    damping = numbers[LOST_AT_START + DAMPING] + numbers[LOST_SO_FAR + DAMPING] + numbers[WORKS]
    friction = numbers[LOST_AT_START + FRICTION] + numbers[LOST_SO_FAR + FRICTION] + numbers[WORKS + 2]
    work = numbers[LOST_AT_START + STOP_WORK] + numbers[LOST_SO_FAR + STOP_WORK] + numbers[WORKS + 1] + numbers[WORK]
    truncated = numbers[LOST_AT_START + KINETIC] + numbers[LOST_SO_FAR + KINETIC]
    truncated += numbers[LOST_AT_START + STRAIN] + numbers[LOST_SO_FAR + STRAIN]
    limit = OPEN * (abs(numbers[GIVEN_ENERGY]) + abs(final) + abs(work))
    left = numbers[GIVEN_ENERGY] + work - impact - damping - friction - truncated - final
    is_taken = impact >= -limit and damping >= -limit and friction >= -limit
    return 1.0 if is_taken and abs(left) <= limit else 0.0
