"""First descents are found where dense sampling sees them, and none is found where there is none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.first_descent import Descent, DescentFinder, Signals


def signals(*rows, constants=None):
    coefficients = np.array(rows, complex)
    return Signals(coefficients, np.zeros(len(rows)) if constants is None else np.array(constants, float))


def basis(rates, powers=None):
    return Exponentials(np.array(rates, complex), np.zeros(len(rates), int) if powers is None else np.array(powers))


POLYNOMIAL = basis([0, 0, 0, 0, 0], [0, 1, 2, 3, 4])  # 1, t, ..., t^4


def signs(found_basis, row, sizes=None):
    """Of one signal; sizes: of which its coefficients are the sums, by default their own."""
    return DescentFinder(found_basis).signs(signals(row), np.abs([row if sizes is None else sizes]))


def first(finder, given_signals, horizon):
    """Time of the first descent, None if there is none."""
    found = finder.first(given_signals, horizon)
    return None if found is None else found.time


def cosine(omega, *rest, constant=0.0, horizon=10.0, refine=1.0):
    """First descent of constant + cos(omega t) + a few more exponentials."""
    rates, weights = zip((1j * omega, 1.0), *rest, strict=True)
    return first(DescentFinder(basis(rates), refine), signals(weights, constants=[constant]), horizon)


def values(found_basis, given_signals, t):
    return (given_signals.coefficients @ found_basis.at(t).T).real + given_signals.constants[:, None]


class TestFirst:
    def test_quarter_period_of_a_cosine(self):
        assert_allclose(cosine(7.0), np.pi / 14, rtol=1e-15)

    def test_of_many_signals_is_found_with_little_work_whatever_their_order(self):
        """Forty cosines that fall one after the other, the earliest of them first, last or anywhere."""
        heights = 0.02 * (1 + np.arange(40))
        alone = DescentFinder(basis([1j]))
        earliest = first(alone, signals([1.0], constants=heights[:1]), 10.0)
        for order in (np.arange(40), np.arange(40)[::-1], np.random.default_rng(3).permutation(40)):
            finder = DescentFinder(basis([1j]))
            found = finder.first(signals(*np.ones((40, 1)), constants=heights[order]), 10.0)
            assert (found.time, found.signal) == (earliest, np.argmin(order))
            assert finder.evaluations < 1.2 * alone.evaluations

    def test_a_signal_that_is_zero_for_ever_falls_with_no_other(self):
        finder, both = DescentFinder(basis([1j])), signals([1.0], [0.0])
        assert finder.simultaneous(both, finder.first(both, 10.0)) == [0]

    def test_none_before_the_horizon(self):
        assert cosine(1.0, horizon=1.57) is None
        assert_allclose(cosine(1.0, horizon=1.571), np.pi / 2, rtol=1e-15)

    def test_none_for_ever(self):
        assert cosine(1.0, constant=1.5, horizon=1e12) is None

    def test_no_signals(self):
        assert DescentFinder(basis([1j])).first(Signals(np.zeros((0, 1), complex), np.zeros(0)), 1.0) is None

    @pytest.mark.parametrize("dip", [1e-3, 1e-6, 1e-9, 1e-12])
    def test_two_crossings_a_hair_apart_are_not_stepped_over(self, dip):
        """1 - dip + cos t reaches -dip at pi: below zero for 2 sqrt(2 dip) only."""
        exact = np.pi - np.arccos(1 - dip)
        found = cosine(1.0, constant=1 - dip, horizon=100.0)
        assert_allclose(found, exact, rtol=0, atol=1e-15 / np.sqrt(dip) + 1e-14)

    @pytest.mark.parametrize("clearance", [0.0, 1e-12, 1e-9, 1e-3])
    def test_a_touch_from_above_is_no_descent(self, clearance):
        assert cosine(1.0, constant=1 + clearance, horizon=100.0) is None

    @pytest.mark.parametrize("first_lap", [1, 7, 40])
    def test_a_graze_many_periods_away(self, first_lap):
        """A beat whose minimum first falls below -1 + 1e-7 some laps later; found by dense sampling of its envelope."""
        slow = 0.5 / first_lap
        found = cosine(1.0, (1j * slow, -1e-4), constant=1.0, horizon=1e3)
        t = np.linspace(0, 1e3, 2_000_001)
        below = 1 + np.cos(t) - 1e-4 * np.cos(slow * t) < 0
        assert_allclose(found, t[np.argmax(below)], atol=5e-4)
        assert 1 + np.cos(found + 1e-6) - 1e-4 * np.cos(slow * (found + 1e-6)) < 0

    @pytest.mark.parametrize("order", [1, 2, 3])
    @pytest.mark.parametrize("size", [1.0, 0.1])
    def test_starting_at_zero_and_rising_by_any_derivative_is_no_descent(self, order, size):
        row = np.zeros(5)
        row[order], row[4] = size, -1.0
        found = first(DescentFinder(POLYNOMIAL), signals(row), 2.0)
        assert_allclose(found, size ** (1 / (4 - order)), rtol=1e-12)

    @pytest.mark.parametrize("order", [1, 2, 3])
    def test_starting_at_zero_and_falling_is_a_descent_at_once(self, order):
        row = np.zeros(5)
        row[order] = -1.0
        assert first(DescentFinder(POLYNOMIAL), signals(row), 2.0) <= 1e-3

    @pytest.mark.parametrize("horizon", [1.0, 1e3, 1e6])
    def test_a_ball_thrown_up_falls_back(self, horizon):
        """t - t^2/2 * g: the second of its two zeros."""
        found = first(DescentFinder(POLYNOMIAL), signals([0, 1, -5.0, 0, 0]), horizon)
        assert_allclose(found, 0.2, rtol=1e-14)

    def test_growing_oscillation(self):
        found = cosine(9.0, constant=2.0, horizon=10.0)
        assert found is None
        growing = first(DescentFinder(basis([0.3 + 9j])), signals([1.0], constants=[2.0]), 10.0)
        t = np.linspace(0, 10, 1_000_001)
        assert_allclose(growing, t[np.argmax(2 + np.exp(0.3 * t) * np.cos(9 * t) < 0)], atol=1e-5)

    def test_earliest_of_several_signals(self):
        finder = DescentFinder(basis([3j, 5j]))
        assert_allclose(first(finder, signals([1, 0], [0, 1]), 4.0), np.pi / 10, rtol=1e-14)

    @settings(max_examples=150)
    @given(st.integers(0, 2**31), st.integers(1, 6), st.integers(1, 3), st.sampled_from([0.0, 0.02, 1.0]))
    def test_agrees_with_dense_sampling(self, seed, count, rows, decay):
        random = np.random.default_rng(seed)
        own = basis(1j * random.uniform(0.3, 60, count) - decay * random.random(count))
        weights = random.normal(size=(rows, count)) + 1j * random.normal(size=(rows, count))
        constants = np.abs(weights).sum(axis=1) * random.uniform(-0.2, 1.0, rows)
        given_signals = Signals(weights, constants - np.minimum(0, weights.sum(axis=1).real + constants))
        horizon = float(random.uniform(0.5, 20))
        finder = DescentFinder(own)
        found = first(finder, given_signals, horizon)
        t = np.linspace(0, horizon, 40_001)
        sampled = values(own, given_signals, t)
        noise = 1e-10 * np.abs(weights).sum()
        before = t if found is None else t[t < found]
        assert np.min(sampled[:, : len(before)], initial=1.0) >= -noise  # none missed
        if found is not None:  # none invented
            at_root = values(own, given_signals, np.array([found]))[:, 0]
            slope = (own.derivative(weights) @ own.at(found)).real
            curvature = (own.derivative(own.derivative(weights)) @ own.at(found)).real
            down = (np.abs(at_root) <= noise) & ((slope < 0) | (np.abs(slope) < 1e-4 * np.abs(curvature)))
            assert np.any(down)
        for refine in (0.1, 10.0):
            other = first(DescentFinder(own, refine), given_signals, horizon)
            assert (found is None) == (other is None)
            if found is not None:
                assert_allclose(other, found, rtol=1e-9, atol=1e-12)

    @settings(max_examples=60)
    @given(st.integers(0, 2**31), st.floats(1e-3, 1e3))
    def test_polynomials_agree_with_their_roots(self, seed, scale):
        row = np.random.default_rng(seed).normal(size=5) * scale ** -np.arange(5.0)
        row[0] = abs(row[0])
        roots = np.roots(row[::-1])
        real = np.sort(roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)].real)
        found = first(DescentFinder(POLYNOMIAL), signals(row), 50 * scale)
        exact = [x for x in real if x <= 50 * scale][:1]  # row[0] > 0: the first simple root is a descent
        assert (found is None) == (not exact)
        if exact:
            assert_allclose(found, exact[0], rtol=1e-7)

    @pytest.mark.parametrize("refine", [1.0, 10.0])
    def test_the_last_stretch_before_the_horizon_takes_no_endless_series_of_shrinking_blocks(self, refine):
        finder = DescentFinder(basis([1j, 20j]), refine)
        assert first(finder, signals([0.7, 0.699], constants=[1.3985]), 0.0731) is None
        assert finder.evaluations <= 100 * refine

    def test_work_grows_with_the_horizon_and_is_none_where_the_constant_outweighs_everything(self):
        finder = DescentFinder(basis([1j, np.sqrt(7) * 1j]))
        assert first(finder, signals([0.7, 0.7j], constants=[1.41]), 1e6) is None
        assert finder.evaluations == 0
        works = []
        for horizon in (100.0, 200.0, 400.0):
            finder.evaluations = 0
            assert first(finder, signals([0.7, 0.7], constants=[1.39999]), horizon) is None
            works.append(finder.evaluations)
        assert works[0] < 5000
        assert works[2] < 5 * works[0]


class TestSimultaneous:
    def test_signals_that_fall_at_one_instant_are_one_event(self):
        finder = DescentFinder(basis([3j, 5j]))
        both = signals([1, 0], [2, 0], [0, 1e-3], constants=[0, 0, 1.0])
        assert finder.simultaneous(both, finder.first(both, 5.0)) == [0, 1]

    def test_one_that_rises_through_zero_at_the_same_instant_has_not_fallen(self):
        finder = DescentFinder(basis([3j]))
        crossing = signals([-1], [1], constants=[1.0, 0.0])
        assert finder.simultaneous(crossing, Descent(np.pi / 6, 1)) == [1]

    def test_the_one_that_was_found_is_always_among_them(self):
        finder = DescentFinder(basis([3j, 5j]))
        given_signals = signals([1, 0], [0, 1], constants=[0.0, 3.0])
        assert finder.simultaneous(given_signals, Descent(np.pi / 6 + 1e-9, 0)) == [0]


class TestMotionThatIsTooFast:
    def test_is_refused_by_name_and_not_searched_for_ever(self):
        """cos + cos of twice the rate is never below -1.125; the bounds, 2, cannot know that."""
        finder, never = DescentFinder(basis([1e9j, 2e9j])), signals([1, 1], constants=[1.2])
        assert finder.first(never, 1e-7) is None
        with pytest.raises(
            NumericalFailure, match=r"^search for the next event: got motion of up to 3.1831e\+08 Hz, .*"
        ):
            finder.first(never, 1.0)


class TestSigns:
    @pytest.mark.parametrize("order", [0, 1, 2, 3, 4])
    @pytest.mark.parametrize("sign", [1, -1])
    def test_are_those_of_the_first_derivative_that_counts(self, order, sign):
        row = np.zeros(5)
        row[order] = 1e-5 * sign
        row[order + 1 :] = -3.0 * sign
        assert signs(POLYNOMIAL, row) == [sign]

    def test_round_off_is_no_sign(self):
        own = basis([2j, 3j])
        assert signs(POLYNOMIAL, [0.0, -0.2, 0.0, 0.0, 1e30]) == [-1]  # t^4 is zero at t = 0
        assert signs(own, [1.0, -1.0 - 1e-15]) == [1]  # by its second derivative, 9 - 4
        assert signs(own, [0.0, 0.0]) == [0]

    def test_nor_is_that_of_coefficients_that_are_sums_of_larger_terms(self):
        own = basis([2j, 3j])
        assert signs(own, [0.0, -1e-16]) == [-1]
        assert signs(own, [0.0, -1e-16], sizes=[0.0, 1.0]) == [0]
        assert signs(own, [0.1, -0.1 - 1e-16], sizes=[1.0, 1.0]) == [1]
