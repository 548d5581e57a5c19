"""The catalogue of extreme cases: nothing in it is wrong, and what would be wrong is seen."""

import dataclasses
import json
import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, stop

from multiphi_exudyn import MultiPhiModel, cli, simulate
from multiphi_exudyn.errors import MultiPhiValueError, NumericalFailure
from multiphi_exudyn.study import stability
from multiphi_exudyn.study.stability import (
    QUICK,
    CaseResult,
    Outcome,
    chosen_cases,
    contents,
    render_stability,
    run_case,
    run_native,
    run_user_object,
    text_table,
)
from reference_models.extreme_case import Case, Problem
from reference_models.extreme_cases import CATALOGUE
from reference_models.full_matrices import run_matrices

SLOW = {"many-events", "1000-seconds", "elements-1000"}  # seconds each; the command runs them
BY_NAME = {case.name: case for case in CATALOGUE}


@pytest.mark.parametrize(
    "case", [c for c in chosen_cases(None, quick=True) if c.name not in SLOW], ids=lambda c: c.name
)
def test_no_case_of_the_quick_catalogue_is_wrong(case):
    outcome, _ = run_native(case, case.build(True), 20.0)
    assert outcome.wrong == ()
    assert outcome.status == "ok" or outcome.message


def test_names_are_unique_and_every_case_says_what_is_hard():
    assert len(BY_NAME) == len(CATALOGUE)
    assert all(case.hard.endswith(".") for case in CATALOGUE)


def right(name):
    """A case of the catalogue, its problem and its trajectory, in which nothing is wrong."""
    case = BY_NAME[name]
    problem = case.build(True)
    outcome, trajectory = run_native(case, problem, 20.0)
    assert (outcome.status, outcome.wrong) == ("ok", ())
    return case, problem, trajectory


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        ("zero-gap-compliant", {"stiffness": 900.0 * (1 + 1e-6)}),
        ("zero-gap-rigid", {"gap": -1e-6}),
        ("friction-decays", {"limit": 100.0 * (1 + 1e-6)}),
        ("friction-lets-go", {"static_limit": 99.9}),
        ("friction-lets-go", {"stiffness": 1.001e5}),
        ("friction-belt", {"velocity": 0.1001}),
        ("viscous-closes-again-inside", {"damping": 40.0}),
    ],
)
def test_an_answer_to_another_case_is_wrong(monkeypatch, name, changed):
    """Every law of the case is judged: the model solves a case whose contact is another one than it is judged by."""
    case, problem, trajectory = right(name)
    other = dataclasses.replace(problem.contacts[0], **changed)
    asked = dataclasses.replace(trajectory.model, contacts=[other, *problem.contacts[1:]])
    monkeypatch.setattr(stability, "simulate", lambda *given: dataclasses.replace(trajectory, model=asked))
    assert run_native(dataclasses.replace(case, check=None), problem, 20.0)[0].wrong


@pytest.mark.parametrize("name", ["moving-stop-compliant", "moving-stop-viscous", "moving-base-fixed-rigid-stop"])
def test_an_answer_for_a_stop_that_moves_otherwise_is_wrong(monkeypatch, name):
    case, problem, trajectory = right(name)
    monkeypatch.setattr(stability, "simulate", lambda *given: trajectory)
    assert run_native(case, dataclasses.replace(problem, loads=[]), 20.0)[0].wrong


def test_an_event_that_is_not_told_is_wrong(monkeypatch):
    case, problem, trajectory = right("friction-lets-go")
    for lost in range(2, 6):
        others = tuple(event for k, event in enumerate(trajectory.events) if k != lost)
        silent = dataclasses.replace(trajectory, events=others)
        monkeypatch.setattr(stability, "simulate", lambda *given, run=silent: run)
        assert any("without an event" in text for text in run_native(case, problem, 20.0)[0].wrong)


def test_a_check_of_its_own_sees_a_wrong_closed_form():
    case, problem, trajectory = right("units-mm-N-t")
    assert case.check(problem, trajectory) == ""
    late = [dataclasses.replace(event, time=event.time + 1e-6) for event in trajectory.events]
    assert "apart" in case.check(problem, dataclasses.replace(trajectory, events=tuple(late)))


def test_a_lawful_rise_of_energy_is_told_with_its_cause():
    case = BY_NAME["viscous-closes-again-inside"]
    outcome, _ = run_native(case, case.build(True), 20.0)
    assert outcome.energy < 1e-12
    assert "a damped stop that closes again inside gives back" in outcome.message


@pytest.mark.parametrize("stiffness", [math.inf, 40.0])
def test_a_user_object_is_right_or_wrong_or_too_coarse(stiffness):
    problem = Problem(chain(4), [stop("m2", 0.2, stiffness)], 20.0, displacement=np.linspace(0.5, 2.0, 4))
    trajectory = simulate(problem.model(), 20.0, problem.displacement)
    found = run_user_object(problem, trajectory, 8000, 20.0)
    assert (found.status, found.wrong, found.message) == ("ok", (), "")
    assert found.difference < 1e-6
    elsewhere = dataclasses.replace(problem, contacts=[stop("m2", 0.3, stiffness)])
    wrong = run_user_object(elsewhere, trajectory, 8000, 20.0)
    assert wrong.wrong[-1].startswith("differs from native by ")
    coarse = run_user_object(problem, trajectory, 30, 20.0)
    assert (coarse.status, coarse.wrong) == ("failed", ())
    assert "30 steps allowed" in coarse.message


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"contact_force": {"stop": lambda values: -values}}, "pulls"),
        ({"gaps": {"stop": lambda values: values - 0.1}}, "is closed with a gap"),
        ({"closed": {"stop": lambda values: 0 * values}, "gaps": {"stop": lambda values: values - 0.1}}, "is open"),
    ],
)
def test_a_user_object_that_breaks_a_law_at_its_steps_is_wrong(monkeypatch, changed, said):
    problem = Problem(chain(4), [stop("m2", 0.2)], 20.0, displacement=np.linspace(0.5, 2.0, 4))
    trajectory = simulate(problem.model(), 20.0, problem.displacement)
    solve = stability.solve_body_alone

    def other(*given, **options):
        histories, time_s = solve(*given, **options)
        fields = {
            field: {name: change(np.asarray(getattr(histories, field)[name])) for name, change in changes.items()}
            for field, changes in changed.items()
        }
        return dataclasses.replace(histories, **fields), time_s

    monkeypatch.setattr(stability, "solve_body_alone", other)
    assert any(said in text for text in run_user_object(problem, trajectory, 8000, 20.0).wrong)


@pytest.mark.parametrize("name", ["friction-decays", "friction-lets-go-rigid", "friction-belt"])
def test_friction_is_the_same_in_exudyn(name):
    _, problem, trajectory = right(name)
    outcome = run_user_object(problem, trajectory, 8000, 20.0)
    assert (outcome.status, outcome.wrong) == ("ok", ()), outcome.message
    assert outcome.difference < 1e-3
    assert outcome.events == len(trajectory.events)


class TestOutcomes:
    PROBLEM = Problem(chain(2), [stop("m1", 0.1, 50.0)], 10.0, displacement=np.array([0.1, 0.3]))
    CASE = Case("small", "Nothing is.", lambda quick: TestOutcomes.PROBLEM)

    def native(self, monkeypatch, simulate, limit_s=20.0):
        monkeypatch.setattr(stability, "simulate", simulate)
        return run_native(self.CASE, self.PROBLEM, limit_s)[0]

    def test_a_failure_of_the_model_s_own_is_not_wrong_and_any_other_exception_is(self, monkeypatch):
        def raising(error):
            def run(*given, **options):
                raise error

            return run

        outcome = self.native(monkeypatch, raising(NumericalFailure("no closed form")))
        assert (outcome.status, outcome.message, outcome.wrong) == ("failed", "no closed form", ())
        outcome = self.native(monkeypatch, raising(ZeroDivisionError("float division")))
        assert outcome.status == "failed"
        assert "ZeroDivisionError: float division" in outcome.wrong[0]

    def test_a_run_that_takes_too_long_has_failed_with_its_limit(self, monkeypatch):
        def endless(*given, **options):
            while True:
                pass

        assert self.native(monkeypatch, endless, 0.05).message == "time limit of 0.05 s"

    def test_every_model_of_a_small_case_agrees_with_the_native_one(self):
        native, body, full = run_case(self.CASE, QUICK).outcomes
        assert [o.status for o in (native, body, full)] == ["ok", "ok", "ok"]
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


SOUND = (Outcome("native", residual=1e-15, energy=1e-3), Outcome("user object", "failed", "a cause"))
BROKEN = (
    Outcome("native", wrong=("2 closings without an event",), energy=1e-9),
    Outcome("user object", difference=0.5),
)
RESULTS = [CaseResult("sound", "Nothing.", SOUND), CaseResult("broken", "All & <everything>.", BROKEN)]


class TestTables:
    def test_text_and_page_hold_every_case_every_cause_and_what_is_wrong(self):
        page = render_stability(RESULTS, {}, quick=True)
        for text in (text_table(RESULTS), page):
            for expected in ("sound", "broken", "a cause", "2 closings without an event", "WRONG", "wrong: broken"):
                assert expected in text
        assert "All &amp; &lt;everything&gt;." in page
        assert "http" not in page
        for name in ("sound", "broken"):
            assert f'<a href="#{name}">{name}</a>' in page
            assert f'id="{name}"' in page

    def test_the_json_holds_every_figure(self):
        found = json.loads(json.dumps(contents(RESULTS, {}, quick=False), allow_nan=False))
        assert found["cases"]["sound"]["models"]["native"]["residual"] == 1e-15
        assert found["cases"]["broken"]["wrong"] is True
        native, body = found["models"]
        assert [(m["ok"], m["failed"], m["wrong"]) for m in (native, body)] == [(2, 0, 1), (1, 1, 0)]
        assert (native["energy_case"], native["difference_case"], body["difference_case"]) == ("sound", "", "broken")


class TestCommand:
    @pytest.fixture(autouse=True)
    def _folder(self, tmp_path, monkeypatch):
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
        monkeypatch.setattr(stability, "CATALOGUE", (BY_NAME["zero-gap-rigid"], broken))
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
