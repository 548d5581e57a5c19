"""Modes that friction couples, by matrices without symmetry: complete, nearly defective, with zero frequencies."""

import numpy as np
import pytest
from buffer_records import in_buffers
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from multiphi_exudyn.mathematics.response.coupled_response import modal_response
from multiphi_exudyn.mathematics.response.forced_response import particular
from multiphi_exudyn.mathematics.response.motion_parts import parts_of


def exactly(squares, damping, coupling, start, force, t, rate=0.0):
    """eta, eta' at t from (eta, eta'), under p exp(rate t), rate real."""
    r = len(squares)
    system = np.zeros((2 * r + 1, 2 * r + 1))
    system[:r, r : 2 * r] = np.eye(r)
    system[r : 2 * r, :r], system[r : 2 * r, r : 2 * r] = -np.diag(squares) - coupling, -damping
    system[r : 2 * r, -1], system[-1, -1] = force, rate
    return (expm(system * t) @ np.concatenate([*start, [1.0]]))[: 2 * r]


def moved(response, start, force, t):
    c = response.coefficients(*start, force)
    return np.concatenate(response.state(c, t))


def pair(beside, square=4.0):
    """Two modes whose eigenvalues merge at omega^2 = ``square``, but for a relative distance."""
    squares = np.array([square - 1.0, square + 1.0])
    return squares, np.array([[0.0, 2.0], [-0.5 * (1 + beside), 0.0]])


class TestFree:
    @settings(max_examples=80, deadline=None)
    @given(st.integers(1, 4), st.integers(0, 2**31), st.floats(0.1, 3.0), st.booleans(), st.booleans())
    def test_equals_the_matrix_exponential(self, r, seed, size, damped, rigid):
        """Flutter, divergence, damping without symmetry; zero-frequency modes that others drive, which drive none."""
        random = np.random.default_rng(seed)
        squares = random.uniform(0.5, 20, r) * (random.random(r) > 0.3 * rigid)
        coupling, damping = size * random.normal(size=(2, r, r))
        free = squares == 0
        coupling[:, free] = 0.0
        damping = damping @ damping.T / 4 + 0.1 * damping if damped else np.zeros((r, r))
        if random.random() < 0.5:
            damping[:, free] = 0.0
        force = np.where(free, random.normal(size=r), 0.0)
        start, t = random.normal(size=(2, r)), float(random.uniform(0, 2))
        response = modal_response(squares, damping, coupling)
        exact = exactly(squares, damping, coupling, start, force, t)
        assert_allclose(moved(response, start, force, t), exact, rtol=0, atol=1e-8 * (1 + np.max(np.abs(exact))))

    @pytest.mark.parametrize("damping", [0.0, 0.3])
    @pytest.mark.parametrize("beside", [0.0, 1e-16, -1e-14, 1e-12, -1e-10, 1e-8, -1e-6, 1e-4])
    def test_nearly_coinciding_pairs_lose_no_digits(self, beside, damping):
        squares, coupling = pair(beside)
        response = modal_response(squares, damping * np.eye(2), coupling)
        assert not response.basis.pure or abs(beside) > 1e-10
        for t in (0.3, 5.0, 60.0):
            start = np.array([1.0, -0.3]), np.array([0.2, 0.5])
            exact = exactly(squares, damping * np.eye(2), coupling, start, np.zeros(2), t)
            found = moved(response, start, np.zeros(2), t)
            assert_allclose(found, exact, rtol=0, atol=2e-10 * max(1.0, np.max(np.abs(exact))))

    @pytest.mark.parametrize("scale", [2.0**-20, 1.0, 2.0**20])
    def test_units_of_time_change_nothing(self, scale):
        squares, coupling = pair(1e-12)
        response = modal_response(squares * scale**2, np.zeros((2, 2)), coupling * scale**2)
        plain = modal_response(squares, np.zeros((2, 2)), coupling)
        assert np.array_equal(response.basis.powers, plain.basis.powers)
        assert_allclose(response.basis.rates / scale, plain.basis.rates, rtol=1e-14)

    @pytest.mark.parametrize("seed", range(4))
    def test_modes_critically_damped_alike_have_powers_of_time(self, seed):
        turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        damping, squares = turn @ np.diag([4.0, 4.0, 1.0]) @ turn.T, np.full(3, 4.0)
        start = np.array([1.0, 0.2, -0.4]), np.array([0.0, 0.7, 0.1])
        response = modal_response(squares, damping)
        assert not response.basis.pure
        for t in (0.4, 3.0, 12.0):
            exact = exactly(squares, damping, np.zeros((3, 3)), start, np.zeros(3), t)
            assert_allclose(moved(response, start, np.zeros(3), t), exact, rtol=0, atol=1e-10)

    def test_three_rates_that_coincide(self):
        """A chain of three modes, each driving the next: omega three times, with one mode."""
        coupling = np.array([[0.0, 3.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
        response = modal_response(np.full(3, 9.0), np.zeros((3, 3)), coupling)
        start = np.array([1.0, 0.2, -0.4]), np.array([0.0, 0.7, 0.1])
        for t in (0.4, 3.0, 12.0):
            exact = exactly(np.full(3, 9.0), np.zeros((3, 3)), coupling, start, np.zeros(3), t)
            found = moved(response, start, np.zeros(3), t)
            assert_allclose(found, exact, rtol=0, atol=1e-9 * np.max(np.abs(exact)))


class TestForced:
    @pytest.mark.parametrize("beside", [0.0, 1e-12, 1e-7, 1e-2])
    @pytest.mark.parametrize("rate", [2j, 2.05j, -0.4 + 0.3j, 40j, 0.0])
    def test_solves_its_equation_at_resonance_too(self, beside, rate):
        squares, coupling = pair(beside)
        damping, horizon = np.zeros((2, 2)), 2.0
        response = modal_response(squares, damping, coupling)
        forces = np.array([[1.0, -0.5j], [0.3, 0.8]], complex)
        x = particular(squares, damping, response, rate, forces, horizon)
        k = np.arange(len(x))

        def differentiated(c):
            after = np.vstack([c[1:], np.zeros((1, 2))]) * (k + 1)[:, None] / horizon
            return rate * c + after

        acceleration = differentiated(differentiated(x))
        left = acceleration + x @ (np.diag(squares) + coupling).T
        for t in np.linspace(0, horizon, 5):
            powers = (t / horizon) ** k
            given = (t / horizon) ** np.arange(2) @ forces
            size = np.max(np.abs(powers @ np.abs(acceleration))) + 1
            assert_allclose(powers @ left, given, rtol=0, atol=1e-11 * size)
        found = in_buffers(response, squares, damping, rate, forces, horizon)
        if rate == 0.0:  # of a force that does not turn the real part is all
            found, x = found.real, x.real
        assert_allclose(found, x, rtol=0, atol=1e-10 * np.max(np.abs(x)))

    def test_a_driven_zero_frequency_mode_is_a_chain(self):
        squares, coupling = np.array([0.0, 9.0]), np.array([[0.0, 2.0], [0.0, 1.5]])
        response = modal_response(squares, np.zeros((2, 2)), coupling)
        forces = np.array([[1.0, 0.5]], complex)
        x = particular(squares, np.zeros((2, 2)), response, 0.7j, forces, 3.0)
        x = np.vstack([x, np.zeros((1, 2))])
        eta, velocity = x[0].real, (0.7j * x[0] + x[1] / 3.0).real
        start, t = (np.array([1.0, 0.3]), np.array([-0.2, 0.4])), 3.0
        c = response.coefficients(start[0] - eta, start[1] - velocity)
        found = response.state(c, t)[0] + (np.exp(0.7j * t) * np.sum(x, axis=0)).real
        system = np.zeros((6, 6))
        system[:2, 2:4], system[2:4, :2] = np.eye(2), -np.diag(squares) - coupling
        system[2:4, 4], system[4, 5], system[5, 4] = [1.0, 0.5], -0.7, 0.7
        exact = (expm(system * t) @ np.concatenate([*start, [1.0, 0.0]]))[:2]
        assert_allclose(found, exact, rtol=0, atol=1e-12)


def test_parts_give_back_their_matrix():
    random = np.random.default_rng(3)
    block = np.array([[0.0, 1.0, 0.3], [0.0, 0.0, 0.7], [0.0, 0.0, 0.0]]) - 0.4 * np.eye(3)
    turn = random.normal(size=(6, 6))
    system = turn @ np.block([[block, np.zeros((3, 3))], [np.zeros((3, 3)), np.diag([1.0, -2.0, 3.0])]])
    system = system @ np.linalg.inv(turn)
    parts = parts_of(system)
    again = (parts.vectors @ parts.mixing @ parts.inverse).real
    assert_allclose(again, system, rtol=0, atol=1e-9)
