"""A study's result: its rows, and the settings they stand for, each with its error and its time.

The error of a setting is the worst, over its nearby runs, of the largest NRMSE of the judged points from 0 to the
study's window. Where one of these runs has no error the setting has none either: a gap with a cause, never a smaller
number. Everything is computed from the rows alone. Times in s.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.study_file import REFERENCE, StudyFile
from multiphi_exudyn.study.measures.spectra import Map
from multiphi_exudyn.study.sweep.store import Row, key_of

__all__ = ["MapPair", "Setting", "StudyResult", "error_of"]

COUNTS = ("modes", "elements")  # fields of which more are finer; of others less are

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


def error_of(result: StudyResult, row: Row) -> float | None:
    """Largest NRMSE of the judged points in the window; None where one of them has none."""
    of_points = row.values.get("nrmse", {}).get(f"{result.window:g}", {}) if row.status == "ok" else {}
    errors = [of_points.get(point) for point in result.judged_points]
    known = [error for error in errors if error is not None]
    return max(known) if known and len(known) == len(errors) else None


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


def _lasting(settings: Sequence[Setting], refine: Mapping[str, str | None]) -> list[float | None]:
    """Of each setting the worst error of it and of those that are finer in their method's field ``refine`` alone."""
    rows = [_refined(setting, refine.get(setting.method) or "") for setting in settings]
    frame = pd.DataFrame(rows, columns=["alike", "value", "error"]).astype({"value": float, "error": float})
    worst = frame.sort_values("value").groupby("alike").error.cummax().sort_index()
    return [None if math.isinf(error) else float(error) for error in worst]


def _refined(setting: Setting, field: str) -> tuple[str, float, float]:
    """What settings share that differ in one field at most, its value, finer ones first, and the error.

    The error is infinite where there is none.
    """
    value = setting.setting.get(field, 0.0)
    rest = {name: value for name, value in setting.setting.items() if name != field}
    alike = key_of({"method": setting.method, "at": setting.at, "setting": rest})
    return alike, -value if field in COUNTS else value, math.inf if setting.error is None else setting.error


def _setting_key(row: Row) -> str:
    return key_of({field: row.parameters[field] for field in ("method", "at", "setting")})
