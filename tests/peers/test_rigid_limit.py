"""Rigid levels are the limit of stiff stops, and linear answers on stiff stops are those of the full Exudyn beam."""

import dataclasses

import pytest

from multiphi_exudyn.study.measures import nrmse, stiff_stops
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import scene_data, scene_of
from multiphi_exudyn.study.setup import prepare

MODELS = [
    {"kind": "reduced", "name": "linear", "modes": "all"},
    *({"kind": "reduced", "name": f"rigid-{r}", "modes": r, "contact": "rigid"} for r in (6, 12, 24, "all")),
]
POINTS = ("node2", "node3")


def bench_of(stiffness, *models):
    path, data = scene_data("paper-rig")
    data["structure"] |= {"support_stiffness": stiffness}
    data["outputs"] |= {"t_end": 0.3}
    data |= {"models": [*MODELS, *models], "comparison": {"reference": "linear"}}
    scene = scene_of(path, data)
    return dataclasses.replace(prepare(scene), repeats=0)


def difference(run, reference, until):
    return max(nrmse(run.points[point], reference.points[point], run.time, until) for point in POINTS)


def test_rigid_levels_of_the_rig_are_far_from_a_soft_stop_and_near_a_stiff_one():
    setup = bench_of(1e6)
    runs = {name: run_model(setup, name) for name in setup.scene.models}
    stiff = stiff_stops(setup)
    assert stiff.stiffness == pytest.approx([1e8, 1e9, 1e10])
    assert stiff.uncertainty(setup.time, POINTS, 0.3) < 0.03
    for name in ("rigid-6", "rigid-12", "rigid-24", "rigid-all"):
        assert difference(runs[name], runs["linear"], 0.3) > 0.1
        assert stiff.error(runs[name], POINTS, 0.3) < 0.03
        assert stiff.error(runs[name], POINTS, 0.1) < 0.005


@pytest.mark.slow
def test_on_a_stop_of_1e7_the_full_beam_confirms_them():
    """Its own step still changes it by 1 % to 0.3 s; to 0.1 s, by 0.1 %."""
    setup = bench_of(1e7, {"kind": "full", "name": "full", "elements": 20, "step": 5e-6})
    runs = {name: run_model(setup, name, progress=False) for name in ("linear", "rigid-6", "rigid-12", "full")}
    assert difference(runs["linear"], runs["full"], 0.1) < 0.001
    assert difference(runs["linear"], runs["full"], 0.3) < 0.02
    for name in ("rigid-6", "rigid-12"):
        assert difference(runs[name], runs["full"], 0.1) < 0.005
        assert difference(runs[name], runs["full"], 0.3) < 0.03
