"""A reduced Exudyn system moves as the system does, and says what it took and what it left out."""

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import reduce

STEP = 2e-5  # s, of Exudyn's own run


@pytest.fixture(autouse=True)
def _quiet():
    exu.config.printToConsole = False
    yield
    exu.config.printToConsole = True


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
        ("slide", "friction"),
        ("timed", "its user function is none of time alone (it reads mbs.systemData)"),
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


def test_a_contact_of_spheres_is_left_out_and_stays_active():
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
    ((item, reason),) = reduce(mbs).left_out
    assert (item.name, item.type) == ("balls", "ObjectContactSphereSphere")
    assert reason == "its gap is no linear function of coordinates"
    assert mbs.GetObjectParameter(balls, "activeConnector") is True
