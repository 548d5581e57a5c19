"""What a study's rows say: settings with their error and time, fronts, the cheapest setting, the uncertainty.

The error of a setting is the worst, over its nearby runs, of the largest NRMSE of the judged points from 0 to the
study's window. Where one of these runs has no error the setting has none either: a gap with a cause, never a smaller
number.
Everything is computed from the rows alone; nothing is run and nothing drawn here. Times in s, frequencies in Hz.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE, StudyFile, is_number
from multiphi_exudyn.study.comparison.wording import seconds
from multiphi_exudyn.study.measures.spectra import Map
from multiphi_exudyn.study.sweep.store import Row, key_of

__all__ = [
    "MapPair",
    "Setting",
    "StudyResult",
    "cheapest",
    "error_of",
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

Intervals = Sequence[Sequence[float]]


@dataclass(frozen=True)
class MapPair:
    """One point's time-frequency maps, of the reference and of a reduced model.

    label: the reduced model, in words. contacts: the intervals [s] in contact, of any contact.
    frequencies: level -> its natural frequencies [Hz].
    """

    point: str
    label: str
    full: Map
    reduced: Map
    full_contacts: Intervals
    reduced_contacts: Intervals
    frequencies: Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class StudyResult:
    """A study with all its rows: of the error pass, of the timing pass, of the budgets."""

    study: StudyFile
    name: str
    judged_points: tuple[str, ...]
    window: float
    rows: tuple[Row, ...]
    timings: tuple[Row, ...]
    budgets: tuple[Row, ...]
    maps: tuple[MapPair, ...]
    environment: Mapping[str, Any]
    assumptions: tuple[str, ...]
    quick: bool

    @functools.cached_property
    def judged(self) -> tuple[Setting, ...]:
        """Every setting with its error and time, the reference and its coarser copy included."""
        timings = {_setting_key(row): row for row in self.timings}
        groups: dict[str, list[Row]] = {}
        for row in self.rows:
            groups.setdefault(_setting_key(row), []).append(row)
        alone = [_setting(self, group, timings.get(key)) for key, group in groups.items()]
        lasting = _lasting(alone, {method.name: method.refine for method in self.study.methods})
        return tuple(replace(each, lasting_error=worst) for each, worst in zip(alone, lasting, strict=True))


@dataclass(frozen=True)
class Setting:
    """One setting of a method at one point of the scene's axes.

    error: the worst of the nearby runs; None where one of them has none, and message names the cause.
    own_error: of the setting itself. lasting_error: the worst of it and of every finer setting that was tried, finer
    in its method's field ``refine`` alone; of methods without such a field its error.
    values, timing: of its own run in the error and in the timing pass, {} without.
    """

    method: str
    at: Mapping[str, Any]
    setting: Mapping[str, Any]
    error: float | None
    own_error: float | None
    message: str
    values: Mapping[str, Any]
    timing: Mapping[str, Any]
    lasting_error: float | None = None

    @property
    def online_s(self) -> float | None:
        """Median of the repeated runs."""
        return self.timing.get("online_s")

    @property
    def spread(self) -> tuple[float, float] | None:
        """The shortest and the longest of the repeated runs."""
        repeats = self.timing.get("repeats_s")
        return (min(repeats), max(repeats)) if repeats else None

    @property
    def first_s(self) -> float | None:
        """The first run, which builds what the later ones find built."""
        return self.timing.get("first_s")

    @property
    def offline_s(self) -> float | None:
        """Before any run: structure, modes, static start."""
        return self.timing.get("offline_s")

    @property
    def indicator(self) -> float | None:
        """The model's own prediction of its error."""
        return self.values.get("indicator")

    @property
    def dofs(self) -> int | None:
        """Number of coordinates."""
        return self.values.get("dofs")


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


def error_of(result: StudyResult, row: Row) -> float | None:
    """Largest NRMSE of the judged points in the window; None where one of them has none."""
    of_points = row.values.get("nrmse", {}).get(f"{result.window:g}", {}) if row.status == "ok" else {}
    errors = [of_points.get(point) for point in result.judged_points]
    known = [error for error in errors if error is not None]
    return max(known) if known and len(known) == len(errors) else None


def names_of(settings: Sequence[Setting]) -> list[str]:
    """The methods that settings belong to, each once, in order."""
    return list(dict.fromkeys(setting.method for setting in settings))


def _setting(result: StudyResult, nearby: Sequence[Row], timing: Row | None) -> Setting:
    errors = [error_of(result, row) for row in nearby]
    known = [error for error in errors if error is not None]
    own = next((row for row in nearby if not row.parameters["nearby"]), None)
    parameters = nearby[0].parameters
    return Setting(
        parameters["method"],
        parameters["at"],
        parameters["setting"],
        error=max(known) if len(known) == len(errors) else None,
        own_error=None if own is None else error_of(result, own),
        message=next(_causes(result, nearby, timing), ""),
        values={} if own is None else own.values,
        timing=timing.values if timing is not None and timing.status == "ok" else {},
    )


def _causes(result: StudyResult, nearby: Sequence[Row], timing: Row | None) -> Iterator[str]:
    """Why there is no error, or no time."""
    for row in nearby:
        if row.status != "ok":
            yield f"{row.status}: {row.message}{_near(row)}"
        elif row.parameters["method"] != REFERENCE and error_of(result, row) is None:
            yield f"no error: nothing to compare it with{_near(row)}"
    if timing is not None and timing.status != "ok":
        yield f"timing {timing.status}: {timing.message}"


def _near(row: Row) -> str:
    factors = ", ".join(f"{field} × {factor:g}" for field, factor in row.parameters["nearby"].items())
    return f" (nearby: {factors})" if factors else ""


def _coarser(result: StudyResult, at: Mapping[str, Any]) -> list[Setting]:
    return [s for s in references(result) if s.method == COARSER and s.at == at]


def _holds(error: float | None, tolerance: float) -> bool:
    return error is not None and error <= tolerance


def _lasting(settings: Sequence[Setting], refine: Mapping[str, str | None]) -> list[float | None]:
    """Of each setting the worst error of it and of those that are finer in their method's field ``refine`` alone."""
    rows = [_refined(setting, refine.get(setting.method) or "") for setting in settings]
    frame = pd.DataFrame(rows, columns=["alike", "value", "error"]).astype({"value": float, "error": float})
    worst = frame.sort_values("value").groupby("alike").error.cummax().sort_index()
    return [None if math.isinf(error) else float(error) for error in worst]


def _refined(setting: Setting, field: str) -> tuple[str, float, float]:
    """What settings share that differ in one field at most, its value, and the error, infinite where there is none."""
    rest = {name: value for name, value in setting.setting.items() if name != field}
    alike = key_of({"method": setting.method, "at": setting.at, "setting": rest})
    return alike, setting.setting.get(field, 0.0), math.inf if setting.error is None else setting.error


def _word(field: str, value: Any) -> str:
    if field == "modes":
        return f"r = {value}"
    if field == "elements":
        return f"{value} elements"
    if field == "step":
        return f"step {seconds(value)}"
    return f"{field} = {value:g}" if is_number(value) else f"{field} = {value}"


def _setting_key(row: Row) -> str:
    return key_of({field: row.parameters[field] for field in ("method", "at", "setting")})
