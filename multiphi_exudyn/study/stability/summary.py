"""Summary of a run of the catalogue: counts and worst values, for the page, the terminal and the JSON file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import pandas as pd

from multiphi_exudyn.study.report import sentences
from multiphi_exudyn.study.stability.judgement import BEYOND
from multiphi_exudyn.study.stability.outcome import FAILED, NOT_RUN, OK, CaseResult, Outcome
from multiphi_exudyn.study.stability.run_laws import CLOSES
from multiphi_exudyn.time.model_warnings import grouped

__all__ = ["contents", "failures", "headline", "summaries", "warned"]

TEMPLATE = "stability_headline.txt.j2"
STATUSES = (OK, FAILED, NOT_RUN)
WORST = ("energy", "residual", "beyond", "difference")  # quantities whose largest value is shown
LOCATED = ("energy", "difference")  # quantities shown with their case


def summaries(results: Sequence[CaseResult]) -> list[dict[str, Any]]:
    """One row for each model: number of runs by status, worst values, and total run time [s].

    energy_case, difference_case: case with the worst value, or "". None for a quantity that no run has.
    """
    runs = _runs(results)
    answers = runs.assign(**{name: runs[name].where(runs.status == OK) for name in WORST})
    of_model = answers.groupby("model", sort=False)
    counts = pd.crosstab(runs.model, runs.status).reindex(columns=STATUSES, fill_value=0)
    worst = of_model[list(WORST)].max()
    cases = {f"{name}_case": of_model[[name, "case"]].apply(_case_of, name) for name in LOCATED}
    missed, time_s = of_model.missed.sum(min_count=1), of_model.time_s.sum()
    table = worst.join(counts.rename(columns={NOT_RUN: "not_run"}))
    table = table.assign(**cases, wrong=of_model.wrong.sum(), missed=missed, time_s=time_s).reset_index()
    return [{str(name): _json_value(value) for name, value in row.items()} for row in table.to_dict("records")]


def _runs(results: Sequence[CaseResult]) -> pd.DataFrame:
    """Table with a row for each case and model."""
    rows = [
        {**asdict(outcome), "case": result.name, "wrong": bool(outcome.wrong)}
        for result in results
        for outcome in result.outcomes
    ]
    return pd.DataFrame(rows).astype(dict.fromkeys((*WORST, "missed", "time_s"), float))


def _case_of(runs: pd.DataFrame, name: str) -> str:
    """Name of the case with the largest value of a quantity."""
    ranked = runs.dropna(subset=name).sort_values(name, ascending=False, kind="stable")
    return "" if ranked.empty else str(ranked["case"].iloc[0])


def _json_value(value: Any) -> Any:
    """A number as JSON has it: None for NaN, an int for a whole number."""
    if not isinstance(value, float):
        return value
    return None if pd.isna(value) else int(value) if value.is_integer() else value


def failures(results: Sequence[CaseResult]) -> list[tuple[str, Outcome]]:
    """Failed runs with the name of their case, sorted by model."""
    models = list(dict.fromkeys(outcome.model for result in results for outcome in result.outcomes))
    failed = [(result.name, o) for result in results for o in result.outcomes if o.status == FAILED]
    return sorted(failed, key=lambda failure: models.index(failure[1].model))


def warned(results: Sequence[CaseResult]) -> list[str]:
    """Warnings of the reduced models, a sentence for each kind."""
    ran = [(f"{result.name}, {o.model}", o.warnings) for result in results for o in result.outcomes if o.status == OK]
    return [group.told(len(ran)) for group in grouped(ran)]


def headline(results: Sequence[CaseResult]) -> str:
    """The outcome in one sentence."""
    (sentence,) = sentences(TEMPLATE, ["outcome"], results=results)["outcome"]
    return sentence


def contents(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> dict[str, Any]:
    """Content of the JSON file."""
    return {
        "environment": environment,
        "quick": quick,
        "limits": {"residual": CLOSES, "beyond_m": BEYOND},
        "models": summaries(results),
        "cases": {
            result.name: {
                "hard": result.hard,
                "wrong": result.wrong,
                "models": {outcome.model: asdict(outcome) for outcome in result.outcomes},
            }
            for result in results
        },
    }
