"""The study's page: one self-contained HTML file, its pictures embedded. Sections without data do not appear."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from multiphi_exudyn.study.accuracy import study_figures
from multiphi_exudyn.study.accuracy.along_axis import numeric_axes, series, tables_along
from multiphi_exudyn.study.accuracy.analysis import (
    cheapest,
    full_methods,
    indicators,
    most_accurate,
    over_all_points,
    points,
    rank_correlation,
    references_at,
    settings_at,
    stiff_errors,
    uncertainty,
    words,
)
from multiphi_exudyn.study.accuracy.budget_figure import budget_figure
from multiphi_exudyn.study.accuracy.map_figure import map_figure
from multiphi_exudyn.study.accuracy.study_findings import error_text, findings, records, shown_points
from multiphi_exudyn.study.accuracy.study_result import StudyResult
from multiphi_exudyn.study.comparison.pages import Picture, environment_of
from multiphi_exudyn.study.comparison.wording import percent, seconds
from multiphi_exudyn.study.measures import metrics

__all__ = ["render_study"]

TEMPLATE = "study.html.j2"
MOST_FAILURES = 100  # listed on the page; the CSV file has all
PARETO = (
    "The line of a method joins its Pareto-optimal settings: no other setting is better in both time and error. Errors "
    "in the grey band are below the uncertainty of the reference. Thin lines: the tolerances of the table below. "
    "Colours are the same in all pictures."
)
CONVERGENCE = (
    "In brackets: the other fields, each at its finest value. Order: observed between neighbouring values. ×: failed."
)
ALONG = "Every method at its finest setting; a gap in a line is a failed run."
RESPONSE = "Response of the reference at the points of the scene's axes."
INDICATOR = (
    "All runs with an indicator, nearby ones included. On the line the prediction is exact. The indicator predicts the "
    "error of modal truncation, not that of a contact law other than the reference's."
)
BUDGET = (
    "Bars: size of each part, whiskers its uncertainty, numbers its share of the whole difference in %. "
    "Pale: no larger than its uncertainty. Dashed line: the whole difference between full and reduced."
)
MAPS = (
    "The reference and {}. Dashed: natural frequencies of the levels [Hz]. Hatched: affected by the ends of the "
    "record. Grey bars on top: in contact."
)


def render_study(result: StudyResult) -> str:
    """The page as HTML."""
    environment = environment_of(__package__ or "")
    environment.filters |= {"words": words, "cell": cell_text}
    shown = [_point(result, at) for at in shown_points(result)]
    timed = [point for point in shown if point["pareto"]]
    return environment.get_template(TEMPLATE).render(
        name=result.name,
        title=result.study.title,
        findings=findings(result),
        definitions=metrics.METRICS.values(),
        assumptions=result.assumptions,
        environment=result.environment,
        result=result,
        study=result.study,
        shown=shown,
        timed=timed,
        zoom=[study_figures.error_against_time(result, point["at"], k) for k, point in enumerate(timed)],
        count=len(points(result)),
        kinds=[False, True] if any(method.refine for method in result.study.methods) else [False],
        cheapest=lambda *options: records(cheapest(result, *options)),
        full=full_methods(result),
        error_text=error_text,
        overall=_overall(result) if len(points(result)) > 1 else None,
        response=_drawn(study_figures.response_figure(result), RESPONSE),
        along=[_along(result, axis) for axis in numeric_axes(result.table, "at")],
        indicator=_drawn(study_figures.indicator_figure(result), INDICATOR),
        correlations=_correlations(result),
        budget=_budget(result),
        maps=list(_maps(result)),
        failed=[row for row in (*result.rows, *result.timings, *result.turns, *result.budgets) if row.status != "ok"],
        most_failures=MOST_FAILURES,
        metrics=metrics.METRICS,
    )


def cell_text(value: float | None, quantity: str) -> str:
    """A cell of a table along an axis, with its unit."""
    if value is None or math.isnan(value):
        return "–"
    if quantity == "error":
        return percent(value)
    if quantity == "first_contact":
        return f"{1e3 * value:.3f} ms"
    if quantity == "largest":
        return f"{1e3 * value:.4g} mm"
    units = {"impulse": " N s", "largest_force": " N"}
    return f"{value:.4g}{units.get(quantity, '')}"


def _point(result: StudyResult, at: Mapping[str, Any]) -> dict[str, Any]:
    """What is shown for one point of the scene's axes."""
    drawn = settings_at(result, at)
    known = drawn.dropna(subset=["online_s", "error"])
    axes, methods = numeric_axes(drawn, "setting"), drawn.method.unique()
    touched = pd.concat([references_at(result, at), most_accurate(result, at)])
    return {
        "at": at,
        "uncertainty": uncertainty(result, at),
        "pareto": Picture.of(study_figures.pareto_figure(result, at), PARETO) if len(known) else None,
        "convergence": _drawn(study_figures.convergence_figure(result, at), CONVERGENCE),
        "lines": [line for axis in axes for name in methods if (line := series(drawn, name, axis))],
        "stiff": records(stiff_errors(result, at)),
        "contact": [each for each in records(touched) if each["measures"].get("first_contact")],
    }


def _drawn(figure: Figure | None, caption: str) -> Picture | None:
    return None if figure is None else Picture.of(figure, caption)


def _overall(result: StudyResult) -> pd.DataFrame:
    """Every setting over all points, in words."""
    table = over_all_points(result).set_index("method")
    text_of = {"median": percent, "worst": percent, "online_s": seconds}
    headings = {"points": "points with an error", "median": "error, median", "worst": "error, largest"}
    texts = table.assign(**{column: table[column].map(text) for column, text in text_of.items()})
    return texts.rename(columns={**headings, "online_s": "online, median"}).rename_axis(index=None, columns="method")


def _along(result: StudyResult, axis: str) -> tuple[str, Picture, list[pd.DataFrame]]:
    """An axis of the scene, its picture, and a table in words for each quantity."""
    tables = []
    for column, table in tables_along(result, axis).items():
        quantity, _, name = column.partition(".")
        label = metrics.METRICS[quantity].label if quantity in metrics.METRICS else "error"
        texts = table.map(cell_text, quantity=quantity).rename(columns="{:g}".format)
        tables.append(texts.rename_axis(index=None, columns=", ".join(filter(None, (label, name)))))
    return axis, Picture.of(study_figures.along_figure(result, axis), ALONG), tables


def _correlations(result: StudyResult) -> pd.DataFrame:
    """By method, then of all together: the rank correlation, of how many runs, how many have an indicator."""
    pairs = indicators(result)
    found = {str(name): (*rank_correlation(own), len(own)) for name, own in pairs.groupby("method", sort=False)}
    found |= {"all": (*rank_correlation(pairs), len(pairs))} if len(found) > 1 else {}
    lines = {name: ["–" if size is None else f"{size:.3f}", *counts] for name, (size, *counts) in found.items()}
    columns = pd.Index(["rank correlation", "runs", "with an indicator"], name="method")
    return pd.DataFrame.from_dict(lines, orient="index", columns=columns)


def _budget(result: StudyResult) -> Picture | None:
    values = [row.values for row in result.budgets if row.values]
    return Picture.of(budget_figure(values), BUDGET) if values else None


def _maps(result: StudyResult) -> Iterator[Picture]:
    for label, pairs in itertools.groupby(sorted(result.maps, key=lambda pair: pair.label), lambda pair: pair.label):
        yield Picture.of(map_figure(list(pairs)), MAPS.format(label))
