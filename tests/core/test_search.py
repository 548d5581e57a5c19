"""First descents are found where dense sampling sees them, and none is found where there is none, with little work."""

import numpy as np
import pytest
from core_search import KINDS, Basis, Descent, Search, Signals, random_case
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn import _core
from multiphi_exudyn.mathematics.round_off import CLEAR, ZERO

CASES = 30  # of every kind
DENSE = 20_001  # samples of a signal in its horizon
DERIVATIVES = 7  # a signal and those that may give its sign
SIMULTANEOUS = 1e-11  # of its terms: a signal farther from zero does not fall with another
WORK = {  # samples in all cases of a kind: 1.2 times what they were when this was written
    "oscillating": 264, "decaying": 487, "growing": 370, "overdamped": 737, "polynomial": 322, "loaded": 391,
}  # fmt: skip


def test_the_remainder_of_the_cubic_is_the_least_that_holds():
    """t^4 minus its cubic on [0, 1] is t^2 (1 - t)^2; its fourth derivative is 24."""
    t = np.linspace(0, 1, 1001)
    assert_allclose(np.max(t**2 * (1 - t) ** 2), 24 * _core.CUBIC_REMAINDER, rtol=1e-15)


def values(basis, own, t):
    """Of all signals (s, k) at times (k,)."""
    return (own.coefficients @ basis.at(t).T).real + own.constants[:, None]


def round_off(basis, own, t, latest):
    """How much of every signal (s, k) at times (k,) is round-off, by itself or by what it is made of.

    Of powers of t what they are at the latest time, for which the search has its bounds. Phases have round-off too.
    """
    exponentials = np.abs(np.exp(np.multiply.outer(basis.rates.real, t)))
    phases = np.finfo(float).eps * np.multiply.outer(np.abs(basis.rates), t)
    powers = np.abs(own.coefficients) * (latest / basis.unit) ** basis.powers
    terms = powers @ ((CLEAR + 2 * phases) * exponentials) + CLEAR * np.abs(own.constants)[:, None]
    return np.maximum(terms, 0.0 if own.noise is None else own.noise[:, None])


def assert_first(basis, own, found, start, horizon):
    """No sample before the descent lies below zero; at it the signal is zero and falls, by whatever derivative."""
    t, latest = np.linspace(start, horizon if found is None else found.time, DENSE), 2 * horizon - start
    assert np.all(values(basis, own, t) >= -round_off(basis, own, t, latest))
    if found is None:
        return
    at, alone = np.array([found.time]), Signals(*(None if part is None else part[[found.signal]] for part in own))
    rows = [alone.coefficients]
    rows.append(basis.derivative(rows[0]))
    slope = float((rows[1] @ basis.at(found.time)).real[0])
    noise = float(round_off(basis, alone, at, latest)[0, 0])
    assert abs(values(basis, alone, at)[0, 0]) <= 2 * noise + abs(slope) * 1e-12 * found.time
    size = float((np.abs(rows[1]) @ np.abs(basis.at(found.time)))[0])
    assert slope < 0 or slope <= 1e-6 * size


@pytest.mark.parametrize("kind", KINDS)
def test_of_random_signals_the_first_descent_is_found_with_bounded_work(kind):
    found, taken = 0, 0
    for seed in range(CASES):
        basis, own, start, horizon = random_case(kind, seed)
        search = Search(basis, own)
        descent = search.descent(horizon, start)
        assert_first(basis, own, descent, start, horizon)
        found += descent is not None
        taken += search.samples
    assert found > 0.2 * CASES
    assert taken <= WORK[kind]


@pytest.mark.parametrize("kind", KINDS)
def test_a_signal_and_its_twin_fall_at_one_instant(kind):
    several = 0
    for seed in range(CASES):
        basis, own, start, horizon = random_case(kind, seed)
        alike, count = Signals(*(np.concatenate([part, part]) for part in own)), len(own.constants)
        search = Search(basis, alike)
        found = search.descent(horizon, start)
        if found is not None:
            together = search.simultaneous(found)
            assert {found.signal % count, found.signal % count + count} <= set(together)
            assert all((s + count) % (2 * count) in together for s in together)
            others = [s for s in together if s % count != found.signal % count]
            near = np.abs(values(basis, alike, np.array([found.time]))[:, 0])
            size = np.abs(alike.coefficients) @ np.abs(basis.at(found.time)) + np.abs(alike.constants)
            assert np.all(near[others] <= SIMULTANEOUS * size[others])
            several += 1
    assert several


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("since", [0, 1, 2])
def test_signs_are_those_of_the_first_derivative_that_is_not_round_off_of_its_terms(kind, since):
    seen = set()
    for seed in range(CASES):
        basis, own, _, _ = random_case(kind, seed)
        random = np.random.default_rng(seed)
        rows = own.coefficients * random.choice([1.0, 1e-14, 1e-30], own.coefficients.shape)
        held = np.where(random.random(len(rows)) < 0.5, -(rows @ basis.at(0.0)).real, own.constants)
        sizes = np.abs(rows) * random.uniform(1, 3)
        signs = Search(basis, Signals(rows, held)).signs(sizes, since)
        assert signs == expected_signs(basis, rows, held, sizes, since)
        seen |= set(signs)
    assert {1, -1} <= seen


def expected_signs(basis, rows, constants, sizes, since):
    """By the derivatives themselves: a power of t and all its terms are zero at once."""
    signs, growing = np.zeros(len(rows), int), Basis(np.abs(basis.rates), basis.powers, basis.unit)
    for order in range(DERIVATIVES):
        value = (rows @ basis.at(0.0)).real + (constants if order == 0 else 0.0)
        noise = ZERO * (sizes @ np.abs(basis.at(0.0)) + (np.abs(constants) if order == 0 else 0.0))
        decided = (signs == 0) & (np.abs(value) > noise) & (order >= since)
        signs[decided] = np.sign(value[decided])
        rows, sizes = basis.derivative(rows), growing.derivative(sizes)
    return signs.tolist()


def signals(*rows, constants=None):
    coefficients = np.array(rows, complex)
    return Signals(coefficients, np.zeros(len(rows)) if constants is None else np.array(constants, float))


def basis(rates, powers=None):
    return Basis(np.array(rates, complex), np.zeros(len(rates), int) if powers is None else np.array(powers))


POLYNOMIAL = basis([0, 0, 0, 0, 0], [0, 1, 2, 3, 4])  # 1, t, ..., t^4


def signs(found_basis, row, sizes=None):
    """Of one signal; sizes: of which its coefficients are the sums, by default their own."""
    return Search(found_basis, signals(row)).signs(np.abs([row if sizes is None else sizes]))


def first(found_basis, given_signals, horizon, refine=1.0):
    """Time of the first descent, None if there is none."""
    found = Search(found_basis, given_signals, refine=refine).descent(horizon)
    return None if found is None else found.time


def cosine(omega, *rest, constant=0.0, horizon=10.0):
    """First descent of constant + cos(omega t) + a few more exponentials."""
    rates, weights = zip((1j * omega, 1.0), *rest, strict=True)
    return first(basis(rates), signals(weights, constants=[constant]), horizon)


class TestFirst:
    def test_quarter_period_of_a_cosine(self):
        assert_allclose(cosine(7.0), np.pi / 14, rtol=1e-15)

    def test_of_many_signals_is_found_with_little_work_whatever_their_order(self):
        """Forty cosines that fall one after the other, the earliest of them first, last or anywhere."""
        heights = 0.02 * (1 + np.arange(40))
        alone = Search(basis([1j]), signals([1.0], constants=heights[:1]))
        earliest = alone.descent(10.0).time
        for order in (np.arange(40), np.arange(40)[::-1], np.random.default_rng(3).permutation(40)):
            search = Search(basis([1j]), signals(*np.ones((40, 1)), constants=heights[order]))
            assert search.descent(10.0) == (earliest, np.argmin(order))
            assert search.samples < 2 * alone.samples

    def test_a_signal_that_is_zero_for_ever_falls_with_no_other(self):
        both = Search(basis([1j]), signals([1.0], [0.0]))
        assert both.simultaneous(both.descent(10.0)) == [0]

    def test_none_before_the_horizon(self):
        assert cosine(1.0, horizon=1.57) is None
        assert_allclose(cosine(1.0, horizon=1.571), np.pi / 2, rtol=1e-15)

    def test_none_for_ever(self):
        assert cosine(1.0, constant=1.5, horizon=1e12) is None

    def test_no_signals(self):
        assert Search(basis([1j]), Signals(np.zeros((0, 1), complex), np.zeros(0))).descent(1.0) is None

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
        found = first(POLYNOMIAL, signals(row), 2.0)
        assert_allclose(found, size ** (1 / (4 - order)), rtol=1e-12)

    @pytest.mark.parametrize("order", [1, 2, 3])
    def test_starting_at_zero_and_falling_is_a_descent_at_once(self, order):
        row = np.zeros(5)
        row[order] = -1.0
        assert first(POLYNOMIAL, signals(row), 2.0) <= 1e-3

    @pytest.mark.parametrize("below", [0.0, 1e-16, 1e-15])
    def test_a_ball_thrown_up_from_a_hair_below_zero_falls_back(self, below):
        """The curve through zero at its start is no descent, though a search for roots might end there."""
        thrown = signals([-below, 1, -5.0, 0, 0])._replace(noise=np.array([1e-14]))
        assert_allclose(first(POLYNOMIAL, thrown, 1.0), 0.2, rtol=1e-13)

    def test_what_its_start_keeps_above_zero_is_not_sampled(self):
        """cos t + 1 / 2 up to its horizon, by value, slope and curvature; beyond it is sampled."""
        search = Search(basis([1j]), signals([1.0], constants=[0.5]))
        assert search.descent(1.2) is None
        assert search.samples == 0
        assert_allclose(search.descent(3.0).time, 2 * np.pi / 3, rtol=1e-14)
        assert search.samples > 0

    @pytest.mark.parametrize("decay", [0.0, 0.3])
    def test_what_its_drift_keeps_above_zero_is_not_sampled(self, decay):
        """10 - t + cos(50 t) exp(-decay t) falls where its drift is about one, or less if the cosine has decayed."""
        own = basis([50j - decay, 0, 0], [0, 0, 1])
        search = Search(own, signals([1.0, 4.0, -1.0], constants=[6.0]))
        found, t = search.descent(20.0).time, np.linspace(0.0, 12.0, 2_000_001)
        assert_allclose(found, t[np.argmax(10 - t + np.cos(50 * t) * np.exp(-decay * t) < 0)], atol=1e-5)
        assert search.samples < 30

    def test_a_drift_that_exceeds_all_else_up_to_the_horizon_needs_no_samples(self):
        search = Search(basis([50j, 0, 0], [0, 0, 1]), signals([1.0, 0.0, -1.0], constants=[10.0]))
        assert search.descent(8.9) is None
        assert search.samples == 0

    def test_of_many_signals_on_few_exponentials_no_drift_hides_a_fall(self):
        """1 - t^2 beside four signals that rise."""
        rows = np.zeros((5, 3))
        rows[0, 2], rows[1:, 1] = -1.0, 1.0
        assert_allclose(
            first(basis(np.zeros(3), [0, 1, 2]), signals(*rows, constants=np.ones(5)), 3.0), 1.0, rtol=1e-14
        )

    def test_a_drift_that_rises_is_judged_at_its_start(self):
        """0.5 + t + cos(50 t), soon far above zero, falls before."""
        found = first(basis([50j, 0, 0], [0, 0, 1]), signals([1.0, 0.0, 1.0], constants=[0.5]), 5.0)
        t = np.linspace(0.0, 0.1, 1_000_001)
        assert_allclose(found, t[np.argmax(0.5 + t + np.cos(50 * t) < 0)], atol=2e-7)

    @pytest.mark.parametrize("phase", [0.0, 1.0, 2.0, 4.0])
    def test_of_two_opposite_signals_each_is_found(self, phase):
        """-0.97 < cos(t + phase) + 0.3 exp(-t / 2) < 1.28: the limit that is reached first."""
        row, both = np.array([np.exp(1j * phase), 0.3]), basis([1j, -0.5])
        t = np.linspace(0.0, 10.0, 1_000_001)
        moved = np.cos(t + phase) + 0.3 * np.exp(-0.5 * t)
        outside = np.argmax((moved < -0.97) | (moved > 1.28))
        found = Search(both, signals(row, -row, constants=[0.97, 1.28])).descent(10.0)
        assert_allclose(found.time, t[outside], atol=2e-5)
        assert found.signal == (0 if moved[outside] < 0 else 1)

    @pytest.mark.parametrize("horizon", [1.0, 1e3, 1e6])
    def test_a_ball_thrown_up_falls_back(self, horizon):
        """t - t^2/2 * g: the second of its two zeros."""
        found = first(POLYNOMIAL, signals([0, 1, -5.0, 0, 0]), horizon)
        assert_allclose(found, 0.2, rtol=1e-14)

    def test_growing_oscillation(self):
        found = cosine(9.0, constant=2.0, horizon=10.0)
        assert found is None
        growing = first(basis([0.3 + 9j]), signals([1.0], constants=[2.0]), 10.0)
        t = np.linspace(0, 10, 1_000_001)
        assert_allclose(growing, t[np.argmax(2 + np.exp(0.3 * t) * np.cos(9 * t) < 0)], atol=1e-5)

    def test_earliest_of_several_signals(self):
        assert_allclose(first(basis([3j, 5j]), signals([1, 0], [0, 1]), 4.0), np.pi / 10, rtol=1e-14)

    @settings(max_examples=100)
    @given(st.integers(0, 2**31), st.integers(1, 6), st.integers(1, 3), st.sampled_from([0.0, 0.02, 1.0]))
    def test_agrees_with_dense_sampling_whatever_the_density_of_its_own_samples(self, seed, count, rows, decay):
        random = np.random.default_rng(seed)
        own = basis(1j * random.uniform(0.3, 60, count) - decay * random.random(count))
        weights = random.normal(size=(rows, count)) + 1j * random.normal(size=(rows, count))
        constants = np.abs(weights).sum(axis=1) * random.uniform(-0.2, 1.0, rows)
        given_signals = Signals(weights, constants - np.minimum(0, weights.sum(axis=1).real + constants))
        horizon = float(random.uniform(0.5, 20))
        found = Search(own, given_signals).descent(horizon)
        assert_first(own, given_signals, found, 0.0, horizon)
        for refine in (0.5, 3.0):
            other = first(own, given_signals, horizon, refine)
            assert (found is None) == (other is None)
            if found is not None:
                assert_allclose(other, found.time, rtol=1e-9, atol=1e-12)

    @settings(max_examples=60)
    @given(st.integers(0, 2**31), st.floats(1e-3, 1e3))
    def test_polynomials_agree_with_their_roots(self, seed, scale):
        row = np.random.default_rng(seed).normal(size=5) * scale ** -np.arange(5.0)
        row[0] = abs(row[0])
        roots = np.roots(row[::-1])
        real = np.sort(roots[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)].real)
        found = first(POLYNOMIAL, signals(row), 50 * scale)
        exact = [x for x in real if x <= 50 * scale][:1]  # row[0] > 0: the first simple root is a descent
        assert (found is None) == (not exact)
        if exact:
            assert_allclose(found, exact[0], rtol=1e-7)

    @pytest.mark.parametrize("refine", [1.0, 10.0])
    def test_the_last_stretch_before_the_horizon_takes_no_endless_series_of_shrinking_blocks(self, refine):
        search = Search(basis([1j, 20j]), signals([0.7, 0.699], constants=[1.3985]), refine=refine)
        assert search.descent(0.0731) is None
        assert search.samples <= 100 * refine

    def test_work_grows_with_the_horizon_and_is_none_where_the_constant_outweighs_everything(self):
        own = basis([1j, np.sqrt(7) * 1j])
        outweighed = Search(own, signals([0.7, 0.7j], constants=[1.41]))
        assert outweighed.descent(1e6) is None
        assert outweighed.samples == 0
        works = []
        for horizon in (100.0, 200.0, 400.0):
            search = Search(own, signals([0.7, 0.7], constants=[1.39999]))
            assert search.descent(horizon) is None
            works.append(search.samples)
        assert works[0] < 5000
        assert works[2] < 5 * works[0]


class TestSimultaneous:
    def test_signals_that_fall_at_one_instant_are_one_event(self):
        both = Search(basis([3j, 5j]), signals([1, 0], [2, 0], [0, 1e-3], constants=[0, 0, 1.0]))
        assert both.simultaneous(both.descent(5.0)) == [0, 1]

    def test_one_that_rises_through_zero_at_the_same_instant_has_not_fallen(self):
        crossing = Search(basis([3j]), signals([-1], [1], constants=[1.0, 0.0]))
        assert crossing.simultaneous(Descent(np.pi / 6, 1)) == [1]

    def test_the_one_that_was_found_is_always_among_them(self):
        alone = Search(basis([3j, 5j]), signals([1, 0], [0, 1], constants=[0.0, 3.0]))
        assert alone.simultaneous(Descent(np.pi / 6 + 1e-9, 0)) == [0]

    def test_two_that_fall_together_are_named_both(self):
        twice = Search(basis([3j]), signals([1], [1]))
        found = twice.descent(10.0)
        assert found.time == pytest.approx(np.pi / 6, rel=1e-15)
        assert twice.simultaneous(found) == [0, 1]


class TestWhatIsToldInTheStead:
    def test_a_search_that_would_take_for_ever_is_refused(self):
        """cos + cos of twice the rate is never below -1.125; the bounds, 2, cannot know that."""
        never = Search(basis([1e9j, 2e9j]), signals([1, 1], constants=[1.2]))
        assert never.descent(1e-7) is None
        outcome, _, _, step, left = never.first(1.0)
        assert outcome == _core.SearchOutcome.too_long
        assert 0 < step < 1e-8
        assert 0.9 < left <= 1.0

    def test_motion_that_is_not_finite(self):
        """The first overflows before it falls."""
        given = [([1e4 + 1j], [1.0], 1.0), ([1j], [np.inf], 1.0), ([1j], [np.nan], 1.0), ([1j], [1.0], np.nan)]
        for rates, weights, constant in given:
            outcome, *_ = Search(basis(rates), signals(weights, constants=[constant])).first(10.0)
            assert outcome == _core.SearchOutcome.not_finite

    @pytest.mark.parametrize("horizon", [0.5, 0.8, 5.0])
    def test_nothing_of_what_decays_below_the_smallest_number(self, horizon):
        assert first(basis([-1000.0]), signals([1.0]), horizon) is None


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
