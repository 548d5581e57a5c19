"""Masses and constraints on interface coordinates beside rigid contacts: one impact of all that hangs together."""

import math
from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    CoordinateSpringDamper,
    LoadCoordinate,
    LoadForceVector,
    MarkerNodeCoordinate,
    MarkerNodePosition,
    Mass1D,
    MassPoint2D,
    Node1D,
    NodeGenericODE1,
    NodePoint2D,
    NodePointGround,
    ObjectConnectorCoordinate,
    ObjectConnectorDistance,
    ObjectGenericODE1,
    ObjectGenericODE2,
)
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from test_interface import (
    DAMPER,
    END,
    GAP,
    MASS,
    SPRING,
    START,
    STIFFNESS,
    TRAPEZOIDAL,
    chain,
    coordinate,
    mass_on,
    mass_tied,
    run,
    settings,
    watch,
)

import multiphi_exudyn as mp
import multiphi_exudyn._core as core
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

COUPLING = 0.25  # kg, between neighbours: an impact on the second mass moves the others
STEPS = END / np.array([250, 400, 1000, 2500])  # s
ORDER = 1.5  # at least, fitted to all steps; an event's place in its step scatters errors by 3


def order_and_last(shown, expected, steps=STEPS):
    """Order fitted to all steps, the relative error at the last, and the events there, of shown(step)."""
    errors = []
    for step in steps:
        y, events = shown(step)
        exact = expected(np.minimum(np.arange(len(y)) * step, END))
        errors.append(np.linalg.norm(y - exact) / np.linalg.norm(exact))
    return np.polyfit(np.log(steps), np.log(errors), 1)[0], errors[-1], events


def told(events):
    """What happened, instants at which a contact changes back and forth left out."""
    return [(e.contact, e.kind) for e in events if e.impulse > 0 or e.kind == "open"]


def on_point(model, attach, at="m2", matched=True, **given):
    """shown(step): displacement of the third mass of the body with something attached, and its events."""

    def shown(step):
        given["matchedStepSize"] = step if matched else None
        y, _, events = run(model, step, attach, dict.fromkeys(("m2", at)).keys(), **given)
        return y[:, 0], events

    return shown


@pytest.mark.parametrize(("attach", "matched"), [(mass_on, True), (mass_tied, False), (mass_tied, True)])
def test_a_mass_on_a_point_is_struck_with_the_structure(attach, matched):
    native = mp.simulate(chain(math.inf, COUPLING, added_mass=MASS), END, displacement=START)
    assert sum(event.impulse > 0.05 for event in native.events) >= 5
    shown = on_point(chain(math.inf, COUPLING), attach, matched=matched)
    order, error, events = order_and_last(shown, lambda t: native.at("m2", t))
    assert order > ORDER
    assert error < (1e-5 if matched else 1e-3)
    if matched:
        assert told(events) == told(native.events)
        pushed = [[e.impulse for e in each if e.impulse > 0] for each in (events, native.events)]
        assert np.allclose(*pushed, rtol=2e-3)


@pytest.mark.parametrize("attach", [mass_on, mass_tied])
def test_with_restitution_a_mass_on_a_point_rebounds_with_the_structure(attach):
    def bouncing(model):
        stops = [replace(contact, restitution=0.6) for contact in model.contacts]
        return mp.MultiPhiModel(model.structure, stops, modes="all")

    native = mp.simulate(bouncing(chain(math.inf, COUPLING, added_mass=MASS)), END, displacement=START)
    assert sum(event.impulse > 0.3 for event in native.events) >= 5
    shown = on_point(bouncing(chain(math.inf, COUPLING)), attach)
    order, error, events = order_and_last(shown, lambda t: native.at("m2", t))
    assert order > ORDER
    assert error < 1e-4
    assert told(events) == told(native.events)
    pushed = [[e.impulse for e in each if e.impulse > 0] for each in (events, native.events)]
    assert np.allclose(*pushed, rtol=2e-3)


def stopped_twice(added_mass=0.0):
    """The chain with rigid stops at the first and at the second mass, at one place."""
    s = chain(math.inf, COUPLING, added_mass=added_mass).structure
    stops = [mp.UnilateralContact(f"stop{i}", f"m{i}", gap) for i, gap in ((0, 0.7 * GAP), (1, GAP))]
    return mp.MultiPhiModel(s, stops, modes="all")


@pytest.mark.parametrize("load", [0.0, -15.0])
def test_with_two_stops_a_mass_on_a_point_decides_which_of_them_press(load):
    heavy = 4 * MASS
    native = mp.simulate(
        stopped_twice(heavy), END, displacement=START, loads=[mp.ConstantLoad("m2", load)] if load else []
    )
    assert {event.contact for event in native.events} == {"stop0", "stop1"}

    def attach(mbs, items):
        mbs.AddObject(ObjectGenericODE2(nodeNumbers=[items["nInterface"]["m2"]], massMatrix=[[heavy]]))
        mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"]["m2"]), load=load))

    order, error, events = order_and_last(on_point(stopped_twice(), attach), lambda t: native.at("m2", t))
    assert order > ORDER
    assert error < 5e-5
    assert told(events) == told(native.events)


def test_a_point_held_by_a_constraint_takes_part_in_impacts_as_a_fixed_one():
    model = chain(math.inf, COUPLING)
    s, start = model.structure, np.array([0.0, 0.01, 0.0])
    free = slice(0, 2)
    rest = mp.LinearStructure(s.mass[free, free], s.stiffness[free, free], s.damping[free, free], {"m0": 0, "m1": 1})
    native = mp.simulate(mp.MultiPhiModel(rest, model.contacts, modes="all"), END, displacement=start[free])
    assert sum(event.impulse > 0.05 for event in native.events) >= 3

    def shown(step):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        items = CreateMultiPhiBody(mbs, model, "b", displacement=start, interface=("m0", "m2"), matchedStepSize=step)
        ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m2"])]
        mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends))
        sensors = [watch(mbs, node) for node in items["nInterface"].values()]
        mbs.Assemble()
        mbs.SolveDynamic(settings(step), solverType=TRAPEZOIDAL)
        y, held = (mbs.GetSensorStoredData(sensor)[:, 1] for sensor in sensors)
        assert np.max(np.abs(held)) < 1e-2 * np.max(np.abs(y))
        return y, mbs.variables["multiPhi"]["b"].events

    order, error, events = order_and_last(shown, lambda t: native.at("m0", t))
    assert order > ORDER
    assert error < 5e-5
    assert told(events) == told(native.events)


def spring_at_stop(mbs, items):
    ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m1"])]
    mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, stiffness=SPRING, damping=DAMPER))


def mass_at_stop(mbs, items):
    mbs.AddObject(ObjectGenericODE2(nodeNumbers=[items["nInterface"]["m1"]], massMatrix=[[MASS]]))


def load_at_stop(mbs, items):
    mbs.AddLoad(LoadCoordinate(markerNumber=coordinate(mbs, items["nInterface"]["m1"]), load=-12.0))


@pytest.mark.parametrize(
    ("attach", "mass", "spring", "load"),
    [(spring_at_stop, 0.0, 1.0, 0.0), (mass_at_stop, MASS, 0.0, 0.0), (load_at_stop, 0.0, 0.0, -12.0)],
)
def test_a_point_that_a_rigid_contact_holds_carries_what_acts_on_it(attach, mass, spring, load):
    s, second = chain(math.inf, COUPLING).structure, np.diag([0.0, 1.0, 0.0])
    whole = mp.LinearStructure(
        s.mass + mass * second,
        s.stiffness + spring * SPRING * second,
        s.damping + spring * DAMPER * second,
        {"m1": 1, "m2": 2},
    )
    stop = chain(math.inf).contacts
    pressing = mp.ConstantLoad("m2", -15.0)
    loads = [pressing, mp.ConstantLoad("m1", load)] if load else [pressing]
    native = mp.simulate(mp.MultiPhiModel(whole, stop, modes="all"), END, displacement=START, loads=loads)
    held = [b.time - a.time for a, b in zip(native.events, native.events[1:], strict=False) if a.kind == "close"]
    assert sum(time > STEPS[0] for time in held) >= 2
    shown = on_point(chain(math.inf, COUPLING), attach, at="m1", loads=[pressing])
    order, error, events = order_and_last(shown, lambda t: native.at("m2", t))
    assert load or order > ORDER
    assert error < (1e-9 if load else 3e-5)
    assert told(events) == told(native.events)


def test_a_mass_behind_a_damper_on_a_struck_point_converges_with_order_two():
    between, damper = np.array([0, 0, 1, -1.0]), 30.0
    coupling, s = np.outer(between, between), chain(math.inf, COUPLING).structure
    whole = mp.LinearStructure(
        np.pad(s.mass, (0, 1)) + np.diag([0, 0, 0, MASS]),
        np.pad(s.stiffness, (0, 1)) + SPRING * coupling,
        np.pad(s.damping, (0, 1)) + damper * coupling,
        {"m1": 1, "m2": 2, "mass": 3},
    )
    stop = [mp.UnilateralContact("stop", "m1", GAP)]
    native = mp.simulate(mp.MultiPhiModel(whole, stop, modes="all"), END, displacement=np.append(START, 0.0))
    assert sum(event.impulse > 0.05 for event in native.events) >= 2

    def shown(step):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        body = {"displacement": START, "interface": ("m2",), "matchedStepSize": step}
        items = CreateMultiPhiBody(mbs, chain(math.inf, COUPLING), "b", **body)
        node = mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
        mbs.AddObject(Mass1D(nodeNumber=node, mass=MASS))
        ends = [coordinate(mbs, node), coordinate(mbs, items["nInterface"]["m2"])]
        mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, stiffness=SPRING, damping=damper))
        sensor = watch(mbs, node)
        mbs.Assemble()
        mbs.SolveDynamic(settings(step), solverType=TRAPEZOIDAL)
        return mbs.GetSensorStoredData(sensor)[:, 1], mbs.variables["multiPhi"]["b"].events

    order, error, _ = order_and_last(shown, lambda t: native.at("mass", t))
    assert order > 1.9
    assert error < 2e-5


def test_a_contact_damper_that_makes_the_force_of_a_mass_jump_converges_with_order_two():
    stop = [mp.UnilateralContact("stop", "m1", GAP, STIFFNESS, 60.0)]
    heavy, light = (chain(STIFFNESS, COUPLING, added_mass=mass).structure for mass in (MASS, 0.0))
    native = mp.simulate(mp.MultiPhiModel(heavy, stop, modes="all"), END, displacement=START)
    assert len(native.events) >= 4
    shown = on_point(mp.MultiPhiModel(light, stop, modes="all"), mass_on)
    order, error, events = order_and_last(shown, lambda t: native.at("m2", t))
    assert order > ORDER
    assert error < 1e-5
    assert told(events) == told(native.events)


CARRIAGE, BOB, LENGTH, SWUNG, GRAVITY = 0.2, 0.3, 0.02, 0.6, 9.81  # kg, kg, m, rad, m/s2


def pendulum(mbs, items):
    """A pendulum on a carriage that moves with the third mass; its weight acts across that motion."""
    across = START[2]
    carriage = mbs.AddNode(NodePoint2D(initialCoordinates=[0.0, across]))
    away = [LENGTH * math.cos(SWUNG), LENGTH * math.sin(SWUNG)]
    bob = mbs.AddNode(NodePoint2D(referenceCoordinates=away, initialCoordinates=[0.0, across]))
    for node, mass in ((carriage, CARRIAGE), (bob, BOB)):
        mbs.AddObject(MassPoint2D(nodeNumber=node, mass=mass))
    ground = coordinate(mbs, mbs.AddNode(NodePointGround()))
    along, beside = (mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=carriage, coordinate=c)) for c in (0, 1))
    mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=[ground, along]))
    mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=[coordinate(mbs, items["nInterface"]["m2"]), beside]))
    ends = [mbs.AddMarker(MarkerNodePosition(nodeNumber=node)) for node in (carriage, bob)]
    mbs.AddObject(ObjectConnectorDistance(markerNumbers=ends, distance=LENGTH))
    mbs.AddLoad(LoadForceVector(markerNumber=ends[1], loadVector=[BOB * GRAVITY, 0.0, 0.0]))


def integrated_pendulum(times):
    """m2 of the chain with the pendulum and a rigid stop at m1, from impact to impact by DOP853: x, phi (4,)."""
    s = chain(math.inf, COUPLING).structure
    row = np.array([0.0, 1.0, 0.0, 0.0])

    def matrices(phi, omega, x, v):
        mass = np.pad(s.mass, (0, 1))
        mass[2, 2] += CARRIAGE + BOB
        mass[2, 3] = mass[3, 2] = BOB * LENGTH * math.cos(phi)
        mass[3, 3] = BOB * LENGTH**2
        force = np.append(-s.stiffness @ x - s.damping @ v, -BOB * GRAVITY * LENGTH * math.sin(phi))
        force[2] += BOB * LENGTH * math.sin(phi) * omega**2
        return mass, force

    def acceleration(z, closed):
        mass, force = matrices(z[3], z[7], z[:3], z[4:7])
        free = np.linalg.solve(mass, force)
        if not closed:
            return free, 0.0
        give = np.linalg.solve(mass, row)
        push = -free[1] / give[1]
        return free + push * give, push

    def reaches(t, z, closed):
        return acceleration(z, True)[1] if closed else z[1] + GAP

    reaches.terminal, reaches.direction = True, -1
    z, t, closed, shown, impacts = np.concatenate([START, [SWUNG], np.zeros(4)]), 0.0, False, np.empty(len(times)), []
    while t < times[-1]:
        found = solve_ivp(
            lambda t, z, closed: np.concatenate([z[4:], acceleration(z, closed)[0]]),
            (t, times[-1]),
            z,
            "DOP853",
            rtol=1e-11,
            atol=1e-13,
            max_step=1e-3,
            events=reaches,
            dense_output=True,
            args=(closed,),
        )
        here = (times >= t) & (times <= found.t[-1])
        shown[here] = found.sol(times[here])[2]
        t, z = found.t[-1], found.y[:, -1]
        if found.status == 0:
            break
        if closed:
            closed = False
            continue
        give = np.linalg.solve(matrices(z[3], z[7], z[:3], z[4:7])[0], row)
        impacts.append(-z[5] / give[1])
        z[4:] -= z[5] / give[1] * give
        closed = acceleration(z, True)[1] > 0
        z[1] = -GAP * (1 - 1e-13)
    return shown, impacts


def test_a_pendulum_on_a_point_is_struck_with_the_structure():
    fine = np.unique(np.concatenate([np.minimum(np.arange(round(END / s) + 1) * s, END) for s in STEPS]))
    m2, impacts = integrated_pendulum(fine)  # at the very instants that are compared
    assert sum(impulse > 0.05 for impulse in impacts) >= 3
    shown = on_point(chain(math.inf, COUPLING), pendulum)
    order, error, events = order_and_last(shown, lambda t: np.interp(t, fine, m2))
    assert order > ORDER
    assert error < 3e-5
    struck = [event.impulse for event in events if event.impulse > 1e-3]
    assert struck[:3] == pytest.approx([i for i in impacts if i > 1e-3][:3], rel=1e-3)


@pytest.mark.parametrize("rigid_second", [False, True])
@pytest.mark.parametrize("order", ["ba", "ab"])
def test_two_bodies_tied_at_a_point_are_struck_as_one_or_refused(rigid_second, order):
    """Their contacts close within the same steps, whichever body was there first."""
    first, s = chain(math.inf, COUPLING), chain(math.inf, COUPLING).structure
    stop = [mp.UnilateralContact("other", "m1", GAP, math.inf if rigid_second else STIFFNESS)]
    second = mp.MultiPhiModel(s, stop, modes="all")
    whole = mp.assemble({"a": s, "b": s}, ties=[{"a.m2": 1.0, "b.m2": -1.0}])
    stops = [mp.UnilateralContact("stop", "a.m1", GAP), mp.UnilateralContact("other", "b.m1", GAP, STIFFNESS)]
    start = np.linalg.lstsq(
        np.array([whole.row(f"{b}.m{i}") for b in "ab" for i in range(3)]), np.tile(START, 2), rcond=None
    )[0]
    native = mp.simulate(mp.MultiPhiModel(whole, stops, modes="all"), END, displacement=start)

    def shown(step):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        bodies = [
            CreateMultiPhiBody(mbs, model, name, displacement=START, interface=("m2",), matchedStepSize=step)
            for name, model in sorted((("b", second), ("a", first)), key=lambda each: order.index(each[0]))
        ]
        nodes = [items["nInterface"]["m2"] for items in bodies]
        mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=[coordinate(mbs, node) for node in nodes]))
        sensor = watch(mbs, nodes[0])
        mbs.Assemble()
        mbs.SolveDynamic(settings(step), solverType=TRAPEZOIDAL)
        return mbs.GetSensorStoredData(sensor)[:, 1], mbs.variables["multiPhi"]["a"].events

    if rigid_second:
        with pytest.raises(ValueError, match=r"constraints that tie body '[ab]' to another, both with rigid"):
            shown(STEPS[0])
        return
    assert {event.contact for event in native.events} == {"stop", "other"}
    fitted, error, _ = order_and_last(shown, lambda t: native.at("a.m2", t))
    assert fitted > ORDER
    assert error < 5e-5


def test_a_start_into_a_rigid_stop_with_a_mass_on_a_point_is_refused():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    model = chain(math.inf, COUPLING)
    given = {"displacement": np.array([0.0, -GAP, 0.0]), "velocity": np.array([0.0, -1.0, 0.0])}
    items = CreateMultiPhiBody(mbs, model, "b", **given, interface=("m2",))
    mass_on(mbs, items)
    mbs.Assemble()
    with pytest.raises(ValueError, match="start of 'b': got a velocity into a rigid contact, with masses"):
        mbs.SolveDynamic(settings(STEPS[0]), solverType=TRAPEZOIDAL)


@pytest.mark.parametrize("velocity", [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
def test_a_start_at_a_stop_that_is_not_struck_runs(velocity):
    given = {"velocity": np.array(velocity), "matchedStepSize": STEPS[-1]}
    place = np.array([0.0, -GAP, 0.0])
    native = mp.simulate(
        chain(math.inf, COUPLING, added_mass=MASS), END, displacement=place, velocity=given["velocity"]
    )
    y, events = simulated(chain(math.inf, COUPLING), mass_on, STEPS[-1], displacement=place, **given)
    expected = native.at("m2", np.minimum(np.arange(len(y)) * STEPS[-1], END))
    assert np.linalg.norm(y - expected) < 5e-3 * np.linalg.norm(expected)
    assert any(event.impulse > 1e-3 for event in events)


def simulated(model, attach, step, end=END, interface=("m2",), watched="m2", **given):
    """Displacement of an interface coordinate, and the body's events."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, model, "b", interface=interface, **given)
    attach(mbs, items)
    sensor = watch(mbs, items["nInterface"][watched]) if interface else None
    mbs.Assemble()
    chosen = settings(step)
    chosen.timeIntegration.endTime, chosen.timeIntegration.numberOfSteps = end, round(end / step)
    mbs.SolveDynamic(chosen, solverType=TRAPEZOIDAL)
    y = mbs.GetSensorStoredData(sensor)[:, 1] if interface else None
    return y, mbs.variables["multiPhi"]["b"].events


def pin(mbs, items):
    """The second mass, held where its stop is."""
    ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m1"])]
    mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends, offset=-GAP))


def test_a_contact_that_constraints_hold_at_its_stop_stays_open_without_a_force():
    start, given = np.array([0.01, -GAP, 0.02]), {"interface": ("m0", "m1"), "watched": "m0"}
    y, events = simulated(chain(math.inf, COUPLING), pin, STEPS[2], displacement=start, **given)
    s, free = chain(math.inf, COUPLING).structure, [0, 2]
    part = np.ix_(free, free)
    rest = mp.LinearStructure(s.mass[part], s.stiffness[part], s.damping[part], {"m0": 0, "m2": 1})
    pulled = [mp.ConstantLoad(f"m{i}", float(s.stiffness[i, 1] * GAP)) for i in free]
    native = mp.simulate(mp.MultiPhiModel(rest, modes="all"), END, displacement=start[free], loads=pulled)
    expected = native.at("m0", np.minimum(np.arange(len(y)) * STEPS[2], END))
    assert events == []
    assert np.linalg.norm(y - expected) < 2e-2 * np.linalg.norm(expected)


def test_what_drives_a_contact_into_its_stop_is_an_error():
    def drive(mbs, items):
        ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nInterface"]["m1"])]
        ways = [
            lambda mbs, t, item, offset, k=k: -3 * GAP * (math.sin(40 * t), 40 * math.cos(40 * t))[k] for k in (0, 1)
        ]
        moved = {"offsetUserFunction": ways[0], "offsetUserFunction_t": ways[1]}
        mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends, **moved))

    with pytest.raises(mp.errors.NumericalFailure, match="drives the closed contact 'stop' into its stop"):
        simulated(
            chain(math.inf, COUPLING),
            drive,
            STEPS[0],
            interface=("m1",),
            watched="m1",
            velocity=np.array([0, -0.12, 0]),
        )


def test_a_step_that_does_not_resolve_what_hangs_there_is_an_error():
    def stiff(mbs, items):
        node = mbs.AddNode(Node1D(referenceCoordinates=[0.0]))
        mbs.AddObject(Mass1D(nodeNumber=node, mass=MASS))
        ends = [coordinate(mbs, node), coordinate(mbs, items["nInterface"]["m2"])]
        mbs.AddObject(CoordinateSpringDamper(markerNumbers=ends, damping=1e5))

    with pytest.raises(mp.errors.NumericalFailure, match=r"steps of 0.001 s are too long for what is"):
        simulated(chain(math.inf, COUPLING), stiff, STEPS[0], displacement=START)


def test_other_coordinates_of_the_system_do_not_count():
    """First-order coordinates have no part in it, and heavy masses elsewhere none in what is round-off."""

    def beside(mbs, items):
        mass_tied(mbs, items)
        first = mbs.AddNode(
            NodeGenericODE1(referenceCoordinates=[0.0], initialCoordinates=[1.0], numberOfODE1Coordinates=1)
        )
        mbs.AddObject(ObjectGenericODE1(nodeNumbers=[first], systemMatrix=[[-3.0]], rhsVector=[0.0]))
        mbs.AddObject(Mass1D(nodeNumber=mbs.AddNode(Node1D(referenceCoordinates=[0.0])), mass=1e10))

    model, given = chain(math.inf, COUPLING), {"displacement": START, "matchedStepSize": STEPS[1]}
    alone, _ = simulated(model, mass_tied, STEPS[1], **given)
    together, _ = simulated(model, beside, STEPS[1], **given)
    assert np.max(np.abs(alone - together)) < 1e-6 * np.max(np.abs(alone))


def mass_on_node(mbs, items):
    mbs.AddObject(ObjectGenericODE2(nodeNumbers=[items["nGenericODE2"]], massMatrix=np.diag([0.1, 0.0, 0.0])))


def constraint_on_node(mbs, items):
    ends = [coordinate(mbs, mbs.AddNode(NodePointGround())), coordinate(mbs, items["nGenericODE2"])]
    mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends))


@pytest.mark.parametrize("attach", [mass_on_node, constraint_on_node])
@pytest.mark.parametrize("interface", [(), ("m2",)])
def test_a_mass_or_a_constraint_on_the_node_of_a_body_that_is_struck_is_refused(attach, interface):
    with pytest.raises(ValueError, match="node of 'b': got a mass or a constraint on the node of a body"):
        simulated(chain(math.inf, COUPLING), attach, STEPS[0], interface=interface, displacement=START)


def test_a_tie_between_bodies_that_are_struck_is_refused_when_it_becomes_active():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    bodies = [
        CreateMultiPhiBody(mbs, chain(math.inf, COUPLING), n, displacement=START, interface=("m2",)) for n in "ab"
    ]
    ends = [coordinate(mbs, items["nInterface"]["m2"]) for items in bodies]
    tie = mbs.AddObject(ObjectConnectorCoordinate(markerNumbers=ends, activeConnector=False))

    def join(mbs, t):
        if t > 0.1:
            mbs.SetObjectParameter(tie, "activeConnector", True)
        return True

    mbs.SetPreStepUserFunction(join)
    mbs.Assemble()
    with pytest.raises(ValueError, match=r"constraints that tie body '[ab]' to another, both with rigid"):
        mbs.SolveDynamic(settings(STEPS[0]), solverType=TRAPEZOIDAL)


@given(st.integers(0, 10**6), st.integers(1, 5), st.integers(1, 3), st.integers(0, 2))
def test_what_is_attached_gives_the_mobility_of_the_whole(seed, modes, points, held):
    """B of the module's docstring is that of body and masses with the constraints written out."""
    rng = np.random.default_rng(seed)
    held = min(held, points)
    rows, factor = rng.normal(size=(points, modes)), rng.normal(size=(points, points))
    directions = np.linalg.qr(rng.normal(size=(points, points)))[0]
    mass, free = factor @ factor.T, directions[:, held:]
    body = core.PointInertia(mass, free, rows)
    constraints = np.hstack([rows, -np.eye(points)]), np.hstack([np.zeros((held, modes)), directions[:, :held].T])
    jacobian = np.vstack(constraints)
    inertia = np.block([[np.eye(modes), np.zeros((modes, points))], [np.zeros((points, modes)), mass]])
    whole = np.block([[inertia, jacobian.T], [jacobian, np.zeros((len(jacobian),) * 2)]])
    pushed = np.vstack([np.eye(modes), np.zeros((len(whole) - modes, modes))])
    expected = np.linalg.lstsq(whole, pushed, rcond=None)[0][:modes]
    if np.linalg.cond(rows @ rows.T + np.eye(points) * 1e-12) > 1e8:
        return  # more constraints than the body has motions
    found = np.eye(modes) - rows.T @ body.impedance(rows) @ rows
    assert np.max(np.abs(found - expected)) < 1e-8
