"""Friction in scene files: the reduced sides and the full beam answer alike, the page shows it, errors name fields."""

import dataclasses
import json
import math

import numpy as np
import pytest
from small_scene import BEAM, changed, write

import multiphi_exudyn as mp
from multiphi_exudyn.cli import main
from multiphi_exudyn.study.compare import compare, histories, summary
from multiphi_exudyn.study.details import Details
from multiphi_exudyn.study.plots import grey_spans, history_figure
from multiphi_exudyn.study.report import render
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene, mechanics_of
from multiphi_exudyn.study.setup import prepare
from multiphi_exudyn.study.study_file import load_study

pytestmark = pytest.mark.usefixtures("few_elements")

RING = {"name": "ring", "direction": "middle", "limit": 0.8, "stiffness": 2e4}
MODELS = [
    {"kind": "full", "name": "beam", "elements": 8, "step": 1e-4},
    {"kind": "reduced", "name": "all", "modes": "all"},
    {"kind": "user-object", "name": "body", "step": 1e-4, "modes": 6},
    {"kind": "reduced", "name": "r6", "modes": 6},
]
SHAKEN = {"kind": "harmonic", "at": "tip", "amplitude": 2.0, "frequency_hz": 20.0}
SCENE = BEAM | {
    "contacts": [],
    "friction": [RING],
    "start": {"load_at": "tip", "measured_at": "tip", "displacement": 1e-3},
    "models": MODELS,
    "comparison": {"reference": "beam"},
}


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    scene = load_scene(write(tmp_path_factory.mktemp("scene") / "ring.toml", SCENE))
    return prepare(scene)


@pytest.fixture(scope="module")
def compared(setup):
    return compare(setup, {}, progress=False)


def test_full_beam_reduced_model_and_body_answer_alike(compared):
    assert [run.message for run in compared.runs.values() if not run.ok] == []
    beam, every, body, few = compared.runs.values()
    assert compared.worst_error(every, 0.1) < 0.01
    assert compared.worst_error(few, 0.1) < 0.02
    assert len(every.stick_intervals["ring"]) > 1
    assert np.max(np.abs(beam.friction_force["ring"] - every.friction_force["ring"])) < 0.03
    assert np.max(np.abs(body.friction_force["ring"] - few.friction_force["ring"])) < 1e-3
    assert body.stick_intervals["ring"] == pytest.approx(few.stick_intervals["ring"], abs=1e-9)
    assert np.max(np.abs(beam.slip["ring"] - every.slip["ring"])) < 2e-5
    for run, allowed in ((beam, 0.03), (few, 0.02), (body, 0.02)):
        assert run.ledger["friction"] == pytest.approx(every.ledger["friction"], rel=allowed)
    assert abs(every.ledger["residual"]) < 1e-12


def test_the_page_and_the_files_tell_of_it(compared):
    page, content, arrays = render(compared, Details()), summary(compared), histories(compared)
    assert "<th>friction ring</th>" in page
    assert "how far the patch has slipped" in page
    assert content["scene"]["friction"] == [RING | {"velocity": 0.0}]
    assert content["ledger"]["r6"]["friction"] > 0
    assert content["stick_intervals"]["r6"]["ring"][0][0] == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(arrays["r6/friction/ring"])) <= 0.8 * (1 + 1e-12)
    assert json.dumps(content)


def test_grey_is_where_it_sticks_if_there_are_no_contacts(compared):
    figure = history_figure(compared, "tip")
    assert figure.axes[0].get_title("left") == "Displacement of tip; grey: friction sticks in the reference"
    assert len(figure.axes) == 2
    spans, _ = grey_spans(compared.reference)
    assert len(spans) == len(figure.axes[0].patches) > 1
    assert spans == pytest.approx(compared.reference.stick_intervals["ring"])
    assert "the first contact phase, and" not in render(compared, Details())


def test_the_user_object_of_a_stop_that_rubs_is_its_reduced_model():
    scene = load_scene("rubbing-stop")
    setup = prepare(scene)
    setup = dataclasses.replace(setup, time=setup.time[setup.time <= 0.25], repeats=1)
    names = "reduced-r12", "user-object-r12"
    reduced, body = (run_model(setup, name, progress=False) for name in names)
    assert len(reduced.stick_intervals["stop"]) >= 2
    for field in ("points", "gaps", "contact_force", "friction_force", "slip"):
        for name, values in getattr(reduced, field).items():
            assert np.max(np.abs(getattr(body, field)[name] - values)) < 1e-8 * np.max(np.abs(values))
    assert body.stick_intervals["stop"] == pytest.approx(reduced.stick_intervals["stop"], abs=1e-9)
    assert body.ledger["friction"] == pytest.approx(reduced.ledger["friction"], rel=1e-3)


def test_a_start_leaves_springs_stretched_for_every_model(compared):
    """At the start the ring carries what a slow pull leaves in it."""
    first = [run.friction_force["ring"][0] for run in compared.runs.values()]
    assert first[1] > 0.1
    assert np.ptp(first) < 0.03 * first[1]


def test_friction_without_a_spring_runs_where_nothing_is_full(tmp_path):
    scene = SCENE | {"friction": [RING | {"stiffness": "rigid", "static_limit": 1.0}], "models": MODELS[1:3]}
    scene |= {"comparison": {"reference": "all"}, "loads": [SHAKEN]}
    del scene["start"]
    given = load_scene(write(tmp_path / "rigid.toml", scene))
    (friction,) = mechanics_of(given).frictions
    assert (friction.stiffness, friction.static_limit) == (math.inf, 1.0)
    assert main(["compare", str(tmp_path / "rigid.toml"), "--out", str(tmp_path / "out")]) == 0
    content = json.loads((tmp_path / "out" / "summary.json").read_text("utf-8"))
    assert content["scene"]["friction"][0]["stiffness"] == "rigid"
    assert content["ledger"]["body"]["friction"] > 0


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("friction", 0, "limit"), -1.0, "friction[0].limit: got -1.0"),
        (("friction", 0, "limit"), None, "friction[0].limit: got nothing"),
        (("friction", 0, "static_limit"), 0.5, "static_limit: got 0.5, need a finite force >= the limit 0.8"),
        (("friction", 0, "direction"), "nowhere", "friction[0].direction: got 'nowhere', need one of the points"),
        (("friction", 0, "stifness"), 1.0, "friction[0].stifness: got 1.0"),
        (("friction",), [RING, RING], "friction[1].name: got 'ring', need another name"),
        (
            ("friction", 0, "stiffness"),
            "rigid",
            "friction[0].stiffness: got 'inf', need a finite one: friction of",
        ),
        (
            ("models", 2),
            {"kind": "solve-ivp", "name": "s", "modes": 4, "method": "RK45", "rtol": 1e-6},
            "models[2].kind: got 'solve-ivp', need another kind: this kind takes no friction, and the scene has ring",
        ),
    ],
)
def test_errors_name_file_and_field(tmp_path, path, value, said):
    with pytest.raises(mp.MultiPhiValueError) as error:
        mechanics_of(load_scene(write(tmp_path / "scene.toml", changed(path, value, SCENE))))
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_the_limit_of_a_friction_is_an_axis_of_a_study(tmp_path):
    scene = write(
        tmp_path / "ring.toml", SCENE | {"models": [MODELS[0], MODELS[1]], "comparison": {"reference": "all"}}
    )
    study = {
        "title": "how many modes does friction take?",
        "scene": scene,
        "axes": {"friction.ring.limit": [0.5, 0.8]},
        "methods": [{"name": "r", "model": {"kind": "reduced"}, "axes": {"modes": [2, 6]}}],
    }
    found = load_study(write(tmp_path / "study.toml", study))
    limits = [found.scene_for(found.reference(at)).file.friction[0].limit for at in found.points]
    assert sorted(limits) == [0.5, 0.8]
    for path, said in (
        ("friction.belt.limit", "friction.belt.limit: got 'belt', need one of the entries: "),
        ("friction.ring", r"friction\[0\]: got 0.5"),
    ):
        with pytest.raises(mp.MultiPhiValueError, match=said):
            load_study(write(tmp_path / "study.toml", study | {"axes": {path: [0.5]}}))


def test_a_stop_that_rubs_may_be_rigid():
    """In a scene's own words, and where a model takes all contacts rigid: along the stop, too."""
    scene = load_scene("rubbing-stop")
    setup = prepare(scene)
    (stop,) = setup.contacts(rigid=True)
    assert stop.stiffness == stop.tangential_stiffness == math.inf
    found = []
    for modes in (20, 40):
        model = mp.MultiPhiModel(setup.structure, [stop], modes=modes)
        run = mp.simulate(model, 0.2, loads=setup.loads)
        assert run.status == "ok"
        assert abs(run.ledger.residual) < 1e-12
        found.append(run.at("side.node3", np.linspace(0, 0.2, 200)))
    assert len(run.contact_intervals("stop")) > 0
    assert np.linalg.norm(found[0] - found[1]) < 2e-3 * np.linalg.norm(found[1])
