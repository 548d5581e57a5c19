"""Run and judge the native model in a case."""

from __future__ import annotations

from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study.runs import timed
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.judgement import judge
from multiphi_exudyn.study.stability.outcome import FAILED, OK, Outcome
from multiphi_exudyn.study.sweep import TimeLimitExceeded, call_within
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory

__all__ = ["NATIVE", "Native", "run_native"]

NATIVE = "native"
TRACE = "no failure of the model's own"  # added to an exception that should have been a status


@dataclass(frozen=True)
class Native:
    """An outcome with its trajectory; None for a failed run."""

    outcome: Outcome
    trajectory: Trajectory | None = None


def run_native(case: Case, problem: Problem, limit_s: float, budget: int) -> Native:
    """Run the native model of a problem, and judge the trajectory.

    A failure of the model is an outcome with its cause; any other exception is an outcome that is wrong.
    """
    try:
        trajectory, time_s = call_within(limit_s, lambda: timed(lambda: _simulated(problem)))
    except TimeLimitExceeded:
        return Native(Outcome(NATIVE, FAILED, f"time limit of {limit_s:g} s"))
    except MultiPhiError as error:
        return Native(Outcome(NATIVE, FAILED, _one_line(error)))
    except Exception as error:  # an exception that is no MultiPhiError is an error of the model
        cause = f"{type(error).__name__}: {_one_line(error)}"
        return Native(Outcome(NATIVE, FAILED, cause, (f"{cause}: {TRACE}",)))
    if trajectory.status != OK:
        return Native(Outcome(NATIVE, FAILED, trajectory.message, events=len(trajectory.events), time_s=time_s))
    return Native(_outcome_of(case, problem, trajectory, time_s, budget), trajectory)


def _simulated(problem: Problem) -> Trajectory:
    return simulate(problem.model(), problem.t_end, problem.displacement, problem.velocity, problem.loads)


def _outcome_of(case: Case, problem: Problem, trajectory: Trajectory, time_s: float, budget: int) -> Outcome:
    judgement = judge(problem, trajectory, budget)
    fault = case.check(problem, trajectory) if case.check else ""
    return Outcome(
        NATIVE,
        message=trajectory.message,
        wrong=(*judgement.complaints(problem.metre), *([fault] if fault else [])),
        energy=judgement.energy,
        residual=judgement.residual,
        events=judgement.events,
        missed=judgement.missed,
        time_s=time_s,
        samples=judgement.samples,
        covered=judgement.covered,
        beyond=(judgement.unexcused if judgement.truncated else judgement.beyond) / problem.metre,
        excused=judgement.beyond / problem.metre if judgement.truncated else None,
        reported=judgement.reported / problem.metre if judgement.truncated else None,
        warnings=trajectory.warnings,
    )


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
