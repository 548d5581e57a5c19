"""What a study found, as its template says it: what was asked, what came out, what to distrust."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import (
    cheapest,
    full_methods,
    longest,
    named,
    names_of,
    points,
    pointwise_until,
    references,
    settings,
    settings_at,
    times_faster,
    uncertainty,
)
from multiphi_exudyn.study.accuracy.overview import over_all_points
from multiphi_exudyn.study.accuracy.stiff_errors import stiff_errors
from multiphi_exudyn.study.accuracy.study_file import REFERENCE
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.accuracy.study_warnings import warned
from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.comparison.wording import percent
from multiphi_exudyn.study.sweep.row import Row

__all__ = ["Choice", "Findings", "choices", "error_words", "findings", "most_accurate", "shown_points"]

TEMPLATE = "findings.txt.j2"
MOST_POINTS = 6  # of the scene's axes that pictures and tables are shown for
BUSY = 1.5  # load average from which others were at work: the run itself makes 1
FORGOTTEN = timedelta(minutes=4)  # after which a load average of the last minute knows nothing of an earlier load
UNSTEADY = 2.0  # longest over shortest repeat from which a time is worth a word


@dataclass(frozen=True)
class Findings:
    """The page's first lines, and how its times were taken."""

    asked: str
    outcome: tuple[str, ...]
    distrust: tuple[str, ...]
    timing: str


@dataclass(frozen=True)
class Choice:
    """The cheapest setting of one method for one tolerance, None where none holds it, and how much faster it is."""

    method: str
    setting: Setting | None
    faster: float | None


def findings(result: StudyResult) -> Findings:
    """The page's first lines, from the rows' numbers."""
    told = sentences(
        __package__ or "",
        TEMPLATE,
        ("asked", "outcome", "distrust", "timing"),
        result=result,
        study=result.study,
        given=settings(result),
        names=names_of(settings(result)),
        places=points(result),
        full=full_methods(result),
        label=next((s.values.get("label") for s in references(result) if s.method == REFERENCE), None),
        explained=sum(_explained(row) for row in result.budgets),
        named=named,
        error_words=error_words,
        warned=warned(result),
        **_at_one_point(result),
        **_uncertainties(result),
        **_failures(result),
        **_times(result),
    )
    return Findings(" ".join(told["asked"]), told["outcome"], told["distrust"], " ".join(told["timing"]))


def shown_points(result: StudyResult) -> list[Mapping[str, Any]]:
    """The first points of the scene's axes, those with times before the others."""
    timed = [at for at in points(result) if any(s.online_s is not None for s in settings_at(result, at))]
    return (timed or points(result))[:MOST_POINTS]


def choices(result: StudyResult, at: Mapping[str, Any], tolerance: float, lasting: bool = False) -> list[Choice]:
    """Every method's cheapest setting for a tolerance at one point of the scene's axes, the fastest first.

    lasting: whether every finer setting has to hold it as well.
    """
    chosen = cheapest(settings_at(result, at), tolerance, lasting)
    faster = times_faster(chosen, full_methods(result))
    found = [Choice(name, setting, faster[name]) for name, setting in chosen.items()]
    return sorted(found, key=lambda choice: _time(choice.setting))


def most_accurate(result: StudyResult, at: Mapping[str, Any]) -> list[Setting]:
    """Every method's most accurate setting at one point of the scene's axes."""
    known = [setting for setting in settings_at(result, at) if setting.error is not None]
    return [min((s for s in known if s.method == name), key=_error) for name in names_of(known)]


def error_words(error: float | None, own: float | None) -> str:
    """An error; one below the reference's own uncertainty only as that."""
    if error is not None and own is not None and error <= own:
        return f"≤ {percent(own)} (uncertainty)"
    return percent(error)


def _explained(row: Row) -> bool:
    """Whether a budget's parts explain all of its differences that are known."""
    groups = [each["all"] for ladders in row.values.get("windows", {}).values() for each in ladders.values()]
    known = [group["explained"] for group in groups if group is not None]
    return bool(known) and all(known)


def _at_one_point(result: StudyResult) -> dict[str, Any]:
    """Of one point the cheapest for each tolerance and the most accurate; of several every method over all of them."""
    if len(points(result)) != 1:
        table = over_all_points(result).sort_values(["points", "worst"], ascending=[False, True], kind="stable")
        best = table.groupby("method", sort=False).head(1)
        order = names_of(settings(result))
        rows = sorted(best.to_dict("records"), key=lambda row: order.index(row["method"]))
        return {"cheapest": [], "best": None, "uncertainty": None, "overall": rows}
    (at,) = points(result)
    timed = any(setting.online_s is not None for setting in settings_at(result, at))
    return {
        "cheapest": [_cheapest(result, at, tolerance) for tolerance in result.study.tolerances if timed],
        "best": min(most_accurate(result, at), key=_error, default=None),
        "uncertainty": uncertainty(result, at),
        "overall": [],
    }


def _cheapest(result: StudyResult, at: Mapping[str, Any], tolerance: float) -> dict[str, Any]:
    """The cheapest choice, and how much faster it is where every finer setting has to hold the tolerance too."""
    refined = any(method.refine for method in result.study.methods)
    lasting = choices(result, at, tolerance, lasting=True)[0].faster if refined else None
    return {"tolerance": tolerance, "best": choices(result, at, tolerance)[0], "lasting": lasting}


def _uncertainties(result: StudyResult) -> dict[str, Any]:
    """How far the reference's coarser copy is off at most, and until when [s] the two agree, if not throughout."""
    at = max(points(result) or [{}], key=lambda each: uncertainty(result, each) or 0.0)
    own = uncertainty(result, at)
    until = {tolerance: pointwise_until(result, at, tolerance) for tolerance in result.study.tolerances}
    return {
        "own": own,
        "undecided": [tolerance for tolerance in result.study.tolerances if own is not None and tolerance < own],
        "separated": {x: end for x, end in until.items() if end is not None and end < longest(result)},
        "stiff": any(stiff_errors(result, each) for each in shown_points(result)),
    }


def _failures(result: StudyResult) -> dict[str, Any]:
    bad = [row for row in result.rows if row.status != "ok"]
    return {
        "bad": len(bad),
        "gaps": sum(setting.error is None for setting in settings(result)),
        "no_reference": any(row.parameters["method"] == REFERENCE for row in bad),
        "remarks": list(dict.fromkeys(row.message for row in result.rows if row.status == "ok" and row.message)),
    }


def _times(result: StudyResult) -> dict[str, Any]:
    spreads = [(s.spread[1] / s.spread[0], s) for s in settings(result) if s.spread and s.spread[0] > 0]
    return {
        "spread": max(spreads, key=lambda pair: pair[0], default=None),
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


def _time(setting: Setting | None) -> float:
    return float("inf") if setting is None or setting.online_s is None else setting.online_s


def _error(setting: Setting) -> float:
    return float("inf") if setting.error is None else setting.error
