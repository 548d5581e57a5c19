"""Histories: what is exact is exact, what is interpolated is within its tolerance, and a piece holds from anywhere."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn.mathematics.piecewise_exponential import PiecewiseExponential

T = np.linspace(0.0, 3.0, 20_011)


def of_piece(piece, s):
    """u(t + s) from the piece's own formula."""
    powers = np.asarray(s)[:, None] ** np.arange(len(piece.coefficients))
    return (np.exp(piece.rate * np.asarray(s)) * (powers @ piece.coefficients)).real


def chirp(law):
    """phase(t), omega(t) of a sweep from 3 to 200 rad/s in 3 s."""
    growth = math.log(200 / 3) / 3
    if law == "linear":
        return (lambda t: 3 * t + 197 / 6 * t**2), (lambda t: 3 + 197 / 3 * t)
    return (lambda t: 3 / growth * np.expm1(growth * t)), (lambda t: 3 * np.exp(growth * t))


def shapes():
    """One history of every kind, with the function it stands for."""
    knots, values = np.array([0.0, 0.4, 1.1, 3.0]), np.array([1.0, -2.0, 0.5, 4.0])
    phase, omega = chirp("linear")
    return {
        "constant": (PiecewiseExponential.constant(2.5), lambda t: np.full_like(t, 2.5)),
        "harmonic": (PiecewiseExponential.harmonic(2.0, 7.0, 0.3), lambda t: 2 * np.cos(7 * t + 0.3)),
        "sampled": (PiecewiseExponential.sampled(knots, values), lambda t: np.interp(t, knots, values)),
        "smooth": (
            PiecewiseExponential.smooth(lambda t: np.exp(-t) * np.sin(9 * t), 3.0, 1e-12),
            lambda t: np.exp(-t) * np.sin(9 * t),
        ),
        "modulated": (
            PiecewiseExponential.modulated(lambda t: np.full_like(t, 1.5), phase, omega, 3.0, 1e-11),
            lambda t: 1.5 * np.cos(phase(t)),
        ),
    }


KINDS = tuple(shapes())


@pytest.mark.parametrize("kind", KINDS)
class TestEveryKind:
    def test_is_the_function_it_stands_for(self, kind):
        history, function = shapes()[kind]
        inside = T[history.breaks[-1] > T]
        assert_allclose(history.at(inside), function(inside), rtol=0, atol=2e-11)

    def test_a_piece_holds_from_any_instant_in_it(self, kind):
        history, _ = shapes()[kind]
        for t in (0.0, 0.4, 0.7321, 1.1, 2.999):
            piece = history.local(t)
            s = np.linspace(0, min(piece.until - t, 1.0), 57, endpoint=False)
            assert_allclose(of_piece(piece, s), history.at(t + s), rtol=0, atol=1e-13)

    def test_the_derivative_is_the_limit_of_differences(self, kind):
        history, _ = shapes()[kind]
        h = 1e-6
        starts = history.breaks[:-1, None] + np.minimum(np.diff(history.breaks), 1.0)[:, None] * [0.2, 0.5, 0.8]
        t = starts.ravel()
        t = t[(np.diff(history.breaks).repeat(3) > 20 * h)]
        difference = (history.at(t + h) - history.at(t - h)) / (2 * h)
        assert_allclose(history.derivative.at(t), difference, rtol=0, atol=1e-5)

    def test_is_zero_before_its_first_and_after_its_last_break(self, kind):
        history, _ = shapes()[kind]
        assert history.at(np.array([-1e-9, -5.0])).tolist() == [0.0, 0.0]
        assert history.local(-2.0).until == history.breaks[0]
        assert np.all(history.local(-2.0).coefficients == 0)
        if math.isfinite(end := float(history.breaks[-1])):
            assert history.at(np.array([end, end + 1])).tolist() == [0.0, 0.0]
            assert history.local(end).until == math.inf
            assert np.all(history.local(end).coefficients == 0)


class TestExactness:
    def test_samples_are_met_to_the_last_bit(self):
        random = np.random.default_rng(1)
        time, values = np.cumsum(random.uniform(1e-6, 1, 200)), random.normal(size=200)
        history = PiecewiseExponential.sampled(time, values)
        assert np.array_equal(history.at(time[:-1]), values[:-1])


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_a_sweep_is_within_its_tolerance_everywhere(law, tolerance):
    phase, omega = chirp(law)
    history = PiecewiseExponential.modulated(lambda t: np.full_like(t, 2.0), phase, omega, 3.0, tolerance)
    t = np.linspace(0, 3, 100_003)[:-1]
    assert np.max(np.abs(history.at(t) - 2 * np.cos(phase(t)))) <= tolerance + 1e-13 * 200 * 3


def test_pieces_of_a_sweep_follow_its_change_of_frequency_not_its_frequency():
    """From 1e5 to 1.1e5 rad/s: 50000 periods on a few hundred polynomials."""
    history = PiecewiseExponential.modulated(
        np.ones_like, lambda t: 1e5 * t + 5e3 * t**2 / 3, lambda t: 1e5 + 1e4 * t / 3, 3.0, 1e-6
    )
    assert history.pieces <= 512


@settings(max_examples=20)
@given(st.integers(0, 2**31), st.sampled_from([1e-4, 1e-8, 1e-11]), st.floats(1e-6, 1e6), st.floats(1e-3, 1e4))
def test_whatever_the_smooth_function_the_tolerance_holds_between_all_points(seed, tolerance, size, end):
    random = np.random.default_rng(seed)
    a, w, p = random.normal(size=5), random.uniform(0, 200, 5) / end, random.uniform(0, 7, 5)

    def function(t):
        return (
            size
            * np.sum(a * np.cos(w * np.asarray(t)[..., None] + p), axis=-1)
            / (1 + (8 * np.asarray(t) / end - 3) ** 2)
        )

    history = PiecewiseExponential.smooth(function, end, tolerance * size)
    t = np.linspace(0, end, 30_011)[:-1]
    assert np.max(np.abs(history.at(t) - function(t))) <= 1.01 * tolerance * size + 1e-13 * size
    assert np.all(np.diff(history.breaks) > 0)
    assert (history.breaks[0], history.breaks[-1]) == (0.0, end)


class TestFailures:
    @pytest.mark.parametrize("kink", [0.3, 1 / math.pi])
    @pytest.mark.parametrize(
        "function",
        [lambda t, k: np.abs(t - k), lambda t, k: np.where(t < k, 0.0, 1.0), lambda t, k: np.sqrt(np.abs(t - k))],
    )
    def test_a_function_that_is_not_smooth_is_resolved_in_little_work(self, function, kink):
        evaluated = 0

        def counted(t):
            nonlocal evaluated
            evaluated += t.size
            return function(t, kink)

        history = PiecewiseExponential.smooth(counted, 1.0, 1e-9)
        t = np.linspace(0, 1, 10_001)[:-1]
        assert np.max(np.abs(history.at(t) - function(t, kink))[np.abs(t - kink) > 1e-9]) < 1e-8
        assert evaluated < 40_000
        assert history.pieces < 150
