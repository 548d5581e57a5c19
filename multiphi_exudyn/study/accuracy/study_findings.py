"""What a study found, in plain words: what was asked, what came out, what to distrust."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from multiphi_exudyn.study.accuracy.analysis import (
    REFERENCE,
    Setting,
    StudyResult,
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
from multiphi_exudyn.study.accuracy.study_warnings import warned
from multiphi_exudyn.study.comparison.wording import percent, seconds, sentence, times
from multiphi_exudyn.study.sweep.store import Row

__all__ = [
    "Choice",
    "Findings",
    "choices",
    "error_words",
    "findings",
    "most_accurate",
    "share",
    "shown_points",
    "timing_words",
]

MOST_POINTS = 6  # of the scene's axes that pictures and tables are shown for
BUSY = 1.5  # load average from which others were at work: the run itself makes 1
FORGOTTEN = timedelta(minutes=4)  # after which a load average of the last minute knows nothing of an earlier load
UNSTEADY = 2.0  # longest over shortest repeat from which a time is worth a word


@dataclass(frozen=True)
class Findings:
    """The page's first lines."""

    asked: str
    outcome: tuple[str, ...]
    distrust: tuple[str, ...]


@dataclass(frozen=True)
class Choice:
    """The cheapest setting of one method for one tolerance, None where none holds it, and how much faster it is."""

    method: str
    setting: Setting | None
    faster: float | None


def findings(result: StudyResult) -> Findings:
    """The page's first lines, from the rows' numbers."""
    return Findings(_asked(result), tuple(_outcome(result)), tuple(_distrust(result)))


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


def share(value: float) -> str:
    """A tolerance as it was given: "5 %", "0.5 %"."""
    return f"{100 * value:g} %"


def timing_words(result: StudyResult) -> str:
    """How the times were taken, from the rows of the timing pass."""
    values = [row.values for row in result.timings if row.status == "ok"]
    if not values:
        return ""
    counts = [len(each["repeats_s"]) for each in values]
    loads = _loads(result)
    load = f" Load average of the machine meanwhile: {min(loads):.2g} to {max(loads):.2g}." if loads else ""
    repeats = f"{min(counts)}" if min(counts) == max(counts) else f"{min(counts)} to {max(counts)}"
    return f"{len(values)} settings timed, {repeats} repeats each.{load}"


def _asked(result: StudyResult) -> str:
    if result.study.methods:
        return _asked_of_errors(result)
    return (
        "Where does the difference between the full and the reduced model come from? One run per rung of a ladder from "
        f"one to the other, one cause per difference. Scene: {result.study.scene}, {len(result.budgets)} budgets."
    )


def _explained(row: Row) -> bool:
    """Whether a budget's parts explain all of its differences that are known."""
    groups = [each["all"] for ladders in row.values.get("windows", {}).values() for each in ladders.values()]
    known = [group["explained"] for group in groups if group is not None]
    return bool(known) and all(known)


def _asked_of_errors(result: StudyResult) -> str:
    given, window = settings(result), f"{result.window:g} s"
    axes = result.study.axes
    where = f", at {len(points(result))} points of {' × '.join(axes)}" if axes else ""
    label = next((s.values.get("label") for s in references(result) if s.method == REFERENCE), None)
    return (
        f"How wrong are {len(names_of(given))} methods, at {len(given)} settings in all, and how long do they take? "
        f"Scene: {result.study.scene}{where}. Error: NRMSE to {window}, the worst of {', '.join(result.judged_points)} "
        f"and of each setting's nearby runs, against the reference{f', the {label}' if label else ''}."
    )


def _outcome(result: StudyResult) -> Iterable[str]:
    """One sentence per tolerance, or with several points one per method; the budgets."""
    if len(points(result)) == 1:
        yield from _outcome_at(result, points(result)[0])
    elif settings(result):
        yield from _over_all(result)
    if result.budgets:
        explained = sum(_explained(row) for row in result.budgets)
        whole = len(result.budgets)
        yield f"Of {whole} error budgets {explained} are explained by their parts; the table below has them."


def _over_all(result: StudyResult) -> Iterable[str]:
    """Every method at the setting whose largest error over all points is the smallest."""
    table = over_all_points(result)
    count = len(points(result))
    for method, of_method in table.groupby("method", sort=False):
        best = of_method.sort_values(["points", "worst"], ascending=[False, True]).iloc[0]
        if best.points == 0:
            yield f"{method}: no error is known."
            continue
        where = f"all {count} points" if best.points == count else f"{best.points} of {count} points"
        time = f"; {seconds(best.online_s)} in the median" if math.isfinite(best.online_s) else ""
        error = f"{percent(best['median'])} in the median, at most {percent(best.worst)}"
        yield f"{method} ({best.setting}): error {error}, at {where}{time}."


def _outcome_at(result: StudyResult, at: Mapping[str, Any]) -> Iterable[str]:
    drawn = settings_at(result, at)
    if any(setting.online_s is not None for setting in drawn):
        yield from (_cheapest_words(result, at, tolerance) for tolerance in result.study.tolerances)
    best = min(most_accurate(result, at), key=_error, default=None)
    if best is not None:
        yield f"The most accurate is {named(best)}: {error_words(best.error, uncertainty(result, at))}."


def _cheapest_words(result: StudyResult, at: Mapping[str, Any], tolerance: float) -> str:
    best, full = choices(result, at, tolerance)[0], full_methods(result)
    if best.setting is None:
        return f"None of the settings reaches {share(tolerance)}."
    faster = ""
    if best.faster is None and full:
        faster = "; no full model does"
    elif best.faster is not None and best.method not in full:
        faster = (
            f", {times(best.faster)} faster than the cheapest full model that does{_lastingly(result, at, tolerance)}"
        )
    online = seconds(best.setting.online_s)
    return f"The cheapest that reaches {share(tolerance)} is {named(best.setting)}: {online}{faster}."


def _lastingly(result: StudyResult, at: Mapping[str, Any], tolerance: float) -> str:
    """How much faster where a setting has to hold the tolerance at every finer step as well."""
    if not any(method.refine for method in result.study.methods):
        return ""
    best = choices(result, at, tolerance, lasting=True)[0]
    return f" ({times(best.faster)}, where every finer setting has to hold it too)" if best.faster is not None else ""


def _distrust(result: StudyResult) -> Iterable[str]:
    if result.quick:
        yield "This is the study's short form: few settings. It shows that everything runs, no more."
    yield from map(sentence, warned(result))
    at = max(points(result) or [{}], key=lambda each: uncertainty(result, each) or 0.0)
    yield _own_uncertainty(result, at)
    if any(stiff_errors(result, each) for each in shown_points(result)):
        yield "Rigid levels are the limit of stiff stops; a table below measures them against some as well."
    yield from _failures(result)
    yield from _times(result)
    if result.timings:
        yield "Cheapest means: cheapest of the settings that were tried."
    if result.assumptions:
        yield "No measurement is compared here; what is assumed about the structure is listed under Assumptions."


def _own_uncertainty(result: StudyResult, at: Mapping[str, Any]) -> str:
    own, most = uncertainty(result, at), " at most, over all points" if len(points(result)) > 1 else ""
    if own is None:
        return "The reference's own uncertainty is unknown: no coarser copy of it ran."
    below = [share(tolerance) for tolerance in result.study.tolerances if tolerance < own]
    undecided = f" Who reaches {', '.join(below)} is not decided here." if below else ""
    return (
        f"The reference differs from a coarser copy of itself by {percent(own)}{most}. Smaller errors say nothing."
        f"{undecided}{_pointwise(result, at)}"
    )


def _pointwise(result: StudyResult, at: Mapping[str, Any]) -> str:
    """Until when the reference and its coarser copy agree, where that is not the whole run."""
    until = {tolerance: pointwise_until(result, at, tolerance) for tolerance in result.study.tolerances}
    early = [
        f"to {share(x)} until {end:.3g} s" for x, end in until.items() if end is not None and end < longest(result)
    ]
    after = "after that compare contact times and energies, not curves."
    return f" The two agree {', '.join(early)}; {after}" if early else ""


def _failures(result: StudyResult) -> Iterable[str]:
    bad = [row for row in result.rows if row.status != "ok"]
    gaps = [setting for setting in settings(result) if setting.error is None]
    if any(row.parameters["method"] == REFERENCE for row in bad):
        yield "A reference failed: at that point of the scene's axes nothing can be measured."
    if bad:
        yield (
            f"{len(bad)} of {len(result.rows)} runs failed or took too long. Settings without an error: {len(gaps)} of "
            f"{len(settings(result))}. The causes are listed below."
        )
    remarks = list(dict.fromkeys(row.message for row in result.rows if row.status == "ok" and row.message))
    if remarks:
        yield f"Runs that reached their end had {len(remarks)} remarks, the first: {remarks[0]}."


def _times(result: StudyResult) -> Iterable[str]:
    spreads = [(s.spread[1] / s.spread[0], s) for s in settings(result) if s.spread and s.spread[0] > 0]
    if spreads:
        ratio, setting = max(spreads, key=lambda pair: pair[0])
        most = f" The repeats of {named(setting)} differ most: {ratio:.2g} to 1." if ratio > UNSTEADY else ""
        yield f"Run times are wall clock on one machine: ratios count.{most}"
    load = max(_loads(result), default=0.0)
    if load > BUSY:
        yield f"The timing pass was not alone on the machine: the load average rose to {load:.2g}."
    hosts = {row.environment.get("host") for row in result.timings}
    if len(hosts) > 1:
        yield f"Times were taken on {len(hosts)} machines: compare no time of one with a time of another."


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
