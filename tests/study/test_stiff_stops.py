"""Stiff stops: rigid levels are their limit, and they are run only where there are any."""

import numpy as np
import pytest
from small_scene import BEAM, changed, write

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.study import measures as module
from multiphi_exudyn.study.measures import rigid_models, stiff_stops
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare

pytestmark = pytest.mark.usefixtures("few_elements")

RIGID = {"kind": "reduced", "name": "rigid", "contact": "rigid", "modes": "all"}


def bench_of(tmp_path, *models, data=BEAM):
    data = data | {"models": [*BEAM["models"], *models]}
    scene = load_scene(write(tmp_path / "scene.toml", data))
    return prepare(scene)


def one_mass(tmp_path, stiffness, mass=2.0):
    np.savez(tmp_path / "one.npz", mass=[[mass, 0.0], [0.0, 1.0]], stiffness=np.diag([300.0, 1.0]))
    data = BEAM | {
        "structure": {"matrices": "one.npz", "points": {"middle": 0, "tip": 1}},
        "damping": {"modal_ratios": []},
    }
    data |= {
        "start": {"load_at": "tip", "force": 1.0},
        "models": [RIGID | {"modes": 1}],
        "comparison": {"reference": "rigid"},
    }
    data["contacts"] = [BEAM["contacts"][0] | {"stiffness": stiffness}]
    scene = load_scene(write(tmp_path / "one.toml", data))
    return prepare(scene)


@pytest.mark.parametrize(("own", "softest"), [("rigid", 1e8), (1e2, 1e8), (2e9, 1e10), (1e9, 1e9)])
def test_the_softest_is_the_decade_above_the_structure_and_the_scenes_own_stop(tmp_path, own, softest):
    """Of a mass on a spring of 300 N/m: 3e7."""
    assert stiff_stops(one_mass(tmp_path, own)).stiffness == pytest.approx([softest, 10 * softest, 100 * softest])


def test_rigid_levels_are_near_stiff_stops_and_far_from_the_scenes_soft_one(tmp_path):
    """To 0.06 s: after that the bounces grow round-off, by which two runs differ, to per cents of the motion."""
    setup = bench_of(tmp_path, RIGID, data=changed(["contacts", 0, "stiffness"], 1e4))
    stiff, rigid, soft = stiff_stops(setup), run_model(setup, "rigid"), run_model(setup, "all")
    uncertain = stiff.uncertainty(setup.time, ("tip",), 0.06)
    assert max(stiff.error(rigid, ("tip",), 0.06), uncertain) < 2e-3
    assert stiff.error(soft, ("tip",), 0.06) > 0.1
    values = stiff.values(setup, {"rigid": rigid})
    assert values["errors"]["rigid"]["0.1"]["tip"] == stiff.error(rigid, ("tip",), 0.1)


def test_loads_that_need_the_scenes_own_mesh_act_on_it(tmp_path):
    full = {"kind": "full", "name": "full", "elements": 3, "step": 1e-3}
    data = BEAM | {"loads": [{"kind": "gravity", "acceleration": 9.81}]}
    assert stiff_stops(bench_of(tmp_path, RIGID, full, data=data)).ok


def test_without_rigid_levels_nothing_is_run(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "simulate", None)
    assert stiff_stops(bench_of(tmp_path)) is None
    free = BEAM | {"contacts": []}
    assert stiff_stops(bench_of(tmp_path, RIGID, data=free)) is None


def test_levels_with_printed_frequencies_have_no_stiff_stop():
    scene = load_scene("paper-rig-as-published", t_end=0.01)
    assert rigid_models(prepare(scene)) == ()


def test_a_failure_is_told_and_measures_nothing(tmp_path, monkeypatch):
    def failing(*_):
        raise NumericalFailure("no way")

    monkeypatch.setattr(module, "_histories", failing)
    setup = bench_of(tmp_path, RIGID)
    stiff = stiff_stops(setup)
    assert not stiff.ok
    values = stiff.values(setup, {"rigid": run_model(setup, "rigid")})
    assert (values["message"], values["errors"], values["uncertainty"]) == ("no way", {}, {})
