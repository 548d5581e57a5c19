"""The catalogue of extreme cases: nothing in it is wrong, and what would be wrong is seen."""

import dataclasses
import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, random_model, stop

from multiphi_exudyn import MultiPhiModel, UnilateralContact, cli, simulate
from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.study.stability import catalogue_run, native_run
from multiphi_exudyn.study.stability.case import Case, Problem
from multiphi_exudyn.study.stability.catalogue_run import CATALOGUE, QUICK, chosen_cases, run_case
from multiphi_exudyn.study.stability.exudyn_runs import run_user_object
from multiphi_exudyn.study.stability.judgement import judge
from multiphi_exudyn.study.stability.native_run import run_native
from multiphi_exudyn.study.stability.outcome import CaseResult, Outcome
from multiphi_exudyn.study.stability.report import render_stability, text_table
from multiphi_exudyn.study.stability.run_laws import energy_rise
from multiphi_exudyn.study.stability.summary import contents, failures, summaries
from multiphi_exudyn.time.segments import Segments
from reference_models.full_matrices import run_matrices

pytestmark = pytest.mark.usefixtures("few_elements")

BUDGET = 20_000
SLOW = {"many-events", "1000-seconds", "elements-1000"}  # seconds each; the command runs them
BY_NAME = {case.name: case for case in CATALOGUE}


@pytest.mark.parametrize(
    "case", [c for c in chosen_cases(None, quick=True) if c.name not in SLOW], ids=lambda c: c.name
)
def test_no_case_of_the_quick_catalogue_is_wrong(case):
    outcome = run_native(case, case.build(True), 20.0, BUDGET).outcome
    assert outcome.wrong == ()
    assert outcome.status == "ok" or outcome.message


def test_names_are_unique_and_every_case_says_what_is_hard():
    assert len(BY_NAME) == len(CATALOGUE)
    assert all(case.hard.endswith(".") for case in CATALOGUE)


@pytest.fixture(scope="module", params=[math.inf, 40.0], ids=["rigid", "compliant"])
def honest(request):
    """Four masses over a stop: a problem and its trajectory, in which nothing is wrong."""
    contact = stop("m2", 0.2, request.param)
    problem = Problem(chain(4), [contact], 20.0, displacement=np.linspace(0.5, 2.0, 4))
    trajectory = simulate(problem.model(), 20.0, problem.displacement)
    assert judge(problem, trajectory, BUDGET).complaints(1.0) == []
    assert len(trajectory.events) > 6
    return problem, trajectory


def complaints(problem, trajectory):
    return " ".join(judge(problem, trajectory, BUDGET).complaints(1.0))


def right(name):
    """A case of the catalogue and its trajectory, in which nothing is wrong."""
    problem = BY_NAME[name].build(True)
    trajectory = simulate(problem.model(), problem.t_end, problem.displacement, None, problem.loads)
    assert complaints(problem, trajectory) == ""
    assert len(trajectory.events) > 2
    return problem, trajectory


class TestTheJudgeSees:
    def test_a_gap_that_is_not_the_models(self, honest):
        problem, trajectory = honest
        contact = dataclasses.replace(problem.contacts[0], gap=problem.contacts[0].gap - 1e-6)
        shifted = dataclasses.replace(problem, contacts=[contact])
        assert "m beyond the contact law" in complaints(shifted, trajectory)
        assert "without an event" in complaints(shifted, trajectory)

    @pytest.mark.parametrize("kind", ["close", "open"])
    def test_an_event_that_is_not_told(self, honest, kind):
        problem, trajectory = honest
        lost = next(
            e for e in trajectory.events if e.kind == kind and e.time in {s.start for s in trajectory.segments[2:]}
        )
        others = tuple(event for event in trajectory.events if event is not lost)
        found = judge(problem, dataclasses.replace(trajectory, events=others), BUDGET)
        assert found.missed == 1

    def test_a_closing_that_is_stepped_over(self, honest):
        problem, trajectory = honest
        first = trajectory.segments[0]
        passed = dataclasses.replace(first, end=trajectory.t_end)
        through = dataclasses.replace(trajectory, segments=Segments((passed,)), events=())
        assert judge(problem, through, BUDGET).missed >= 1

    def test_an_energy_that_nobody_gave(self, honest):
        problem, trajectory = honest
        start = dataclasses.replace(trajectory.start, velocity=trajectory.start.velocity + 1e-4)
        assert "ledger: residual" in complaints(problem, dataclasses.replace(trajectory, start=start))

    def test_a_loss_that_is_not_in_the_ledger(self):
        problem = Problem(chain(4), [stop("m2", 0.2)], 20.0, displacement=np.linspace(0.5, 2.0, 4))
        trajectory = simulate(problem.model(), 20.0, problem.displacement)
        free = [dataclasses.replace(e, loss=e.loss._replace(impact=0.0)) for e in trajectory.events]
        assert "ledger: residual" in complaints(problem, dataclasses.replace(trajectory, events=tuple(free)))

    def test_a_force_that_is_not_the_law(self):
        problem = Problem(chain(4), [stop("m2", 0.2, 40.0)], 20.0, displacement=np.linspace(0.5, 2.0, 4))
        trajectory = simulate(problem.model(), 20.0, problem.displacement)
        stiffer = dataclasses.replace(problem, contacts=[dataclasses.replace(problem.contacts[0], stiffness=41.0)])
        assert "m beyond the contact law" in complaints(stiffer, trajectory)

    def test_a_rigid_contact_that_pulls(self):
        problem = Problem(chain(2), [stop("m1", -0.5)], 4.0, displacement=np.array([0.25, 0.5]))
        trajectory = simulate(problem.model(), 4.0, problem.displacement)
        assert complaints(problem, trajectory) == ""
        pulled = [dataclasses.replace(s, level=_with_forces(s.level, -1.0)) for s in trajectory.segments]
        assert "pulls" in complaints(problem, dataclasses.replace(trajectory, segments=Segments(pulled)))


def test_a_user_object_is_right_or_wrong_or_too_coarse(honest):
    problem, trajectory = honest
    right = run_user_object(problem, trajectory, 8000, 20.0)
    assert (right.status, right.wrong, right.message) == ("ok", (), "")
    assert right.difference < 1e-6
    elsewhere = dataclasses.replace(problem, contacts=[stop("m2", 0.3, problem.contacts[0].stiffness)])
    wrong = run_user_object(elsewhere, trajectory, 8000, 20.0)
    assert wrong.status == "ok"
    assert wrong.wrong[0].startswith("differs from native by ")
    coarse = run_user_object(problem, trajectory, 30, 20.0)
    assert (coarse.status, coarse.wrong) == ("failed", ())
    assert "differs from native by " in coarse.message
    assert "30 steps allowed" in coarse.message


@pytest.mark.parametrize("name", ["viscous-closes-again-inside", "viscous-overdamped"])
def test_what_a_damped_stop_gives_back_as_it_closes_again_is_no_error_of_the_energy(name):
    case = BY_NAME[name]
    assert run_native(case, case.build(True), 20.0, BUDGET).outcome.energy < 1e-12


def test_what_a_damped_stop_takes_as_it_opens_is_no_rise_of_the_energy():
    """The spring of a viscous contact is still pressed where its force is zero; its energy is lost there."""
    contact = UnilateralContact("stop", {"m0": 1.0}, 0.1, 400.0, damping=9.0)
    run = simulate(MultiPhiModel(chain(1), [contact], modes="all"), 0.2, displacement=[-0.11], velocity=[0.2])
    assert [event.kind for event in run.events] == ["open"]
    assert run.events[0].loss.damping > 1e-6
    assert energy_rise(run, run.segments) < 1e-12


class TestTheJudgeKnowsFriction:
    """Each case is right, and wrong as soon as the problem's friction is another than the trajectory's."""

    @pytest.mark.parametrize(
        ("name", "changed", "said"),
        [
            ("friction-decays", {"limit": 100.0 * (1 + 1e-6)}, "friction off its law"),
            ("friction-lets-go", {"static_limit": 99.9}, "friction off its law"),
            ("friction-lets-go", {"stiffness": 1.001e5}, "m beyond the contact law"),
            ("friction-belt", {"velocity": 0.1001}, "m beyond the contact law"),
        ],
    )
    def test_that_is_another(self, name, changed, said):
        problem, trajectory = right(name)
        other = dataclasses.replace(problem.contacts[0], **changed)
        assert said in complaints(dataclasses.replace(problem, contacts=[other]), trajectory)

    def test_whose_events_are_not_told(self):
        problem, trajectory = right("friction-lets-go")
        for lost in range(2, 6):
            others = tuple(event for k, event in enumerate(trajectory.events) if k != lost)
            found = judge(problem, dataclasses.replace(trajectory, events=others), BUDGET)
            assert found.missed == 1

    @pytest.mark.parametrize("name", ["friction-decays", "friction-lets-go-rigid", "friction-belt"])
    def test_in_exudyn_too(self, name):
        problem, trajectory = right(name)
        outcome = run_user_object(problem, trajectory, 8000, 20.0)
        assert outcome.status == "ok", outcome.message
        assert outcome.difference < 1e-3
        assert outcome.events == len(trajectory.events)


class TestTheJudgeKnowsLaws:
    """Each case is right, and wrong as soon as the problem's law is another than the trajectory's."""

    def told_of(self, name, **changed):
        problem, trajectory = right(name)
        contacts = [dataclasses.replace(problem.contacts[0], **changed), *problem.contacts[1:]]
        return complaints(dataclasses.replace(problem, contacts=contacts), trajectory)

    @pytest.mark.parametrize("damping", [40.0, 60.0])
    def test_of_a_damper_that_is_another(self, damping):
        told = self.told_of("viscous-closes-again-inside", damping=damping)
        assert "m beyond the contact law" in told
        assert "without an event" in told

    def test_of_a_viscous_contact_that_pulls(self):
        problem, trajectory = right("viscous-closes-again-inside")
        i = next(i for i, s in enumerate(trajectory.segments) if s.level.level.indices and s.end < trajectory.t_end)
        held = dataclasses.replace(trajectory.segments[i], end=trajectory.segments[i + 1].end)
        segments = (*trajectory.segments[:i], held, *trajectory.segments[i + 2 :])
        told = complaints(problem, dataclasses.replace(trajectory, segments=Segments(segments)))
        assert "a contact pulls" in told

    def test_of_a_force_law_whose_springs_are_not_its_own(self):
        problem, trajectory = right("law-clearance-both-sides")
        knots, forces = problem.contacts[0].law
        harder = dataclasses.replace(problem.contacts[0], law=(knots, 1.001 * forces))
        assert "m beyond the contact law" in complaints(dataclasses.replace(problem, contacts=[harder]), trajectory)

    def test_of_links_that_do_not_add_up_to_their_law(self):
        problem = BY_NAME["law-clearance-both-sides"].build(True)
        law = problem.contacts[0]
        vars(law)["_below"] = ()
        trajectory = simulate(problem.model(), problem.t_end, problem.displacement)
        assert "m beyond the contact law" in complaints(problem, trajectory)

    @pytest.mark.parametrize("name", ["moving-stop-compliant", "moving-stop-viscous", "moving-base-fixed-rigid-stop"])
    def test_of_a_stop_that_moves_otherwise(self, name):
        problem, trajectory = right(name)
        assert "m beyond the contact law" in complaints(dataclasses.replace(problem, loads=[]), trajectory)

    def test_of_an_energy_below_zero(self):
        problem, trajectory = right("law-leaves-unstable-rest")
        assert trajectory.ledger.initial < 0
        start = dataclasses.replace(trajectory.start, velocity=trajectory.start.velocity + 1e-4)
        assert "ledger: residual" in complaints(problem, dataclasses.replace(trajectory, start=start))


def _with_forces(loaded, factor):
    rest = dataclasses.replace(loaded.asymptotic, forces=factor * loaded.asymptotic.forces)
    return dataclasses.replace(loaded, asymptotic=rest)


def test_a_truncated_depth_that_is_not_reported_is_wrong():
    model, random = random_model(169, kind="mixed")
    velocity = random.normal(size=model.structure.n) * 3
    problem = Problem(model.structure, model.contacts, 20.0, model.modes, velocity=velocity)
    trajectory = simulate(problem.model(), 20.0, velocity=velocity)
    found = judge(problem, trajectory, BUDGET)
    assert found.truncated
    assert found.complaints(1.0) == []
    assert_allclose(found.reported, found.open_depth, rtol=0.05)
    assert "m reported" in " ".join(dataclasses.replace(found, reported=0.0).complaints(1.0))


def test_an_answer_does_not_depend_on_the_unit_of_length():
    case = BY_NAME["units-mm-N-t"]
    problem = case.build(True)
    trajectory = simulate(problem.model(), problem.t_end, problem.displacement, None, problem.loads)
    assert case.check(problem, trajectory) == ""
    late = [dataclasses.replace(event, time=event.time + 1e-6) for event in trajectory.events]
    assert "apart" in case.check(problem, dataclasses.replace(trajectory, events=tuple(late)))


def test_a_case_s_own_check_sees_a_wrong_closed_form():
    case = BY_NAME["zero-gap-compliant"]
    problem = case.build(True)
    soft = dataclasses.replace(problem.contacts[0], stiffness=problem.contacts[0].stiffness * (1 + 1e-6))
    other = simulate(MultiPhiModel(problem.structure, [soft], "all"), problem.t_end, problem.displacement)
    assert "closed form" in case.check(problem, other)


class TestOutcomes:
    PROBLEM = Problem(chain(2), [stop("m1", 0.1, 50.0)], 10.0, displacement=np.array([0.1, 0.3]))
    CASE = Case("small", "Nothing is.", lambda quick: TestOutcomes.PROBLEM)

    def native(self, monkeypatch, simulate=simulate, limit_s=20.0):
        monkeypatch.setattr(native_run, "simulate", simulate)
        return run_native(self.CASE, self.PROBLEM, limit_s, BUDGET).outcome

    def test_a_failure_of_the_model_s_own_is_not_wrong(self, monkeypatch):
        def failing(*given, **options):
            raise NumericalFailure("no closed form")

        outcome = self.native(monkeypatch, failing)
        assert (outcome.status, outcome.message, outcome.wrong) == ("failed", "no closed form", ())

    def test_any_other_exception_is_wrong(self, monkeypatch):
        def crashing(*given, **options):
            raise ZeroDivisionError("float division")

        outcome = self.native(monkeypatch, crashing)
        assert outcome.status == "failed"
        assert "ZeroDivisionError: float division" in outcome.wrong[0]

    def test_a_run_that_takes_too_long_has_failed_with_its_limit(self, monkeypatch):
        def endless(*given, **options):
            while True:
                pass

        assert self.native(monkeypatch, endless, 0.05).message == "time limit of 0.05 s"

    def test_every_model_of_a_small_case_agrees_with_the_native_one(self):
        result = run_case(self.CASE, QUICK)
        native, body, full = result.outcomes
        assert [o.status for o in result.outcomes] == ["ok", "ok", "ok"]
        assert body.difference < 1e-6
        assert full.difference < 1e-3
        assert body.events == native.events > 0

    def test_a_rigid_contact_has_no_full_model_unless_a_penalty_stands_in(self):
        rigid = dataclasses.replace(self.PROBLEM, contacts=[stop("m1", 0.1)])
        case = dataclasses.replace(self.CASE, build=lambda quick: rigid)
        assert run_case(case, QUICK).outcomes[-1].status == "not run"
        stiff = dataclasses.replace(rigid, penalty=1e4)
        outcome = run_case(dataclasses.replace(case, build=lambda quick: stiff), QUICK).outcomes[-1]
        assert (outcome.status, "penalty of 10000" in outcome.message) == ("ok", True)


class TestFullMatrices:
    def test_it_converges_to_the_native_answer_as_the_step_falls(self):
        structure, contact = chain(3, damping=0.02 * np.eye(3)), stop({"m2": -2.0}, 0.3, 7.0)
        start = np.array([0.5, 0.2, -0.5])
        exact = simulate(MultiPhiModel(structure, [contact], "all"), 12.0, start)
        assert len(exact.events) > 1
        errors = []
        for steps in (2000, 8000, 32000):
            run = run_matrices(structure, [contact], 12.0, steps, displacement=start, damping=structure.damping)
            errors.append(np.max(np.abs(run.gaps["stop"] - exact.gap("stop", np.minimum(run.time, 12.0)))))
        assert errors[-1] < 5e-6
        assert errors[0] / errors[-1] > 100  # second order but for the instants of contact: 256

    @pytest.mark.parametrize("name", ["law-clearance-both-sides", "viscous-closes-again-inside"])
    def test_laws_and_viscous_contacts_converge_to_the_native_answer(self, name):
        problem = BY_NAME[name].build(True)
        start, end = problem.displacement, 0.1
        exact = simulate(problem.model(), end, start)
        assert len(exact.events) > 1
        given = problem.structure, problem.penalty_contacts, end
        errors, part = [], problem.parts[0].name
        for steps in (1000, 8000):
            run = run_matrices(*given, steps, displacement=start, laws=problem.laws)
            errors.append(np.max(np.abs(run.gaps[part] - exact.gap(part, np.minimum(run.time, end)))))
        assert errors[-1] < 2e-3 * np.max(np.abs(start))
        assert errors[0] / errors[-1] > 20  # second order but for the instants of contact: 64

    def test_a_law_s_energy_is_kept(self):
        problem = BY_NAME["law-magnet"].build(True)
        start = problem.displacement
        run = run_matrices(problem.structure, [], 0.1, 2000, displacement=start, laws=problem.laws)
        assert np.ptp(run.energy) < 1e-5 * np.max(run.kinetic)
        exact = simulate(problem.model(), 0.1, start)
        assert_allclose(run.energy[0], exact.ledger.initial, rtol=1e-9)

    def test_a_load_that_varies_does_the_work_that_the_energy_shows(self):
        structure = chain(2)
        run = run_matrices(
            structure,
            [],
            5.0,
            5000,
            varying=lambda t: np.array([[0.0], [1.0]]) * np.cos(3 * t),
            load=np.array([0.2, 0.0]),
        )
        assert np.max(np.abs(run.energy - run.work)) < 1e-5
        assert np.max(run.energy) > 0.1

    @pytest.mark.parametrize("contact", [stop("m1", 0.1), stop({"m0": 1.0, "m1": 1.0}, 0.1, 5.0)])
    def test_a_contact_it_cannot_have_is_refused(self, contact):
        with pytest.raises(MultiPhiValueError, match="need a finite one on one coordinate"):
            run_matrices(chain(2), [contact], 1.0, 10)


RESULTS = [
    CaseResult(
        "sound",
        "Nothing.",
        (Outcome("native", residual=1e-15, events=3), Outcome("user object", "failed", "a cause")),
    ),
    CaseResult("broken", "All & <everything>.", (Outcome("native", wrong=("2 closings without an event",)),)),
]


class TestTables:
    def test_text_and_page_hold_every_case_every_cause_and_what_is_wrong(self):
        page = render_stability(RESULTS, {}, quick=True)
        for text in (text_table(RESULTS), page):
            for expected in ("sound", "broken", "a cause", "2 closings without an event", "WRONG", "wrong: broken"):
                assert expected in text
        assert "All &amp; &lt;everything&gt;." in page
        assert "http" not in page

    def test_the_json_holds_every_figure(self):
        found = json.loads(json.dumps(contents(RESULTS, {}, quick=False), allow_nan=False))
        assert found["cases"]["sound"]["models"]["native"]["residual"] == 1e-15
        assert found["cases"]["broken"]["wrong"] is True
        assert [(m["model"], m["ok"], m["failed"], m["wrong"]) for m in found["models"]] == [
            ("native", 2, 0, 1),
            ("user object", 0, 1, 0),
        ]

    def test_the_worst_figures_and_the_failed_runs_lead_to_their_cases(self):
        far = CaseResult("far", "Far.", (Outcome("native", energy=1e-3), Outcome("user object", difference=0.5)))
        near = CaseResult("near", "Near.", (Outcome("native", energy=1e-9), Outcome("user object", difference=0.1)))
        loop, body = summaries([near, far])
        assert (loop["energy_case"], loop["difference_case"]) == ("far", "")
        assert (body["energy_case"], body["difference_case"]) == ("", "far")
        assert [(case, o.model, o.message) for case, o in failures(RESULTS)] == [("sound", "user object", "a cause")]
        page = render_stability([near, far, *RESULTS], {}, quick=True)
        for name in ("far", "sound"):
            assert f'<a href="#{name}">{name}</a>' in page
            assert f'id="{name}"' in page


class TestCommand:
    @pytest.fixture(autouse=True)
    def _fast(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)

    def test_one_case_writes_page_table_and_figures(self, tmp_path, capsys):
        assert cli.main(["stability", "--quick", "--case", "grazing-1e-12-below-rigid"]) == 0
        folder = tmp_path / "multiphi-stability-quick"
        assert {path.name for path in folder.iterdir()} == {"report.html", "summary.json", "table.txt"}
        told = capsys.readouterr().out
        assert "grazing-1e-12-below-rigid" in told
        assert "1 cases, none wrong" in told
        assert "grazing-1e-12-below-rigid" in (folder / "report.html").read_text("utf-8")

    def test_a_wrong_case_is_exit_code_1_and_still_a_report(self, tmp_path, monkeypatch, capsys):
        broken = Case("broken", "Its check.", TestOutcomes.CASE.build, lambda problem, trajectory: "not what was asked")
        monkeypatch.setattr(catalogue_run, "CATALOGUE", (BY_NAME["zero-gap-rigid"], broken))
        assert cli.main(["stability", "--out", "out"]) == 1
        assert "WRONG: not what was asked" in capsys.readouterr().out
        assert "not what was asked" in (tmp_path / "out" / "report.html").read_text("utf-8")

    def test_an_unknown_case_is_exit_code_2_and_one_line(self, tmp_path, capsys):
        assert cli.main(["stability", "--case", "easy"]) == 2
        err = capsys.readouterr().err
        assert err.startswith("--case: got 'easy', need one of: zero-gap-compliant, ")
        assert err.count("\n") == 1
        assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_no_model_is_wrong_in_the_whole_catalogue():
    for case in chosen_cases(None, quick=False):
        result = run_case(case, dataclasses.replace(QUICK, quick=False))
        assert not result.wrong, result
