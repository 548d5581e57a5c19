"""The closed form of the modal equations equals the matrix exponential, whatever couples the modes."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from long_exponential import long_expm
from numpy.testing import assert_allclose
from scipy.linalg import expm
from slow_mass import free_mass

from multiphi_exudyn import NumericalFailure, _core
from multiphi_exudyn.mathematics.round_off import SLOW


def exactly(squares, damping, start, force, t, coupling=0.0, exponential=expm):
    """(eta, eta') at t: the matrix exponential of the first-order system, the constant force as one more state."""
    r = len(squares)
    system = np.zeros((2 * r + 1, 2 * r + 1))
    system[:r, r : 2 * r] = np.eye(r)
    system[r : 2 * r, :r], system[r : 2 * r, r : 2 * r] = -np.diag(squares) - coupling, -damping
    system[r : 2 * r, -1] = 0.0 if force is None else force
    return (exponential(system * t) @ np.concatenate([*start, [1.0]]))[: 2 * r]


def moved(response, start, force, t):
    return np.concatenate(response.state(response.coefficients(*start, force), t))


def starting(r, seed=1):
    return np.random.default_rng(seed).normal(size=(2, r))


def diagonal(omega, ratios):
    return np.diag(2 * np.asarray(ratios) * omega)


def pair(beside, square=4.0):
    """Two modes whose eigenvalues merge at omega^2 = ``square``, but for a relative distance."""
    return np.array([square - 1.0, square + 1.0]), np.array([[0.0, 2.0], [-0.5 * (1 + beside), 0.0]])


def chain(seed, r, ratio):
    """omega^2 of modes apart from each other, and a damping of about that ratio, semidefinite."""
    random = np.random.default_rng(seed)
    omega = np.cumsum(random.uniform(0.7, 1.3, r))
    root = random.normal(size=(r, r)) / r**0.5
    return omega**2, 2 * ratio * omega[0] * root @ root.T + np.diag(ratio * omega)


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
}


class TestModalResponse:
    @pytest.mark.parametrize("regime", REGIMES)
    def test_equals_the_matrix_exponential(self, regime):
        (omega, damping), start = REGIMES[regime], starting(3)
        force = np.where(omega == 0, 1.7, 0.0)
        response = _core.modal_response(omega**2, damping)
        for given_force, t in itertools.product((None, force), (0.0, 1e-6, 0.05, 0.7, 3.0)):
            exact = exactly(omega**2, damping, start, given_force, t)
            assert_allclose(moved(response, start, given_force, t), exact, rtol=0, atol=3e-11)

    @pytest.mark.parametrize("regime", REGIMES)
    def test_the_basis_and_the_shapes_give_its_motion(self, regime):
        omega, damping = REGIMES[regime]
        response = _core.modal_response(omega**2, damping)
        basis, c = response.basis, response.coefficients(*starting(3))
        for t in (0.0, 0.3, 2.0):
            found = [(response.shapes @ (rows * basis.at(t))).real for rows in (c, basis.derivative(c))]
            assert_allclose(found, response.state(c, t), rtol=0, atol=1e-12)

    @pytest.mark.parametrize("seed", range(6))
    def test_a_slow_start_beside_a_fast_mode_is_met_to_its_own_round_off(self, seed):
        """What an eigenvalue solver leaves, round-off of the fastest rate, would be 1e-10 of this velocity."""
        random, omega = np.random.default_rng(seed), np.array([1.0, 1.5, 5.0, 14.0, 6e4])
        root = random.normal(size=(5, 5))
        response = _core.modal_response(omega**2, 3 * root @ root.T)
        displacement, velocity = 17 * random.normal(size=5) / omega, random.normal(size=5)
        reached = response.state(response.coefficients(displacement, velocity), 0.0)
        assert_allclose(reached[0], displacement, atol=2e-14)
        assert_allclose(reached[1], velocity, atol=2e-14)

    def test_round_off_beside_the_diagonal_is_no_coupling(self):
        damping = np.diag([1.0, 2.0, 3.0])
        damping[0, 1] = damping[1, 0] = 1e-15
        assert _core.modal_response(OMEGA**2, damping).alone.all()
        damping[0, 1] = damping[1, 0] = 1e-6
        assert not _core.modal_response(OMEGA**2, damping).alone.any()

    def test_an_exponential_of_one_mode_reaches_that_mode_only(self):
        squares = np.array([0.0, 1.0, 1.0001, 25.0, -4.0, 9e4])
        response = _core.modal_response(squares, np.diag([0.0, 0.0, 0.02, 10.0, 1.0, 3.0]))
        modes = np.argmax(response.shapes, axis=0)
        assert response.reached == [(mode, mode + 1) for mode in modes]

    @pytest.mark.parametrize("seed", range(6))
    def test_defective_coupled_damping_is_accurate_or_a_failure_never_wrong(self, seed):
        """Two equal modes critically damped, their damping turned: double roots with one eigenvector."""
        squares, turn = np.full(3, 4.0), np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        damping = turn @ np.diag([4.0, 4.0, 1.0]) @ turn.T
        try:
            response = _core.modal_response(squares, damping)
        except NumericalFailure:
            return
        exact = exactly(squares, damping, starting(3), None, 0.6)
        assert_allclose(moved(response, starting(3), None, 0.6), exact, rtol=0, atol=2e-8)

    @settings(max_examples=60)
    @given(st.integers(1, 4), st.integers(0, 2**31), st.floats(0.3, 3.0), st.booleans())
    def test_equals_the_matrix_exponential_for_random_damping(self, r, seed, size, coupled):
        random = np.random.default_rng(seed)
        squares = (random.uniform(0.5, 20, r) * (random.random(r) > 0.2)) ** 2
        root = random.normal(size=(r, r)) * size
        damping = root @ root.T if coupled else np.diag(np.diagonal(root @ root.T))
        start, force = random.normal(size=(2, r)), np.where(squares == 0, random.normal(size=r), 0.0)
        try:
            response = _core.modal_response(squares, damping)
        except NumericalFailure:
            assert coupled
            return
        t = float(random.uniform(0, 2))
        exact = exactly(squares, damping, start, force, t)
        assert_allclose(moved(response, start, force, t), exact, rtol=1e-7, atol=1e-7)

    @pytest.mark.parametrize("damping", [np.full((2, 2), np.nan), np.diag([np.inf, 0.0])])
    def test_damping_that_is_not_finite_is_a_failure_with_its_cause(self, damping):
        with pytest.raises(NumericalFailure, match="damping of a level is not finite"):
            _core.modal_response(np.array([1.0, 4.0]), damping)

    def test_friction_that_cancels_a_stiffness_is_a_failure_with_its_cause(self):
        squares, coupling = np.array([0.0, 4.0]), np.array([[0.0, 1.0], [0.0, -4.0]])
        with pytest.raises(NumericalFailure, match="friction cancels the stiffness"):
            _core.modal_response(squares, np.zeros((2, 2)), coupling)

    def test_arrays_that_do_not_fit_are_refused(self):
        with pytest.raises(ValueError, match=r"damping: got shape \(2, 2\), need \(3, 3\)"):
            _core.modal_response(np.ones(3), np.eye(2))
        with pytest.raises(ValueError, match="velocity"):
            _core.modal_response(np.ones(2), np.eye(2)).coefficients(np.ones(2), np.ones(3))


class TestLightDamping:
    @given(st.integers(0, 2**31), st.integers(1, 8), st.floats(0, 0.03), st.floats(0, 5))
    def test_equals_the_matrix_exponential(self, seed, r, ratio, t):
        squares, damping = chain(seed, r, ratio)
        response = _core.lightly_damped_response(squares, damping)
        if response is None:
            return
        exact = exactly(squares, damping, starting(r, seed), None, t)
        assert_allclose(moved(response, starting(r, seed), None, t), exact, rtol=0, atol=1e-12 * r**2)

    @pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1e-2])
    def test_is_taken_where_damping_is_light(self, ratio):
        squares, damping = chain(1, 12, ratio)
        response = _core.modal_response(squares, damping)
        assert not response.alone.any()
        assert np.array_equal(response.shapes.diagonal(), np.ones(12))
        left = squares[:, None] * response.shapes + damping @ response.shapes * response.basis.rates
        left += response.shapes * response.basis.rates**2
        assert np.max(np.abs(left)) < 1e-13 * np.max(squares)

    def test_starts_are_their_own_to_round_off(self):
        squares, damping = chain(2, 10, 5e-3)
        response = _core.lightly_damped_response(squares, damping)
        places, speeds = response.shapes, response.shapes * response.basis.rates
        for rows, own, other in (
            (places, response.from_displacement, response.from_velocity),
            (speeds, response.from_velocity, response.from_displacement),
        ):
            assert_allclose((rows @ own).real, np.eye(10), atol=1e-14)
            assert_allclose((rows @ other).real, np.zeros((10, 10)), atol=1e-13 * np.max(squares) ** 0.5)

    def test_modes_far_apart_start_where_they_are_put(self):
        """Their vectors are known after one step; a rate from before it would start 6e-11 beside."""
        response = _core.lightly_damped_response(np.array([6.9, 1.8e8]), np.array([[0.32, 0.12], [0.12, 0.22]]))
        start = np.array([-0.75, 1.5e-8])
        c = response.from_displacement @ start
        assert_allclose((response.shapes @ c).real, start, rtol=1e-15, atol=1e-20)
        assert_allclose((response.shapes @ (c * response.basis.rates)).real, 0.0, atol=1e-15)

    @pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
    def test_units_of_time_change_nothing(self, scale):
        squares, damping = chain(3, 6, 1e-2)
        plain = _core.lightly_damped_response(squares, damping)
        scaled = _core.lightly_damped_response(squares * scale**2, damping * scale)
        assert_allclose(scaled.basis.rates, plain.basis.rates * scale, rtol=1e-15)
        assert_allclose(scaled.shapes, plain.shapes, rtol=1e-15)

    def test_what_is_not_light_is_left_to_eigenvalues(self):
        squares, damping = chain(4, 5, 5e-3)
        pairs = np.array([1.0, 1.0, 4.0, 9.0, 16.0])  # of equal frequencies any vector is one
        turned = damping.copy()
        turned[0, 1] *= 1.1
        light = _core.lightly_damped_response
        assert light(squares, damping) is not None
        assert light(pairs, damping) is None
        assert light(np.array([0.0, 1.0, 4.0, 9.0, 16.0]), damping) is None
        assert light(np.array([-1.0, 1.0, 4.0, 9.0, 16.0]), damping) is None
        assert light(squares, 100 * damping) is None
        assert light(squares, turned) is None
        assert light(squares, np.full_like(damping, np.nan)) is None


class TestCoupledModes:
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
        response = _core.modal_response(squares, damping, coupling)
        exact = exactly(squares, damping, start, force, t, coupling)
        assert_allclose(moved(response, start, force, t), exact, rtol=0, atol=1e-8 * (1 + np.max(np.abs(exact))))

    @pytest.mark.parametrize("damping", [0.0, 0.3])
    @pytest.mark.parametrize("beside", [0.0, 1e-16, -1e-14, 1e-12, -1e-10, 1e-8, -1e-6, 1e-4])
    def test_nearly_coinciding_pairs_lose_no_digits(self, beside, damping):
        squares, coupling = pair(beside)
        response = _core.modal_response(squares, damping * np.eye(2), coupling)
        assert not response.basis.pure or abs(beside) > 1e-10
        for t in (0.3, 5.0, 60.0):
            start = np.array([1.0, -0.3]), np.array([0.2, 0.5])
            exact = exactly(squares, damping * np.eye(2), start, np.zeros(2), t, coupling)
            found = moved(response, start, np.zeros(2), t)
            assert_allclose(found, exact, rtol=0, atol=2e-10 * max(1.0, np.max(np.abs(exact))))

    @pytest.mark.parametrize("scale", [2.0**-20, 1.0, 2.0**20])
    def test_units_of_time_change_nothing(self, scale):
        squares, coupling = pair(1e-12)
        response = _core.modal_response(squares * scale**2, np.zeros((2, 2)), coupling * scale**2)
        plain = _core.modal_response(squares, np.zeros((2, 2)), coupling)
        assert np.array_equal(response.basis.powers, plain.basis.powers)
        assert_allclose(response.basis.rates / scale, plain.basis.rates, rtol=1e-14)

    @pytest.mark.parametrize("seed", range(6))
    def test_modes_critically_damped_alike_have_powers_of_time(self, seed):
        turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        damping, squares = turn @ np.diag([4.0, 4.0, 1.0]) @ turn.T, np.full(3, 4.0)
        start = np.array([1.0, 0.2, -0.4]), np.array([0.0, 0.7, 0.1])
        response = _core.modal_response(squares, damping)
        assert not response.basis.pure
        for t in (0.4, 3.0, 12.0):
            exact = exactly(squares, damping, start, np.zeros(3), t)
            assert_allclose(moved(response, start, np.zeros(3), t), exact, rtol=0, atol=1e-10)

    def test_three_rates_that_coincide(self):
        """A chain of three modes, each driving the next: omega three times, with one mode."""
        coupling = np.array([[0.0, 3.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
        response = _core.modal_response(np.full(3, 9.0), np.zeros((3, 3)), coupling)
        start = np.array([1.0, 0.2, -0.4]), np.array([0.0, 0.7, 0.1])
        for t in (0.4, 3.0, 12.0):
            exact = exactly(np.full(3, 9.0), np.zeros((3, 3)), start, np.zeros(3), t, coupling)
            found = moved(response, start, np.zeros(3), t)
            assert_allclose(found, exact, rtol=0, atol=1e-9 * np.max(np.abs(exact)))

    def test_parts_give_back_their_matrix(self):
        random = np.random.default_rng(3)
        block = np.array([[0.0, 1.0, 0.3], [0.0, 0.0, 0.7], [0.0, 0.0, 0.0]]) - 0.4 * np.eye(3)
        turn = random.normal(size=(6, 6))
        system = turn @ np.block([[block, np.zeros((3, 3))], [np.zeros((3, 3)), np.diag([1.0, -2.0, 3.0])]])
        system = system @ np.linalg.inv(turn)
        parts = _core.motion_parts(system)
        again = (parts.vectors @ parts.mixing @ parts.inverse).real
        assert_allclose(again, system, rtol=0, atol=1e-9)


RATES = [0.0, *10.0 ** np.arange(-14, 2.1, 0.5)]  # 1/s


def assert_free_mass(rate, duration, velocity, force):
    response = _core.modal_response(np.zeros(1), np.array([[rate]]), duration=duration)
    way, _ = free_mass(rate, duration, velocity, force)
    for t in (duration, duration / 3, duration / 100):
        found = moved(response, (np.zeros(1), np.array([velocity])), np.array([force]), t)
        expected = free_mass(rate, t, velocity, force)
        assert abs(found[0] - expected[0]) <= 1e-13 * abs(way)
        assert abs(found[1] - expected[1]) <= 1e-13 * (velocity + force * duration)


class TestSlowDamping:
    """Zero-frequency modes whose damping is slow beside the time of a motion: 1 / D is no term of theirs."""

    SQUARES = np.array([2.0, 30.0, 750.0])

    def damped(self, rate, free, seed):
        row = np.random.default_rng(seed).normal(size=(free, free + len(self.SQUARES)))
        row[:, :free] *= np.sqrt(rate)
        return np.concatenate([np.zeros(free), self.SQUARES]), row.T @ row

    @pytest.mark.parametrize("duration", [1.0, 1000.0])
    @pytest.mark.parametrize(("velocity", "force"), [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
    def test_a_free_mass_moves_exactly_at_every_rate(self, duration, velocity, force):
        for rate in RATES:
            assert_free_mass(rate, duration, velocity, force)

    @settings(max_examples=100)
    @given(st.floats(-14, 2), st.floats(-3, 4), st.booleans())
    def test_a_free_mass_moves_exactly_whatever_the_rate_and_the_time(self, rate, duration, forced):
        assert_free_mass(10.0**rate, 10.0**duration, 1.0, float(forced))

    def test_units_of_time_change_no_form(self):
        forms = []
        for unit in (1e-12, 1.0, 1e12):
            for share in (0.99, 1.01):
                response = _core.modal_response(np.zeros(1), np.array([[share * SLOW / unit]]), duration=unit)
                forms.append(tuple(response.basis.powers.tolist()))
        assert len(set(forms[::2])) == len(set(forms[1::2])) == 1
        assert forms[0] != forms[1]

    @pytest.mark.parametrize("forced", [False, True])
    @pytest.mark.parametrize("free", [1, 2])
    @pytest.mark.parametrize("duration", [1.0, 30.0])
    def test_coupled_modes_move_as_the_matrix_exponential(self, forced, free, duration):
        for seed, rate in enumerate(RATES[1:]):
            squares, damping = self.damped(rate, free, seed)
            response = _core.modal_response(squares, damping, duration=duration)
            start, force = starting(len(squares), seed), np.where(squares == 0, forced, 0)
            for t in (duration, duration / 7):
                expected = exactly(squares, damping, start, force, t, exponential=long_expm)
                assert_allclose(moved(response, start, force, t), expected, atol=3e-12 * np.max(np.abs(expected)))

    @pytest.mark.parametrize("forced", [False, True])
    def test_modes_of_zero_frequency_alone(self, forced):
        """All parts are slow, and none is left beside them."""
        damping = 1e-8 * np.array([[2.0, 1.0], [1.0, 3.0]])
        response = _core.modal_response(np.zeros(2), damping, duration=10.0)
        start, force = np.array([[0.3, -1.0], [2.0, 0.7]]), np.array([1.0, -2.0]) * forced
        expected = exactly(np.zeros(2), damping, start, force, 10.0, exponential=long_expm)
        assert_allclose(moved(response, start, force, 10.0), expected, rtol=1e-14)

    def test_beside_a_mode_that_nothing_damps(self):
        squares, damping = self.damped(1e-9, 1, 5)
        squares, damping = np.insert(squares, 0, 0.0), np.pad(damping, (1, 0))
        response = _core.modal_response(squares, damping, duration=5.0)
        start, force = starting(5), np.array([1.0, -2.0, 0.0, 0.0, 0.0])
        expected = exactly(squares, damping, start, force, 5.0, exponential=long_expm)
        assert_allclose(moved(response, start, force, 5.0), expected, atol=1e-12)
