"""Runs of one scene's models: the start, the shared damping, and models that have to agree."""

import numpy as np
import pytest
from small_scene import changed, write

from multiphi_exudyn import (
    ModalDamping,
    MultiPhiModel,
    MultiPhiValueError,
    NumericalFailure,
    RayleighDamping,
    planar_beam,
)
from multiphi_exudyn.mechanics.structure import damping_matrix
from multiphi_exudyn.study import runners
from multiphi_exudyn.study import runs as timing
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.runs import in_turns, repeated, undisturbed
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare, start_configuration
from reference_models.rig import rig_beam

MODELS = [
    {"kind": "full", "name": "full", "elements": 6, "step": 1e-4},
    {"kind": "reduced", "name": "all", "modes": "all"},
    {"kind": "reduced", "name": "compliant"},
    {"kind": "user-object", "name": "body", "step": 1e-4},
    {"kind": "user-object", "name": "coarse-body", "step": 4e-4},
    {"kind": "reduced", "name": "rigid", "contact": "rigid"},
    {"kind": "craig-bampton", "name": "component", "modes": 12, "step": 1e-5},
    {"kind": "solve-ivp", "name": "stepwise", "method": "DOP853", "rtol": 1e-9},
    {"kind": "global-basis", "name": "one-basis", "modes": 8},
    {"kind": "pod-basis", "name": "pod", "modes": 8},
    {"kind": "splitting", "name": "splitting", "modes": 6, "step": 2e-6},
    {"kind": "global-basis", "name": "one-rigid-basis", "modes": 8, "contact": "rigid"},
]


def bench_of(folder, **fields):
    data = changed(["damping"], {"modal_ratios": [0.05], "beyond": 0.05}) | {"models": MODELS}
    data |= {"comparison": {"reference": "full"}, "outputs": {"t_end": 0.12, "interval": 1e-4}} | fields
    scene = load_scene(write(folder / "scene.toml", data))
    return prepare(scene)


@pytest.fixture(scope="module")
def setup(tmp_path_factory):
    return bench_of(tmp_path_factory.mktemp("scene"))


@pytest.fixture(scope="module")
def runs(setup):
    return {name: run_model(setup, name, progress=False) for name in setup.scene.models}


def difference(runs, one, other, until=0.12):
    return max(nrmse(runs[one].points[p], runs[other].points[p], runs[one].time, until) for p in ("middle", "tip"))


def test_every_model_runs_to_the_end_on_one_grid_and_meets_the_stop(runs):
    assert [run.message for run in runs.values()] == [""] * len(runs)
    for run in runs.values():
        assert len(run.points["tip"]) == len(run.gaps["stop"]) == len(run.time) == 1201
        assert run.contact_intervals["stop"].shape[1] == 2
        assert len(run.contact_intervals["stop"]) > 0
        assert run.impulse["stop"] > 0
        assert run.online_s > 0


def test_full_and_linear_model_share_start_matrices_and_damping(tmp_path):
    """Off the stop nothing but large displacements is left between them: a difference that falls with the start."""
    errors = []
    for displacement in (1e-3, 1e-4):
        start = {"load_at": "tip", "measured_at": "tip", "displacement": displacement}
        setup = bench_of(tmp_path, start=start)
        runs = {name: run_model(setup, name, progress=False) for name in ("full", "all")}
        assert len(runs["full"].contact_intervals["stop"]) == 0
        errors.append(difference(runs, "all", "full"))
    assert errors[0] < 2e-4
    assert errors[1] < 2e-5


def test_a_body_in_exudyn_answers_as_the_model_by_itself(runs):
    assert difference(runs, "body", "compliant") < 1e-9
    np.testing.assert_allclose(
        runs["body"].contact_intervals["stop"], runs["compliant"].contact_intervals["stop"], atol=1e-9
    )
    assert runs["body"].impulse["stop"] == pytest.approx(runs["compliant"].impulse["stop"], rel=1e-2)


def test_a_body_with_a_coarse_step_is_put_on_the_common_grid(runs):
    assert difference(runs, "coarse-body", "compliant") < 2e-5


def test_the_baselines_answer_as_the_models_they_replace(runs):
    for one, other, tolerance in (
        ("stepwise", "compliant", 1e-7),
        ("component", "all", 1e-4),
        ("one-basis", "all", 1e-5),
        ("pod", "all", 1e-3),
        ("splitting", "all", 2e-3),
        ("one-rigid-basis", "rigid", 0.05),
    ):
        assert difference(runs, one, other) < tolerance, one
        for field in ("gaps", "contact_force"):
            found, exact = getattr(runs[one], field)["stop"], getattr(runs[other], field)["stop"]
            assert np.linalg.norm(found - exact) <= 100 * tolerance * np.linalg.norm(exact), (one, field)


@pytest.mark.parametrize(("one", "other"), [("component", "all"), ("stepwise", "compliant"), ("one-basis", "all")])
def test_the_baselines_meet_the_stop_when_the_models_they_replace_do(runs, one, other):
    np.testing.assert_allclose(runs[one].contact_intervals["stop"], runs[other].contact_intervals["stop"], atol=1e-6)
    assert runs[one].impulse["stop"] == pytest.approx(runs[other].impulse["stop"], rel=1e-3)
    energy = np.interp(runs[other].energy_time, runs[one].energy_time, runs[one].energy)
    np.testing.assert_allclose(energy, runs[other].energy, rtol=2e-3, atol=1e-3 * energy[0])


def test_labels_say_what_a_model_is(setup, runs):
    assert runs["component"].label == "Craig-Bampton in Exudyn, 2 interface points + 12 modes, step 10 µs"
    assert runs["stepwise"].label == "solve_ivp, DOP853, rtol 1e-09, compliant levels, r = 6"
    assert runs["one-rigid-basis"].label == "global basis, rigid levels, r = 8 from each of two"


def test_a_component_loaded_inside_starts_from_a_projection_and_says_so(tmp_path):
    outputs = {"t_end": 0.01, "interval": 1e-4, "points": ["middle"]}
    component = {"kind": "craig-bampton", "name": "component", "modes": 3, "step": 1e-4}
    models = [{"kind": "reduced", "name": "all", "modes": "all"}, component]
    setup = bench_of(tmp_path, outputs=outputs, models=models, comparison={"reference": "all"})
    assert setup.interface == ("middle",)
    projected, exact = (run_model(setup, name, progress=False) for name in ("component", "all"))
    assert projected.label.endswith(", start projected")
    assert projected.ledger["truncation_strain"] > 0
    assert projected.points["middle"][0] == pytest.approx(exact.points["middle"][0], rel=1e-9)
    assert projected.energy[0] + projected.ledger["truncation_strain"] == pytest.approx(exact.energy[0], rel=1e-9)


@pytest.mark.parametrize(
    "model",
    [
        {"kind": "craig-bampton", "modes": 2, "step": 1e-3},
        {"kind": "solve-ivp", "modes": 12, "method": "RK45", "rtol": 0.5},
        {"kind": "solve-ivp", "modes": 12, "method": "LSODA", "rtol": 0.03},
    ],
)
def test_a_baseline_that_gains_energy_has_failed(tmp_path, model):
    models = [{"kind": "reduced", "name": "all", "modes": "all"}, model | {"name": "coarse"}]
    setup = bench_of(tmp_path, models=models, comparison={"reference": "all"}, damping={"modal_ratios": []})
    run = run_model(setup, "coarse", progress=False)
    assert run.status == "failed"
    assert "energy gained" in run.message
    assert run.online_s > 0


def test_a_beam_is_linearised_once_for_all_scenes(tmp_path):
    first, again = bench_of(tmp_path), bench_of(tmp_path, start={"load_at": "tip", "force": 2.0})
    assert again.structure_s == first.structure_s > 0
    np.testing.assert_array_equal(again.structure.stiffness, first.structure.stiffness)
    other = bench_of(tmp_path, models=[MODELS[0] | {"elements": 7}])
    assert other.structure.n > first.structure.n


def test_rigid_levels_have_another_contact_law(runs):
    assert runs["rigid"].ledger["impact"] > 0 == runs["compliant"].ledger["impact"]
    assert difference(runs, "rigid", "compliant") > 1e-3


@pytest.mark.parametrize("displacement", [0.01, -0.01])
def test_the_start_reaches_its_displacement_with_the_right_contacts_closed(tmp_path, displacement):
    start = {"load_at": "tip", "measured_at": "tip", "displacement": displacement}
    setup = bench_of(tmp_path, start=start)
    for rigid in (False, True):
        model = MultiPhiModel(setup.structure, setup.contacts(rigid))
        x = start_configuration(setup, model)
        gap = setup.structure.row("middle") @ x + 1e-3
        assert setup.structure.row("tip") @ x == pytest.approx(displacement, rel=1e-9)
        assert gap > 1e-3 if displacement > 0 else gap <= 1e-12


def test_a_start_by_force_is_the_static_equilibrium_for_every_model(tmp_path):
    setup = bench_of(tmp_path, start={"load_at": "tip", "force": 2.0})
    model = MultiPhiModel(setup.structure, setup.contacts(rigid=False))
    expected = setup.structure.row("tip") @ model.static_equilibrium({"tip": 2.0})
    for name in ("full", "all"):
        assert run_model(setup, name, progress=False).points["tip"][0] == pytest.approx(expected, rel=1e-6)


def test_a_start_that_no_force_reaches_is_a_failed_run_with_its_cause(tmp_path):
    """Pressed onto the stop from above, the tip beyond it rises again."""
    beam = {"points": {"inside": 0.15, "middle": 0.3, "tip": 0.5}}
    start = {"load_at": "inside", "measured_at": "tip", "displacement": -0.05}
    data = changed(["structure", "beam", "points"], beam["points"]) | {"start": start}
    setup = bench_of(tmp_path, structure=data["structure"], start=start)
    with pytest.raises(NumericalFailure, match=r"no force at inside moves tip by -0\.05 m"):
        start_configuration(setup, MultiPhiModel(setup.structure, setup.contacts(rigid=False)))
    run = run_model(setup, "compliant", progress=False)
    assert run.status == "failed"
    assert "no force at inside" in run.message


def test_the_damping_matrix_has_the_ratios_it_was_given():
    given = ModalDamping((0.04, 0.02), beyond=0.01)
    structure = planar_beam(rig_beam(), 10, given)
    values = np.sort_complex(np.linalg.eigvals(_first_order(structure, damping_matrix(structure))))
    ratios = sorted((-v.real / abs(v), abs(v)) for v in values if v.imag > 0)
    by_frequency = [ratio for ratio, _ in sorted(ratios, key=lambda pair: pair[1])]
    np.testing.assert_allclose(by_frequency[:5], [0.04, 0.02, 0.01, 0.01, 0.01], rtol=1e-4)


def test_rayleigh_damping_is_its_sum_and_a_matrix_is_itself():
    structure = planar_beam(rig_beam(), 10, RayleighDamping(0.3, 2e-5))
    expected = 0.3 * structure.mass + 2e-5 * structure.stiffness
    np.testing.assert_allclose(damping_matrix(structure), expected)
    assert damping_matrix(planar_beam(rig_beam(), 10)) is None
    assert np.array_equal(damping_matrix(planar_beam(rig_beam(), 10, expected)), expected)


def _first_order(structure, damping):
    inverse = np.linalg.inv(structure.mass)
    zero, one = np.zeros_like(inverse), np.eye(len(inverse))
    return np.block([[zero, one], [-inverse @ structure.stiffness, -inverse @ damping]])


def test_a_tolerance_in_place_of_a_number_of_modes(tmp_path):
    data = changed(["models", 1], {"kind": "reduced", "name": "to-1-percent", "tolerance": 0.01})
    scene = load_scene(write(tmp_path / "scene.toml", data))
    setup = prepare(scene)
    run = run_model(setup, "to-1-percent")
    assert run.label == "Multi-Phi, compliant levels, modes for a truncation error of 0.01"
    assert 2 <= run.dofs < setup.structure.n - 1
    assert run.indicators["0.1"] <= 0.01


def test_modes_and_a_tolerance_are_refused(tmp_path):
    data = changed(["models", 1], {"kind": "reduced", "name": "both", "tolerance": 0.01, "modes": 3})
    with pytest.raises(MultiPhiValueError, match=r"models\[1\].*need modes or tolerance, not both"):
        load_scene(write(tmp_path / "scene.toml", data))


def test_short_runs_are_repeated_until_their_time_is_steady_and_long_ones_once(monkeypatch):
    monkeypatch.setattr(timing, "STEADY_S", 0.1)
    for duration, expected in ((0.001, 100), (0.03, 7), (0.5, 3), (3.0, 0)):
        repeats = repeated(lambda duration=duration: duration, duration, 7)
        assert abs(len(repeats) - expected) <= 1
        assert set(repeats) <= {duration}
    assert repeated(lambda: 0.001, 0.001, 0) == ()


def test_in_turns_a_change_of_speed_changes_all_runs_alike():
    """A machine at half its speed for stretches of seven runs."""
    calls = []

    def run(duration):
        calls.append(duration)
        return duration * (1 + len(calls) // 7 % 2)

    times = in_turns([lambda: run(1.0), lambda: run(1.05), lambda: run(1.1)], 60.0)
    assert [len(each) for each in times] == 3 * [timing.ROUNDS]
    assert calls[:6] == [1.0, 1.05, 1.1, 1.1, 1.05, 1.0]
    assert [undisturbed(each) for each in times] == [1.0, 1.05, 1.1]


def test_turns_end_with_their_round_where_they_take_long():
    assert in_turns([lambda: 1.0, lambda: 2.0], 0.0) == [(1.0,), (2.0,)]


@pytest.mark.parametrize(("name", "counts"), [("compliant", False), ("full", True)])
def test_a_first_run_that_builds_levels_is_no_measure_of_a_repeat(setup, monkeypatch, name, counts):
    """However long it takes, repeats follow; a full beam that takes as long is not run again."""
    told = []
    monkeypatch.setattr(runners, "repeated", lambda run, first, fewest: told.append(first) or ())
    run_model(setup, name)
    assert (told[0] > 0) == counts
