"""The native model in a case, judged."""

from __future__ import annotations

from dataclasses import dataclass

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study.running.timing import timed
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.judgement import judge
from multiphi_exudyn.study.stability.outcome import FAILED, OK, Outcome
from multiphi_exudyn.study.sweep.time_limit import TimeLimitExceeded, call_within
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory.trajectory import Trajectory

__all__ = ["NATIVE", "Native", "run_native"]

NATIVE = "native"
TRACE = "no failure of the model's own"  # said of an exception that the model should have turned into a status


@dataclass(frozen=True)
class Native:
    """An outcome, and the trajectory it is from, None where there is none."""

    outcome: Outcome
    trajectory: Trajectory | None = None


def run_native(case: Case, problem: Problem, limit_s: float, budget: int) -> Native:
    """Run a model of its own, and judge it.

    A failure of the model is an outcome with its cause; any other exception is an outcome that is wrong.
    """
    try:
        trajectory, time_s = call_within(limit_s, lambda: timed(lambda: _simulated(problem)))
    except TimeLimitExceeded:
        return Native(Outcome(NATIVE, FAILED, f"time limit of {limit_s:g} s"))
    except MultiPhiError as error:
        return Native(Outcome(NATIVE, FAILED, _one_line(error)))
    except Exception as error:  # what a model lets through is a finding of this catalogue
        cause = f"{type(error).__name__}: {_one_line(error)}"
        return Native(Outcome(NATIVE, FAILED, cause, (f"{cause}: {TRACE}",)))
    if trajectory.status != OK:
        return Native(Outcome(NATIVE, FAILED, trajectory.message, events=len(trajectory.events), time_s=time_s))
    return Native(_judged(case, problem, trajectory, time_s, budget), trajectory)


def _simulated(problem: Problem) -> Trajectory:
    return simulate(problem.model(), problem.t_end, problem.displacement, problem.velocity, problem.loads)


def _judged(case: Case, problem: Problem, trajectory: Trajectory, time_s: float, budget: int) -> Outcome:
    found = judge(problem, trajectory, budget)
    special = case.check(problem, trajectory) if case.check else ""
    return Outcome(
        NATIVE,
        message=trajectory.message,
        wrong=(*found.complaints(problem.metre), *([special] if special else [])),
        energy=found.energy,
        residual=found.residual,
        events=found.events,
        missed=found.missed,
        time_s=time_s,
        samples=found.samples,
        covered=found.covered,
        beyond=(found.unexcused if found.truncated else found.beyond) / problem.metre,
        excused=found.beyond / problem.metre if found.truncated else None,
        reported=found.reported / problem.metre if found.truncated else None,
        warnings=trajectory.warnings,
    )


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())
