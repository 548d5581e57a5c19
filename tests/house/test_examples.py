"""The examples run, and each is checked by one number."""

import importlib
import importlib.util
import math
import sys
import warnings
from pathlib import Path

import exudyn as exu
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.study import study_file

EXAMPLES = Path(__file__).parents[2] / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def test_own_matrices(capsys):
    trajectory = load("own_matrices").main()
    assert abs(trajectory.ledger.residual) < 1e-12
    assert "levels built: 3 of 4" in capsys.readouterr().out


def test_structures_from_files(capsys):
    example = load("structures_from_files")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        (tip, force), *files, alone, completed = example.main().values()
    assert tip == 0
    assert [own for own, _ in files] == pytest.approx([0, 0], abs=1e-8)
    assert abs(completed[1] / force - 1) < 0.05 < 0.4 < alone[1] / force - 1
    assert completed[0] < alone[0] / 2
    assert capsys.readouterr().out.count("missing modes") == 1


def test_same_model_again(capsys):
    """The differences that the gallery tells; round-off is what 1e-16 grows to over the impacts of half a second."""
    apart = load("same_model_again").main()
    round_off = {"sweep": 1e-9, "restart": 1e-9, "pressed": 1e-13}
    told = round_off | {"record": 2e-5, "damper": 2e-8}
    assert {name: value <= told[name] for name, value in apart.items()} == dict.fromkeys(apart, True), apart
    printed = capsys.readouterr().out
    assert "9 gaps" in printed
    assert "brakes 13 times" in printed
    assert "slides for 0.150 s, takes 31.97 J in all" in printed


def test_paper_rig(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["paper_rig.py", str(tmp_path / "rig.png")])
    trajectories = load("paper_rig").main()
    first = [trajectory.contact_intervals("support")[0][0] for trajectory in trajectories.values()]
    assert first == pytest.approx([0.06897, 0.06897], abs=2e-5)
    assert (tmp_path / "rig.png").stat().st_size > 10_000
    assert capsys.readouterr().out.count("ok") == 2


def test_friction_ring(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["friction_ring.py", str(tmp_path / "ring.png")])
    example = load("friction_ring")
    monkeypatch.setattr(example, "MODES", (6, 8))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        errors = example.main()
    assert errors[example.OWN][8] < 2e-4 < 8e-4 < errors[example.MASSLESS][8]
    assert (tmp_path / "ring.png").stat().st_size > 10_000
    assert "rigid: 39 events, sticks 0.290 s, takes 4.645 mJ of 5.051 mJ" in capsys.readouterr().out


def test_parameter_study(capsys, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    example = importlib.import_module("parameter_study")
    monkeypatch.setattr(example, "AXES", {"stiffness": [1e5, 1e6], "displacement": [0.02]})
    path = str(tmp_path / "runs.sqlite")
    rows = example.main(path, "serial")
    assert [row.status for row in rows] == ["ok", "ok"]
    assert rows[1].values["first contact [ms]"] == pytest.approx(68.97, abs=0.1)
    assert example.main(path, "serial") == rows
    assert capsys.readouterr().out.count("impulse") == 4


def test_force_laws(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["force_laws.py", str(tmp_path / "laws.png")])
    example = load("force_laws")
    monkeypatch.setattr(example, "SEGMENTS", (8, 16, 64))
    errors = example.main()
    for runs in errors.values():
        assert math.log2(runs["native"][1] / runs["native"][2]) / 2 > 1.8
        assert runs["user object"] == pytest.approx(runs["native"], rel=0.02)
    assert (tmp_path / "laws.png").stat().st_size > 10_000
    assert capsys.readouterr().out.count("order") == 4


def test_friction_in_exudyn(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["friction_in_exudyn.py", str(tmp_path / "ring.png")])
    example = load("friction_in_exudyn")
    monkeypatch.setattr(example, "STEPS", (4e-4, 1e-4))
    monkeypatch.setattr(example, "T_END", 0.25)
    found = example.main()
    time = found.full[1e-4].time
    assert found.error({name: found.reduced.at(name, time) for name in example.POINTS}) < 2e-3
    assert (tmp_path / "ring.png").stat().st_size > 10_000
    assert "friction, 3 N by a bristle of 20000 N/m" in capsys.readouterr().out


def test_modal_test(capsys, tmp_path):
    picture = tmp_path / "modal.png"
    own, found = load("modal_test").main([str(picture)])
    assert found.frequencies == pytest.approx(own.frequencies, rel=0.002)
    assert found.ratios == pytest.approx(own.ratios, rel=0.05)
    assert len(found.frequencies) == 4
    assert capsys.readouterr().out.count("\n") == 5
    assert picture.stat().st_size > 10_000


def test_first_second_frequencies(capsys, monkeypatch, tmp_path):
    """Cycles are counted as they are; with contact the rate lies between the free frequency and its limit."""
    example, picture = load("first_second_frequencies"), tmp_path / "rates.png"
    time = np.arange(0.0, 2.0005, 1e-3)
    slower = np.sin(2 * np.pi * 6.0 * time) + 0.1 * np.sin(2 * np.pi * 37.0 * time)
    assert example.rates(time, slower) == pytest.approx(6.0, rel=0.01)
    shipped = Path(study_file.__file__).parent / "studies" / "clamp.toml"
    text = shipped.read_text().replace("elements = 12, step = 2e-5", "elements = 6, step = 2e-4")  # of the full beam
    (tmp_path / "clamp.toml").write_text(text)
    monkeypatch.setattr(example, "STUDIES", {str(tmp_path / "clamp.toml"): "rotation [N m/rad]"})
    (found,) = example.main(["--quick", str(picture)]).values()
    for free, limit, rise in found.values():
        assert free < 4.01
        assert 0.2 < rise[0] < limit
        assert rise[-1] < rise[0]
    assert capsys.readouterr().out.count("free ") == 2
    assert picture.stat().st_size > 10_000


def test_frequency_response(capsys, tmp_path):
    picture = tmp_path / "response.png"
    found = load("frequency_response").main([str(picture)])
    assert found.up.amplitude("node2")[-1] == pytest.approx(found.down.amplitude("node2")[0], rel=1e-6)
    assert found.up.amplitude("node2")[-1] == pytest.approx(found.linear("node2", np.array([10.0]))[0], rel=1e-4)
    assert found.up.duty("support")[0] > 0.02
    assert capsys.readouterr().out.count("node2") == 8
    assert picture.stat().st_size > 10_000


def test_meshed_cantilever(capsys, tmp_path):
    picture = tmp_path / "cantilever.png"
    example = load("meshed_cantilever")
    beam, (coarse, fine) = example.main([str(picture)])
    off = [np.max(np.abs(found.bending / beam.bending - 1)) for found in (coarse, fine)]
    assert off[1] < off[0] / 2 < 2e-3
    assert example.difference(fine.tip, beam.tip) < min(0.015, example.difference(coarse.tip, beam.tip))
    assert example.difference(fine.force, beam.force) < 0.05
    assert len(fine.trajectory.events) == len(beam.trajectory.events) == 12
    assert capsys.readouterr().out.count("12 events") == 2
    assert picture.stat().st_size > 10_000


def test_plate_on_many_stops(capsys, tmp_path):
    costs = load("plate_on_many_stops").main([str(tmp_path / "plate.pvd")])
    own, residual = (cost.trajectory for cost in costs.values())
    assert own.status == residual.status == "ok"
    assert len(own.events) == len(residual.events) > 20
    times = np.linspace(0, 0.1, 101)
    assert np.abs(own.at("tip", times) - residual.at("tip", times)).max() < 1e-4 * np.abs(own.at("tip", times)).max()
    assert len(list(tmp_path.glob("*.vtu"))) == 101
    assert "for ParaView" in capsys.readouterr().out


def test_draw_body(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(exu.config, "printToConsole", False)
    example = load("draw_body")
    start, later = np.vsplit(example.main().astype(int), 2)
    assert start.shape == (example.WINDOW[1], example.WINDOW[0], 3)
    red, green, blue = np.moveaxis(np.array([start, later]), -1, 0)
    orange = np.sum((red > 150) & (green > 0.4 * red) & (green < 0.7 * red) & (blue < 0.4 * red), axis=(1, 2))
    assert orange[0] == 0 < orange[1]
    assert (tmp_path / "body_in_exudyn.png").stat().st_size > 10_000


def test_coupled_body(capsys, monkeypatch, tmp_path):
    example, picture = load("coupled_body"), tmp_path / "coupled.png"
    monkeypatch.setattr(example, "CASES", example.CASES[1:4:2])  # others: test_interface.py
    monkeypatch.setattr(example, "T_END", 0.25)
    monkeypatch.setattr(example, "STEPS", example.STEPS[:5:4])
    monkeypatch.setattr(example, "FINE", 2.5e-5)
    monkeypatch.setattr(example, "REPEATS", 1)
    found = example.main([str(picture)])
    for runs in found.values():
        assert runs.errors[-1] < 3e-4
        assert example.order(runs.errors) == pytest.approx(2.0, abs=0.35)
        assert runs.apart < 5e-5
        assert runs.small_error < 3e-3
        assert runs.small.events >= 2
    assert picture.stat().st_size > 10_000
    assert capsys.readouterr().out.count("apart") == 2


def test_jointed_body(capsys, monkeypatch, tmp_path):
    example, picture = load("jointed_body"), tmp_path / "jointed.png"
    monkeypatch.setattr(example, "CASES", example.CASES[:1])
    monkeypatch.setattr(example, "T_END", 0.12)
    monkeypatch.setattr(example, "STEPS", example.STEPS[::4])
    monkeypatch.setattr(example, "FINE", 2.5e-5)
    found = example.main([str(picture)])
    for runs in found.values():
        assert runs.errors[-1] < 1e-4
        assert example.order(runs.errors) == pytest.approx(2.1, abs=0.35)
        assert runs.apart < 2e-5
        assert runs.small_error < 3e-3
        assert len(runs.small.histories.events) >= 2
    assert picture.stat().st_size > 10_000
    assert capsys.readouterr().out.count("apart") == 1


def test_vary_a_body(capsys, monkeypatch, tmp_path):
    example, picture = load("vary_a_body"), tmp_path / "varied.png"
    monkeypatch.setattr(example, "TRIED", 3)
    monkeypatch.setattr(example, "RANGE", (140.0, 180.0))
    monkeypatch.setattr(example, "GENERATIONS", 2)
    monkeypatch.setattr(example, "POPULATION", 4)
    found = example.main([str(picture)])
    assert found.again < 1e-9
    assert 140 <= found.best <= 180
    assert found.best_motion == pytest.approx(example.motion({"stiffness": found.best}), rel=1e-9)
    assert found.best_motion < np.max(found.motion)
    assert found.stiffness == pytest.approx([140.0, 160.0, 180.0])
    assert picture.stat().st_size > 10_000
    assert "taken up at half time" in capsys.readouterr().out


def test_reduce_your_model(capsys, tmp_path):
    picture = tmp_path / "reduced.png"
    found = load("reduce_your_model").main([str(picture)])
    errors = found.errors(0.25)
    assert errors["on its own"] == pytest.approx(0.0021, abs=0.001)
    assert errors["as a body in Exudyn"] == pytest.approx(errors["on its own"], rel=0.01)
    assert "contacts: 8" in capsys.readouterr().out


def test_bed_of_stops(capsys, monkeypatch, tmp_path):
    picture = tmp_path / "bed.png"
    example = load("bed_of_stops")
    monkeypatch.setattr(example, "ELEMENTS", (100, 400))
    coarse, fine = example.main([str(picture)], 20, 0.16)
    assert coarse.trajectory.status == fine.trajectory.status == "ok"
    assert len(coarse.trajectory.events) > 15
    first = [each.trajectory.events[0].time for each in (coarse, fine)]
    assert first[0] == pytest.approx(first[1], rel=1e-4)
    assert capsys.readouterr().out.count("1.05e+06") == 2
    assert picture.stat().st_size > 10_000


def test_meshed_bed(capsys, monkeypatch):
    """Times are for a quiet machine; the events of two meshes and the size of their bases are the same on any."""
    monkeypatch.syspath_prepend(EXAMPLES)
    example = importlib.import_module("meshed_bed")
    monkeypatch.setattr(example, "QUICK", ((50, 2), (100, 2)))
    coarse, fine = example.main([], stops=20, t_end=0.012, repeats=1)
    assert (coarse.n, fine.n) == (1000, 2000)
    assert coarse.size == fine.size
    assert coarse.events == fine.events > 10
    assert min(coarse.new, coarse.known, fine.new, fine.known) > 0
    assert "levels known: the finest mesh to the coarsest" in capsys.readouterr().out


def test_coupled_speed(capsys, monkeypatch):
    """Times are not asserted: both move the tip alike, and the body has every event."""
    monkeypatch.syspath_prepend(EXAMPLES)
    rows = load("coupled_speed").main(rounds=1)
    assert [row.events for row in rows] == [20, 4, 6]
    assert max(row.apart for row in rows) < 0.01
    assert all(0 < row.ratio < math.inf for row in rows)
    assert capsys.readouterr().out.count("Exudyn alone") == 3


def test_body_speed(capsys):
    """Times are not asserted: a step of the body is as good as any other, and its error is that of its modes."""
    rows = load("body_speed").main(rounds=1)
    six = [row.error for name, row in rows.items() if name.startswith("body, 6 modes") and "rigid" not in name]
    assert len(six) == 4
    assert six == pytest.approx([0.0113] * 4, rel=0.02)
    assert rows["body, 9 modes, 2810 steps"].error < 5e-3
    assert rows["body, 10 modes, 3430 steps"].error < 5e-4
    assert all(0 < row.median < math.inf for row in rows.values())
    assert capsys.readouterr().out.count("at most") == 5


def test_run_cost(capsys):
    """Times are not asserted: a record takes what its numbers take."""
    costs = load("run_cost").main(rounds=1)
    memory = {name: found[-1] for name, found in costs.items()}
    assert memory["6 modes, free"] == pytest.approx(243, rel=0.02)
    assert memory["12 modes, free"] == pytest.approx(340, rel=0.02)
    assert memory["12 modes, harmonic"] <= 400
    for *measured, _ in costs.values():
        for cost in measured:
            assert all(0 < time < math.inf for time in (cost.short, cost.run, cost.bare, cost.ledger))
    assert capsys.readouterr().out.count("of which warnings") == 6


def test_level_cost(capsys):
    """Times are not asserted: every level takes longer with each of the things that its first event needs."""
    costs = load("level_cost").main(rounds=1)
    assert len(costs) == 4
    assert all(row[0] > 0 and row == sorted(row) and row[-1] < math.inf for row in costs.values())
    assert capsys.readouterr().out.count("map back") == 4


def test_event_cost(capsys):
    """Times are not asserted: the events are."""
    costs = load("event_cost").main(rounds=1)
    assert [cost.events for (modes, _), cost in costs.items() if modes == 6] == [76, 173, 345, 342]
    assert costs[6, "belt"].segment == pytest.approx(2.2 * costs[6, "contact"].segment, rel=0.05)
    assert all(0 < cost.run < math.inf for cost in costs.values())
    assert capsys.readouterr().out.count("times a contact's") == 6
