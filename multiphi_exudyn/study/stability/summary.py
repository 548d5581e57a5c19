"""What a run of the catalogue came to: counts and worst figures, as data for the page, the terminal and the JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import pandas as pd

from multiphi_exudyn.study.comparison.pages import sentences
from multiphi_exudyn.study.stability.judgement import BEYOND
from multiphi_exudyn.study.stability.outcome import FAILED, NOT_RUN, OK, CaseResult, Outcome
from multiphi_exudyn.study.stability.run_laws import CLOSES
from multiphi_exudyn.time.warnings.warning_groups import grouped

__all__ = ["contents", "failures", "headline", "summaries", "warned"]

TEMPLATE = "headline.txt.j2"
STATUSES = (OK, FAILED, NOT_RUN)
WORST = ("energy", "residual", "beyond", "difference")  # figures of which the largest one counts
LOCATED = ("energy", "difference")  # of these the case is told


def summaries(results: Sequence[CaseResult]) -> list[dict[str, Any]]:
    """Of every model in all cases: how many runs ended how, the worst figures, and the time [s] of all its runs.

    energy_case, difference_case: the case with the worst one, "" without any. None for what no run has.
    """
    runs = _runs(results)
    answers = runs.assign(**{name: runs[name].where(runs.status == OK) for name in WORST})
    of_model = answers.groupby("model", sort=False)
    counts = pd.crosstab(runs.model, runs.status).reindex(columns=STATUSES, fill_value=0)
    worst = of_model[list(WORST)].max()
    cases = {f"{name}_case": of_model[[name, "case"]].apply(_case_of, name) for name in LOCATED}
    missed, time_s = of_model.missed.sum(min_count=1), of_model.time_s.sum()
    found = worst.join(counts.rename(columns={NOT_RUN: "not_run"}))
    found = found.assign(**cases, wrong=of_model.wrong.sum(), missed=missed, time_s=time_s).reset_index()
    return [{str(name): _known(value) for name, value in row.items()} for row in found.to_dict("records")]


def _runs(results: Sequence[CaseResult]) -> pd.DataFrame:
    """A row for every case and model."""
    rows = [
        {**asdict(outcome), "case": result.name, "wrong": bool(outcome.wrong)}
        for result in results
        for outcome in result.outcomes
    ]
    return pd.DataFrame(rows).astype(dict.fromkeys((*WORST, "missed", "time_s"), float))


def _case_of(runs: pd.DataFrame, name: str) -> str:
    """The case with the largest figure."""
    found = runs.dropna(subset=name).sort_values(name, ascending=False, kind="stable")
    return "" if found.empty else str(found["case"].iloc[0])


def _known(value: Any) -> Any:
    """A figure, None where there is none; whole ones as such."""
    if not isinstance(value, float):
        return value
    return None if pd.isna(value) else int(value) if value.is_integer() else value


def failures(results: Sequence[CaseResult]) -> list[tuple[str, Outcome]]:
    """The runs that failed, each with the name of its case, model by model."""
    models = list(dict.fromkeys(outcome.model for result in results for outcome in result.outcomes))
    failed = [(result.name, o) for result in results for o in result.outcomes if o.status == FAILED]
    return sorted(failed, key=lambda found: models.index(found[1].model))


def warned(results: Sequence[CaseResult]) -> list[str]:
    """What the reduced models warn of, a sentence for each kind."""
    ran = [(f"{result.name}, {o.model}", o.warnings) for result in results for o in result.outcomes if o.status == OK]
    return [group.told(len(ran)) for group in grouped(ran)]


def headline(results: Sequence[CaseResult]) -> str:
    """The outcome in one sentence."""
    (told,) = sentences(__package__ or "", TEMPLATE, ["outcome"], results=results)["outcome"]
    return told


def contents(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> dict[str, Any]:
    """Everything, for a JSON file."""
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
