"""Interface coordinates: what acts on points of a body acts as on the structure itself, across level changes."""

import functools
import itertools
import math

import exudyn as exu
import numpy as np
import pytest
import scipy.sparse
from exudyn.itemInterface import (
    CoordinateSpringDamper,
    LoadCoordinate,
    MarkerNodeCoordinate,
    Mass1D,
    Node1D,
    NodeGenericData,
    NodePointGround,
    ObjectConnectorCoordinate,
    ObjectContactCoordinate,
    ObjectGenericODE2,
    SensorNode,
)
from scipy.integrate import solve_ivp

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories
from reference_models.solver_settings import fixed_steps

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2
STEP, END = 1e-3, 0.25  # s
STEPS = END / np.array([250, 360, 500, 710, 1000])  # s: an order is fitted to all of them
SPRING, DAMPER, MASS = 800.0, 2.0, 0.4  # N/m, N s/m, kg
GAP, SECOND_GAP, STIFFNESS = 1e-3, 3e-3, 3e4  # m, m, N/m
START = np.array([0.0, 0.0, 0.01])  # m


def chain(stiffness, coupling=0.0, added_mass=0.0, added_damping=0.0):
    """Three masses of 1 kg in a row with a stop at the second, all modes.

    coupling: of neighbours' masses [kg]; with it an impact on the second moves the others too. added_mass,
    added_damping: of the third [kg, N s/m].
    """
    neighbours, third = np.eye(3, k=1) + np.eye(3, k=-1), np.diag([0.0, 0.0, 1.0])
    matrix = 1e4 * (2 * np.eye(3) - neighbours)
    masses, damping = np.eye(3) + coupling * neighbours, 0.5 * np.eye(3) + 1e-5 * matrix
    points = {f"m{i}": i for i in range(3)}
    structure = mp.LinearStructure(masses + added_mass * third, matrix, damping + added_damping * third, points)
    return mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "m1", GAP, stiffness)], modes="all")


def settings(step):
    chosen = fixed_steps(END, round(END / step), write_period=step)
    chosen.timeIntegration.newton.relativeTolerance = 1e-12
    chosen.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    chosen.timeIntegration.discontinuous.useRecommendedStepSize = False  # of an ObjectContactCoordinate
    return chosen


def coordinate(mbs, node):
    return mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))


def watch(mbs, node, kind=exu.OutputVariableType.Coordinates):
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
    level, layout = mbs.GetSensorStoredData(items["sLevel"])[:, 1:], body.coordinates.layout
    shown = np.empty((len(eta), len(sensors)))
    for k, (values, states, held) in enumerate(zip(eta, layout.states(level), layout.held(level), strict=True)):
        loaded = body.discretised_level(states.tolist()).loaded
        x = model.base.modes.shapes @ loaded.configuration(np.concatenate([values[: loaded.modal.modes], held]))
        shown[k] = [model.structure.row(name) @ x for name in items["nInterface"]]
    return np.column_stack([mbs.GetSensorStoredData(s)[:, 1] for s in sensors]), shown, body.events


@functools.cache
def integrated(step):
    """m2 of the chain with the penalty stop, and a mass on a spring-damper, by DOP853."""
    s = chain(STIFFNESS).structure

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
        expected = integrated(step)
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


@pytest.mark.parametrize("load", [-20.0, -10.0])
def test_a_load_on_a_point_that_shares_mass_with_a_rigid_stop_is_the_native_load_and_in_its_reaction(load):
    model, container = chain(math.inf, coupling=0.25), exu.SystemContainer()
    native = mp.simulate(model, END, displacement=START, loads=[mp.ConstantLoad("m2", load)])
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, "b", displacement=START, interface=("m2",), matchedStepSize=STEP)
    mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"]["m2"]), load=load))
    mbs.Assemble()
    mbs.SolveDynamic(settings(STEP), solverType=TRAPEZOIDAL)
    found = body_histories(mbs, items)
    assert [event.kind for event in found.events] == [event.kind for event in native.events]
    held = [b.time - a.time for a, b in itertools.pairwise(native.events) if a.kind == "close"]
    assert sum(time > STEP for time in held) >= 3
    assert np.allclose([e.time for e in found.events], [e.time for e in native.events], rtol=0, atol=1e-12)
    expected = native.contact_force("stop", np.minimum(found.time, END))
    assert np.max(expected) > 1.0
    assert np.max(np.abs(found.contact_force["stop"] - expected)) < 1e-8 * np.max(expected)


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


def order_and_error(shown, expected):
    """Order between two halvings of the step, and the relative error at the last, of shown(step) (steps,)."""
    errors = []
    for step in (STEP, STEP / 2, STEP / 4):
        y = shown(step)
        exact = expected(np.minimum(np.arange(len(y)) * step, END))
        errors.append(np.linalg.norm(y - exact) / np.linalg.norm(exact))
    return math.log2(errors[0] / errors[2]) / 2, errors[2]


def test_a_damped_mass_beside_a_rigid_stop_converges_with_order_two_to_one_structure():
    model, between = chain(math.inf), np.array([0, 0, 1, -1.0])
    coupling = np.outer(between, between)
    stiffness = np.pad(model.structure.stiffness, (0, 1))
    damping = 0.5 * np.diag([1, 1, 1, 0.0]) + 1e-5 * stiffness + DAMPER * coupling
    masses = np.diag([1, 1, 1, MASS])
    whole = mp.LinearStructure(masses, stiffness + SPRING * coupling, damping, {"m1": 1, "m2": 2})
    stops = [mp.UnilateralContact("stop", "m1", GAP)]
    native = mp.simulate(mp.MultiPhiModel(whole, stops, modes="all"), END, displacement=np.append(START, 0.0))
    assert len(native.events) >= 4
    order, error = order_and_error(
        lambda step: run(model, step, spring_and_mass, matchedStepSize=step)[0][:, 0], lambda t: native.at("m2", t)
    )
    assert order > 1.8
    assert error < 1e-4


def test_a_damper_on_a_point_that_impacts_move_converges_with_order_two_to_the_damped_structure():
    def damper(mbs, items):
        ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m2"])]
        mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, damping=20.0))

    body = chain(math.inf, coupling=0.25)
    native = mp.simulate(chain(math.inf, coupling=0.25, added_damping=20.0), END, displacement=START)
    assert sum(event.impulse > 0.05 for event in native.events) >= 2
    order, error = order_and_error(
        lambda step: run(body, step, damper, matchedStepSize=step)[0][:, 0], lambda t: native.at("m2", t)
    )
    assert order > 1.8
    assert error < 1e-4


@pytest.mark.parametrize("tied", [False, True], ids=["on it", "tied to it"])
def test_a_mass_on_a_point_converges_with_order_two_to_the_structure_with_the_mass(tied):
    native = mp.simulate(chain(STIFFNESS, 0.25, added_mass=MASS), END, displacement=START)
    errors = []
    for step in STEPS:
        y, _, events = run(chain(STIFFNESS, 0.25), step, mass_tied if tied else mass_on, matchedStepSize=step)
        expected = native.at("m2", np.minimum(np.arange(len(y)) * step, END))
        errors.append(np.linalg.norm(y[:, 0] - expected) / np.linalg.norm(expected))
    assert len(events) == len(native.events) >= 4
    assert np.polyfit(np.log(STEPS), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.2)
    assert errors[-1] < 3e-4


def test_a_point_moved_as_prescribed_converges_with_order_two_to_the_rest_of_the_structure_under_its_forces():
    model, omega = chain(STIFFNESS, 0.25), 2 * math.pi * 7.0
    s, (rest, held) = model.structure, (slice(0, 2), 2)

    def motion(t):
        """Displacement, velocity and acceleration of the third mass."""
        return START[2] * np.array(
            [math.cos(omega * t), -omega * math.sin(omega * t), -(omega**2) * math.cos(omega * t)]
        )

    def force(row):
        return lambda t: -float(np.array([s.stiffness[row, held], s.damping[row, held], s.mass[row, held]]) @ motion(t))

    def prescribe(mbs, items):
        ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m2"])]
        ways = [lambda mbs, t, item, offset, k=k: offset / START[2] * motion(t)[k] for k in (0, 1)]
        moved = {"offsetUserFunction": ways[0], "offsetUserFunction_t": ways[1]}
        mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends, offset=START[2], **moved))

    others = mp.LinearStructure(s.mass[rest, rest], s.stiffness[rest, rest], s.damping[rest, rest], {"m0": 0, "m1": 1})
    stop = mp.UnilateralContact("stop", "m1", GAP, STIFFNESS)
    loads = [mp.FunctionLoad(f"m{row}", force(row), 1e-9) for row in (0, 1)]
    native = mp.simulate(mp.MultiPhiModel(others, [stop], modes="all"), END, loads=loads)
    errors = []
    for step in STEPS:
        y, _, events = run(model, step, prescribe, interface=("m1", "m2"), matchedStepSize=step)
        expected = native.at("m1", np.minimum(np.arange(len(y)) * step, END))
        errors.append(np.linalg.norm(y[:, 0] - expected) / np.linalg.norm(expected))
    assert len(events) == len(native.events) >= 4
    assert np.polyfit(np.log(STEPS), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 3e-5


def mass_on(mbs, items):
    mbs.AddObject(ObjectGenericODE2(name="mass", nodeNumbers=[items["nInterface"]["m2"]], massMatrix=[[MASS]]))


def mass_tied(mbs, items):
    node = mbs.AddNode(Node1D(referenceCoordinates=[0.0], initialCoordinates=[START[2]]))
    mbs.AddObject(Mass1D(nodeNumber=node, mass=MASS))
    ends = [coordinate(mbs, node), coordinate(mbs, items["nInterface"]["m2"])]
    mbs.AddObject(ObjectConnectorCoordinate(name="tie", markerNumbers=ends))


@pytest.mark.parametrize("stiffness", [STIFFNESS, math.inf], ids=["compliant", "rigid"])
@pytest.mark.parametrize("matched", [False, True], ids=["plain", "matched"])
def test_rates_of_interface_coordinates_are_those_of_the_body_at_every_step(stiffness, matched):
    model, container = chain(stiffness, 0.25), exu.SystemContainer()
    mbs = container.AddSystem()
    step = STEP if matched else None
    items = CreateMultiPhiBody(mbs, model, "b", displacement=START, matchedStepSize=step, interface=("m2",))
    spring_and_mass(mbs, items)
    outputs = exu.OutputVariableType
    sensors = [watch(mbs, items["nInterface"]["m2"], kind) for kind in (outputs.Coordinates_t, outputs.Coordinates_tt)]
    mbs.Assemble()
    mbs.SolveDynamic(settings(STEP), solverType=TRAPEZOIDAL)
    body, point = mbs.variables["multiPhi"]["b"], model.structure.row("m2")
    level = mbs.GetSensorStoredData(items["sLevel"])[:, 1] > 0.5
    assert len(body.events) >= 4
    for sensor, key in zip(sensors, ("sCoordinates_t", "sCoordinates_tt"), strict=True):
        own, y = mbs.GetSensorStoredData(items[key])[:, 1:], mbs.GetSensorStoredData(sensor)[:, 1]
        shapes = [body.discretised_level((int(closed),)).loaded.level.shapes for closed in level]
        shown = np.array([point @ s @ q[: s.shape[1]] for s, q in zip(shapes, own, strict=True)])
        assert np.max(np.abs(y - shown)) < 1e-9 * np.max(np.abs(shown))


@pytest.mark.parametrize("from_end", [False, True], ids=["initial state", "state at the end"])
def test_a_static_solution_after_a_run_is_the_equilibrium_on_the_stop_whichever_level_it_starts_from(from_end):
    model, container = chain(STIFFNESS), exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, displacement=-2 * START, interface=("m2",))
    spring(mbs, items)
    mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"]["m2"]), load=-60.0))
    mbs.Assemble()
    mbs.SolveDynamic(settings(STEP), solverType=TRAPEZOIDAL)
    closed = mbs.GetNodeOutput(items["nGenericData"], exu.OutputVariableType.Coordinates)[0] > 0.5
    assert closed
    if from_end:
        displacement, velocity, *rest = mbs.systemData.GetSystemState()
        mbs.systemData.SetSystemState([displacement, 0 * velocity, *rest], exu.ConfigurationType.Initial)
    mbs.SolveStatic(settings(STEP))
    row, stop = np.diag([0.0, 0.0, SPRING]), np.diag([0.0, STIFFNESS, 0.0])
    force = np.array([0.0, -STIFFNESS * GAP, -60.0])
    expected = np.linalg.solve(model.structure.stiffness + row + stop, force)[2]
    y = mbs.GetNodeOutput(items["nInterface"]["m2"], exu.OutputVariableType.Coordinates)
    assert y == pytest.approx(expected, rel=1e-7)


def test_a_contact_on_an_interface_coordinate_converges_with_order_two_to_a_contact_of_the_model():
    model, gap = chain(STIFFNESS), SECOND_GAP
    second = mp.UnilateralContact("second", "m2", gap, STIFFNESS)
    both = mp.MultiPhiModel(model.structure, [*model.contacts, second], modes="all")
    native = mp.simulate(both, END, displacement=START)
    assert {event.contact for event in native.events} == {"stop", "second"}
    order, error = order_and_error(
        lambda step: run(model, step, second_stop, matchedStepSize=step)[0][:, 0], lambda t: native.at("m2", t)
    )
    assert order > 1.8
    assert error < 6e-4  # Exudyn switches its contact at the ends of steps


def second_stop(mbs, items):
    ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m2"])]
    data = mbs.AddNode(NodeGenericData(initialCoordinates=[SECOND_GAP], numberOfDataCoordinates=1))
    law = {"contactStiffness": STIFFNESS, "offset": -SECOND_GAP}
    mbs.AddObject(ObjectContactCoordinate(markerNumbers=ends, nodeNumber=data, **law))


def test_steps_that_a_contact_of_exudyn_shortens_are_refused_with_matched_modes(monkeypatch):
    def shortened(step):
        chosen = fixed(step)
        chosen.timeIntegration.discontinuous.useRecommendedStepSize = True
        return chosen

    fixed = settings
    monkeypatch.setitem(globals(), "settings", shortened)
    with pytest.raises(
        ValueError, match=r"need the same \(beside Exudyn's own contacts set .*useRecommendedStepSize=False"
    ):
        run(chain(STIFFNESS), STEP, second_stop, matchedStepSize=STEP)


def test_a_base_on_a_driven_slider_converges_with_order_two_to_the_structure_with_the_slider():
    masses, held = np.eye(3), 1e4 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    free, points = mp.RayleighDamping(0.0, 1e-5), {f"m{i}": i for i in range(3)}
    contact = mp.UnilateralContact("stop", "m1", GAP, STIFFNESS)
    body = mp.MultiPhiModel(mp.LinearStructure(masses, held, free, points), [contact], modes="all")
    drawn = held + np.diag([4e3, 0.0, 0.0])
    damping = 1e-5 * held + np.diag([5.0, 0.0, 0.0])
    whole = mp.LinearStructure(masses + np.diag([2.0, 0.0, 0.0]), drawn, damping, points)
    native = mp.simulate(
        mp.MultiPhiModel(whole, [contact], modes="all"),
        END,
        displacement=START,
        loads=[mp.HarmonicLoad("m0", 40.0, 7.0)],
    )

    def slider(mbs, items):
        node = mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
        own, ground = coordinate(mbs, node), coordinate(mbs, mbs.AddNode(NodePointGround()))
        mbs.AddObject(Mass1D(nodeNumber=node, mass=2.0))
        mbs.AddObject(CoordinateSpringDamper(markerNumbers=[ground, own], stiffness=4e3, damping=5.0))
        mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=[own, coordinate(mbs, items["nInterface"]["m0"])]))

        def load(mbs, t, amplitude):
            return amplitude * math.cos(2 * math.pi * 7.0 * t)

        mbs.AddLoad(LoadCoordinate(markerNumber=own, load=40.0, loadUserFunction=load))

    assert len(native.events) >= 4
    order, error = order_and_error(
        lambda step: run(body, step, slider, interface=("m0",), matchedStepSize=step)[0][:, 0],
        lambda t: native.at("m0", t),
    )
    assert order > 1.8
    assert error < 3e-4


def test_two_bodies_coupled_by_a_spring_converge_with_order_two_to_one_structure():
    model = chain(STIFFNESS)
    matrix = np.kron(np.eye(2), model.structure.stiffness)
    between = np.array([0, 0, 1, 0, 0, -1.0])
    damping = 0.5 * np.eye(6) + 1e-5 * matrix
    points = {"a": 2, "b": 5}
    stops = [mp.UnilateralContact(f"stop{i}", np.eye(6)[i], GAP, STIFFNESS) for i in (1, 4)]
    whole = mp.LinearStructure(np.eye(6), matrix + SPRING * np.outer(between, between), damping, points)
    native = mp.simulate(
        mp.MultiPhiModel(whole, stops, modes="all"), END, displacement=np.concatenate([START, -START / 2])
    )
    assert {event.contact for event in native.events} == {"stop1", "stop4"}

    def shown(step):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        bodies = [
            CreateMultiPhiBody(mbs, model, name, displacement=start, interface=("m2",), matchedStepSize=step)
            for name, start in (("a", START), ("b", -START / 2))
        ]
        nodes = [items["nInterface"]["m2"] for items in bodies]
        mbs.AddObject(CoordinateSpringDamper(markerNumbers=[coordinate(mbs, node) for node in nodes], stiffness=SPRING))
        sensors = [watch(mbs, node) for node in nodes]
        mbs.Assemble()
        mbs.SolveDynamic(settings(step), solverType=TRAPEZOIDAL)
        return np.concatenate([mbs.GetSensorStoredData(sensor)[:, 1] for sensor in sensors])

    def expected(t):
        t = t[: len(t) // 2]
        return np.concatenate([native.at("a", t), native.at("b", t)])

    order, error = order_and_error(shown, expected)
    assert order > 1.8
    assert error < 3e-4


@pytest.mark.parametrize(
    ("stiffness", "load", "closed"),
    [(STIFFNESS, -60.0, False), (math.inf, -200.0, True)],
    ids=["from an open end", "from a closed end"],
)
def test_a_second_run_of_one_system_begins_in_the_level_of_its_start(stiffness, load, closed):
    model = chain(stiffness)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, displacement=START, interface=("m2",))
    sensor = watch(mbs, items["nInterface"]["m2"])
    spring(mbs, items)
    mass_tied(mbs, items)
    mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"]["m2"]), load=load))
    mbs.Assemble()
    stored = []
    for _ in range(2):
        mbs.SolveDynamic(settings(STEP), solverType=TRAPEZOIDAL)
        stored.append(mbs.GetSensorStoredData(sensor))
        assert (mbs.GetSensorStoredData(items["sLevel"])[-1, 1] > 0.5) == closed
    assert np.max(np.abs(stored[0] - stored[1])) < 1e-12


def test_what_an_interface_cannot_hold_is_refused():
    model, mbs = chain(STIFFNESS), exu.SystemContainer().AddSystem()
    for interface, error, told in [
        ("m2", mp.errors.MultiPhiTypeError, "interface: got 'm2', need names"),
        (("m7",), mp.errors.MultiPhiValueError, "point: got 'm7'"),
        ({"none": np.zeros(3)}, mp.errors.MultiPhiValueError, "a row of zeros"),
        ({3: "m2"}, mp.errors.MultiPhiTypeError, "interface: got 3"),
        ({"tip": (1.0, 0.0)}, mp.errors.MultiPhiValueError, "interface 'tip': got .*, need a point, a row"),
    ]:
        with pytest.raises(error, match=told):
            CreateMultiPhiBody(mbs, model, interface=interface)
    with pytest.raises(
        mp.errors.MultiPhiValueError, match="got HarmonicLoad in a body with an interface, need constant"
    ):
        CreateMultiPhiBody(mbs, model, interface=("m2",), loads=[mp.HarmonicLoad("m2", 1.0, 2.0)])
    with pytest.raises(ValueError, match="need TrapezoidalIndex2"):
        run(model, STEP, spring, solver=exu.DynamicSolverType.GeneralizedAlpha)


def test_the_base_of_a_large_structure_is_given_what_the_interface_and_the_loads_act_on():
    n = 700
    stiffness = 1e6 * scipy.sparse.diags_array([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
    structure = mp.LinearStructure(scipy.sparse.eye_array(n).tocsr(), stiffness.tocsr(), points={"end": n - 1})
    model = mp.MultiPhiModel(structure, modes=4)
    rows = np.eye(n)[[200, 431]]
    assert all(model.outside(row) > 1e-3 for row in rows)
    mbs = exu.SystemContainer().AddSystem()
    given = {"interface": {"middle": rows[0]}, "loads": [mp.ConstantLoad(rows[1], 1.0)]}
    CreateMultiPhiBody(mbs, model, name="b", **given)
    assert all(mbs.variables["multiPhi"]["b"].model.outside(row) < 1e-12 for row in rows)
    CreateMultiPhiBody(mbs, model, name="at a point", interface=("end",))
    assert mbs.variables["multiPhi"]["at a point"].model is model
