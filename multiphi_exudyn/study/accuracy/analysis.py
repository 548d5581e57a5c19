"""Evaluate the result of a study: Pareto fronts, cheapest settings, speedups, uncertainty of the reference.

Times in s. Tables have the columns of ``StudyResult.table``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE, is_number
from multiphi_exudyn.study.accuracy.study_result import StudyResult, worst_judged
from multiphi_exudyn.study.comparison.wording import seconds
from multiphi_exudyn.study.running.runner import modes_text
from multiphi_exudyn.study.running.timing import REPEAT_BUDGET_S
from multiphi_exudyn.study.store import key_of

__all__ = [
    "cheapest",
    "front",
    "full_methods",
    "indicators",
    "longest",
    "most_accurate",
    "named",
    "near_cheapest",
    "over_all_points",
    "points",
    "pointwise_until",
    "rank_correlation",
    "references_at",
    "settings",
    "settings_at",
    "settings_at_worst",
    "stiff_errors",
    "uncertainty",
    "words",
]

ROUND_OFF = 1e-9  # NRMSE below which two answers differ by round-off only
FEWEST = 3  # pairs that have a rank correlation
NEAR = 10.0  # times the cheapest within a tolerance: a machine whose speed varies could change the order of such times


def settings(result: StudyResult) -> pd.DataFrame:
    """All settings of the methods under study, in the order of their rows."""
    return result.table[~result.table.method.isin([REFERENCE, COARSER])]


def settings_at(result: StudyResult, at: Mapping[str, Any]) -> pd.DataFrame:
    """The methods' settings at one point of the scene's axes."""
    return _at(settings(result), at)


def settings_at_worst(result: StudyResult) -> pd.DataFrame:
    """Every setting of the methods at the point of the scene's axes where its error is largest.

    online_s: the median over the points. A setting without an error at one of the points has none.
    """
    table = settings(result).astype({"error": float, "online_s": float}).reset_index(drop=True)
    of_setting = table.groupby([table.method, table.setting.map(key_of)], sort=False)
    everywhere = of_setting.error.transform("count") == len(points(result))
    ranked = table.error.fillna(math.inf).groupby(of_setting.ngroup(), sort=False)
    online_s = of_setting.online_s.transform("median")
    return table.assign(error=table.error.where(everywhere), online_s=online_s).loc[ranked.idxmax()]


def references_at(result: StudyResult, at: Mapping[str, Any]) -> pd.DataFrame:
    """The reference and its coarser copy at one point of the scene's axes."""
    return _at(result.table[result.table.method.isin([REFERENCE, COARSER])], at)


def full_methods(result: StudyResult) -> list[str]:
    """Names of the methods that are full models."""
    return [method.name for method in result.study.methods if method.model.get("kind") == "full"]


def points(result: StudyResult) -> list[Mapping[str, Any]]:
    """The points of the scene's axes, [{}] for a study without."""
    return result.runs.drop_duplicates("point")["at"].tolist()


def front(table: pd.DataFrame) -> pd.DataFrame:
    """Pareto front of time and error, fastest first; of equal settings the first."""
    complete = table.dropna(subset=["online_s", "error"]).sort_values(["online_s", "error"], kind="stable")
    return complete[complete.error < complete.error.cummin().shift(fill_value=math.inf)]


def cheapest(
    result: StudyResult, at: Mapping[str, Any] | None, tolerance: float, lasting: bool = False
) -> pd.DataFrame:
    """Fastest setting of each method whose error is within the tolerance, the fastest method first.

    at: a point of the scene's axes; None for the worst point of every setting. A row for each method, empty if none of
    its settings is. faster: online time of the fastest full model within the tolerance over that of the setting.
    lasting: whether the lasting error has to be within the tolerance.
    """
    drawn = settings_at_worst(result) if at is None else settings_at(result, at)
    within = drawn[(drawn.lasting_error if lasting else drawn.error) <= tolerance].dropna(subset="online_s")
    best = within.sort_values(["online_s", "error"], kind="stable").groupby("method", sort=False).head(1)
    others = pd.DataFrame({"method": [name for name in drawn.method.unique() if name not in set(best.method)]})
    full = best.online_s[best.method.isin(full_methods(result))].min()
    return pd.concat([best.assign(faster=full / best.online_s), others], ignore_index=True)


def near_cheapest(result: StudyResult, at: Mapping[str, Any]) -> pd.DataFrame:
    """Settings within one of the study's tolerances, in at most ``NEAR`` times the time of the cheapest within it.

    Of runs too long to be repeated (timing.py) none.
    """
    table = settings_at(result, at)
    timed = table[table.online_s < REPEAT_BUDGET_S]
    near = pd.Series(False, timed.index)
    for tolerance in result.study.tolerances:
        for kind in ("error", "lasting_error"):
            within = timed[timed[kind] <= tolerance].online_s
            near |= timed.index.isin(within.index[within <= NEAR * within.min()])
    return timed[near]


def most_accurate(result: StudyResult, at: Mapping[str, Any]) -> pd.DataFrame:
    """Every method's most accurate setting at one point of the scene's axes."""
    table = settings_at(result, at).dropna(subset="error")
    return table.loc[table.groupby("method", sort=False).error.idxmin()]


def over_all_points(result: StudyResult) -> pd.DataFrame:
    """Over all points, for each setting: number of points with an error, its median and maximum, median time [s]."""
    table = settings(result)
    labelled = table.assign(setting=[words(setting) or "–" for setting in table.setting])
    of_setting = labelled.astype({"online_s": float}).groupby(["method", "setting"], sort=False)
    return of_setting.agg(
        points=("error", "count"), median=("error", "median"), worst=("error", "max"), online_s=("online_s", "median")
    ).reset_index()


def stiff_errors(result: StudyResult, at: Mapping[str, Any]) -> pd.DataFrame:
    """Settings with rigid levels at one point of the axes, with their errors against stiff stops.

    stiff_error: the largest NRMSE of the judged points; stiff_uncertainty: the stiff stops' own.
    """
    drawn = settings_at(result, at)
    kept = drawn.measures.map(lambda each: each.get("stiff_stops", {}))
    errors, own = (
        pd.Series([worst_judged(result, each.get(name, {})) for each in kept], drawn.index, float)
        for name in ("errors", "uncertainty")
    )
    table = drawn.assign(stiff_error=errors, stiff_uncertainty=own)
    return table.dropna(subset=["stiff_error", "stiff_uncertainty"])


def indicators(result: StudyResult) -> pd.DataFrame:
    """Columns method, indicator, error (NaN for none) of all runs with an indicator, nearby ones included."""
    runs = result.runs[~result.runs.method.isin([REFERENCE, COARSER])]
    indicator = runs.measures.map(lambda each: each.get("indicator")).astype(float)
    return runs.assign(indicator=indicator)[["method", "indicator", "error"]].dropna(subset="indicator")


def rank_correlation(pairs: pd.DataFrame) -> tuple[float | None, int]:
    """Spearman's rank correlation of indicator and error (None for too few values), and its number of runs."""
    runs = pairs[pairs.error >= ROUND_OFF]
    if len(runs) < FEWEST or runs.indicator.nunique() < 2 or runs.error.nunique() < 2:
        return None, len(runs)
    return float(runs.indicator.corr(runs.error, method="spearman")), len(runs)


def uncertainty(result: StudyResult, at: Mapping[str, Any]) -> float | None:
    """Error of the reference's coarser copy: smaller differences to the reference are not significant."""
    errors = _coarser(result, at).own_error.dropna()
    return None if errors.empty else float(errors.iloc[0])


def pointwise_until(result: StudyResult, at: Mapping[str, Any], tolerance: float) -> float | None:
    """Agreement horizon [s] of the coarser copy: pointwise comparison is not meaningful after it."""
    horizons = (each.get("horizon", {}).get(f"{tolerance:g}") for each in _coarser(result, at).measures)
    return next(horizons, None)


def longest(result: StudyResult) -> float:
    """Longest window [s] with errors: the whole run."""
    return max((float(w) for row in result.rows for w in row.values.get("nrmse", {})), default=0.0)


def words(fields: Mapping[str, Any]) -> str:
    """Fields of a setting or of a point as text: "r = 8, step 70 µs"."""
    return ", ".join(_word(field, value) for field, value in fields.items())


def named(method: str, setting: Mapping[str, Any]) -> str:
    """A method with its setting as text: "multiphi (r = 8)"."""
    return f"{method} ({words(setting)})" if setting else method


def _at(table: pd.DataFrame, at: Mapping[str, Any]) -> pd.DataFrame:
    return table[table.point == key_of(at)]


def _coarser(result: StudyResult, at: Mapping[str, Any]) -> pd.DataFrame:
    table = references_at(result, at)
    return table[table.method == COARSER]


def _word(field: str, value: Any) -> str:
    if field == "modes":
        return modes_text(value)
    if field == "elements":
        return f"{value} elements"
    if field == "step":
        return f"step {seconds(value)}"
    return f"{field} = {value:g}" if is_number(value) else f"{field} = {value}"
