"""A study from beginning to end: references, error pass, error budgets, timing pass, maps, turns.

The error pass runs wherever the executor has workers. At the first point of the scene's axes every setting itself, not
its nearby ones, is run once more, nudged, for its sensitivity horizon: one number per model is enough, and the other
points cost what they did. Warnings are kept with every run. Rigid levels are measured against stiff stops as well. The
timing pass is another one: each setting again, one at a time, in this process, with nothing else of the study running,
a first run and its repeats. Settings whose times are near the cheapest are then timed in turns, since a machine's
speed may change between one setting and the next. Every run is kept in the store as it ends, so a study that was
stopped goes on where it was; maps are made anew with every report.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.study.accuracy.analysis import most_accurate, near_cheapest
from multiphi_exudyn.study.accuracy.budget import budget
from multiphi_exudyn.study.accuracy.cases import CASE, TURNS, Parameters, Study
from multiphi_exudyn.study.accuracy.study_result import MapPair, StudyResult, setting_key
from multiphi_exudyn.study.measures.measures import measures
from multiphi_exudyn.study.measures.spectra import FEWEST, FREQUENCIES, wavelet_map
from multiphi_exudyn.study.measures.stiff_stops import StiffStops, rigid_models, stiff_stops
from multiphi_exudyn.study.running.environment import environment, load_average
from multiphi_exudyn.study.running.runners import ready_model, run_model
from multiphi_exudyn.study.running.runs import ModelRun, from_arrays, to_arrays
from multiphi_exudyn.study.running.timing import TURNS_BUDGET_S, in_turns
from multiphi_exudyn.study.scene import mechanics_of
from multiphi_exudyn.study.setup import Setup, prepare
from multiphi_exudyn.study.store import Row, Store
from multiphi_exudyn.study.sweep import Function, Outcome, sweep
from multiphi_exudyn.time.model_warnings import kept_back

__all__ = ["BudgetRun", "MeasuredRun", "TimedRun", "TimedTurns", "run_study"]

ERRORS, TIMING, BUDGETS = "error", "timing", "budget"  # names of the passes in the store, as TURNS


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
        values = measures(setup, run, self.reference) | {"indicator": indicator}
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
        """Times [s], and the machine's load average of the last minute when they were taken."""
        setup = _bench(self.study, parameters)
        run = run_model(setup, self.study.model_name(parameters), progress=False)
        values = {
            "first_s": run.first_s,
            "repeats_s": list(run.repeats_s),
            "online_s": run.online_s,
            "offline_s": run.offline_s,
            "sampling_s": run.sampling_s,
            "load_average": load_average(),
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


@dataclass(frozen=True)
class BudgetRun:
    """A case of the error budgets."""

    study: Study

    def __call__(self, parameters: Mapping[str, Any]) -> Outcome:
        """The budget's values; failed, with the cause, where a rung is missing."""
        setup = _bench(self.study, parameters)
        values = budget(setup, parameters["setting"]["modes"], progress=False).values()
        causes = [f"{name}: {rung['message']}" for name, rung in values["rungs"].items() if rung["status"] != "ok"]
        return Outcome(values, {}, "failed" if causes else "ok", "; ".join(causes))


def run_study(study: Study, store: Store, executor: Executor | None = None, progress: bool = True) -> StudyResult:
    """Run what the store does not have yet, and give all of it."""

    def passed(function: Function, cases: Sequence[Parameters], name: str, **how: Any) -> tuple[Row, ...]:
        return sweep(function, cases, store, name, budget_s=study.file.time_limit_s, progress=progress, **how)

    references = [study.reference(at) for at in study.points if study.file.methods]
    rows = list(passed(MeasuredRun(study, None), references, ERRORS, executor=executor, keep_histories=True))
    for case in references:
        reference = _stored(store, case)
        if reference is not None:  # without one nothing can be measured there
            cases, kept = study.runs(case["at"]), study.file.histories
            measured = MeasuredRun(study, reference, _stiff(study, cases, store))
            rows += passed(measured, cases, ERRORS, executor=executor, keep_histories=kept)
    budgets = passed(BudgetRun(study), study.budgets(), BUDGETS, executor=executor)
    timings = passed(TimedRun(study), _timed(study, rows), TIMING) if study.file.timing else ()
    result = _result(study, tuple(rows), timings, budgets, store)
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


def _result(
    study: Study, rows: tuple[Row, ...], timings: tuple[Row, ...], budgets: tuple[Row, ...], store: Store
) -> StudyResult:
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
        budgets=budgets,
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
            yield from _pairs(study, (name, setting), full)


def _pairs(study: Study, chosen: tuple[str, Mapping[str, Any]], full: ModelRun) -> Iterator[MapPair]:
    """A method and its setting beside the reference."""
    case = next(case for case in study.runs(study.points[0]) if (case["method"], case["setting"]) == chosen)
    setup = replace(_bench(study, case), repeats=0)
    run = run_model(setup, CASE, progress=False)
    frequencies = FREQUENCIES[FREQUENCIES * FEWEST * setup.scene.file.outputs.interval <= 1]
    for point in setup.points if run.ok and len(frequencies) else ():
        yield MapPair(
            point=point,
            label=run.label,
            full=wavelet_map(full.points[point], full.time, frequencies),
            reduced=wavelet_map(run.points[point], run.time, frequencies),
            full_contacts=_in_contact(full),
            reduced_contacts=_in_contact(run),
            frequencies=_level_frequencies(setup),
        )


def _in_contact(run: ModelRun) -> list[list[float]]:
    return sorted(interval for given in run.contact_intervals.values() for interval in given.tolist())


def _level_frequencies(setup: Setup) -> dict[str, list[float]]:
    """Natural frequencies [Hz] of the case's levels, within the map: the open one, each contact closed alone."""
    lowest, highest = FREQUENCIES[0], FREQUENCIES[-1]
    contacts = setup.contacts(setup.scene.models[CASE].rigid)
    model = MultiPhiModel(setup.structure, contacts, modes="all", overrides=setup.overrides)
    levels = {"open": model.level(())} | {f"{c.name} closed": model.level((c.name,)) for c in model.contacts}
    return {name: [float(f) for f in level.frequencies if lowest <= f <= highest] for name, level in levels.items()}
