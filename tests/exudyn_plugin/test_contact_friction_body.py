"""Bodies with contacts that rub: alone as exact as the native run, coupled of second order, restarted as one run."""

import numpy as np
import pytest
import scipy.linalg
from body_runs import coordinate, run, system
from exudyn.itemInterface import (
    NodeGenericODE2,
    ObjectConnectorCoordinateSpringDamper,
    ObjectGenericODE2,
)

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody

END = 5.0
MASS, DAMPING_PARTS = np.diag([1.0, 0.6, 0.5]), (0.05, 0.02)
STIFFNESS = np.array([[8.0, -3.0, 0.8], [-3.0, 9.0, 1.0], [0.8, 1.0, 12.0]])
POINTS = {"x": 0, "z": 1, "y": 2}
START, SPEED = np.array([0.4, 0.6, -0.08]), np.array([0.3, 0.0, 0.0])
WEIGHT = mp.ConstantLoad("y", -1.5)
KINDS = {
    "rigid": {},
    "lets go, rigid": {"static_friction": 0.5},
    "sprung": {"tangential_stiffness": 60.0},
    "lets go": {"tangential_stiffness": 60.0, "static_friction": 0.5},
    "viscous": {"damping": 3.0},
}


def floor(kind, **given):
    return mp.UnilateralContact("floor", "y", 0.0, 80.0, friction=0.3, tangential="x", **KINDS[kind], **given)


def matrices():
    return [MASS.copy(), STIFFNESS.copy(), DAMPING_PARTS[0] * MASS + DAMPING_PARTS[1] * STIFFNESS]


def model(*contacts, **given):
    mass, stiffness, damping = matrices()
    structure = mp.LinearStructure(mass, stiffness, damping=damping, points=POINTS)
    return mp.MultiPhiModel(structure, contacts, **{"modes": "all", **given})


def assert_is(found, native):
    assert len(native.events) >= 8
    assert [(e.kind, e.state) for e in found.events] == [(e.kind, e.state) for e in native.events]
    assert [e.time for e in found.events] == pytest.approx([e.time for e in native.events], rel=1e-10)
    for point in POINTS:
        assert np.max(np.abs(found.points[point] - native.at(point, found.time))) < 1e-11
    assert found.gaps["floor"] == pytest.approx(native.gap("floor", found.time), abs=1e-11)
    assert found.contact_force["floor"] == pytest.approx(native.contact_force("floor", found.time), abs=1e-9)
    assert found.friction_force["floor"] == pytest.approx(native.friction_force("floor", found.time), abs=1e-9)
    assert found.slip["floor"] == pytest.approx(native.slip("floor", found.time), abs=1e-10)
    assert np.array(found.contact_intervals["floor"]) == pytest.approx(np.array(native.contact_intervals("floor")))
    assert found.stick_intervals["floor"] == pytest.approx(native.stick_intervals("floor"), abs=1e-9)


class TestAlone:
    @pytest.mark.parametrize("kind", KINDS)
    def test_is_exact_at_matched_steps(self, kind):
        native = mp.simulate(model(floor(kind)), END, displacement=START, velocity=SPEED, loads=[WEIGHT])
        found, body = run(
            model(floor(kind)), 0.02, END, matchedStepSize=0.02, displacement=START, velocity=SPEED, loads=[WEIGHT]
        )
        assert_is(found, native)
        assert body.warnings == native.warnings

    @pytest.mark.parametrize("kind", ["lets go", "viscous"])
    def test_is_exact_on_a_belt_under_loads_that_vary(self, kind):
        belt = model(floor(kind, tangential_velocity=0.2))
        given = {"displacement": START, "velocity": SPEED, "loads": [WEIGHT, mp.HarmonicLoad("z", 2.0, 0.4)]}
        found, _ = run(belt, 0.02, END, **given)
        assert_is(found, mp.simulate(belt, END, **given))

    @pytest.mark.parametrize("static", [None, 0.5])
    def test_with_a_rigid_contact_is_exact_at_matched_steps(self, static):
        stop = mp.UnilateralContact("floor", "y", 0.0, friction=0.3, static_friction=static, tangential="x")
        given = {"displacement": [0.4, 0.6, 0.1], "velocity": SPEED, "loads": [WEIGHT, mp.HarmonicLoad("x", 4.0, 0.9)]}
        found, _ = run(model(stop), 0.02, END, matchedStepSize=0.02, **given)
        native = mp.simulate(model(stop), END, **given)
        assert {event.kind for event in native.events} >= {"close", "slip", "stick"}
        assert_is(found, native)

    def test_unmatched_steps_are_exact_where_something_happens(self):
        """Between events Exudyn's own steps are of second order, in levels without a symmetric matrix too."""
        native = mp.simulate(model(floor("rigid")), END, displacement=START, velocity=SPEED, loads=[WEIGHT])
        errors = []
        for h in (0.02, 0.01):
            found, _ = run(model(floor("rigid")), h, END, displacement=START, velocity=SPEED, loads=[WEIGHT])
            assert [e.time for e in found.events] == pytest.approx([e.time for e in native.events], rel=1e-9)
            errors.append(max(np.max(np.abs(found.points[p] - native.at(p, found.time))) for p in POINTS))
        assert errors[1] < 0.3 * errors[0]

    def test_a_growing_level_is_followed(self):
        """Flutter: what slides on a fast belt grows, exactly as the native run does."""
        stiffness = np.array([[23.25, 3.897], [3.897, 7.75]])
        structure = mp.LinearStructure(np.eye(2), stiffness, points={"x": 0, "y": 1})
        belt = mp.UnilateralContact("belt", "y", -1.0, 35.0, friction=1.2, tangential="x", tangential_velocity=-1e3)
        given = {"displacement": [0.7, -0.6], "velocity": None}
        native = mp.simulate(mp.MultiPhiModel(structure, [belt], modes="all"), 3.0, **given)
        level = native.model.level({"belt": "slip+"})
        assert np.max(level.response.basis.rates.real) > 0.1
        found, _ = run(mp.MultiPhiModel(structure, [belt], modes="all"), 0.02, 3.0, **given)
        for point in ("x", "y"):
            assert np.max(np.abs(found.points[point] - native.at(point, found.time))) < 1e-10


class TestCoupled:
    """Beside the whole structure in one model."""

    @pytest.mark.parametrize(("kind", "point"), list(zip(KINDS, "xyxyx", strict=True)))
    def test_a_mass_where_it_rubs_or_presses_converges_with_order_two(self, kind, point):
        mass, stiffness, damping = matrices()
        mass[POINTS[point], POINTS[point]] += 0.7
        whole = mp.LinearStructure(mass, stiffness, damping=damping, points=POINTS)

        def add(mbs, items):
            mbs.AddObject(ObjectGenericODE2(nodeNumbers=[items["nInterface"][point]], massMatrix=[[0.7]]))

        assert_converges(whole, kind, point, add)

    @pytest.mark.parametrize("kind", ["rigid", "lets go"])
    def test_a_mass_on_a_spring_converges_with_order_two(self, kind):
        mass, stiffness, damping = (scipy.linalg.block_diag(part, [[0.0]]) for part in matrices())
        mass[3, 3] = 0.5
        stiffness[1::2, 1::2] += 8.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
        whole = mp.LinearStructure(mass, stiffness, damping=damping, points=POINTS)

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
            ends = [coordinate(mbs, items["nInterface"]["z"]), coordinate(mbs, free)]
            mbs.AddObject(ObjectConnectorCoordinateSpringDamper(markerNumbers=ends, stiffness=8.0))

        assert_converges(whole, kind, "z", add)

    def test_a_belt_has_no_interface(self, refused):
        begins = "velocity of 'floor.tangential': got 0.1 m/s of the counter-surface in a body with an interface"
        given = model(floor("rigid", tangential_velocity=0.1))
        refused(ValueError, begins, lambda: CreateMultiPhiBody(system(), given, interface=("z",)))

    def test_a_rigid_contact_with_friction_has_no_interface(self, refused):
        given = model(mp.UnilateralContact("stop", "z", 0.1, friction=0.2, tangential="x"))
        begins = "friction: got rigid contacts with friction (stop) in a body with an interface, need a"
        refused(ValueError, begins, lambda: CreateMultiPhiBody(system(), given, interface=("z",)))


def assert_converges(whole, kind, point, add):
    still = np.zeros(whole.n - 3)
    native = mp.simulate(
        mp.MultiPhiModel(whole, [floor(kind)], modes="all"), END, displacement=[*START, *still],
        velocity=[*SPEED, *still], loads=[WEIGHT],
    )  # fmt: skip
    assert len(native.events) >= 8
    errors = []
    for h in (0.02, 0.01, 0.0025):
        found, _ = run(
            model(floor(kind)), h, END, add=add, interface=(point,), matchedStepSize=h, displacement=START,
            velocity=SPEED, loads=[WEIGHT],
        )  # fmt: skip
        errors.append(max(np.max(np.abs(found.points[p] - native.at(p, found.time))) for p in POINTS))
    states = [(e.kind, e.state) for e in native.events]
    assert [(e.kind, e.state) for e in found.events] == states
    forces = np.abs(found.friction_force["floor"] - native.friction_force("floor", found.time))
    assert np.mean(forces) < 0.01 * np.max(np.abs(native.friction_force("floor", found.time)))
    assert errors[-1] < max(errors) / 10  # of first order it would be an eighth
    assert errors[-1] < 3e-4
