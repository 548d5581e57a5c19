"""The command line: exit codes, one line for bad input, files that are whole or not there."""

import json

import numpy as np
import pytest
from small_scene import BEAM, changed, write

from multiphi_exudyn import cli
from multiphi_exudyn.study.running import reduced_runner
from multiphi_exudyn.study.scene.scenes import shipped_scenes

FILES = {"report.html", "histories.npz", "summary.json"}


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A small scene's file, in an empty working directory, without the seconds that environment() takes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "environment", lambda: {"python": "3"})
    return write(tmp_path / "small.toml", BEAM)


def refused(capsys, *arguments):
    """The one line with which the command line refuses its arguments."""
    assert cli.main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_compare_writes_three_whole_files_and_says_where(scene, tmp_path, capsys):
    assert cli.main(["compare", scene]) == 0
    folder = tmp_path / "multiphi-small"
    assert {path.name for path in folder.iterdir()} == FILES
    assert "multiphi-small/report.html" in capsys.readouterr().out
    content = json.loads((folder / "summary.json").read_text("utf-8"))
    assert {row["status"] for row in content["models"].values()} == {"ok"}
    assert content["errors"]["r6"]["0.1"]["tip"] < 0.2
    with np.load(folder / "histories.npz") as arrays:
        assert arrays["all/point/tip"].shape == arrays["time"].shape == (101,)


def test_the_reduced_error_falls_with_the_number_of_modes(scene, tmp_path):
    errors = []
    for modes in ("3", "8"):
        assert cli.main(["compare", scene, "--modes", modes, "--out", modes]) == 0
        content = json.loads((tmp_path / modes / "summary.json").read_text("utf-8"))
        errors.append(content["errors"][f"r{modes}"]["0.1"]["tip"])
    assert errors[1] < 0.2 * errors[0]


def test_end_time_and_folder_are_taken_from_the_command_line(scene, tmp_path):
    assert cli.main(["compare", scene, "--t-end", "0.05", "--out", str(tmp_path / "a" / "b")]) == 0
    with np.load(tmp_path / "a" / "b" / "histories.npz") as arrays:
        assert arrays["time"][-1] == pytest.approx(0.05)


def test_a_failed_model_is_exit_code_1_and_still_a_report(scene, tmp_path, monkeypatch, capsys):
    simulate = reduced_runner.simulate

    def failing(model, t_end, displacement):
        if model.modes == 6:
            raise RuntimeError("did not converge\nat 0.02 s")
        return simulate(model, t_end, displacement=displacement)

    monkeypatch.setattr(reduced_runner, "simulate", failing)
    assert cli.main(["compare", scene]) == 1
    assert "did not converge at 0.02 s" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "multiphi-small").iterdir()} == FILES


def test_an_interrupted_write_leaves_the_old_file_and_no_rest(tmp_path, monkeypatch):
    target = tmp_path / "summary.json"
    target.write_text("old", "utf-8")
    with pytest.raises(TypeError):
        cli._replace(target, "not bytes")
    assert target.read_text("utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_interrupted_comparison_leaves_no_file(scene, tmp_path, monkeypatch):
    def broken(comparison):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "summary", broken)
    assert cli.main(["compare", scene]) == 130
    assert list((tmp_path / "multiphi-small").iterdir()) == []


def test_scenes_are_listed_with_their_titles(capsys):
    assert cli.main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(shipped_scenes())


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], "the following arguments are required"),
        (["simulate"], "invalid choice: 'simulate'"),
        (["compare"], "required: SCENE"),
        (["compare", "no-such-scene"], "got 'no-such-scene', need a TOML file or one of: paper-rig"),
        (["compare", "paper-rig", "--t-end", "-1"], "--t-end: got '-1', need a time > 0"),
        (["compare", "paper-rig", "--t-end", "nan"], "--t-end: got 'nan', need a time > 0"),
        (["compare", "paper-rig", "--t-end", "soon"], "--t-end: got 'soon', need a time > 0"),
        (["compare", "paper-rig", "--modes", "0"], "--modes: got '0', need a whole number >= 1"),
        (["compare", "paper-rig", "--modes", "6.5"], "--modes: got '6.5', need a whole number >= 1"),
        (["compare", "paper-rig", "--modes", "5000"], "got 5000, need at most"),
        (["compare", "paper-rig", "--t-end", "1e9"], "outputs.interval: got 0.0001, need at least"),
        (["compare", "paper-rig", "--mode", "6", "--speed"], "--speed"),
    ],
)
def test_bad_input_is_exit_code_2_and_one_line(capsys, arguments, expected):
    assert expected in refused(capsys, *arguments)


def test_a_wrong_field_is_one_line_with_file_and_field(scene, tmp_path, capsys):
    file = write(tmp_path / "wrong.toml", changed(["contacts", 0, "stiffness"], -1.0))
    assert refused(capsys, "compare", file) == f"{file}: contacts[0].stiffness: got -1.0, need greater than 0\n"
    assert not (tmp_path / "multiphi-wrong").exists()


def test_a_folder_that_is_a_file_is_refused_before_anything_runs(scene, capsys):
    assert "--out: got " in refused(capsys, "compare", scene, "--out", scene)
