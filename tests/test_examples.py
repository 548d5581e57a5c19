"""The examples run, and each is checked by one number."""

import importlib
import importlib.util
import math
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parent.parent / "examples"


def load(name):
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_own_matrices(capsys):
    trajectory = load("own_matrices").main()
    assert abs(trajectory.ledger.residual) < 1e-12
    assert "levels built: 3 of 4" in capsys.readouterr().out


def test_paper_rig(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("sys.argv", ["paper_rig.py", str(tmp_path / "rig.png")])
    trajectories = load("paper_rig").main()
    first = [trajectory.contact_intervals("support")[0][0] for trajectory in trajectories.values()]
    assert first == pytest.approx([0.06897, 0.06897], abs=2e-5)
    assert (tmp_path / "rig.png").stat().st_size > 10_000
    assert capsys.readouterr().out.count("ok") == 2


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
