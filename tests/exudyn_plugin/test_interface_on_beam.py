"""A block on a joint at the tip of a reduced beam moves as on the full nonlinear beam, in the plane."""

import math

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import (
    CreateMultiPhiBody,
    PositionInterface,
    RigidInterface,
    body_histories,
    linear_structure_from,
)
from reference_models.beam_system import build_beam_system
from reference_models.beams import as_beams
from reference_models.full_beam_settings import FullBeamSettings
from reference_models.point_contact import point_contacts
from reference_models.rig import rig_beam
from reference_models.solver_settings import simulation_settings

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

END, STEP, SAMPLES = 0.1, 2e-5, 1e-3  # s
TIP, AT = "node3", "node2"
STOP = mp.UnilateralContact("stop", AT, 3e-6, 1e5)  # m, N/m
DAMPING = mp.RayleighDamping(0.5, 1e-5)
MASS, SIDE, TURNED = 0.02, 0.03, 0.8  # kg, m, rad: of a block that hangs out to the side


def block(mbs, node, rigid):
    """A block on a joint, with a torsional spring on the angle between both where the node has one."""
    place = mbs.GetNode(node)["referenceCoordinates"]
    centre = [place[0] + SIDE * math.cos(TURNED), place[1] - SIDE * math.sin(TURNED)]
    own = mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[*centre, -TURNED]))
    body = mbs.AddObject(eii.ObjectRigidBody2D(mass=MASS, inertia=MASS * SIDE**2 / 3, nodeNumber=own))
    middle = mbs.AddMarker(eii.MarkerBodyMass(bodyNumber=body))
    mbs.AddLoad(eii.LoadMassProportional(markerNumber=middle, loadVector=[0.0, -1.0, 0.0]))
    end = mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body, localPosition=[-SIDE, 0.0, 0.0]))
    tip = mbs.AddMarker((eii.MarkerNodeRigid if rigid else eii.MarkerNodePosition)(nodeNumber=node))
    mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=[tip, end]))
    if rigid:
        twist = {"stiffness": 0.05, "damping": 1e-4, "offset": -TURNED}
        mbs.AddObject(eii.ObjectConnectorTorsionalSpringDamper(markerNumbers=[tip, end], **twist))


def beam_system(damping=None):
    beams = as_beams(rig_beam())
    settings = FullBeamSettings(kind="geometrically-exact", elements=6, step=STEP)
    return build_beam_system(beams, settings, point_contacts(beams, [STOP]), damping)


def structure():
    system = beam_system()
    nodes = {point: system.nodes[system.points[point]] for point in (TIP, AT)}
    points = {AT: (nodes[AT], 1), "x": (nodes[TIP], 0), "y": (nodes[TIP], 1), "phi": (nodes[TIP], 2)}
    place = system.mbs.GetNode(nodes[TIP])["referenceCoordinates"][:2]
    return linear_structure_from(system.mbs, points, DAMPING)[0], place


def solve(mbs):
    mbs.Assemble()
    settings = simulation_settings(FullBeamSettings(step=STEP, newton_tolerance=1e-6), END)
    settings.solution.sensors.writePeriod = SAMPLES
    mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)


def full(linear, rigid):
    proportional = DAMPING.alpha * linear.mass + DAMPING.beta * linear.stiffness
    system = beam_system(linear.coordinates @ proportional @ linear.coordinates.T)
    node, kind = system.nodes[system.points[TIP]], exu.OutputVariableType.Coordinates
    block(system.mbs, node, rigid)
    sensor = system.mbs.AddSensor(eii.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))
    solve(system.mbs)
    return system.mbs.GetSensorStoredData(sensor)[:, 2]


@pytest.mark.parametrize("rigid", [False, True], ids=["position", "rigid"])
def test_a_block_on_a_joint_moves_the_reduced_beam_as_the_full_one(rigid):
    linear, place = structure()
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    moved = ["x", "y"]
    tip = RigidInterface(place, moved, ["phi"]) if rigid else PositionInterface(place, moved)
    items = CreateMultiPhiBody(mbs, mp.MultiPhiModel(linear, [STOP], modes="all"), interface={"tip": tip})
    block(mbs, items["nInterface"]["tip"], rigid)
    solve(mbs)
    found, theirs = body_histories(mbs, items), full(linear, rigid)
    assert len(found.events) >= 1
    assert np.linalg.norm(found.points["y"] - theirs) < 1e-3 * np.linalg.norm(theirs)
