"""All measures of a run: known histories, their JSON, and that each is defined."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from small_scene import changed, write

from multiphi_exudyn.study.measures import METRICS, horizons, measures_of
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.runs import ModelRun, from_arrays, to_arrays
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare

KEYS = [
    "label", "kind", "dofs", "steps", "nrmse", "max_difference", "spectral_difference", "horizon", "largest",
    "first_contact", "contact_count", "closed_time", "intervals", "largest_force", "impulse", "inner_losses",
    "energy_end", "ledger", "horizon_s", "warnings",
]  # fmt: skip
RELATIVE = ("nrmse", "max_difference", "spectral_difference", "horizon")


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    outputs = {"t_end": 0.2, "points": ["middle", "tip"], "judged_points": ["tip"], "interval": 1e-4}
    scene = load_scene(write(tmp_path_factory.mktemp("scene") / "small.toml", changed(["outputs"], outputs)))
    return prepare(scene)


@pytest.fixture(scope="module")
def reference(setup):
    """Drawn by hand: in contact twice."""
    tip = 1e-2 * np.cos(300 * setup.time)
    return ModelRun(
        "drawn",
        "full",
        "drawn by hand",
        dofs=40,
        time=setup.time,
        points={"tip": tip, "middle": 0.4 * tip},
        gaps={"stop": 1e-3 + 0.4 * tip},
        contact_force={"stop": np.maximum(0, -tip)},
        contact_intervals={"stop": np.array([[0.03, 0.032], [0.034, 0.04]])},
        impulse={"stop": 0.5},
        energy_time=setup.time,
        energy=np.exp(-setup.time),
        ledger={"initial": 1.0, "damping": 0.2, "final": 0.8},
        steps=100,
        repeats_s=(0.1, 0.2),
    )


@pytest.fixture(scope="module")
def simulated(setup):
    return run_model(setup, "r6")


def scaled(run, share):
    return replace(run, points={name: (1 + share) * values for name, values in run.points.items()})


def test_the_measures_are_these_and_nothing_else(setup, reference):
    assert list(measures_of(setup, reference, reference)) == KEYS


def test_every_measure_is_defined(setup, reference):
    assert set(KEYS) - {"label", "kind"} <= set(METRICS)
    assert set(METRICS) - set(KEYS) == {
        "pointwise_until",
        "stiff_nrmse",
    }  # of two runs, of a study


def test_differences_to_the_reference_by_window_and_point(setup, reference):
    found = measures_of(setup, scaled(reference, 0.03), reference)
    for name in ("nrmse", "spectral_difference"):
        assert list(found[name]) == ["0.1", "0.2"]
        for table in found[name].values():
            assert table == pytest.approx({"middle": 0.03, "tip": 0.03})
    assert found["max_difference"]["0.2"] == pytest.approx({"middle": 1.2e-4, "tip": 3e-4})
    assert found["horizon"] == {"0.01": 0.0, "0.05": 0.2}


def test_the_horizon_is_that_of_the_judged_points(setup, reference):
    off = replace(reference, points=dict(reference.points) | {"middle": 2 * reference.points["middle"]})
    assert horizons(setup, off, reference) == {"0.01": 0.2, "0.05": 0.2}


def test_contacts_energy_and_ledger(setup, reference):
    found = measures_of(setup, reference, None)
    assert found["first_contact"] == {"stop": 0.03}
    assert found["contact_count"] == {"stop": 2}
    assert found["closed_time"] == {"stop": pytest.approx(0.008)}
    assert found["intervals"] == {"stop": [[0.03, 0.032], [0.034, 0.04]]}
    assert found["largest"] == {"tip": 1e-2, "middle": pytest.approx(4e-3)}
    assert found["largest_force"] == {"stop": pytest.approx(1e-2, rel=1e-3)}
    assert found["impulse"] == {"stop": 0.5}
    assert found["inner_losses"] == {"stop": 1}
    assert found["energy_end"] == math.exp(-0.2)
    assert found["ledger"] == {"initial": 1.0, "damping": 0.2, "final": 0.8}
    assert (found["label"], found["kind"], found["dofs"], found["steps"]) == ("drawn by hand", "full", 40, 100)


def test_without_a_reference_there_are_no_differences(setup, reference):
    failed = ModelRun("full", "full", "full", status="failed", message="no convergence")
    for missing in (None, failed):
        found = measures_of(setup, reference, missing)
        assert [found[name] for name in RELATIVE] == [{}] * 4
        assert list(found) == KEYS


def test_a_failed_run_has_its_label_and_no_numbers(setup, reference):
    failed = ModelRun("full", "full", "full beam", status="failed", message="no convergence")
    found = measures_of(setup, failed, reference)
    assert list(found) == KEYS
    assert found["label"] == "full beam"
    assert found["energy_end"] is None
    assert found["warnings"] == []
    assert all(found[name] == {} for name in KEYS[4:] if name not in ("energy_end", "warnings"))


def test_a_run_that_never_touches_has_no_first_contact(setup, reference):
    found = measures_of(setup, replace(reference, contact_intervals={"stop": np.zeros((0, 2))}), None)
    assert found["first_contact"] == {"stop": None}
    assert found["intervals"] == {"stop": []}
    assert found["contact_count"] == {"stop": 0} == found["inner_losses"]


def test_measures_are_json_without_numbers_that_do_not_exist(setup, reference, simulated):
    still = scaled(reference, -1.0)
    for run, other in ((simulated, reference), (reference, still), (still, reference)):
        found = measures_of(setup, run, other)
        assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert measures_of(setup, reference, still)["nrmse"]["0.1"]["tip"] is None


def test_windows_end_with_the_run(setup):
    def of(t_end):
        return replace(setup, time=1e-3 * np.arange(round(t_end / 1e-3) + 1)).windows

    assert [of(t_end) for t_end in (0.05, 0.3, 1.0)] == [(0.05,), (0.1, 0.3), (0.1, 0.3, 1.0)]


def test_a_run_stored_as_arrays_is_the_same_run(setup, reference, simulated, tmp_path):
    for run in (reference, simulated, ModelRun("a", "full", "label, of a", status="failed", message="why: n/a")):
        np.savez(tmp_path / "run.npz", **to_arrays(run))
        with np.load(tmp_path / "run.npz", allow_pickle=False) as stored:
            restored = from_arrays(dict(stored))
        np.testing.assert_equal(vars(restored), vars(run))
        assert type(restored.steps) is int
        assert type(restored.message) is str
        assert measures_of(setup, restored, reference) == measures_of(setup, run, reference)


def test_arrays_are_named_by_field_and_entry(reference):
    arrays = to_arrays(reference)
    assert {"time", "points/tip", "gaps/stop", "contact_intervals/stop", "impulse/stop", "ledger/final"} <= set(arrays)
    assert all(isinstance(array, np.ndarray) for array in arrays.values())
