"""What a study's result says: fronts, the cheapest setting, how much faster it is, the reference's own uncertainty.

Nothing is run and nothing drawn here. Times in s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE, is_number
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.comparison.wording import seconds
from multiphi_exudyn.study.running.runner import modes_words
from multiphi_exudyn.study.sweep.row import key_of

__all__ = [
    "cheapest",
    "front",
    "full_methods",
    "longest",
    "named",
    "names_of",
    "points",
    "pointwise_until",
    "references",
    "settings",
    "settings_at",
    "times_faster",
    "uncertainty",
    "words",
]


def settings(result: StudyResult) -> list[Setting]:
    """All settings of the methods under study, in the order of their rows."""
    return [setting for setting in result.judged if setting.method not in (REFERENCE, COARSER)]


def settings_at(result: StudyResult, at: Mapping[str, Any]) -> list[Setting]:
    """The methods' settings at one point of the scene's axes."""
    return [setting for setting in settings(result) if setting.at == at]


def references(result: StudyResult) -> list[Setting]:
    """The reference and its coarser copy, at every point of the scene's axes."""
    return [setting for setting in result.judged if setting.method in (REFERENCE, COARSER)]


def full_methods(result: StudyResult) -> list[str]:
    """Names of those that are full models."""
    return [method.name for method in result.study.methods if method.model.get("kind") == "full"]


def points(result: StudyResult) -> list[Mapping[str, Any]]:
    """The points of the scene's axes, [{}] for a study without."""
    return list({key_of(row.parameters["at"]): row.parameters["at"] for row in result.rows}.values())


def front(settings: Sequence[Setting]) -> list[Setting]:
    """Those that no other one beats in time and error both, fastest first; of equal ones the first."""
    best, kept = math.inf, []
    known = [(s.online_s, s.error, s) for s in settings if s.online_s is not None and s.error is not None]
    for _, error, setting in sorted(known, key=lambda each: each[:2]):
        if error < best:
            best = error
            kept.append(setting)
    return kept


def cheapest(settings: Sequence[Setting], tolerance: float, lasting: bool = False) -> dict[str, Setting | None]:
    """For each method the fastest setting whose error holds the tolerance; None where there is none.

    lasting: whether its lasting error has to.
    """
    chosen = [s for s in settings if _holds(s.lasting_error if lasting else s.error, tolerance)]
    return {name: next(iter(front([s for s in chosen if s.method == name])), None) for name in names_of(settings)}


def times_faster(chosen: Mapping[str, Setting | None], full: Sequence[str]) -> dict[str, float | None]:
    """For each method: online time of the fastest chosen full model over its own; None where either is missing."""
    known = {name: s.online_s for name, s in chosen.items() if s is not None and s.online_s is not None}
    base = min((known[name] for name in full if name in known), default=None)
    return {name: base / known[name] if base is not None and name in known else None for name in chosen}


def uncertainty(result: StudyResult, at: Mapping[str, Any]) -> float | None:
    """Error of the reference's coarser copy: smaller differences to the reference say nothing."""
    return next((s.own_error for s in _coarser(result, at)), None)


def pointwise_until(result: StudyResult, at: Mapping[str, Any], tolerance: float) -> float | None:
    """From when on [s] pointwise comparison has lost its meaning: the coarser copy's agreement horizon."""
    return next((s.values.get("horizon", {}).get(f"{tolerance:g}") for s in _coarser(result, at)), None)


def words(fields: Mapping[str, Any]) -> str:
    """Fields of a setting or of a point as an engineer would say them: "r = 8, step 70 µs"."""
    return ", ".join(_word(field, value) for field, value in fields.items())


def named(setting: Setting) -> str:
    """A setting in words: "multiphi (r = 8)"."""
    fields = words(setting.setting)
    return f"{setting.method} ({fields})" if fields else setting.method


def longest(result: StudyResult) -> float:
    """The longest window [s] that errors are known for: the whole run."""
    return max((float(w) for row in result.rows for w in row.values.get("nrmse", {})), default=0.0)


def names_of(settings: Sequence[Setting]) -> list[str]:
    """The methods that settings belong to, each once, in order."""
    return list(dict.fromkeys(setting.method for setting in settings))


def _coarser(result: StudyResult, at: Mapping[str, Any]) -> list[Setting]:
    return [s for s in references(result) if s.method == COARSER and s.at == at]


def _holds(error: float | None, tolerance: float) -> bool:
    return error is not None and error <= tolerance


def _word(field: str, value: Any) -> str:
    if field == "modes":
        return modes_words(value)
    if field == "elements":
        return f"{value} elements"
    if field == "step":
        return f"step {seconds(value)}"
    return f"{field} = {value:g}" if is_number(value) else f"{field} = {value}"
