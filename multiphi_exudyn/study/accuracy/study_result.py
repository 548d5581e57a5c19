"""A study's result: its rows, a table with a line for each setting, and one with everything, as ``runs.csv`` has it.

The error of a setting is the worst, over its nearby runs, of the largest NRMSE of the judged points from 0 to the
study's window. Where one of these runs has no error the setting has none either: a gap with a cause, never a smaller
number. Everything is computed from the rows alone. Times in s.
"""

from __future__ import annotations

import functools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from multiphi_exudyn.study.accuracy.study_file import REFERENCE, StudyFile
from multiphi_exudyn.study.measures.spectra import Map
from multiphi_exudyn.study.running.timing import FEWEST_ROUNDS, undisturbed
from multiphi_exudyn.study.store import Row, key_of

__all__ = ["MapPair", "StudyResult", "all_numbers", "csv_text", "error_of", "setting_key", "worst_judged"]

COUNTS = ("modes", "elements")  # fields of which more are finer; of others less are
TIMES = ["online_s", "first_s", "offline_s", "repeats_s"]

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
    """A study with all its rows: of the error pass, of the timing pass, of settings in turns, of the budgets."""

    study: StudyFile
    name: str
    judged_points: tuple[str, ...]
    window: float
    rows: tuple[Row, ...]
    timings: tuple[Row, ...]
    turns: tuple[Row, ...]
    budgets: tuple[Row, ...]
    maps: tuple[MapPair, ...]
    environment: Mapping[str, Any]
    assumptions: tuple[str, ...]
    quick: bool

    @functools.cached_property
    def runs(self) -> pd.DataFrame:
        """A line for each run of the error pass.

        key: of its setting; point: of its point of the scene's axes. at, setting, nearby: field -> value.
        error: NaN without; cause: why there is none, or "". measures: all of them, by name.
        """
        lines = [
            {
                "key": setting_key(row.parameters),
                "point": key_of(row.parameters["at"]),
                **row.parameters,
                "error": error_of(self, row),
                "cause": _cause(self, row),
                "measures": row.values,
            }
            for row in self.rows
        ]
        columns = ["key", "point", "method", "at", "setting", "nearby", "error", "cause", "measures"]
        return pd.DataFrame(lines, columns=columns).astype({"error": float})

    @functools.cached_property
    def table(self) -> pd.DataFrame:
        """A line for each setting of a method at a point of the scene's axes, the references included.

        error: the worst of the nearby runs; NaN where one of them has none, and message names the cause.
        own_error: of the setting itself. lasting_error: the worst of it and of every finer setting that was tried,
        finer in its method's field ``refine`` alone; of methods without such a field its error. measures: of its own
        run. online_s, the median of repeats_s, first_s and offline_s are of the timing pass.
        Of settings that were timed in turns, in_turns, repeats_s is of these, and online_s its lower quartile.
        """
        own = self.runs[self.runs.nearby.map(len) == 0].set_index("key")
        of_setting = self.runs.assign(error=self.runs.error.fillna(math.inf)).groupby("key")
        cause = of_setting.cause.agg(lambda causes: next(filter(None, causes), ""))
        timings = [(setting_key(row.parameters), row) for row in self.timings]
        times = {key: {**row.values, **self._turns.get(key, {})} for key, row in timings if row.status == "ok"}
        untimed = {key: f"timing {row.status}: {row.message}" for key, row in timings if row.status != "ok"}
        table = own.rename(columns={"error": "own_error"}).assign(error=of_setting.error.max(), cause=cause)
        table = table.join(pd.DataFrame.from_dict(times, orient="index").reindex(columns=TIMES))
        table["in_turns"] = table.index.isin(list(self._turns))
        table["message"] = table.cause.where(table.cause != "", [untimed.get(str(key), "") for key in table.index])
        table["lasting_error"] = self._lasting(table)
        return table.replace({"error": math.inf, "lasting_error": math.inf}, np.nan)

    @functools.cached_property
    def _turns(self) -> dict[str, dict[str, Any]]:
        """Setting, by its key -> its times [s] in turns, and the one that counts."""
        return {setting_key(case): found for row in self.turns for case, found in _of_cases(row)}

    def _lasting(self, table: pd.DataFrame) -> pd.Series:
        """The worst error so far from the finest setting to the coarsest, of those alike but for one field."""
        refine = {method.name: method.refine or "" for method in self.study.methods}
        fields = table.method.map(refine).fillna("")
        pairs = list(zip(fields, table.setting, strict=True))
        alike = [key_of({name: value for name, value in given.items() if name != field}) for field, given in pairs]
        order = [given.get(field, 0.0) * (-1 if field in COUNTS else 1) for field, given in pairs]
        finest_first = table.assign(order=pd.array(order, float)).sort_values("order", kind="stable")
        return finest_first.error.groupby([table.point, table.method, pd.Series(alike, table.index)]).cummax()


def error_of(result: StudyResult, row: Row) -> float | None:
    """Largest NRMSE of the judged points in the window; None where one of them has none."""
    return worst_judged(result, row.values.get("nrmse", {})) if row.status == "ok" else None


def worst_judged(result: StudyResult, by_window: Mapping[str, Mapping[str, float | None]]) -> float | None:
    """The largest entry of the judged points in the study's window; None where one of them has none."""
    of_points = by_window.get(f"{result.window:g}", {})
    known = [of_points.get(point) for point in result.judged_points]
    return max((each for each in known if each is not None), default=None) if None not in known else None


def all_numbers(result: StudyResult) -> pd.DataFrame:
    """One line for each run: its error pass, its timing and its budget; ``multiphi_exudyn.study.load`` says which."""
    lines: dict[str, dict[str, Any]] = {}
    for row in result.rows:
        lines[key_of(row.parameters)] = {**row.parameters, **_of_run(row), "error": error_of(result, row)}
    for name, rows in (("timing", result.timings), ("budget", result.budgets)):
        for row in rows:
            lines.setdefault(key_of(row.parameters), dict(row.parameters))[name] = _of_run(row)
    for case, found in (pair for row in result.turns for pair in _of_cases(row)):
        lines[key_of(case)]["turns"] = found
    return pd.json_normalize(list(lines.values()))


def csv_text(result: StudyResult) -> str:
    """The same as CSV; lists are JSON."""

    def text(cell: Any) -> Any:
        return json.dumps(cell) if isinstance(cell, (list, tuple)) else cell

    return all_numbers(result).map(text).to_csv(index=False, lineterminator="\n")


def _of_run(row: Row) -> dict[str, Any]:
    of_run = {"status": row.status, "cause": row.message, "elapsed_s": row.elapsed_s, "finished": row.finished}
    return {**of_run, **row.values}


def setting_key(parameters: Mapping[str, Any]) -> str:
    """Key of the setting in these parameters of a run: the same for its nearby runs."""
    return key_of({field: parameters[field] for field in ("method", "at", "setting")})


def _of_cases(row: Row) -> Iterator[tuple[Mapping[str, Any], dict[str, Any]]]:
    """Each case of a row of settings in turns, with its times [s]; none of a row that failed, or of too few rounds."""
    for case, repeats in zip(row.parameters["cases"], row.values.get("repeats_s", ()), strict=False):
        if len(repeats) >= FEWEST_ROUNDS:
            yield case, {"online_s": undisturbed(repeats), "repeats_s": repeats}


def _cause(result: StudyResult, row: Row) -> str:
    """Why a run has no error; empty where it has one."""
    factors = ", ".join(f"{field} × {factor:g}" for field, factor in row.parameters["nearby"].items())
    near = f" (nearby: {factors})" if factors else ""
    if row.status != "ok":
        return f"{row.status}: {row.message}{near}"
    if row.parameters["method"] != REFERENCE and error_of(result, row) is None:
        return f"no error: nothing to compare it with{near}"
    return ""
