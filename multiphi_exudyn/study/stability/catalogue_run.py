"""The shipped catalogue, and its run: every case through every model, in turn."""

from __future__ import annotations

from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.study.stability import beams, driven, friction, laws, starts, systems
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.exudyn_runs import (
    FULL_MODEL,
    USER_OBJECT,
    run_full_model,
    run_user_object,
)
from multiphi_exudyn.study.stability.native_run import Native, run_native
from multiphi_exudyn.study.stability.outcome import NOT_RUN, CaseResult, Outcome
from multiphi_exudyn.time.model_warnings import kept_back

__all__ = ["CATALOGUE", "FULL_LENGTH", "QUICK", "Limits", "chosen_cases", "run_case"]

CATALOGUE = (*starts.CASES, *beams.CASES, *systems.CASES, *laws.CASES, *driven.CASES, *friction.CASES)
IN_EXUDYN = (USER_OBJECT, FULL_MODEL)


@dataclass(frozen=True)
class Limits:
    """quick: whether cases are short. native_limit_s, limit_s: of one run of the native and of another model [s].

    budget: samples of every contact. most_steps: of the user object. values: coordinates that the full model of
    matrices may store, all steps together.
    """

    quick: bool
    native_limit_s: float
    limit_s: float
    budget: int
    most_steps: int
    values: int


FULL_LENGTH = Limits(
    quick=False, native_limit_s=30.0, limit_s=8.0, budget=100_000, most_steps=100_000, values=4_000_000
)
QUICK = Limits(quick=True, native_limit_s=10.0, limit_s=4.0, budget=40_000, most_steps=8_000, values=500_000)


def chosen_cases(name: str | None, quick: bool) -> list[Case]:
    """The cases of a run: the one with this name, or all, or those of the quick catalogue."""
    if name is None:
        return [case for case in CATALOGUE if case.quick or not quick]
    found = [case for case in CATALOGUE if case.name == name]
    if not found:
        raise MultiPhiValueError(f"--case: got {name!r}, need {one_of(name, (case.name for case in CATALOGUE))}")
    return found


def run_case(case: Case, limits: Limits) -> CaseResult:
    """Every model in one case; those in Exudyn are compared with the native answer."""
    with kept_back():
        problem = case.build(limits.quick)
        native = run_native(case, problem, limits.native_limit_s, limits.budget)
        return CaseResult(case.name, case.hard, (native.outcome, *_in_exudyn(problem, native, limits)))


def _in_exudyn(problem: Problem, native: Native, limits: Limits) -> tuple[Outcome, ...]:
    if native.trajectory is None:
        return tuple(Outcome(name, NOT_RUN, "no native answer to be compared with") for name in IN_EXUDYN)
    body = run_user_object(problem, native.trajectory, limits.most_steps, limits.limit_s)
    return body, run_full_model(problem, native.trajectory, limits.values, limits.limit_s)
