"""A body in Exudyn tells of force laws that leave their span, as runs do: alone, beside others, in static solutions."""

import re

import exudyn as exu
import pytest
from exudyn.itemInterface import LoadCoordinate
from helpers.body_runs import TRAPEZOIDAL, coordinate, settings

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

STEP, END, SPEED = 2e-3, 2.0, 3.0  # s, s, m/s
TOLD = re.compile(
    r"law span: force law '(.*)' leaves its span \((.*), (.*)\) at t = (.*) s and reaches (.*) at t = (.*?) s"
)


def mass(span, law=lambda q: 4.0 * q + 2.0 * q**3):
    """1 kg on a spring of 1 N/m and on a hardening law."""
    structure = mp.LinearStructure([[1.0]], [[1.0]], [[0.05]], points={"x": 0})
    return mp.MultiPhiModel(structure, [mp.ForceLaw("x", law, span=span, tolerance=1e-3, name="spring")])


class Body:
    """The mass as a body, with its speed or a force on it."""

    def __init__(self, model, interface=("x",), force=0.0, **given):
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        items = CreateMultiPhiBody(self.mbs, model, "b", interface=interface, matchedStepSize=STEP, **given)
        if force:
            self.mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(self.mbs, items["nInterface"]["x"]), load=force))
        self.mbs.Assemble()
        self.settings = settings(STEP, END)
        self.settings.staticSolver.verboseMode = 0

    def ran(self):
        self.mbs.SolveDynamic(self.settings, solverType=TRAPEZOIDAL)
        return self.told

    @property
    def told(self):
        found = [TOLD.match(told) for told in self.mbs.variables["multiPhi"]["b"].warnings if "law span" in told]
        assert len(found) <= 1
        return (found[0][1], *map(float, found[0].groups()[1:])) if found else None


@pytest.mark.filterwarnings("ignore:law span")
@pytest.mark.parametrize("interface", [(), ("x",)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("span", [(-0.4, 0.5), (-0.7, 0.6), (-2.0, 2.0)])
def test_a_run_tells_what_simulate_does_though_the_motion_comes_back(span, sign, interface):
    model = mass(span)
    found = Body(model, interface, velocity=[sign * SPEED]).ran()
    exact = mp.simulate(model, END, velocity=[sign * SPEED])
    expected = [TOLD.match(told) for told in exact.warnings if "law span" in told]
    assert bool(found) == bool(expected) == (span[1] < 2.0)
    if found:
        name, *numbers = expected[0].groups()
        assert found[0] == name
        low, high, first, place, when = map(float, numbers)
        assert found[1:3] == (low, high)
        assert found[3:] == pytest.approx((first, place, when), abs=0.04)
        assert found[4] == pytest.approx(place, rel=1e-2)


@pytest.mark.filterwarnings("ignore:law span")
def test_a_force_of_the_system_drives_it_out():
    first, place = Body(mass((-0.5, 0.5)), force=4.0, velocity=[0.1]).ran()[3:5]
    assert 0 < first < END
    assert place > 0.5
    assert Body(mass((-0.5, 0.5)), force=0.5, velocity=[0.1]).ran() is None


def test_a_static_solution_tells_it():
    body = Body(mass((-0.5, 0.5)), force=30.0, displacement=[0.0])
    with pytest.warns(mp.MultiPhiWarning, match=r"law span: force law 'spring' leaves its span .*\(body 'b'\)"):
        body.mbs.SolveStatic(body.settings)
    assert body.told[4] == pytest.approx(mass((-0.5, 0.5)).static_equilibrium({"x": 30.0})[0], rel=1e-6)
