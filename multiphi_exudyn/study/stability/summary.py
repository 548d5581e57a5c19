"""What a run of the catalogue came to: counts and worst figures, as data for the page, the terminal and the JSON."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from multiphi_exudyn.study.stability.judgement import BEYOND
from multiphi_exudyn.study.stability.outcome import FAILED, NOT_RUN, OK, CaseResult, Outcome
from multiphi_exudyn.study.stability.run_laws import CLOSES
from multiphi_exudyn.time.warning_groups import grouped

__all__ = ["ModelSummary", "contents", "failures", "headline", "summaries", "warned"]


@dataclass(frozen=True)
class ModelSummary:
    """Of one model in all cases: how many ended how, its worst figures, and the time of all its runs [s].

    energy_case, difference_case: the case that is the worst one, "" without any.
    """

    model: str
    ok: int
    failed: int
    not_run: int
    wrong: int
    energy: float | None
    residual: float | None
    beyond: float | None
    missed: int | None
    difference: float | None
    time_s: float
    energy_case: str
    difference_case: str


def summaries(results: Sequence[CaseResult]) -> list[ModelSummary]:
    """One of every model, in the order of the table."""
    by_model: dict[str, dict[str, Outcome]] = {}
    for result in results:
        for outcome in result.outcomes:
            by_model.setdefault(outcome.model, {})[result.name] = outcome
    return [_summary(name, cases) for name, cases in by_model.items()]


def failures(results: Sequence[CaseResult]) -> list[tuple[str, Outcome]]:
    """The runs that failed, each with the name of its case, model by model."""
    models = list(dict.fromkeys(outcome.model for result in results for outcome in result.outcomes))
    failed = [(result.name, o) for result in results for o in result.outcomes if o.status == FAILED]
    return sorted(failed, key=lambda found: models.index(found[1].model))


def _summary(name: str, cases: Mapping[str, Outcome]) -> ModelSummary:
    outcomes = list(cases.values())

    def worst(value: Callable[[Outcome], float | None]) -> float | None:
        return max((found for o in outcomes if o.status == OK and (found := value(o)) is not None), default=None)

    def where(value: Callable[[Outcome], float | None]) -> str:
        found = worst(value)
        return "" if found is None else next(case for case, o in cases.items() if o.status == OK and value(o) == found)

    missed = [o.missed for o in outcomes if o.missed is not None]
    return ModelSummary(
        model=name,
        ok=sum(o.status == OK for o in outcomes),
        failed=sum(o.status == FAILED for o in outcomes),
        not_run=sum(o.status == NOT_RUN for o in outcomes),
        wrong=sum(bool(o.wrong) for o in outcomes),
        energy=worst(lambda o: o.energy),
        residual=worst(lambda o: o.residual),
        beyond=worst(lambda o: o.beyond),
        missed=sum(missed) if missed else None,
        difference=worst(lambda o: o.difference),
        time_s=sum(o.time_s or 0.0 for o in outcomes),
        energy_case=where(lambda o: o.energy),
        difference_case=where(lambda o: o.difference),
    )


def warned(results: Sequence[CaseResult]) -> list[str]:
    """What the reduced models warn of, a sentence for each kind."""
    ran = [(f"{result.name}, {o.model}", o.warnings) for result in results for o in result.outcomes if o.status == OK]
    return [group.told(len(ran)) for group in grouped(ran)]


def headline(results: Sequence[CaseResult]) -> str:
    """The outcome in one sentence."""
    wrong = [result.name for result in results if result.wrong]
    silent = [result.name for result in results if not result.answered]
    told = f"{len(results)} cases, none wrong" if not wrong else f"{len(results)} cases, wrong: {', '.join(wrong)}"
    return f"{told}; without an answer, with a cause: {', '.join(silent)}." if silent else f"{told}."


def contents(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> dict[str, Any]:
    """Everything, for a JSON file."""
    return {
        "environment": environment,
        "quick": quick,
        "limits": {"residual": CLOSES, "beyond_m": BEYOND},
        "models": [asdict(summary) for summary in summaries(results)],
        "cases": {
            result.name: {
                "hard": result.hard,
                "wrong": result.wrong,
                "models": {outcome.model: asdict(outcome) for outcome in result.outcomes},
            }
            for result in results
        },
    }
