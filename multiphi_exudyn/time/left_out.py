"""Left out: what truncation took of a run, and how large it has to be for a warning.

The energy is told from a share of the largest of the run on, whatever its sign at an instant; the motion from an
indicator on (truncation.py). The thresholds are calibrated on random truncated models judged by the same with all
modes: tests/campaign/truncation_study.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from multiphi_exudyn.display import per_cent
from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.levels.mode_choice import Tolerance
from multiphi_exudyn.levels.model import MultiPhiModel
from multiphi_exudyn.time.defects import Samples, indicator, is_small
from multiphi_exudyn.time.known_warnings import REMEDY

__all__ = ["LeftOut", "energy_warning", "left_alone", "left_out_warnings"]

ENERGY_SHARE = 0.01  # of the largest energy of a run
INDICATOR = 0.03  # of the motion, where every contact that is struck is compliant
RIGID_INDICATOR = 0.05  # where a rigid one is: its impacts raise the indicator more than the error


class LeftOut(NamedTuple):
    """What truncation took of a run: energy [J], its sum of |defect|^2; given: the energy [J] at the start y (m,)."""

    energy: float
    defects: float
    given: float
    start: np.ndarray

    def looked_into(self, tolerance: Tolerance | None) -> tuple[bool, bool]:
        """Whether its energy, and what it did to the motion, may be told; what is not a number may.

        tolerance: the one that the modes were decided by.
        """
        least = min(INDICATOR, tolerance.error) if tolerance else INDICATOR
        much = not self.energy <= ENERGY_SHARE * self.given
        return much, not (self.defects <= 0 or is_small(self.defects, least, self.start))


def left_out_warnings(
    model: MultiPhiModel,
    excitation: Excitation,
    taken: LeftOut,
    looked: tuple[bool, bool],
    tolerance: Tolerance | None,
    samples: Samples,
    struck: Callable[[], bool],
) -> list[str]:
    """Of the energy that truncation took, and of the motion that it did, where these are ``looked_into``.

    struck: whether a rigid contact was.
    """
    (much, far), found = looked, list[str]()
    if much:
        alone = left_alone(model, excitation)
        found += energy_warning(taken.energy, taken.given if alone else max(samples.largest_energy, taken.given))
    if far:
        found += _of_motion(model, indicator(taken.defects, samples), tolerance, struck)
    return found


def left_alone(model: MultiPhiModel, excitation: Excitation) -> bool:
    """Whether nothing works on the structure from outside, so that it has no more energy than at its start."""
    return excitation.nothing and not (model.general or model.overrides)


def energy_warning(lost: float, largest: float) -> Iterator[str]:
    """largest: zero where truncation has taken all energy at the start."""
    if lost > ENERGY_SHARE * largest:
        share = per_cent(lost / (largest or lost))
        yield f"lost energy: truncation took {share} of the largest energy of the run; {REMEDY}"


def _of_motion(
    model: MultiPhiModel, error: float, tolerance: Tolerance | None, struck: Callable[[], bool]
) -> Iterator[str]:
    """Of the estimated error, which with rigid contacts is four times the true one in the mean."""
    rigid = any(contact.rigid for contact in model.contacts) and struck()
    if tolerance is not None and error > tolerance.error:
        kept = model.level_at(()).modes
        yield (
            f"truncation: the indicator is {error:.2g} with {kept} modes, the tolerance {tolerance.error:g}; "
            "give Tolerance a larger most=, or a new model, so that it decides by this run"
        )
    elif error > (RIGID_INDICATOR if rigid else INDICATOR):
        typical = ", with rigid contacts a quarter of that is typical" if rigid else ""
        yield f"truncation: displacements may be off by {per_cent(error)} of the motion{typical}; {REMEDY}"
