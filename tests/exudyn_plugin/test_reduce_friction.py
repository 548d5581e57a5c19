"""Friction connectors of an Exudyn system as mp.Friction: moved as Exudyn moves them, or left out by name."""

import re

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import reduce
from reference_models.exudyn_quiet import quiet
from reference_models.solver_settings import fixed_steps

BRISTLE = {"dynamicFrictionForce": 0.4, "stickingStiffness": 30.0}


class TwoMasses:
    """1 kg and 0.5 kg in a row on springs of 4 and 9 N/m, a force of 1.3 N at 0.31 Hz on the last, one connector."""

    def __init__(self, between=False, data=(0.0, 0.0, 0.0), start=0.0, loaded=True, **connector):
        self.container = exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        ground = mbs.AddNode(eii.NodePointGround())
        self.markers = [mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))]
        self.sensors = []
        for name, mass, stiffness in (("one", 1.0, 4.0), ("two", 0.5, 9.0)):
            node = mbs.AddNode(eii.Node1D(referenceCoordinates=[0.0], initialCoordinates=[start]))
            mbs.AddObject(eii.ObjectMass1D(nodeNumber=node, mass=mass))
            self.markers.append(mbs.AddMarker(eii.MarkerNodeCoordinate(name=name, nodeNumber=node, coordinate=0)))
            mbs.AddObject(
                eii.ObjectConnectorCoordinateSpringDamper(markerNumbers=self.markers[-2:], stiffness=stiffness)
            )
            variable = exu.OutputVariableType.Coordinates
            self.sensors.append(
                mbs.AddSensor(eii.SensorNode(nodeNumber=node, outputVariableType=variable, storeInternal=True))
            )
        self.object = mbs.AddObject(
            eii.ObjectConnectorCoordinateSpringDamperExt(
                name="ring",
                markerNumbers=self.markers[1:] if between else self.markers[::2],
                nodeNumber=mbs.AddNode(eii.NodeGenericData(initialCoordinates=list(data), numberOfDataCoordinates=3)),
                **BRISTLE | connector,
            )
        )
        if loaded:
            force = {"load": 1.3, "loadUserFunction": lambda mbs, t, load: load * np.cos(2 * np.pi * 0.31 * t)}
            mbs.AddLoad(eii.LoadCoordinate(markerNumber=self.markers[2], **force))
        mbs.Assemble()

    def run(self, end, step):
        """Times (k,) and coordinates (2, k) of Exudyn's own run."""
        settings = fixed_steps(end, round(end / step), write_period=step)
        settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
        settings.timeIntegration.discontinuous.useRecommendedStepSize = False
        settings.timeIntegration.discontinuous.ignoreMaxIterations = True
        with quiet():
            self.mbs.SolveDynamic(settings)
        found = np.array([self.mbs.GetSensorStoredData(sensor) for sensor in self.sensors])
        return found[0, :, 0], found[:, :, 1]


def reduced_run(system, end):
    reduction = reduce(system.mbs)
    assert reduction.left_out == ()
    start = {"velocity": reduction.velocity, "loads": reduction.loads}
    return mp.simulate(reduction.model, end, **start)


def motion(trajectory, time, start=0.0):
    """Of both masses, from where the system stood."""
    return start + np.array([trajectory.at(name, time) for name in ("one", "two")])


@pytest.mark.parametrize(
    ("system", "start"),
    [
        ({}, 0.0),
        ({"between": True}, 0.0),
        ({"between": True, "factor0": 0.5, "factor1": -1.5}, 0.0),
        ({"staticFrictionOffsetForce": 1e-6}, 0.0),
        ({"stiffness": 3.0, "damping": 0.2, "offset": 0.05, "velocityOffset": 0.3}, 0.0),
        ({"data": (0.0, 0.1, 0.0), "start": 0.1}, 0.1),
    ],
    ids=[
        "to ground",
        "two coordinates",
        "factors",
        "a hair between the limits",
        "spring and damper",
        "started elsewhere",
    ],
)
def test_a_bristle_moves_as_in_exudyn(system, start):
    trajectory = reduced_run(TwoMasses(**system), 8.0)
    kinds = [event.kind for event in trajectory.events]
    assert kinds.count("slip") >= 4
    assert kinds.count("stick") >= 4
    errors = []
    for step in (8e-3, 1e-3):
        time, own = TwoMasses(**system).run(8.0, step)
        errors.append(np.linalg.norm(motion(trajectory, time, start) - own) / np.linalg.norm(own))
    assert errors[1] < 1e-4
    assert errors[1] < errors[0] / 20


def test_friction_and_limit_stops_of_one_connector_act_together():
    stops = {"useLimitStops": True, "limitStopsUpper": 0.15, "limitStopsLower": -0.2, "limitStopsStiffness": 200.0}
    trajectory = reduced_run(TwoMasses(**stops), 4.0)
    assert {contact.name for contact in trajectory.model.contacts} == {"ring", "ring.upper", "ring.lower"}
    assert {"close", "stick", "slip"} <= {event.kind for event in trajectory.events}
    time, own = TwoMasses(**stops).run(4.0, 1e-3)
    np.testing.assert_allclose(motion(trajectory, time), own, atol=1e-3 * np.max(np.abs(own)))


def test_the_report_says_what_it_became():
    assert "friction, 0.4 N by a bristle of 30 N/m" in reduce(TwoMasses().mbs).report


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"frictionProportionalZone": 1e-3}, "in proportion to slow speeds"),
        ({"staticFrictionOffsetForce": 0.1}, "falls with the speed"),
        ({"viscousFrictionFactor": 0.1}, "grows with the speed of slip"),
        ({"stickingDamping": 0.1}, "damped bristle"),
        ({"data": (0.4, 0.0, 0.0)}, r"slips already \(data coordinate 0: 0.4\)"),
        ({"start": 0.1}, r"stretched bristle \(data coordinate 1: 0\), need its coordinate: 0.1"),
        ({"activeConnector": False}, "not active"),
        ({"springForceUserFunction": lambda mbs, t, i, u, *given: u}, "the difference of its user function"),
    ],
)
def test_what_is_another_law_is_left_out_by_name(changed, reason):
    system = TwoMasses(**changed)
    reduction = reduce(system.mbs)
    ((item, told),) = reduction.left_out
    assert item.name == "ring"
    assert re.search(reason, told)
    assert reduction.model.contacts == ()


def test_friction_on_a_coordinate_that_constraints_hold_acts_in_no_run():
    system = TwoMasses()
    system.mbs.AddObject(eii.ObjectConnectorCoordinate(markerNumbers=system.markers[::2]))
    system.mbs.Assemble()
    reduction = reduce(system.mbs, strict=True)
    assert [reason for _, reason in reduction.left_out] == ["constraints hold the coordinate of its friction"]


def test_a_system_with_friction_is_within_its_linear_range():
    trajectory = reduced_run(TwoMasses(loaded=False, start=0.0, offset=1.0, stiffness=2.0), 5.0)
    assert "slip" in {event.kind for event in trajectory.events}
    assert not [warning for warning in trajectory.warnings if warning.startswith("linear range")]
