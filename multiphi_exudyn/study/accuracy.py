"""A study from beginning to end, and what its rows say: a line for each setting, fronts, the cheapest settings.

The error pass runs wherever the executor has workers. At the first point of the scene's axes every setting itself, not
its nearby ones, is run once more, nudged, for its sensitivity horizon: one number per model is enough, and the other
points cost what they did. Warnings are kept with every run. Rigid levels are measured against stiff stops as well. The
timing pass is another one: each setting again, one at a time, in this process, with nothing else of the study running,
a first run and its repeats. Settings whose times are near the cheapest are then timed in turns, since a machine's
speed may change between one setting and the next. Every run is kept in the store as it ends, so a study that was
stopped goes on where it was; maps are made anew with every report.

The error of a setting is the worst, over its nearby runs, of the largest NRMSE of the judged points from 0 to the
study's window. Where one of these runs has no error the setting has none either: a gap with a cause, never a smaller
number. Everything is computed from the rows alone. With mesh size, step or tolerance h (h = 1 / value for modes and
elements) the observed order is

    p = log(e1 / e2) / log(h1 / h2)        between consecutive values

and along a scene's axis, where h is the value itself, p says error ~ value**p. Times in s.
"""

from __future__ import annotations

import contextlib
import functools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.study.details import MapPair, map_pairs
from multiphi_exudyn.study.measures import (
    StiffStops,
    measures_of,
    rigid_models,
    stiff_stops,
)
from multiphi_exudyn.study.runners import ready_model, run_model
from multiphi_exudyn.study.runs import (
    FEWEST_ROUNDS,
    REPEAT_BUDGET_S,
    TURNS_BUDGET_S,
    ModelRun,
    environment,
    from_arrays,
    in_turns,
    modes_text,
    to_arrays,
    undisturbed,
)
from multiphi_exudyn.study.scene import mechanics_of
from multiphi_exudyn.study.setup import Setup, prepare
from multiphi_exudyn.study.store import Row, Store, key_of
from multiphi_exudyn.study.study_file import CASE, COARSER, REFERENCE, TURNS, Parameters, Study, StudyFile, is_number
from multiphi_exudyn.study.sweep import Function, Outcome, sweep
from multiphi_exudyn.study.wording import seconds
from multiphi_exudyn.time.model_warnings import kept_back

__all__ = [
    "FINER",
    "MeasuredRun",
    "Series",
    "StudyResult",
    "TimedRun",
    "TimedTurns",
    "all_numbers",
    "cheapest",
    "csv_text",
    "error_of",
    "front",
    "full_methods",
    "longest",
    "most_accurate",
    "named",
    "near_cheapest",
    "numeric_axes",
    "over_all_points",
    "points",
    "pointwise_until",
    "references_at",
    "run_study",
    "series",
    "setting_key",
    "settings",
    "settings_at",
    "settings_at_worst",
    "stiff_errors",
    "tables_along",
    "uncertainty",
    "words",
    "worst_judged",
]


COUNTS = ("modes", "elements")  # fields of which more are finer; of others less are
TIMES = ["online_s", "first_s", "offline_s", "repeats_s"]


@dataclass(frozen=True)
class StudyResult:
    """A study with all its rows: of the error pass, of the timing pass, of settings in turns."""

    study: StudyFile
    name: str
    judged_points: tuple[str, ...]
    window: float
    rows: tuple[Row, ...]
    timings: tuple[Row, ...]
    turns: tuple[Row, ...]
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
    """One line for each run: its error pass and its timing; ``multiphi_exudyn.study.load`` says which."""
    lines: dict[str, dict[str, Any]] = {}
    for row in result.rows:
        lines[key_of(row.parameters)] = {**row.parameters, **_of_run(row), "error": error_of(result, row)}
    for name, rows in (("timing", result.timings),):
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


ROUND_OFF = 1e-9  # NRMSE below which two answers differ by round-off only
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


FINER = {"modes": 1, "elements": 1, "step": -1, "rtol": -1, "tolerance": -1, "newton_tolerance": -1}  # if larger
QUANTITIES = ("largest", "first_contact", "inner_losses", "largest_force", "impulse")  # of a point or a contact


@dataclass(frozen=True)
class Series:
    """A method's settings along one numeric axis, all other fields fixed, those of the scene not counted.

    table: a line for each setting, with its value on the axis, ascending, and the order [-] since the line before.
    """

    method: str
    axis: str
    fixed: Mapping[str, Any]
    table: pd.DataFrame


def numeric_axes(table: pd.DataFrame, kind: str) -> list[str]:
    """Fields, of the scene (kind "at") or of the methods ("setting"), that take two or more numeric values."""
    values = pd.DataFrame(table[kind].tolist()).map(lambda value: value if is_number(value) else None)
    return [str(field) for field, count in values.nunique().items() if count > 1]


def series(table: pd.DataFrame, method: str, axis: str) -> Series | None:
    """The method along one axis, every other field at its finest value (those without one: at their first).

    Fields that leave fewer than two errors are passed over where others have them. None without two numeric values.
    """
    own = table[table.method == method]
    fields = pd.Series([{**at, **setting} for at, setting in zip(own["at"], own.setting, strict=True)], own.index)
    rest = fields.map(lambda each: {field: value for field, value in each.items() if field != axis})
    lines = own.assign(value=fields.map(lambda each: each.get(axis)), rest=rest)
    lines = lines[lines.value.map(is_number)]
    groups = [group for _, group in lines.groupby(lines.rest.map(key_of), sort=False) if len(group) > 1]
    if not groups:
        return None
    best = max(groups, key=lambda group: (group.error.count() > 1, _fineness(group.rest.iloc[0])))
    fixed = {field: value for field, value in best.setting.iloc[0].items() if field != axis}
    best = best.astype({"value": float}).sort_values("value")
    return Series(method, axis, fixed, best.assign(order=_orders(axis, best.value, best.error)))


def tables_along(result: StudyResult, axis: str) -> dict[str, pd.DataFrame]:
    """Quantity -> a row for each method, a column for each value along a scene's axis.

    First "error", then what each point and contact does, as "largest.tip".
    """
    methods = list(result.table.method.unique())
    lines = [line.table for name in methods if (line := series(result.table, name, axis))]
    whole = pd.concat(lines, ignore_index=True)
    measures = pd.json_normalize([{name: each.get(name, {}) for name in QUANTITIES} for each in whole.measures])
    cells = whole[["method", "value", "error"]].join(measures)
    tables = {}
    for quantity in ["error", *map(str, measures)]:
        table = cells.pivot(index="method", columns="value", values=quantity).astype(float)
        judged = [name for name in methods if name in table.index and (quantity, name) != ("error", REFERENCE)]
        tables[quantity] = table.loc[judged]
    return tables


def _fineness(fields: Mapping[str, Any]) -> tuple[float, ...]:
    """Larger is finer, field by field; "all" modes are finest, fields without a fine end do not count."""
    known = {name: value for name, value in fields.items() if name in FINER}
    return tuple(FINER[name] * value if is_number(value) else math.inf for name, value in known.items())


def _orders(axis: str, values: pd.Series, errors: pd.Series) -> pd.Series:
    """Observed order since the value before; NaN where an error is missing or zero, or the value changes its sign."""
    positive = (errors * errors.shift() > 0) & (values * values.shift() > 0)
    finer = (errors / errors.shift()).where(positive), (values / values.shift()).where(positive)
    return finer[0].map(math.log) / finer[1].map(math.log) * (-1 if FINER.get(axis) == 1 else 1)


ERRORS, TIMING = "error", "timing"  # names of the passes in the store, as TURNS


@dataclass(frozen=True)
class MeasuredRun:
    """A case of the error pass: one run, measured against the reference at its point of the axes.

    stiff: what rigid levels are measured against too.
    """

    study: Study
    reference: ModelRun | None
    stiff: StiffStops | None = None

    def __call__(self, parameters: Mapping[str, Any]) -> Outcome:
        """The run's measures, and the run itself as arrays."""
        setup = replace(_bench(self.study, parameters), repeats=0)
        nudged = parameters["at"] == self.study.points[0] and not parameters["nearby"]
        run = run_model(setup, self.study.model_name(parameters), progress=False, horizon=nudged)
        indicator = run.indicators.get(f"{_window(self.study, setup):g}")
        values = measures_of(setup, run, self.reference) | {"indicator": indicator}
        values |= self._against_stiff(setup, run)
        return Outcome(values, to_arrays(run), run.status, run.message)

    def _against_stiff(self, setup: Setup, run: ModelRun) -> dict[str, Any]:
        if self.stiff is None or run.name not in rigid_models(setup):
            return {}
        found = self.stiff.values(setup, {run.name: run})
        return {"stiff_stops": found | {"errors": found["errors"].get(run.name, {})}}


@dataclass(frozen=True)
class TimedRun:
    """A case of the timing pass: a first run and its repeats."""

    study: Study

    def __call__(self, parameters: Mapping[str, Any]) -> Outcome:
        """Times [s]."""
        setup = _bench(self.study, parameters)
        run = run_model(setup, self.study.model_name(parameters), progress=False)
        values = {
            "first_s": run.first_s,
            "repeats_s": list(run.repeats_s),
            "online_s": run.online_s,
            "offline_s": run.offline_s,
            "sampling_s": run.sampling_s,
        }
        return Outcome(values, {}, run.status, run.message)


@dataclass(frozen=True)
class TimedTurns:
    """A case of the turns: several settings, each prepared and run once, then timed in turns."""

    study: Study

    def __call__(self, parameters: Mapping[str, Any]) -> Outcome:
        """Times [s] of every one of the cases, in their order."""
        with kept_back():
            runs = [ready_model(_bench(self.study, case), self.study.model_name(case)) for case in parameters["cases"]]
            times = in_turns(runs, TURNS_BUDGET_S / len(self.study.points))
            return Outcome({"repeats_s": [list(each) for each in times]})


def run_study(study: Study, store: Store, executor: Executor | None = None, progress: bool = True) -> StudyResult:
    """Run what the store does not have yet, and give all of it."""

    def passed(function: Function, cases: Sequence[Parameters], name: str, **how: Any) -> tuple[Row, ...]:
        return sweep(function, cases, store, name, budget_s=study.file.time_limit_s, progress=progress, **how)

    references = [study.reference(at) for at in study.points]
    rows = list(passed(MeasuredRun(study, None), references, ERRORS, executor=executor, keep_histories=True))
    for case in references:
        reference = _stored(store, case)
        if reference is not None:  # without one nothing can be measured there
            cases, kept = study.runs(case["at"]), study.file.histories
            measured = MeasuredRun(study, reference, _stiff(study, cases, store))
            rows += passed(measured, cases, ERRORS, executor=executor, keep_histories=kept)
    timings = passed(TimedRun(study), _timed(study, rows), TIMING) if study.file.timing else ()
    result = _result(study, tuple(rows), timings, store)
    turns = sweep(TimedTurns(study), list(_turns(study, result)), store, TURNS, progress=progress)
    return replace(result, turns=turns)


def _turns(study: Study, result: StudyResult) -> Iterator[Parameters]:
    """At every point of the axes the case of settings to be timed in turns, where there are several."""
    timed = {setting_key(row.parameters): dict(row.parameters) for row in result.timings}
    for at in study.points:
        cases = [timed[key] for key in near_cheapest(result, at).index.unique()]
        if len(cases) > 1:
            yield study.turns(at, cases)


def _stored(store: Store, case: Parameters) -> ModelRun | None:
    """A run that is ok, from its arrays."""
    row, arrays = store.find(ERRORS, case), store.histories(ERRORS, case)
    return from_arrays(arrays) if row is not None and row.status == "ok" and arrays is not None else None


def _stiff(study: Study, cases: Sequence[Parameters], store: Store) -> StiffStops | None:
    """What rigid levels at one point of the axes are measured against too; None where no case with any is left.

    A method that its scene refuses there has no levels; its runs say why.
    """
    pending = {case["method"]: case for case in cases if store.find(ERRORS, case) is None}
    for case in pending.values():
        with contextlib.suppress(MultiPhiValueError):
            stiff = stiff_stops(_bench(study, case))
            if stiff is not None:
                return stiff
    return None


def _bench(study: Study, parameters: Mapping[str, Any]) -> Setup:
    scene = study.scene_for(parameters)
    return prepare(scene)


def _window(study: Study, setup: Setup) -> float:
    """End [s] of the window whose errors are ranked."""
    return min(study.file.window or setup.t_end, setup.t_end)


def _timed(study: Study, rows: Sequence[Row]) -> list[Parameters]:
    """Cases worth a time: the settings themselves that ran, not their neighbours."""
    return [dict(row.parameters) for row in rows if row.status == "ok" and not row.parameters["nearby"]]


def _result(study: Study, rows: tuple[Row, ...], timings: tuple[Row, ...], store: Store) -> StudyResult:
    first = study.reference(study.points[0])
    setup = _bench(study, first)
    result = StudyResult(
        study=study.file,
        name=study.name,
        judged_points=setup.judged_points,
        window=_window(study, setup),
        rows=rows,
        timings=timings,
        turns=(),
        maps=(),
        environment=environment(),
        assumptions=_assumptions(study),
        quick=study.quick,
    )
    reference = _stored(store, first)
    return result if reference is None else replace(result, maps=tuple(_maps(study, result, reference)))


def _assumptions(study: Study) -> tuple[str, ...]:
    """What the scenes rest on, at all points of the axes."""
    scenes = [study.scene_for(study.reference(at)) for at in study.points]
    return tuple(dict.fromkeys(sentence for scene in scenes for sentence in mechanics_of(scene).assumptions))


def _maps(study: Study, result: StudyResult, full: ModelRun) -> Iterator[MapPair]:
    """Of the methods asked for, at the first point of the axes: the most accurate setting beside the reference."""
    best = most_accurate(result, study.points[0])
    for name in study.file.maps:
        for setting in best.setting[best.method == name]:
            case = next(c for c in study.runs(study.points[0]) if (c["method"], c["setting"]) == (name, setting))
            setup = replace(_bench(study, case), repeats=0)
            run = run_model(setup, CASE, progress=False)
            yield from map_pairs(setup, full, run) if run.ok else ()
