"""Positions and rigid frames of a body: what Exudyn's own markers and joints do there acts as on the structure."""

import math

import exudyn as exu
import numpy as np
import pytest
from exudyn.itemInterface import (
    Force,
    GenericJoint,
    MarkerBodyRigid,
    MarkerNodePosition,
    MarkerNodeRigid,
    NodePoint,
    NodePoint2D,
    NodeRigidBody2D,
    NodeRigidBodyRxyz,
    SensorNode,
    Torque,
)
from exudyn.utilities import RigidBodyInertia
from test_interface import TRAPEZOIDAL

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, PositionInterface, RigidInterface, body_histories
from reference_models.solver_settings import fixed_steps

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

END = 0.3  # s
PLACE = (0.3, 0.1, -0.2)  # m
MASS, INERTIA = 0.5, 0.02  # kg, kg m2, of a ball: the same about every axis
SMALL = 1e-5  # m, rad: of the motion, so that what large rotations do is round-off
MOVED, TURNED = ["d0", "d1", "d2"], ["d3", "d4", "d5"]
FRAME = RigidInterface(PLACE, MOVED, TURNED)


def structure(added=0.0):
    """Eight coupled coordinates; the first six are those of a frame, added: whether the ball is part of it."""
    random = np.random.default_rng(1)
    coupling = random.standard_normal((8, 8))
    stiffness = 400 * (coupling @ coupling.T + 4 * np.eye(8))
    mass = np.diag([1.0, 1, 1, 0.05, 0.05, 0.05, 1, 1]) + added * np.diag([MASS] * 3 + [INERTIA] * 3 + [0, 0])
    return mp.LinearStructure(mass, stiffness, 1e-4 * stiffness, {f"d{i}": i for i in range(8)})


def model(stiffness=math.inf, added=0.0):
    return mp.MultiPhiModel(
        structure(added), [mp.UnilateralContact("stop", {"d2": 1.0, "d4": 0.3}, 0.3 * SMALL, stiffness)], modes="all"
    )


START = SMALL * np.array([0.5, -0.4, 1.0, 0.6, -0.3, 0.5, 0.0, 0.0])


def solve(mbs, step):
    mbs.Assemble()
    settings = fixed_steps(END, round(END / step), step)
    settings.timeIntegration.newton.relativeTolerance = settings.timeIntegration.newton.absoluteTolerance = 1e-12
    mbs.SolveDynamic(settings, solverType=TRAPEZOIDAL)


def run(given, step, attach, interface, **also):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, given, "b", matchedStepSize=step, interface={"at": interface}, **also)
    kind = exu.OutputVariableType.Coordinates
    sensor = mbs.AddSensor(
        SensorNode(nodeNumber=items["nInterface"]["at"], outputVariableType=kind, storeInternal=True)
    )
    attach(mbs, items["nInterface"]["at"])
    solve(mbs, step)
    return mbs, body_histories(mbs, items), mbs.GetSensorStoredData(sensor)[:, 1:], items


def ball(mbs, node):
    """A ball welded to the frame."""
    inertia = RigidBodyInertia(MASS, INERTIA * np.eye(3))
    body = mbs.CreateRigidBody(
        referencePosition=list(PLACE),
        inertia=inertia,
        nodeType=exu.NodeType.RotationRxyz,
        initialDisplacement=START[:3],
    )
    mbs.SetNodeParameter(mbs.GetObject(body)["nodeNumber"], "initialCoordinates", START[:6])
    first = mbs.AddMarker(MarkerNodeRigid(nodeNumber=node))
    mbs.AddObject(GenericJoint(markerNumbers=[first, mbs.AddMarker(MarkerBodyRigid(bodyNumber=body))]))


@pytest.mark.parametrize("stiffness", [2e4, math.inf], ids=["compliant", "rigid"])
def test_a_ball_welded_to_a_rigid_interface_is_part_of_the_structure_in_impacts_too(stiffness):
    native = mp.simulate(model(stiffness, added=1.0), END, displacement=START)
    assert sum(event.kind == "close" for event in native.events) >= 3
    steps, errors = END / np.array([400, 1000, 2500, 5000]), []
    for step in steps:
        _, found, shown, _ = run(model(stiffness), step, ball, FRAME, displacement=START)
        exact = native.displacement(np.minimum(found.time, END))[:6].T
        assert np.max(np.abs(shown - np.array([found.points[f"d{i}"] for i in range(6)]).T)) < 1e-12 * SMALL
        errors.append(np.linalg.norm(shown - exact) / np.linalg.norm(exact))
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 1.5
    assert errors[-1] < 5e-5


def test_forces_and_torques_on_a_rigid_interface_are_those_of_the_structure():
    force, torque = SMALL * np.array([600.0, -300.0, 900.0]), SMALL * np.array([50.0, 80.0, -60.0])

    def push(mbs, node):
        marker = mbs.AddMarker(MarkerNodeRigid(nodeNumber=node))
        mbs.AddLoad(Force(markerNumber=marker, loadVector=force))
        mbs.AddLoad(Torque(markerNumber=marker, loadVector=torque))

    mbs, found, _, items = run(model(2e4), 1e-3, push, FRAME, displacement=START)
    row = np.concatenate([force, torque, [0.0, 0.0]])
    native = mp.simulate(model(2e4), END, displacement=START, loads=[mp.ConstantLoad(row, 1.0)])
    assert len(found.events) == len(native.events) > 0
    for i in range(8):
        expected = native.at(f"d{i}", np.minimum(found.time, END))
        assert np.max(np.abs(found.points[f"d{i}"] - expected)) < 1e-5 * SMALL
    felt = mbs.GetSensorStoredData(items["sInterface"]["at"])[1:, 1:]
    assert np.mean(felt, axis=0) == pytest.approx(row[:6], rel=1e-4)


@pytest.mark.parametrize(
    ("interface", "kind"),
    [
        (PositionInterface(PLACE[:2], ["d0", None]), NodePoint2D),
        (PositionInterface(PLACE, MOVED), NodePoint),
        (RigidInterface(PLACE[:2], ["d0", {"d1": 2.0}], ["d5"]), NodeRigidBody2D),
        (FRAME, NodeRigidBodyRxyz),
    ],
)
def test_an_interface_is_a_node_of_exudyn_where_it_was_placed(interface, kind):
    def look(mbs, node):
        marker = mbs.AddMarker(MarkerNodePosition(nodeNumber=node))
        mbs.AddLoad(Force(markerNumber=marker, loadVector=[0.0, SMALL, 0.0]))
        assert mbs.GetNode(node)["nodeType"] == dict(kind())["nodeType"]

    mbs, found, shown, items = run(model(2e4), 1e-3, look, interface, displacement=START)
    place = mbs.GetNodeOutput(items["nInterface"]["at"], exu.OutputVariableType.Position)
    moved = np.zeros(3)
    for i, at in enumerate(interface.displacements):
        row = {"d0": 1.0} if at == "d0" else {} if at is None else at if isinstance(at, dict) else {at: 1.0}
        moved[i] = sum(c * found.points[name][-1] for name, c in row.items())
    assert place == pytest.approx(np.append(interface.position, 0.0)[:3] + moved, abs=1e-12)
    assert shown.shape[1] == len(interface.displacements) + len(getattr(interface, "rotations", ()))


def test_a_rigid_interface_that_turns_far_warns():
    def turn(mbs, node):
        marker = mbs.AddMarker(MarkerNodeRigid(nodeNumber=node))
        mbs.AddLoad(Torque(markerNumber=marker, loadVector=[0.0, 0.0, 400.0]))

    open_stop = mp.MultiPhiModel(structure(), [mp.UnilateralContact("stop", "d6", 1.0, 1e4)], modes="all")
    with pytest.warns(mp.MultiPhiWarning, match=r"rigid interface 'at': turned by [\d.]+ degrees"):
        _, found, shown, _ = run(open_stop, 1e-3, turn, FRAME)
    largest = math.degrees(np.max(np.linalg.norm(shown[:, 3:], axis=1)))
    assert largest > 5
    assert any(f"turned by {largest:.3g} degrees" in sentence for sentence in found.warnings)


@pytest.mark.parametrize(
    ("interface", "said"),
    [
        (PositionInterface((0.0,), ["d0"]), "position"),
        (PositionInterface((0.0, math.nan), ["d0", "d1"]), "position"),
        (PositionInterface("there", ["d0", "d1"]), "position"),
        (PositionInterface(PLACE, ["d0", "d1"]), "displacements: got 2 entries, need 3"),
        (PositionInterface(PLACE, "d0"), "displacements: got 'd0'"),
        (PositionInterface(PLACE, [None, None, None]), "rows of zeros"),
        (PositionInterface(PLACE, ["d0", "d1", "up"]), "point: got 'up'"),
        (RigidInterface(PLACE, MOVED, ["d3"]), "rotations: got 1 entries, need 3"),
        (RigidInterface(PLACE[:2], MOVED[:2], TURNED), "rotations: got 3 entries, need 1"),
    ],
)
def test_a_wrong_interface_is_named(interface, said):
    container = exu.SystemContainer()
    with pytest.raises(mp.MultiPhiError, match=said):
        CreateMultiPhiBody(container.AddSystem(), model(), interface={"at": interface})
