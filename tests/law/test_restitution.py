"""Restitution of rigid contacts: exact bounces, their end, shared impacts, and where the energy goes."""

import math

import numpy as np
import pytest
import scipy.integrate
from lawful import assert_lawful
from numpy.testing import assert_allclose
from small_structures import random_structure

import multiphi_exudyn as mp
from multiphi_exudyn.mechanics.time_functions import Harmonic

G = 9.81


def ball(restitution, t_end, gap=0.0, height=1.0, **options):
    """A ball of 1 kg that falls from a height above the floor."""
    structure = mp.LinearStructure([[1.0]], [[0.0]], points={"ball": 0})
    floor = mp.UnilateralContact("floor", "ball", gap, restitution=restitution)
    model = mp.MultiPhiModel(structure, [floor], modes="all")
    return mp.simulate(model, t_end, displacement=[height - gap], loads=[mp.ConstantLoad("ball", -G)], **options)


def balls(gaps, restitutions, velocity, t_end=1.0):
    """Equal free balls in a row."""
    n = len(velocity)
    structure = mp.LinearStructure(np.eye(n), np.zeros((n, n)), points={f"m{i}": i for i in range(n)})
    contacts = [
        mp.UnilateralContact(f"c{i}", {f"m{i + 1}": 1.0, f"m{i}": -1.0}, gap, restitution=e)
        for i, (gap, e) in enumerate(zip(gaps, restitutions, strict=True))
    ]
    return mp.simulate(mp.MultiPhiModel(structure, contacts, modes="all"), t_end, velocity=velocity)


class TestBouncingBall:
    @pytest.mark.parametrize(("e", "rests"), [(0.5, 1.354570922957), (0.8, 4.063712768872), (0.9, 8.578949178729)])
    def test_comes_to_rest_at_the_exact_time(self, e, rests):
        """sqrt(2 h/g) (1 + e)/(1 - e)."""
        run = ball(e, 10.0)
        assert run.status == "ok"
        intervals = run.contact_intervals("floor")
        assert intervals[-1][0] == pytest.approx(rests, abs=1e-12)
        assert intervals[-1][1] == 10.0
        assert run.contact_force("floor", 10.0) == pytest.approx(G, rel=1e-12)
        assert run.at("ball", 10.0) == pytest.approx(0.0, abs=1e-15)

    def test_strikes_at_the_exact_times_with_the_exact_speeds(self):
        run, first = ball(0.5, 1.4), math.sqrt(2 / G)
        strikes = [event for event in run.events if event.kind == "close"]
        n = np.arange(20)
        assert_allclose([s.time for s in strikes[:20]], first * (3 - 2 * 0.5**n), rtol=1e-12)
        assert_allclose([s.impulse for s in strikes[:20]], 1.5 * math.sqrt(2 * G) * 0.5**n, rtol=1e-9)
        assert_allclose([s.loss.impact for s in strikes[:20]], 0.75 * G * 0.25**n, rtol=1e-8)
        assert run.ledger.impact == pytest.approx(G, rel=1e-9)


class TestBallsInARow:
    @pytest.mark.parametrize("gap", [0.0, 0.25])
    @pytest.mark.parametrize(
        ("e", "after"), [(1.0, (-1 / 3, 2 / 3, 2 / 3)), (0.5, (0.0, 0.5, 0.5)), (0.0, (1 / 3, 1 / 3, 1 / 3))]
    )
    def test_that_touch_are_struck_in_one_impact(self, gap, e, after):
        """The first one comes from a distance, or touches: Moreau's law for all three."""
        run = balls([gap, 0.0], [e, e], [1.0, 0.0, 0.0])
        assert_allclose(run.velocity(1.0), after, atol=1e-15)
        assert run.ledger.impact == pytest.approx(0.5 - 0.5 * float(np.square(after).sum()), abs=1e-15)

    def test_driven_back_to_their_neighbour_strike_again_at_once(self):
        """A heavy ball between two light ones that come: admissible and without a gain, whatever the sequence."""
        run = balls([0.0, 0.0, 0.0], [1.0] * 3, [2.0, 0.3, 0.3, -1.0])
        after = run.velocity(1.0)
        assert np.all(np.diff(after) >= -1e-12)
        assert float(after @ after) == pytest.approx(4 + 0.18 + 1, rel=1e-13)
        assert np.sum(after) == pytest.approx(1.6, rel=1e-13)


class TestBetweenStops:
    """At the start a mass moves between two stops that both touch it: it strikes them in turn until it is at rest."""

    @staticmethod
    def struck(e_below, e_above, speed, beside=None):
        mass = np.diag([2.0, 3.0])
        stiffness = [[4.0, -1.0], [-1.0, 1.0]] if beside is not None else [[4.0, 0.0], [0.0, 1.0]]
        structure = mp.LinearStructure(mass, stiffness, points={"x": 0, "beside": 1})
        below = mp.UnilateralContact("below", {"x": 1.0}, 0.0, restitution=e_below)
        above = mp.UnilateralContact("above", {"x": -1.0}, 0.0, restitution=e_above)
        start, loads = (np.zeros(2), np.array([speed, beside or 0.0])), [mp.HarmonicLoad("x", 0.5, 3.0)]
        return mp.simulate(mp.MultiPhiModel(structure, [below, above], modes="all"), 1.0, *start, loads), loads, start

    @pytest.mark.parametrize(
        ("e_below", "e_above"), [(0.2, 0.2), (0.5, 0.5), (0.5, 1.0), (0.7, 0.7), (0.3, 0.9), (0.9, 0.9), (0.99, 0.99)]
    )
    @pytest.mark.parametrize("speed", [1.0, -1.0, 1e-5])
    @pytest.mark.parametrize("beside", [None, 0.7])
    def test_it_loses_its_energy_and_stays(self, e_below, e_above, speed, beside):
        run, loads, start = self.struck(e_below, e_above, speed, beside)
        assert run.status == "ok"
        assert_lawful(run, loads, 1e-11, start)
        times = np.linspace(0.0, 1.0, 9)
        assert_allclose(run.displacement(times)[0], 0.0, atol=1e-12)
        assert_allclose(run.velocity(times)[0], 0.0, atol=1e-12)
        assert run.ledger.impact == pytest.approx(speed**2, rel=1e-10)
        first, second = (e_above, e_below) if speed > 0 else (e_below, e_above)
        impulses = {event.contact: event.impulse for event in run.events if event.kind == "close" and event.impulse}
        struck, other = ("above", "below") if speed > 0 else ("below", "above")
        for contact, velocities in ((struck, 1 + first), (other, first * (1 + second))):
            expected, round_off = 2.0 * abs(speed) * velocities, 1e-11  # of a blow's velocities, also of those beside
            assert (1 - first * second) * impulses[contact] == pytest.approx(expected, rel=1e-10, abs=round_off)


def test_a_moving_stop_gives_its_speed_on():
    """Struck at rest by a stop that rises at s: it leaves with (1 + e) s."""
    structure = mp.LinearStructure([[2.0]], [[0.0]], points={"m": 0})
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("table", "m", 0.3, restitution=0.6)], modes="all")
    run = mp.simulate(model, 0.4, loads=[mp.StopMotion("table", Harmonic(0.5, 1.0, -math.pi / 2))])
    strike = math.asin(0.6) / (2 * math.pi)
    assert run.events[0].time == pytest.approx(strike, rel=1e-12)
    assert run.velocity(0.4)[0] == pytest.approx(1.6 * 0.5 * 2 * math.pi * 0.8, rel=1e-12)
    assert run.ledger.residual == pytest.approx(0.0, abs=1e-13)


def integrated(structure, row, gap, e, velocity, t_end):
    """Times of the strikes and the last state, by DOP853 from strike to strike."""
    mass, stiffness, n = np.asarray(structure.mass), np.asarray(structure.stiffness), len(row)
    state, t, times, push = np.concatenate([np.zeros(n), velocity]), 0.0, [], np.linalg.solve(mass, row)

    def slope(_, z):
        return np.concatenate([z[n:], -np.linalg.solve(mass, stiffness @ z[:n])])

    def reached(_, z):
        return row @ z[:n] + gap

    reached.terminal, reached.direction = True, -1.0
    while True:
        found = scipy.integrate.solve_ivp(slope, (t, t_end), state, "DOP853", events=reached, rtol=1e-12, atol=1e-14)
        t, state = found.t[-1], found.y[:, -1].copy()
        if found.status == 0:
            return times, state
        times.append(t)
        state[n:] -= push * (1 + e) * (row @ state[n:]) / (row @ push)


@pytest.mark.parametrize("seed", range(4))
def test_flexible_structures_strike_as_an_integrator_says(seed):
    n, mass, stiffness, _, random = random_structure(seed)
    structure = mp.LinearStructure(mass, stiffness, points={f"m{i}": i for i in range(n)})
    velocity, e = random.normal(size=n), 0.7
    stop = mp.UnilateralContact("stop", f"m{n - 1}", 0.05, restitution=e)
    run = mp.simulate(mp.MultiPhiModel(structure, [stop], modes="all"), 2.0, velocity=velocity)
    times, state = integrated(structure, np.eye(n)[n - 1], 0.05, e, velocity, 2.0)
    assert run.status == "ok"
    assert_allclose([event.time for event in run.events if event.kind == "close"], times, rtol=1e-9)
    assert_allclose(run.displacement(2.0), state[:n], rtol=0, atol=1e-8)
    assert run.ledger.residual == pytest.approx(0.0, abs=1e-12 * run.ledger.initial)


def test_an_elastic_contact_whose_friction_takes_a_share_of_every_bounce_comes_to_rest():
    """e = 1, h = (1, 1), h_t = (0, 1), mu = 1: it lands as fast as it slides, and leaves with 2/3."""
    body = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"x": 0, "y": 1})
    floor = mp.UnilateralContact("floor", {"x": 1.0, "y": 1.0}, 0.0, restitution=1.0, friction=1.0, tangential="y")
    weight = mp.ConstantLoad({"x": 1.0, "y": 1.0}, -5.0)
    model = mp.MultiPhiModel(body, [floor], modes="all")
    run = mp.simulate(model, 3.0, displacement=[0.5, 0.5], velocity=[0.3, 0.0], loads=[weight])
    assert run.status == "ok"
    third = [event.time for event in run.events if event.kind == "close"][2]
    leaving = np.sum(run.velocity(third, "right"))
    intervals = run.contact_intervals("floor")
    assert intervals[-1] == pytest.approx([third + 2 * leaving / (10 * (1 - 2 / 3)), 3.0], rel=1e-9)
    assert_lawful(run, [weight])
