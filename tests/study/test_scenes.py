"""Scene files: the shipped ones, and one line naming file and field for every broken one."""

import math

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_scene import BEAM, changed, write

from multiphi_exudyn import MultiPhiValueError, RayleighDamping
from multiphi_exudyn.study.model_kinds import FullModel
from multiphi_exudyn.study.scene import load_scene, mechanics_of, shipped_scenes
from multiphi_exudyn.study.scene_tables import RigStructure
from multiphi_exudyn.study.setup import prepare
from reference_models.rig import rig


def complaint(tmp_path, data):
    """The one line with which a scene is refused."""
    file = write(tmp_path / "scene.toml", data)
    with pytest.raises(MultiPhiValueError) as caught:
        mechanics_of(load_scene(file))
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(file + ": ")
    return line.removeprefix(file + ": ")


OF_THE_RIG = [name for name in shipped_scenes() if isinstance(load_scene(name).file.structure, RigStructure)]


def test_the_shipped_scenes_cover_holes_directions_and_parameter_sets():
    scenes = [load_scene(name) for name in OF_THE_RIG]
    assert {"paper-rig", "paper-rig-minus-z", "paper-rig-printed-pinned"} <= {scene.name for scene in scenes}
    released = [scene.file.start for scene in scenes if scene.file.start is not None]
    starts = {(start.load_at, start.displacement > 0) for start in released}
    assert starts == {(hole, up) for hole in ("hole1", "hole2", "hole3") for up in (True, False)}
    assert {scene.file.structure.rig for scene in scenes} == {
        "measured-free",
        "printed-pinned",
        "as-published",
    }


@pytest.mark.parametrize("name", OF_THE_RIG)
def test_a_shipped_scene_of_the_rig_is_complete(name):
    scene = load_scene(name)
    mechanics = mechanics_of(scene)
    (support,) = mechanics.contacts
    assert support.gap == rig().contact_gap
    assert mechanics.assumptions
    assert any(isinstance(model, FullModel) for model in scene.models.values())


def test_a_contact_of_a_scene_may_have_a_restitution(tmp_path):
    rigid = changed(["contacts", 0], BEAM["contacts"][0] | {"stiffness": math.inf, "restitution": 0.4})
    models = {"models": BEAM["models"][:1]}
    (stop,) = mechanics_of(load_scene(write(tmp_path / "mine.toml", rigid | models))).contacts
    assert stop.restitution == 0.4
    soft = changed(["contacts", 0, "restitution"], 0.4)
    assert "contact 'stop' restitution: got 0.4 beside a finite stiffness" in complaint(tmp_path, soft)
    assert "restitution: got -1" in complaint(tmp_path, changed(["contacts", 0, "restitution"], -1.0))


def test_a_scene_can_describe_its_own_beam(tmp_path):
    scene = load_scene(write(tmp_path / "mine.toml", BEAM))
    mechanics = mechanics_of(scene)
    assert scene.name == "mine"
    assert list(scene.models) == ["all", "r6"]
    assert mechanics.points == ("middle", "tip")
    assert mechanics.beam.masses[0].mass == 0.05
    assert mechanics.damping.ratios == (0.01, 0.02)


def test_a_scene_can_take_matrices_from_a_file(tmp_path):
    np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=np.diag([1.0, 4.0]), difference=[1.0, -1.0])
    data = changed(["structure"], {"matrices": "two.npz", "points": {"middle": 0, "tip": 1, "d": "difference"}})
    data["damping"] = {"alpha": 0.1, "beta": 0.0}
    mechanics = mechanics_of(load_scene(write(tmp_path / "scene.toml", data)))
    np.testing.assert_array_equal(mechanics.matrices.row("d"), [1.0, -1.0])
    assert mechanics.damping == RayleighDamping(0.1, 0.0)


def test_one_file_of_arrays_and_a_file_for_each_matrix_are_the_same_scene(tmp_path):
    rows = {"mass": np.eye(2), "stiffness": np.diag([1.0, 4.0]), "damping": np.eye(2) / 10}
    np.savez(tmp_path / "two.npz", difference=[1.0, -1.0], **rows)
    np.save(tmp_path / "difference.npy", [1.0, -1.0])
    scipy.sparse.save_npz(tmp_path / "mass.npz", scipy.sparse.csr_array(rows["mass"]))
    for name in ("stiffness", "damping"):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", scipy.sparse.csr_array(rows[name]))
    files = {"mass": "mass.npz", "stiffness": "stiffness.mtx", "damping": "damping.mtx"}
    found = []
    for matrices, row in (("two.npz", "difference"), (files, "difference.npy")):
        data = changed(["structure"], {"matrices": matrices, "points": {"middle": 0, "tip": 1, "d": row}})
        data["models"] = [{"kind": "reduced", "name": "r1", "modes": 1, "contact": "rigid"}]
        data["comparison"] = {"reference": "r1"}
        found.append(mechanics_of(load_scene(write(tmp_path / "scene.toml", data))).matrices)
    for name, need in rows.items():
        np.testing.assert_array_equal(getattr(found[0], name), need)
        np.testing.assert_array_equal(getattr(found[1], name).toarray(), need)
    np.testing.assert_array_equal(found[0].row("d"), found[1].row("d"))


def test_a_scene_takes_nodes_supports_and_arrays_by_name_as_read_structure_does(tmp_path):
    """One MATLAB file with names that tell what they are; another whose arrays are named; a table of nodes beside."""
    stiffness = 4e4 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    scipy.io.savemat(tmp_path / "one.mat", {"M": np.eye(3), "K": stiffness})
    scipy.io.savemat(tmp_path / "two.mat", {"A": stiffness, "B": np.eye(3)})
    (tmp_path / "nodes.txt").write_text("1 3\n2 3\n3 3\n")
    named = {"mass": ["two.mat", "B"], "stiffness": ["two.mat", "A"]}
    by_node = {"points": {"middle": [2, 3], "tip": [3, 3]}, "dofs": "nodes.txt", "fixed": [[1, 3]]}
    found = []
    for table in (
        by_node | {"matrices": "one.mat"},
        {"matrices": named, "points": {"middle": 1, "tip": 2}, "fixed": [0]},
    ):
        found.append(mechanics_of(load_scene(write(tmp_path / "scene.toml", changed(["structure"], table)))).matrices)
    for structure in found:
        np.testing.assert_array_equal(structure.stiffness, stiffness[1:, 1:])
        np.testing.assert_array_equal(structure.row("tip"), [0.0, 1.0])


def test_sparse_matrices_are_refused_to_a_model_that_takes_dense_ones(tmp_path):
    for name in ("mass", "stiffness"):
        scipy.sparse.save_npz(tmp_path / f"{name}.npz", scipy.sparse.eye_array(2).tocsr())
    files = {"mass": "mass.npz", "stiffness": "stiffness.npz"}
    data = changed(["structure"], {"matrices": files, "points": {"middle": 0, "tip": 1}})
    data["models"] = [{"kind": "craig-bampton", "name": "cb", "modes": 1, "step": 1e-3}]
    data["comparison"] = {"reference": "cb"}
    assert "models[0].kind: got 'craig-bampton', need another kind: this kind takes dense" in complaint(tmp_path, data)


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


COMPONENT = {"kind": "craig-bampton", "name": "cb", "modes": 2, "step": 1e-4}
STEPWISE = {"kind": "solve-ivp", "name": "ivp", "method": "RK45", "rtol": 1e-4}

FILES = {"mass": "m.mtx", "stiffness": "k.mtx"}
BROKEN = {
    "unknown field": (["outputs", "steps"], 3, "outputs.steps: got 3, need a known field"),
    "missing table": (["start"], None, "start: got nothing, need a value"),
    "missing field": (["contacts", 0, "gap"], None, "contacts[0].gap: got nothing, need a value"),
    "text for a number": (["contacts", 0, "gap"], "1", "contacts[0].gap: got '1', need a valid number"),
    "truth for a number": (["contacts", 0, "gap"], True, "contacts[0].gap: got True, need a valid number"),
    "negative stiffness": (
        ["contacts", 0, "stiffness"], -1.0, "contacts[0].stiffness: got -1.0, need greater than 0"
    ),
    "stiffness by another word": (
        ["contacts", 0, "stiffness"], "inf", "contacts[0].stiffness: got 'inf', need a number or 'rigid'"
    ),
    "stiffness nan": (["contacts", 0, "stiffness"], math.nan, "contacts[0].stiffness: got nan, need greater than 0"),
    "infinite gap": (["contacts", 0, "gap"], math.inf, "contacts[0].gap: got inf, need a finite number"),
    "negative time": (["outputs", "t_end"], -1.0, "outputs.t_end: got -1.0, need greater than 0"),
    "no models": (["models"], [], "models: got [], need"),
    "no modes": (["models", 1, "modes"], 0, "models[1].modes: got 0, need"),
    "modes by half": (["models", 1, "modes"], 2.5, "models[1].modes: got 2.5, need a valid integer or 'all'"),
    "fewer than no modes": (["models", 1], COMPONENT | {"modes": -1}, "models[1].modes: got -1, need greater than or"),
    "no step": (["models", 1], {k: COMPONENT[k] for k in ("kind", "name", "modes")}, "models[1].step: got nothing"),
    "radius above one": (
        ["models", 1], COMPONENT | {"spectral_radius": 1.1}, "models[1].spectral_radius: got 1.1, need less than or"
    ),
    "unknown method": (["models", 1], STEPWISE | {"method": "RK4"}, "models[1].method: got 'RK4', need 'RK45', 'DOP"),
    "no tolerance": (["models", 1], STEPWISE | {"rtol": 0.0}, "models[1].rtol: got 0.0, need greater than or equal"),
    "contact of a stepwise model": (
        ["models", 1], STEPWISE | {"contact": "rigid"}, "models[1].contact: got 'rigid', need a known field"
    ),
    "no start": (["start", "displacement"], 0.0, "start.displacement: got 0.0, need a value that is not zero"),
    "another kind": (["models", 0, "kind"], "exact", "models[0]: got"),
    "structure of no form": (["structure"], {}, "structure: got {}, need a table with the field rig or beam"),
    "unknown rig": (
        ["structure"], {"rig": "mine", "support_stiffness": 1e6}, "structure.rig: got 'mine', need 'measured-free'"
    ),
    "section without end": (
        ["structure", "beam", "sections", 0, "end"], None, "structure.beam.sections[0].end: got nothing"
    ),
    "section backwards": (["structure", "beam", "sections", 0, "end"], -1.0, "structure.beam: section: got start"),
    "point off the beam": (["structure", "beam", "points", "tip"], 0.6, "structure.beam: points['tip']: got x"),
    "unknown load point": (["start", "load_at"], "tap", "start.load_at: got 'tap', need one of the points: middle"),
    "unknown output": (["outputs", "points"], ["tap"], "outputs.points[0]: got 'tap', need one of the points"),
    "unknown direction": (["contacts", 0, "direction"], "tap", "contacts[0].direction: got 'tap', need one of"),
    "unknown coefficient": (["contacts", 0, "direction"], {"tap": 1.0}, "contacts[0].direction: got 'tap', need"),
    "unknown beside a known one": (
        ["contacts", 0, "direction"], {"tap": 1.0, "tip": -1.0}, "contacts[0].direction: got 'tap', need one of"
    ),
    "unknown reference": (["comparison", "reference"], "full", "comparison.reference: got 'full', need one of"),
    "two of a name": (["models", 1, "name"], "all", "models[1].name: got 'all', need another name"),
    "too many samples": (["outputs", "interval"], 1e-12, "outputs.interval: got 1e-12, need at least"),
    "no matrices": (["structure"], {"matrices": "no.npz", "points": {"tip": 0}}, "structure: mass: got"),
    "no matrix": (["structure"], {"matrices": FILES, "points": {"tip": 0}}, "structure: mass: got"),
    "no stiffness": (["structure"], {"matrices": {"mass": "m.mtx"}, "points": {"tip": 0}}, "structure.matrices"),
    "unknown base": (["base"], "paper", "base: got 'paper', need one of: beam-chain"),
    "base of the wrong kind": (["base"], [1], "base: got [1], need one of: beam-chain"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_wrong_field_is_named_with_what_was_given_and_needed(tmp_path, case):
    path, value, expected = BROKEN[case]
    assert complaint(tmp_path, changed(path, value)).startswith(expected)


def test_two_contacts_of_one_name_are_refused(tmp_path):
    data = changed(["contacts"], BEAM["contacts"] * 2)
    assert complaint(tmp_path, data).startswith("contacts: got 'stop', need another name")


def test_a_full_model_needs_a_beam_and_a_finite_stiffness(tmp_path):
    full = {"kind": "full", "name": "full", "elements": 4, "step": 1e-4}
    data = changed(["models"], [*BEAM["models"], full])
    assert "need a finite one" in complaint(tmp_path, changed(["contacts", 0, "stiffness"], math.inf, data))
    np.savez(tmp_path / "one.npz", mass=np.eye(1), stiffness=np.eye(1))
    data["structure"] = {"matrices": "one.npz", "points": {"middle": 0, "tip": 0}}
    assert "this kind is made of beams" in complaint(tmp_path, data)


@pytest.mark.parametrize("model", [COMPONENT, STEPWISE])
def test_a_penalty_model_needs_a_finite_stiffness(tmp_path, model):
    data = changed(["models"], [*BEAM["models"], model])
    line = complaint(tmp_path, changed(["contacts", 0, "stiffness"], math.inf, data))
    needed = f"a finite one: contacts of the model {model['name']} are penalty springs"
    assert line == f"stiffness of contact stop: got 'inf', need {needed}"


def test_a_component_needs_contacts_on_single_points(tmp_path):
    data = changed(["models"], [*BEAM["models"], COMPONENT])
    data = changed(["contacts", 0, "direction"], {"middle": 1.0, "tip": -1.0}, data)
    assert complaint(tmp_path, data).startswith("models[2].kind: got 'craig-bampton', need another kind: its contacts")


def test_printed_frequencies_and_a_stepwise_model_exclude_each_other(tmp_path):
    structure = {"rig": "as-published", "support_stiffness": 1e6}
    variant = {"title": "t", "base": "paper-rig", "structure": structure, "models": [STEPWISE]}
    variant["comparison"] = {"reference": "ivp"}
    assert "models[0].kind: got 'solve-ivp', need reduced" in complaint(tmp_path, variant)


@pytest.mark.parametrize(
    ("model", "modes", "expected"),
    [
        (COMPONENT, 115, "modes of cb: got 115, need at most 114 beside 2 interface points"),
        (STEPWISE, 116, "modes of ivp: got 116, need at most 115 for this structure"),
        ({"kind": "global-basis", "name": "one"}, 116, "modes of one: got 116, need at most 115 for this structure"),
    ],
)
def test_a_baseline_of_more_modes_than_there_are_is_refused(tmp_path, model, modes, expected):
    data = changed(["models"], [*BEAM["models"], model | {"modes": modes}])
    data["outputs"] = {"points": ["middle", "tip"]}
    assert prepared(tmp_path, data) == expected


def test_contact_points_that_follow_from_each_other_are_refused(tmp_path):
    np.savez(tmp_path / "three.npz", mass=np.eye(3), stiffness=np.eye(3), double=[2.0, 0.0, 0.0])
    data = changed(["models"], [COMPONENT | {"modes": 0}])
    data["structure"] = {"matrices": "three.npz", "points": {"middle": 0, "tip": 1, "double": "double"}}
    data["contacts"] = [BEAM["contacts"][0] | {"name": name, "direction": name} for name in ("middle", "double")]
    data["comparison"] = {"reference": "cb"}
    assert prepared(tmp_path, data).endswith("need another: point double follows from the others")


def prepared(tmp_path, data):
    """The one line with which preparing a scene is refused, without its file."""
    file = write(tmp_path / "scene.toml", data)
    scene = load_scene(file)
    with pytest.raises(MultiPhiValueError) as caught:
        prepare(scene)
    return str(caught.value).removeprefix(file + ": ")


def test_a_structure_that_has_no_modes_is_refused_where_it_is_prepared(tmp_path):
    np.savez(tmp_path / "two.npz", mass=np.eye(2), stiffness=np.array([[1.0, 2.0], [2.0, 1.0]]))
    data = changed(["structure"], {"matrices": "two.npz", "points": {"middle": 0, "tip": 1}})
    data |= {"models": [{"kind": "reduced", "name": "all", "modes": "all"}], "comparison": {"reference": "all"}}
    assert prepared(tmp_path, data).startswith("structure: stiffness: indefinite")


@pytest.mark.parametrize("arrays", [{"mass": np.eye(2)}, {"mass": np.eye(2), "stiffness": np.eye(3)}])
def test_wrong_matrices_are_one_line(tmp_path, arrays):
    np.savez(tmp_path / "two.npz", **arrays)
    assert "stiffness" in complaint(tmp_path, changed(["structure"], {"matrices": "two.npz", "points": {"tip": 0}}))


@pytest.mark.parametrize("content", [b"", b"not a zip", b"PK\x03\x04 broken"])
def test_a_broken_matrix_file_is_one_line(tmp_path, content):
    (tmp_path / "two.npz").write_bytes(content)
    data = changed(["structure"], {"matrices": "two.npz", "points": {"tip": 0}})
    assert complaint(tmp_path, data).startswith("structure: mass: got")


@pytest.mark.parametrize("source", ["", "no-such-scene", "no/such.toml", "paper-rig.toml", "../paper-rig", "\0"])
def test_an_unknown_scene_is_answered_with_the_known_ones(source):
    with pytest.raises(MultiPhiValueError, match="need a TOML file or one of: beam-chain"):
        load_scene(source)


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.one_of(st.binary(max_size=200), st.text(max_size=200).map(str.encode)))
def test_any_bytes_are_refused_in_one_line(tmp_path, content):
    file = tmp_path / "scene.toml"
    file.write_bytes(content)
    with pytest.raises(MultiPhiValueError) as caught:
        load_scene(str(file))
    assert "\n" not in str(caught.value)


def places(value, path=()):
    """Paths of all entries of nested tables and arrays."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield [*path, key]
        yield from places(item, (*path, key))


JUNK = st.recursive(
    st.booleans() | st.integers(-(2**60), 2**60) | st.floats() | st.text('ab[]"\n\\{}.é', max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1), inner, max_size=3),
    max_leaves=5,
)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(path=st.sampled_from(list(places(BEAM))), value=st.none() | JUNK)
def test_any_value_anywhere_is_taken_or_refused_in_one_line(tmp_path, path, value):
    file = write(tmp_path / "scene.toml", changed(path, value))
    line = answer(lambda: mechanics_of(load_scene(file)))
    assert line == "" or (line.startswith(file) and "\n" not in line)


def answer(call):
    """The error's text, "" without one."""
    try:
        call()
    except MultiPhiValueError as error:
        return str(error)
    return ""
