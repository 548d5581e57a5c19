"""Exponentials: their derivatives, integrals and later starts, of motions with any damping."""

import numpy as np
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
