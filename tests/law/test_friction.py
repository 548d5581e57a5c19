"""What a trajectory tells of friction: force, slip, stick, its row of the ledger; and moving counter-surfaces."""

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import random_structure, stop

import multiphi_exudyn as mp


def block(*elements, stiffness=4.0, damping=None):
    structure = mp.LinearStructure([[1.0]], [[stiffness]], damping=damping, points={"m": 0})
    return mp.MultiPhiModel(structure, elements, modes="all")


def belt(speed=0.3, static_limit=3.5, stiffness=math.inf):
    """m 1, k 25, N 10, limits .2 and .35 of it."""
    friction = mp.Friction("belt", "m", 2.0, static_limit, stiffness, speed)
    return block(friction, stiffness=25.0)


def quietly(*given, **more):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mp.simulate(*given, **more)


def largest_energy(run):
    times = np.linspace(run.start.time, run.t_end, 301)
    return max(float(np.max(np.abs(run.energy(times)))), abs(run.ledger.work_of_loads), run.ledger.friction)


def assert_balanced(run, share=1e-12):
    assert run.status == "ok"
    assert abs(run.ledger.residual) <= share * largest_energy(run)
    assert run.ledger.friction >= 0


class TestFreeDecay:
    """m 1, k 4, F .1 from x0 .33: seven half cycles of pi/2, 2 F/k shorter each, then rest at .02."""

    def run(self):
        return mp.simulate(block(mp.Friction("floor", "m", 0.1)), 20.0, displacement=[0.33])

    def test_the_force_is_the_limit_against_the_motion_and_then_what_the_spring_asks_for(self):
        run, half = self.run(), math.pi / 2
        turning = np.array([-0.1, 0.1] * 3 + [-0.1])
        assert_allclose(run.friction_force("floor", half * (np.arange(7) + 0.5)), turning, rtol=1e-15)
        assert run.friction_force("floor", 15.0) == pytest.approx(-4 * 0.02, abs=1e-15)
        assert run.friction_force("floor", half, side="left") == pytest.approx(-0.1, rel=1e-15)
        assert run.friction_force("floor", half, side="right") == pytest.approx(0.1, rel=1e-15)

    def test_slips_as_far_as_the_block_moves_and_not_by_a_bit_at_rest(self):
        run = self.run()
        t = np.linspace(0, 20, 101)
        assert_allclose(run.slip("floor", t), run.at("m", t) - 0.33, rtol=0, atol=1e-15)
        assert run.slip("floor", 0.0) == 0.0
        assert len(set(run.slip("floor", np.linspace(11.1, 20, 50)))) == 1


def test_on_an_incline_the_acceleration_is_exact():
    """a = g (sin - mu cos), and below the angle of friction none."""
    angle, g, mass = math.radians(35.0), 9.81, 2.0
    structure = mp.LinearStructure([[mass]], [[0.0]], points={"m": 0})
    weight = mp.ConstantLoad("m", mass * g * math.sin(angle))
    for mu in (0.3, 0.69, 0.71):
        floor = mp.Friction("floor", "m", mu * mass * g * math.cos(angle))
        run = mp.simulate(mp.MultiPhiModel(structure, [floor], modes="all"), 3.0, loads=[weight])
        a = max(g * (math.sin(angle) - mu * math.cos(angle)), 0.0)
        assert run.at("m", 3.0) == pytest.approx(4.5 * a, rel=1e-14)
        assert run.slip("floor", 3.0) == pytest.approx(4.5 * a, rel=1e-14)
        assert run.ledger.friction == pytest.approx(floor.limit * 4.5 * a, rel=1e-14)
        assert_balanced(run, 1e-14)


class TestBelt:
    """A block on a belt: stick-slip of the period 2/w0 (pi - atan(d w0 / V)) + 2 d / V, d = (F_s - F) / k."""

    period = 1.3424777960769378

    @pytest.mark.parametrize("speed", [0.3, -0.3])
    def test_has_its_period(self, speed):
        run = mp.simulate(belt(speed), 12.0)
        slips = [event.time for event in run.events if event.kind == "slip"]
        assert len(slips) == 9
        assert_allclose(np.diff(slips), self.period, rtol=1e-13)
        sticks = np.diff(run.stick_intervals("belt")[1:-1], axis=1)
        assert_allclose(sticks, 2 * (3.5 - 2.0) / 25.0 / abs(speed), rtol=1e-12)
        assert_balanced(run, 1e-13)

    def test_carries_the_block_while_it_sticks(self):
        run = mp.simulate(belt(), 12.0)
        start, end = run.stick_intervals("belt")[3]
        t = np.linspace(start, end, 20, endpoint=False)
        assert_allclose(run.at("m", t), run.at("m", start) + 0.3 * (t - start), rtol=0, atol=1e-14)
        assert_allclose(run.friction_force("belt", t), -25.0 * run.at("m", t), rtol=1e-12)
        assert len(set(run.slip("belt", t))) == 1
        assert_allclose(run.slip("belt", 12.0), run.at("m", 12.0) - 0.3 * 12.0, rtol=1e-14)

    @pytest.mark.parametrize("stiffness", [math.inf, 200.0])
    def test_a_stop_motion_adds_to_its_speed(self, stiffness):
        """Two thirds of the speed as a stop motion, with a shaking belt: the same as all of it in one motion."""
        shaking = mp.Harmonic(0.01, 0.9, 0.3)
        given = [mp.StopMotion("belt", shaking), mp.StopMotion("belt", mp.Smooth(lambda t: 0.2 * t))]
        one = mp.simulate(belt(0.1, stiffness=stiffness), 6.0, loads=given)
        both = mp.Smooth(lambda t: 0.3 * t + 0.01 * np.cos(2 * math.pi * 0.9 * t + 0.3))
        other = mp.simulate(belt(0.0, stiffness=stiffness), 6.0, loads=[mp.StopMotion("belt", both)])
        assert len(one.events) == len(other.events) > 2
        t = np.linspace(0, 6, 61)
        assert_allclose(one.at("m", t), other.at("m", t), rtol=0, atol=1e-7)
        for run in (one, other):
            assert_balanced(run, 1e-11)


class TestStaticLimitOfASpring:
    """A Jenkins element that lets go at 3 N and slips at 2 N: its spring drops, and its patch jumps by 1 N / k."""

    def run(self):
        ring = mp.Friction("ring", "m", 2.0, 3.0, 25.0)
        loads = [mp.ConstantLoad("m", -100.0), mp.StopMotion("shaker", mp.Harmonic(0.3, 0.7))]
        return mp.simulate(block(stop("m", 0.0, name="shaker"), ring), 3 / 0.7, displacement=[0.3], loads=loads)

    def test_jumps_where_it_lets_go(self):
        run = self.run()
        slips = [event for event in run.events if event.kind == "slip"]
        assert len(slips) > 3
        for sign, event in zip((-1, 1, -1), slips, strict=False):
            force = [run.friction_force("ring", event.time, side) for side in ("left", "right")]
            assert_allclose(force, [3.0 * sign, 2.0 * sign], rtol=1e-11)
            slip = [run.slip("ring", event.time, side) for side in ("left", "right")]
            assert slip[1] - slip[0] == pytest.approx(sign / 25.0, rel=1e-10)
            assert event.loss.friction == pytest.approx((9 - 4) / 50.0, rel=1e-10)

    def test_ledger_closes(self):
        run = self.run()
        assert_balanced(run, 1e-11)
        assert abs(run.ledger.truncation_strain) + abs(run.ledger.truncation_kinetic) < 1e-10


class TestLedger:
    """Closes to round-off, whatever moves and however many modes are kept."""

    @pytest.mark.parametrize("modes", ["all", 3])
    @pytest.mark.parametrize("seed", range(4))  # each with a damping of its own
    def test_of_random_chains_with_everything(self, seed, modes):
        n, mass, springs, dampings, random = random_structure(seed)
        damping = list(dampings.values())[seed % 4]
        structure = mp.LinearStructure(mass, springs, damping=damping, points={f"m{i}": i for i in range(n)})
        places = [f"m{i}" for i in random.permutation(n)]
        elements = [
            mp.Friction("one", places[0], 0.3, velocity=0.2),
            mp.Friction("two", {places[1]: 1.0, places[2]: -1.0}, 0.1, 0.13, stiffness=20.0),
            mp.Friction("three", places[2], 0.05, velocity=-0.1, stiffness=5.0),
            mp.UnilateralContact("stop", places[1], 0.05, 300.0),
        ]
        loads = [
            mp.HarmonicLoad(places[0], 1.0, 0.3),
            mp.ConstantLoad(places[1], -0.4),
            mp.StopMotion("two", mp.Harmonic(0.1, 0.2)),
            mp.SampledLoad(places[2], [0.0, 2.0, 2.5, 9.0], [0.0, 1.0, -1.0, 0.5]),
        ]
        model = mp.MultiPhiModel(structure, elements, modes=modes)
        run = quietly(model, 4.0, velocity=random.normal(size=n), loads=loads)
        assert len(run.events) > 1
        assert_balanced(run, 1e-11)
        half = quietly(model, 4.0, loads=loads, start=quietly(model, 2.0, velocity=random.normal(size=n), loads=loads))
        assert_balanced(half, 1e-11)
