"""A full beam that fails is tried again at gentler settings, and says so; a study's is not."""

from small_scene import changed, write

from multiphi_exudyn.study import runners
from multiphi_exudyn.study import runs as timing
from multiphi_exudyn.study.compare import compare, summary
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare
from reference_models.gentler import attempts

STIFF = {"kind": "full", "name": "full", "elements": 4, "step": 2e-4, "newton_tolerance": 1e-3}
HOPELESS = {"kind": "full", "name": "hopeless", "elements": 4, "step": 2e-4, "newton_tolerance": 1e-15}


def bench_of(folder, stiffness, *models):
    """A stop so stiff that a large step gains energy at its impacts."""
    data = changed(["contacts", 0, "stiffness"], stiffness)
    data |= {"models": [*models, {"kind": "reduced", "name": "all", "modes": "all"}]}
    data |= {"comparison": {"reference": "all"}, "outputs": {"t_end": 0.12, "interval": 1e-3}}
    scene = load_scene(write(folder / "scene.toml", data))
    return prepare(scene)


def test_a_run_that_gains_energy_comes_out_right_at_gentler_settings(tmp_path, monkeypatch):
    setup = bench_of(tmp_path, 1e7, STIFF)
    once = run_model(setup, "full", progress=False)
    assert once.status == "failed"
    assert "gentler" not in once.message
    tried = []
    monkeypatch.setattr(runners, "attempts", lambda *given: tried.append(attempts(*given)) or tried[-1])
    run = run_model(setup, "full", progress=False, retry=True)
    assert run.ok
    assert run.message.startswith("ran with gentler settings (full Newton")
    assert f"as asked: {once.message}" in run.message
    assert run.first_s == sum(attempt.run.online_s for attempt in tried[0])
    assert run.repeats_s == ()
    assert len(run.points["tip"]) == len(run.time) == 121
    assert run.ledger["worst_gain"] < 0.01 * run.ledger["initial"]


def test_a_run_that_needs_nothing_is_not_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(runners, "repeated", timing.repeated)
    run = run_model(bench_of(tmp_path, 1e4, STIFF), "full", progress=False, retry=True)
    assert (run.status, run.message) == ("ok", "")
    assert len(run.repeats_s) >= 7


def test_a_run_that_fails_with_every_setting_is_a_row_and_the_comparison_goes_on(tmp_path):
    comparison = compare(bench_of(tmp_path, 1e5, HOPELESS), {}, progress=False)
    rows = summary(comparison)["models"]
    assert rows["all"]["status"] == "ok"
    row = rows["hopeless"]
    assert row["status"] == "failed"
    assert row["message"].startswith("failed with every setting; as asked: ")
    assert row["message"].count(" s)") == 5
    assert "\n" not in row["message"]
    assert row["online_s"] > 0
