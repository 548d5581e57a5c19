"""Exponentials: their derivatives, integrals and later starts, of motions with any damping."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad_vec

from multiphi_exudyn._core import modal_response
from multiphi_exudyn.mathematics.exponentials import exponential_integrals


def by_response(response, coefficients, t):
    values = response.basis.at(t)
    rates = response.basis.derivative(coefficients)
    return (response.shapes @ (coefficients * values)).real, (response.shapes @ (rates * values)).real


def start(r, seed=1):
    return np.random.default_rng(seed).normal(size=(2, r))


def diagonal(omega, ratios):
    return np.diag(2 * np.asarray(ratios) * omega)


OMEGA = np.array([3.0, 7.0, 11.0])
REGIMES = {
    "undamped": (OMEGA, np.zeros((3, 3))),
    "underdamped": (OMEGA, diagonal(OMEGA, [0.01, 0.2, 0.9])),
    "critical": (OMEGA, diagonal(OMEGA, [1.0, 1.0, 1.0])),
    "nearly critical": (OMEGA, diagonal(OMEGA, [1 - 1e-6, 1 + 1e-7, 1 + 4e-5])),
    "edge of nearly critical": (OMEGA, diagonal(OMEGA, [1 - 4.9e-5, 1 - 5.1e-5, 1 + 5.1e-5])),
    "overdamped": (OMEGA, diagonal(OMEGA, [1.1, 5.0, 300.0])),
    "zero frequency": (np.array([0.0, 0.0, 5.0]), np.diag([0.0, 2.0, 0.3])),
    "coupled": (OMEGA, np.array([[0.5, 0.3, 0.1], [0.3, 1.0, 0.4], [0.1, 0.4, 0.8]])),
    "coupled overdamped": (OMEGA, np.array([[90.0, 60.0, 5.0], [60.0, 80.0, 4.0], [5.0, 4.0, 70.0]])),
    "coupled zero frequency": (np.array([0.0, 4.0, 9.0]), np.array([[1.0, 0.5, 0.2], [0.5, 1.0, 0.1], [0.2, 0.1, 2]])),
    "coupled beside undamped zero frequency": (
        np.array([0.0, 4.0, 9.0]),
        np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.4], [0.0, 0.4, 2.0]]),
    ),
    "two coupled zero frequencies": (
        np.array([0.0, 0.0, 9.0]),
        np.array([[1.0, 0.5, 0.2], [0.5, 1.0, 0.1], [0.2, 0.1, 2.0]]),
    ),
}  # fmt: skip


@pytest.fixture(params=REGIMES, name="regime")
def each_regime(request):
    return REGIMES[request.param]


class TestExponentials:
    def test_derivative_twice_satisfies_the_equation(self, regime):
        omega, damping = regime
        response, force = modal_response(omega**2, damping), np.where(omega == 0, 1.7, 0.0)
        c = response.coefficients(*start(3), force)
        motion = [c, response.basis.derivative(c)]
        motion.append(response.basis.derivative(motion[1]))
        for t in (0.0, 0.3, 2.0):
            eta, rate, acceleration = ((response.shapes @ (m * response.basis.at(t))).real for m in motion)
            terms = acceleration, damping @ rate, omega**2 * eta, -force
            assert_allclose(sum(terms), 0, atol=1e-11 * max(1.0, *(np.abs(term).max() for term in terms)))

    def test_starts_again_from_a_later_instant(self, regime):
        omega, damping = regime
        response = modal_response(omega**2, damping)
        c = response.coefficients(*start(3), np.where(omega == 0, 1.7, 0.0))
        later = response.basis.shifted(c, 0.37)
        for t in (0.0, 0.4, 1.5):
            assert_allclose(by_response(response, later, t), by_response(response, c, t + 0.37), rtol=0, atol=1e-11)

    def test_integrals_equal_quadrature(self, regime):
        omega, damping = regime
        response = modal_response(omega**2, damping)
        for duration in (1e-4, 0.05, 0.9, 6.0):
            parts = np.linspace(0, duration, 9)[1:-1]
            exact, _ = quad_vec(response.basis.at, 0, duration, epsabs=1e-13, points=parts)
            assert_allclose(response.basis.integrals(duration), exact, rtol=1e-10, atol=1e-13)

    def test_evaluates_many_times_at_once(self, regime):
        (omega, damping), times = regime, np.array([0.0, 0.2, 1.0])
        basis = modal_response(omega**2, damping).basis
        together = basis.at(times)
        assert together.shape == (3, len(basis.rates))
        assert_allclose(together, [basis.at(float(t)) for t in times], rtol=1e-15)


class TestExponentialIntegrals:
    @settings(max_examples=200)
    @given(
        st.complex_numbers(max_magnitude=30, allow_nan=False).filter(lambda s: s.real < 2),
        st.integers(0, 10),
        st.floats(1e-3, 3),
        st.sampled_from([0.5, 1.0, 4.0]),
    )
    def test_equal_quadrature(self, rate, power, duration, unit):
        found = exponential_integrals(np.array([rate]), np.array([power]), duration, unit)[0] * unit**power
        nodes, weights = np.polynomial.legendre.leggauss(20)
        panels = np.linspace(0, duration, 25)
        t = (panels[:-1, None] + duration / 24 * (nodes + 1) / 2).ravel()
        values = np.tile(weights * duration / 48, 24) * t**power * np.exp(rate * t)
        assert abs(found - np.sum(values)) <= 1e-9 * np.sum(np.abs(values)) + 1e-14
