"""Warnings of many runs: kept with every run, grouped by kind, shown by reports and commands, issued once."""

import json
import re
import sys
import threading
import warnings
from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
from small_scene import BEAM, write
from small_structures import oscillator
from small_study import ENVIRONMENT, METHODS, result_of, row

import multiphi_exudyn as mp
from multiphi_exudyn import cli
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from multiphi_exudyn.study import accuracy_report, report
from multiphi_exudyn.study.accuracy_report import render_study, study_warnings
from multiphi_exudyn.study.compare import compare, summary
from multiphi_exudyn.study.details import Details
from multiphi_exudyn.study.report import Picture, comparison_warnings, render
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.runs import from_arrays, to_arrays
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare
from multiphi_exudyn.study.stability import CaseResult, Outcome, text_table
from multiphi_exudyn.time.model_warnings import grouped, issue, kept_back
from multiphi_exudyn.time.trajectory import Trajectory
from reference_models.solver_settings import fixed_steps

LINEAR = "linear range: moments differ by 30 % at the largest rotation; take a nonlinear model"
SHARE = "static share: contact stop lacks 86 % of its flexibility; take more modes"


@pytest.fixture
def warning_runs(monkeypatch):
    """Every run warns twice, and is determined until half its time."""
    monkeypatch.setattr(sys.modules["multiphi_exudyn.time.simulate"], "warnings_of", lambda *given: (LINEAR, SHARE))
    monkeypatch.setattr(Trajectory, "horizon", lambda self, tolerance: 0.5 * self.t_end)


@pytest.fixture(autouse=True)
def no_pictures(monkeypatch):
    """Pages without them, which take most of their time."""
    monkeypatch.setattr(report, "_pictures", lambda comparison, levels: ())
    monkeypatch.setattr(accuracy_report, "_drawn", lambda figure, caption: None)
    monkeypatch.setattr(accuracy_report, "_along", lambda result, axis: (axis, Picture("", ""), []))


@pytest.fixture
def scene_file(tmp_path):
    return write(tmp_path / "small.toml", BEAM)


def bench_of(scene_file):
    scene = load_scene(scene_file)
    return prepare(scene)


def text_of(page):
    """What is read: without tags and pictures."""
    return " ".join(re.sub(r"<style>.*?</style>|<[^>]+>", " ", page, flags=re.DOTALL).split())


def test_what_one_thread_keeps_back_another_issues():
    with warnings.catch_warnings(record=True) as issued:
        warnings.simplefilter("always")
        with kept_back():
            issue([SHARE])
            other = threading.Thread(target=issue, args=([LINEAR],))
            other.start()
            other.join()
        issue([SHARE])
    assert [str(each.message) for each in issued] == [LINEAR, SHARE]


def test_warnings_are_grouped_by_what_stands_before_the_first_colon():
    groups = grouped([("a", [SHARE, LINEAR]), ("b", []), ("c", [SHARE.replace("86", "7"), SHARE])])
    assert [(group.kind, group.runs) for group in groups] == [("static share", ("a", "c")), ("linear range", ("a",))]
    assert groups[0].told(3) == f"static share: 2 of 3 runs (a, c); the first: {SHARE.partition(': ')[2]}"
    assert groups[1].told(1) == LINEAR
    assert grouped([("a", ()), ("b", ())]) == ()


def test_a_large_group_names_its_first_runs_only():
    (group,) = grouped([(f"r = {r}", [SHARE]) for r in range(8)])
    assert group.told(20).startswith("static share: 8 of 20 runs (r = 0, r = 1, r = 2 and 5 more); the first: ")


def test_a_model_run_keeps_its_warnings_and_issues_none(warning_runs, scene_file):
    with warnings.catch_warnings():
        warnings.simplefilter("error", mp.MultiPhiWarning)
        run = run_model(bench_of(scene_file), "r6", horizon=True)
    assert run.warnings == (LINEAR, SHARE)
    assert run.horizon_s == {"0.01": 0.05}
    again = from_arrays(to_arrays(run))
    assert (again.warnings, again.horizon_s) == (run.warnings, run.horizon_s)
    assert run_model(bench_of(scene_file), "r6").horizon_s == {}


def test_a_comparison_shows_what_its_models_warn_of_first(warning_runs, scene_file):
    comparison = compare(bench_of(scene_file), ENVIRONMENT, progress=False)
    models = summary(comparison)["models"]
    assert {name: (each["warnings"], each["horizon_s"]) for name, each in models.items()} == dict.fromkeys(
        ("all", "r6"), ([LINEAR, SHARE], {"0.01": 0.05})
    )
    told = comparison_warnings(comparison)
    assert told[0] == "linear range: 2 of 2 runs (all, r6); the first: " + LINEAR.partition(": ")[2]
    assert told[1].startswith("static share: 2 of 2 runs (all, r6); ")
    assert told[2].startswith(
        "sensitivity: 2 of 2 runs are not determined to their end: with a start changed by 1e-12 they differ by 1 %, "
        "all from 0.05 s on"
    )
    assert len(told) == 3
    page = text_of(render(comparison, Details()))
    assert page.index("Linear range: 2 of 2 runs (all, r6); the first: moments") < page.index("Key figures")
    assert "sensitivity horizon" in page


def test_a_model_that_warns_of_nothing_is_shown_without_a_word(scene_file, monkeypatch):
    monkeypatch.setattr(sys.modules["multiphi_exudyn.time.simulate"], "warnings_of", lambda *given: ())
    monkeypatch.setattr(Trajectory, "horizon", lambda self, tolerance: self.t_end)
    comparison = compare(bench_of(scene_file), ENVIRONMENT, progress=False)
    assert comparison_warnings(comparison) == []
    assert "whole run" in text_of(render(comparison, Details()))


def test_a_comparison_prints_a_line_for_each_and_issues_none(warning_runs, scene_file, tmp_path, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error", mp.MultiPhiWarning)
        assert cli.main(["compare", scene_file, "--out", str(tmp_path / "report")]) == 0
    assert sum(line.startswith("warning: ") for line in capsys.readouterr().out.splitlines()) == 3


def test_a_study_keeps_the_warnings_of_every_run(warning_runs, tmp_path, capsys):
    write(tmp_path / "small.toml", BEAM)
    method = {"name": "levels", "model": {"kind": "reduced"}, "axes": {"modes": [2, 4]}}
    study = {"title": "small", "scene": "small.toml", "axes": {"start.displacement": [0.01, 0.005]}}
    file = write(tmp_path / "study.toml", study | {"methods": [method], "timing": False})
    assert cli.main(["study", file, "--on", "serial", "--out", str(tmp_path / "out")]) == 0
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("warning: ")]
    assert told[0].startswith("warning: linear range: 6 of 6 runs (reference (start.displacement = 0.01) and 5 more); ")
    assert told[2].startswith("warning: sensitivity: 2 of 2 runs are not determined")  # at the first point alone
    heads, *lines = (tmp_path / "out" / "runs.csv").read_text().splitlines()
    assert {"warnings", "horizon_s.0.01"} <= set(heads.split(","))
    assert all(json.dumps(LINEAR).replace('"', '""') in line for line in lines)
    assert "Linear range: 6 of 6 runs" in text_of((tmp_path / "out" / "report.html").read_text())


def test_a_studys_page_names_the_rows_of_each_kind():
    rows = [row("reference")]
    rows += [row("Multi-Phi", 0.1, setting={"modes": r}, warnings=[SHARE] if r < 6 else []) for r in (3, 4, 6)]
    result = result_of(rows, methods=METHODS)
    (told,) = study_warnings(result)
    assert (
        told
        == f"static share: 2 of 4 runs (Multi-Phi (r = 3), Multi-Phi (r = 4)); the first: {SHARE.partition(': ')[2]}"
    )
    assert "Static share: 2 of 4 runs" in text_of(render_study(result))


def test_the_catalogue_prints_what_its_models_warn_of():
    outcomes = (Outcome("native", warnings=(SHARE,)), Outcome("full model"))
    told = text_table([CaseResult("clamp", "hard", outcomes)])
    assert f"warning: static share: 1 of 2 runs (clamp, native); the first: {SHARE[14:]}" in told


# ---------------------------------------------------------------------- bodies in Exudyn


def struck(modes):
    """Three masses, the last one thrown at a rigid stop."""
    stiffness = 1e4 * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    structure = mp.LinearStructure(np.eye(3), stiffness, points={"last": 2})
    return mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "last", 1e-3)], modes=modes)


def added(modes):
    """A system with one body, and the body's items."""
    mbs = exu.SystemContainer().AddSystem()
    items = CreateMultiPhiBody(mbs, struck(modes), name="masses", velocity=np.array([0.0, 0.0, -1.0]))
    mbs.Assemble()
    return mbs, items


def solve(mbs, end=0.05):
    mbs.SolveDynamic(fixed_steps(end, 500), solverType=exu.DynamicSolverType.TrapezoidalIndex2)


@pytest.mark.usefixtures("quiet_exudyn")
def test_a_truncated_body_warns_once_at_the_end_of_every_run():
    mbs, items = added(modes=1)
    body = mbs.variables["multiPhi"]["masses"]
    for _ in range(2):
        with pytest.warns(mp.MultiPhiWarning) as issued:
            solve(mbs)
        assert [str(each.message) for each in issued] == [f"{each} (body 'masses')" for each in body.warnings]
        assert body_histories(mbs, items).warnings == body.warnings
    trajectory = mp.simulate(struck(1), 0.05, velocity=np.array([0.0, 0.0, -1.0]))
    ledger = trajectory.ledger
    share = 100 * (ledger.truncation_kinetic + ledger.truncation_strain) / ledger.initial
    assert body.warnings[0].startswith("lost energy: truncation took ")
    told = float(re.search(r"([\d.]+) %", body.warnings[0])[1])
    assert told == pytest.approx(share, rel=0.05)


@pytest.mark.usefixtures("quiet_exudyn")
def test_a_body_with_all_modes_does_not_warn():
    mbs, items = added(modes="all")
    with warnings.catch_warnings():
        warnings.simplefilter("error", mp.MultiPhiWarning)
        solve(mbs)
    assert len(body_histories(mbs, items).events) > 0
    assert mbs.variables["multiPhi"]["masses"].warnings == ()


# ---------------------------------------------------------------------- steady states

LOAD = mp.HarmonicLoad(np.array([1.0]), 1.0, 0.5)


def driven(validity):
    model = oscillator(gap=0.5, contact=200.0, damping=mp.ModalDamping([0.03]))
    return replace(model, validity=validity)


def beyond(limit):
    """Warns where the motion goes beyond a limit [m]."""

    def validity(trajectory):
        farthest = float(np.max(np.abs(trajectory.displacement(np.linspace(0, trajectory.t_end, 200)))))
        return (f"linear range: {farthest:.3g} m, the limit is {limit:g} m",) if farthest > limit else ()

    return validity


def test_a_steady_state_issues_each_kind_of_warning_once():
    with pytest.warns(mp.MultiPhiWarning) as issued:
        state = mp.steady_state(driven(beyond(0.01)), LOAD)
    assert state.warnings == state.trajectory.warnings
    assert [str(each.message) for each in issued] == list(state.warnings)
    assert len(issued) == 1
    assert issued[0].filename == __file__


def test_a_warning_of_the_way_to_a_steady_state_says_so():
    with pytest.warns(mp.MultiPhiWarning) as issued:
        state = mp.steady_state(driven(beyond(1.0)), LOAD, displacement=np.array([2.0]))
    assert state.status == "periodic"
    assert state.trajectory.warnings == ()
    assert state.warnings == ("linear range: before it settled, 2 m, the limit is 1 m",)
    assert len(issued) == 1


def test_a_frequency_response_issues_a_warning_for_each_kind_not_for_each_frequency():
    with pytest.warns(mp.MultiPhiWarning) as issued:
        response = mp.frequency_response(driven(beyond(0.3)), LOAD, [0.05, 0.1, 0.3, 0.32])
    (sentence,) = response.warnings
    assert re.match(r"linear range: 2 of 4 runs \(0.3 Hz, 0.32 Hz\); the first: 0\.\d+ m, the limit is 0.3 m", sentence)
    assert [str(each.message) for each in issued] == [sentence]
    assert response.states[0].warnings == ()
