"""Truncation warnings: sentences on energy and motion lost to truncation, from the verdict of a run (verdict.py)."""

from __future__ import annotations

import copy
import functools
import math

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.display import per_cent
from multiphi_exudyn.levels.model.mode_choice import Tolerance
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.time.reliability.defects import total_defect
from multiphi_exudyn.time.trajectory.trajectory import Trajectory
from multiphi_exudyn.time.warnings.model_warnings import REMEDY

__all__ = ["CHANGE", "energy_warning", "indicator_threshold", "truncation_warnings", "verdict_of"]

INDICATOR = core.MOTION_THRESHOLD
CHANGE = "change"  # entry of a model: the last change by more modes, where it exceeds what a Tolerance allows
TEXTS = 64  # verdicts whose sentences are kept
RIGID_INDICATOR = 0.05  # threshold where a rigid contact is struck: impacts raise the indicator more than the error


def indicator_threshold(tolerance: Tolerance | None) -> float:
    """Threshold of the indicator for a warning; tolerance: the one that decided the modes."""
    return INDICATOR if tolerance is None else min(INDICATOR, tolerance.error)


def verdict_of(trajectory: Trajectory, tolerance: Tolerance | None = None) -> tuple[float, float]:
    """Verdict on a run for which the loop could not compute it, or used another limit.

    tolerance: the one that decided the modes.
    """
    if trajectory.model.whole:
        return 0.0, 0.0
    limit, ledger = indicator_threshold(tolerance), trajectory.ending.ledger
    found = copy.copy(trajectory.ending.record.trajectory.truncation)
    found.defects = total_defect(trajectory)
    found.start_square = found.start_square or float(np.sum(trajectory.start.displacement**2))
    found.estimate(ledger, limit)
    if math.isnan(found.energy_share) or math.isnan(found.motion):
        found.mean_square, found.largest_energy = trajectory.segments.sizes(trajectory.t_end)
        found.estimate(ledger, limit)
    return found.energy_share, found.motion


def truncation_warnings(
    model: MultiPhiModel, verdict: tuple[float, float], tolerance: Tolerance | None, struck: bool
) -> tuple[str, ...]:
    """One warning of motion and energy lost to truncation, or none; struck: whether a rigid contact was struck."""
    share, error = verdict
    if tolerance is not None and (told := _of_tolerance(model, share, error, tolerance)):
        return (told,)
    return _sentence(share, error, struck)


def _of_tolerance(model: MultiPhiModel, share: float, error: float, tolerance: Tolerance) -> str:
    """Warning of a tolerance that the run which decided the modes, or this one, does not keep, or ""."""
    kept, change = model.level_at(()).modes, model.entries.find(CHANGE)
    if change is not None:
        found = f"differs by {per_cent(change)} from" if math.isfinite(change) else "could not be compared with"
        return (
            f"truncation: with {kept} modes the run that decided them {found} one with another number of modes, the "
            f"tolerance is {tolerance.error:g}{_also_lost(share)}; give Tolerance a larger most=, or a shorter run"
        )
    if error > tolerance.error:
        return (
            f"truncation: the indicator is {error:.2g} with {kept} modes, the tolerance {tolerance.error:g}"
            f"{_also_lost(share)}; give Tolerance a larger most=, or a new model, so that it decides by this run"
        )
    return ""


@functools.lru_cache(TEXTS)
def _sentence(share: float, error: float, struck: bool) -> tuple[str, ...]:
    """One warning of a verdict on a run whose modes no tolerance has decided: of its motion, else of its energy.

    The estimated error of motion is on average four times the true one where a rigid contact was struck.
    """
    if not error > (RIGID_INDICATOR if struck else INDICATOR):
        return energy_warning(share)
    typical = ", with rigid contacts a quarter of that is typical" if struck else ""
    off = f"truncation: displacements may be off by {per_cent(error)} of the motion"
    return (f"{off}{typical}{_also_lost(share)}; {REMEDY}",)


def energy_warning(share: float) -> tuple[str, ...]:
    """Warning of the energy lost, a share of the largest energy of the run; none where the share is zero."""
    if not share > 0:
        return ()
    return (f"lost energy: truncation took {per_cent(share)} of the largest energy of the run; {REMEDY}",)


def _also_lost(share: float) -> str:
    """Energy lost, as part of a sentence on the motion."""
    return f", and {per_cent(share)} of the largest energy of the run was lost" if share > 0 else ""
