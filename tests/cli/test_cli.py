"""The command line: exit codes, one line for bad input, files that are whole or not there."""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
from small_scene import BEAM, changed, write

import multiphi_exudyn as mp
from multiphi_exudyn import cli
from multiphi_exudyn.cli import THREAD_SETTINGS, parser
from multiphi_exudyn.files import write_whole
from multiphi_exudyn.study import runners
from multiphi_exudyn.study import setup as bench
from multiphi_exudyn.study.scene import shipped_scenes

FILES = {"report.html", "histories.npz", "summary.json"}


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A small scene's file, in an empty working directory, without the seconds that import_times() takes."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("multiphi_exudyn.study.runs.import_times", dict)
    monkeypatch.setattr(bench, "ELEMENTS", 16)
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


def test_modes_end_time_and_folder_are_taken_from_the_command_line(scene, tmp_path):
    """And the reduced error falls with the number of modes."""
    errors = []
    for modes in ("3", "8"):
        folder = tmp_path / "a" / modes
        assert cli.main(["compare", scene, "--modes", modes, "--t-end", "0.05", "--out", str(folder)]) == 0
        content = json.loads((folder / "summary.json").read_text("utf-8"))
        errors.append(content["errors"][f"r{modes}"]["0.05"]["tip"])
        with np.load(folder / "histories.npz") as arrays:
            assert arrays["time"][-1] == pytest.approx(0.05)
    assert errors[1] < 0.2 * errors[0]


def test_a_failed_model_is_exit_code_1_and_still_a_report(scene, tmp_path, monkeypatch, capsys):
    simulate = runners.simulate

    def failing(model, t_end, start, loads):
        if model.modes == 6:
            raise RuntimeError("did not converge\nat 0.02 s")
        return simulate(model, t_end, start=start)

    monkeypatch.setattr(runners, "simulate", failing)
    assert cli.main(["compare", scene]) == 1
    assert "did not converge at 0.02 s" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "multiphi-small").iterdir()} == FILES


def test_an_interrupted_write_leaves_the_old_file_and_no_rest(tmp_path, monkeypatch):
    target = tmp_path / "summary.json"
    target.write_text("old", "utf-8")
    with pytest.raises(TypeError):
        write_whole(target, "not bytes")
    assert target.read_text("utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_an_interrupted_comparison_leaves_no_file(scene, tmp_path, monkeypatch):
    def broken(comparison):
        raise KeyboardInterrupt

    monkeypatch.setattr("multiphi_exudyn.study.compare.summary", broken)
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
        (["compare", "no-such-scene"], "got 'no-such-scene', need a TOML file or one of: beam-chain"),
        (["compare", "papper-rig"], "did you mean 'paper-rig'?"),
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


STUDY = {
    "title": "a small study",
    "scene": "small.toml",
    "methods": [{"name": "levels", "model": {"kind": "reduced"}, "axes": {"modes": [2, 4]}, "quick": {"modes": [2]}}],
}


def test_a_study_leaves_runs_table_and_report_and_goes_on_where_it_was(scene, tmp_path, capsys):
    path = write(tmp_path / "small-study.toml", STUDY)
    folder = tmp_path / "multiphi-small-study"
    assert cli.main(["study", path, "--quick", "--on", "serial", "--out", str(folder)]) == 0
    assert {file.name for file in folder.iterdir()} == {"report.html", "runs.csv", "runs.sqlite"}
    assert len((folder / "runs.csv").read_text("utf-8").splitlines()) == 1 + 2
    capsys.readouterr()
    assert cli.main(["study", path, "--on", "serial"]) == 0
    assert "cheapest within 1 %" in capsys.readouterr().out
    assert len((folder / "runs.csv").read_text("utf-8").splitlines()) == 1 + 3


def test_a_study_over_an_axis_prints_the_worst_of_its_points(scene, tmp_path, capsys):
    """Of 1 mm the beam hardly reaches its stop."""
    axis = {"start.displacement": [1e-3, 0.02]}
    path = write(tmp_path / "axis.toml", STUDY | {"axes": axis, "tolerances": [0.5]})
    assert cli.main(["study", path, "--on", "serial"]) == 0
    printed = capsys.readouterr().out
    assert "cheapest within 50 % at all 2 points" in printed
    assert "; worst at start.displacement = 0.02" in printed
    untimed = write(tmp_path / "untimed.toml", STUDY | {"axes": axis, "timing": False})
    assert cli.main(["study", untimed, "--on", "serial"]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"levels \(r = 4\): error .* % in the median, at most .* %, at all 2 points", printed)


def test_a_study_none_of_whose_settings_ran_has_exit_code_1(scene, tmp_path, capsys):
    study = changed(["methods", 0, "model"], {"kind": "craig-bampton", "modes": 1, "newton_tolerance": 1e-30}, STUDY)
    study = changed(["methods", 0, "axes"], {"step": [1e-4]}, study)
    path = write(tmp_path / "failing.toml", changed(["methods", 0, "quick"], {}, study))
    assert cli.main(["study", path, "--on", "serial"]) == 1
    assert "2 runs, 1 without an answer" in capsys.readouterr().out


def test_a_wrong_study_is_refused_before_anything_is_written(scene, tmp_path, capsys):
    assert "need a TOML file or one of" in refused(capsys, "study", "nothing")
    path = write(tmp_path / "wrong.toml", STUDY | {"scene": "none.toml"})
    assert "SCENE: got 'none.toml'" in refused(capsys, "study", path)
    good = write(tmp_path / "good.toml", STUDY)
    assert "where: 'cloud'" in refused(capsys, "study", good, "--on", "cloud")
    assert "--workers" in refused(capsys, "study", good, "--workers", "0")


def test_the_budget_of_a_scene(scene, tmp_path, capsys, pictures):
    full = [{"kind": "full", "name": name, "elements": 4, "step": h} for name, h in (("fine", 1e-4), ("coarse", 2e-4))]
    data = changed(["outputs"], {"t_end": 0.03, "windows": [0.02]}) | {"models": full, "modes": 3}
    path = write(tmp_path / "full.toml", data | {"comparison": {"reference": "fine", "coarser": "coarse"}})
    with pictures():
        assert cli.main(["budget", path, "--out", "out"]) == 0
    told = capsys.readouterr().out
    assert "rigid ladder, to 0.02 s" in told
    assert "contact law" in told
    values = json.loads((tmp_path / "out" / "budget.json").read_text("utf-8"))
    assert values["modes"] == 3
    assert (tmp_path / "out" / "budget.png").read_bytes().startswith(b"\x89PNG")


def test_the_studies_are_listed(capsys):
    assert cli.main(["studies"]) == 0
    assert "pareto" in capsys.readouterr().out


def installed(*arguments, **options):
    """The command line as a process of its own."""
    return subprocess.run(
        [sys.executable, "-m", "multiphi_exudyn", *arguments], capture_output=True, text=True, check=False, **options
    )


def test_help_and_version_load_nothing_that_a_run_needs():
    commands = [line.split()[0] for line in parser().format_help().splitlines() if line.startswith("    ")]
    assert "compare" in commands
    code = (
        "import sys; from multiphi_exudyn.cli import main\n"
        f"for asked in (['--help'], ['--version'], *([name, '--help'] for name in {commands})):\n"
        "    try: main(asked)\n"
        "    except SystemExit: pass\n"
        "print(sorted({'numpy', 'scipy', 'matplotlib', 'exudyn', 'pydantic', 'jinja2', 'tqdm'} & set(sys.modules)))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.splitlines()[-1] == "[]"


def test_the_command_gives_blas_one_thread_unless_the_user_has_set_the_number():
    code = (
        "import sys; from multiphi_exudyn.cli import command; sys.argv = ['multiphi-exudyn', 'scenes']\n"
        "try: command()\n"
        "except SystemExit: pass\n"
        "import numpy, threadpoolctl; print({pool['num_threads'] for pool in threadpoolctl.threadpool_info()})"
    )
    free = {name: value for name, value in os.environ.items() if name not in THREAD_SETTINGS}
    for given, found in ((free, "{1}"), (free | {"OMP_NUM_THREADS": "2"}, "{2}")):
        told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=given)
        assert told.stdout.splitlines()[-1] == found


def test_version_and_module_entry():
    told = installed("--version")
    assert (told.returncode, told.stdout) == (0, f"multiphi-exudyn {mp.__version__}\n")


@pytest.mark.parametrize(
    "name", ["compare", "animate", "budget", "needs", "study", "stability", "new", "validate", "schema"]
)
def test_the_help_of_a_command_has_a_description_and_an_example_that_is_understood(name, capsys):
    with pytest.raises(SystemExit):
        cli.main([name, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    example = text.partition("Example: multiphi-exudyn ")[2]
    assert example.split()[0] == name
    assert vars(parser().parse_args(example.split()))["command"] == name


def test_a_pipe_that_its_reader_closes_ends_the_command_quietly():
    command = [sys.executable, "-m", "multiphi_exudyn", "scenes"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 141
