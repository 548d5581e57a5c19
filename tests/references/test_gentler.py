"""A full beam that fails is tried again at gentler settings, and says so; a study's is not."""

from dataclasses import replace

import numpy as np
import pytest
from small_scene import changed, write

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.beam import Clamp
from multiphi_exudyn.study.comparison.compare import compare, summary
from multiphi_exudyn.study.running import full_runner, runner, timing
from multiphi_exudyn.study.running.runners import run_model
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.gentler import attempts, gentler
from reference_models.rig import rig_beam

STIFF = {"kind": "full", "name": "full", "elements": 4, "step": 2e-4, "newton_tolerance": 1e-3}
HOPELESS = {"kind": "full", "name": "hopeless", "elements": 4, "step": 2e-4, "newton_tolerance": 1e-15}


def bench_of(folder, stiffness, *models):
    """A stop so stiff that a large step gains energy at its impacts."""
    data = changed(["contacts", 0, "stiffness"], stiffness)
    data |= {"models": [*models, {"kind": "reduced", "name": "all", "modes": "all"}]}
    data |= {"comparison": {"reference": "all"}, "outputs": {"t_end": 0.12, "interval": 1e-3}}
    scene = load_scene(write(folder / "scene.toml", data))
    return prepare(scene)


def test_each_rung_keeps_those_before_it():
    asked = FullBeamSettings(step=1e-4, newton_tolerance=1e-5)
    words, rungs = zip(*gentler(asked), strict=True)
    assert words[-1] == "full Newton, half the step, ten times the Newton tolerance, spectral radius 0.9"
    assert [rung.full_newton for rung in rungs] == [True] * 4
    assert [rung.step for rung in rungs] == [1e-4, 5e-5, 5e-5, 5e-5]
    np.testing.assert_allclose([rung.newton_tolerance for rung in rungs], [1e-5, 1e-5, 1e-4, 1e-4])
    assert [rung.spectral_radius for rung in rungs] == [1.0, 1.0, 1.0, 0.9]


def test_a_rung_that_changes_nothing_is_left_out():
    words = [word for word, _ in gentler(FullBeamSettings(full_newton=True, spectral_radius=0.5))]
    assert words == ["half the step", "half the step, ten times the Newton tolerance"]


def test_a_run_that_gains_energy_comes_out_right_at_gentler_settings(tmp_path, monkeypatch):
    setup = bench_of(tmp_path, 1e7, STIFF)
    once = run_model(setup, "full", progress=False)
    assert once.status == "failed"
    assert "gentler" not in once.message
    tried = []
    monkeypatch.setattr(full_runner, "attempts", lambda *given: tried.append(attempts(*given)) or tried[-1])
    run = run_model(setup, "full", progress=False, retry=True)
    assert run.ok
    assert run.message.startswith("ran with gentler settings (full Newton")
    assert f"as asked: {once.message}" in run.message
    assert run.first_s == sum(attempt.run.online_s for attempt in tried[0])
    assert run.repeats_s == ()
    assert len(run.points["tip"]) == len(run.time) == 121
    assert run.ledger["worst_gain"] < 0.01 * run.ledger["initial"]


def test_a_run_that_needs_nothing_is_not_tried_again(tmp_path, monkeypatch):
    monkeypatch.setattr(runner, "repeated", timing.repeated)
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


def test_a_static_start_that_is_not_found_is_not_tried_again():
    hinged = replace(rig_beam("measured-free"), clamp=Clamp(rotation=0.0))
    full = FullBeam(hinged, (), FullBeamSettings(elements=4))
    start = {"load_at": "hole3", "measured_at": "node3", "displacement": 0.02, "progress": False}
    (only,) = attempts(full, lambda beam: beam.run(0.1, **start))
    assert only.run.status == "failed"
    assert only.told.startswith("as asked: static start: ")


def test_settings_that_ask_for_another_mesh_are_refused(tmp_path):
    beam = bench_of(tmp_path, 1e5, STIFF)
    full = beam.full_beam(beam.scene.models["full"])
    with pytest.raises(MultiPhiValueError, match="need the same kind, elements and contact"):
        full.with_settings(FullBeamSettings(elements=5))
