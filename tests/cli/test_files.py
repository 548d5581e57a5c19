"""What a newcomer has: a file to start from, a check without a run, and a study of what the subject is about."""

import json

import pytest
from small_study import result_of, row

from multiphi_exudyn import MultiPhiValueError, cli
from multiphi_exudyn.study import load
from multiphi_exudyn.study.accuracy import csv_text
from multiphi_exudyn.study.scene import with_value


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def told(capsys, *arguments):
    code = cli.main([*arguments])
    printed = capsys.readouterr()
    return code, printed.out, printed.err


def test_templates_are_valid_as_they_are_and_overwrite_nothing(folder, capsys):
    assert told(capsys, "new", "study") == (0, "study.toml\nscene.toml\n", "")
    code, out, _ = told(capsys, "validate", "scene.toml")
    assert code == 0
    assert out.startswith("scene.toml: valid, a scene of ")
    code, out, _ = told(capsys, "validate", "study.toml")
    assert code == 0
    assert "27 points (3 of contacts.*.gap x 3 of contacts.*.stiffness x 3 of loads.0.frequency_hz), 135 runs" in out
    code, _, err = told(capsys, "new", "scene")
    assert (code, err) == (2, "FILE: got 'scene.toml', which exists already, need another name\n")
    assert told(capsys, "new", "scene", "other.toml")[:2] == (0, "other.toml\n")
    assert sorted(path.name for path in folder.iterdir()) == ["other.toml", "scene.toml", "study.toml"]


def test_what_is_shipped_is_valid_by_its_name(folder, capsys):
    assert told(capsys, "validate", "paper-rig")[1].startswith("paper-rig: valid, a scene of ")
    assert told(capsys, "validate", "pareto")[1].startswith("pareto: valid, a study of ")
    assert "got 'no-such'" in told(capsys, "validate", "no-such")[2]


def test_all_faults_at_once(folder, capsys):
    told(capsys, "new", "scene")
    text = (folder / "scene.toml").read_text()
    wrong = text.replace("stiffness = 1e5", "stifness = 1e5").replace("frequency_hz", "frequency")
    (folder / "scene.toml").write_text(wrong.replace('modes = "all"', "modes = 0"))
    code, out, err = told(capsys, "validate", "scene.toml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    for fault in (
        "contacts[0].stifness: got 100000.0, need a known field",
        "loads[0].frequency: got 12.0, need a known field",
        "contacts[0].stiffness: got nothing, need a value",
        "loads[0].frequency_hz: got nothing, need a value",
        "models[1].modes: got 0, need",
    ):
        assert fault in err


def test_points_that_are_not_there_are_told_all_at_once(folder, capsys):
    told(capsys, "new", "scene")
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text.replace('direction = "middle"', 'direction = "midle"'))
    _, _, err = told(capsys, "validate", "scene.toml")
    assert (
        err == "scene.toml: contacts[0].direction: got 'midle', need one of the points: middle, tip; "
        "did you mean 'middle'?\n"
    )


def test_a_scene_given_as_a_study_and_the_reverse_are_told_in_one_sentence(folder, capsys):
    told(capsys, "new", "study")
    assert told(capsys, "study", "scene.toml")[2].startswith("scene.toml: got a scene, need a study")
    assert told(capsys, "compare", "study.toml")[2].startswith("study.toml: got a study, need a scene")


@pytest.mark.parametrize(
    ("axis", "said"),
    [
        ("contacts.*.gab", "contacts[0].gab: got 0.0005, need a known field"),
        ("contacts.stp.gap", "got 'stp', need one of the entries: *, 0, stop; did you mean 'stop'?"),
        ("contacts.1.gap", "got '1', need one of the entries: *, 0, stop"),
        ("contact.stop.gap", "contact: got {'stop': {'gap': 0.0005}}, need a known field"),
        ("modes.gap", "got 'gap' inside 6, need a field"),
    ],
)
def test_an_axis_that_leads_nowhere_is_told_before_a_run(folder, capsys, axis, said):
    told(capsys, "new", "study")
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text.replace('"contacts.*.gap"', f'"{axis}"'))
    code, _, err = told(capsys, "validate", "study.toml")
    assert code == 2
    assert said in err


def test_schemas_name_every_field_and_what_may_stand_for_infinity(capsys):
    for kind, field in (("scene", "contacts"), ("study", "methods")):
        code, out, _ = told(capsys, "schema", kind)
        assert code == 0
        assert field in json.loads(out, parse_constant=pytest.fail)["properties"]
    code, out, _ = told(capsys, "schema", "scene")
    contact = json.loads(out)["$defs"]["ContactSpec"]["properties"]
    assert {"const": "rigid"} in contact["stiffness"]["anyOf"]
    assert contact["tangential_stiffness"]["default"] == "rigid"
    assert contact["gap"]["description"] == "m, at x = 0"


def test_a_study_of_gap_stiffness_and_frequency_from_the_templates_alone(folder, capsys):
    """What `new` writes runs, gives its pictures, and its table pivots; rows and physics are as they must be."""
    told(capsys, "new", "study")
    text = (folder / "study.toml").read_text()
    (folder / "study.toml").write_text(text.replace("timing = true", "timing = false").replace("[4, 8, 16]", "[8]"))
    text = (folder / "scene.toml").read_text()
    (folder / "scene.toml").write_text(text.replace("t_end = 0.5", "t_end = 0.3").replace("1e-4 # s", "1e-3 # s"))
    code, _, _ = told(capsys, "study", "study.toml", "--quick", "--on", "serial")
    assert code == 0
    report = (folder / "multiphi-study-quick" / "report.html").read_text()
    assert all(f"<h2>Along {axis}</h2>" in report for axis in ("contacts.*.gap", "contacts.*.stiffness"))
    runs = load("multiphi-study-quick")
    ours = runs[runs.method == "Multi-Phi"]
    assert len(ours) == 8
    assert set(runs.status) == {"ok"}
    assert (ours.error < 0.5).all()
    assert isinstance(ours["intervals.stop"].iloc[0], list)
    forces = ours.pivot_table("largest_force.stop", "at.contacts.*.gap", "at.contacts.*.stiffness")
    assert forces.shape == (2, 2)
    assert (forces[1e6] > forces[1e4]).all()
    exact = runs[runs.method == "reference"].set_index(ours.index)
    assert (ours["largest.tip"] / exact["largest.tip"]).to_numpy() == pytest.approx(1.0, abs=0.1)


def test_numbers_stay_numbers_beside_words(folder):
    rows = [row("a", 0.1, {"structure.clamp_rotation": value}) for value in (30.0, "rigid")]
    (folder / "runs.csv").write_text(csv_text(result_of(rows)))
    assert list(load(folder)["at.structure.clamp_rotation"]) == [30.0, "rigid"]
    assert list(load(folder).error) == [0.1, 0.1]
    with pytest.raises(MultiPhiValueError, match="need the folder of a finished study"):
        load(folder / "nothing")


DATA = {
    "contacts": [{"name": "a.tip", "gap": 1.0}, {"name": "b", "gap": 2.0}],
    "damping": {"modal_ratios": [0.1, 0.2]},
    "structure": {"beams": {"left": {"sections": [{"height": 1.0}]}, "right": {"sections": [{"height": 2.0}]}}},
}


def test_places_by_name_by_number_all_at_once_and_whole_tables():
    def gaps(place, value):
        return [contact["gap"] for contact in with_value(DATA, place, value)["contacts"]]

    assert gaps("contacts.a.tip.gap", 3.0) == [3.0, 2.0]
    assert gaps("contacts.1.gap", 3.0) == [1.0, 3.0]
    assert gaps("contacts.*.gap", 3.0) == [3.0, 3.0]
    assert gaps("contacts.b", {"name": "c", "gap": 4.0}) == [1.0, 4.0]
    assert with_value(DATA, "damping.modal_ratios.1", 0.3)["damping"] == {"modal_ratios": [0.1, 0.3]}
    beams = with_value(DATA, "structure.beams.*.sections.0.height", 5.0)["structure"]["beams"]
    assert [beam["sections"][0]["height"] for beam in beams.values()] == [5.0, 5.0]
    assert with_value(DATA, "outputs.t_end", 1.0)["outputs"] == {"t_end": 1.0}
    assert with_value(DATA, "structure", {"rig": "x"})["structure"] == {"rig": "x"}
    assert DATA["contacts"][0]["gap"] == 1.0
    with pytest.raises(MultiPhiValueError, match="need a field of a table or a list"):
        with_value(DATA, "contacts.b.gap.more", 1.0)
