"""The closed form of the modal equations equals the matrix exponential, whatever the damping."""

import itertools

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.integrate import quad_vec

from multiphi_exudyn import NumericalFailure
from multiphi_exudyn.mathematics.response.coupled_response import modal_response
from multiphi_exudyn.mathematics.response.exponentials import exponential_integrals


def by_matrix_exponential(omega, damping, displacement, velocity, force, t):
    """(eta, eta') at t: expm of the first-order system, the constant force as one more state."""
    r = len(omega)
    system = np.zeros((2 * r + 1, 2 * r + 1))
    system[:r, r : 2 * r] = np.eye(r)
    system[r : 2 * r, :r], system[r : 2 * r, r : 2 * r] = -np.diag(omega**2), -damping
    system[r : 2 * r, -1] = force
    reached = scipy.linalg.expm(system * t) @ np.concatenate([displacement, velocity, [1.0]])
    return reached[:r], reached[r : 2 * r]


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


class TestModalResponse:
    def test_equals_the_matrix_exponential(self, regime):
        omega, damping = regime
        displacement, velocity = start(3)
        force = np.where(omega == 0, 1.7, 0.0)
        response = modal_response(omega**2, damping)
        for given_force, t in itertools.product((None, force), (0.0, 1e-6, 0.05, 0.7, 3.0)):
            c = response.coefficients(displacement, velocity, given_force)
            exact = by_matrix_exponential(
                omega, damping, displacement, velocity, 0 if given_force is None else given_force, t
            )
            found = by_response(response, c, t)
            assert_allclose(found[0], exact[0], rtol=0, atol=3e-12)
            assert_allclose(found[1], exact[1], rtol=0, atol=3e-11)

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

    @pytest.mark.parametrize("seed", range(6))
    def test_a_slow_start_beside_a_fast_mode_is_met_to_its_own_round_off(self, seed):
        """What an eigenvalue solver leaves, round-off of the fastest rate, would be 1e-10 of this velocity."""
        random, omega = np.random.default_rng(seed), np.array([1.0, 1.5, 5.0, 14.0, 6e4])
        root = random.normal(size=(5, 5))
        response = modal_response(omega**2, 3 * root @ root.T)
        displacement, velocity = 17 * random.normal(size=5) / omega, random.normal(size=5)
        reached = response.state(response.coefficients(displacement, velocity), 0.0)
        assert_allclose(reached[0], displacement, atol=2e-14)
        assert_allclose(reached[1], velocity, atol=2e-14)

    def test_round_off_beside_the_diagonal_is_no_coupling(self):
        damping = np.diag([1.0, 2.0, 3.0])
        damping[0, 1] = damping[1, 0] = 1e-15
        assert modal_response(OMEGA**2, damping).alone.all()
        damping[0, 1] = damping[1, 0] = 1e-6
        assert not modal_response(OMEGA**2, damping).alone.any()

    @pytest.mark.parametrize("seed", range(6))
    def test_defective_coupled_damping_is_accurate_or_a_failure_never_wrong(self, seed):
        """Two equal modes critically damped, their damping turned: double roots with one eigenvector."""
        omega, r = np.full(3, 2.0), 3
        turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(r, r)))[0]
        damping = turn @ np.diag([4.0, 4.0, 1.0]) @ turn.T
        try:
            response = modal_response(omega**2, damping)
        except NumericalFailure:
            return
        c = response.coefficients(*start(r))
        exact = by_matrix_exponential(omega, damping, *start(r), 0, 0.6)
        assert_allclose(by_response(response, c, 0.6), exact, rtol=0, atol=2e-8)

    @settings(max_examples=60)
    @given(st.integers(1, 4), st.integers(0, 2**31), st.floats(0.3, 3.0), st.booleans())
    def test_equals_the_matrix_exponential_for_random_damping(self, r, seed, size, coupled):
        random = np.random.default_rng(seed)
        omega = random.uniform(0.5, 20, r) * (random.random(r) > 0.2)
        root = random.normal(size=(r, r)) * size
        damping = root @ root.T if coupled else np.diag(np.diagonal(root @ root.T))
        displacement, velocity = random.normal(size=(2, r))
        force = np.where(omega == 0, random.normal(size=r), 0.0)
        try:
            response = modal_response(omega**2, damping)
        except NumericalFailure:
            assert coupled
            return
        c = response.coefficients(displacement, velocity, force)
        t = float(random.uniform(0, 2))
        exact = by_matrix_exponential(omega, damping, displacement, velocity, force, t)
        assert_allclose(by_response(response, c, t), exact, rtol=1e-7, atol=1e-7)


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


@pytest.mark.parametrize("damping", [np.full((2, 2), np.nan), np.diag([np.inf, 0.0])])
def test_damping_that_is_not_finite_is_a_failure_with_its_cause(damping):
    with pytest.raises(NumericalFailure, match="damping of a level is not finite"):
        modal_response(np.array([1.0, 4.0]), damping)
