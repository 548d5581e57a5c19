"""The animation: its shapes are those of the models, its stops stand and change colour where the contacts do."""

import io

import numpy as np
import pytest
from PIL import Image
from small_scene import BEAM, changed, write

import multiphi_exudyn as mp
from multiphi_exudyn import cli
from multiphi_exudyn.study.animation import (
    CLOSED,
    LONGEST,
    MOST_FRAMES,
    PERIOD_SHOWN,
    AnimatedScene,
    _closed,
    gif,
    moving_figure,
    prepare_animation,
)
from multiphi_exudyn.study.runners import run_model
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare

pytestmark = pytest.mark.usefixtures("few_elements")

FULL = {"kind": "full", "name": "full", "elements": 4, "step": 1e-4}
PLAIN = changed(["outputs", "interval"], 1e-4)  # closures between two samples of 1 ms would be averaged
WITH_FULL = changed(["models"], [*BEAM["models"], FULL], PLAIN) | {"comparison": {"reference": "full"}}
PART = BEAM["structure"]["beam"]
CLAP = {"name": "clap", "direction": {"a.tip": 2.0, "b.middle": -2.0}, "gap": 1e-3, "stiffness": 1e5}
PAIR = {
    "structure": {"beams": {"a": PART, "b": PART, "far": PART}},
    "contacts": [CLAP, CLAP | {"name": "stop", "direction": {"b.tip": -1.0}}],
    "start": {"load_at": "a.tip", "measured_at": "a.tip", "displacement": 0.01},
    "models": [{"kind": "reduced", "name": "r", "modes": 30}],
    "comparison": {"reference": "r"},
    "outputs": {"t_end": 0.1, "interval": 1e-4, "points": ["a.tip"]},
}
SAME = 1e-9  # m: the same matrices, by the same routes


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A file of the small scene with a full beam, in an empty working directory."""
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "small.toml", WITH_FULL)


def refused(capsys, *arguments):
    assert cli.main(["animate", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def drawn(path, frame, **chosen):
    """The animated scene, both runs, and the axes of one frame."""
    animated = prepare_animation(load_scene(path), **chosen)
    runs = animated.runs(progress=False)
    figure, move = moving_figure(animated, runs)
    move(frame)
    return animated, runs, figure.axes


def test_points_at_every_node_leave_both_models_as_they_are(scene):
    animated, runs, (axes, _) = drawn(scene, 7, slow=20.0)
    loaded = load_scene(scene)
    setup = prepare(loaded)
    for name, run in runs.items():
        alone = run_model(setup, name, progress=False)
        assert np.max(np.abs(run.points["tip"] - alone.points["tip"])) < SAME
        line = next(each for each in axes.lines if each.get_label() == name)
        now = np.interp(animated.time[7], alone.time, alone.points["tip"])
        assert line.get_ydata()[-1] == pytest.approx(1e3 * now, abs=1e3 * SAME)
        assert line.get_xdata()[[0, -1]] == pytest.approx([0.0, 0.5])
        assert abs(line.get_ydata()[0]) < 1e-12


def test_the_shape_between_the_points_is_the_trajectory_of_the_linear_elements(tmp_path):
    animated, _, (axes, _) = drawn(write(tmp_path / "linear.toml", PLAIN), 4, slow=5.0)
    loaded = load_scene(str(tmp_path / "linear.toml"))
    setup = prepare(loaded)
    model = mp.MultiPhiModel(setup.structure, setup.mechanics.contacts)
    start = model.static_equilibrium({"tip": 1.0})
    trajectory = mp.simulate(model, 0.1, displacement=start * 0.01 / (setup.structure.row("tip") @ start))
    expected = trajectory.displacement(animated.time[4])[::2]
    assert axes.lines[0].get_ydata()[1:] == pytest.approx(1e3 * expected, abs=1e-4)


def test_a_stop_stands_where_the_gap_is_closed_and_has_the_colour_of_closed_only_then(scene):
    animated, runs, _ = drawn(scene, 0, slow=20.0)
    run = runs["full"]
    figure, move = moving_figure(animated, runs)
    closed = _closed(run.contact_intervals["stop"], animated.time)
    assert 0 < np.sum(closed) < len(closed)
    for frame in (0, int(np.argmax(closed))):
        move(frame)
        mark = figure.axes[0].lines[1]
        assert (mark.get_xdata()[0], mark.get_marker()) == (0.3, "^")
        assert mark.get_ydata()[0] == pytest.approx(-1.0, abs=1e-6)
        assert (mark.get_color() == CLOSED) == closed[frame]


def test_a_stop_above_and_one_that_moves(tmp_path):
    course = {"kind": "harmonic", "amplitude": 2e-4, "frequency_hz": 30.0}
    loads = [{"kind": "stop-motion", "contact": "stop", "course": course}]
    data = changed(["contacts", 0, "direction"], {"middle": -1.0}, PLAIN) | {"loads": loads}
    animated, _, (axes, _) = drawn(write(tmp_path / "above.toml", data), 5, model="r6", reference="r6", slow=5.0)
    mark = axes.lines[1]
    assert mark.get_marker() == "v"
    assert mark.get_ydata()[0] == pytest.approx(1 - 0.2 * np.cos(2 * np.pi * 30.0 * animated.time[5]), abs=1e-3)


def test_beams_that_meet_are_each_shown_with_the_other_where_it_would_touch(tmp_path):
    animated, runs, axes = drawn(write(tmp_path / "pair.toml", PLAIN | PAIR), 20, slow=32.0)
    run = runs["r"]
    now = animated.time[20]
    at = {name: 1e3 * np.interp(now, run.time, run.points[name]) for name in ("a.tip", "b.middle")}
    assert len(axes) == 4  # three beams, a history
    of_a, of_b = axes[0].lines[1], axes[1].lines[1]
    assert (of_a.get_marker(), of_b.get_marker()) == ("^", "v")
    assert of_a.get_ydata()[0] == pytest.approx(at["b.middle"] - 0.5, abs=1e-3)
    assert of_b.get_ydata()[0] == pytest.approx(at["a.tip"] + 0.5, abs=1e-3)
    assert len(axes[2].lines) == 2  # nothing touches the third


def test_the_gif_has_every_frame_and_its_rate(scene):
    animated = prepare_animation(load_scene(scene), slow=1.6)
    drawn_frames = []
    content = gif(animated, animated.runs(progress=False), lambda: drawn_frames.append(1))
    with Image.open(io.BytesIO(content)) as written:
        assert written.n_frames == len(animated.time) == len(drawn_frames) == 4
        assert written.info["duration"] == 40
        assert written.info["loop"] == 0


def test_animate_writes_one_file_and_says_where(scene, tmp_path, capsys):
    short = ["animate", scene, "--slow", "4", "--t-end", "0.03"]
    assert cli.main([*short, "--model", "r6"]) == 0
    assert capsys.readouterr().out == "3 frames, 4 times slower than reality\nmultiphi-small/animation.gif\n"
    assert [path.name for path in (tmp_path / "multiphi-small").iterdir()] == ["animation.gif"]
    assert cli.main([*short, "--reference", "all", "--out", str(tmp_path / "b.gif")]) == 0
    assert (tmp_path / "b.gif").stat().st_size > 5000


def test_without_a_factor_a_period_is_shown_at_length_in_a_film_that_ends(scene):
    short, long = (prepare_animation(load_scene(scene, t_end=t_end)) for t_end in (0.1, 10.0))
    assert short.slow * short.setup.longest_period == pytest.approx(PERIOD_SHOWN, rel=0.1)
    assert long.slow * 10.0 == pytest.approx(LONGEST, rel=0.1)


def test_a_model_that_fails_is_exit_code_1_with_its_cause_and_no_file(scene, tmp_path, capsys, monkeypatch):
    data = changed(["models", 2, "newton_tolerance"], 1e-30, WITH_FULL)
    monkeypatch.setattr(AnimatedScene, "runs", lambda animated, progress: _failing(animated))
    assert cli.main(["animate", write(tmp_path / "failing.toml", data)]) == 1
    assert capsys.readouterr().out.startswith("full: failed, ")
    assert list((tmp_path / "multiphi-failing").iterdir()) == []


def _failing(animated):
    """Both runs, the full one not tried again at gentler settings."""
    return {name: run_model(animated.setup, name, progress=False) for name in animated.models}


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["--model", "full"], "--model: got 'full', need one of: all, r6"),
        (["--reference", "none"], "--reference: got 'none', need one of: all, r6, full"),
        (["--slow", "0"], "--slow: got '0', need a factor > 0"),
        (["--slow", "1e6"], f"--slow: got 1e+06, need 0.8 to {MOST_FRAMES / 2.5:g} for 0.1 s"),
        (["--slow", "0.1"], "--slow: got 0.1, need 0.8 to "),
        (["--out", "film.mp4"], "--out: got 'film.mp4', need the name of a .gif file"),
        (["--out", "small.toml/film.gif"], "--out: got 'small.toml', need a folder"),
    ],
)
def test_bad_input_is_exit_code_2_and_one_line(scene, capsys, arguments, expected):
    assert expected in refused(capsys, scene, *arguments)


def test_matrices_and_scenes_without_a_reduced_model_are_refused(tmp_path, capsys):
    np.savez(tmp_path / "m.npz", mass=np.eye(2), stiffness=np.diag([1e4, 4e4]))
    data = changed(["structure"], {"matrices": "m.npz", "points": {"middle": 0, "tip": 1}})
    path = write(tmp_path / "matrices.toml", changed(["models"], [BEAM["models"][0]], data))
    assert refused(capsys, path) == f"{path}: structure: got matrices, need beams, whose shapes are drawn along x\n"
    alone = write(tmp_path / "full.toml", changed(["models"], [FULL], WITH_FULL))
    assert "models: got none that is reduced" in refused(capsys, alone)
