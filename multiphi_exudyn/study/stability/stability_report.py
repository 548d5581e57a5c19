"""The page of a run of the catalogue: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from multiphi_exudyn.study.comparison.pages import environment_of
from multiphi_exudyn.study.stability import brute_force, exudyn_runs, judgement, run_laws
from multiphi_exudyn.study.stability.outcome import CaseResult
from multiphi_exudyn.study.stability.summary import failures, headline, summaries, warned
from multiphi_exudyn.study.stability.text_table import figure

__all__ = ["render_stability"]

TEMPLATE = "stability.html.j2"


def render_stability(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> str:
    """The page as HTML."""
    page = environment_of(__package__ or "")
    page.filters["figure"] = figure
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
