"""What a scene does not need is left out: levels, coordinates and memory of the shipped scenes' runs, packages."""

import json
import pickle

import pytest
from small_scene import BEAM, changed, write

from multiphi_exudyn import cli
from multiphi_exudyn.study import needs as needs_module
from multiphi_exudyn.study.needs import needs_of
from multiphi_exudyn.study.run_alone import run_alone
from multiphi_exudyn.study.scene import load_scene, shipped_scenes

LEVELS = {
    "rubbing-stop": 4,
    "beam-chain": 8,
    "bed-of-stops": 21,
    "rig-clamp-play": 3,
    "two-sided-stop": 3,
}  # two for all others
POSSIBLE = {
    "beam-chain": 8,
    "bed-of-stops": 2**100,
    "two-sided-stop": 4,
    "rig-clamp-play": 4,
    "friction-ring": 3,
    "rubbing-stop": 4,
}
MEMORY = {
    "beam-chain": 10e6,
    "bed-of-stops": 70e6,
    "rubbing-stop": 12e6,
}  # bytes at most; 8 MB for all others, of the loop's code and record
PACKAGES = {"numpy", "scipy"}  # numpy may bring others
HEAVY = {"exudyn", "jinja2", "matplotlib", "numba", "pandas", "pydantic"}
MOST_MODULES = 207  # of this package, whose core has no more files and rooms; nothing of study, plugin or command line
T_END = {"bed-of-stops": 0.08}  # s, of a run that takes seconds
VARIANTS = ("hole", "minus-z", "as-published", "printed-pinned")  # of the rig: other numbers of the same scene


@pytest.fixture
def in_this_process(monkeypatch):
    """The run takes its levels and memory wherever it is made; only what it imports asks for a process of its own."""
    monkeypatch.setattr(needs_module, "_run_in_process", lambda task: json.dumps(run_alone(*pickle.loads(task))))


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("name", [name for name in shipped_scenes() if not any(part in name for part in VARIANTS)])
def test_a_shipped_scene_takes_what_it_visits(name):
    needs = needs_of(load_scene(name, t_end=T_END.get(name)))
    assert needs.status == "ok"
    assert needs.levels_built == LEVELS.get(name, 2)
    assert needs.levels_possible == POSSIBLE.get(name, 2)
    assert needs.dofs_carried <= 0.3 * needs.dofs_given
    assert 0 < needs.memory <= MEMORY.get(name, 8e6)


def test_a_run_imports_what_it_needs_and_nothing_heavy():
    """Friction and a compliant stop that rubs: the scene that uses most rooms."""
    needs = needs_of(load_scene("rubbing-stop"))
    assert set(needs.packages) >= PACKAGES
    assert not HEAVY & set(needs.packages)
    assert 10 < needs.modules <= MOST_MODULES
    assert 0 < needs.memory <= MEMORY["rubbing-stop"]


@pytest.mark.usefixtures("in_this_process")
def test_a_contact_that_is_never_reached_costs_no_level(tmp_path):
    far = changed(("contacts", 0, "gap"), 10.0)
    needs = needs_of(load_scene(write(tmp_path / "far.toml", far)))
    assert (needs.levels_built, needs.levels_possible) == (1, 2)


@pytest.mark.usefixtures("in_this_process")
def test_the_command_prints_a_line_for_every_scene(tmp_path, capsys):
    assert cli.main(["needs", write(tmp_path / "small.toml", BEAM)]) == 0
    heads, line = capsys.readouterr().out.splitlines()
    assert heads.split()[:3] == ["scene", "model", "levels"]
    assert "2 of 2" in line
    assert set(line.rpartition("   ")[2].strip().split(", ")) >= PACKAGES


def test_a_scene_without_a_reduced_model_is_refused(tmp_path, capsys):
    models = [{"kind": "full", "name": "all", "elements": 4, "step": 1e-4}]
    assert cli.main(["needs", write(tmp_path / "full.toml", changed(("models",), models))]) == 2
    assert "need one" in capsys.readouterr().err
