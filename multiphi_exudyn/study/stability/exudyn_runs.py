"""The models inside Exudyn in a case: the reduced body as a user object, and the full model.

They use time steps, so the criteria of the native model do not apply to them. A user object whose modes are matched to
its step has to agree with the native run; one that has too few steps for that and is as far away has failed. Of a full
model, which is another model, energy drift and difference are reported. A run that stops has Exudyn's message.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import FunctionLoad, HarmonicLoad, SampledLoad, SweepLoad
from multiphi_exudyn.mechanics.structure import damping_matrix
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.stability.brute_force import highest_frequency
from multiphi_exudyn.study.stability.case import STATIC_LOADS, Problem, Pull
from multiphi_exudyn.study.stability.outcome import FAILED, NOT_RUN, OK, Outcome
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.body_alone import solve_body_alone
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.full_matrices import run_matrices

__all__ = ["FULL_MODEL", "USER_OBJECT", "run_full_model", "run_user_object"]

USER_OBJECT, FULL_MODEL = "user object", "full model"
MATCHED_PER_PERIOD = 3  # steps of the user object in the shortest kept period; matched modes need more than two
STEPS_PER_PERIOD = 200  # of the full model in it
FEWEST_STEPS = 200
LARGEST_FULL = 400  # coordinates of a dense full model at most, for the time of a step
AGREEMENT = 0.01  # of the largest travel, or of its 2-norm: smaller differences count as agreement
VARYING_LOADS = (HarmonicLoad, SampledLoad, FunctionLoad, SweepLoad)
MOST_WORDS = 200  # characters of the message of a foreign exception


def run_user_object(problem: Problem, native: Trajectory, most_steps: int, limit_s: float) -> Outcome:
    """The body alone in Exudyn, its modes matched to the step where ``most_steps`` allow it."""
    needed = max(FEWEST_STEPS, math.ceil(problem.t_end * highest_frequency(native) * MATCHED_PER_PERIOD))
    steps, matched = min(needed, most_steps), needed <= most_steps

    def solve() -> Outcome:
        histories, time_s = solve_body_alone(
            problem.model(),
            problem.displacement,
            problem.t_end,
            steps,
            (),
            velocity=problem.velocity,
            loads=problem.loads,
            matched=matched,
            cpu_limit_s=limit_s,
        )
        remark = "" if matched else f"{steps} steps allowed, {needed} needed to match its modes: plain trapezoidal rule"
        outcome = Outcome(
            USER_OBJECT,
            message=remark,
            events=len(histories.events),
            steps=steps,
            time_s=time_s,
            warnings=histories.warnings,
        )
        compared = _with_difference(outcome, problem, native, histories.time, histories.gaps, histories.slip)
        return _judged(compared, matched)

    return _outcome_of(USER_OBJECT, solve)


def _judged(outcome: Outcome, matched: bool) -> Outcome:
    """A user object's outcome: wrong where it is far from the native run, or failed where its steps are too few."""
    if outcome.difference is None or outcome.difference <= AGREEMENT:
        return outcome
    far = f"differs from native by {100 * outcome.difference:.2g} %"
    return (
        replace(outcome, wrong=(far,))
        if matched
        else replace(outcome, status=FAILED, message=f"{far}: {outcome.message}")
    )


def run_full_model(problem: Problem, native: Trajectory, values: int, limit_s: float) -> Outcome:
    """The full nonlinear beam where the problem is one, else all coordinates of its matrices.

    values: coordinates that a run may store, all steps together.
    """
    contacts = problem.penalty_contacts
    if problem.frictions:
        return Outcome(FULL_MODEL, NOT_RUN, "friction: compared by scenes with a full beam")
    if contacts is None:
        return Outcome(FULL_MODEL, NOT_RUN, "Exudyn's contact elements have no rigid law without rebound")
    pull = problem.pull
    if pull is not None:
        return _outcome_of(FULL_MODEL, lambda: _full_beam(problem, pull, contacts, native, limit_s))
    if problem.structure.n > LARGEST_FULL:
        return Outcome(FULL_MODEL, NOT_RUN, f"{problem.structure.n} coordinates, dense up to {LARGEST_FULL}")
    return _outcome_of(FULL_MODEL, lambda: _full_matrices(problem, contacts, native, values, limit_s))


def _full_matrices(
    problem: Problem, contacts: Sequence[UnilateralContact], native: Trajectory, values: int, limit_s: float
) -> Outcome:
    """All coordinates, in as many steps as ``values`` stored coordinates allow."""
    if not all(isinstance(load, (*STATIC_LOADS, *VARYING_LOADS)) for load in problem.loads):
        return Outcome(FULL_MODEL, NOT_RUN, "a base or a stop that moves")
    structure, highest = problem.structure, highest_frequency(native)
    needed = max(FEWEST_STEPS, math.ceil(problem.t_end * highest * STEPS_PER_PERIOD))
    steps = min(needed, values // (structure.n + 1))
    static = [load for load in problem.loads if isinstance(load, STATIC_LOADS)]
    run = run_matrices(
        structure,
        contacts,
        problem.t_end,
        steps,
        displacement=problem.displacement,
        velocity=problem.velocity,
        load=sum((load.row(structure) for load in static), np.zeros(structure.n)),
        varying=_varying(problem),
        damping=damping_matrix(structure),
        laws=problem.laws,
        cpu_limit_s=limit_s,
    )
    coarse = f"{steps / (problem.t_end * highest):.3g} steps in the shortest period" if steps < needed else ""
    outcome = Outcome(
        FULL_MODEL,
        message="; ".join(filter(None, (_penalty_remark(problem), coarse))),
        energy=_drift(run.energy, run.work, run.kinetic, not problem.damped),
        steps=steps,
        time_s=run.wall_s,
    )
    return _with_difference(outcome, problem, native, run.time, run.gaps)


def _varying(problem: Problem) -> Callable[[np.ndarray], np.ndarray] | None:
    """Function that evaluates the varying loads (n, k) at times (k,); None without such loads."""
    loads = [load for load in problem.loads if isinstance(load, VARYING_LOADS)]
    if not loads:
        return None
    rows = np.array([problem.structure.row(load.at) for load in loads])
    histories = [load.course.history(problem.t_end) for load in loads]
    return lambda times: rows.T @ np.array([history.at(times) for history in histories])


def _full_beam(
    problem: Problem, pull: Pull, contacts: Sequence[UnilateralContact], native: Trajectory, limit_s: float
) -> Outcome:
    settings = FullBeamSettings(elements=pull.elements, step=pull.step, cpu_limit_s=limit_s)
    beam = FullBeam(pull.beam, contacts, settings)
    run = beam.run(
        problem.t_end,
        load_at=pull.tip,
        measured_at=pull.tip,
        displacement=pull.displacement,
        damping=damping_matrix(replace(beam.structure, damping=problem.structure.damping)),
        progress=False,
    )
    outcome = Outcome(FULL_MODEL, run.status, run.message or _penalty_remark(problem), steps=run.steps)
    if run.status != OK or run.balance is None:
        return outcome
    drift = _drift(run.energy, np.zeros(1), run.energy, not problem.damped)
    outcome = replace(outcome, energy=drift, time_s=run.online_s)
    return _with_difference(outcome, problem, native, run.time, run.gaps)


def _penalty_remark(problem: Problem) -> str:
    rigid = any(contact.rigid for contact in problem.parts)
    return f"penalty of {problem.penalty:g} for the rigid contact: another law" if rigid else ""


def _drift(energy: np.ndarray, work: np.ndarray, kinetic: np.ndarray, conservative: bool) -> float:
    """Of energies less work (k,): the largest deviation from the first, of a damped system the largest gain.

    Both as a share of the largest energy, the kinetic one where force laws hold a negative one.
    """
    balance = energy - work
    deviation = np.abs(balance - balance[0]) if conservative else balance - np.minimum.accumulate(balance)
    largest = max(float(np.max(energy)), float(np.max(kinetic)))
    return float(np.max(deviation)) / largest if largest > 0 else float(np.max(deviation))


def _with_difference(
    outcome: Outcome,
    problem: Problem,
    native: Trajectory,
    time: np.ndarray,
    gaps: Mapping[str, np.ndarray],
    slips: Mapping[str, np.ndarray] | None = None,
) -> Outcome:
    """The outcome with difference and agreement of the contacts' travel h.x, and of slips, unless nothing moves."""
    inside = time <= native.t_end
    pairs = [
        (gaps[c.name][inside] - c.gap, np.asarray(native.gap(c.name, time[inside])) - c.gap) for c in problem.parts
    ]
    pairs += [(slip[inside], np.asarray(native.slip(name, time[inside]))) for name, slip in (slips or {}).items()]
    pairs = [(values, ref) for values, ref in pairs if np.any(ref)]
    if not pairs:
        return outcome
    worst = max(nrmse(*pair, time[inside], native.t_end) for pair in pairs)
    apart = np.max([np.abs(values - ref) / np.max(np.abs(ref)) for values, ref in pairs], axis=0) > AGREEMENT
    until = float(time[inside][np.argmax(apart)]) / native.t_end if np.any(apart) else 1.0
    return replace(outcome, difference=worst, agrees_until=until)


def _outcome_of(name: str, solve: Callable[[], Outcome]) -> Outcome:
    """Outcome of ``solve``, or a failed outcome with the message of its exception."""
    try:
        return solve()
    except MultiPhiError as error:
        return Outcome(name, FAILED, " ".join(str(error).split()))
    except Exception as error:  # Exudyn wraps what a user function raises in errors of its own
        return Outcome(name, FAILED, f"{type(error).__name__}: {' '.join(str(error).split())[:MOST_WORDS]}")
