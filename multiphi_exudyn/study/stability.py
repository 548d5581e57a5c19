"""Stability: a catalogue of extreme cases, every model run through each of them, and what each answer is worth.

    native        judged by the laws of motion, contact, friction and energy (law_check.py), and by its case's own check
    user object   judged at its steps by the laws of contact and friction; where its modes are matched to the step it
                  has to agree with the native run, with too few steps for that it has failed where it does not
    full model    another model: its energy drift and its difference are shown, without a judgement

A run that stops with a cause counts as correct. A rise of energy that breaks no law is told with its cause.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin import BodyHistories
from multiphi_exudyn.mechanics.arguments import one_of
from multiphi_exudyn.mechanics.contact import UnilateralContact
from multiphi_exudyn.mechanics.loads import FunctionLoad, HarmonicLoad, SampledLoad, SweepLoad
from multiphi_exudyn.mechanics.structure import damping_matrix
from multiphi_exudyn.study.law_check import broken_laws, energy_rise, lawful_rise
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.report import environment_of
from multiphi_exudyn.study.runs import timed
from multiphi_exudyn.study.sweep import TimeLimitExceeded, call_within
from multiphi_exudyn.study.wording import seconds
from multiphi_exudyn.time.model_warnings import grouped, kept_back
from multiphi_exudyn.time.simulate import simulate
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.body_alone import solve_body_alone
from reference_models.extreme_case import STATIC_LOADS, Case, Problem, Pull
from reference_models.extreme_cases import CATALOGUE
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.full_matrices import run_matrices

__all__ = [
    "FULL_LENGTH",
    "QUICK",
    "CaseResult",
    "Limits",
    "Outcome",
    "chosen_cases",
    "contents",
    "render_stability",
    "run_case",
    "run_full_model",
    "run_native",
    "run_user_object",
    "text_table",
]

NATIVE, USER_OBJECT, FULL_MODEL = "native", "user object", "full model"
OK, FAILED, NOT_RUN = "ok", "failed", "not run"
INTERVALS, SAMPLES = 100, 100_000  # of the law check
MATCHED_PER_PERIOD = 3  # steps of the user object in the shortest kept period; matched modes need more than two
STEPS_PER_PERIOD = 200  # of the full model in it
FEWEST_STEPS = 200
LARGEST_FULL = 400  # coordinates of a dense full model at most, for the time of a step
AGREEMENT = 0.01  # of the largest travel, or of its 2-norm: smaller differences count as agreement
AT_STEPS = 1e-6  # of the largest travel or force of a user object: what its laws may be off at a step
VARYING_LOADS = (HarmonicLoad, SampledLoad, FunctionLoad, SweepLoad)
MOST_WORDS = 200  # characters of the message of a foreign exception
INSTANTS = 500  # at which a run's largest energy is looked for


@dataclass(frozen=True)
class Outcome:
    """Result of one model in one case. Quantities that a model does not have are None.

    model: its name. status: "ok" | "failed" | "not run"; message: the cause, or a remark. wrong: what makes an answer
    that is ok wrong, one sentence each. energy, of the largest: by how much energy less the work of loads rises, of a
    full model its drift, where damped its largest gain. residual: of the ledger, of the largest energy.
    difference: to the native answer, ||y - native|| / ||native|| of the contacts' travel, the worst of them;
    agrees_until: the share of the run up to the first difference above AGREEMENT of the largest travel.
    steps: of a model in Exudyn. time_s: of the run alone [s]. warnings: of a reduced model about its result.
    """

    model: str
    status: str = OK
    message: str = ""
    wrong: tuple[str, ...] = ()
    energy: float | None = None
    residual: float | None = None
    events: int | None = None
    difference: float | None = None
    agrees_until: float | None = None
    steps: int | None = None
    time_s: float | None = None
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class CaseResult:
    """name, hard: of the case; outcomes: one of every model."""

    name: str
    hard: str
    outcomes: tuple[Outcome, ...]

    @property
    def wrong(self) -> bool:
        """Whether one of the results is wrong."""
        return any(outcome.wrong for outcome in self.outcomes)

    @property
    def answered(self) -> bool:
        """Whether one of the runs is ok."""
        return any(outcome.status == OK for outcome in self.outcomes)


@dataclass(frozen=True)
class Limits:
    """quick: whether cases are short. native_limit_s, limit_s: of one run of the native and of another model [s].

    most_steps: of the user object. values: coordinates that the full model of matrices may store, all steps together.
    """

    quick: bool
    native_limit_s: float
    limit_s: float
    most_steps: int
    values: int


FULL_LENGTH = Limits(quick=False, native_limit_s=30.0, limit_s=8.0, most_steps=100_000, values=4_000_000)
QUICK = Limits(quick=True, native_limit_s=10.0, limit_s=4.0, most_steps=8_000, values=500_000)


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
        native, trajectory = run_native(case, problem, limits.native_limit_s)
        if trajectory is None:
            why = "no native answer to be compared with"
            others = [Outcome(name, NOT_RUN, why) for name in (USER_OBJECT, FULL_MODEL)]
        else:
            others = [
                run_user_object(problem, trajectory, limits.most_steps, limits.limit_s),
                run_full_model(problem, trajectory, limits.values, limits.limit_s),
            ]
        return CaseResult(case.name, case.hard, (native, *others))


# the native model


def run_native(case: Case, problem: Problem, limit_s: float) -> tuple[Outcome, Trajectory | None]:
    """Run the native model of a problem, and judge the trajectory; None of a run that failed.

    A failure of the model is an outcome with its cause; any other exception is an outcome that is wrong.
    """

    def run() -> Trajectory:
        return simulate(problem.model(), problem.t_end, problem.displacement, problem.velocity, problem.loads)

    try:
        trajectory, time_s = call_within(limit_s, lambda: timed(run))
    except TimeLimitExceeded:
        return Outcome(NATIVE, FAILED, f"time limit of {limit_s:g} s"), None
    except MultiPhiError as error:
        return Outcome(NATIVE, FAILED, " ".join(str(error).split())), None
    except Exception as error:  # one that is no MultiPhiError is an error of the model
        cause = f"{type(error).__name__}: {' '.join(str(error).split())}"
        return Outcome(NATIVE, FAILED, cause, (f"{cause}: no failure of the model's own",)), None
    if trajectory.status != OK:
        return Outcome(NATIVE, FAILED, trajectory.message, events=len(trajectory.events), time_s=time_s), None
    fault = case.check(problem, trajectory) if case.check else ""
    laws = broken_laws(trajectory, problem.loads, problem.start, INTERVALS, samples=SAMPLES)
    largest = _largest_energy(trajectory)
    rise = energy_rise(trajectory, problem.loads)
    outcome = Outcome(
        NATIVE,
        message="; ".join(filter(None, (trajectory.message, lawful_rise(trajectory)))),
        wrong=(*laws, *([fault] if fault else [])),
        energy=None if rise is None else _share(rise, largest),
        residual=_share(abs(trajectory.ledger.residual), largest),
        events=len(trajectory.events),
        time_s=time_s,
        warnings=trajectory.warnings,
    )
    return outcome, trajectory


def _largest_energy(trajectory: Trajectory) -> float:
    times = np.linspace(trajectory.t_start, trajectory.t_end, INSTANTS)
    ledger = trajectory.ledger
    return max(float(np.max(np.abs(trajectory.energy(times)))), abs(ledger.initial), abs(ledger.work_of_loads))


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0 else part


# the models inside Exudyn


def run_user_object(problem: Problem, native: Trajectory, most_steps: int, limit_s: float) -> Outcome:
    """The body alone in Exudyn, its modes matched to the step where ``most_steps`` allow it."""
    needed = max(FEWEST_STEPS, math.ceil(problem.t_end * _highest_frequency(native) * MATCHED_PER_PERIOD))
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
        outcome = _with_difference(outcome, problem, native, histories.time, histories.gaps, histories.slip)
        wrong = tuple(_broken_at_steps(problem, histories))
        if outcome.difference is not None and outcome.difference > AGREEMENT:
            far = f"differs from native by {100 * outcome.difference:.2g} %"
            if not matched:
                return replace(outcome, status=FAILED, message=f"{far}: {outcome.message}")
            wrong += (far,)
        return replace(outcome, wrong=wrong)

    return _outcome_of(USER_OBJECT, solve)


def _broken_at_steps(problem: Problem, found: BodyHistories) -> list[str]:
    """The laws of contact and friction that a user object breaks at its steps, one sentence each.

    Gaps of open contacts are judged where no mode is left out, |T| where the limit is a number.
    """
    broken = []
    for contact in problem.unilateral:
        gap, force = np.asarray(found.gaps[contact.name]), np.asarray(found.contact_force[contact.name])
        closed = np.asarray(found.closed[contact.name], bool)
        length, most = AT_STEPS * float(np.ptp(gap)), AT_STEPS * float(np.max(np.abs(force), initial=0.0))
        if (contact.rigid or contact.damping) and np.any(-force > most):
            broken.append(f"{contact.name} pulls with {-np.min(force):.2g} at a step")
        if contact.rigid and np.any(np.abs(gap[closed]) > length) and problem.modes == "all":
            broken.append(f"{contact.name} is closed with a gap of {np.max(np.abs(gap[closed])):.2g} at a step")
        if not contact.damping and problem.modes == "all" and np.any(-gap[~closed] > length):
            broken.append(f"{contact.name} is open {-np.min(gap[~closed]):.2g} inside its stop at a step")
    for friction in problem.frictions:
        tension = float(np.max(np.abs(found.friction_force[friction.name]), initial=0.0))
        if tension > friction.most * (1 + AT_STEPS):
            broken.append(f"{friction.name} rubs with {tension:.6g}, its limit is {friction.most:g}")
    return broken


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
    structure, highest = problem.structure, _highest_frequency(native)
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


def _highest_frequency(trajectory: Trajectory) -> float:
    """Of the levels that a trajectory visits [Hz]."""
    levels = {id(segment.level.level): segment.level.level for segment in trajectory.segments}
    return max(level.highest_frequency for level in levels.values())


def _penalty_remark(problem: Problem) -> str:
    rigid = any(contact.rigid for contact in problem.parts)
    return f"penalty of {problem.penalty:g} for the rigid contact: another law" if rigid else ""


def _drift(energy: np.ndarray, work: np.ndarray, kinetic: np.ndarray, conservative: bool) -> float:
    """Of energies less work (k,): the largest deviation from the first, of a damped system the largest gain.

    Both as a share of the largest energy, the kinetic one where force laws hold a negative one.
    """
    balance = energy - work
    deviation = np.abs(balance - balance[0]) if conservative else balance - np.minimum.accumulate(balance)
    return _share(float(np.max(deviation)), max(float(np.max(energy)), float(np.max(kinetic))))


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


# what is told of the whole run: table, page, JSON


HEADS = {"status": 7, "energy": 8, "ledger": 8, "events": 7, "differs": 8, "time": 8}  # column -> its width
WORST = ("energy", "residual", "difference")  # quantities whose largest value is shown, with its case


def headline(results: Sequence[CaseResult]) -> str:
    """The outcome in one sentence."""
    wrong = ", ".join(result.name for result in results if result.wrong)
    silent = ", ".join(result.name for result in results if not result.answered)
    told = f"{len(results)} cases, {f'wrong: {wrong}' if wrong else 'none wrong'}"
    return f"{told}; without an answer, with a cause: {silent}." if silent else f"{told}."


def summaries(results: Sequence[CaseResult]) -> list[dict[str, Any]]:
    """One row for each model: number of runs by status, worst values of answers with their cases, and run time [s]."""
    runs = [(result.name, outcome) for result in results for outcome in result.outcomes]
    rows = []
    for model in dict.fromkeys(outcome.model for _, outcome in runs):
        own = [(case, outcome) for case, outcome in runs if outcome.model == model]
        counts = {status: sum(outcome.status == status for _, outcome in own) for status in (OK, FAILED, NOT_RUN)}
        row: dict[str, Any] = {"model": model, "ok": counts[OK], "failed": counts[FAILED], "not_run": counts[NOT_RUN]}
        row["wrong"] = sum(bool(outcome.wrong) for _, outcome in own)
        row["time_s"] = sum(outcome.time_s or 0.0 for _, outcome in own)
        for name in WORST:
            known = [(getattr(o, name), case) for case, o in own if o.status == OK and getattr(o, name) is not None]
            row[name], row[f"{name}_case"] = max(known, default=(None, ""))
        rows.append(row)
    return rows


def warned(results: Sequence[CaseResult]) -> list[str]:
    """Warnings of the reduced models, a sentence for each kind."""
    ran = [(f"{r.name}, {o.model}", o.warnings) for r in results for o in r.outcomes if o.status == OK]
    return [group.told(len(ran)) for group in grouped(ran)]


def contents(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> dict[str, Any]:
    """Content of the JSON file."""
    cases = {
        r.name: {"hard": r.hard, "wrong": r.wrong, "models": {o.model: asdict(o) for o in r.outcomes}} for r in results
    }
    return {"environment": environment, "quick": quick, "models": summaries(results), "cases": cases}


def text_table(results: Sequence[CaseResult]) -> str:
    """Text table of all cases, followed by the warnings of the models and the result in one sentence."""
    width = max(len(outcome.model) for result in results for outcome in result.outcomes)
    lines = [f"  {'':{width}}  " + "  ".join(f"{head:>{size}}" for head, size in HEADS.items())]
    for result in results:
        lines.append(f"{result.name}{'  WRONG' if result.wrong else ''}")
        for o in result.outcomes:
            events = "–" if o.events is None else str(o.events)
            cells = (o.status, _figure(o.energy), _figure(o.residual), events, _figure(o.difference), seconds(o.time_s))
            row = "  ".join(f"{cell:>{size}}" for cell, size in zip(cells, HEADS.values(), strict=True))
            remarks = "; ".join([*(f"WRONG: {sentence}" for sentence in o.wrong), *filter(None, [o.message])])
            lines.append(f"  {o.model:{width}}  {row}  {remarks}".rstrip())
    return "\n".join([*lines, "", *(f"warning: {sentence}" for sentence in warned(results)), headline(results)])


def render_stability(results: Sequence[CaseResult], environment: dict[str, Any], quick: bool) -> str:
    """The page as HTML."""
    page = environment_of()
    page.filters["figure"] = _figure
    failures = [(o.model, r.name, o.message) for r in results for o in r.outcomes if o.status == FAILED]
    return page.get_template("stability.html.j2").render(
        results=results,
        headline=headline(results),
        warned=warned(results),
        summaries=summaries(results),
        failures=sorted(failures, key=lambda failure: failure[0]),
        quick=quick,
        environment=environment,
        agreement=AGREEMENT,
    )


def _figure(value: float | None) -> str:
    """A number with two digits and a power of ten."""
    if value is None:
        return "–"
    return "0" if value == 0 else f"{value:.1e}"
