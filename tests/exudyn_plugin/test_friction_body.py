"""Bodies with friction: alone as exact as the native run, coupled of second order, handed on whole."""

import dataclasses

import body_runs
import exudyn as exu
import numpy as np
import pytest
import scipy.linalg
from body_runs import TRAPEZOIDAL, coordinate, settings, system
from exudyn.itemInterface import (
    NodeGenericODE2,
    ObjectConnectorCoordinateSpringDamper,
    ObjectGenericODE2,
    SensorNode,
)
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories

END = 8.0
DAMPING = mp.ModalDamping([0.02, 0.01, 0.03])
RING = {
    "rigid": mp.Friction("ring", "m1", 0.4),
    "sprung": mp.Friction("ring", "m1", 0.4, stiffness=30.0),
    "lets go": mp.Friction("ring", "m1", 0.4, static_limit=0.6, stiffness=30.0),
    "lets go, rigid": mp.Friction("ring", "m1", 0.4, static_limit=0.6),
}
START = np.array([0.3, 0.7, 1.0])


def model(*elements, **given):
    return mp.MultiPhiModel(chain(3, damping=DAMPING, stiffness=10.0), elements, **{"modes": "all", **given})


def run(of, step, end=END, **given):
    """Histories and body of a run."""
    return body_runs.run(of, step, end, **{"displacement": START, **given})


class TestAlone:
    @pytest.mark.parametrize("kind", RING)
    def test_is_exact_at_matched_steps(self, kind):
        native = mp.simulate(model(RING[kind]), END, displacement=START)
        found, _ = run(model(RING[kind]), 0.02, matchedStepSize=0.02)
        assert_is(found, native)

    @pytest.mark.parametrize("velocity", [0.0, 0.2], ids=["at rest", "belt"])
    def test_is_exact_at_every_step_under_loads_that_vary(self, velocity):
        ring, loads = dataclasses.replace(RING["lets go"], velocity=velocity), [mp.HarmonicLoad("m2", 1.5, 0.31)]
        native = mp.simulate(model(ring), END, displacement=START, loads=loads)
        found, _ = run(model(ring), 0.02, loads=loads)
        assert_is(found, native)

    def test_a_truncated_model_goes_on_where_another_run_ended(self):
        """Exudyn hands on all that there is: two runs are one, with a contact beside the friction."""
        stop = mp.UnilateralContact("stop", {"m2": -1.0}, 0.4, 40.0)
        given = model(RING["lets go"], stop, modes=2)
        whole, _ = run(given, 0.02, matchedStepSize=0.02)
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        items = CreateMultiPhiBody(mbs, given, name="b", displacement=START, matchedStepSize=0.02)
        mbs.Assemble()
        parts = []
        for k in range(2):
            part = settings(0.02, END / 2)
            part.timeIntegration.startTime, part.timeIntegration.endTime = k * END / 2, (k + 1) * END / 2
            mbs.SolveDynamic(part, solverType=TRAPEZOIDAL)
            parts.append(body_histories(mbs, items))
            mbs.systemData.SetSystemState(mbs.systemData.GetSystemState(), configuration=exu.ConfigurationType.Initial)
        assert 3 < len(parts[0].events) < len(whole.events)
        for name in ("points", "friction_force", "contact_force"):
            for key, values in getattr(whole, name).items():
                joined = np.concatenate([getattr(parts[0], name)[key], getattr(parts[1], name)[key][1:]])
                assert np.max(np.abs(joined - values)) < 1e-8 * np.max(np.abs(values))

    def test_a_body_that_somebody_moves_beyond_its_limit_slips_at_once(self):
        container = exu.SystemContainer()
        mbs = container.AddSystem()
        given = model(RING["sprung"])
        items = CreateMultiPhiBody(mbs, given, name="b", matchedStepSize=0.02)
        mbs.Assemble()
        moved = given.level(()).vectors.T @ given.base.coordinates(START)
        level = mbs.variables["multiPhi"]["b"].state.level
        eta = level.modal.vectors.T @ given.base.coordinates(START)
        assert len(moved) == len(eta)
        first = int(mbs.GetNodeODE2Index(items["nGenericODE2"]))
        state = list(mbs.systemData.GetODE2Coordinates())
        state[first : first + 3] = eta
        mbs.systemData.SetODE2Coordinates(state, configuration=exu.ConfigurationType.Initial)
        mbs.SolveDynamic(settings(0.02, 4.0), solverType=TRAPEZOIDAL)
        found = body_histories(mbs, items)
        assert (found.events[0].time, found.events[0].kind) == (0.0, "slip")
        native = mp.simulate(given, 4.0, displacement=START)  # where a run starts a link has no stretch
        assert np.max(np.abs(found.friction_force["ring"])) <= 0.4 * (1 + 1e-12)
        assert native.events


class TestCoupled:
    @pytest.mark.parametrize("kind", ["rigid", "lets go"])
    def test_a_mass_on_a_spring_converges_with_order_two(self, kind):
        whole = mp.LinearStructure(*with_spring(8.0, 0.5), {f"m{i}": i for i in range(4)})
        native = mp.simulate(mp.MultiPhiModel(whole, [RING[kind]], modes="all"), END, displacement=[*START, 0.0])

        def add(mbs, items):
            free = mbs.AddNode(
                NodeGenericODE2(
                    referenceCoordinates=[0.0],
                    initialCoordinates=[0.0],
                    initialCoordinates_t=[0.0],
                    numberOfODE2Coordinates=1,
                )
            )
            mbs.AddObject(ObjectGenericODE2(nodeNumbers=[free], massMatrix=[[0.5]]))
            ends = [coordinate(mbs, items["nInterface"]["m2"]), coordinate(mbs, free)]
            mbs.AddObject(ObjectConnectorCoordinateSpringDamper(markerNumbers=ends, stiffness=8.0))

        assert_converges(native, lambda h: run(model(RING[kind]), h, add=add, interface=("m2",), matchedStepSize=h))

    @pytest.mark.parametrize("point", ["m1", "m2"])
    @pytest.mark.parametrize("kind", ["rigid", "lets go"])
    def test_a_mass_where_it_rubs_or_beside_it_converges_with_order_two(self, kind, point):
        chained = chain(3, damping=DAMPING, stiffness=10.0)
        mass = np.array(chained.mass)
        mass[int(point[1]), int(point[1])] += 0.7
        whole = mp.LinearStructure(mass, chained.stiffness, physical(chained), {f"m{i}": i for i in range(3)})
        native = mp.simulate(mp.MultiPhiModel(whole, [RING[kind]], modes="all"), END, displacement=START)

        def add(mbs, items):
            mbs.AddObject(ObjectGenericODE2(nodeNumbers=[items["nInterface"][point]], massMatrix=[[0.7]]))

        assert_converges(native, lambda h: run(model(RING[kind]), h, add=add, interface=(point,), matchedStepSize=h))

    def test_an_interface_on_what_rubs_is_where_the_body_is(self):
        """Places that links hold are part of interface coordinates at every step."""
        given = model(RING["rigid"], modes=2)

        def watch(mbs, items):
            node = SensorNode(
                nodeNumber=items["nInterface"]["m1"],
                storeInternal=True,
                writeToFile=False,
                outputVariableType=exu.OutputVariableType.Coordinates,
            )
            watch.sensor, watch.mbs = mbs.AddSensor(node), mbs

        found, _ = run(given, 0.01, add=watch, interface=("m1",))
        y = watch.mbs.GetSensorStoredData(watch.sensor)[:, 1]
        assert len(found.events) > 4
        assert np.max(np.abs(y - found.points["m1"])) < 1e-12

    def test_a_belt_has_no_interface(self, refused):
        ring = mp.Friction("ring", "m1", 0.4, velocity=0.1)
        begins = "velocity of 'ring': got 0.1 m/s of the counter-surface in a body with an interface"
        refused(ValueError, begins, lambda: CreateMultiPhiBody(system(), model(ring), interface=("m2",)))


def physical(structure):
    """The damping matrix of modal damping."""
    squares, shapes = scipy.linalg.eigh(structure.stiffness, structure.mass)
    weighed = structure.mass @ shapes
    return weighed @ np.diag(2 * np.array(DAMPING.ratios) * np.sqrt(squares)) @ weighed.T


def with_spring(stiffness, mass):
    """M, K, C of the chain with a mass on a spring at its end."""
    chained = chain(3, damping=DAMPING, stiffness=10.0)
    parts = [scipy.linalg.block_diag(part, [[0.0]]) for part in (chained.mass, chained.stiffness, physical(chained))]
    parts[0][3, 3] = mass
    parts[1][2:, 2:] += stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return parts


def assert_is(found, native):
    assert len(native.events) >= 6
    assert [(e.kind, e.contact) for e in found.events] == [(e.kind, e.contact) for e in native.events]
    assert [e.time for e in found.events] == pytest.approx([e.time for e in native.events], rel=1e-10)
    for point in ("m0", "m1", "m2"):
        assert np.max(np.abs(found.points[point] - native.at(point, found.time))) < 1e-11
    assert found.stick_intervals["ring"] == pytest.approx(native.stick_intervals("ring"), rel=1e-10)
    assert found.friction_force["ring"] == pytest.approx(native.friction_force("ring", found.time), abs=1e-9)
    assert found.slip["ring"] == pytest.approx(native.slip("ring", found.time), abs=1e-10)


def assert_converges(native, shown):
    assert len(native.events) >= 6
    steps, errors = np.array([0.04, 0.02, 0.01, 0.005]), []
    for h in steps:
        found, _ = shown(h)
        errors.append(max(np.max(np.abs(found.points[p] - native.at(p, found.time))) for p in ("m0", "m1", "m2")))
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] > 1.5
    assert errors[-1] < 3e-4
