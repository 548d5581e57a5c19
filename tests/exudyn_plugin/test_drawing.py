"""The body in Exudyn's renderer: its shape is the trajectory's, its stops have the colour of their state."""

import functools

import exudyn as exu
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, Drawing, PositionInterface
from multiphi_exudyn.exudyn_plugin.drawing import BLOCK, graphics_of
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping
from reference_models.solver_settings import fixed_steps

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

STEP, SHORT, LONG = 5e-4, 0.02, 0.088  # s; open at the first end, closed at the second
SHOWN, CURRENT = exu.ConfigurationType.Visualization, exu.ConfigurationType.Current
SAME = 1e-7  # m: the matched step is exact to round-off of 20 mm and 200 steps


class Recorded(Drawing):
    """Remembers every shape that was drawn."""

    def __post_init__(self):
        super().__post_init__()
        object.__setattr__(self, "lines", [])

    def line(self, deflections):
        self.lines.append(super().line(deflections))
        return self.lines[-1]


@functools.cache
def rig():
    model = mp.MultiPhiModel(mp.planar_beam(rig_beam(), 20, rig_damping()), [rig_contact(1e6)], modes=6)
    bent = model.static_equilibrium({"node3": 1.0})
    return model, bent * initial_displacement() / float(model.structure.row("node3") @ bent)


def system(drawing, matched=STEP, **given):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(
        mbs, rig()[0], name="beam", displacement=rig()[1], matchedStepSize=matched, drawing=drawing, **given
    )
    mbs.Assemble()
    container.visualizationSettings.view0.window.renderWindowSize = [240, 120]
    return container, mbs, items


def run(mbs, end):
    mbs.SolveDynamic(fixed_steps(end, round(end / STEP)), solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    mbs.systemData.SetSystemState(mbs.systemData.GetSystemState(CURRENT), SHOWN)


def image(container):
    container.renderer.ZoomAll()
    return np.array(container.renderer.RedrawAndGetImage(useRaytracer=True)).astype(int)


def orange(pixels):
    """Pixels of the colour of a closed stop, in any light; the red axis of the view has less green."""
    red, green, blue = np.moveaxis(pixels, -1, 0)
    return int(np.sum((red > 150) & (green > 0.4 * red) & (green < 0.7 * red) & (blue < 0.4 * red)))


@pytest.mark.parametrize("end", [SHORT, LONG])
def test_drawn_shape_is_that_of_the_trajectory_in_either_level(end):
    drawing = Recorded.of_beam(rig_beam(), 20, scale=2.0)
    container, mbs, _ = system(drawing)
    run(mbs, end)
    image(container)
    exact = mp.simulate(rig()[0], end, displacement=rig()[1])
    assert bool(len(exact.events) % 2) == (end == LONG)
    expected = drawing.positions[:, 1] + 2.0 * drawing.rows @ exact.displacement(end)
    assert np.max(np.abs(drawing.lines[-1][:, 1] - expected)) < SAME
    assert np.array_equal(drawing.lines[-1][:, 0], drawing.positions[:, 0])


def test_nothing_is_drawn_or_computed_in_a_run_that_nobody_looks_at():
    drawing = Recorded.of_beam(rig_beam(), 20)
    container, mbs, _ = system(drawing)
    run(mbs, SHORT)
    assert drawing.lines == []
    image(container)
    assert len(drawing.lines) > 0


def test_a_stop_changes_its_colour_when_the_contact_closes():
    drawing = Drawing.of_beam(rig_beam(), 20, scale=4.0, radius=8e-3)
    pictures = []
    for end in (SHORT, LONG):
        container, mbs, _ = system(drawing)
        run(mbs, end)
        pictures.append(orange(image(container)))
    assert pictures[0] == 0 < pictures[1]


def test_bar_and_block_touch_exactly_where_the_gap_is_closed():
    model = rig()[0]
    drawing, stop = Drawing.of_beam(rig_beam(), 20, scale=3.0, radius=2e-3), rig_contact(1e6)
    row = model.structure.row(stop.direction)
    centre = drawing.stop(row, stop.gap)
    touching = -row * stop.gap / (row @ row)
    struck = np.flatnonzero(drawing.rows @ row)[0]
    surface = drawing.line(drawing.rows @ touching)[struck, 1] - 2e-3
    assert surface == pytest.approx(centre[1] + BLOCK / 2 * 2e-3, rel=1e-12)
    above = drawing.stop(-row, stop.gap)
    assert above[1] == pytest.approx(-centre[1], rel=1e-12)
    assert drawing.stop(row + drawing.rows[1], stop.gap) is None


def test_every_redraw_has_one_bar_between_neighbours_and_one_block_a_stop():
    drawing = Drawing.of_beam(rig_beam(), 20)
    _, mbs, _ = system(drawing)
    mbs.systemData.SetSystemState(mbs.systemData.GetSystemState(exu.ConfigurationType.Initial), SHOWN)
    body = mbs.variables["multiPhi"]["beam"]
    shapes = graphics_of(body, drawing, [-1.0] * 4)(mbs, 0)
    assert len(shapes) == len(drawing.rows) - 1 + 1
    red = graphics_of(body, drawing, [1.0, 0.0, 0.0, 1.0])(mbs, 0)
    assert np.allclose(np.reshape(red[0]["colors"], (-1, 4)), [1.0, 0.0, 0.0, 1.0], atol=1e-6)
    assert np.array_equal(red[-1]["colors"], shapes[-1]["colors"])


def test_show_and_color_are_those_of_the_items():
    tip = PositionInterface((0.6, 0.0), [None, "node3"])
    _, mbs, items = system(None, show=False, color=[1.0, 0.0, 0.0, 1.0], interface={"tip": tip})
    seen = mbs.GetObject(items["oGenericODE2"]), mbs.GetNode(items["nInterface"]["tip"])
    for item in seen:
        assert item["Vshow"] is False
        assert np.allclose(item["Vcolor"], [1.0, 0.0, 0.0, 1.0])
    with pytest.raises(mp.MultiPhiError, match="color: got"):
        system(None, color=[1.0, 0.0])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"direction": np.array([0.0, 2.0, 0.0])}, "drawing direction: got .* need a unit vector"),
        ({"positions": np.zeros((3, 2))}, r"drawing positions: got shape \(3, 2\), need \(k, 3\)"),
        ({"rows": np.zeros((2, 4))}, "drawing rows: got 2 rows for 3 positions, need one each"),
        ({"scale": 0.0}, "drawing scale: got 0.0, need a finite value > 0"),
        ({"radius": "thin"}, "drawing radius: got 'thin', need a number"),
    ],
)
def test_a_wrong_drawing_is_told_in_one_line(changes, said):
    given = {"positions": np.zeros((3, 3)), "rows": np.zeros((3, 4)), "direction": np.array([0.0, 1.0, 0.0])}
    with pytest.raises(mp.MultiPhiError, match=said):
        Drawing(**{**given, **changes})


def test_a_drawing_of_another_structure_is_refused():
    with pytest.raises(mp.MultiPhiError, match=r"drawing rows: got 2 columns, need"):
        system(Drawing(np.zeros((3, 3)), np.zeros((3, 2)), np.array([0.0, 1.0, 0.0])))
    with pytest.raises(mp.MultiPhiError, match="drawing: got str, need a Drawing or None"):
        system("beam")
