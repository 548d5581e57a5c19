"""Runs of bodies that nothing holds and a dashpot hardly slows down: exact, and their ledgers close to round-off."""

import numpy as np
import pytest
from lawful import complaints
from numpy.testing import assert_allclose
from slow_mass import free_mass

import multiphi_exudyn as mp
from multiphi_exudyn.study.law_check import broken_laws

RATES = [1e-14, 1e-11, 4e-8, 1e-6, 1e-4, 1e-2, 1.0, 100.0]  # 1/s
TIMES = [1.0, 1000.0]  # s


def mass(rate, contacts=()):
    """1 kg with a dashpot."""
    body = mp.LinearStructure(np.eye(1), np.zeros((1, 1)), np.array([[rate]]), {"m": 0})
    return mp.MultiPhiModel(body, contacts, modes="all")


def chain(rate, contacts=()):
    """Three masses in a row; the dashpot is on a row that the rigid-body mode hardly moves."""
    row = np.array([1.0, -1.7, 0.7]) + np.sqrt(rate / 3)
    stiffness = 50.0 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    body = mp.LinearStructure(np.eye(3), stiffness, np.outer(row, row), {"left": 0, "right": 2})
    return mp.MultiPhiModel(body, contacts, modes="all")


class TestFreeMass:
    @pytest.mark.parametrize("rate", RATES)
    @pytest.mark.parametrize("end", TIMES)
    @pytest.mark.parametrize("force", [0.0, 2.0])
    def test_moves_exactly(self, rate, end, force):
        run = mp.simulate(mass(rate), end, velocity=[1.0], loads=[mp.ConstantLoad("m", force)] if force else [])
        times = end * np.array([0.01, 0.3, 1.0])
        way, speed = np.transpose([free_mass(rate, t, 1.0, force) for t in times])
        assert_allclose(run.displacement(times)[0], way, rtol=0, atol=1e-12 * way[-1])
        assert_allclose(run.velocity(times)[0], speed, rtol=0, atol=1e-12 * (1 + force * end))
        assert abs(run.ledger.residual) <= 1e-12 * (1 + force * way[-1])

    @pytest.mark.parametrize("rate", RATES)
    @pytest.mark.parametrize("end", TIMES)
    def test_under_a_ramp_moves_exactly(self, rate, end):
        """A force t / T is the rate of what p t^2 / 2 does: eta' is the way under a constant force, 1 / T."""
        run = mp.simulate(mass(rate), end, loads=[mp.SampledLoad("m", [0.0, end], [0.0, 1.0])])
        times = end * np.array([0.01, 0.3, 0.999])
        speed = np.array([free_mass(rate, t, 0.0, 1 / end)[0] for t in times])
        assert_allclose(run.velocity(times)[0], speed, rtol=0, atol=1e-12 * speed[-1])

    @pytest.mark.parametrize("rate", RATES[:-2])
    def test_reaches_a_stop_at_the_instant(self, rate):
        stop = mp.UnilateralContact("stop", {"m": -1.0}, gap=free_mass(rate, 7.0, 1.0, 0.0)[0])
        run = mp.simulate(mass(rate, [stop]), 10.0, velocity=[1.0])
        assert abs(run.events[0].time - 7.0) <= 1e-13 * 10


class TestReaction:
    @pytest.mark.parametrize("rate", RATES)
    @pytest.mark.parametrize("parts", [(0.0, 1.0), (0.3, 0.8)])
    def test_impulse_of_a_floor_that_a_dashpot_presses_on_is_that_of_the_momentum(self, rate, parts):
        """Free masses slide on a floor y = 0, an oblique dashpot presses on it: int lambda = sum c_yi x_i."""
        row = np.array([1.0, 4.0, -10.0, 10.0])
        damping = rate / 200 * np.outer(row, row)
        body = mp.LinearStructure(np.eye(4), np.zeros((4, 4)), damping, {"y": 3})
        model = mp.MultiPhiModel(body, [mp.UnilateralContact("floor", "y", 0.0)])
        run = mp.simulate(model, 10.0, velocity=[2.0, 0.0, -1.0, 0.0])
        first, last = 10.0 * np.array(parts)
        expected = damping[3] @ (run.displacement(last) - run.displacement(first))
        assert_allclose(run.contact_impulse("floor", first, last), expected, rtol=1e-9, atol=1e-12 * damping[3, 3])
        assert broken_laws(run) == []


class TestChain:
    @pytest.mark.parametrize("rate", RATES[:-2])
    @pytest.mark.parametrize("load", ["none", "constant", "ramp", "harmonic"])
    def test_ledger_closes_and_laws_hold_from_stop_to_stop(self, rate, load):
        loads = {
            "none": [],
            "constant": [mp.ConstantLoad("right", 0.3)],
            "ramp": [mp.SampledLoad("right", [0.0, 20.0], [0.0, 0.5])],
            "harmonic": [mp.HarmonicLoad("right", 0.5, 0.4)],
        }[load]
        stops = [
            mp.UnilateralContact("right", {"right": -1.0}, gap=0.4, stiffness=800.0),
            mp.UnilateralContact("left", "left", gap=0.3),
        ]
        run = mp.simulate(chain(rate, stops), 20.0, velocity=[0.5, 0.6, 0.7], loads=loads)
        assert run.status == "ok"
        assert len(run.events) > 10
        assert abs(run.ledger.residual) < 1e-12
        assert not complaints(run, loads)
