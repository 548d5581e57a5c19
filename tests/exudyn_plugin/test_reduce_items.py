"""What reduce makes of joints, turning bodies, user functions, many contacts; and its result among other bodies."""

import itertools

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories, linear_structure_from, reduce
from reference_models.published_systems import OwnRun, PublishedSystem, cable_on_nodal_stops

GRAVITY = 9.81  # m/s^2


@pytest.fixture(autouse=True)
def _quiet():
    exu.config.printToConsole = False
    yield
    exu.config.printToConsole = True


class System:
    """An empty system with markers on ground: one of a coordinate, one of a body."""

    def __init__(self):
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.ground = coordinate(self.mbs, self.mbs.AddNode(eii.NodePointGround()), 0, "ground")
        self.body = self.mbs.AddMarker(
            eii.MarkerBodyRigid(name="origin", bodyNumber=self.mbs.AddObject(eii.ObjectGround()))
        )

    def mass(self, name, mass=1.0, velocity=0.0, displacement=0.0):
        """A mass of one coordinate, its marker of that name."""
        return add_mass(self.mbs, name, mass, velocity, displacement)

    def contact(self, name, markers, gap, stiffness=1e4, damping=0.0):
        data = self.mbs.AddNode(eii.NodeGenericData(initialCoordinates=[gap], numberOfDataCoordinates=1))
        law = {"contactStiffness": stiffness, "contactDamping": damping, "offset": -gap}
        self.mbs.AddObject(eii.ObjectContactCoordinate(name=name, markerNumbers=markers, nodeNumber=data, **law))

    def moved(self, point, end, step=2e-5):
        """Reduction, largest distance of its motion from Exudyn's own at a point, largest motion."""
        reduction = reduce(self.mbs)
        trajectory = mp.simulate(reduction.model, end, velocity=reduction.velocity, loads=reduction.loads)
        own = OwnRun.of(PublishedSystem(self.container, self.mbs, point, end, step))
        theirs = own.of_row(reduction.structure.coordinates @ reduction.structure.row(point))
        found = trajectory.at(point, np.minimum(own.time, end))
        return reduction, trajectory, np.max(np.abs(found - theirs)), np.max(np.abs(theirs))


def coordinate(mbs, node, component, name=""):
    return mbs.AddMarker(eii.MarkerNodeCoordinate(name=name, nodeNumber=node, coordinate=component))


def add_mass(mbs, name, mass=1.0, velocity=0.0, displacement=0.0):
    start = {"initialCoordinates": [displacement], "initialVelocities": [velocity]}
    node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], **start))
    mbs.AddObject(eii.ObjectMass1D(name=f"mass {name}", mass=mass, nodeNumber=node))
    return coordinate(mbs, node, 0, name)


def spring(mbs, first, second, stiffness, damping=0.0, **given):
    ends = [first, second]
    mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=ends, stiffness=stiffness, damping=damping, **given))


def left_out(reduction):
    return {item.name: reason for item, reason in reduction.left_out}


def squares(structure):
    return np.sort(np.linalg.eigvals(np.linalg.solve(structure.mass, structure.stiffness)).real)


# ---------------------------------------------------------------------- joints, weights, rotation


def bar(system):
    """2 kg over 1 m, hung at its end by a joint in the plane."""
    node = system.mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[0.0, -0.5, 0.0]))
    body = system.mbs.AddObject(eii.ObjectRigidBody2D(mass=2.0, inertia=2 / 12, nodeNumber=node))
    end = system.mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body, localPosition=[0.0, 0.5, 0.0]))
    system.mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=[system.body, end]))
    return body, [GRAVITY * 0.5 / (1 / 12 + 1 / 4)]


def bob(system):
    """2 kg on a massless rod of 1 m."""
    node = system.mbs.AddNode(eii.NodePoint2D(referenceCoordinates=[0.0, -1.0]))
    body = system.mbs.AddObject(eii.ObjectMassPoint2D(mass=2.0, nodeNumber=node))
    ends = [system.body, system.mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body))]
    system.mbs.AddObject(eii.ObjectConnectorDistance(markerNumbers=ends, distance=1.0))
    return body, [GRAVITY]


def bar_in_space(system):
    """The bar with Euler parameters and a joint that lets it turn about one axis."""
    node = system.mbs.AddNode(eii.NodeRigidBodyEP(referenceCoordinates=[0.0, -0.5, 0.0, 1.0, 0.0, 0.0, 0.0]))
    inertia = [2 / 12, 1e-3, 2 / 12, 0.0, 0.0, 0.0]
    body = system.mbs.AddObject(eii.ObjectRigidBody(mass=2.0, inertia=inertia, nodeNumber=node))
    end = system.mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body, localPosition=[0.0, 0.5, 0.0]))
    axes = [1, 1, 1, 1, 1, 0]
    system.mbs.AddObject(eii.ObjectJointGeneric(markerNumbers=[system.body, end], constrainedAxes=axes))
    return body, [GRAVITY * 0.5 / (1 / 12 + 1 / 4)]


@pytest.mark.parametrize("hang", [bar, bob, bar_in_space])
def test_a_hanging_pendulum_swings_with_its_frequency(hang):
    system = System()
    body, expected = hang(system)
    weight = system.mbs.AddMarker(eii.MarkerBodyMass(bodyNumber=body))
    system.mbs.AddLoad(eii.LoadMassProportional(markerNumber=weight, loadVector=[0.0, -GRAVITY, 0.0]))
    system.mbs.Assemble()
    assert squares(reduce(system.mbs).structure) == pytest.approx(expected, rel=1e-7)
    structure, _ = linear_structure_from(system.mbs)
    assert squares(structure) == pytest.approx(expected, rel=1e-7)


def test_a_force_beside_the_centre_of_a_turning_body_gives_its_stiffness_unless_it_turns_with_the_body():
    for fixed, lever in ((False, 0.3), (True, 0.0)):
        system = System()
        node = system.mbs.AddNode(eii.NodeRigidBodyEP(referenceCoordinates=[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]))
        body = system.mbs.AddObject(eii.ObjectRigidBody(mass=2.0, inertia=[0.5] * 3 + [0.0] * 3, nodeNumber=node))
        centre = system.mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body))
        rim = system.mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body, localPosition=[0.0, -0.3, 0.0]))
        ends = [system.body, centre]
        system.mbs.AddObject(eii.ObjectJointSpherical(markerNumbers=ends))
        turning = np.diag([0.0, 0.0, 0.0, 1.0, 2.0, 3.0])
        system.mbs.AddObject(eii.ObjectConnectorRigidBodySpringDamper(markerNumbers=ends, stiffness=turning))
        force = {"loadVector": [0.0, -10.0, 0.0], "bodyFixed": fixed}
        system.mbs.AddLoad(eii.LoadForceVector(name="force", markerNumber=rim, **force))
        system.mbs.Assemble()
        reduction = reduce(system.mbs)
        expected = sorted(np.array([1.0 + 10 * lever, 2.0, 3.0 + 10 * lever]) / 0.5)
        assert squares(reduction.structure) == pytest.approx(expected, rel=1e-6)
        assert ("'force': constant load in its present direction" in reduction.report) == fixed
        assert system.mbs.GetLoad(exu.LoadIndex(0))["loadVector"].tolist() == [0.0, -10.0, 0.0]


def test_a_load_that_turns_with_a_body_on_springs_is_taken_in_its_present_direction():
    system = System()
    node = system.mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[0.0, 0.0, 0.0]))
    body = system.mbs.AddObject(eii.ObjectRigidBody2D(mass=1.0, inertia=0.5, nodeNumber=node))
    centre = system.mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=body))
    system.mbs.AddObject(
        eii.ObjectConnectorRigidBodySpringDamper(
            markerNumbers=[system.body, centre], stiffness=np.diag([100.0, 200.0, 0.0, 0.0, 0.0, 5.0])
        )
    )
    system.mbs.AddLoad(eii.LoadForceVector(name="jet", markerNumber=centre, loadVector=[0.0, 7.0, 0.0], bodyFixed=True))
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    assert squares(reduction.structure) == pytest.approx([10.0, 100.0, 200.0], rel=1e-6)
    assert "'jet': constant load in its present direction" in reduction.report


def test_a_pendulum_that_strikes_a_stop_moves_as_in_exudyn():
    system = System()
    body, _ = bar(system)
    weight = system.mbs.AddMarker(eii.MarkerBodyMass(bodyNumber=body))
    system.mbs.AddLoad(eii.LoadMassProportional(markerNumber=weight, loadVector=[0.0, -GRAVITY, 0.0]))
    centre = coordinate(system.mbs, exu.NodeIndex(1), 0, "centre")
    system.mbs.AddLoad(eii.LoadCoordinate(name="push", markerNumber=centre, load=-0.01))
    system.contact("stop", [system.ground, centre], 3e-4)
    system.mbs.Assemble()
    reduction, trajectory, off, most = system.moved("centre", 2.0, 1e-4)
    assert len(trajectory.contact_intervals("stop")) >= 2
    assert off < 1e-3 * most
    assert left_out(reduction) == {}


def test_a_body_that_turns_on_two_springs_and_strikes_beside_its_centre_moves_as_in_exudyn():
    system = System()
    node = system.mbs.AddNode(
        eii.NodeRigidBody2D(referenceCoordinates=[0.0, 0.0, 0.0], initialVelocities=[0.0, -1e-2, 2e-2])
    )
    body = system.mbs.AddObject(eii.ObjectRigidBody2D(mass=1.0, inertia=0.1, nodeNumber=node))
    for x in (-0.4, 0.3):
        low = system.mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=0, localPosition=[x, -1.0, 0.0]))
        high = system.mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body, localPosition=[x, 0.0, 0.0]))
        law = {"stiffness": [100.0, 400.0, 0.0], "offset": [0.0, 1.0, 0.0]}
        system.mbs.AddObject(eii.ObjectConnectorCartesianSpringDamper(markerNumbers=[low, high], **law))
    turned = coordinate(system.mbs, node, 2, "turned")
    system.contact("stop", [turned, system.ground], 5e-4, stiffness=1e3)
    system.mbs.Assemble()
    reduction, trajectory, off, most = system.moved("turned", 0.5)
    assert reduction.structure.n == 3
    assert len(trajectory.contact_intervals("stop")) >= 2
    assert off < 2e-3 * most


# ---------------------------------------------------------------------- contacts, functions, ground


def test_several_contacts_with_their_own_offsets_move_as_in_exudyn_and_one_between_grounds_is_left_out():
    system = System()
    a, b = system.mass("a", velocity=1.0), system.mass("b", velocity=-0.5)
    for marker in (a, b):
        spring(system.mbs, system.ground, marker, 200.0, 0.2)
    system.contact("floor", [system.ground, a], 0.02)
    system.contact("ceiling", [a, system.ground], 0.03, stiffness=2e4)
    system.contact("between", [a, b], 0.015, stiffness=5e3)
    system.contact("nowhere", [system.ground, system.ground], 1.0)
    system.mbs.Assemble()
    reduction, trajectory, off, _ = system.moved("b", 0.5)
    assert left_out(reduction) == {"nowhere": "constraints hold its gap"}
    assert [c.gap for c in reduction.model.contacts] == pytest.approx([0.02, 0.03, 0.015])
    assert {event.contact for event in trajectory.events} == {"floor", "ceiling", "between"}
    assert off < 1e-6


def test_each_contact_keeps_its_own_damper_and_points_on_ground_are_none():
    system = System()
    a = system.mass("a")
    for k, damping in enumerate((0.0, 5.0, 20.0)):
        system.contact(f"stop{k}", [system.ground, a], 0.01 * (k + 1), stiffness=1e4 * (k + 1), damping=damping)
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    laws = [(c.name, c.gap, c.stiffness, c.damping) for c in reduction.model.contacts]
    assert laws == [("stop0", 0.01, 1e4, 0.0), ("stop1", 0.02, 2e4, 5.0), ("stop2", 0.03, 3e4, 20.0)]
    assert set(reduction.structure.points) == {"a", "node1.0"}
    assert "5 N s/m, which never pulls" in reduction.report


def test_a_spring_by_a_user_function_has_its_tangent_where_the_system_stands_and_is_told():
    system = System()
    a = system.mass("a", displacement=0.2)

    def cubic(mbs, t, item, u, v, stiffness, *_):
        return stiffness * (u + 50 * u**3)

    spring(system.mbs, system.ground, a, 100.0, name="cubic", springForceUserFunction=cubic)
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    assert reduction.structure.stiffness == pytest.approx(np.array([[100 * (1 + 150 * 0.2**2)]]), rel=1e-5)
    (load,) = reduction.loads
    assert load.force * load.at == pytest.approx([-100 * (0.2 + 50 * 0.2**3)])
    assert left_out(reduction) == {"cubic": "the difference of its user function from its tangent at the current state"}


def test_what_works_in_one_direction_only_and_functions_of_the_system_are_told():
    system = System()
    node = system.mbs.AddNode(eii.NodeRigidBodyEP(referenceCoordinates=[0.0, 0.0, 0.1, 1.0, 0.0, 0.0, 0.0]))
    wheel = system.mbs.AddObject(eii.ObjectRigidBody(mass=1.0, inertia=[0.1] * 3 + [0.0] * 3, nodeNumber=node))
    ends = [system.body, system.mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=wheel))]
    data = system.mbs.AddNode(eii.NodeGenericData(initialCoordinates=[0.0] * 3, numberOfDataCoordinates=3))
    rolling = {"discRadius": 0.1, "contactStiffness": 1e4, "dryFriction": [0.5, 0.5]}
    system.mbs.AddObject(
        eii.ObjectConnectorRollingDiscPenalty(name="wheel", markerNumbers=ends, nodeNumber=data, **rolling)
    )
    system.mbs.SetPreStepUserFunction(lambda mbs, t: True)
    system.mbs.Assemble()
    assert left_out(reduce(system.mbs)) == {
        "wheel": "its contact and its friction away from the current state",
        "mbs": "what it does in a run",
    }


# ---------------------------------------------------------------------- among other bodies


def add_pair(mbs):
    """Two masses that can strike each other; the markers of both."""
    ground = coordinate(mbs, mbs.AddNode(eii.NodePointGround()), 0)
    first, second = add_mass(mbs, "first", 0.01, velocity=0.01), add_mass(mbs, "second", 0.02)
    for marker in (first, second):
        spring(mbs, ground, marker, 5.0)
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[1e-4], numberOfDataCoordinates=1))
    law = {"contactStiffness": 1e3, "offset": -1e-4}
    mbs.AddObject(eii.ObjectContactCoordinate(name="clap", markerNumbers=[first, second], nodeNumber=data, **law))
    return first


def attach(mbs, tip, first):
    """A mass between the tip of the cable and the first of the pair."""
    middle = add_mass(mbs, "middle", 0.002)
    spring(mbs, tip, middle, 3.0, 0.002)
    spring(mbs, middle, first, 3.0, 0.002)


def test_two_reductions_put_back_into_one_system_with_another_mass_move_as_all_of_it_does_in_exudyn():
    whole = cable_on_nodal_stops()
    attach(whole.mbs, whole.mbs.GetMarkerNumber("tip"), add_pair(whole.mbs))
    whole.mbs.Assemble()
    own = OwnRun.of(whole)

    pair = System()
    add_pair(pair.mbs)
    pair.mbs.Assemble()
    container, markers, bodies, step = exu.SystemContainer(), [], [], 1e-4
    mbs = container.AddSystem()
    for of, at in ((cable_on_nodal_stops().mbs, "tip"), (pair.mbs, "first")):
        red = reduce(of, modes="all" if at == "first" else 16)
        items = CreateMultiPhiBody(
            mbs, red.model, at, velocity=red.velocity, loads=red.loads, interface=[at], matchedStepSize=step
        )
        markers.append(coordinate(mbs, items["nInterface"][at], 0))
        bodies.append((items, at))
    attach(mbs, *markers)
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = whole.end, round(whole.end / step)
    assert mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    for items, at in bodies:
        found = body_histories(mbs, items)
        first = whole.mbs.GetNodeODE2Index(whole.mbs.GetMarker(whole.mbs.GetMarkerNumber(at))["nodeNumber"])
        component = 1 if at == "tip" else 0
        theirs = np.interp(found.time, own.time, own.coordinates[:, first + component])
        assert len(found.events) >= 2
        assert np.max(np.abs(found.points[at] - theirs)) < 0.01 * np.max(np.abs(theirs))


def bob_on_a_link(direction, mass=2.0):
    """A mass on a link of 1 m in a direction from ground, with its weight."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = [
        mbs.AddNode(eii.NodePointGround()),
        mbs.AddNode(eii.NodePoint2D(name="bob", referenceCoordinates=list(direction))),
    ]
    mbs.AddObject(eii.ObjectMassPoint2D(name="ball", mass=mass, nodeNumber=nodes[1]))
    markers = [mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=node)) for node in nodes]
    mbs.AddObject(eii.ObjectConnectorDistance(markerNumbers=markers, distance=1.0))
    mbs.AddLoad(eii.LoadForceVector(markerNumber=markers[1], loadVector=[0.0, -9.81 * mass, 0.0]))
    mbs.Assemble()
    return container, mbs


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_horizontal_pendulum_has_no_stiffness_and_not_one_of_round_off(sign):
    _, mbs = bob_on_a_link([sign, 0.0])
    np.testing.assert_array_equal(reduce(mbs).structure.stiffness, [[0.0]])


def test_a_negative_stiffness_is_told_by_its_coordinate_and_body(refused):
    _, mbs = bob_on_a_link([0.0, 1.0])
    said = r"stiffness: got a negative eigenvalue (omega^2 = -9.81 1/s2), mainly of coordinate 0 of node 'bob' (Object"
    refused(ValueError, said, reduce, mbs)


def test_a_coordinate_without_mass_is_told(refused):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = [mbs.AddNode(eii.NodePoint2D(name=name)) for name in ("heavy", "empty")]
    for node, mass in zip(nodes, (1.0, 0.0), strict=True):
        mbs.AddObject(eii.ObjectMassPoint2D(mass=mass, nodeNumber=node))
    mbs.Assemble()
    refused(ValueError, "mass: got no mass at coordinate 0 of node 'empty' (ObjectMassPoint2D", reduce, mbs)


def slider_between_springs(mass, inner, outer):
    """1 kg on a spring to a slider, which another spring holds before a stop."""
    system = System()
    moved = system.mass("mass", 1.0, velocity=0.5)
    slider = system.mbs.AddNode(eii.Node1D(name="slider"))
    system.mbs.AddObject(eii.ObjectMass1D(mass=mass, nodeNumber=slider))
    ends = [system.ground, coordinate(system.mbs, slider, 0, "slider"), moved]
    for (first, second), stiffness in zip(itertools.pairwise(ends), (outer, inner), strict=True):
        system.mbs.AddObject(eii.CoordinateSpringDamper(markerNumbers=[first, second], stiffness=stiffness))
    system.contact("stop", ends[:2], 5e-4, stiffness=1e6)
    system.mbs.Assemble()
    return system


@pytest.mark.parametrize(("inner", "outer"), [(2e4, 4e4), (5e4, 1e4)])
def test_the_remedies_for_a_slider_without_mass_are_right(refused, inner, outer):
    """A small mass against a smaller one in Exudyn's own run, on its stop too; and the springs in series, condensed."""
    system = slider_between_springs(0.0, inner, outer)
    refused(ValueError, "mass: got no mass at coordinate 0 of node 'slider'", reduce, system.mbs)
    with pytest.raises(mp.MultiPhiValueError, match=r"by a small mass there .*condensed_structure\(M, K\)"):
        linear_structure_from(system.mbs)
    mass, stiffness = map(np.array, system.mbs.ComputeLinearizedSystem()[:2])
    condensed = mp.MultiPhiModel(mp.condensed_structure(mass, stiffness)).level(())
    assert condensed.omega == pytest.approx([np.sqrt(inner * outer / (inner + outer))], rel=1e-12)
    own = slider_between_springs(1e-9, inner, outer)
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = 0.05, 5000
    settings.timeIntegration.verboseMode = 0
    own.mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.GeneralizedAlpha)
    reduction = reduce(slider_between_springs(1e-6, inner, outer).mbs)
    run = mp.simulate(reduction.model, 0.05, velocity=reduction.velocity, loads=reduction.loads)
    assert run.events
    place, size = (
        reduction.displacement(run, 0.05)[0],
        np.max(np.abs(reduction.displacement(run, np.linspace(0, 0.05)))),
    )
    assert abs(place - own.mbs.systemData.GetODE2Coordinates()[0]) < 1e-4 * size


def test_an_asymmetric_matrix_is_told_by_its_coordinates(refused):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(eii.NodePoint2D(name="shaft"))
    mbs.AddObject(eii.ObjectMassPoint2D(name="disc", mass=1.0, nodeNumber=node))
    spin = np.array([[0.0, 3.0], [-3.0, 0.0]])
    mbs.AddObject(eii.ObjectGenericODE2(name="spin", nodeNumbers=[node], dampingMatrix=spin))
    mbs.Assemble()
    with pytest.raises(
        mp.MultiPhiValueError, match=r"coordinate 0 of node 'shaft' \(ObjectMassPoint2D 'disc', ObjectGen"
    ):
        reduce(mbs)
    refused(ValueError, "mbs: its damping matrix is not symmetric (follower or gyroscopic", reduce, mbs)
