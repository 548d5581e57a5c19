"""Reports of a run of the catalogue: a text table, and a self-contained HTML page."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from multiphi_exudyn.study.report import environment_of
from multiphi_exudyn.study.stability import brute_force, exudyn_runs, judgement, run_laws
from multiphi_exudyn.study.stability.outcome import CaseResult, Outcome
from multiphi_exudyn.study.stability.summary import failures, headline, summaries, warned
from multiphi_exudyn.study.wording import seconds

__all__ = ["render_stability", "text_table"]

TEMPLATE = "stability.html.j2"
HEADS = ("status", "energy", "ledger", "events", "missed", "beyond", "differs", "time")
WIDTHS = (7, 8, 8, 7, 6, 8, 8, 8)


def text_table(results: Sequence[CaseResult]) -> str:
    """Text table of all cases, followed by the warnings of the models and the result in one sentence."""
    width = max(len(outcome.model) for result in results for outcome in result.outcomes)
    heads = "  ".join(f"{head:>{size}}" for head, size in zip(HEADS, WIDTHS, strict=True))
    lines = [f"  {'':{width}}  {heads}", *(line for result in results for line in _case(result, width))]
    return "\n".join([*lines, "", *(f"warning: {sentence}" for sentence in warned(results)), headline(results)])


def render_stability(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> str:
    """The page as HTML."""
    page = environment_of()
    page.filters["figure"] = _figure
    return page.get_template(TEMPLATE).render(
        results=results,
        headline=headline(results),
        warned=warned(results),
        summaries=summaries(results),
        failures=failures(results),
        quick=quick,
        environment=environment,
        limits=judgement,
        laws=run_laws,
        brute=brute_force,
        exudyn=exudyn_runs,
    )


def _figure(value: float | None) -> str:
    """A number with two digits and a power of ten."""
    if value is None:
        return "–"
    return "0" if value == 0 else f"{value:.1e}"


def _case(result: CaseResult, width: int) -> Iterator[str]:
    yield f"{result.name}{'  WRONG' if result.wrong else ''}"
    for outcome in result.outcomes:
        cells = "  ".join(f"{cell:>{size}}" for cell, size in zip(_cells(outcome), WIDTHS, strict=True))
        remarks = "; ".join([*(f"WRONG: {sentence}" for sentence in outcome.wrong), *filter(None, [outcome.message])])
        yield f"  {outcome.model:{width}}  {cells}  {remarks}".rstrip()


def _cells(outcome: Outcome) -> tuple[str, ...]:
    counts = ("–" if count is None else str(count) for count in (outcome.events, outcome.missed))
    return (
        outcome.status,
        _figure(outcome.energy),
        _figure(outcome.residual),
        *counts,
        _figure(outcome.beyond),
        _figure(outcome.difference),
        seconds(outcome.time_s),
    )
