"""Sentences about a study, from its template: what was compared, results, limits of the results."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.analysis import (
    NEAR,
    cheapest,
    full_methods,
    longest,
    most_accurate,
    named,
    over_all_points,
    points,
    pointwise_until,
    settings,
    settings_at,
    stiff_errors,
    uncertainty,
)
from multiphi_exudyn.study.accuracy.study_file import COARSER, REFERENCE
from multiphi_exudyn.study.accuracy.study_result import StudyResult
from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.comparison.run_warnings import run_warnings
from multiphi_exudyn.study.comparison.wording import percent
from multiphi_exudyn.study.store import Row

__all__ = ["error_text", "findings", "records", "shown_points", "study_warnings"]

TEMPLATE = "findings.txt.j2"
MOST_POINTS = 6  # of the scene's axes shown in pictures and tables
BUSY = 1.5  # load average above which other programs were running: the run itself causes 1
LOAD_MEMORY = timedelta(minutes=4)  # after which a load average of one minute no longer contains an earlier load
TICK = 1e-9  # s, resolution of the clock
UNSTEADY = 2.0  # longest over shortest repeat above which the report mentions it


def findings(result: StudyResult) -> dict[str, tuple[str, ...]]:
    """Sentences by section: compared, outcome, distrust, timing."""
    return sentences(
        __package__ or "",
        TEMPLATE,
        ("compared", "outcome", "distrust", "timing"),
        result=result,
        study=result.study,
        settings=settings(result),
        names=list(settings(result).method.unique()),
        places=points(result),
        full=full_methods(result),
        label=next((row.values.get("label") for row in result.rows if row.parameters["method"] == REFERENCE), None),
        explained=sum(_explained(row) for row in result.budgets),
        named=named,
        error_text=error_text,
        warnings=study_warnings(result),
        **_at_one_point(result),
        **_uncertainties(result),
        **_failures(result),
        **_times(result),
    )


def study_warnings(result: StudyResult) -> list[str]:
    """Warnings of the models, a sentence for each kind, and one about sensitivity horizons."""
    rows = [row for row in (*result.rows, *result.budgets) if row.status == "ok"]
    several = len(points(result)) > 1
    runs = [(_run_text(row.parameters, several), _warnings(row)) for row in rows]
    own = settings(result)
    horizons = [
        (named(method, setting), measures.get("horizon_s", {}))
        for method, setting, measures in zip(own.method, own.setting, own.measures, strict=True)
    ]
    return run_warnings(runs, horizons, longest(result))


def shown_points(result: StudyResult) -> list[Mapping[str, Any]]:
    """The first points of the scene's axes, those with times before the others."""
    timed = settings(result).dropna(subset="online_s").drop_duplicates("point")["at"].tolist()
    return (timed or points(result))[:MOST_POINTS]


def error_text(error: float | None, own: float | None) -> str:
    """An error as text; one below the uncertainty of the reference only as its bound."""
    if error is not None and own is not None and error <= own:
        return f"≤ {percent(own)} (uncertainty)"
    return percent(error)


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Rows of a table as dicts, with None for missing values."""
    rows = table.astype(object).where(table.notna(), None).to_dict("records")
    return [{str(name): value for name, value in line.items()} for line in rows]


def _run_text(parameters: Mapping[str, Any], several: bool) -> str:
    """A run as text; several: whether the text includes the point of the scene's axes."""
    at = parameters["at"] if several else {}
    near = "".join(f", {field} × {factor:g}" for field, factor in parameters["nearby"].items())
    return named(parameters["method"], {**parameters["setting"], **at}) + near


def _warnings(row: Row) -> list[str]:
    """Warnings of a run, or of the rungs of a budget."""
    rungs = row.values.get("rungs", {}).values()
    return list(row.values.get("warnings", [sentence for rung in rungs for sentence in rung["warnings"]]))


def _explained(row: Row) -> bool:
    """Whether the parts of a budget add up to all of its differences."""
    groups = [each["all"] for ladders in row.values.get("windows", {}).values() for each in ladders.values()]
    explained = [group["explained"] for group in groups if group is not None]
    return bool(explained) and all(explained)


def _at_one_point(result: StudyResult) -> dict[str, Any]:
    """Values for the template: cheapest and most accurate settings at a single point, or errors over all points."""
    if len(points(result)) != 1:
        table = over_all_points(result).sort_values(["points", "worst"], ascending=[False, True], kind="stable")
        best = table.groupby("method", sort=False).head(1).sort_index()
        return {"cheapest": [], "best": None, "uncertainty": None, "overall": records(best)}
    (at,) = points(result)
    timed = settings_at(result, at).online_s.notna().any()
    best = most_accurate(result, at).sort_values("error", kind="stable").head(1)
    return {
        "cheapest": [_cheapest(result, at, tolerance) for tolerance in result.study.tolerances if timed],
        "best": next(iter(records(best)), None),
        "uncertainty": uncertainty(result, at),
        "overall": [],
    }


def _cheapest(result: StudyResult, at: Mapping[str, Any], tolerance: float) -> dict[str, Any]:
    """The cheapest setting, and the cheapest one of which every finer setting holds the tolerance too.

    lasting: None where no method has finer settings; lasts: whether both are the same.
    """
    best, lasting = (records(cheapest(result, at, tolerance, kind))[0] for kind in (False, True))
    refined = any(method.refine for method in result.study.methods)
    lasts = all(best[name] == lasting[name] for name in ("method", "setting", "faster"))
    return {"tolerance": tolerance, "best": best, "lasting": lasting if refined else None, "lasts": lasts}


def _uncertainties(result: StudyResult) -> dict[str, Any]:
    """Values for the template: largest error of the coarser copy, and its agreement horizons [s] before the end."""
    coarser = result.table[result.table.method == COARSER].sort_values("own_error", ascending=False, kind="stable")
    at: Mapping[str, Any] = next(iter(coarser["at"]), {})
    own = uncertainty(result, at)
    until = {tolerance: pointwise_until(result, at, tolerance) for tolerance in result.study.tolerances}
    return {
        "own": own,
        "undecided": [tolerance for tolerance in result.study.tolerances if own is not None and tolerance < own],
        "separated": {x: end for x, end in until.items() if end is not None and end < longest(result)},
        "stiff": any(len(stiff_errors(result, each)) for each in shown_points(result)),
    }


def _failures(result: StudyResult) -> dict[str, Any]:
    bad = [row for row in result.rows if row.status != "ok"]
    return {
        "bad": len(bad),
        "gaps": settings(result).error.isna().sum(),
        "no_reference": any(row.parameters["method"] == REFERENCE for row in bad),
        "remarks": list(dict.fromkeys(row.message for row in result.rows if row.status == "ok" and row.message)),
    }


def _times(result: StudyResult) -> dict[str, Any]:
    timed = settings(result).dropna(subset="repeats_s")
    timed = timed[timed.repeats_s.map(len) > 0]
    repeated = timed[~timed.in_turns]  # the others' quartiles do not depend on their longest times
    spread = repeated.repeats_s.map(lambda repeats: max(repeats) / max(min(repeats), TICK)).astype(float)
    widest = repeated.loc[[spread.idxmax()]].iloc[0] if len(repeated) else None
    return {
        "spread": None if widest is None else float(spread.max()),
        "widest": None if widest is None else named(widest.method, widest.setting),
        "unsteady": UNSTEADY,
        "loads": _loads(result),
        "busy": BUSY,
        "hosts": len({row.environment.get("host") for row in (*result.timings, *result.turns)}),
        "rounds": timed.repeats_s[timed.in_turns].map(len).tolist(),
        "near": NEAR,
        "counts": [len(row.values["repeats_s"]) for row in result.timings if row.status == "ok"],
    }


def _loads(result: StudyResult) -> list[float]:
    """Load averages of the machine during the timing pass, if the system has them.

    Those of the first minutes are left out, since they contain the load before.
    """
    ended = [datetime.fromisoformat(row.finished.replace("Z", "+00:00")) for row in result.timings]
    late = [row for row, at in zip(result.timings, ended, strict=True) if at - min(ended) > LOAD_MEMORY]
    given = [row.values["load_average"] for row in late if row.status == "ok"]
    return [load for load in given if load is not None]
