"""Interface coordinates: what acts on points of a body acts as on the structure itself, across level changes."""

import math

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    CoordinateSpringDamper,
    LoadCoordinate,
    MarkerNodeCoordinate,
    Mass1D,
    Node1D,
    NodePointGround,
    SensorNode,
)
from scipy.integrate import solve_ivp

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody

TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2
STEP, END = 1e-3, 0.25  # s
SPRING, DAMPER, MASS = 800.0, 2.0, 0.4  # N/m, N s/m, kg
GAP, STIFFNESS = 1e-3, 3e4  # m, N/m
START = np.array([0.0, 0.0, 0.01])  # m


@pytest.fixture(autouse=True)
def _quiet():
    printed, exu.config.printToConsole = exu.config.printToConsole, False
    yield
    exu.config.printToConsole = printed


def chain(stiffness):
    """Three masses of 1 kg in a row with a stop at the second, all modes."""
    matrix = 1e4 * (2 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    structure = mp.LinearStructure(np.eye(3), matrix, mp.RayleighDamping(0.5, 1e-5), {f"m{i}": i for i in range(3)})
    return mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m1", GAP, stiffness)], modes="all")


def settings(step):
    chosen = exu.SimulationSettings()
    chosen.timeIntegration.numberOfSteps = round(END / step)
    chosen.timeIntegration.endTime = END
    chosen.timeIntegration.verboseMode = 0
    chosen.timeIntegration.newton.relativeTolerance = 1e-12
    chosen.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    chosen.solution.file.write = False
    chosen.solution.sensors.writePeriod = step
    return chosen


def coordinate(mbs, node):
    return mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))


def watch(mbs, node):
    kind = exu.OutputVariableType.Coordinates
    return mbs.AddSensor(SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))


def spring(mbs, items):
    ground = coordinate(mbs, mbs.AddNode(NodePointGround()))
    ends = [ground, coordinate(mbs, items["nInterface"]["m2"])]
    mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, stiffness=SPRING, damping=DAMPER))


def spring_and_mass(mbs, items):
    node = mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
    mbs.AddObject(Mass1D(nodeNumber=node, mass=MASS))
    ends = [coordinate(mbs, node), coordinate(mbs, items["nInterface"]["m2"])]
    mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, stiffness=SPRING, damping=DAMPER))


def run(model, step, add, interface=("m2",), solver=TRAPEZOIDAL, **given):
    """Interface coordinates (steps, m) by sensors, those of the body itself, and the body's events."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, name="b", displacement=START, interface=interface, **given)
    sensors = [watch(mbs, node) for node in items["nInterface"].values()]
    add(mbs, items)
    mbs.Assemble()
    mbs.SolveDynamic(settings(step), solverType=solver)
    body = mbs.variables["multiPhi"]["b"]
    eta = mbs.GetSensorStoredData(items["sCoordinates"])[:, 1:]
    level = mbs.GetSensorStoredData(items["sLevel"])[:, 1] > 0.5
    shown = np.empty((len(eta), len(sensors)))
    for k, (values, closed) in enumerate(zip(eta, level, strict=True)):
        loaded = body.stepped_level((0,) if closed else ()).loaded
        x = model.base.modes.shapes @ loaded.configuration(values[: loaded.level.modes])
        shown[k] = [model.structure.row(name) @ x for name in items["nInterface"]]
    return np.column_stack([mbs.GetSensorStoredData(s)[:, 1] for s in sensors]), shown, body.events


def integrated(model, step):
    """m2 of the chain with the penalty stop, and a mass on a spring-damper, by DOP853."""
    s = model.structure

    def rate(t, z):
        x, v, u, w = z[:3], z[3:6], z[6], z[7]
        pull = SPRING * (x[2] - u) + DAMPER * (v[2] - w)
        stop = STIFFNESS * max(0.0, -(x[1] + GAP))
        damping = 0.5 * v + 1e-5 * s.stiffness @ v
        return np.concatenate([v, np.array([0, stop, -pull]) - s.stiffness @ x - damping, [w, pull / MASS]])

    times = np.arange(round(END / step) + 1) * step
    start = np.concatenate([START, np.zeros(5)])
    found = solve_ivp(rate, (0, times[-1]), start, "DOP853", times, rtol=1e-10, atol=1e-13, max_step=5e-4)
    return found.y[2]


@pytest.mark.parametrize("matched", [False, True], ids=["plain", "matched"])
def test_spring_and_mass_on_a_point_converge_with_order_two_to_an_integrator(matched):
    model, errors = chain(STIFFNESS), []
    for step in (STEP, STEP / 2, STEP / 4):
        y, _, events = run(model, step, spring_and_mass, matchedStepSize=step if matched else None)
        expected = integrated(model, step)
        errors.append(np.linalg.norm(y[:, 0] - expected) / np.linalg.norm(expected))
    assert len(events) >= 4
    assert math.log2(errors[0] / errors[2]) / 2 > 1.8
    assert errors[2] < (1e-4 if matched else 2e-2)


@pytest.mark.parametrize("stiffness", [STIFFNESS, math.inf], ids=["compliant", "rigid"])
def test_interface_coordinates_are_the_displacements_of_the_body_at_every_step(stiffness):
    y, shown, events = run(chain(stiffness), STEP, spring_and_mass, interface={"m2": "m2", "m0": "m0"})
    assert len(events) >= 4
    assert np.max(np.abs(y - shown)) < 1e-12


@pytest.mark.parametrize(("stiffness", "at"), [(STIFFNESS, "m2"), (STIFFNESS, "m1"), (math.inf, "m2")])
def test_a_constant_load_on_an_interface_coordinate_is_the_native_load(stiffness, at):
    def push(mbs, items):
        mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"][at]), load=-5.0))

    model = chain(stiffness)
    native = mp.simulate(model, END, displacement=START, loads=[mp.ConstantLoad(at, -5.0)])
    y, _, events = run(model, STEP, push, interface=(at,), matchedStepSize=STEP)
    expected = native.at(at, np.minimum(np.arange(len(y)) * STEP, END))
    assert len(events) == len(native.events) >= 4
    assert np.linalg.norm(y[:, 0] - expected) < 1e-7 * np.linalg.norm(expected)


def test_a_user_load_on_an_interface_coordinate_agrees_with_the_harmonic_load_to_1e_5():
    def push(mbs, items):
        def load(mbs, t, amplitude):
            return amplitude * math.cos(2 * math.pi * 7.0 * t)

        marker = coordinate(mbs, items["nInterface"]["m2"])
        mbs.AddLoad(LoadCoordinate(markerNumber=marker, load=8.0, loadUserFunction=load))

    model, step = chain(STIFFNESS), STEP / 4
    native = mp.simulate(model, END, displacement=START, loads=[mp.HarmonicLoad("m2", 8.0, 7.0)])
    y, _, _ = run(model, step, push, matchedStepSize=step)
    expected = native.at("m2", np.minimum(np.arange(len(y)) * step, END))
    assert np.linalg.norm(y[:, 0] - expected) < 1e-5 * np.linalg.norm(expected)


def test_a_second_run_of_one_system_begins_in_the_level_of_its_start():
    model = chain(STIFFNESS)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, displacement=-START, interface=("m2",))
    sensor = watch(mbs, items["nInterface"]["m2"])
    spring(mbs, items)
    mbs.Assemble()
    stored = []
    for _ in range(2):
        mbs.SolveDynamic(settings(STEP), solverType=TRAPEZOIDAL)
        stored.append(mbs.GetSensorStoredData(sensor))
    assert np.max(np.abs(stored[0] - stored[1])) < 1e-12


def test_what_an_interface_cannot_hold_is_refused():
    model, mbs = chain(STIFFNESS), exu.SystemContainer().AddSystem()
    for interface, error, told in [
        ("m2", mp.errors.MultiPhiTypeError, "interface: got 'm2', need names"),
        (("m7",), mp.errors.MultiPhiValueError, "point: got 'm7'"),
        ({"none": np.zeros(3)}, mp.errors.MultiPhiValueError, "a row of zeros"),
        ({3: "m2"}, mp.errors.MultiPhiTypeError, "interface: got 3"),
        ({"a": "m2", "b": {"m2": 2.0}}, mp.errors.MultiPhiValueError, "depend neither on each other"),
    ]:
        with pytest.raises(error, match=told):
            CreateMultiPhiBody(mbs, model, interface=interface)
    with pytest.raises(mp.errors.MultiPhiValueError, match="'m1', need points that depend"):
        CreateMultiPhiBody(mbs, chain(math.inf), interface=("m1",))
    few = mp.MultiPhiModel(model.structure, model.contacts, modes=1)
    with pytest.raises(mp.errors.MultiPhiValueError, match="2 points that 1 modes do not tell apart"):
        CreateMultiPhiBody(mbs, few, interface=("m0", "m2"))
    with pytest.raises(mp.errors.MultiPhiValueError, match="need constant ones"):
        CreateMultiPhiBody(mbs, model, interface=("m2",), loads=[mp.HarmonicLoad("m2", 1.0, 2.0)])
    with pytest.raises(ValueError, match="need TrapezoidalIndex2"):
        run(model, STEP, spring, solver=exu.DynamicSolverType.GeneralizedAlpha)
