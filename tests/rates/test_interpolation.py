"""Functions of time as users write them: narrow, stepped, kinked; nothing is missed, jumps are located to round-off."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose

from multiphi_exudyn import Smooth

END = 2.0
SCALES = (2.0**-40, 1.0, 2.0**40)


def places(seed, count):
    return np.random.default_rng(seed).uniform(0.01, 1.99, count)


def inner(times):
    """Those within the run, which ends where the history does."""
    return times[(times > 0) & (times < END)].tolist()


class TestNarrowFunctions:
    @pytest.mark.parametrize("width", [3e-5])
    def test_none_of_forty_pulses_is_missed_or_refused_wherever_it_is(self, width):
        for middle in places(0, 40):
            history = Smooth(lambda t, middle=middle: np.exp(-(((t - middle) / width) ** 2))).history(END)
            t = middle + width * np.linspace(-5, 5, 101)
            assert np.max(np.abs(history.at(t) - np.exp(-(((t - middle) / width) ** 2)))) < 4e-9

    def test_a_pulse_shorter_than_the_gaps_is_seen_between_its_breaks(self):
        def pulse(t):
            return np.where((t >= 0.7) & (t < 0.7 + 1e-7), 1.0, 0.0)

        assert Smooth(pulse).history(END).largest == 0
        history = Smooth(pulse, breaks=(0.7, 0.7 + 1e-7)).history(END)
        assert history.at(np.array([0.7 - 1e-8, 0.7 + 5e-8, 0.7 + 2e-7])).tolist() == pytest.approx(
            [0, 1, 0], abs=1e-15
        )


class TestJumps:
    @pytest.mark.parametrize(
        ("place", "scale"),
        [*((place, 1.0) for place in (0.1, 1 / math.pi, 1.0, 1e-5, END - 1e-5)), *((0.1, scale) for scale in SCALES)],
    )
    def test_a_step_is_located_to_round_off_and_costs_one_piece(self, place, scale):
        for function in (
            lambda t: 5 if t < place * scale else 0,
            lambda t: 5 if t <= place * scale else 0,
            lambda t: np.where(t < place * scale, np.sin(3 * t / scale), -1.0),
        ):
            history = Smooth(function).history(END * scale)
            assert np.min(np.abs(history.jump_times() - place * scale)) <= 1e-15 * END * scale
            assert history.pieces <= 66
            sides = place * scale + 2e-15 * END * scale * np.array([-1, 1])
            assert_allclose(history.at(sides), [function(t) for t in sides.tolist()], rtol=0, atol=1e-8)

    def test_a_steep_smooth_function_is_not_taken_for_a_jump(self):
        history = Smooth(lambda t: np.tanh((t - 0.7) / 1e-6)).history(END)
        t = 0.7 + 1e-6 * np.linspace(-20, 20, 401)
        assert np.max(np.abs(history.at(t) - np.tanh((t - 0.7) / 1e-6))) < 4e-9
        assert inner(history.jump_times()) == []


class TestKinks:
    @pytest.mark.parametrize(
        ("function", "kinks"),
        [
            (lambda t: min(t / 0.1, 1.0), [0.1]),
            (lambda t: np.abs(t - 1 / math.pi), [1 / math.pi]),
            (lambda t: np.abs(np.sin(30 * t)), np.arange(1, 20) * math.pi / 30),
            (lambda t: math.sin(math.pi * t / 0.01) if t < 0.01 else 0.0, [0.01]),
            (lambda t: np.maximum(t - 0.5, 0) - 2 * np.maximum(t - 1, 0), [0.5, 1.0]),
        ],
    )
    def test_are_found_and_the_slopes_on_both_sides_are_right(self, function, kinks):
        history = Smooth(function).history(END)
        assert history.pieces < 64 + 2 * len(kinks) + 10
        assert inner(history.jump_times()) == []
        assert_allclose(inner(history.derivative.jump_times(history.error)), kinks, rtol=0, atol=1e-12)
        t = np.ravel(np.array(kinks)[:, None] + [-1e-4, 1e-4])
        slopes = [(function(a + 1e-6) - function(a - 1e-6)) / 2e-6 for a in t.tolist()]
        assert_allclose(history.derivative.at(t), slopes, rtol=1e-6, atol=1e-5)
