"""Every model of a scene moves as the others do, under loads, laws and friction; its report tells of them."""

import dataclasses
import json
import math

import numpy as np
import pytest
from small_scene import BEAM, changed, write
from test_scenes import CUBIC, LAWS, LOADS, MOVED, R12, RECORD, at_rest, prepared, with_laws

import multiphi_exudyn as mp
from multiphi_exudyn import cli
from multiphi_exudyn.study.budget import budget
from multiphi_exudyn.study.compare import compare, histories, summary
from multiphi_exudyn.study.details import Details, details_of, level_modes, loss_tables
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.plots import grey_spans, history_figure
from multiphi_exudyn.study.report import findings, render
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare
from multiphi_exudyn.study.study_file import load_study

pytestmark = pytest.mark.usefixtures("few_elements")

BODY = {"kind": "user-object", "name": "body", "modes": 6, "step": 2e-4}
BASIS = {"kind": "global-basis", "name": "basis", "modes": 8}
FULL = {"kind": "full", "name": "full", "elements": 4, "step": 1e-4}
DAMPED = {"damping": {"modal_ratios": [0.05], "beyond": 0.05}}
VISCOUS = [BEAM["contacts"][0] | {"damping": 300.0}]
STOP_ON_ITS_WAY = MOVED | {"phase": -1.5, "amplitude": 2e-3}
TOUCHING = [  # loads under which the beam meets its stop
    *LOADS[:5],
    {"kind": "stop-motion", "contact": "stop", "course": STOP_ON_ITS_WAY},
    {"kind": "base-motion", "course": MOVED | {"amplitude": 4e-3}, "fixed_stops": ["stop"]},
    {"kind": "base-motion", "course": RECORD},
    {"kind": "stop-motion", "contact": "stop", "course": RECORD | {"factor": 4.0}},
]


def compared(folder, data):
    """The comparison of a scene all of whose models ran."""
    comparison = compare(prepared(folder, data), {}, progress=False)
    assert {name: run.message for name, run in comparison.runs.items()} == dict.fromkeys(comparison.runs, "")
    return comparison


def differences(comparison):
    """NRMSE of the tip to the reduced model of every other run."""
    own = comparison.runs["r12"]
    return {n: nrmse(run.points["tip"], own.points["tip"], own.time, 0.1) for n, run in comparison.runs.items()}


@pytest.mark.parametrize("load", TOUCHING, ids=lambda load: load["kind"])
def test_under_loads_reduced_user_object_and_full_model_move_as_one(tmp_path, load):
    """On the stop, without which nothing would tell a moving one; large displacements are what is left between them."""
    data = at_rest(load) | DAMPED | {"models": [*R12, BODY, FULL], "outputs": {"t_end": 0.1, "interval": 5e-4}}
    comparison = compared(tmp_path, data)
    runs, away = comparison.runs, differences(comparison)
    assert all(len(run.contact_intervals["stop"]) for run in runs.values())
    assert away["body"] < 0.05
    assert away["full"] < 0.03
    assert runs["full"].ledger["work_of_loads"] == pytest.approx(runs["r12"].ledger["work_of_loads"], rel=0.05)


@pytest.mark.parametrize("kind", LAWS)
def test_with_laws_reduced_user_object_global_basis_and_full_model_move_as_one(tmp_path, kind):
    data = with_laws(LAWS[kind][0]) | DAMPED | {"models": [*R12, BODY, BASIS, FULL]}
    away = differences(compared(tmp_path, data))
    assert max(away["body"], away["basis"]) < 1e-3
    assert away["full"] < 0.02


def test_a_viscous_stop_takes_as_much_in_every_model(tmp_path):
    comparison = compared(tmp_path, with_laws() | DAMPED | {"contacts": VISCOUS, "models": [*R12, BODY, BASIS, FULL]})
    away = differences(comparison)
    assert max(away["body"], away["basis"]) < 1e-3
    assert away["full"] < 0.02
    dry = compared(tmp_path, with_laws() | DAMPED | {"contacts": BEAM["contacts"]}).runs["r12"]
    wet, full = comparison.runs["r12"], comparison.runs["full"]
    assert wet.energy[-1] < 0.95 * dry.energy[-1]
    assert full.energy[-1] == pytest.approx(wet.energy[-1], rel=0.03)


RING = {"name": "ring", "direction": "middle", "limit": 0.8, "stiffness": 2e4}
RUBBING = BEAM | {
    "contacts": [],
    "friction": [RING],
    "start": {"load_at": "tip", "measured_at": "tip", "displacement": 1e-3},
    "models": [
        FULL | {"name": "beam", "elements": 8},
        {"kind": "reduced", "name": "all", "modes": "all"},
        BODY | {"step": 1e-4},
        {"kind": "reduced", "name": "r6", "modes": 6},
    ],
    "comparison": {"reference": "beam"},
}


class TestFriction:
    @pytest.fixture(scope="class")
    @staticmethod
    def rubbed(tmp_path_factory):
        return compared(tmp_path_factory.mktemp("scene"), RUBBING)

    def test_full_beam_reduced_model_and_body_answer_alike(self, rubbed):
        beam, every, body, few = rubbed.runs.values()
        assert rubbed.worst_error(every, 0.1) < 0.01
        assert rubbed.worst_error(few, 0.1) < 0.02
        assert len(every.stick_intervals["ring"]) > 1
        assert np.max(np.abs(beam.friction_force["ring"] - every.friction_force["ring"])) < 0.03
        assert np.max(np.abs(body.friction_force["ring"] - few.friction_force["ring"])) < 1e-3
        assert body.stick_intervals["ring"] == pytest.approx(few.stick_intervals["ring"], abs=1e-9)
        assert np.max(np.abs(beam.slip["ring"] - every.slip["ring"])) < 2e-5
        for run, allowed in ((beam, 0.03), (few, 0.02), (body, 0.02)):
            assert run.ledger["friction"] == pytest.approx(every.ledger["friction"], rel=allowed)
        first = [run.friction_force["ring"][0] for run in rubbed.runs.values()]  # what a slow pull leaves in it
        assert first[1] > 0.1
        assert np.ptp(first) < 0.03 * first[1]

    def test_the_page_and_the_files_tell_of_it(self, rubbed):
        content, arrays = summary(rubbed), histories(rubbed)
        assert "<th>friction ring</th>" in render(rubbed, Details())
        assert content["scene"]["friction"] == [RING | {"velocity": 0.0}]
        assert content["ledger"]["r6"]["friction"] > 0
        assert content["stick_intervals"]["r6"]["ring"][0][0] == pytest.approx(0.0, abs=1e-12)
        assert np.max(np.abs(arrays["r6/friction/ring"])) <= 0.8 * (1 + 1e-12)
        assert json.dumps(content)

    def test_grey_is_where_it_sticks_if_there_are_no_contacts(self, rubbed):
        figure = history_figure(rubbed, "tip")
        spans, _ = grey_spans(rubbed.reference)
        assert len(spans) == len(figure.axes[0].patches) > 1
        assert spans == pytest.approx(rubbed.reference.stick_intervals["ring"])

    def test_the_user_object_of_a_stop_that_rubs_is_its_reduced_model(self):
        setup = prepare(load_scene("rubbing-stop"))
        setup = dataclasses.replace(setup, time=setup.time[setup.time <= 0.25], repeats=1)
        reduced, body = (run_model(setup, name, progress=False) for name in ("reduced-r12", "user-object-r12"))
        assert len(reduced.stick_intervals["stop"]) >= 2
        for field in ("points", "gaps", "contact_force", "friction_force", "slip"):
            for name, values in getattr(reduced, field).items():
                assert np.max(np.abs(getattr(body, field)[name] - values)) < 1e-8 * np.max(np.abs(values))
        assert body.stick_intervals["stop"] == pytest.approx(reduced.stick_intervals["stop"], abs=1e-9)
        assert body.ledger["friction"] == pytest.approx(reduced.ledger["friction"], rel=1e-3)

    def test_a_stop_that_rubs_may_be_rigid(self):
        """In a scene's own words, and where a model takes all contacts rigid: along the stop, too."""
        setup = prepare(load_scene("rubbing-stop"))
        (stop,) = setup.contacts(rigid=True)
        assert stop.stiffness == stop.tangential_stiffness == math.inf
        found = []
        for modes in (20, 40):
            run = mp.simulate(mp.MultiPhiModel(setup.structure, [stop], modes=modes), 0.2, loads=setup.loads)
            assert run.status == "ok"
            assert abs(run.ledger.residual) < 1e-12
            found.append(run.at("side.node3", np.linspace(0, 0.2, 200)))
        assert len(run.contact_intervals("stop")) > 0
        assert np.linalg.norm(found[0] - found[1]) < 2e-3 * np.linalg.norm(found[1])

    def test_friction_without_a_spring_runs_where_nothing_is_full(self, tmp_path):
        rigid = changed(["start"], None, RUBBING) | {"friction": [RING | {"stiffness": "rigid", "static_limit": 1.0}]}
        rigid |= {"models": RUBBING["models"][1:3], "comparison": {"reference": "all"}}
        rigid["loads"] = [{"kind": "harmonic", "at": "tip", "amplitude": 2.0, "frequency_hz": 20.0}]
        assert cli.main(["compare", write(tmp_path / "rigid.toml", rigid), "--out", str(tmp_path / "out")]) == 0
        content = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
        assert content["scene"]["friction"][0]["stiffness"] == "rigid"
        assert content["ledger"]["body"]["friction"] > 0

    def test_its_limit_is_an_axis_of_a_study(self, tmp_path):
        models = {"models": RUBBING["models"][:2], "comparison": {"reference": "all"}}
        study = {
            "title": "how many modes does friction take?",
            "scene": write(tmp_path / "ring.toml", RUBBING | models),
            "axes": {"friction.ring.limit": [0.5, 0.8]},
            "methods": [{"name": "r", "model": {"kind": "reduced"}, "axes": {"modes": [2, 6]}}],
        }
        found = load_study(write(tmp_path / "study.toml", study))
        assert [found.scene_for(found.reference(at)).file.friction[0].limit for at in found.points] == [0.5, 0.8]
        for path, said in (("friction.belt.limit", "got 'belt'"), ("friction.ring", r"friction\[0\]: got 0.5")):
            with pytest.raises(mp.MultiPhiValueError, match=said):
                load_study(write(tmp_path / "study.toml", study | {"axes": {path: [0.5]}}))


class TestReport:
    def test_of_loads(self, tmp_path):
        models = {"models": [*R12, BODY, {"kind": "reduced", "name": "r6"}]}
        comparison = compared(tmp_path, at_rest(LOADS[1], LOADS[4]) | DAMPED | models)
        page = render(comparison, details_of(comparison))
        assert "harmonic (amplitude 2, frequency_hz 12, " in " ".join(findings(comparison)["compared"])
        assert "<th>work of loads</th>" in page
        assert comparison.energy_scale(comparison.runs["r6"]) == np.max(comparison.runs["r6"].energy) > 0
        scene = summary(comparison)["scene"]
        assert scene["start"] is None
        assert [load["kind"] for load in scene["loads"]] == ["harmonic", "gravity"]
        assert loss_tables(comparison.setup) == {}
        with pytest.raises(mp.MultiPhiValueError, match="without a start, need one"):
            budget(comparison.setup, 4)

    def test_of_laws_and_of_a_span_that_is_left(self, tmp_path):
        models = {"models": [*R12, {"kind": "reduced", "name": "r6", "modes": 6}]}
        short = with_laws(CUBIC | {"span": [-0.005, 0.005]}) | models
        comparison = compared(tmp_path, short)
        assert "cubic (name spring, at tip" in findings(comparison)["compared"][0]
        assert any("leaves the span" in line for line in findings(comparison)["distrust"])
        assert summary(comparison)["scene"]["force_laws"][0]["k3"] == 2e6
        wide = findings(compared(tmp_path, with_laws(CUBIC)))["distrust"]
        assert not any("leaves the span" in line for line in wide)

    def test_of_viscous_contacts_whose_levels_are_rigid(self, tmp_path):
        rigid = {"kind": "reduced", "name": "rigid", "modes": 6, "contact": "rigid"}
        comparison = compared(tmp_path, with_laws() | {"contacts": VISCOUS, "models": [*R12, rigid]})
        assert [level.name for level in level_modes(comparison)] == ["open", "stop closed"]
        assert summary(comparison)["scene"]["contacts"]["stop"]["damping"] == 300.0
