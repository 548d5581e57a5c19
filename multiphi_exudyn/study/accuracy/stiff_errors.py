"""Rigid levels against stiff stops, from a study's rows: what they are the limit of, beside the study's reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import settings_at
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult

__all__ = ["StiffError", "stiff_errors"]


@dataclass(frozen=True)
class StiffError:
    """A setting's largest NRMSE of the judged points against stops from ``stiffness`` [N/m] up, and their own."""

    setting: Setting
    error: float
    uncertainty: float
    stiffness: float


def stiff_errors(result: StudyResult, at: Mapping[str, Any]) -> list[StiffError]:
    """Of the settings with rigid levels at one point of the scene's axes that ran, as did the stiff stops."""
    found = [(setting, setting.values.get("stiff_stops", {})) for setting in settings_at(result, at)]
    return [
        StiffError(setting, error, uncertainty, kept["stiffness"][0])
        for setting, kept in found
        if (error := _worst(result, kept.get("errors", {}))) is not None
        and (uncertainty := _worst(result, kept.get("uncertainty", {}))) is not None
    ]


def _worst(result: StudyResult, table: Mapping[str, Any]) -> float | None:
    """The largest entry of the judged points in the study's window."""
    of_points = table.get(f"{result.window:g}", {})
    known = [of_points.get(point) for point in result.judged_points]
    return None if None in known or not known else max(known)
