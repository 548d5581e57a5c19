"""Left out: what truncation took of a run, and how large it has to be for a warning.

The energy is told from a share of the largest of the run on, whatever its sign at an instant; the motion from an
indicator on (truncation.py). The thresholds are calibrated on random truncated models judged by the same with all
modes: tests/campaign/truncation_study.py.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.time.defects import indicator
from multiphi_exudyn.time.known_warnings import REMEDY
from multiphi_exudyn.time.looking import INDICATOR, is_small

__all__ = ["LeftOut", "energy_warning", "hangs_on_size", "left_alone", "left_out_warnings"]

ENERGY_SHARE = 0.01  # of the largest energy of a run
RIGID_INDICATOR = 0.05  # where a rigid contact is struck: its impacts raise the indicator more than the error
NOT_ASKED = math.nan, math.nan  # in place of sizes


class LeftOut(NamedTuple):
    """What truncation took of a run: energy [J], its sum of |defect|^2; of its start: the energy [J] given, |y|^2."""

    energy: float
    defects: float
    given: float
    square: float

    def looked_into(self, tolerance: Tolerance | None) -> tuple[bool, bool]:
        """Whether its energy, and what it did to the motion, may be told; what is not a number may.

        tolerance: the one that the modes were decided by.
        """
        least = min(INDICATOR, tolerance.error) if tolerance else INDICATOR
        much = not self.energy <= ENERGY_SHARE * self.given
        return much, not (self.defects <= 0 or is_small(self.defects, least, self.square))


def hangs_on_size(model: MultiPhiModel, excitation: Excitation, looked: tuple[bool, bool]) -> bool:
    """Whether what is told, of what is ``looked_into``, hangs on how the run went on, not on its start alone."""
    much, far = looked
    return far or (much and not left_alone(model, excitation))


def left_out_warnings(
    model: MultiPhiModel,
    excitation: Excitation,
    taken: LeftOut,
    looked: tuple[bool, bool],
    tolerance: Tolerance | None,
    sizes: tuple[float, float] | None,
    struck: bool,
) -> tuple[str, ...]:
    """Of the energy that truncation took, and of the motion that it did, where these are ``looked_into``.

    sizes: mean of |y|^2 and largest energy of the run, None where nothing ``hangs_on_size``. struck: whether a rigid
    contact was.
    """
    (much, far), (square, largest) = looked, sizes or NOT_ASKED
    found: tuple[str, ...] = ()
    if much:
        alone = left_alone(model, excitation)
        found = energy_warning(taken.energy, taken.given if alone else max(largest, taken.given))
    if far:
        found += _motion_warning(model, indicator(taken.defects, square), tolerance, struck)
    return found


def left_alone(model: MultiPhiModel, excitation: Excitation) -> bool:
    """Whether nothing works on the structure from outside, so that it has no more energy than at its start."""
    return excitation.nothing and not (model.general or model.overrides)


def energy_warning(lost: float, largest: float) -> tuple[str, ...]:
    """largest: zero where truncation has taken all energy at the start."""
    if not lost > ENERGY_SHARE * largest:
        return ()
    share = per_cent(lost / (largest or lost))
    return (f"lost energy: truncation took {share} of the largest energy of the run; {REMEDY}",)


def _motion_warning(model: MultiPhiModel, error: float, tolerance: Tolerance | None, struck: bool) -> tuple[str, ...]:
    """Of the estimated error, which with rigid contacts is four times the true one in the mean."""
    if tolerance is not None and error > tolerance.error:
        kept = model.level_at(()).modes
        return (
            f"truncation: the indicator is {error:.2g} with {kept} modes, the tolerance {tolerance.error:g}; "
            "give Tolerance a larger most=, or a new model, so that it decides by this run",
        )
    if not error > (RIGID_INDICATOR if struck else INDICATOR):
        return ()
    typical = ", with rigid contacts a quarter of that is typical" if struck else ""
    return (f"truncation: displacements may be off by {per_cent(error)} of the motion{typical}; {REMEDY}",)
