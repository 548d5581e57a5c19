"""The report of a study: its sentences, its pictures, its page; and its results as CSV."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from multiphi_exudyn.study import measures
from multiphi_exudyn.study.accuracy import (
    FINER,
    NEAR,
    Series,
    StudyResult,
    cheapest,
    front,
    full_methods,
    longest,
    most_accurate,
    named,
    numeric_axes,
    over_all_points,
    points,
    pointwise_until,
    references_at,
    series,
    settings,
    settings_at,
    stiff_errors,
    tables_along,
    uncertainty,
    words,
)
from multiphi_exudyn.study.plots import (
    COLOURS,
    FULL,
    LINE,
    STYLE,
    WIDTH,
    Style,
    legend_below,
    map_figure,
    panels,
    percent_axis,
    seconds_axis,
    uncertainty_band,
)
from multiphi_exudyn.study.plots import REFERENCE as BLACK
from multiphi_exudyn.study.report import MAPS, Picture, environment_of, run_warnings, sentences
from multiphi_exudyn.study.study_file import COARSER, REFERENCE
from multiphi_exudyn.study.wording import percent, seconds

__all__ = [
    "along_figure",
    "convergence_figure",
    "error_text",
    "findings",
    "pareto_figure",
    "records",
    "render_study",
    "response_figure",
    "shown_points",
    "study_warnings",
    "styles",
]


MOST_POINTS = 6  # of the scene's axes shown in pictures and tables


def findings(result: StudyResult) -> dict[str, tuple[str, ...]]:
    """Sentences by section: compared, outcome, distrust, timing."""
    return sentences(
        "study_findings.txt.j2",
        ("compared", "outcome", "distrust", "timing"),
        result=result,
        study=result.study,
        settings=settings(result),
        names=list(settings(result).method.unique()),
        places=points(result),
        full=full_methods(result),
        label=next((row.values.get("label") for row in result.rows if row.parameters["method"] == REFERENCE), None),
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
    rows = [row for row in result.rows if row.status == "ok"]
    several = len(points(result)) > 1
    runs = [(_run_text(row.parameters, several), row.values.get("warnings", [])) for row in rows]
    own = settings(result)
    horizons = [
        (named(method, setting), found.get("horizon_s", {}))
        for method, setting, found in zip(own.method, own.setting, own.measures, strict=True)
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
    return {
        "hosts": len({row.environment.get("host") for row in (*result.timings, *result.turns)}),
        "rounds": timed.repeats_s[timed.in_turns].map(len).tolist(),
        "near": NEAR,
        "counts": [len(row.values["repeats_s"]) for row in result.timings if row.status == "ok"],
    }


MARKERS = ("o", "D", "^", "v", "<", ">", "p", "h", "*")  # one more than colours: no two methods look alike
FULL_COLOURS, FULL_MARKERS = (BLACK, FULL, "#4D4D4D"), ("s", "d", "X")
MOST_ORDERS = 5  # written one by one
MOST_TICKS = 10
WIDE = 10.0  # ratio of largest to smallest value from which an axis is logarithmic
BRIGHTEST = 0.85  # of the colour map: yellow is hard to see on white
MOST_COLUMNS, MOST_ROWS = 4, 4  # panels of the response
QUANTITIES = {  # label and scale of what is drawn of points and contacts
    "largest": ("largest displacement\n{} [mm]", 1e3),
    "inner_losses": ("losses of contact\nin the first phase\n{}", 1.0),
    "largest_force": ("largest force\n{} [N]", 1.0),
}
LABEL_LENGTH = 42  # characters of a legend's line


def styles(result: StudyResult) -> dict[str, Style]:
    """One style per method, then those of the reference and its coarser copy."""
    neutral = zip(itertools.cycle(FULL_COLOURS), itertools.cycle(FULL_MARKERS), strict=False)
    coloured = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=False)
    full = full_methods(result)
    own = {name: Style(*next(neutral if name in full else coloured)) for name in settings(result).method.unique()}
    return own | {REFERENCE: Style(BLACK, "None", "--"), COARSER: Style(FULL, "None", ":")}


@rc_context(STYLE)
def pareto_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure:
    """Error against online time: every setting faint, each method's front strong, failures on the upper edge."""
    figure, (axes,) = panels([6.2])
    drawn = settings_at(result, at)
    axes.set(xscale="log", yscale="log", xlabel="online time of one run", ylabel=_error_label(result))
    for name, style in styles(result).items():
        own = drawn[(drawn.method == name) & drawn.online_s.notna()]
        if len(own):
            best = front(own)
            axes.plot(own.online_s, 100 * own.error, style.marker, color=style.colour, ms=5, mew=0, alpha=0.28)
            axes.plot(best.online_s, 100 * best.error, **style.marks | style.lines | {"ms": 8, "lw": 2}, label=name)
            _crosses(axes, own.online_s[own.error.isna()], style)
    _tolerances(axes, result, at, drawn)
    for time in _reference(references_at(result, at)).online_s.dropna():
        axes.axvline(time, color=BLACK, ls="--", lw=1, label="the reference itself")
    axes.margins(x=0.08)
    seconds_axis(axes.xaxis)
    percent_axis(axes.yaxis)
    failed = drawn[drawn.error.isna()]
    count = f"; × failed: {len(failed)}" if len(failed) else ""
    untimed = failed.online_s.isna().sum()
    hidden = f", {untimed} of them not shown: without a time" if untimed else ""
    axes.set_title(f"Lower left is better. Faint: every setting{count}{hidden}", pad=12)
    legend_below(figure, [axes])
    return figure


@rc_context(STYLE)
def convergence_figure(result: StudyResult, at: Mapping[str, Any]) -> Figure | None:
    """Error along each field of the methods' settings, the others at their finest, with observed orders."""
    drawn = settings_at(result, at)
    lines = {
        axis: [line for name in drawn.method.unique() if (line := series(drawn, name, axis))]
        for axis in numeric_axes(drawn, "setting")
    }
    if not lines:
        return None
    figure, all_axes = panels([max(3.5, 0.4 * len(each) + 0.5) for each in lines.values()])
    for axes, (axis, each) in zip(all_axes, lines.items(), strict=True):
        for line in each:
            style, table = styles(result)[line.method], line.table
            axes.plot(table.value, 100 * table.error, **style.marks | style.lines, label=_series_label(line))
            _crosses(axes, table.value[table.error.isna()], style)
        axes.set(yscale="log", ylabel=_error_label(result))
        percent_axis(axes.yaxis)
        _value_axis(axes, axis, pd.concat([line.table.value for line in each]))
        axes.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        uncertainty_band(axes, uncertainty(result, at))
    return figure


@rc_context(STYLE)
def along_figure(result: StudyResult, axis: str) -> Figure:
    """Error, largest displacements and forces, and losses of contact, along one of the scene's axes."""
    tables = tables_along(result, axis)
    drawn = [quantity for quantity in tables if quantity.partition(".")[0] in QUANTITIES]
    figure, all_axes = panels([3.2] * (1 + len(drawn)), sharex=True)
    for axes, quantity in zip(all_axes, ["error", *drawn], strict=True):
        table, (kind, _, name) = tables[quantity], quantity.partition(".")
        label, scale = QUANTITIES.get(kind, (_error_label(result), 100.0))
        for method, style in styles(result).items():
            if method in table.index:
                axes.plot(table.columns, scale * table.loc[method], **style.marks | style.lines, label=method)
        axes.set_ylabel(label.format(name))
        if quantity == "error":
            axes.set_yscale("log")
            percent_axis(axes.yaxis)
        else:
            axes.yaxis.set_major_locator(MaxNLocator(integer=kind == "inner_losses"))
    _value_axis(all_axes[-1], axis, tables["error"].columns.astype(float))
    legend_below(figure, all_axes)
    return figure


@rc_context(STYLE)
def response_figure(result: StudyResult) -> Figure | None:
    """Largest displacements and forces of the reference along two or three axes; None for fewer, or without any.

    The first axis is drawn along, lines are values of the second, columns of the third; others at their first value.
    """
    runs = _reference(result.table)
    axes = numeric_axes(runs, "at")
    measures = pd.json_normalize(runs.measures.tolist(), max_level=1)
    known = [f"largest.{point}" for point in result.judged_points]
    known += [name for name in map(str, measures) if name.startswith("largest_force.")]
    rows = [name for name in known if name in measures][:MOST_ROWS]
    if len(axes) < 2 or not rows:
        return None
    frame = measures[rows].join(pd.DataFrame(runs["at"].tolist()))
    for axis in axes[3:]:
        frame = frame[frame[axis] == frame[axis].iloc[0]]
    parts: list[tuple[Any, pd.DataFrame]] = [(None, frame)]
    if len(axes) > 2:
        parts = list(frame.groupby(axes[2]))[:MOST_COLUMNS]
    figure = Figure(figsize=(WIDTH, 2.3 * len(rows) + 0.9))
    grid = figure.subplots(len(rows), len(parts), squeeze=False, sharex=True, sharey="row")
    for panels_of_row, row in zip(grid, rows, strict=True):
        quantity, _, name = row.partition(".")
        label, scale = QUANTITIES[quantity]
        for axes_of_part, (value, part) in zip(panels_of_row, parts, strict=True):
            _family(axes_of_part, scale * part.pivot_table(row, axes[0], axes[1], dropna=False).astype(float))
            _value_axis(axes_of_part, axes[0], part[axes[0]])
            axes_of_part.set_title("" if value is None or row != rows[0] else f"{axes[2]} = {value:g}")
            axes_of_part.set_ylabel(label.format(name), fontsize=9)
            axes_of_part.label_outer()
    legend_below(figure, [grid[0, 0]], columns=6, title=axes[1])
    return figure


def _error_label(result: StudyResult) -> str:
    return f"NRMSE to {result.window:g} s\nworst of {', '.join(result.judged_points)}"


def _reference(table: pd.DataFrame) -> pd.DataFrame:
    return table[table.method == REFERENCE]


def _crosses(axes: Axes, places: pd.Series, style: Style) -> None:
    """Crosses on the upper edge."""
    if len(places):
        edge: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(places, np.ones(len(places)), "x", color=style.colour, ms=7, mew=1.8, zorder=6, **edge)


def _tolerances(axes: Axes, result: StudyResult, at: Mapping[str, Any], drawn: pd.DataFrame) -> None:
    """Room for all errors and the reference's own uncertainty, and a line for each tolerance between them."""
    own = uncertainty(result, at)
    known = 100 * drawn.error[(drawn.error > 0) & (drawn.online_s > 0)]
    if own:
        known = pd.concat([known, pd.Series([100 * own])])
    if len(known):
        axes.set_ylim(known.min() / 2.5, known.max() * 2)
    uncertainty_band(axes, own)
    lowest, highest = axes.get_ylim()
    for height in [100 * tolerance for tolerance in result.study.tolerances if lowest < 100 * tolerance < highest]:
        axes.axhline(height, color=LINE, lw=0.8, zorder=1)
        axes.text(1.0, height, f" {height:g} %", transform=axes.get_yaxis_transform(), va="center", fontsize=9)


def _value_axis(axes: Axes, axis: str, values: Iterable[float]) -> None:
    """The values themselves as ticks; logarithmic where they are far apart."""
    ticks = sorted({float(value) for value in values})
    if ticks[0] > 0 and (axis in FINER or ticks[-1] / ticks[0] >= WIDE):
        axes.set_xscale("log")
    shown = ticks[:: -(-len(ticks) // MOST_TICKS)]
    axes.set_xticks(shown, [seconds(tick) if axis == "step" else f"{tick:g}" for tick in shown])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("modes r" if axis == "modes" else axis)


def _family(axes: Axes, table: pd.DataFrame) -> None:
    """A line for each column, dark to bright."""
    for shade, value in zip(colormaps["viridis"](np.linspace(0, BRIGHTEST, table.shape[1])), table, strict=True):
        axes.plot(table.index, table[value], color=shade, marker="o", ms=4, label=f"{value:g}")


def _series_label(line: Series) -> str:
    """Method, its other fields, and the observed orders below them."""
    fixed = f" ({words(line.fixed)})" if line.fixed else ""
    orders = line.table.order.dropna()
    told = f"order {', '.join(f'{order:.1f}' for order in orders)}" if len(orders) else ""
    if len(orders) > MOST_ORDERS:
        told = f"order {orders.min():.1f} to {orders.max():.1f}, median {orders.median():.1f}"
    return "\n".join(textwrap.fill(each, LABEL_LENGTH) for each in (f"{line.method}{fixed}", told) if each)


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


def render_study(result: StudyResult) -> str:
    """The page as HTML."""
    environment = environment_of()
    environment.filters |= {"words": words, "cell": cell_text}
    shown = [_point(result, at) for at in shown_points(result)]
    timed = [point for point in shown if point["pareto"]]
    return environment.get_template("study.html.j2").render(
        name=result.name,
        title=result.study.title,
        findings=findings(result),
        definitions=measures.METRICS.values(),
        assumptions=result.assumptions,
        environment=result.environment,
        result=result,
        study=result.study,
        shown=shown,
        timed=timed,
        count=len(points(result)),
        kinds=[False, True] if any(method.refine for method in result.study.methods) else [False],
        cheapest=lambda *options: records(cheapest(result, *options)),
        full=full_methods(result),
        error_text=error_text,
        overall=_overall(result) if len(points(result)) > 1 else None,
        response=_drawn(response_figure(result), RESPONSE),
        along=[_along(result, axis) for axis in numeric_axes(result.table, "at")],
        maps=list(_maps(result)),
        failed=[row for row in (*result.rows, *result.timings, *result.turns) if row.status != "ok"],
        most_failures=MOST_FAILURES,
        metrics=measures.METRICS,
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
    return {
        "at": at,
        "uncertainty": uncertainty(result, at),
        "pareto": Picture.of(pareto_figure(result, at), PARETO) if len(known) else None,
        "convergence": _drawn(convergence_figure(result, at), CONVERGENCE),
        "stiff": records(stiff_errors(result, at)),
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
        label = measures.METRICS[quantity].label if quantity in measures.METRICS else "error"
        texts = table.map(cell_text, quantity=quantity).rename(columns="{:g}".format)
        tables.append(texts.rename_axis(index=None, columns=", ".join(filter(None, (label, name)))))
    return axis, Picture.of(along_figure(result, axis), ALONG), tables


def _maps(result: StudyResult) -> Iterator[Picture]:
    for label, pairs in itertools.groupby(sorted(result.maps, key=lambda pair: pair.label), lambda pair: pair.label):
        yield Picture.of(map_figure(list(pairs)), MAPS.format(label))
