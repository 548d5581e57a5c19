"""The study's page: one self-contained HTML file, its pictures embedded. Sections without data do not appear."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from multiphi_exudyn.study.accuracy import study_figures
from multiphi_exudyn.study.accuracy.along_axis import Series, numeric_axes, series, tables_along
from multiphi_exudyn.study.accuracy.analysis import (
    full_methods,
    names_of,
    points,
    references,
    settings,
    settings_at,
    uncertainty,
    words,
)
from multiphi_exudyn.study.accuracy.budget_figure import budget_figure
from multiphi_exudyn.study.accuracy.indicator import indicators, rank_correlation
from multiphi_exudyn.study.accuracy.map_figure import map_figure
from multiphi_exudyn.study.accuracy.overview import over_all_points, response_figure
from multiphi_exudyn.study.accuracy.stiff_errors import StiffError, stiff_errors
from multiphi_exudyn.study.accuracy.study_findings import (
    choices,
    error_words,
    findings,
    most_accurate,
    shown_points,
)
from multiphi_exudyn.study.accuracy.study_result import Setting, StudyResult
from multiphi_exudyn.study.accuracy.study_zoom import error_against_time
from multiphi_exudyn.study.comparison.pages import environment_of
from multiphi_exudyn.study.comparison.plots import data_uri
from multiphi_exudyn.study.comparison.wording import percent
from multiphi_exudyn.study.measures import metrics

__all__ = ["render_study"]

TEMPLATE = "study.html.j2"
MOST_FAILURES = 100  # listed on the page; the CSV file has all


@dataclass(frozen=True)
class Picture:
    """A figure as a data URI, with its caption."""

    source: str
    caption: str


@dataclass(frozen=True)
class Point:
    """What is shown for one point of the scene's axes."""

    at: Mapping[str, Any]
    uncertainty: float | None
    pareto: Picture | None
    convergence: Picture | None
    lines: tuple[Series, ...]
    stiff: tuple[StiffError, ...]
    contact: tuple[Setting, ...]


def render_study(result: StudyResult) -> str:
    """The page as HTML."""
    environment = environment_of(__package__ or "")
    environment.filters |= {"words": words, "cell": cell_words}
    shown = [_point(result, at) for at in shown_points(result)]
    failed = [row for row in (*result.rows, *result.timings, *result.budgets) if row.status != "ok"]
    return environment.get_template(TEMPLATE).render(
        result=result,
        study=result.study,
        findings=findings(result),
        shown=shown,
        zoom=[error_against_time(result, point.at, k) for k, point in enumerate(shown) if point.pareto],
        count=len(points(result)),
        choices=choices,
        kinds=[False, True] if any(method.refine for method in result.study.methods) else [False],
        full=full_methods(result),
        error_words=error_words,
        overall=over_all_points(result).to_dict("records") if len(points(result)) > 1 else [],
        response=_response(result),
        along=[(axis, _along(result, axis), tables_along(result, axis)) for axis in _axes(result)],
        indicator=_indicator(result),
        correlations=_correlations(result),
        budget=_budget(result),
        maps=list(_maps(result)),
        failed=failed,
        most_failures=MOST_FAILURES,
        metrics=metrics.METRICS,
    )


def cell_words(value: float | None, quantity: str) -> str:
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


def _point(result: StudyResult, at: Mapping[str, Any]) -> Point:
    drawn = settings_at(result, at)
    lines = [series(drawn, name, axis) for axis in numeric_axes(drawn, of_scene=False) for name in names_of(drawn)]
    return Point(
        at,
        uncertainty(result, at),
        _pareto(result, at, drawn),
        _convergence(result, at),
        tuple(line for line in lines if line is not None),
        tuple(stiff_errors(result, at)),
        tuple(s for s in (*_references(result, at), *most_accurate(result, at)) if s.values.get("first_contact")),
    )


def _pareto(result: StudyResult, at: Mapping[str, Any], drawn: list[Setting]) -> Picture | None:
    if not any(setting.online_s is not None and setting.error is not None for setting in drawn):
        return None
    return _picture(
        study_figures.pareto_figure(result, at),
        "A line joins those settings of a method that none of its other settings beats in both time and error. In the "
        "grey band a model is as good as the reference can tell. Thin lines: the tolerances of the table below. "
        "Colours are the same in all pictures.",
    )


def _convergence(result: StudyResult, at: Mapping[str, Any]) -> Picture | None:
    figure = study_figures.convergence_figure(result, at)
    caption = (
        "In brackets: the other fields, each at its finest. Order: observed between neighbouring values. ×: failed."
    )
    return None if figure is None else _picture(figure, caption)


def _axes(result: StudyResult) -> list[str]:
    return numeric_axes([*references(result), *settings(result)], of_scene=True)


def _along(result: StudyResult, axis: str) -> Picture:
    return _picture(study_figures.along_figure(result, axis), "Every method at its finest setting; gaps: failed.")


def _references(result: StudyResult, at: Mapping[str, Any]) -> list[Setting]:
    return [setting for setting in references(result) if setting.at == at]


def _response(result: StudyResult) -> Picture | None:
    figure = response_figure(result)
    return None if figure is None else _picture(figure, "The reference, at the points of the scene's axes.")


def _indicator(result: StudyResult) -> Picture | None:
    figure = study_figures.indicator_figure(result)
    caption = (
        "Every run that has an indicator, nearby ones included. On the line the prediction is exact. It predicts what "
        "truncation costs, not what a contact law other than the reference's does."
    )
    return None if figure is None else _picture(figure, caption)


def _correlations(result: StudyResult) -> dict[str, tuple[float | None, int, int]]:
    """By method, then of all together: the rank correlation, of how many runs, how many have an indicator."""
    pairs = indicators(result)
    found = {str(name): (*rank_correlation(own), len(own)) for name, own in pairs.groupby("method", sort=False)}
    return found | ({"all": (*rank_correlation(pairs), len(pairs))} if len(found) > 1 else {})


def _budget(result: StudyResult) -> Picture | None:
    values = [row.values for row in result.budgets if row.values]
    caption = (
        "Bars: size of each part, whiskers its uncertainty, numbers its share of the whole difference in %. "
        "Pale: no larger than its uncertainty. Dashed line: the whole difference between full and reduced."
    )
    return _picture(budget_figure(values), caption) if values else None


def _maps(result: StudyResult) -> Iterable[Picture]:
    for label, pairs in itertools.groupby(sorted(result.maps, key=lambda pair: pair.label), lambda pair: pair.label):
        yield _picture(
            map_figure(list(pairs)),
            f"The reference and {label}. Dashed: natural frequencies of the levels [Hz]. Hatched: the ends of the "
            "record show. Grey bars on top: in contact.",
        )


def _picture(figure: Figure, caption: str) -> Picture:
    return Picture(data_uri(figure), caption)
