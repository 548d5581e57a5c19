"""The animation: its shapes are those of the models, its stops stand and change colour where the contacts do."""

import io

import numpy as np
import pytest
from PIL import Image
from small_scene import BEAM, changed, write

import multiphi_exudyn as mp
from multiphi_exudyn import cli
from multiphi_exudyn.cli import animate_command
from multiphi_exudyn.mechanics.beam import Beam, Section
from multiphi_exudyn.study.comparison.animation import CLOSED, frame_count, frames, gif
from multiphi_exudyn.study.comparison.film import LONGEST, MOST_FRAMES, PERIOD_SHOWN, film_of, run_stage, stage_of
from multiphi_exudyn.study.comparison.placement import Placement, placements
from multiphi_exudyn.study.running.runners import run_model
from multiphi_exudyn.study.scene.mechanics import mechanics_of
from multiphi_exudyn.study.scene.scenes import load_scene
from multiphi_exudyn.study.scene.workbench import prepare
from reference_models.beams import Beams

FULL = {"kind": "full", "name": "full", "elements": 4, "step": 1e-4}
PLAIN = changed(["outputs", "interval"], 1e-4)  # closures between two samples of 1 ms would be averaged
WITH_FULL = changed(["models"], [*BEAM["models"], FULL], PLAIN) | {"comparison": {"reference": "full"}}
SAME = 1e-9  # m: the same matrices, by the same routes


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """A file of the small scene with a full beam, in an empty working directory."""
    monkeypatch.chdir(tmp_path)
    return write(tmp_path / "small.toml", WITH_FULL)


def filmed(path, **chosen):
    stage = stage_of(load_scene(path), **chosen)
    return film_of(stage, run_stage(stage, progress=False))


def has(image, colour):
    wanted = tuple(int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return bool(np.any(np.all(np.asarray(image.convert("RGB"))[: image.height * 2 // 3] == wanted, axis=-1)))


def refused(capsys, *arguments):
    assert cli.main(["animate", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_points_at_every_node_leave_both_models_as_they_are(scene):
    film = filmed(scene, slow=20.0)
    loaded = load_scene(scene)
    bench = prepare(loaded, mechanics_of(loaded))
    for take in film.takes:
        alone = run_model(bench, take.run.name, progress=False)
        (line,) = take.lines
        assert np.max(np.abs(take.run.points["tip"] - alone.points["tip"])) < SAME
        assert np.array_equal(line.deflection[-1], take.history)
        assert take.history == pytest.approx(np.interp(film.time, alone.time, alone.points["tip"]), abs=SAME)
        assert np.max(np.abs(line.deflection[0])) < 1e-15


def test_the_shape_between_the_points_is_the_trajectory_of_the_linear_elements(tmp_path):
    film = filmed(write(tmp_path / "linear.toml", PLAIN), slow=5.0)
    loaded = load_scene(str(tmp_path / "linear.toml"))
    bench = prepare(loaded, mechanics_of(loaded))
    model = mp.MultiPhiModel(bench.structure, bench.mechanics.contacts)
    start = model.static_equilibrium({"tip": 1.0})
    trajectory = mp.simulate(model, 0.1, displacement=start * 0.01 / (bench.structure.row("tip") @ start))
    assert film.takes[0].run.name == film.takes[1].run.name == "all"
    (line,) = film.takes[0].lines
    frame = len(film.time) // 3
    expected = trajectory.displacement(film.time[frame])[::2]
    assert line.deflection[1:, frame] == pytest.approx(expected, abs=1e-7)


def test_a_stop_stands_where_the_gap_is_closed_and_tells_when_it_is(scene):
    film = filmed(scene, slow=20.0)
    for take in film.takes:
        (stop,) = take.stops
        (line,) = take.lines
        struck = line.deflection[np.argmin(np.abs(line.x - stop.x))]
        assert stop.z == pytest.approx(-1e-3, abs=1e-9)
        assert (stop.x, stop.side) == (0.3, "below")
        assert 0 < np.sum(stop.closed) < len(film.time)
        assert np.all(struck[stop.closed] < -1e-3 + 1e-9)
        assert np.all(struck[~stop.closed] > -1e-3 - 1e-9)


def test_a_stop_above_and_one_that_moves(tmp_path):
    course = {"kind": "harmonic", "amplitude": 2e-4, "frequency_hz": 30.0}
    loads = [{"kind": "stop-motion", "contact": "stop", "course": course}]
    data = changed(["contacts", 0, "direction"], {"middle": -1.0}, PLAIN) | {"loads": loads}
    film = filmed(write(tmp_path / "above.toml", data), model="r6", reference="r6", slow=5.0)
    (stop,) = film.takes[0].stops
    assert stop.side == "above"
    assert stop.z == pytest.approx(1e-3 - 2e-4 * np.cos(2 * np.pi * 30.0 * film.time), abs=1e-6)


def test_the_gif_has_every_frame_and_the_colour_of_closed_stops_only_where_one_is_closed(scene):
    film = filmed(scene, slow=8.0)
    closed = [any(stop.closed[k] for take in film.takes for stop in take.stops) for k in range(len(film.time))]
    images = list(frames(film))
    assert [has(image, CLOSED) for image in images] == closed
    assert len(set(closed)) == 2
    with Image.open(io.BytesIO(gif(images, frame_count(film)))) as written:
        assert written.n_frames == frame_count(film) == 20
        assert written.size == images[0].size
        assert written.info["duration"] == 40
        for k in (0, 19):
            written.seek(k)
            assert np.array_equal(np.asarray(written.convert("RGB")), np.asarray(images[k].convert("RGB")))


def test_animate_writes_one_file_and_says_where(scene, tmp_path, capsys):
    assert cli.main(["animate", scene, "--slow", "4", "--t-end", "0.05", "--model", "r6"]) == 0
    assert capsys.readouterr().out == "5 frames, 4 times slower\nmultiphi-small/animation.gif\n"
    assert [path.name for path in (tmp_path / "multiphi-small").iterdir()] == ["animation.gif"]
    assert cli.main(["animate", scene, "--slow", "4", "--reference", "all", "--out", str(tmp_path / "b.gif")]) == 0
    assert (tmp_path / "b.gif").stat().st_size > 5000


def test_without_a_factor_a_period_is_shown_at_length_in_a_film_that_ends(scene):
    short, long = (stage_of(load_scene(scene, t_end=t_end)) for t_end in (0.1, 10.0))
    assert short.slow * short.bench.longest_period == pytest.approx(PERIOD_SHOWN, rel=0.1)
    assert long.slow * 10.0 == pytest.approx(LONGEST, rel=0.1)


def test_a_model_that_fails_is_exit_code_1_with_its_cause_and_no_file(scene, tmp_path, capsys, monkeypatch):
    data = changed(["models", 2, "newton_tolerance"], 1e-30, WITH_FULL)
    monkeypatch.setattr(animate_command, "run_stage", lambda stage, progress: _failing(stage))
    assert cli.main(["animate", write(tmp_path / "failing.toml", data)]) == 1
    assert capsys.readouterr().out.startswith("full: failed, ")
    assert list((tmp_path / "multiphi-failing").iterdir()) == []


def _failing(stage):
    """Both runs, the full one not tried again at gentler settings."""
    return {name: run_model(stage.bench, name, progress=False) for name in stage.models}


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


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """A film of beams a over b, that clap; b under a stop; a third beam that nothing touches."""
    return filmed(write(tmp_path_factory.mktemp("pair") / "pair.toml", PLAIN | PAIR), slow=32.0)  # contacts last 1 ms


def line_at(line, x):
    return line.height + line.deflection[np.argmin(np.abs(line.x - x))]


def test_two_beams_are_drawn_touching_where_and_when_their_contact_is_closed(pair):
    take = pair.takes[0]
    clap, _ = take.stops
    a, b, _ = take.lines
    assert clap.side == "between"
    assert 0 < np.sum(clap.closed) < len(pair.time)
    distance = line_at(a, clap.x) - line_at(b, clap.x)
    assert distance[0] == pytest.approx(1e-3 / 2 + 0.01, abs=1e-6)
    assert np.all(distance[clap.closed] < 1e-9)
    assert np.all(distance[~clap.closed] > -1e-9)
    assert clap.z == pytest.approx((line_at(a, clap.x) + line_at(b, clap.x)) / 2)


def test_a_stop_of_a_beam_that_is_drawn_lower_is_drawn_lower(pair):
    take = pair.takes[0]
    _, stop = take.stops
    assert stop.side == "above"
    assert stop.z - take.lines[1].height == pytest.approx(1e-3)


def test_a_beam_that_nothing_touches_is_drawn_below_all_others(pair):
    *others, far = pair.takes[0].lines
    assert far.name == "far"
    assert far.height < min(np.min(line.height + line.deflection) for line in others)


def test_beams_in_contact_have_the_colour_of_it_and_open_ones_have_no_mark(pair):
    closed = [any(stop.closed[k] for stop in pair.takes[0].stops) for k in range(len(pair.time))]
    assert [has(image, CLOSED) for image in frames(pair)] == closed
    assert len(set(closed)) == 2


def test_beams_tied_to_each_other_have_one_height_and_the_tie_one_place():
    section = Section.rectangle(0, 0.5, width=0.03, height=0.004, youngs_modulus=7e10, density=2700)
    part = Beam([section], {"tip": 0.5, "middle": 0.3})
    beams = Beams({"a": part, "b": part, "c": part}, ({"b.tip": 1.0, "a.middle": -1.0}, {"c.tip": 1.0}))
    found = placements(beams, [mp.UnilateralContact("below", {"c.tip": -1.0, "b.middle": 1.0}, 2e-3, 1e5)])
    assert found["a"] == Placement(0.0, 0.0, 0)
    assert (found["b"].shift, found["b"].height, found["b"].group) == pytest.approx((-0.2, 0.0, 0))
    assert (found["c"].shift, found["c"].height, found["c"].group) == pytest.approx((-0.4, -2e-3, 0))
