"""A reduced Exudyn system moves as the system does, and says what it took and what it left out."""

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories, linearize, reduce
from reference_models.published_systems import OwnRun, PublishedSystem

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

STEP = 2e-5  # s, of Exudyn's own run


class Mass:
    """A mass point between markers of ground and of one of its coordinates."""

    def __init__(self, coordinate=0, mass=0.5, displacement=0.0, velocity=0.0, data=3):
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        ground, axis = mbs.AddNode(eii.NodePointGround()), np.eye(3)[coordinate]
        self.node = mbs.AddNode(
            eii.NodePoint(initialCoordinates=list(displacement * axis), initialVelocities=list(velocity * axis))
        )
        mbs.AddObject(eii.ObjectMassPoint(mass=mass, nodeNumber=self.node))
        pairs = ((ground, 0), (self.node, coordinate))
        self.markers = [
            mbs.AddMarker(eii.MarkerNodeCoordinate(name=f"m{i}", nodeNumber=n, coordinate=c))
            for i, (n, c) in enumerate(pairs)
        ]
        self.data = mbs.AddNode(
            eii.NodeGenericData(initialCoordinates=[1.0] + (data - 1) * [0.0], numberOfDataCoordinates=data)
        )

    def at(self, end, step=STEP):
        """Displacement of the mass at the end of Exudyn's own run."""
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = end, round(end / step)
        settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
        assert self.mbs.SolveDynamic(settings)
        return self.mbs.GetMarkerOutput(self.markers[1], exu.OutputVariableType.Coordinates)[0]


def bouncing_mass():
    """Exudyn's contactCoordinateTest by its parameters: a ball under gravity on a stiff damped contact."""
    spring = 2e6
    system = Mass(coordinate=1, mass=0.25, displacement=0.1, data=1)
    system.mbs.AddObject(
        eii.ObjectContactCoordinate(
            name="floor",
            markerNumbers=system.markers,
            nodeNumber=system.data,
            contactStiffness=spring,
            contactDamping=1e-4 * spring,
            offset=0.05,
        )
    )
    system.mbs.AddLoad(eii.LoadCoordinate(name="weight", markerNumber=system.markers[1], load=-0.25 * 9.81))
    system.mbs.Assemble()
    return system


def mass_between_limit_stops(damping=10.0, friction=0.0, **changed):
    """The third part of Exudyn's coordinateSpringDamperExt: a mass flies to and fro between two stops."""
    system = Mass(velocity=10.0)
    stops = {"limitStopsUpper": 0.95, "limitStopsLower": -0.95, "limitStopsStiffness": 1e4} | changed
    system.mbs.AddObject(
        eii.ObjectConnectorCoordinateSpringDamperExt(
            name="slide",
            markerNumbers=system.markers,
            nodeNumber=system.data,
            useLimitStops=True,
            limitStopsDamping=damping,
            dynamicFrictionForce=friction,
            stickingStiffness=1e4 * (friction > 0),
            **stops,
        )
    )
    system.mbs.Assemble()
    return system


def run(reduction, end):
    return mp.simulate(reduction.model, end, velocity=reduction.velocity, loads=reduction.loads)


@pytest.mark.parametrize("changed", [{}, {"offset": 0.1, "stiffness": 50.0, "factor1": 1.5, "limitStopsLower": -0.4}])
def test_undamped_limit_stops_move_as_in_exudyn(changed):
    system = mass_between_limit_stops(damping=0.0, **changed)
    reduction = reduce(system.mbs)
    trajectory = run(reduction, 0.5)
    assert {c.name for c in reduction.model.contacts} == {"slide.upper", "slide.lower"}
    assert len(trajectory.contact_intervals("slide.upper")) > 0
    assert len(trajectory.contact_intervals("slide.lower")) > 0
    assert trajectory.at("m1", 0.5) == pytest.approx(system.at(0.5), abs=2e-4)


def test_a_load_out_of_balance_is_a_constant_load_and_the_fall_to_the_floor_is_exact():
    system = bouncing_mass()
    reduction = reduce(system.mbs)
    trajectory = run(reduction, 0.09)
    assert trajectory.at("m1", 0.09) == pytest.approx(-9.81 * 0.09**2 / 2, rel=1e-9)
    first = run(reduction, 0.11).contact_intervals("floor")[0][0]
    assert first == pytest.approx(np.sqrt(2 * 0.05 / 9.81), rel=1e-9)


def test_the_report_names_what_was_taken_and_what_was_left_out():
    system = mass_between_limit_stops(friction=1.5)
    timed = eii.LoadCoordinate(
        name="timed",
        markerNumber=system.markers[1],
        load=3.0,
        loadUserFunction=lambda mbs, t, load: load * mbs.systemData.GetTime(),
    )
    system.mbs.AddLoad(timed)
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    assert [(item.name, reason) for item, reason in reduction.left_out] == [
        ("slide", "friction that slips already (data coordinate 0: 1), need a bristle that sticks: 0"),
        ("timed", "its user function depends on more than time (it reads mbs.systemData)"),
    ]
    assert reduction.loads == ()
    assert "contacts slide.upper, slide.lower, 10000 N/m and 10 N s/m" in reduction.report


@pytest.mark.parametrize("fails", [False, True])
def test_the_system_is_left_as_it_was(monkeypatch, fails):
    system = mass_between_limit_stops(friction=1.5)
    force = eii.LoadCoordinate(markerNumber=system.markers[1], load=3.0, loadUserFunction=lambda mbs, t, load: load * t)
    system.mbs.AddLoad(force)
    system.mbs.Assemble()
    before = repr([system.mbs.GetObject(1), system.mbs.GetLoad(0)]), system.mbs.systemData.GetSystemState()
    if fails:
        monkeypatch.setattr(exu.MainSystem, "ComputeLinearizedSystem", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            reduce(system.mbs)
    else:
        reduce(system.mbs)
    assert repr([system.mbs.GetObject(1), system.mbs.GetLoad(0)]) == before[0]
    np.testing.assert_array_equal(np.concatenate(system.mbs.systemData.GetSystemState()), np.concatenate(before[1]))


def test_a_contact_that_is_no_linear_spring_is_left_out_with_its_reason():
    system = Mass(velocity=1.0, data=1)
    system.mbs.AddObject(
        eii.ObjectContactCoordinate(
            name="hertz",
            markerNumbers=system.markers,
            nodeNumber=system.data,
            contactStiffness=1e5,
            contactStiffnessExponent=1.5,
            offset=-1.0,
        )
    )
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    ((item, reason),) = reduction.left_out
    assert (item.name, item.type, reason) == ("hertz", "ObjectContactCoordinate", "stiffness exponent 1.5, need 1")
    assert reduction.model.contacts == ()


def test_a_contact_of_spheres_is_taken_and_stays_active():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    nodes = [mbs.AddNode(eii.NodePoint(referenceCoordinates=[x, 0.0, 0.0])) for x in (0.0, 1.0)]
    for node in nodes:
        mbs.AddObject(eii.ObjectMassPoint(mass=1.0, nodeNumber=node))
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=4 * [0.0], numberOfDataCoordinates=4))
    balls = mbs.AddObject(
        eii.ObjectContactSphereSphere(
            name="balls",
            markerNumbers=[mbs.AddMarker(eii.MarkerNodePosition(nodeNumber=node)) for node in nodes],
            nodeNumber=data,
            spheresRadii=[0.1, 0.1],
            contactStiffness=1e3,
        )
    )
    mbs.Assemble()
    (contact,) = reduce(mbs).model.contacts
    assert (contact.name, contact.gap, contact.stiffness) == ("balls", pytest.approx(0.8), 1e3)
    assert mbs.GetObjectParameter(balls, "activeConnector") is True


def two_masses(first=0.0, second=0.0, held=False):
    """Two masses on a line, each on a spring to ground, with a contact of 1e4 N/m between them, 10 mm apart.

    first, second: displacements. held: a third coordinate is tied to the second mass by a constraint.
    """
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    ground = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    markers = []
    for name, start in (("a", first), ("b", second), *([("c", second)] if held else [])):
        node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[start]))
        mbs.AddObject(eii.ObjectMass1D(mass=1.0, nodeNumber=node))
        markers.append(mbs.AddMarker(eii.MarkerNodeCoordinate(name=name, nodeNumber=node, coordinate=0)))
        spring = eii.ObjectConnectorCoordinateSpringDamper
        mbs.AddObject(spring(markerNumbers=[ground, markers[-1]], stiffness=100.0, damping=0.1))
    if held:
        mbs.AddObject(eii.CoordinateConstraint(name="tie", markerNumbers=markers[1:]))
    facing = [markers[0], markers[-1]]
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[second - first + 0.01], numberOfDataCoordinates=1))
    mbs.AddObject(
        eii.ObjectContactCoordinate(
            name="facing", markerNumbers=facing, nodeNumber=data, contactStiffness=1e4, offset=-0.01
        )
    )
    mbs.Assemble()
    return PublishedSystem(container, mbs, "a", 0.5, 2e-5)


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize(("first", "closed"), [(-0.05, False), (0.03, True)])
def test_two_bodies_in_contact_move_as_in_exudyn_also_from_closed_and_with_a_constraint(first, closed, held):
    system = two_masses(first=first, held=held)
    reduction = reduce(system.mbs)
    (contact,) = reduction.model.contacts
    assert contact.gap == pytest.approx(0.01 - first)
    assert np.linalg.eigvalsh(reduction.structure.stiffness)[-1] < 101  # a closed contact is no part of it
    assert reduction.structure.n == 2
    assert ("constraint, its directions taken out" in reduction.report) == held
    trajectory = run(reduction, system.end)
    own = OwnRun.of(system)
    intervals = trajectory.contact_intervals("facing")
    assert (intervals[0][0] == 0.0) == closed
    row = reduction.structure.coordinates @ reduction.structure.row("a")
    np.testing.assert_allclose(trajectory.at("a", np.minimum(own.time, system.end)), own.of_row(row), atol=2e-6)


def test_a_force_by_a_function_of_time_goes_on_from_the_current_time():
    system = two_masses(first=-1.0)
    force = eii.LoadCoordinate(name="push", markerNumber=2, load=2.0, loadUserFunction=pushed)
    system.mbs.AddLoad(force)
    system.mbs.Assemble()
    assert reduce(system.mbs).left_out == ()
    system.mbs.systemData.SetTime(0.3)
    (load,) = [load for load in reduce(system.mbs).loads if isinstance(load, mp.FunctionLoad)]
    assert load.function(0.1) == pytest.approx(2.0 * np.sin(40.0 * 0.4))


def pushed(mbs, t, load):
    return load * np.sin(40.0 * t)


def test_a_force_by_a_function_of_time_moves_the_model_as_it_does_the_system():
    system = two_masses(first=-0.05)
    system.mbs.AddLoad(eii.LoadCoordinate(name="push", markerNumber=2, load=2.0, loadUserFunction=pushed))
    system.mbs.Assemble()
    reduction = reduce(system.mbs)
    trajectory, own = run(reduction, system.end), OwnRun.of(system)
    row = reduction.structure.coordinates @ reduction.structure.row("b")
    assert "LoadCoordinate 'push': load by its function of time" in reduction.report
    np.testing.assert_allclose(trajectory.at("b", np.minimum(own.time, system.end)), own.of_row(row), atol=2e-6)


def test_gyroscopic_forces_are_refused():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    zero = [0.0, 0.0]
    node = mbs.AddNode(
        eii.NodeGenericODE2(
            referenceCoordinates=zero, initialCoordinates=zero, initialCoordinates_t=zero, numberOfODE2Coordinates=2
        )
    )
    spin = np.array([[0.0, 3.0], [-3.0, 0.0]])
    mbs.AddObject(
        eii.ObjectGenericODE2(
            nodeNumbers=[node], massMatrix=np.eye(2), stiffnessMatrix=100 * np.eye(2), dampingMatrix=spin
        )
    )
    mbs.Assemble()
    with pytest.raises(mp.MultiPhiValueError, match=r"damping matrix is not symmetric .*gyroscopic"):
        reduce(mbs)


def test_the_body_put_back_into_exudyn_moves_as_the_model_alone():
    reduction = reduce(two_masses(first=-0.05).mbs)
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(
        mbs, reduction.model, velocity=reduction.velocity, loads=reduction.loads, matchedStepSize=1e-3
    )
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = 1e-3
    settings.timeIntegration.endTime, settings.timeIntegration.numberOfSteps = 0.5, 500
    assert mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)
    body = body_histories(mbs, items)
    assert len(body.contact_intervals["facing"]) > 0
    alone = run(reduction, 0.5).at("a", np.minimum(body.time, 0.5))
    np.testing.assert_allclose(body.points["a"], alone, atol=1e-9)


def test_a_system_not_assembled_is_refused():
    container = exu.SystemContainer()
    with pytest.raises(mp.MultiPhiValueError, match="not assembled"):
        reduce(container.AddSystem())


def test_what_has_no_linear_or_no_dense_form_is_refused(refused, monkeypatch):
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    mbs.AddNode(eii.NodePoint())
    mbs.Assemble()
    monkeypatch.setattr(linearize, "LARGEST", 2)
    refused(ValueError, "mbs: got 3 ODE2 coordinates, need 1 to 2", reduce, mbs)
    monkeypatch.undo()
    mbs.AddGeneralContact()
    refused(ValueError, "mbs: got a GeneralContact, whose pairs change", reduce, mbs)


def test_what_is_no_system_and_what_are_no_points_is_refused():
    with pytest.raises(mp.MultiPhiTypeError, match=r"mbs: got SystemContainer, need an exudyn\.MainSystem"):
        reduce(exu.SystemContainer())
    system = Mass()
    system.mbs.Assemble()
    with pytest.raises(mp.MultiPhiTypeError, match="points: got list, need "):
        reduce(system.mbs, points=["a"])


def test_a_structure_is_shown_in_one_line():
    system = Mass()
    system.mbs.Assemble()
    structure = reduce(system.mbs).structure
    assert repr(structure).startswith("<LinearizedStructure: degrees of freedom 3; matrices dense")
    assert repr(structure.points).startswith("<rows of 3 degrees of freedom, by point: m1")


def test_a_start_that_is_displaced_and_moving_against_a_damper_moves_as_in_exudyn():
    system = Mass(displacement=0.3, velocity=10.0)
    stops = {"limitStopsUpper": 0.95, "limitStopsLower": -0.95, "limitStopsStiffness": 1e4, "useLimitStops": True}
    held = {"name": "slide", "markerNumbers": system.markers, "nodeNumber": system.data}
    system.mbs.AddObject(eii.ObjectConnectorCoordinateSpringDamperExt(**held, **stops, stiffness=50.0, damping=1.0))
    system.mbs.Assemble()
    trajectory = run(reduce(system.mbs), 0.15)
    assert len(trajectory.contact_intervals("slide.upper")) == 1
    assert 0.3 + trajectory.at("m1", 0.15) == pytest.approx(system.at(0.15), abs=2e-4)


def test_a_hinged_bar_on_a_stop_moves_as_in_exudyn():
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    node = mbs.AddNode(eii.NodeRigidBody2D(referenceCoordinates=[0.5, 0.0, 0.0]))
    bar = mbs.AddObject(eii.ObjectRigidBody2D(mass=2.0, inertia=2 / 12, nodeNumber=node))
    ground = mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=mbs.AddObject(eii.ObjectGround())))
    end = mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=bar, localPosition=[-0.5, 0.0, 0.0]))
    mbs.AddObject(eii.ObjectJointRevolute2D(name="hinge", markerNumbers=[ground, end]))
    fixed = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(eii.NodePointGround()), coordinate=0))
    markers = [fixed, mbs.AddMarker(eii.MarkerNodeCoordinate(name="centre", nodeNumber=node, coordinate=1))]
    data = mbs.AddNode(eii.NodeGenericData(initialCoordinates=[1.0], numberOfDataCoordinates=1))
    law = {"contactStiffness": 1e5, "offset": -1e-3}
    mbs.AddObject(eii.ObjectContactCoordinate(name="stop", markerNumbers=markers, nodeNumber=data, **law))
    body = mbs.AddMarker(eii.MarkerBodyMass(bodyNumber=bar))
    mbs.AddLoad(eii.LoadMassProportional(markerNumber=body, loadVector=[0.0, -2.0, 0.0]))
    mbs.Assemble()
    reduction = reduce(mbs)
    own, trajectory = OwnRun.of(PublishedSystem(container, mbs, "centre", 0.2, 2e-5)), run(reduction, 0.2)
    row = reduction.structure.coordinates @ reduction.structure.row("centre")
    assert "'hinge': constraint, its directions taken out" in reduction.report
    assert len(trajectory.contact_intervals("stop")) == 2
    np.testing.assert_allclose(trajectory.at("centre", np.minimum(own.time, 0.2)), own.of_row(row), atol=2e-6)


def test_strict_refuses_what_would_be_left_out_and_names_it():
    with pytest.raises(
        mp.MultiPhiValueError,
        match=r"leaves out \(ObjectConnector.*Ext 'slide': friction that slips.*\), need strict=F",
    ):
        reduce(mass_between_limit_stops(friction=1.5).mbs, strict=True)
    assert reduce(mass_between_limit_stops().mbs, strict=True).left_out == ()


def springs_by_user_functions(count):
    """A mass on springs by user functions, one of which is switched off."""
    system = Mass(displacement=0.01)
    for i in range(count):
        system.mbs.AddObject(
            eii.ObjectConnectorCoordinateSpringDamper(
                name=f"spring{i}",
                markerNumbers=system.markers,
                springForceUserFunction=lambda mbs, t, i, u, v, k, d, offset: 100.0 * u + 1e7 * u**3,
                activeConnector=i > 0,
            )
        )
    system.mbs.Assemble()
    return system


def test_items_left_out_for_one_reason_are_one_warning_and_one_line():
    reduction = reduce(springs_by_user_functions(30).mbs)
    sentence, _ = run(reduction, 0.1).warnings
    assert sentence.startswith(
        "left out: 29 ObjectConnectorCoordinateSpringDamper ('spring1', 'spring2', 'spring3', ...): the difference of"
    )
    assert len(reduction.left_out) == 30
    assert len(reduction.report.splitlines()) < 10


def test_what_is_switched_off_is_no_reason_to_refuse_or_to_warn():
    reduction = reduce(springs_by_user_functions(1).mbs, strict=True)
    assert [reason for _, reason in reduction.left_out] == ["not active"]
    assert run(reduction, 0.1).warnings == ()


def test_a_motion_prescribed_by_velocity_makes_no_difference_to_the_check():
    """Exudyn fills half of the Jacobian of such a constraint; the damper on the moved mass pulls the free one."""
    system = Mass(velocity=2.0)
    mbs = system.mbs
    free = mbs.AddNode(eii.NodePoint())
    mbs.AddObject(eii.ObjectMassPoint(mass=1.0, nodeNumber=free))
    moved = mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=free, coordinate=0))
    mbs.AddObject(
        eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=[system.markers[1], moved], stiffness=50.0, damping=3.0)
    )
    mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=system.markers, offset=2.0, velocityLevel=True))
    mbs.Assemble()
    reduction = reduce(mbs)
    assert reduction.left_out == ()
    assert reduction.check(run(reduction, 1.0)).error < 1e-6
