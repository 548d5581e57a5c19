"""Exact answers with dry friction, through the front door, and what must be the same: mirrored, coupled, many.

Source: J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction, Trans. ASME 53 (1931).
"""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, stop

import multiphi_exudyn as mp


def block(*elements, stiffness=4.0, mass=1.0):
    structure = mp.LinearStructure([[mass]], [[stiffness]], points={"m": 0})
    return mp.MultiPhiModel(structure, elements, modes="all")


def assert_balanced(run, share=1e-12):
    assert run.status == "ok"
    size = max(np.max(np.abs(run.energy(np.linspace(run.start.time, run.t_end, 101)))), abs(run.ledger.work_of_loads))
    assert abs(run.ledger.residual) <= share * size


@pytest.mark.parametrize(
    ("beta", "share", "expected"),
    [(0.7, 0.5, 1.744253936249), (0.5, 0.3, 1.333333333333), (1.5, 0.4, 0.653197264742)],
)
class TestDenHartog:
    """m x'' + k x + F sign x' = a k cos: the amplitude of slip without stops, f = F / (a k), beta = w / w_n."""

    def amplitude(self, beta, share):
        v, u = 1 / (1 - beta**2), math.sin(math.pi / beta) / (beta * (1 + math.cos(math.pi / beta)))
        return math.sqrt(v**2 - (share * u) ** 2), v, u

    def run(self, beta, share, periods, phase, start):
        model = block(mp.Friction("floor", "m", share), stiffness=1.0)
        load = mp.HarmonicLoad("m", 1.0, beta / (2 * math.pi), phase)
        return mp.simulate(model, periods * 2 * math.pi / beta, displacement=[start], loads=[load])

    def test_repeats_from_a_turning_point(self, beta, share, expected):
        """There x = x0, x' = 0, V cos(phase) = x0 and V sin(phase) = -f U."""
        x0, v, u = self.amplitude(beta, share)
        assert x0 == pytest.approx(expected, abs=1e-12)
        run = self.run(beta, share, 3, math.atan2(-share * u / v, x0 / v), x0)
        turns = run.at("m", math.pi / beta * np.arange(7))
        assert_allclose(turns, x0 * (-1.0) ** np.arange(7), rtol=1e-11)
        assert not len(run.stick_intervals("floor"))
        assert run.ledger.friction == pytest.approx(share * 4 * x0 * 3, rel=1e-11)
        assert_balanced(run)


class TestJenkins:
    """Moved by a rigid shaker as x = X cos(W t): a loop of area 4 F (X - F / k) in every period."""

    reach, limit, stiffness, hertz = 0.3, 2.0, 25.0, 0.7

    def run(self, periods, sign=1.0):
        element = mp.Friction("ring", {"m": sign}, self.limit, stiffness=self.stiffness)
        loads = [mp.ConstantLoad("m", -100.0), mp.StopMotion("shaker", mp.Harmonic(self.reach, self.hertz))]
        model = block(stop("m", 0.0, name="shaker"), element)
        return mp.simulate(model, periods / self.hertz, displacement=[self.reach], loads=loads)

    def test_area_is_what_the_ledger_has(self):
        each = 4 * self.limit * (self.reach - self.limit / self.stiffness)
        found = [self.run(periods).ledger.friction for periods in (2, 3, 7)]
        assert_allclose(np.diff(found), [each, 4 * each], rtol=1e-12)

    def test_force_and_slip_are_exact(self):
        """From x = X down: T falls along k until -F, and the patch slips 2 X - 2 F / k in a half cycle from then on."""
        run, half = self.run(3), 0.5 / self.hertz
        t = np.linspace(0, half, 41)
        x = self.reach * np.cos(2 * math.pi * self.hertz * t)
        expected = np.maximum(self.stiffness * (x - self.reach), -self.limit)
        assert_allclose(run.friction_force("ring", t, "left"), expected, rtol=0, atol=1e-11)
        assert_allclose(
            run.slip("ring", t), np.minimum(x - self.reach + self.limit / self.stiffness, 0), rtol=0, atol=1e-13
        )
        way = 2 * self.reach - 2 * self.limit / self.stiffness
        slips = run.slip("ring", half * np.arange(1, 6))
        assert_allclose(np.diff(slips), way * np.array([1, -1, 1, -1]), rtol=1e-12)


class TestHolding:
    """Below the limit nothing slips, not by a bit, for a million periods; it costs nothing to know that."""

    @pytest.mark.parametrize("stiffness", [math.inf, 200.0])
    def test_of_a_swinging_chain_lasts_a_million_periods(self, stiffness):
        structure = chain(3, stiffness=50.0, damping=mp.ModalDamping([0.02] * 3))
        model = mp.MultiPhiModel(structure, [mp.Friction("ring", "m1", 1.0, stiffness=stiffness)], modes="all")
        run = mp.simulate(model, 1e6 / 0.3, loads=[mp.HarmonicLoad("m2", 0.05, 0.3)])
        assert run.slip("ring", 1e6 / 0.3) == 0.0
        assert np.all(run.slip("ring", np.linspace(0, 1e6 / 0.3, 1001)) == 0.0)
        assert not run.events
        assert np.max(np.abs(run.at("m2", np.linspace(0, 100, 101)))) > 1e-3
        assert run.stats.function_evaluations < 1000
        assert_allclose(run.stick_intervals("ring"), [[0.0, 1e6 / 0.3]])


class TestTwoBodies:
    """A block slides on another that is free: both go on with the speed of their common momentum."""

    def run(self, limit, stiffness=math.inf, masses=(2.0, 3.0), speed=1.5):
        bodies = {
            name: mp.LinearStructure([[mass]], [[0.0]], points={"p": 0})
            for name, mass in zip("ab", masses, strict=True)
        }
        rub = mp.Friction("rub", {"a.p": 1.0, "b.p": -1.0}, limit, stiffness=stiffness)
        model = mp.MultiPhiModel(mp.assemble(bodies), [rub], modes="all")
        return mp.simulate(model, 5.0, velocity=[speed, 0.0])

    def test_stop_against_each_other_after_an_exact_time(self):
        run = self.run(0.8)
        inverse = 1 / 2.0 + 1 / 3.0
        (event,) = run.events
        assert event.time == pytest.approx(1.5 / (0.8 * inverse), rel=1e-13)
        assert_allclose(run.velocity(5.0), 2.0 * 1.5 / 5.0, rtol=1e-13)
        assert run.slip("rub", 5.0) == pytest.approx(1.5**2 / (2 * 0.8 * inverse), rel=1e-13)
        assert run.ledger.friction == pytest.approx(1.5**2 / (2 * inverse), rel=1e-13)
        assert_balanced(run)


@pytest.mark.parametrize("damping", [1e-2, 1e-4, 1e-6])
@pytest.mark.parametrize("load", [0.0, 3.0])
def test_a_block_that_hardly_any_dashpot_holds_keeps_its_digits(damping, load):
    """m x'' + c x' = P - F: x = v t (1 - z/2 + z^2/6 - ...) + (P - F) t^2 (1/2 - z/6 + ...), z = c t."""
    structure = mp.LinearStructure([[1.0]], [[0.0]], damping=[[damping]], points={"m": 0})
    model = mp.MultiPhiModel(structure, [mp.Friction("floor", "m", 2.0)], modes="all")
    run = mp.simulate(model, 0.9, velocity=[2.0], loads=[mp.ConstantLoad("m", load)])
    t = np.linspace(0, 0.9, 10)
    first, second = (sum((-damping * t) ** k / math.factorial(k + d) for k in range(9)) for d in (1, 2))
    assert_allclose(run.at("m", t), 2 * t * first + (load - 2.0) * t**2 * second, rtol=0, atol=3e-15 / damping)
    assert_balanced(run, 1e-14 / damping)
