"""Loads and courses: where they act, how they go with time, and what a file or a function may not give."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

from multiphi_exudyn import (
    ConstantLoad,
    Gravity,
    MultiPhiError,
    Sampled,
    Smooth,
    Sweep,
)

T = np.linspace(0, 2, 10_001)[:-1]


class TestCourses:
    def test_samples_are_joined_by_straight_lines_and_zero_outside(self):
        course = Sampled([0.5, 1.0, 1.5], [1.0, 3.0, -1.0])
        inside = (T >= 0.5) & (T < 1.5)
        expected = np.where(inside, np.interp(T, [0.5, 1.0, 1.5], [1.0, 3.0, -1.0]), 0.0)
        assert_allclose(course.history(2.0).at(T), expected, rtol=0, atol=1e-14)

    def test_finer_divides_the_tolerance(self):
        coarse, fine = (Smooth(lambda t: np.sin(300 * t), 1e-3).history(2.0, finer) for finer in (1.0, 1e6))
        errors = [np.max(np.abs(history.at(T) - np.sin(300 * T))) for history in (coarse, fine)]
        assert errors[1] < 1e-8
        assert coarse.pieces < fine.pieces

    @pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-10])
    @pytest.mark.parametrize("law", ["linear", "logarithmic"])
    @pytest.mark.parametrize(("start", "end"), [(1.0, 200.0), (200.0, 1.0), (7.0, 7.0), (7.0, 7.0000001)])
    def test_a_sweep_is_within_its_tolerance_and_its_phase_is_the_integral_of_its_frequency(
        self, law, start, end, tolerance
    ):
        sweep = Sweep(2.0, start, end, 1.5, law, tolerance)
        inside = T[T < 1.5]
        found = sweep.history(2.0).at(T)
        assert np.max(np.abs(found[: len(inside)] - 2 * np.cos(sweep.phase(inside)))) <= 2 * tolerance + 1e-12
        assert np.all(found[T >= 1.5] == 0)
        h = 1e-5
        rate = (sweep.phase(inside + h) - sweep.phase(inside - h)) / (2 * h)
        assert_allclose(rate, 2 * math.pi * sweep.frequency(inside), rtol=1e-6)
        assert_allclose(sweep.frequency(np.array([0.0, 1.5])), [start, end], rtol=1e-12)


class TestLoads:
    def test_static_rows(self):
        structure = chain(3, mass=2.0)
        assert ConstantLoad("m1", 3.0).row(structure).tolist() == [0, 3, 0]
        assert ConstantLoad({"m0": 1.0, "m2": -2.0}, 3.0).row(structure).tolist() == [3, 0, -6]
        assert Gravity(np.ones(3), -9.81).row(structure).tolist() == pytest.approx([-19.62] * 3)


class TestFiles:
    def test_columns_of_a_csv_file(self, tmp_path):
        file = tmp_path / "force.csv"
        file.write_text("# time, force, other\n0.0, 1.0, 5\n0.5, -2.0, 6\n1.5, 0.25, 7\n")
        assert Sampled.from_csv(file).values.tolist() == [1.0, -2.0, 0.25]
        assert Sampled.from_csv(str(file), 2).values.tolist() == [5.0, 6.0, 7.0]


class TestFunctions:
    @pytest.mark.parametrize(
        "function",
        [
            lambda t: 1 / t,
            lambda t: "a",
            lambda t: None,
            lambda t: 1j * t,
            lambda t: math.nan,
            lambda t: [t, t],
            lambda t, s: t,
            lambda: 1.0,
            lambda t: math.sqrt(t - 1),
            lambda t: {}[t],
        ],
    )
    def test_what_gives_no_number_is_refused_with_the_time(self, function):
        with np.errstate(all="ignore"), pytest.raises(MultiPhiError) as caught:
            Smooth(function).history(1.0)
        assert str(caught.value).startswith("function: ")
        assert "\n" not in str(caught.value)
