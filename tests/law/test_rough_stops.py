"""Rigid contacts with friction: impacts on the edge of Coulomb's cone and inside it, sliding, sticking, lifting off."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp

G = 9.81
COUPLED = np.array([[1.0, 0.4], [0.4, 1.0]])


def dropped(speed, friction, *, height=1.0, t_end=3.0, mass=None, slope=0.0, **given):
    """A block at a height above a rough floor, with a speed along it; slope: of the floor [rad]."""
    mass = np.eye(2) if mass is None else mass
    structure = mp.LinearStructure(mass, np.zeros((2, 2)), points={"x": 0, "y": 1})
    floor = mp.UnilateralContact("floor", "y", 0.0, friction=friction, tangential="x", **given)
    weight = [mp.ConstantLoad("x", G * math.sin(slope)), mp.ConstantLoad("y", -G * math.cos(slope))]
    model = mp.MultiPhiModel(structure, [floor], modes="all")
    return mp.simulate(model, t_end, displacement=[0.0, height], velocity=[speed, 0.0], loads=weight)


class TestDroppedBlock:
    """m 1: it falls sqrt(2 h / g), strikes with v_n = sqrt(2 g h), and slides on with v_t - mu v_n."""

    @pytest.mark.parametrize("speed", [5.0, -5.0, 2.0])
    def test_slides_until_it_sticks(self, speed):
        run, falls, sign = dropped(speed, 0.3), math.sqrt(2 / G), math.copysign(1.0, speed)
        left = abs(speed) - 0.3 * math.sqrt(2 * G)
        stops, way = falls + left / (0.3 * G), left**2 / (2 * 0.3 * G)
        assert [event.kind for event in run.events] == ["close", "stick"]
        assert run.events[0].impulse == pytest.approx(math.sqrt(2 * G), rel=1e-12)
        assert_allclose([event.time for event in run.events], [falls, stops], rtol=1e-12)
        assert run.velocity(falls + 1e-14)[0] == pytest.approx(sign * left, rel=1e-12)
        assert run.at("x", 3.0) == pytest.approx(speed * falls + sign * way, rel=1e-12)
        assert run.friction_force("floor", falls + 0.01) == pytest.approx(sign * 0.3 * G, rel=1e-12)
        assert run.friction_force("floor", 3.0) == pytest.approx(0.0, abs=1e-12)
        assert run.contact_force("floor", 3.0) == pytest.approx(G, rel=1e-12)
        assert run.ledger.impact == pytest.approx(G + speed**2 / 2 - left**2 / 2, rel=1e-12)
        assert run.ledger.friction == pytest.approx(left**2 / 2, rel=1e-12)
        assert abs(run.ledger.residual) < 1e-12 * G

    @pytest.mark.parametrize("speed", [1.32, -1.32, 0.0])
    def test_sticks_at_once_inside_the_cone(self, speed):
        """mu v_n = 1.3289 m/s."""
        run = dropped(speed, 0.3)
        assert [event.kind for event in run.events] == ["close"]
        assert_allclose(run.stick_intervals("floor"), [[math.sqrt(2 / G), 3.0]], rtol=1e-12)
        assert run.at("x", 3.0) == pytest.approx(speed * math.sqrt(2 / G), rel=1e-12, abs=1e-15)
        assert run.ledger.impact == pytest.approx(G + speed**2 / 2, rel=1e-12)


class TestIncline:
    @pytest.mark.parametrize(("friction", "static"), [(0.5, None), (0.3, 0.7)])
    def test_holds_below_the_static_friction(self, friction, static):
        run = dropped(0.0, friction, height=0.0, slope=math.atan(0.49), static_friction=static, t_end=50.0)
        assert run.at("x", 50.0) == 0.0
        assert run.friction_force("floor", 50.0) == pytest.approx(G * math.sin(math.atan(0.49)), rel=1e-12)


def _impacts(mass, speed, friction):
    """All speeds after an impact that Moreau's law with friction admits: x along the floor, y away from it."""
    flexibility = np.linalg.inv(mass)
    found = []
    for state in ("stick", 1.0, -1.0):
        matrix = flexibility if state == "stick" else np.array([[1.0, state * friction], flexibility[1]])
        q, p = np.linalg.solve(matrix, -np.asarray(speed) if state == "stick" else [0.0, -speed[1]])
        after = speed + flexibility @ [q, p]
        inside = abs(q) <= friction * p if state == "stick" else state * after[0] > 0
        found += [after] if p >= 0 and inside else []
    return found


def _poisson(mass, speed, friction, restitution):
    """Speeds after a plastic impact of impulse p and one of at least e p, and both together."""
    flexibility, (after,) = np.linalg.inv(mass), _impacts(mass, speed, friction)
    first = (mass @ (after - speed))[1]
    for state in ("stick", 1.0, -1.0):  # the floor lets go of it with e p or more, and it pushes along it
        least = restitution * first
        q = (
            -(after[0] + flexibility[0, 1] * least) / flexibility[0, 0]
            if state == "stick"
            else -state * friction * least
        )
        final = after + flexibility @ [q, least]
        inside = abs(q) <= friction * least + 1e-15 if state == "stick" else state * final[0] > 0
        if inside and final[1] >= 0:
            return final, first + least
    raise AssertionError("it would be struck once more")


class TestCoupledImpact:
    """Mass that couples x and y: an impulse against the floor makes a speed along it, and friction changes it."""

    @pytest.mark.parametrize("friction", [0.1, 0.5, 1.5])
    @pytest.mark.parametrize("speed", [-2.0, -0.3, 0.1, 0.3, 2.0])
    def test_is_the_only_one_that_coulombs_law_admits(self, speed, friction):
        run = dropped(speed, friction, mass=COUPLED, slope=0.0, t_end=1.0)
        struck = run.events[0].time
        before = run.velocity(struck - 1e-13)
        (expected,) = _impacts(COUPLED, before, friction)
        assert_allclose(run.velocity(struck + 1e-13), expected, rtol=0, atol=1e-11)
        assert run.events[0].loss.impact > 0
        assert abs(run.ledger.residual) < 1e-12 * run.ledger.work_of_loads

    @pytest.mark.parametrize("speed", [-2.0, -0.3, 0.5, 2.0])
    @pytest.mark.parametrize("restitution", [0.3, 0.9, 1.0])
    @pytest.mark.parametrize("friction", [0.1, 0.5, 1.5])
    def test_with_restitution_gives_back_impulse_as_poisson_says(self, speed, friction, restitution):
        """Of Newton's law speed 0.5, friction 0.5 and e 0.9 make energy (Kane's paradox)."""
        mass = np.array([[1.0, 0.5], [0.5, 1.0]])
        structure = mp.LinearStructure(mass, np.zeros((2, 2)), points={"x": 0, "y": 1})
        floor = mp.UnilateralContact("floor", "y", 0.1, friction=friction, tangential="x", restitution=restitution)
        start = np.array([speed, -1.0])
        model = mp.MultiPhiModel(structure, [floor], modes="all")
        run = mp.simulate(model, 0.2, velocity=start)
        expected, impulse = _poisson(mass, start, friction, restitution)
        assert run.status == "ok"
        assert_allclose(run.velocity(0.2), expected, rtol=0, atol=1e-13)
        assert run.events[0].impulse == pytest.approx(impulse, rel=1e-12)
        lost = (start @ mass @ start - expected @ mass @ expected) / 2
        assert run.ledger.impact == pytest.approx(lost, abs=1e-13)
        assert lost >= -1e-13
        assert abs(run.ledger.residual) < 1e-13


def rod(friction, speed, height):
    """Painleve's rod, m 1, half length 1, J 1/3, with one end on the floor, at an angle."""
    angle = math.atan(2.0)
    structure = mp.LinearStructure(np.diag([1.0, 1.0, 1 / 3]), np.zeros((3, 3)), points={"x": 0, "y": 1})
    normal, along = [0.0, 1.0, -math.cos(angle)], [1.0, 0.0, math.sin(angle)]
    floor = mp.UnilateralContact("floor", normal, 0.0, friction=friction, tangential=along)
    model = mp.MultiPhiModel(structure, [floor], modes="all")
    weight = [mp.ConstantLoad("y", -G)]
    return mp.simulate(model, 0.6, displacement=[0.0, height, 0.0], velocity=[speed, 0.0, 0.0], loads=weight)


class TestRod:
    @pytest.mark.parametrize("speed", [-1.0, 1.0])
    def test_slides_below_the_critical_coefficient(self, speed):
        run = rod(1.0, speed, 0.0)
        assert [event.kind for event in run.events] == ["close", "stick"]
        assert abs(run.ledger.residual) < 1e-12

    def test_that_slides_without_a_unique_motion_is_refused_with_its_number(self):
        run = rod(1.4, -1.0, 0.0)
        assert run.status == "failed"
        assert "h.M^-1 (h - s mu h_t) is -0.05 of h.M^-1 h" in run.message
        assert rod(1.4, 1.0, 0.0).status == "ok"  # the other way it slides


def rubbing_chain(contacts, modes="all", masses=8):
    return mp.MultiPhiModel(chain(masses, stiffness=40.0), contacts, modes=modes)


def _rough(i, sign=1.0, **given):
    """A stop at a mass, which rubs with its neighbours."""
    along = {f"m{i + 1}": 1.0, f"m{i - 1}": -0.5}
    return mp.UnilateralContact(f"c{i}", {f"m{i}": sign}, 0.01, friction=0.4, tangential=along, **given)


class TestSeveral:
    LOADS = (mp.HarmonicLoad("m2", 6.0, 0.7), mp.HarmonicLoad("m5", -5.0, 0.9))

    def test_forces_stay_inside_their_cones_and_the_ledger_closes(self):
        run = mp.simulate(rubbing_chain([_rough(2), _rough(5, -1.0)]), 6.0, loads=self.LOADS)
        assert run.status == "ok"
        assert {event.kind for event in run.events} >= {"close", "open", "slip", "stick"}
        t = np.linspace(0, 6, 4001)
        for name in ("c2", "c5"):
            pressure, rubbing = run.contact_force(name, t), run.friction_force(name, t)
            assert np.min(pressure) > -1e-9
            assert np.max(np.abs(rubbing) - 0.4 * pressure) < 1e-9
            assert np.min(run.gap(name, t)) > -1e-12
        assert abs(run.ledger.residual) < 1e-10 * run.ledger.work_of_loads
        assert run.ledger.friction > 0 < run.ledger.impact
        size = np.max(np.abs([event.loss.truncation_kinetic for event in run.events]))
        assert size < 1e-12 * run.ledger.work_of_loads


def feet(static):
    """A rigid body, and a block, each pushed to and fro on a floor; the body stands on two feet."""
    body = mp.LinearStructure(np.diag([1.0, 1.0, 1 / 3]), np.zeros((3, 3)), points={"x": 0, "y": 1})
    block = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"x": 0, "y": 1})
    rubs = {"friction": 0.3, "static_friction": static}
    both = [
        mp.UnilateralContact(name, [0.0, 1.0, arm], 0.0, tangential=[1.0, 0.0, 0.5], **rubs)
        for name, arm in (("left", -1.0), ("right", 1.0))
    ]
    return (body, both), (block, [mp.UnilateralContact("floor", "y", 0.0, tangential="x", **rubs)])


@pytest.mark.parametrize("amplitude", [2.5, 6.0])
def test_of_two_feet_of_a_rigid_body_one_sticks_for_both(amplitude):
    """Which of them bears what is not determined; how the body moves is: as a block."""
    t, found = np.linspace(0.0, 4.0, 80), []
    for structure, contacts in feet(None):
        start = np.eye(structure.n)[0] * 0.7
        loads = [mp.ConstantLoad("y", -G), mp.HarmonicLoad("x", amplitude, 0.8)]
        run = mp.simulate(mp.MultiPhiModel(structure, contacts, modes="all"), 4.0, velocity=start, loads=loads)
        assert run.status == "ok"
        found.append(run.at("x", t))
    assert_allclose(*found, rtol=0, atol=1e-12)


def sled(arms, height, stiffness, friction=0.37, **given):
    """A body that only its feet hold along x; weak springs hold how deep it sinks, and how it tips."""
    along = np.array([1.0, 0.0, height])
    feet = [
        mp.UnilateralContact(
            name, [0.0, 1.0, x], 0.0, stiffness, friction=friction, tangential=along if friction else None, **given
        )
        for name, x in zip(("rear", "front"), arms, strict=False)
    ]
    structure = mp.LinearStructure(np.diag([1.0, 1.0, 0.5]), np.diag([0.0, 0.1, 0.1]))
    return mp.MultiPhiModel(structure, feet, modes="all"), [mp.ConstantLoad(np.array([0.0, -1.0, 0.0]), G)]


@pytest.mark.parametrize("stiffness", [math.inf, 1e3])
@pytest.mark.parametrize("height", [0.0, 0.3, 0.7])
def test_a_sled_on_two_feet_stops_where_its_speed_is_spent(stiffness, height):
    """They share its weight, m g, as its friction tips it: no round-off of that couples its free motion."""
    speed, sunk, t = 1.3, G / (2 * stiffness + 0.1), np.linspace(0, 1, 41)
    model, weight = sled((-1.0, 1.0), height, stiffness)
    run = mp.simulate(model, 1.0, [0.0, -sunk, 0.0], [speed, 0.0, 0.0], weight)
    pressure, end = G - 0.1 * sunk, speed / (0.37 * (G - 0.1 * sunk))
    assert run.status == "ok"
    if math.isinf(stiffness) or height == 0.0:
        s = np.minimum(t, end)
        assert_allclose(run.displacement(t)[0], speed * s - 0.37 * pressure * s**2 / 2, atol=1e-11)
        assert min(e.time for e in run.events if e.kind == "stick" and e.time > 0) == pytest.approx(end, rel=1e-12)
    both = run.contact_force("rear", t) + run.contact_force("front", t)
    assert_allclose(both, pressure, rtol=1e-9)
    assert run.ledger.residual == pytest.approx(0.0, abs=1e-12)
