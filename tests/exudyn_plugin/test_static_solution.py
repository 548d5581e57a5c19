"""SolveStatic with bodies: it ends in the level whose contacts agree with it, or is refused by name."""

import math
import warnings

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import CoordinateSpringDamper, LoadCoordinate
from helpers.body_runs import TRAPEZOIDAL, coordinate, settings

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

N, K, GAP = 4, 4e4, 1e-3  # masses, N/m, m
NAMES = [f"m{i}" for i in range(N)]
STEPS = (1, 5)  # of the load


def chain(*elements, modes="all", held=K):
    """Masses of 1 kg in a row, the first on a spring to the ground."""
    matrix = K * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    matrix[0, 0], matrix[-1, -1] = K + held, K
    structure = mp.LinearStructure(np.eye(N), matrix, 1e-3 * matrix, {name: i for i, name in enumerate(NAMES)})
    return mp.MultiPhiModel(structure, elements, modes=modes)


def stops(stiffness):
    """Stops below the second mass, and on both sides of the last."""
    rows = ({"m1": 1.0}, GAP), ({"m3": 1.0}, 2 * GAP), ({"m3": -1.0}, 1.5 * GAP)
    return [mp.UnilateralContact(f"stop{i}", row, gap, stiffness) for i, (row, gap) in enumerate(rows)]


class Solved:
    """Bodies by name with forces on their points, and springs between points; solved by SolveStatic."""

    def __init__(self, bodies, springs=(), interface=("m1", "m3"), steps=1):
        self.container = exu.SystemContainer()
        self.mbs, self.items = self.container.AddSystem(), {}
        for name, (model, forces, given) in bodies.items():
            items = self.items[name] = CreateMultiPhiBody(self.mbs, model, name, interface=interface, **given)
            for point, force in forces.items():
                self.mbs.AddLoad(LoadCoordinate(markerNumber=self.at(items, point), load=force))
        for (first, one), (second, other), stiffness in springs:
            ends = [self.at(self.items[first], one), self.at(self.items[second], other)]
            self.mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, stiffness=stiffness))
        self.mbs.Assemble()
        self.settings = settings(1e-3, 0.05)
        self.settings.staticSolver.numberOfLoadSteps = steps
        self.settings.staticSolver.verboseMode = 0

    def at(self, items, point):
        return coordinate(self.mbs, items["nInterface"][point])

    def solve(self):
        self.mbs.SolveStatic(self.settings, updateInitialValues=True)
        return self

    def place(self, name, point):
        found = self.mbs.GetNodeOutput(self.items[name]["nInterface"][point], exu.OutputVariableType.Coordinates)
        return float(np.ravel(found)[0])


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("stiffness", [1e5, 1e8, math.inf])
@pytest.mark.parametrize(
    "forces",
    [{"m3": -1.0}, {"m3": -60.0}, {"m3": 80.0}, {"m1": -500.0, "m3": 300.0}, {"m1": 900.0, "m3": -700.0}],
)
def test_it_is_the_equilibrium_on_the_contacts_and_stays_one_in_the_run_that_follows(forces, stiffness, steps):
    model = chain(*stops(stiffness))
    x = model.static_equilibrium(forces)
    solved = Solved({"b": (model, forces, {})}, steps=steps).solve()
    scale = np.max(np.abs(x))
    assert [solved.place("b", name) for name in ("m1", "m3")] == pytest.approx(x[[1, 3]], abs=1e-8 * scale)
    solved.mbs.SolveDynamic(solved.settings, solverType=TRAPEZOIDAL)
    assert [solved.place("b", name) for name in ("m1", "m3")] == pytest.approx(x[[1, 3]], abs=1e-6 * scale)
    assert not [e for e in solved.mbs.variables["multiPhi"]["b"].events if e.impulse > 1e-9]


@pytest.mark.parametrize("stiffness", [1e6, math.inf])
def test_from_a_start_on_its_stops_it_leaves_those_that_would_pull(stiffness):
    model, away = chain(*stops(stiffness)), {"m3": 30.0}
    pressed = {"displacement": model.static_equilibrium({"m1": -300.0, "m3": -300.0})}
    solved = Solved({"b": (model, away, pressed)}).solve()
    assert solved.place("b", "m3") == pytest.approx(model.static_equilibrium(away)[3], rel=1e-7)


def test_a_body_that_its_own_loads_press_through_a_stop_ends_on_it():
    model = chain(*stops(1e6))
    loads = [mp.ConstantLoad("m3", -60.0)]
    solved = Solved({"b": (model, {}, {"loads": loads, "displacement": np.zeros(N)})}, interface=()).solve()
    body = solved.mbs.variables["multiPhi"]["b"]
    states = body.coordinates.read_level_data()[0]
    x = model.static_equilibrium({"m3": -60.0})
    assert states == tuple(int(q + gap < 0) for q, gap in ((x[1], GAP), (x[3], 2 * GAP), (-x[3], 1.5 * GAP)))
    assert any(states)
    solved.mbs.SolveDynamic(solved.settings, solverType=TRAPEZOIDAL)
    assert not body.events


@pytest.mark.parametrize("force", [3.0, 60.0, -200.0])
def test_a_force_law_ends_in_its_segment(force):
    law = mp.ForceLaw("m3", lambda q: 500 * q + 4e8 * q**3, tolerance=1e-3, span=(-0.03, 0.03))
    model = chain(law)
    solved = Solved({"b": (model, {"m3": force}, {})}).solve()
    assert solved.place("b", "m3") == pytest.approx(model.static_equilibrium({"m3": force})[3], rel=1e-7)


@pytest.mark.parametrize(("stiffness", "spring"), [(1e5, 1e4), (math.inf, 1e5)])
def test_two_bodies_on_each_other_and_on_their_stops(stiffness, spring):
    """The second has no support of its own."""
    one, two = chain(*stops(stiffness)), chain(*stops(stiffness), held=0.0)
    forces = {"a": {"m1": -200.0}, "b": {"m3": -300.0}}
    bodies = {name: (model, forces[name], {}) for name, model in (("a", one), ("b", two))}
    solved = Solved(bodies, [(("a", "m3"), ("b", "m1"), spring)]).solve()
    matrix = np.zeros((2 * N, 2 * N))
    matrix[:N, :N], matrix[N:, N:] = one.structure.stiffness, two.structure.stiffness
    tie = np.zeros(2 * N)
    tie[3], tie[N + 1] = 1.0, -1.0
    points = {f"{body}.{name}": i for i, (body, name) in enumerate((b, n) for b in "ab" for n in NAMES)}
    structure = mp.LinearStructure(np.eye(2 * N), matrix + spring * np.outer(tie, tie), points=points)
    contacts = [
        mp.UnilateralContact(f"{b}{stop.name}", {f"{b}.{p}": c for p, c in stop.direction.items()}, stop.gap, stiffness)
        for b in "ab"
        for stop in stops(stiffness)
    ]
    x = mp.MultiPhiModel(structure, contacts).static_equilibrium({"a.m1": -200.0, "b.m3": -300.0})
    found = [solved.place(body, name) for body in "ab" for name in ("m1", "m3")]
    assert found == pytest.approx(x[[1, 3, 5, 7]], abs=1e-7 * np.max(np.abs(x)))


def test_friction_that_holds_is_right_and_one_that_would_slip_or_begin_is_refused_by_name(refused):
    ring = mp.Friction("ring", "m1", limit=20.0)
    held = Solved({"b": (chain(ring), {"m3": -15.0}, {})}).solve()
    assert held.place("b", "m3") == pytest.approx(chain(ring).equilibrium({"m3": -15.0}).displacement[3], rel=1e-7)
    slipping = Solved({"b": (chain(ring), {"m3": -25.0}, {})})
    refused(ValueError, "static solution of 'b': got forces that change the state of 'ring'", slipping.solve)
    floor = mp.UnilateralContact("floor", "m1", GAP, 1e6, friction=0.3, tangential="m2")
    landing = Solved({"b": (chain(floor), {"m3": -300.0}, {})})
    refused(ValueError, "static solution of 'b': got forces that change the state of 'floor'", landing.solve)
    assert Solved({"b": (chain(floor), {"m3": 5.0}, {})}).solve().place("b", "m3") > 0


@pytest.mark.parametrize("solution", ["static", "run"])
def test_coordinates_of_a_solution_without_its_level_are_no_start(refused, solution):
    model = chain(*stops(1e6))
    solved = Solved({"b": (model, {"m3": -60.0}, {"displacement": np.zeros(N)})})
    if solution == "static":
        solved.mbs.SolveStatic(solved.settings)
    else:
        solved.mbs.SolveDynamic(solved.settings, solverType=TRAPEZOIDAL)
    data = solved.mbs.systemData
    assert any(solved.mbs.variables["multiPhi"]["b"].coordinates.read_level_data()[0])
    data.SetODE2Coordinates(data.GetODE2Coordinates(), exu.ConfigurationType.Initial)

    def again():
        solved.mbs.SolveDynamic(solved.settings, solverType=TRAPEZOIDAL)

    refused(ValueError, "start of 'b': got the coordinates of the last solution without its level", again)


def test_what_too_few_modes_leave_out_is_told_or_refused_by_name(refused):
    told = Solved({"b": (chain(*stops(1e5), modes=1), {"m1": -300.0}, {})})
    with (
        pytest.warns(mp.MultiPhiWarning, match=r"truncated contact: .* 75 % .*\(body 'b'\)"),
        pytest.warns(mp.MultiPhiWarning, match="truncated statics: 1 modes leave out"),
    ):
        told.solve()
    model = chain(*stops(1e9), modes=1)
    neither = Solved({"b": (model, {"m3": -60.0}, {})})
    refused(mp.MultiPhiError, "static solution of 'b': no level was found", neither.solve)


@pytest.mark.parametrize("scale", [1.0, 2.0**-20])
@pytest.mark.parametrize("modes", [2, 3, "all"])
@pytest.mark.parametrize("stiffness", [None, 1e4, 1e6, math.inf])
@pytest.mark.parametrize("forces", [{"m1": -300.0}, {"m1": -400.0, "m3": 300.0}, {"m3": -80.0}])
def test_what_the_modes_leave_out_of_displacements_is_told(forces, stiffness, modes, scale):
    """Of a body without contacts, on open and on closed ones, compared with the equilibrium of the structure."""
    model = chain(*([] if stiffness is None else stops(stiffness)), modes=modes)
    forces = {name: scale * force for name, force in forces.items()}
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            solved = Solved({"b": (model, forces, {})}).solve()
        except mp.NumericalFailure:
            assert modes != "all"
            return
    x = model.static_equilibrium(forces)[[1, 3]]
    error = np.max(np.abs([solved.place("b", name) for name in ("m1", "m3")] - x)) / np.max(np.abs(x))
    told = any(str(each.message).startswith("truncated statics: ") for each in caught)
    assert told if error > 0.02 else not (told and error < 0.01)
    assert error < 1e-7 or modes != "all"


def test_a_run_tells_nothing_of_a_static_solution_before_it():
    solved = Solved({"b": (chain(modes=2), {"m1": -300.0}, {"matchedStepSize": 1e-3})})
    with pytest.warns(mp.MultiPhiWarning, match=r"truncated statics: 2 modes leave out .* % .* at 'm1'.*\(body 'b'\)"):
        solved.solve()
    solved.mbs.SolveDynamic(solved.settings, solverType=TRAPEZOIDAL)
    assert not solved.mbs.variables["multiPhi"]["b"].warnings
