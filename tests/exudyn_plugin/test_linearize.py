"""An Exudyn system and its linear structure hold the same matrices, points and contacts."""

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin import LinearizedStructure, linear_structure_from

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

MASSES = (2.0, 3.0, 5.0)
STIFFNESS = (700.0, 1100.0)  # ground - first, first - second
DAMPING = (3.0, 7.0)


class Chain:
    """Three masses in a row, the third tied to the second, a contact between the first two."""

    def __init__(self, load=0.0, **contact):
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        ground = mbs.AddNode(eii.NodePointGround())
        names = ("first", "second", "third")
        self.nodes = [mbs.AddNode(eii.Node1D(name=f"n-{name}", referenceCoordinates=[0.0])) for name in names]
        for node, mass in zip(self.nodes, MASSES, strict=True):
            mbs.AddObject(eii.ObjectMass1D(mass=mass, nodeNumber=node))
        self.ground = self.marker(ground, "ground")
        self.markers = [self.marker(node, name) for node, name in zip(self.nodes, names, strict=True)]
        for i, pair in enumerate(((self.ground, self.markers[0]), (self.markers[0], self.markers[1]))):
            spring = {"stiffness": STIFFNESS[i], "damping": DAMPING[i]}
            mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=list(pair), **spring))
        mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=self.markers[1:]))
        data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
        law = {"contactStiffness": 1e5, "offset": -0.02} | contact
        self.contact = mbs.AddObject(
            eii.ObjectContactCoordinate(name="stop", markerNumbers=self.markers[:2], nodeNumber=data, **law)
        )
        mbs.AddLoad(eii.LoadCoordinate(markerNumber=self.markers[2], load=load))
        self.sensor = mbs.AddSensor(
            eii.SensorNode(
                nodeNumber=self.nodes[0],
                outputVariableType=exu.OutputVariableType.Coordinates,
                storeInternal=True,
            )
        )
        mbs.Assemble()

    def marker(self, node, name):
        return self.mbs.AddMarker(eii.MarkerNodeCoordinate(name=name, nodeNumber=node, coordinate=0))

    def solve_static(self):
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        settings.solution.sensors.active = False
        self.mbs.SolveStatic(settings)

    @property
    def active(self):
        return self.mbs.GetObjectParameter(self.contact, "activeConnector")


def in_two_coordinates(matrix):
    """A matrix of the chain with x3 = x2, (2, 2)."""
    tie = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    return tie.T @ matrix @ tie


def exact(values):
    a, b = values
    return np.array([[a + b, -b, 0.0], [-b, b, 0.0], [0.0, 0.0, 0.0]])


def test_chain_has_the_matrices_of_the_chain():
    structure, _ = linear_structure_from(Chain().mbs)
    assert isinstance(structure, LinearizedStructure)
    assert structure.n == 2
    basis = structure.coordinates
    np.testing.assert_allclose(basis.T @ basis, np.eye(2), atol=1e-14)
    np.testing.assert_allclose(basis[1], basis[2], atol=1e-14)  # the constraint
    np.testing.assert_allclose(structure.mass, basis.T @ np.diag(MASSES) @ basis, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(structure.stiffness, basis.T @ exact(STIFFNESS) @ basis, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(structure.damping, basis.T @ exact(DAMPING) @ basis, rtol=1e-9, atol=1e-9)


def test_chain_has_the_frequencies_of_the_reduced_chain():
    structure, _ = linear_structure_from(Chain().mbs)
    squared = np.linalg.eigvals(np.linalg.solve(structure.mass, structure.stiffness))
    mass, stiffness = in_two_coordinates(np.diag(MASSES)), in_two_coordinates(exact(STIFFNESS))
    expected = np.linalg.eigvals(np.linalg.solve(mass, stiffness))
    np.testing.assert_allclose(np.sort(squared), np.sort(expected), rtol=1e-9)


def test_contact_comes_back_with_row_gap_and_stiffness():
    structure, contacts = linear_structure_from(Chain().mbs)
    (contact,) = contacts
    assert (contact.name, contact.stiffness) == ("stop", 1e5)
    assert contact.gap == pytest.approx(0.02, abs=1e-15)
    np.testing.assert_allclose(contact.direction, structure.row({"second": 1.0, "first": -1.0}), atol=1e-15)


def test_gap_is_measured_where_the_system_stands():
    chain = Chain(load=6.0)
    chain.solve_static()
    structure, (contact,) = linear_structure_from(chain.mbs)
    assert contact.gap == pytest.approx(0.02 + 6.0 / STIFFNESS[1], rel=1e-9)
    np.testing.assert_allclose(
        structure.stiffness, structure.coordinates.T @ exact(STIFFNESS) @ structure.coordinates, rtol=1e-8
    )


def test_a_contact_whose_data_node_says_closed_is_no_part_of_the_stiffness():
    chain = Chain()
    closed = chain.mbs.systemData.GetSystemState()
    closed[4] = np.array([-1.0])
    chain.mbs.systemData.SetSystemState(closed)
    structure, _ = linear_structure_from(chain.mbs)
    reference, _ = linear_structure_from(Chain().mbs)
    np.testing.assert_allclose(structure.stiffness, reference.stiffness, rtol=1e-12)


def test_the_system_is_left_as_it_was():
    chain = Chain(load=6.0)
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    chain.mbs.SolveDynamic(settings)
    stored = np.array(chain.mbs.GetSensorStoredData(chain.sensor))
    chain.solve_static()
    data, initial = chain.mbs.systemData, exu.ConfigurationType.Initial
    before = [np.concatenate(data.GetSystemState(c)) for c in (initial, exu.ConfigurationType.Current)]
    time = data.GetTime()
    linear_structure_from(chain.mbs)
    after = [np.concatenate(data.GetSystemState(c)) for c in (initial, exu.ConfigurationType.Current)]
    np.testing.assert_array_equal(after, before)
    assert data.GetTime() == time
    assert chain.active is True
    np.testing.assert_array_equal(chain.mbs.GetSensorStoredData(chain.sensor), stored)


def test_contacts_are_switched_on_again_after_an_error(monkeypatch):
    chain = Chain()
    seen = []

    def fail(*_, **__):
        seen.append(chain.active)
        raise ZeroDivisionError

    monkeypatch.setattr(exu.MainSystem, "ComputeLinearizedSystem", fail)
    with pytest.raises(ZeroDivisionError):
        linear_structure_from(chain.mbs)
    assert seen == [False]
    assert chain.active is True


def test_an_inactive_contact_stays_inactive_and_is_left_out():
    chain = Chain()
    chain.mbs.SetObjectParameter(chain.contact, "activeConnector", False)
    _, contacts = linear_structure_from(chain.mbs)
    assert contacts == ()
    assert chain.active is False


def test_a_nonlinear_spring_enters_by_its_tangent_at_the_current_state():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground, node = mbs.AddNode(eii.NodePointGround()), mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0]))
    mbs.AddObject(eii.ObjectMass1D(mass=2.0, nodeNumber=node))
    markers = [mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=n, coordinate=0)) for n in (ground, node)]

    def cubic(mbs, t, item, u, v, k, d, offset):
        return k * u + 2e4 * u**3

    spring = {"stiffness": 300.0, "springForceUserFunction": cubic}
    mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=markers, **spring))
    mbs.AddLoad(eii.LoadCoordinate(markerNumber=markers[1], load=300 * 0.1 + 2e4 * 0.1**3))
    mbs.Assemble()
    mbs.systemData.SetODE2Coordinates([0.1])
    structure, _ = linear_structure_from(mbs)
    assert structure.stiffness[0, 0] == pytest.approx(300 + 3 * 2e4 * 0.1**2, rel=1e-5)
    np.testing.assert_array_equal(mbs.systemData.GetODE2Coordinates(), [0.1])


class TestPoints:
    def test_every_marker_and_node_coordinate_that_moves_is_named(self):
        structure, _ = linear_structure_from(Chain().mbs)
        assert set(structure.points) == {"first", "second", "third", "n-first.0", "n-second.0", "n-third.0"}
        np.testing.assert_array_equal(structure.row("third"), structure.coordinates[2])

    def test_given_points_are_markers_or_node_coordinates(self):
        chain = Chain()
        points = {"a": chain.markers[0], "b": (chain.nodes[1], 0)}
        structure, _ = linear_structure_from(chain.mbs, points)
        np.testing.assert_array_equal(structure.row("a"), structure.coordinates[0])
        np.testing.assert_array_equal(structure.row("b"), structure.coordinates[1])
        assert set(structure.points) == {"a", "b"}

    def test_a_marker_with_a_position_names_its_components(self):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        node = mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[1.0, 2.0, 0.0]))
        body = mbs.AddObject(eii.ObjectRigidBody2D(mass=2.0, inertia=0.1, nodeNumber=node))
        mbs.AddMarker(eii.MarkerBodyPosition(name="tip", bodyNumber=body, localPosition=[0.5, 0.2, 0.0]))
        mbs.Assemble()
        structure, _ = linear_structure_from(mbs)
        np.testing.assert_allclose(structure.row("tip.x"), [1.0, 0.0, -0.2], atol=1e-8)
        np.testing.assert_allclose(structure.row("tip.y"), [0.0, 1.0, 0.5], atol=1e-8)
        assert "tip.z" not in structure.points

    def test_a_name_that_comes_twice_is_an_error(self):
        chain = Chain()
        chain.marker(chain.nodes[1], "n-second.0")
        chain.mbs.Assemble()
        with pytest.raises(MultiPhiValueError, match=r"two markers or nodes .* 'n-second\.0'"):
            linear_structure_from(chain.mbs)

    @pytest.mark.parametrize(
        ("given", "error", "match"),
        [
            (99, MultiPhiValueError, "marker 99"),
            ((0, 99), MultiPhiValueError, "coordinate 99"),
            ("tip", MultiPhiTypeError, "'tip'"),
        ],
    )
    def test_what_is_no_point_is_named_in_the_error(self, given, error, match):
        with pytest.raises(error, match=match):
            linear_structure_from(Chain().mbs, {"p": given})


class TestWhatALinearStructureCannotHold:
    def test_a_state_out_of_balance(self):
        with pytest.raises(MultiPhiValueError, match="out of balance by 3 N"):
            linear_structure_from(Chain(load=6.0).mbs)  # the tied pair shares it

    def test_a_contact_closed_at_rest(self):
        chain = Chain(load=-300.0)
        chain.solve_static()
        with pytest.raises(MultiPhiValueError, match="open contacts"):
            linear_structure_from(chain.mbs)
        assert chain.active is True

    @pytest.mark.parametrize("law", [{"contactDamping": 2.0}, {"contactStiffnessExponent": 1.5}])
    def test_a_contact_that_is_no_linear_spring(self, law):
        with pytest.raises(MultiPhiValueError, match=f"'stop' {next(iter(law))}"):
            linear_structure_from(Chain(**law).mbs)

    def test_another_contact_object(self):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        markers = []
        for x in (0.0, 1.0):
            node = mbs.AddNode(eii.NodePoint(referenceCoordinates=[x, 0.0, 0.0]))
            mbs.AddObject(eii.ObjectMassPoint(mass=1.0, nodeNumber=node))
            markers.append(mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=node)))
        data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=4 * [0.0], numberOfDataCoordinates=4))
        mbs.AddObject(
            eii.ObjectContactSphereSphere(
                name="balls",
                markerNumbers=markers,
                nodeNumber=data,
                spheresRadii=[0.1, 0.1],
                contactStiffness=1e3,
            )
        )
        mbs.Assemble()
        with pytest.raises(MultiPhiValueError, match=r"'balls': got ObjectContactSphereSphere"):
            linear_structure_from(mbs)

    def test_a_system_that_is_not_assembled(self):
        with pytest.raises(MultiPhiValueError, match="not assembled"):
            linear_structure_from(exu.SystemContainer().AddSystem())

    def test_a_follower_force(self):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        node = mbs.AddNode(eii.NodePoint2D(referenceCoordinates=[0.0, 0.0]))
        mbs.AddObject(eii.ObjectMassPoint2D(mass=1.0, nodeNumber=node))
        circulatory = np.array([[1.0, 0.5], [-0.5, 1.0]])
        mbs.AddObject(eii.ObjectGenericODE2(nodeNumbers=[node], stiffnessMatrix=circulatory))
        mbs.Assemble()
        with pytest.raises(MultiPhiValueError, match="stiffness matrix is not symmetric"):
            linear_structure_from(mbs)
