"""Loads in scene files: what they become, one line for every broken one, models that agree, and the report's words."""

import numpy as np
import pytest
from small_scene import BEAM, changed, write

from multiphi_exudyn import (
    Accelerogram,
    BaseMotion,
    Gravity,
    Harmonic,
    MultiPhiModel,
    MultiPhiValueError,
    SampledLoad,
    StopMotion,
    SweepLoad,
    simulate,
)
from multiphi_exudyn.study.budget import budget
from multiphi_exudyn.study.compare import compare, summary
from multiphi_exudyn.study.details import details_of, loss_tables
from multiphi_exudyn.study.measures import nrmse
from multiphi_exudyn.study.report import findings, render
from multiphi_exudyn.study.scene import load_scene, mechanics_of
from multiphi_exudyn.study.setup import prepare, start_configuration

HARMONIC = {"kind": "harmonic", "at": "tip", "amplitude": 2.0, "frequency_hz": 12.0, "phase": 0.5}
MOVED = {"kind": "harmonic", "amplitude": 1e-3, "frequency_hz": 12.0}
SWEPT = {"kind": "sweep", "amplitude": 1e-3, "start_hz": 5.0, "end_hz": 30.0, "duration": 0.5}
RECORD = {"kind": "accelerogram", "time": [0.0, 0.02, 0.06, 0.1], "values": [0.0, 1.2, -1.2, 0.0], "factor": 9.81}
SAMPLES = {"time": [0.0, 0.02, 0.2], "values": [0.0, -2.0, 2.0]}
LOADS = {
    "constant": {"kind": "constant", "at": {"tip": 1.0, "middle": -0.5}, "force": -2.0},
    "harmonic": HARMONIC,
    "sampled": {"kind": "sampled", "at": "tip"} | SAMPLES,
    "sweep": SWEPT | {"at": "tip", "amplitude": 2.0, "law": "logarithmic"},
    "gravity": {"kind": "gravity", "acceleration": -9.81},
    "stop-motion": {"kind": "stop-motion", "contact": "stop", "course": MOVED | {"phase": -1.5, "amplitude": 2e-3}},
    "base-motion": {"kind": "base-motion", "course": MOVED | {"amplitude": 4e-3}, "fixed_stops": ["stop"]},
    "accelerogram": {"kind": "base-motion", "course": RECORD},
    "accelerated stop": {"kind": "stop-motion", "contact": "stop", "course": RECORD | {"factor": 4.0}},
}
MODELS = [
    {"kind": "reduced", "name": "r12", "modes": 12},
    {"kind": "user-object", "name": "body", "modes": 6, "step": 2e-4},
    {"kind": "full", "name": "full", "elements": 4, "step": 1e-4},
]


def at_rest(*loads, **fields):
    """The small scene without a start, under loads, its runs by 12 modes."""
    data = changed(["start"], None) | {"loads": list(loads), "models": MODELS[:1], "comparison": {"reference": "r12"}}
    return data | {"damping": {"modal_ratios": [0.05], "beyond": 0.05}} | fields


def loaded(folder, data):
    scene = load_scene(write(folder / "scene.toml", data))
    return scene, mechanics_of(scene)


def bench_of(folder, data):
    return prepare(loaded(folder, data)[0])


def complaint(folder, data):
    file = write(folder / "scene.toml", data)
    with pytest.raises(MultiPhiValueError) as caught:
        mechanics_of(load_scene(file))
    line = str(caught.value)
    assert line.startswith(file + ": ")
    assert "\n" not in line
    return line.removeprefix(file + ": ")


class TestForms:
    def test_every_kind_becomes_its_load(self, tmp_path):
        setup = bench_of(tmp_path, at_rest(*LOADS.values()))
        constant, harmonic, sampled, sweep, gravity, stop, base, quake, pushed = setup.loads
        assert (constant.at, constant.force) == ({"tip": 1.0, "middle": -0.5}, -2.0)
        assert harmonic.course == Harmonic(2.0, 12.0, 0.5)
        np.testing.assert_array_equal(sampled.force, SAMPLES["values"])
        assert isinstance(sweep, SweepLoad)
        assert (sweep.law, sweep.duration) == ("logarithmic", 0.5)
        assert isinstance(gravity, Gravity)
        assert gravity.acceleration == -9.81
        assert isinstance(stop, StopMotion)
        assert stop.course == Harmonic(2e-3, 12.0, -1.5)
        assert isinstance(base, BaseMotion)
        assert base.fixed_stops == ("stop",)
        for load, factor in ((quake, 9.81), (pushed, 4.0)):
            assert isinstance(load.course, Accelerogram)
            assert (load.course.values.tolist(), load.course.factor) == (RECORD["values"], factor)

    def test_samples_come_from_a_file_beside_the_scene(self, tmp_path):
        np.savetxt(tmp_path / "force.csv", [[0.0, 9.0, 1.0], [0.1, 9.0, -1.0]], delimiter=",", header="t, a, b")
        load = {"kind": "sampled", "at": "tip", "csv": "force.csv", "column": 2}
        (found,) = bench_of(tmp_path, at_rest(load)).loads
        np.testing.assert_array_equal(found.force, [1.0, -1.0])

    @pytest.mark.parametrize("factor", [9.81, 0.01])
    def test_a_record_from_a_file_shakes_the_base_in_its_unit(self, tmp_path, factor):
        """Against the force -M e a(t) of the same record."""
        time, values = np.array([0.0, 0.05, 0.1, 0.2]), np.array([0.0, 6.0, -8.0, 0.0]) / factor
        np.savetxt(tmp_path / "record.csv", np.transpose([time, values]), delimiter=",", header="s, a")
        course = {"kind": "accelerogram", "csv": "record.csv", "factor": factor}
        setup = bench_of(tmp_path, at_rest({"kind": "base-motion", "course": course}))
        (base,) = setup.loads
        model, structure = MultiPhiModel(setup.structure, setup.mechanics.contacts, modes=12), setup.structure
        force = SampledLoad(-structure.mass @ structure.row(base.direction), time, factor * values)
        shaken, pushed = (simulate(model, 0.3, loads=[load]) for load in (base, force))
        assert shaken.events
        times = np.linspace(0.0, 0.3, 50)
        expected = pushed.at("tip", times)
        np.testing.assert_allclose(shaken.at("tip", times), expected, atol=1e-9 * np.max(np.abs(expected)))

    def test_a_start_left_out_is_rest(self, tmp_path):
        setup = bench_of(tmp_path, at_rest(HARMONIC))
        model = MultiPhiModel(setup.structure, setup.mechanics.contacts)
        np.testing.assert_array_equal(start_configuration(setup, model), np.zeros(setup.structure.n))

    @pytest.mark.parametrize("models", [MODELS[:1], MODELS])
    def test_the_transverse_direction_carries_the_whole_weight(self, tmp_path, models):
        """Of linear elements without a full model, and of the full model's own."""
        data = changed(["structure", "beam", "masses"], []) | {"models": models, "comparison": {"reference": "r12"}}
        setup = bench_of(tmp_path, data | {"loads": [LOADS["gravity"]]})
        (gravity,) = setup.loads
        sag = setup.structure.row("tip") @ np.linalg.solve(setup.structure.stiffness, gravity.row(setup.structure))
        section = BEAM["structure"]["beam"]["sections"][0]
        width, height, modulus = section["width"], section["height"], section["youngs_modulus"]
        line, bending = 2700 * width * height * -9.81, modulus * width * height**3 / 12
        assert sag == pytest.approx(line * 0.5**4 / (8 * bending), rel=1e-3)  # shear

    def test_matrices_need_a_direction(self, tmp_path):
        np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=np.eye(2))
        data = at_rest(LOADS["gravity"]) | {"structure": {"matrices": "two.npz", "points": {"middle": 0, "tip": 1}}}
        data |= {"models": [{"kind": "reduced", "name": "r12", "modes": 1}]}
        assert complaint(tmp_path, data).startswith("loads[0].direction: got None, need a direction: only a structure")
        data["loads"] = [LOADS["gravity"] | {"direction": {"middle": 1.0, "tip": 1.0}}]
        (gravity,) = bench_of(tmp_path, data).loads
        assert gravity.direction == {"middle": 1.0, "tip": 1.0}


COMPONENT = {"kind": "craig-bampton", "name": "cb", "modes": 2, "step": 1e-4}
STEPWISE = {"kind": "solve-ivp", "name": "ivp", "method": "RK45", "rtol": 1e-4}
BASIS = {"kind": "global-basis", "name": "basis"}
ROUND = {"kind": "full", "name": "round", "elements": 4, "step": 1e-4, "contact": "circle"}
NO_CSV = {"kind": "sampled", "at": "tip", "csv": "no.csv"}
BROKEN = {
    "nothing at all": ([], {}, "start: got nothing, need a value, or loads"),
    "unknown kind": ([HARMONIC | {"kind": "random"}], {}, "loads[0]: got"),
    "unknown point": ([HARMONIC | {"at": "tap"}], {}, "loads[0].at: got 'tap', need one of the points"),
    "unknown coefficient": ([HARMONIC | {"at": {"tap": 1.0}}], {}, "loads[0].at: got 'tap', need one of the points"),
    "weight along one point": (
        [LOADS["gravity"] | {"direction": "tip"}], {}, "loads[0].direction: got 'tip', need an object"
    ),
    "negative frequency": ([HARMONIC | {"frequency_hz": -1.0}], {}, "loads[0].frequency_hz: got -1.0, need greater"),
    "no amplitude": ([{k: v for k, v in HARMONIC.items() if k != "amplitude"}], {}, "loads[0].amplitude: got nothing"),
    "unknown field": ([HARMONIC | {"force": 1.0}], {}, "loads[0].force: got 1.0, need a known field"),
    "unknown stop": ([LOADS["stop-motion"] | {"contact": "floor"}], {}, "loads[0].contact: got 'floor', need one of"),
    "unknown fixed stop": (
        [LOADS["base-motion"] | {"fixed_stops": ["floor"]}], {}, "loads[0].fixed_stops: got 'floor', need one of"
    ),
    "sampled base": (
        [{"kind": "base-motion", "course": {"kind": "sampled"} | SAMPLES}], {}, "loads[0].course: got"
    ),
    "an accelerogram that is a load": (
        [RECORD | {"at": "tip"}], {}, "loads[0]: got"
    ),
    "records of two sources": (
        [{"kind": "base-motion", "course": RECORD | {"csv": "a.csv"}}], {}, "loads[0].course: got"
    ),
    "a record that is not there": (
        [{"kind": "base-motion", "course": {"kind": "accelerogram", "csv": "no.csv"}}], {},
        "loads[0].course: samples: got",
    ),
    "a unit that is none": (
        [{"kind": "base-motion", "course": RECORD | {"factor": "g"}}], {}, "loads[0].course.factor: got 'g', need"
    ),
    "samples of two sources": ([LOADS["sampled"] | {"csv": "a.csv"}], {}, "loads[0]: got"),
    "samples that go back": (
        [LOADS["sampled"] | {"time": [0.0, 0.2, 0.1]}], {}, "loads[0]: samples: got time 0.1 s after 0.2 s"
    ),
    "no such file": ([NO_CSV], {}, "loads[0]: samples: got"),
    "loads on a component": ([HARMONIC], {"models": [COMPONENT]}, "models[0].kind: got 'craig-bampton', need another"),
    "loads of a stepwise model": ([HARMONIC], {"models": [STEPWISE]}, "models[0].kind: got 'solve-ivp', need another"),
    "weight on a global basis": (
        [LOADS["gravity"]], {"models": [BASIS]}, "models[0].kind: got 'global-basis', need another kind"
    ),
    "a round stop that moves": (
        [LOADS["stop-motion"]], {"models": [ROUND]}, "models[0].contact: got 'circle', need 'coordinate'"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_wrong_load_is_named_with_what_was_given_and_needed(tmp_path, case):
    loads, fields, expected = BROKEN[case]
    data = at_rest(*loads, **fields)
    if "models" in fields:
        data["comparison"] = {"reference": fields["models"][0]["name"]}
    assert complaint(tmp_path, data).startswith(expected)


@pytest.mark.parametrize("kind", LOADS)
def test_reduced_user_object_and_full_model_move_as_one(tmp_path, kind):
    """On the stop, without which nothing would tell a moving one; large displacements are what is left between them."""
    data = at_rest(LOADS[kind], models=MODELS, comparison={"reference": "r12"})
    data["outputs"] = {"t_end": 0.1, "interval": 5e-4}
    comparison = compare(bench_of(tmp_path, data), {}, progress=False)
    runs = comparison.runs
    assert {name: run.message for name, run in runs.items()} == dict.fromkeys(runs, "")
    assert all(len(run.contact_intervals["stop"]) for run in runs.values())
    for name, tolerance in (("body", 0.05), ("full", 0.03)):
        assert (
            max(nrmse(runs[name].points[p], runs["r12"].points[p], runs[name].time, 0.1) for p in ("tip",)) < tolerance
        )
    assert runs["full"].ledger["work_of_loads"] == pytest.approx(runs["r12"].ledger["work_of_loads"], rel=0.05)


class TestReport:
    @pytest.fixture(scope="class")
    @staticmethod
    def comparison(tmp_path_factory):
        models = [*MODELS[:2], {"kind": "reduced", "name": "r6"}]
        data = at_rest(HARMONIC, LOADS["gravity"], models=models)
        return compare(bench_of(tmp_path_factory.mktemp("scene"), data), {}, progress=False)

    def test_the_loads_are_told_where_the_start_is(self, comparison):
        told = " ".join(findings(comparison)["compared"])
        assert "harmonic (amplitude 2, frequency_hz 12, " in told
        assert "gravity (acceleration -9.81)" in told
        assert "released" not in told

    def test_energies_are_shares_of_the_largest(self, comparison):
        page = render(comparison, details_of(comparison))
        assert "Shares of the largest energy of the run" in page
        assert "<th>work of loads</th>" in page
        run = comparison.runs["r6"]
        assert comparison.energy_scale(run) == np.max(run.energy) > 0

    def test_the_summary_holds_the_loads(self, comparison):
        scene = summary(comparison)["scene"]
        assert scene["start"] is None
        assert [load["kind"] for load in scene["loads"]] == ["harmonic", "gravity"]
        assert scene["loads"][0]["amplitude"] == 2.0

    def test_tables_of_a_scaled_start_are_left_out(self, comparison):
        assert loss_tables(comparison.setup) == {}

    def test_a_budget_needs_a_start_to_disturb(self, comparison):
        with pytest.raises(MultiPhiValueError, match="without a start, need one"):
            budget(comparison.setup, 4)


def test_every_kind_is_told_in_words(tmp_path):
    scene, _ = loaded(tmp_path, at_rest(*LOADS.values()))
    told = [load.phrase() for load in scene.file.loads]
    assert told[:3] == [
        "constant (at +1 tip and -0.5 middle, force -2)",
        "harmonic (amplitude 2, frequency_hz 12, phase 0.5, at tip)",
        "sampled (time of 3 values, values of 3 values, at tip)",
    ]
    assert told[6] == "base-motion (course harmonic (amplitude 0.004, frequency_hz 12), fixed_stops stop)"


def test_a_released_scene_may_be_loaded_too(tmp_path):
    scene, _ = loaded(tmp_path, BEAM | {"loads": [HARMONIC]})
    assert scene.file.start.displacement == 0.01
    assert len(scene.file.loads) == 1
