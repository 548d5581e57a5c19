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


def precisely(system, start, t):
    """exp(system t) start: a Taylor series over a short time, squared, in extended precision."""
    halved = max(0, int(np.ceil(np.log2(np.max(np.sum(np.abs(system * t), axis=1))))) + 2)
    size = len(system)
    step, term = np.eye(size, dtype=np.longdouble), np.eye(size, dtype=np.longdouble)
    for k in range(1, 20):
        term = term @ system * (t / 2**halved / k)
        step += term
    for _ in range(halved):
        step = step @ step
    return (step @ start).astype(float)


def cancelled(beside, dashpot=(0.5, 1.0), stiffness=1000.0, driven=0.7):
    """A dashpot between a free mode and an elastic one, on which friction acts; another free mode that it drives.

    Friction takes the damping of the free mode away, but for a relative rest.
    """
    squares, row = np.array([0.0, 0.0, stiffness]), np.array([0.0, *dashpot])
    coupling = np.zeros((3, 3))
    coupling[:2, 2] = driven * stiffness, (1 + beside) * dashpot[0] / dashpot[1] * stiffness
    return squares, np.outer(row, row), coupling


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


RESTS = [0.0, 1e-16, -1e-15, 1e-14, -1e-12, 1e-9, -1e-6, 1e-4, -1e-2, 0.3]
DASHPOTS = [(0.5, 1.0), (-0.5, 1.0), (0.3, 0.7), (1.1, 0.1), (1e-3, 2e-3)]


class TestFrictionThatCancelsDamping:
    """A rate of (nearly) zero of a part that moves zero-frequency modes: the motion has no quotient of it."""

    @pytest.mark.parametrize("duration", [0.1, 3.0])
    @pytest.mark.parametrize("driven", [0.0, 0.7])
    @pytest.mark.parametrize("dashpot", DASHPOTS)
    @pytest.mark.parametrize("beside", RESTS)
    def test_moves_as_the_matrix_exponential(self, beside, dashpot, driven, duration):
        for stiffness in (1000.0, 90.0, 7.3):
            squares, damping, coupling = cancelled(beside, dashpot, stiffness, driven)
            response = modal_response(squares, damping, coupling, duration)
            start, force = np.array([[1.0, -0.4, 0.02], [0.3, -2.0, 1.0]]), np.array([-0.6, 0.8, 0.0])
            system = np.zeros((7, 7))
            system[:3, 3:6], system[3:6, :3] = np.eye(3), -np.diag(squares) - coupling
            system[3:6, 3:6], system[3:6, 6] = -damping, force
            for t in (duration, duration / 3):
                exact = precisely(system, np.concatenate([*start, [1.0]]), t)[:6]
                found = moved(response, start, force, t)
                assert_allclose(found, exact, rtol=0, atol=3e-11 * np.max(np.abs(exact)))

    @pytest.mark.parametrize("dashpot", DASHPOTS)
    def test_exactly_cancelled_damping_has_no_need_of_a_duration(self, dashpot):
        for stiffness in (1000.0, 90.0, 7.3):
            rates = modal_response(*cancelled(0.0, dashpot, stiffness)).basis.rates
            assert np.all((rates == 0) | (np.abs(rates) > 1e-8))

    def test_beside_modes_that_are_critically_damped_alike(self):
        """These form a cluster, and all rates come from another decomposition."""
        squares, damping, coupling = (np.pad(given, [(0, 2)] * np.ndim(given)) for given in cancelled(0.0))
        squares[3:], damping[3:, 3:], coupling[3, 4] = 4.0, 0.6 * np.eye(2), 1.0
        response = modal_response(squares, damping, coupling)
        start, t = np.array([[1.0, -0.4, 0.02, 0.1, -0.3], [0.3, -2.0, 1.0, 0.0, 0.5]]), 2.0
        exact = exactly(squares, damping, coupling, start, np.zeros(5), t)
        assert_allclose(moved(response, start, np.zeros(5), t), exact, rtol=0, atol=1e-9)

    @pytest.mark.parametrize("beside", RESTS)
    @pytest.mark.parametrize("rate", [0.0, 0.7j, 30j, -0.5 + 2j])
    def test_solves_its_equation_under_forces(self, beside, rate):
        squares, damping, coupling = cancelled(beside)
        response, horizon = modal_response(squares, damping, coupling, 2.0), 2.0
        forces = np.array([[1.0, -0.5j, 2.0], [0.3, 0.8, -1.0]], complex)
        x = particular(squares, damping, response, rate, forces, horizon)
        k = np.arange(len(x))

        def differentiated(c):
            return rate * c + np.vstack([c[1:], np.zeros((1, 3))]) * (k + 1)[:, None] / horizon

        velocity = differentiated(x)
        acceleration = differentiated(velocity)
        left = acceleration + velocity @ damping.T + x @ (np.diag(squares) + coupling).T
        size = np.max(np.abs(acceleration)) + np.max(np.abs(x)) * np.max(squares)
        for t in np.linspace(0, horizon, 5):
            given = (t / horizon) ** np.arange(2) @ forces
            powers = (t / horizon) ** k
            assert_allclose(powers @ left, given, rtol=0, atol=1e-11 * size)
        found = in_buffers(response, squares, damping, rate, forces, horizon)
        if rate == 0.0:
            found, x = found.real, x.real
        assert_allclose(found, x, rtol=0, atol=1e-10 * np.max(np.abs(x)))


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
