"""Contacts of spheres in reduce: taken in their present direction, and told where the motion turns that direction."""

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest
from test_reduce_limits import off, simulated

from multiphi_exudyn.exudyn_plugin import reduce
from reference_models.published_systems import PublishedSystem

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

RADIUS, GAP, END = 0.1, 1e-3, 0.2  # m, m, s


class Ball:
    """A ball of 1 kg on three springs, 1 mm above something, struck downwards and sideways."""

    def __init__(self, below, speeds=(0.0, 0.0, -0.3), **law):
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        ground = mbs.AddObject(eii.ObjectGround())
        node = mbs.AddNode(
            eii.NodeRigidBodyRxyz(
                name="n",
                referenceCoordinates=[0.0, 0.0, RADIUS + GAP, 0.0, 0.0, 0.0],
                initialVelocities=[*speeds, 0.0, 0.0, 0.0],
            )
        )
        inertia = 0.4 * RADIUS**2
        body = mbs.AddObject(
            eii.ObjectRigidBody(mass=1.0, inertia=[inertia] * 3 + [0.0] * 3, nodeNumber=node, name="ball")
        )
        centre = mbs.AddMarker(eii.MarkerBodyRigid(name="centre", bodyNumber=body))
        mbs.AddMarker(eii.MarkerNodeCoordinate(name="m1", nodeNumber=node, coordinate=2))
        origin = mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=ground, localPosition=[0.0, 0.0, RADIUS + GAP]))
        stiffness = np.diag([1e3] * 3 + [10.0] * 3)
        mbs.AddObject(eii.ObjectConnectorRigidBodySpringDamper(markerNumbers=[origin, centre], stiffness=stiffness))
        data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[GAP, 0, 0, 0], numberOfDataCoordinates=4))
        given = {"name": "touch", "nodeNumber": data, "contactStiffness": 1e5, **law}
        below(mbs, ground, centre, given)
        mbs.Assemble()
        self.reduction = reduce(mbs)
        self.trajectory = simulated(self.reduction, END)

    def off(self):
        return off(self, self.reduction, self.trajectory, END, 2e-5)


def sphere(mbs, ground, ball, given):
    below = mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=ground, localPosition=[0.0, 0.0, -RADIUS]))
    mbs.AddObject(eii.ObjectContactSphereSphere(markerNumbers=[below, ball], spheresRadii=[RADIUS] * 2, **given))


def triangle(mbs, ground, ball, given):
    corners = exu.Vector3DList([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    plane = mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=ground))
    mbs.AddObject(
        eii.ObjectContactSphereTriangle(
            markerNumbers=[ball, plane], sphereRadius=RADIUS, trianglePoints=corners, **given
        )
    )


@pytest.mark.parametrize("below", [sphere, triangle])
def test_a_ball_that_strikes_straight_moves_as_in_exudyn(below):
    system = Ball(below)
    (contact,) = system.reduction.model.contacts
    assert (contact.name, contact.stiffness) == ("touch", 1e5)
    assert contact.gap == pytest.approx(GAP, rel=1e-9)
    assert system.reduction.taken[-1].became == "contact, 100000 N/m, in its present direction"
    assert len(system.trajectory.events) == 4
    assert system.trajectory.warnings == ()
    assert system.off() < 1e-3


def test_a_ball_that_moves_sideways_over_a_plane_is_in_the_linear_range():
    system = Ball(triangle, speeds=(2.0, 0.0, -0.3))
    assert system.trajectory.warnings == ()
    assert system.off() < 1e-3


def test_a_ball_that_strikes_another_beside_its_top_is_told_to_leave_the_linear_range():
    system = Ball(sphere, speeds=(2.0, 0.0, -0.3))
    assert np.max(system.trajectory.at("n.0", np.linspace(0, END, 200))) > 0.2 * RADIUS
    assert any(sentence.startswith("linear range") for sentence in system.trajectory.warnings)
    assert system.off() > 0.05


@pytest.mark.parametrize(
    ("law", "reason"),
    [
        ({"dynamicFriction": 0.2}, "friction coefficient 0.2, need 0"),
        ({"contactStiffnessExponent": 1.5}, "stiffness exponent 1.5, need 1"),
        ({"impactModel": 1, "restitutionCoefficient": 0.7}, "impact model 1, need 0"),
        ({"contactPlasticityRatio": 0.3}, "plasticity ratio 0.3, need 0"),
    ],
)
def test_what_is_no_linear_spring_is_left_out_by_name(law, reason):
    system = Ball(sphere, **law)
    ((item, said),) = system.reduction.left_out
    assert (item.name, said) == ("touch", reason)
    assert system.reduction.model.contacts == ()


def driven(mbs, t, index, q, q_t):
    return [3.0 * np.sin(40.0 * t), -20.0 * q[1], 0.0]


def test_a_force_of_a_generic_object_that_changes_with_time_moves_the_model_as_it_does_the_system():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(eii.NodePoint(name="n", initialCoordinates=[0.01, 0.02, 0.0]))
    mbs.AddObject(
        eii.ObjectGenericODE2(
            name="block",
            nodeNumbers=[node],
            massMatrix=np.eye(3),
            stiffnessMatrix=np.diag([400.0, 900.0, 2500.0]),
            forceUserFunction=driven,
        )
    )
    mbs.AddMarker(eii.MarkerNodeCoordinate(name="m1", nodeNumber=node, coordinate=0))
    mbs.Assemble()
    reduction = reduce(mbs)
    trajectory = simulated(reduction)
    (taken,) = reduction.taken
    assert taken.became == "its user function linearised at the current state; how its force changes with time"
    assert len(reduction.loads) == 2  # what is out of balance, and the one component that changes
    assert trajectory.warnings == ()
    assert off(PublishedSystem(container, mbs, "m1", 0.5, 1e-4), reduction, trajectory) < 1e-3
