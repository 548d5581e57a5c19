"""Scene files: what they become, and one line naming file and field for every broken one."""

import math

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from small_scene import BEAM, changed, write

from multiphi_exudyn import (
    ConstantLoad,
    Harmonic,
    MultiPhiModel,
    MultiPhiValueError,
    RayleighDamping,
    SampledLoad,
    simulate,
)
from multiphi_exudyn.study.model_kinds import FullModel
from multiphi_exudyn.study.scene import load_scene, mechanics_of, shipped_scenes
from multiphi_exudyn.study.scene_tables import RigStructure
from multiphi_exudyn.study.setup import prepare, start_configuration
from reference_models.rig import rig

pytestmark = pytest.mark.usefixtures("few_elements")

OF_THE_RIG = [name for name in shipped_scenes() if isinstance(load_scene(name).file.structure, RigStructure)]
R12 = [{"kind": "reduced", "name": "r12", "modes": 12}]
STIFFNESS = 7e10 * 0.02 * 0.004**3 / 12  # of the beam against bending, N m^2


MOVED = {"kind": "harmonic", "amplitude": 1e-3, "frequency_hz": 12.0}
RECORD = {"kind": "accelerogram", "time": [0.0, 0.02, 0.06, 0.1], "values": [0.0, 1.2, -1.2, 0.0], "factor": 9.81}
LOADS = (
    {"kind": "constant", "at": {"tip": 1.0, "middle": -0.5}, "force": -2.0},
    {"kind": "harmonic", "at": "tip", "amplitude": 2.0, "frequency_hz": 12.0, "phase": 0.5},
    {"kind": "sampled", "at": "tip", "time": [0.0, 0.02, 0.2], "values": [0.0, -2.0, 2.0]},
    {"kind": "sweep", "at": "tip", "amplitude": 2.0, "start_hz": 5.0, "end_hz": 30.0, "duration": 0.5}
    | {"law": "logarithmic"},
    {"kind": "gravity", "acceleration": -9.81},
    {"kind": "stop-motion", "contact": "stop", "course": MOVED | {"phase": -1.5}},
    {"kind": "base-motion", "course": MOVED, "fixed_stops": ["stop"]},
    {"kind": "base-motion", "course": RECORD},
)
SPAN = {"span": [-0.015, 0.015], "tolerance": 0.003}
CUBIC = {"kind": "cubic", "name": "spring", "at": "tip", "k1": 50.0, "k3": 2e6} | SPAN
LAWS = {
    "table": (
        {"kind": "table", "name": "spring", "at": "tip", "q": [-0.01, -2e-3, 4e-3], "force": [-3.0, 0.0, 0.3]},
        lambda q: np.interp(q, [-0.01, -2e-3, 4e-3], [-3.0, 0.0, 0.3]),
    ),
    "cubic": (CUBIC, lambda q: 50.0 * q + 2e6 * q**3),
    "hertz": (
        {"kind": "hertz", "name": "ball", "at": "tip", "stiffness": 2e4, "gap": 1e-3} | SPAN,
        lambda q: -2e4 * np.maximum(-q - 1e-3, 0.0) ** 1.5,
    ),
    "magnet": (
        {"kind": "magnet", "name": "pole", "at": "tip", "strength": 1e-4, "distance": -0.025} | SPAN,
        lambda q: 1e-4 / (q + 0.025) ** 2,  # pulls down
    ),
}


def described(folder, data):
    return mechanics_of(load_scene(write(folder / "scene.toml", data)))


def prepared(folder, data):
    return prepare(load_scene(write(folder / "scene.toml", data)))


def by_matrices(**structure):
    models = {"models": [{"kind": "reduced", "name": "r", "modes": 1}], "comparison": {"reference": "r"}}
    return changed(["structure"], {"points": {"middle": 0, "tip": 1}} | structure) | models


def at_rest(*loads):
    """The small scene without a start, under loads."""
    return changed(["start"], None) | {"loads": list(loads), "models": R12, "comparison": {"reference": "r12"}}


def with_laws(*laws):
    """The small scene without its stop, held by laws."""
    return BEAM | {"contacts": [], "force_laws": list(laws), "models": R12, "comparison": {"reference": "r12"}}


@pytest.mark.parametrize("name", OF_THE_RIG)
def test_a_shipped_scene_of_the_rig_is_complete(name):
    scene = load_scene(name)
    mechanics = mechanics_of(scene)
    if "play" not in name:
        (support,) = mechanics.contacts
        assert support.gap == rig().contact_gap
    assert mechanics.assumptions
    assert any(isinstance(model, FullModel) for model in scene.models.values())


def test_the_shipped_scenes_cover_holes_directions_and_parameter_sets():
    files = [load_scene(name).file for name in OF_THE_RIG]
    starts = {(file.start.load_at, file.start.displacement > 0) for file in files if file.start is not None}
    assert starts == {(hole, up) for hole in ("hole1", "hole2", "hole3") for up in (True, False)}
    assert {file.structure.rig for file in files} == {"measured-free", "printed-pinned", "as-published"}


def test_a_scene_can_describe_its_own_beam(tmp_path):
    scene = load_scene(write(tmp_path / "mine.toml", BEAM))
    mechanics = mechanics_of(scene)
    assert (scene.name, list(scene.models), mechanics.points) == ("mine", ["all", "r6"], ("middle", "tip"))
    assert mechanics.beam.masses[0].mass == 0.05
    assert mechanics.damping.ratios == (0.01, 0.02)


def test_a_variant_takes_what_it_does_not_say_from_its_base(tmp_path):
    variant = {"title": "longer", "base": "paper-rig", "outputs": {"t_end": 2.0, "points": ["node3"]}}
    scene, base = load_scene(write(tmp_path / "longer.toml", variant)), load_scene("paper-rig")
    assert scene.file.outputs.t_end == 2.0
    assert scene.file.models == base.file.models


def test_end_time_and_modes_are_replaced_and_equal_models_run_once():
    scene = load_scene("paper-rig", t_end=0.25, modes=6)
    assert scene.file.outputs.t_end == 0.25
    assert [name for name in scene.models if name.startswith("compliant")] == ["compliant-r6"]
    assert "user-object-r6" in scene.models
    assert "compliant-r6" in load_scene("paper-rig", modes=4).models  # has its own number of modes


def test_a_row_is_its_points_and_contacts_one_by_one(tmp_path):
    stop = {"gap": 1e-3, "stiffness": 1e5}
    points = {"p{i}": {"first": 0.1, "last": 0.5, "count": 3}, "tip": 0.5}
    rows = changed(["structure", "beam", "points"], points)
    rows["contacts"] = [stop | {"name": "s{i}", "direction": {"p{i}": -1.0}, "count": 3}]
    single = changed(["structure", "beam", "points"], {"p1": 0.1, "p2": 0.3, "p3": 0.5, "tip": 0.5})
    single["contacts"] = [stop | {"name": f"s{i}", "direction": {f"p{i}": -1.0}} for i in (1, 2, 3)]
    first, second = (described(tmp_path, data) for data in (rows, single))
    assert [repr(contact) for contact in first.contacts] == [repr(contact) for contact in second.contacts]
    assert first.beam.points == pytest.approx(second.beam.points)


class TestMatrices:
    def test_one_file_of_arrays_and_a_file_for_each_are_the_same_scene(self, tmp_path):
        rows = {"mass": np.eye(2), "stiffness": np.diag([1.0, 4.0]), "damping": np.eye(2) / 10}
        np.savez(tmp_path / "two.npz", difference=[1.0, -1.0], **rows)
        np.save(tmp_path / "difference.npy", [1.0, -1.0])
        scipy.sparse.save_npz(tmp_path / "mass.npz", scipy.sparse.csr_array(rows["mass"]))
        for name in ("stiffness", "damping"):
            scipy.io.mmwrite(tmp_path / f"{name}.mtx", scipy.sparse.csr_array(rows[name]))
        files = {"mass": "mass.npz", "stiffness": "stiffness.mtx", "damping": "damping.mtx"}
        found = []
        for matrices, row in (("two.npz", "difference"), (files, "difference.npy")):
            data = by_matrices(matrices=matrices, points={"middle": 0, "tip": 1, "d": row})
            found.append(described(tmp_path, changed(["damping"], None, data)))
        for name, need in rows.items():
            np.testing.assert_array_equal(getattr(found[0].matrices, name), need)
            np.testing.assert_array_equal(getattr(found[1].matrices, name).toarray(), need)
        np.testing.assert_array_equal(found[0].matrices.row("d"), found[1].matrices.row("d"))
        np.testing.assert_array_equal(found[0].damping, rows["damping"])
        given = by_matrices(matrices="two.npz") | {"damping": {"alpha": 0.1, "beta": 0.0}}
        assert described(tmp_path, given).damping == RayleighDamping(0.1, 0.0)

    def test_nodes_supports_and_arrays_by_name_are_those_of_read_structure(self, tmp_path):
        """A MATLAB file with names that tell what they are; another whose arrays are named; a table of nodes beside."""
        stiffness = 4e4 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
        scipy.io.savemat(tmp_path / "one.mat", {"M": np.eye(3), "K": stiffness})
        scipy.io.savemat(tmp_path / "two.mat", {"A": stiffness, "B": np.eye(3)})
        (tmp_path / "nodes.txt").write_text("1 3\n2 3\n3 3\n")
        named = {"mass": ["two.mat", "B"], "stiffness": ["two.mat", "A"]}
        by_node = {"points": {"middle": [2, 3], "tip": [3, 3]}, "dofs": "nodes.txt", "fixed": [[1, 3]]}
        for table in (
            by_node | {"matrices": "one.mat"},
            {"matrices": named, "points": {"middle": 1, "tip": 2}, "fixed": [0]},
        ):
            structure = described(tmp_path, by_matrices(**table)).matrices
            np.testing.assert_array_equal(structure.stiffness, stiffness[1:, 1:])
            np.testing.assert_array_equal(structure.row("tip"), [0.0, 1.0])


class TestLoads:
    def test_every_kind_becomes_its_load(self, tmp_path):
        constant, harmonic, sampled, sweep, gravity, stop, base, quake = prepared(tmp_path, at_rest(*LOADS)).loads
        assert (type(constant), constant.at, constant.force) == (ConstantLoad, {"tip": 1.0, "middle": -0.5}, -2.0)
        assert harmonic.course == Harmonic(2.0, 12.0, 0.5)
        np.testing.assert_array_equal(sampled.force, [0.0, -2.0, 2.0])
        assert (sweep.law, sweep.duration) == ("logarithmic", 0.5)
        assert gravity.acceleration == -9.81
        assert stop.course == Harmonic(1e-3, 12.0, -1.5)
        assert (base.course, base.fixed_stops) == (Harmonic(1e-3, 12.0), ("stop",))
        assert (quake.course.values.tolist(), quake.course.factor) == (RECORD["values"], 9.81)

    def test_every_kind_is_told_in_words(self, tmp_path):
        scene = load_scene(write(tmp_path / "scene.toml", at_rest(*LOADS)))
        assert [load.phrase() for load in scene.file.loads][:3] == [
            "constant (at +1 tip and -0.5 middle, force -2)",
            "harmonic (amplitude 2, frequency_hz 12, phase 0.5, at tip)",
            "sampled (time of 3 values, values of 3 values, at tip)",
        ]

    @pytest.mark.parametrize("factor", [9.81, 0.01])
    def test_a_record_from_a_file_shakes_the_base_in_its_unit(self, tmp_path, factor):
        """Against the force -M e a(t) of the same record."""
        time, values = np.array([0.0, 0.05, 0.1, 0.2]), np.array([0.0, 6.0, -8.0, 0.0]) / factor
        np.savetxt(tmp_path / "record.csv", np.transpose([time, 0 * time, values]), delimiter=",", header="s, b, a")
        course = {"kind": "accelerogram", "csv": "record.csv", "column": 2, "factor": factor}
        setup = prepared(tmp_path, at_rest({"kind": "base-motion", "course": course}))
        (base,) = setup.loads
        model, structure = MultiPhiModel(setup.structure, setup.mechanics.contacts, modes=12), setup.structure
        force = SampledLoad(-structure.mass @ structure.row(base.direction), time, factor * values)
        shaken, pushed = (simulate(model, 0.3, loads=[load]) for load in (base, force))
        assert shaken.events
        times = np.linspace(0.0, 0.3, 50)
        expected = pushed.at("tip", times)
        np.testing.assert_allclose(shaken.at("tip", times), expected, atol=1e-9 * np.max(np.abs(expected)))
        np.testing.assert_array_equal(start_configuration(setup, model), np.zeros(setup.structure.n))

    @pytest.mark.parametrize("full", [[], [{"kind": "full", "name": "full", "elements": 4, "step": 1e-4}]])
    def test_the_transverse_direction_carries_the_whole_weight(self, tmp_path, full):
        """Of linear elements without a full model, and of the full model's own."""
        data = at_rest({"kind": "gravity", "acceleration": -9.81}) | {"models": R12 + full}
        setup = prepared(tmp_path, changed(["structure", "beam", "masses"], [], data))
        (gravity,) = setup.loads
        sag = setup.structure.row("tip") @ np.linalg.solve(setup.structure.stiffness, gravity.row(setup.structure))
        assert sag == pytest.approx(2700 * 0.02 * 0.004 * -9.81 * 0.5**4 / (8 * STIFFNESS), rel=1e-3)  # shear

    def test_matrices_need_a_direction(self, tmp_path):
        np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=np.eye(2))
        data = by_matrices(matrices="two.npz") | {"loads": [{"kind": "gravity", "acceleration": -9.81}]}
        assert "loads[0].direction: got None" in complaint(tmp_path, data)
        data["loads"][0]["direction"] = {"middle": 1.0, "tip": 1.0}
        assert prepared(tmp_path, data).loads[0].direction == {"middle": 1.0, "tip": 1.0}


class TestLaws:
    @pytest.mark.parametrize("kind", LAWS)
    def test_every_kind_becomes_its_law(self, tmp_path, kind):
        given, exact = LAWS[kind]
        (law,) = described(tmp_path, with_laws(given)).force_laws
        q = np.linspace(*law.knots[[0, -1]], 500)
        np.testing.assert_allclose(law.force(q), exact(q), atol=0.0031 * np.max(np.abs(exact(q))))
        assert (law.name, law.at) == (given["name"], "tip")

    @pytest.mark.parametrize(("distance", "pull"), [(0.02, 1.0), (-0.02, -1.0)])
    def test_a_magnet_attracts_from_its_side_and_repels_with_a_negative_strength(self, tmp_path, distance, pull):
        attracts = LAWS["magnet"][0] | {"distance": distance}
        repels = attracts | {"name": "other", "strength": -1e-4}
        first, second = described(tmp_path, with_laws(attracts, repels)).force_laws
        assert -first.law(0.0) == pytest.approx(pull * 1e-4 / 0.02**2)
        assert second.law(0.0) == -first.law(0.0)

    def test_segments_instead_of_a_tolerance(self, tmp_path):
        counted = {key: value for key, value in CUBIC.items() if key != "tolerance"} | {"segments": 8}
        (law,) = described(tmp_path, with_laws(counted)).force_laws
        assert len(law.slopes) == 8

    def test_a_law_is_in_balance_at_the_start(self, tmp_path):
        """At the tip a static force holds beam and law together, everywhere else the beam is in balance."""
        setup = prepared(tmp_path, with_laws(CUBIC))
        model = setup.model(setup.scene.models["r12"])
        x, tip = start_configuration(setup, model), setup.structure.row("tip")
        assert tip @ x == pytest.approx(0.01, rel=1e-9)
        assert setup.structure.stiffness @ x == pytest.approx(tip * 3 * 0.01 * STIFFNESS / 0.5**3, rel=2e-3, abs=1e-6)
        held = tip @ setup.structure.stiffness @ x + setup.mechanics.force_laws[0].force(0.01)
        np.testing.assert_allclose(model.static_equilibrium({"tip": held}), x, atol=1e-9 * 0.01)


# one line for every broken scene


def complaint(folder, data, build=mechanics_of):
    """The one line with which a scene is refused, without its file."""
    file = write(folder / "scene.toml", data)
    with pytest.raises(MultiPhiValueError) as caught:
        build(load_scene(file))
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(file + ": ")
    return line.removeprefix(file + ": ")


CB = {"kind": "craig-bampton", "name": "cb", "modes": 2, "step": 1e-4}
IVP = {"kind": "solve-ivp", "name": "ivp", "method": "RK45", "rtol": 1e-4}
FULL = {"kind": "full", "name": "full", "elements": 4, "step": 1e-4}
ROUND = FULL | {"contact": "circle"}
LAW = CUBIC
RING = {"name": "ring", "direction": "middle", "limit": 0.8, "stiffness": 2e4}
WAVE = {"kind": "harmonic", "at": "tip", "amplitude": 2.0, "frequency_hz": 12.0}
SAMPLED = {"kind": "sampled", "at": "tip", "time": [0.0, 0.2], "values": [0.0, 1.0]}
WEIGHT = {"kind": "gravity", "acceleration": -9.81}
QUAKE = {"kind": "base-motion", "course": RECORD}
LIFT = {"kind": "stop-motion", "contact": "stop", "course": MOVED}
FILES = {"mass": "m.mtx", "stiffness": "k.mtx"}
TWO_POINTS = {"tip": 1.0, "middle": -1.0}
FIELDS = [  # path, value, with what the line begins
    (["outputs", "steps"], 3, "outputs.steps: got 3"),
    (["start"], None, "start: got nothing"),
    (["contacts", 0, "gap"], None, "contacts[0].gap: got nothing"),
    (["contacts", 0, "gap"], "1", "contacts[0].gap: got '1'"),
    (["contacts", 0, "gap"], True, "contacts[0].gap: got True"),
    (["contacts", 0, "gap"], math.inf, "contacts[0].gap: got inf"),
    (["contacts", 0, "stiffness"], -1.0, "contacts[0].stiffness: got -1.0"),
    (["contacts", 0, "stiffness"], "inf", "contacts[0].stiffness: got 'inf', need a number or 'rigid'"),
    (["contacts", 0, "stiffness"], math.nan, "contacts[0].stiffness: got nan"),
    (["contacts", 0, "restitution"], 0.4, "contacts[0]: contact 'stop' restitution: got 0.4"),
    (["contacts", 0, "restitution"], -1.0, "contacts[0].restitution: got -1"),
    (["contacts", 0, "direction"], "tap", "contacts[0].direction: got 'tap', need one of the points: middle, tip"),
    (["contacts", 0, "direction"], {"tap": 1.0, "tip": -1.0}, "contacts[0].direction: got 'tap'"),
    (["contacts"], BEAM["contacts"] * 2, "contacts: got 'stop', need another name"),
    (["outputs", "t_end"], -1.0, "outputs.t_end: got -1.0"),
    (["outputs", "points"], ["tap"], "outputs.points[0]: got 'tap'"),
    (["outputs", "interval"], 1e-12, "outputs.interval: got 1e-12"),
    (["models"], [], "models: got []"),
    (["models", 1, "modes"], 0, "models[1].modes: got 0"),
    (["models", 1, "modes"], 2.5, "models[1].modes: got 2.5"),
    (["models", 1], CB | {"modes": -1}, "models[1].modes: got -1"),
    (["models", 1], CB | {"spectral_radius": 1.1}, "models[1].spectral_radius: got 1.1"),
    (["models", 1], IVP | {"method": "RK4"}, "models[1].method: got 'RK4'"),
    (["models", 1], IVP | {"rtol": 0.0}, "models[1].rtol: got 0.0"),
    (["models", 1], IVP | {"contact": "rigid"}, "models[1].contact: got 'rigid'"),
    (["models", 0, "kind"], "exact", "models[0]: got"),
    (["models", 1, "name"], "all", "models[1].name: got 'all', need another name"),
    (["comparison", "reference"], "full", "comparison.reference: got 'full', need one of"),
    (["start", "displacement"], 0.0, "start.displacement: got 0.0"),
    (["start", "load_at"], "tap", "start.load_at: got 'tap'"),
    (["structure"], {}, "structure: got {}, need a table with the field rig or beam"),
    (["structure"], {"rig": "mine", "support_stiffness": 1e6}, "structure.rig: got 'mine'"),
    (["structure"], {"matrices": "no.npz", "points": {"tip": 0}}, "structure: mass: got"),
    (["structure"], {"matrices": FILES, "points": {"tip": 0}}, "structure: mass: got"),
    (["structure"], {"matrices": {"mass": "m.mtx"}, "points": {"tip": 0}}, "structure.matrices"),
    (["structure", "beam", "sections", 0, "end"], None, "structure.beam.sections[0].end: got nothing"),
    (["structure", "beam", "sections", 0, "end"], -1.0, "structure.beam: section: got start"),
    (["structure", "beam", "points", "tip"], 0.6, "structure.beam: points['tip']: got x"),
    (["structure", "beam", "points", "row"], {"first": 0.1, "last": 0.5, "count": 3}, "structure.beam: points: got"),
    (["base"], "paper", "base: got 'paper', need one of: beam-chain"),
    (["base"], [1], "base: got [1], need one of: beam-chain"),
    (["force_laws"], [LAW | {"kind": "quintic"}], "force_laws[0]: got"),
    (["force_laws"], [LAW | {"at": "tap"}], "force_laws[0].at: got 'tap'"),
    (["force_laws"], [LAW | {"k5": 1.0}], "force_laws[0].k5: got 1.0"),
    (["force_laws"], [LAW | {"span": [0.01, -0.01]}], "force_laws[0]: force law 'spring' span: got"),
    (["force_laws"], [LAW | {"segments": 9}], "force_laws[0]: force law 'spring': got tolerance 0.003 and seg"),
    (["force_laws"], [LAWS["magnet"][0] | {"distance": 0.01}], "force_laws[0]: got"),
    (["force_laws"], [LAW, LAW], "force_laws[1].name: got 'spring', need another name"),
    (["force_laws"], [LAW | {"name": "stop"}], "force_laws[0].name: got 'stop', need another name"),
    (["friction"], [RING | {"limit": -1.0}], "friction[0].limit: got -1.0"),
    (["friction"], [RING | {"static_limit": 0.5}], "friction[0]: friction 'ring' static_limit: got 0.5"),
    (["friction"], [RING | {"direction": "tap"}], "friction[0].direction: got 'tap'"),
    (["friction"], [RING, RING], "friction[1].name: got 'ring', need another name"),
    (["loads"], [WAVE | {"kind": "random"}], "loads[0]: got"),
    (["loads"], [WAVE | {"at": {"tap": 1.0}}], "loads[0].at: got 'tap'"),
    (["loads"], [WAVE | {"frequency_hz": -1.0}], "loads[0].frequency_hz: got -1.0"),
    (["loads"], [WAVE | {"force": 1.0}], "loads[0].force: got 1.0"),
    (["loads"], [SAMPLED | {"csv": "a.csv"}], "loads[0]: got"),
    (["loads"], [SAMPLED | {"time": [0.2, 0.1]}], "loads[0]: samples: got time 0.1 s after 0.2 s"),
    (["loads"], [{"kind": "sampled", "at": "tip", "csv": "no.csv"}], "loads[0]: samples: got"),
    (["loads"], [WEIGHT | {"direction": "tip"}], "loads[0].direction: got 'tip'"),
    (["loads"], [LIFT | {"contact": "floor"}], "loads[0].contact: got 'floor', need one of"),
    (["loads"], [QUAKE | {"fixed_stops": ["floor"]}], "loads[0].fixed_stops: got 'floor', need one of"),
    (["loads"], [QUAKE | {"course": {"kind": "sampled", "time": [0.0], "values": [0.0]}}], "loads[0].course: got"),
    (["loads"], [QUAKE | {"course": RECORD | {"factor": "g"}}], "loads[0].course.factor: got 'g'"),
    (["loads"], [QUAKE | {"course": {"kind": "accelerogram", "csv": "no.csv"}}], "loads[0].course: samples: got"),
]


@pytest.mark.parametrize(("path", "value", "expected"), FIELDS)
def test_a_wrong_field_is_named_with_what_was_given(tmp_path, path, value, expected):
    assert complaint(tmp_path, changed(path, value)).startswith(expected)


NOT_FOR_IT = [  # model, fields of the scene, with what the line begins
    (FULL, {"contacts": [BEAM["contacts"][0] | {"stiffness": "rigid"}]}, "stiffness of contact stop: got 'inf'"),
    (CB, {"contacts": [BEAM["contacts"][0] | {"stiffness": "rigid"}]}, "stiffness of contact stop: got 'inf'"),
    (IVP, {"contacts": [BEAM["contacts"][0] | {"stiffness": "rigid"}]}, "stiffness of contact stop: got 'inf'"),
    (CB, {"contacts": [BEAM["contacts"][0] | {"direction": TWO_POINTS}]}, "models[0].kind: got 'craig-bampton'"),
    (FULL, {"contacts": [BEAM["contacts"][0] | {"direction": {"tip": 1.0, "middle": -0.5}}]}, "models[0].kind: got"),
    (ROUND, {"contacts": [BEAM["contacts"][0] | {"direction": TWO_POINTS}]}, "models[0].contact: got 'circle'"),
    (ROUND, {"loads": [LIFT]}, "models[0].contact: got 'circle'"),
    (CB, {"loads": [WAVE]}, "models[0].kind: got 'craig-bampton'"),
    (IVP, {"loads": [WAVE]}, "models[0].kind: got 'solve-ivp'"),
    ({"kind": "global-basis", "name": "b"}, {"loads": [WEIGHT]}, "models[0].kind: got 'global-basis'"),
    (CB, {"force_laws": [LAW]}, "models[0].kind: got 'craig-bampton'"),
    (IVP, {"force_laws": [LAW]}, "models[0].kind: got 'solve-ivp'"),
    (FULL, {"force_laws": [LAW | {"at": TWO_POINTS}]}, "models[0].kind: got 'full'"),
    (IVP, {"friction": [RING]}, "models[0].kind: got 'solve-ivp'"),
    (FULL, {"friction": [RING | {"stiffness": "rigid"}]}, "friction[0].stiffness: got 'inf'"),
]


@pytest.mark.parametrize(("model", "fields", "expected"), NOT_FOR_IT)
def test_what_a_model_cannot_have_is_told_before_a_run(tmp_path, model, fields, expected):
    data = BEAM | fields | {"models": [model], "comparison": {"reference": model["name"]}}
    assert complaint(tmp_path, data).startswith(expected)


@pytest.mark.parametrize(
    ("model", "structure", "expected"),
    [
        (FULL, {"matrices": "two.npz"}, "models[0].kind: got 'full', need another kind"),
        (CB, {"matrices": {"mass": "m.npz", "stiffness": "m.npz"}}, "structure: stiffness: got"),
        (CB, {"matrices": {"mass": "m.npz", "stiffness": "k.npz"}}, "models[0].kind: got 'craig-bampton'"),
    ],
)
def test_what_a_model_cannot_have_of_matrices_is_told(tmp_path, model, structure, expected):
    np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=np.eye(2))
    for name in "mk":
        scipy.sparse.save_npz(tmp_path / f"{name}.npz", scipy.sparse.eye_array(2).tocsr())
    data = by_matrices(**structure) | {"models": [model], "comparison": {"reference": model["name"]}}
    assert complaint(tmp_path, data).startswith(expected)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"models": [IVP]}, "models[0].kind: got 'solve-ivp'"),
        ({"force_laws": [LAW | {"at": "node3"}]}, "force_laws[0].name: got 'spring'"),
        ({"structure": {"clamp_rotation": 1e3}}, "structure.clamp_rotation: got 1000.0"),
    ],
)
def test_printed_frequencies_are_of_a_rigid_clamp_and_support_alone(tmp_path, fields, expected):
    structure = {"rig": "as-published", "support_stiffness": 1e6} | fields.pop("structure", {})
    data = {"base": "paper-rig", "title": "t", "structure": structure}
    data |= {"models": [{"kind": "reduced", "name": "r", "contact": "rigid"}]} | fields
    data["comparison"] = {"reference": data["models"][0]["name"]}
    assert complaint(tmp_path, data).startswith(expected)


@pytest.mark.parametrize(
    ("model", "modes", "expected"),
    [
        (CB, 115, "modes of cb: got 115, need at most "),
        (IVP, 116, "modes of ivp: got 116, need at most "),
        ({"kind": "global-basis", "name": "one"}, 116, "modes of one: got 116, need at most "),
    ],
)
def test_more_modes_than_there_are_are_refused(tmp_path, model, modes, expected):
    data = changed(["models"], [*BEAM["models"], model | {"modes": modes}])
    assert complaint(tmp_path, data, prepare).startswith(expected)


def test_contact_points_that_follow_from_each_other_are_refused(tmp_path):
    np.savez(tmp_path / "three.npz", mass=np.eye(3), stiffness=np.eye(3), double=[2.0, 0.0, 0.0])
    data = by_matrices(matrices="three.npz", points={"middle": 0, "tip": 1, "double": "double"})
    data |= {"models": [CB | {"modes": 0}], "comparison": {"reference": "cb"}}
    data["contacts"] = [BEAM["contacts"][0] | {"name": name, "direction": name} for name in ("middle", "double")]
    assert "point double follows" in complaint(tmp_path, data, prepare)


def test_a_structure_that_has_no_modes_is_refused_where_it_is_prepared(tmp_path):
    np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=np.array([[1.0, 2.0], [2.0, 1.0]]))
    assert complaint(tmp_path, by_matrices(matrices="two.npz"), prepare).startswith("structure: stiffness: indefinite")


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 broken"])
def test_a_broken_matrix_file_is_one_line(tmp_path, content):
    (tmp_path / "two.npz").write_bytes(content)
    assert complaint(tmp_path, by_matrices(matrices="two.npz")).startswith("structure: mass: got")


@pytest.mark.parametrize("source", ["", "no-such-scene", "no/such.toml", "paper-rig.toml", "../paper-rig"])
def test_an_unknown_scene_is_answered_with_the_known_ones(source):
    with pytest.raises(MultiPhiValueError, match="need a TOML file or one of: beam-chain"):
        load_scene(source)
