"""A motion of a reduced Exudyn system says whether it stays where the linearisation holds; the system is left alone."""

import copy
import itertools
import pickle
import warnings

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import reduce

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

KINDS = (exu.ConfigurationType.Initial, exu.ConfigurationType.Current, exu.ConfigurationType.Visualization)


def new_system():
    container = exu.SystemContainer()
    return container, container.AddSystem()


def pendulum(degrees, length=1.0, gravity=9.81, mass=2.0):
    """A mass on a massless link, released at an angle from its equilibrium: a distance constraint, and a start speed
    that it would have when it has swung from there."""
    container, mbs = new_system()
    angle = np.radians(degrees)
    ground = mbs.AddNode(eii.NodePointGround())
    speed = np.sqrt(2 * gravity * length * (1 - np.cos(angle)))
    bob = mbs.AddNode(eii.NodePoint2D(name="bob", referenceCoordinates=[0.0, -length], initialVelocities=[speed, 0.0]))
    mbs.AddObject(eii.ObjectMassPoint2D(name="ball", mass=mass, nodeNumber=bob))
    markers = [
        mbs.AddMarker(eii.MarkerNodePosition(name=f"m{n}", nodeNumber=node)) for n, node in enumerate((ground, bob))
    ]
    mbs.AddObject(eii.ObjectConnectorDistance(name="link", markerNumbers=markers, distance=length))
    mbs.AddLoad(eii.LoadForceVector(markerNumber=markers[1], loadVector=[0.0, -mass * gravity, 0.0]))
    mbs.Assemble()
    return container, mbs


def double_pendulum(degrees):
    """Two rigid links of 1 m, joints, at an angle from hanging straight."""
    container, mbs = new_system()
    angle = np.radians(degrees)
    ground = mbs.AddObject(eii.ObjectGround())
    before, local, top = ground, [0.0, 0.0, 0.0], np.zeros(3)
    for name in ("upper", "lower"):
        along = np.array([np.sin(angle), -np.cos(angle), 0.0])
        centre = top + along / 2
        node = mbs.AddNode(
            eii.NodeRigidBody2D(name=f"n{name}", referenceCoordinates=[centre[0], centre[1], angle - np.pi / 2])
        )
        body = mbs.AddObject(eii.ObjectRigidBody2D(name=name, mass=1.0, inertia=1 / 12, nodeNumber=node))
        ends = [
            mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=b, localPosition=place))
            for b, place in ((before, local), (body, [-0.5, 0.0, 0.0]))
        ]
        mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=ends))
        mass = mbs.AddMarker(eii.MarkerBodyMass(bodyNumber=body))
        mbs.AddLoad(eii.LoadMassProportional(markerNumber=mass, loadVector=[0.0, -9.81, 0.0]))
        before, local, top = body, [0.5, 0.0, 0.0], top + along
    mbs.Assemble()
    return container, mbs


def slider_crank(turn, torque=None):
    """A crank of 0.2 m, a connecting rod of 0.5 m, a slider on a line; the crank turns at ``turn`` rad/s."""
    container, mbs = new_system()
    ground = mbs.AddObject(eii.ObjectGround())
    angle = np.pi / 2
    tip = 0.2 * np.array([np.cos(angle), np.sin(angle), 0.0])
    slope = -np.arcsin(0.2 / 0.5)
    end = tip + 0.5 * np.array([np.cos(slope), np.sin(slope), 0.0])
    crank = mbs.AddNode(
        eii.NodeRigidBody2D(
            referenceCoordinates=[*tip[:2] / 2, angle], initialVelocities=[-turn * tip[1] / 2, turn * tip[0] / 2, turn]
        )
    )
    speed = -turn * tip[1]  # of the crank's tip along x; rod and slider move with it, for the tip moves along x
    rod = mbs.AddNode(
        eii.NodeRigidBody2D(referenceCoordinates=[*(tip + end)[:2] / 2, slope], initialVelocities=[speed, 0.0, 0.0])
    )
    slider = mbs.AddNode(eii.NodePoint2D(referenceCoordinates=list(end[:2]), initialVelocities=[speed, 0.0]))
    bodies = [
        mbs.AddObject(eii.ObjectRigidBody2D(mass=0.5, inertia=2e-3, nodeNumber=crank)),
        mbs.AddObject(eii.ObjectRigidBody2D(mass=1.0, inertia=2e-2, nodeNumber=rod)),
        mbs.AddObject(eii.ObjectMassPoint2D(mass=1.0, nodeNumber=slider)),
    ]

    def marker(body, x):
        return mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body, localPosition=[x, 0.0, 0.0]))

    for pair in (
        (marker(ground, 0.0), marker(bodies[0], -0.1)),
        (marker(bodies[0], 0.1), marker(bodies[1], -0.25)),
        (marker(bodies[1], 0.25), marker(bodies[2], 0.0)),
    ):
        mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=list(pair)))
    held = [
        mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=c))
        for n, c in ((mbs.AddNode(eii.NodePointGround()), 0), (slider, 1))
    ]
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=held))
    mbs.Assemble()
    return container, mbs


def sliding_mass(speed):
    """A mass on a spring of 1 m that lies across its way: no stiffness at first, and more the farther it slides."""
    container, mbs = new_system()
    ground = mbs.AddObject(eii.ObjectGround())
    node = mbs.AddNode(eii.NodePoint2D(referenceCoordinates=[0.0, 1.0], initialVelocities=[speed, 0.0]))
    mass = mbs.AddObject(eii.ObjectMassPoint2D(mass=1.0, nodeNumber=node))
    ends = [mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=b)) for b in (ground, mass)]
    mbs.AddObject(eii.ObjectConnectorSpringDamper(markerNumbers=ends, referenceLength=0.99, stiffness=1e3))
    mbs.Assemble()
    return container, mbs


def run(reduction, end):
    return mp.simulate(reduction.model, end, velocity=reduction.velocity, loads=reduction.loads)


def told(trajectory, kind="linear range"):
    return [sentence for sentence in trajectory.warnings if sentence.startswith(kind + ": ")]


def test_a_pendulum_of_57_degrees_warns_and_one_of_half_a_degree_does_not():
    for degrees, sentences in ((57.0, 1), (0.5, 0)):
        _, mbs = pendulum(degrees)
        reduction = reduce(mbs)
        trajectory = run(reduction, 1.0)
        assert trajectory.status == "ok"
        assert len(told(trajectory)) == len(trajectory.warnings) == sentences
        assert reduction.check(trajectory).holds is (sentences == 0)


def test_the_warning_is_issued_with_the_time_and_the_number():
    _, mbs = pendulum(57.0)
    reduction = reduce(mbs)
    with pytest.warns(mp.MultiPhiWarning, match=r"^linear range: left by t = 0\.\d+ s; .* \d+ % of"):
        run(reduction, 1.0)


def test_the_error_of_a_pendulum_is_what_it_rises_by():
    """The bob rises by x^2 / (2 length), which a motion along x leaves out; its force is off by more than x^3 only."""
    _, mbs = pendulum(2.0)
    reduction = reduce(mbs)
    found = reduction.check(run(reduction, 1.0))
    assert found.error == pytest.approx(np.radians(2.0) / 2, rel=0.02)


@pytest.mark.parametrize(
    ("build", "large", "small", "end"),
    [
        (double_pendulum, 40.0, 0.0, 1.0),
        (slider_crank, 10.0, 0.02, 0.5),
        (sliding_mass, 2.0, 1e-3, 1.0),
    ],
)
def test_mechanisms_in_large_motion_warn_and_in_small_motion_do_not(build, large, small, end):
    _, mbs = build(large)
    assert len(told(run(reduce(mbs), end))) == 1
    _, mbs = build(small)
    assert told(run(reduce(mbs), end)) == []


@pytest.mark.parametrize("sign", [-1, 1])
@pytest.mark.parametrize(("unit", "power"), [("length", 10), ("mass", 40), ("time", 40)])
def test_units_change_no_number(unit, power, sign):
    """Exudyn's differentiation takes steps of an absolute length, which ends where lengths can be scaled to."""
    scale = 2.0 ** (sign * power)
    _, mbs = pendulum(5.0)
    reduction = reduce(mbs)
    expected = reduction.check(run(reduction, 1.0)).error
    given = {
        "length": {"length": scale, "gravity": 9.81 * scale},
        "mass": {"mass": 2.0 * scale},
        "time": {"gravity": 9.81 / scale**2},
    }
    _, mbs = pendulum(5.0, **given[unit])
    reduction = reduce(mbs)
    found = reduction.check(run(reduction, scale if unit == "time" else 1.0)).error
    assert found == pytest.approx(expected, rel=1e-3)


def driven_rotor(degrees, end):
    """A rigid bar on a hinge with a torsional spring, turned by a force across it that is a function of time."""
    container, mbs = new_system()
    ground = mbs.AddObject(eii.ObjectGround())
    node = mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[0.5, 0.0, 0.0]))
    bar = mbs.AddObject(eii.ObjectRigidBody2D(mass=1.0, inertia=1 / 12, nodeNumber=node))
    ends = [
        mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=b, localPosition=[x, 0.0, 0.0]))
        for b, x in ((ground, 0.0), (bar, -0.5))
    ]
    mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=ends))
    turn = [
        mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=c))
        for n, c in ((mbs.AddNode(eii.NodePointGround()), 0), (node, 2))
    ]
    mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=turn, stiffness=10.0))
    tip = mbs.AddMarker(eii.MarkerBodyPosition(name="tip", bodyNumber=bar, localPosition=[0.5, 0.0, 0.0]))
    size = 10.0 * np.radians(degrees)

    def force(mbs, t, vector):
        return [0.5 * size * np.cos(9.0 * t), size * np.sin(4.0 * t), 0.0]

    mbs.AddLoad(
        eii.LoadForceVector(name="push", markerNumber=tip, loadVector=[0.0, 1.0, 0.0], loadVectorUserFunction=force)
    )
    mbs.Assemble()
    return container, mbs, tip


def test_a_vector_force_by_a_function_of_time_is_taken_and_moves_the_model_as_the_system():
    _, mbs, tip = driven_rotor(0.02, 1.0)
    reduction = reduce(mbs)
    trajectory = run(reduction, 1.0)
    assert reduction.left_out == ()
    assert "LoadForceVector 'push': load by its function of time" in reduction.report
    assert trajectory.warnings == ()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = 1.0, 4000
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    moved = mbs.GetMarkerOutput(tip, exu.OutputVariableType.Displacement)[1]
    assert trajectory.at("tip.y", 1.0) == pytest.approx(moved, rel=1e-3)


def test_forces_by_functions_of_time_are_part_of_what_is_checked():
    """A force along the bar does nothing to it, until it has turned."""
    _, mbs, _ = driven_rotor(20.0, 1.0)
    assert len(told(run(reduce(mbs), 1.0))) == 1


def state_of(mbs):
    data = mbs.systemData
    return [[*data.GetSystemState(kind), data.GetODE2Coordinates_tt(kind), [data.GetTime(kind)]] for kind in KINDS] + [
        repr(mbs.GetLoad(i)) for i in range(data.NumberOfLoads())
    ]


@pytest.mark.parametrize("fails", [False, True])
def test_the_check_leaves_the_system_as_it_was(monkeypatch, fails):
    _, mbs, _ = driven_rotor(20.0, 1.0)
    reduction = reduce(mbs)
    trajectory = run(reduction, 1.0)
    data = mbs.systemData
    data.SetODE2Coordinates([0.1, 0.2, 0.3])
    data.SetODE2Coordinates_tt([3.0, 2.0, 1.0])
    data.SetTime(0.7)
    before = state_of(mbs)
    if fails:
        monkeypatch.setattr(exu.MainSolverStatic, "ComputeODE2RHS", lambda *_: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            reduction.check(trajectory)
    else:
        reduction.check(trajectory)
    for one, other in zip(state_of(mbs), before, strict=True):
        np.testing.assert_equal(one, other)


def test_the_check_takes_a_few_evaluations_only(monkeypatch):
    _, mbs = double_pendulum(10.0)
    reduction = reduce(mbs)
    trajectory = run(reduction, 1.0)
    asked = []
    original = exu.MainSolverStatic.ComputeODE2RHS

    def counted(*given):
        asked.append(1)
        return original(*given)

    monkeypatch.setattr(exu.MainSolverStatic, "ComputeODE2RHS", counted)
    reduction.check(trajectory)
    assert 3 <= len(asked) <= 20


def test_a_system_that_has_grown_since_is_told_and_not_asked():
    _, mbs = pendulum(57.0)
    reduction = reduce(mbs)
    mbs.AddNode(eii.NodePoint2D())
    (sentence,) = run(reduction, 1.0).warnings
    assert sentence.startswith("linear range: not checked, the Exudyn system has been changed and not assembled")
    mbs.AddObject(eii.ObjectMassPoint2D(mass=1.0, nodeNumber=2))
    mbs.Assemble()
    trajectory = run(reduction, 1.0)
    (sentence,) = trajectory.warnings
    assert sentence == "linear range: not checked, the Exudyn system has 4 coordinates, and had 2 when it was reduced"
    assert np.isnan(reduction.check(trajectory).error)


def test_a_pickled_model_keeps_limits_and_copies_ask_the_system():
    for degrees, sentences in ((57.0, 1), (0.5, 0)):
        _, mbs = pendulum(degrees)
        reduction = reduce(mbs)
        for made in (
            pickle.loads(pickle.dumps(reduction.model)),
            copy.deepcopy(reduction.model),
            copy.copy(reduction.model),
        ):
            trajectory = mp.simulate(made, 1.0, velocity=reduction.velocity)
            assert len(told(trajectory)) == sentences
        assert pickle.loads(pickle.dumps(pickle.loads(pickle.dumps(reduction)))).check(trajectory).holds is (
            sentences == 0
        )


def test_a_linear_system_has_no_limits():
    container, mbs = new_system()
    node = mbs.AddNode(eii.NodePoint2D(initialVelocities=[1.0, 0.0]))
    mbs.AddObject(eii.ObjectMassPoint2D(mass=1.0, nodeNumber=node))
    ends = [
        mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0))
        for n in (mbs.AddNode(eii.NodePointGround()), node)
    ]
    mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=ends, stiffness=100.0, damping=1.0))
    mbs.Assemble()
    reduction = reduce(mbs)
    trajectory = run(reduction, 1e3)
    assert reduction.check(trajectory).error < 1e-12
    assert pickle.loads(pickle.dumps(reduction)).check(trajectory).error == 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        run(reduction, 1e3)
    del container


def test_a_slender_beam_that_bends_is_not_said_to_be_stretched():
    """A cantilever's tip moves by 1 % of its length: far less than its axial forces would have it, were it straight."""
    _, mbs = new_system()
    nodes = [
        mbs.AddNode(eii.NodePoint2DSlope1(referenceCoordinates=[x, 0.0, 1.0, 0.0])) for x in np.linspace(0.0, 1.0, 5)
    ]
    for pair in itertools.pairwise(nodes):
        mbs.AddObject(
            eii.ObjectANCFCable2D(
                length=0.25,
                massPerLength=1.0,
                bendingStiffness=1.0,
                axialStiffness=1e6,
                nodeNumbers=list(pair),
            )
        )
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    for c in (0, 1, 3):
        held = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=nodes[0], coordinate=c))
        mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=[ground, held]))
    tip = mbs.AddMarker(eii.MarkerNodePosition(name="tip", nodeNumber=nodes[-1]))
    push = mbs.AddLoad(eii.LoadForceVector(markerNumber=tip, loadVector=[0.0, 0.03, 0.0]))
    for force, holds in ((0.02, True), (3.0, False)):
        mbs.SetLoadParameter(push, "loadVector", [0.0, force, 0.0])
        mbs.Assemble()
        reduction = reduce(mbs, modes="all")
        trajectory = run(reduction, 2.0)
        assert np.max(trajectory.at("tip.y", np.linspace(0.0, 2.0, 99))) == pytest.approx(2 * force / 3, rel=0.05)
        assert reduction.check(trajectory).holds is holds


def test_a_report_of_a_run_says_what_holds_until_when_and_what_it_warns_of():
    _, mbs = pendulum(57.0)
    reduction = reduce(mbs)
    trajectory = run(reduction, 1.0)
    linear, horizon, *warned = reduction.report_of(trajectory).splitlines()
    assert linear.startswith("linear range (does not hold): what the model leaves out moves it by ")
    assert horizon == "horizon: determined within 1 % until 1 s of 1 s"
    assert warned == [f"warning: {sentence}" for sentence in trajectory.warnings]
    assert warned[0].startswith("warning: linear range: ")
