"""What a study found, as its template says it: what was compared, what came out, what to distrust."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime, timedelta
from typing import Any

import pandas as pd

from multiphi_exudyn.study.accuracy.analysis import (
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
from multiphi_exudyn.study.sweep.row import Row

__all__ = ["error_text", "findings", "records", "shown_points", "study_warnings"]

TEMPLATE = "findings.txt.j2"
MOST_POINTS = 6  # of the scene's axes that pictures and tables are shown for
BUSY = 1.5  # load average from which others were at work: the run itself makes 1
FORGOTTEN = timedelta(minutes=4)  # after which a load average of the last minute knows nothing of an earlier load
TICK = 1e-9  # s, of the clock: no time is shorter
UNSTEADY = 2.0  # longest over shortest repeat from which a time is worth a word


def findings(result: StudyResult) -> dict[str, tuple[str, ...]]:
    """Sentences: compared, outcome, distrust; and timing, how times were taken."""
    return sentences(
        __package__ or "",
        TEMPLATE,
        ("compared", "outcome", "distrust", "timing"),
        result=result,
        study=result.study,
        given=settings(result),
        names=list(settings(result).method.unique()),
        places=points(result),
        full=full_methods(result),
        label=next((row.values.get("label") for row in result.rows if row.parameters["method"] == REFERENCE), None),
        explained=sum(_explained(row) for row in result.budgets),
        named=named,
        error_text=error_text,
        warned=study_warnings(result),
        **_at_one_point(result),
        **_uncertainties(result),
        **_failures(result),
        **_times(result),
    )


def study_warnings(result: StudyResult) -> list[str]:
    """What the models warn of, a sentence for each kind, and how long their runs are determined."""
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
    """An error; one below the reference's own uncertainty only as that."""
    if error is not None and own is not None and error <= own:
        return f"≤ {percent(own)} (uncertainty)"
    return percent(error)


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The lines of a table as a template takes them, None where there is nothing."""
    found = table.astype(object).where(table.notna(), None).to_dict("records")
    return [{str(name): value for name, value in line.items()} for line in found]


def _run_text(parameters: Mapping[str, Any], several: bool) -> str:
    """A run, in words of its own; several: whether it has its point of the scene's axes in them."""
    at = parameters["at"] if several else {}
    near = "".join(f", {field} × {factor:g}" for field, factor in parameters["nearby"].items())
    return named(parameters["method"], {**parameters["setting"], **at}) + near


def _warnings(row: Row) -> list[str]:
    """Of a run; of a budget those of its rungs."""
    rungs = row.values.get("rungs", {}).values()
    return list(row.values.get("warnings", [sentence for rung in rungs for sentence in rung["warnings"]]))


def _explained(row: Row) -> bool:
    """Whether a budget's parts explain all of its differences that are known."""
    groups = [each["all"] for ladders in row.values.get("windows", {}).values() for each in ladders.values()]
    known = [group["explained"] for group in groups if group is not None]
    return bool(known) and all(known)


def _at_one_point(result: StudyResult) -> dict[str, Any]:
    """Of one point the cheapest for each tolerance and the most accurate; of several every method over all of them."""
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
    """The cheapest setting, and how much faster it is where every finer setting has to hold the tolerance too."""
    best, lasting = (records(cheapest(result, at, tolerance, kind))[0] for kind in (False, True))
    refined = any(method.refine for method in result.study.methods)
    return {"tolerance": tolerance, "best": best, "lasting": lasting["faster"] if refined else None}


def _uncertainties(result: StudyResult) -> dict[str, Any]:
    """How far the reference's coarser copy is off at most, and until when [s] the two agree, if not throughout."""
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
    spread = timed.repeats_s.map(lambda repeats: max(repeats) / max(min(repeats), TICK)).astype(float)
    widest = timed.loc[[spread.idxmax()]].iloc[0] if len(timed) else None
    return {
        "spread": None if widest is None else float(spread.max()),
        "widest": None if widest is None else named(widest.method, widest.setting),
        "unsteady": UNSTEADY,
        "loads": _loads(result),
        "busy": BUSY,
        "hosts": len({row.environment.get("host") for row in result.timings}),
        "counts": [len(row.values["repeats_s"]) for row in result.timings if row.status == "ok"],
    }


def _loads(result: StudyResult) -> list[float]:
    """The machine's load averages while settings were timed, where the system tells them.

    Those of the first minutes, which still remember what ran before, do not count.
    """
    ended = [datetime.fromisoformat(row.finished.replace("Z", "+00:00")) for row in result.timings]
    late = [row for row, at in zip(result.timings, ended, strict=True) if at - min(ended) > FORGOTTEN]
    given = [row.values["load_average"] for row in late if row.status == "ok"]
    return [load for load in given if load is not None]
