"""What a report tells beside the comparison: shapes at the start, losses by height, the motion long after, bases."""

from dataclasses import replace

import numpy as np
import pytest
from small_scene import changed, write

from multiphi_exudyn.study import details
from multiphi_exudyn.study.compare import compare
from multiphi_exudyn.study.details import basis_table, initial_shape, long_motions, loss_tables
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare, start_configuration

pytestmark = pytest.mark.usefixtures("few_elements")

RIGID = {"kind": "reduced", "name": "rigid", "modes": 4, "contact": "rigid"}


def setup_of(folder, *models, **outputs):
    data = changed(["models"], [{"kind": "reduced", "name": "all", "modes": "all"}, *models])
    data |= {"outputs": data["outputs"] | outputs, "comparison": {"reference": "all"}}
    return prepare(load_scene(write(folder / "small.toml", data)))


def test_the_initial_shape_passes_through_the_start_at_every_point(tmp_path):
    setup = setup_of(tmp_path)
    (beam,) = initial_shape(setup)
    start = start_configuration(setup, setup.model(setup.scene.models["all"]))
    for name, x in setup.mechanics.beam.points.items():
        assert np.interp(x, beam.x, beam.shapes[0]) == pytest.approx(setup.structure.row(name) @ start, rel=1e-3)


def test_without_a_contact_that_it_reaches_the_motion_long_after_keeps_the_first_frequency_and_its_phase(tmp_path):
    setup = setup_of(tmp_path)
    far = tuple(replace(contact, gap=1.0) for contact in setup.mechanics.contacts)
    (course,) = long_motions(replace(setup, mechanics=replace(setup.mechanics, contacts=far)), ["all"])
    assert course.last == 0.0
    assert course.time[-1] == pytest.approx(32 * setup.longest_period, rel=0.01)
    assert course.frequency(0.0, course.time[-1]) * setup.longest_period == pytest.approx(1.0, rel=2e-3)
    assert np.max(np.abs(course.phase)) < 0.1


def test_contact_makes_the_motion_come_round_sooner(tmp_path):
    (course,) = long_motions(setup_of(tmp_path), ["all"])
    assert course.last > 0
    assert course.phase[-1] > 0.2


@pytest.mark.parametrize(("height", "share"), [(-1.0, 1.0), (1.0, 0.0)])
def test_losses_are_counted_by_height(tmp_path, monkeypatch, height, share):
    """Above -1 m all of them, above 1 m none."""
    monkeypatch.setattr(details, "HIGH", height)
    tables = loss_tables(setup_of(tmp_path, RIGID))
    assert list(tables) == ["compliant levels, stop", "rigid levels, stop"]
    cells = [cell for table in tables.values() for cell in table.to_numpy().ravel() if cell != "failed"]
    counts = [tuple(map(int, cell.split(" of "))) for cell in cells]
    assert any(every > 0 for _, every in counts)
    assert all(high == share * every for high, every in counts)


def test_own_modes_and_one_basis_meet_where_many_are_kept(tmp_path):
    compared = compare(setup_of(tmp_path, RIGID, windows=[0.05]), {}, progress=False)
    table = basis_table(compared)
    assert list(table.columns) == [
        (stops, name) for stops in ("the scene's stops", "rigid stops") for name in ("own modes", "one basis")
    ]
    soft = table.iloc[[0, -1], :2].map(lambda cell: float(cell.split(" %")[0]))
    assert (soft.iloc[0] > soft.iloc[1]).all()
    assert basis_table(replace(compared, stiff=None)) is None
