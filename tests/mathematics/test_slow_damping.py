"""Zero-frequency modes whose damping is slow beside the time of a motion lose no digits: 1 / D is no term of theirs."""

import numpy as np
import pytest
from buffer_records import in_buffers
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from slow_mass import free_mass

from multiphi_exudyn.mathematics.response.coupled_response import modal_response
from multiphi_exudyn.mathematics.response.forced_response import particular
from multiphi_exudyn.mathematics.round_off import SLOW

RATES = [0.0, *10.0 ** np.arange(-14, 2.1, 0.5)]  # 1/s


def exactly(squares, damping, start, force, t, rate=0.0):
    """eta, eta' at t from (eta, eta'), under p exp(rate t), rate real: a Taylor series over a short time, squared."""
    r = len(squares)
    system = np.zeros((2 * r + 1, 2 * r + 1))
    system[:r, r : 2 * r] = np.eye(r)
    system[r : 2 * r, :r], system[r : 2 * r, r : 2 * r] = -np.diag(squares), -damping
    system[r : 2 * r, -1], system[-1, -1] = force, rate
    halved = max(0, int(np.ceil(np.log2(np.max(np.sum(np.abs(system * t), axis=1))))) + 2)
    step, term = np.eye(2 * r + 1, dtype=np.longdouble), np.eye(2 * r + 1, dtype=np.longdouble)
    for k in range(1, 20):
        term = term @ system * (t / 2**halved / k)
        step += term
    for _ in range(halved):
        step = step @ step
    return (step @ np.concatenate([*start, [1.0]]))[: 2 * r].astype(float)


def moved(response, start, force, t):
    return np.concatenate(response.state(response.coefficients(*start, force), t))


def assert_free_mass(rate, duration, velocity, force):
    response = modal_response(np.zeros(1), np.array([[rate]]), duration=duration)
    way, _ = free_mass(rate, duration, velocity, force)
    for t in (duration, duration / 3, duration / 100):
        found = moved(response, (np.zeros(1), np.array([velocity])), np.array([force]), t)
        expected = free_mass(rate, t, velocity, force)
        assert abs(found[0] - expected[0]) <= 1e-13 * abs(way)
        assert abs(found[1] - expected[1]) <= 1e-13 * (velocity + force * duration)


class TestFreeMass:
    @pytest.mark.parametrize("duration", [1.0, 1000.0])
    @pytest.mark.parametrize(("velocity", "force"), [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
    def test_moves_exactly_at_every_rate(self, duration, velocity, force):
        for rate in RATES:
            assert_free_mass(rate, duration, velocity, force)

    @settings(max_examples=100)
    @given(st.floats(-14, 2), st.floats(-3, 4), st.booleans())
    def test_moves_exactly_whatever_the_rate_and_the_time(self, rate, duration, forced):
        assert_free_mass(10.0**rate, 10.0**duration, 1.0, float(forced))

    def test_units_of_time_change_no_form(self):
        forms = []
        for unit in (1e-12, 1.0, 1e12):
            for share in (0.99, 1.01):
                response = modal_response(np.zeros(1), np.array([[share * SLOW / unit]]), duration=unit)
                forms.append(tuple(response.basis.powers.tolist()))
        assert len(set(forms[::2])) == len(set(forms[1::2])) == 1
        assert forms[0] != forms[1]

    def test_is_continuous_where_the_form_changes(self):
        start, force = (np.zeros(1), np.ones(1)), np.ones(1)
        damping = np.array([[SLOW]])
        slow = modal_response(np.zeros(1), damping, duration=1.0)
        fast = modal_response(np.zeros(1), damping, duration=1.0001)
        assert len(slow.basis.rates) > len(fast.basis.rates)
        assert_allclose(moved(slow, start, force, 1.0), moved(fast, start, force, 1.0), rtol=0, atol=1e-13)


class TestCoupled:
    """A dashpot that hardly moves zero-frequency modes, and couples them to the others."""

    SQUARES = np.array([2.0, 30.0, 750.0])

    def damped(self, rate, free, seed):
        row = np.random.default_rng(seed).normal(size=(free, free + len(self.SQUARES)))
        row[:, :free] *= np.sqrt(rate)
        return np.concatenate([np.zeros(free), self.SQUARES]), row.T @ row

    @pytest.mark.parametrize("forced", [False, True])
    @pytest.mark.parametrize("free", [1, 2])
    @pytest.mark.parametrize("duration", [1.0, 30.0])
    def test_moves_as_the_matrix_exponential(self, forced, free, duration):
        for seed, rate in enumerate(RATES[1:]):
            squares, damping = self.damped(rate, free, seed)
            response = modal_response(squares, damping, duration=duration)
            start, force = np.random.default_rng(seed).normal(size=(2, len(squares))), np.where(squares == 0, forced, 0)
            for t in (duration, duration / 7):
                expected = exactly(squares, damping, start, force, t)
                assert_allclose(moved(response, start, force, t), expected, atol=3e-12 * np.max(np.abs(expected)))

    @pytest.mark.parametrize("forced", [False, True])
    def test_modes_of_zero_frequency_alone(self, forced):
        """All parts are slow, and none is left beside them."""
        damping = 1e-8 * np.array([[2.0, 1.0], [1.0, 3.0]])
        response = modal_response(np.zeros(2), damping, duration=10.0)
        start, force = np.array([[0.3, -1.0], [2.0, 0.7]]), np.array([1.0, -2.0]) * forced
        expected = exactly(np.zeros(2), damping, start, force, 10.0)
        assert_allclose(moved(response, start, force, 10.0), expected, rtol=1e-14)

    def test_beside_a_mode_that_nothing_damps(self):
        squares, damping = self.damped(1e-9, 1, 5)
        squares, damping = np.insert(squares, 0, 0.0), np.pad(damping, (1, 0))
        response = modal_response(squares, damping, duration=5.0)
        start, force = np.random.default_rng(1).normal(size=(2, 5)), np.array([1.0, -2.0, 0.0, 0.0, 0.0])
        expected = exactly(squares, damping, start, force, 5.0)
        assert_allclose(moved(response, start, force, 5.0), expected, atol=1e-12)


class TestForced:
    """A start at rest under a force that varies: the particular response, and the free one that makes up for it."""

    def assert_moves(self, squares, damping, rate, horizon):
        r = len(squares)
        response, force = modal_response(squares, damping, duration=horizon), np.arange(1.0, r + 1)
        x = particular(squares, damping, response, rate, force[None].astype(complex), horizon)
        after = x[1].real / horizon if len(x) > 1 else 0.0
        c = response.coefficients(-x[0].real, -(rate * x[0].real + after))
        found = response.state(c, horizon)[0] + np.exp(rate * horizon) * np.sum(x.real, axis=0)
        expected = exactly(squares, damping, np.zeros((2, r)), force, horizon, rate)[:r]
        assert_allclose(found, expected, rtol=0, atol=3e-12 * np.max(np.abs(expected)))
        again = in_buffers(response, squares, damping, rate, force[None].astype(complex), horizon)
        assert_allclose(again.real, x.real, rtol=0, atol=1e-11 * np.max(np.abs(x)))

    @pytest.mark.parametrize("carrier", [0.0, -1e-9, -0.3, -4.0])
    @pytest.mark.parametrize("horizon", [0.5, 20.0])
    def test_moves_as_the_matrix_exponential(self, carrier, horizon):
        for rate in RATES[1:-4]:
            self.assert_moves(np.zeros(1), np.array([[rate]]), carrier, horizon)
            row = np.array([np.sqrt(rate), 0.7, -0.4])
            self.assert_moves(np.array([0.0, 2.0, 30.0]), np.outer(row, row), carrier, horizon)
