"""Loads and courses: where they act, how they go with time, and what a file or a function may not give."""

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

from multiphi_exudyn import (
    ConstantLoad,
    FunctionLoad,
    Gravity,
    Harmonic,
    HarmonicLoad,
    MultiPhiError,
    Sampled,
    SampledLoad,
    Smooth,
    Sweep,
    SweepLoad,
)

T = np.linspace(0, 2, 10_001)[:-1]


class TestCourses:
    def test_a_harmonic_is_a_cosine(self):
        course = Harmonic(3.0, 5.0, 0.4)
        assert_allclose(course.history(2.0).at(T), 3 * np.cos(2 * math.pi * 5 * T + 0.4), rtol=0, atol=1e-12)

    def test_a_frequency_of_zero_is_a_constant(self):
        assert_allclose(Harmonic(3.0, 0.0, 1.0).history(2.0).at(T), 3 * math.cos(1.0), rtol=1e-15)

    def test_samples_are_joined_by_straight_lines_and_zero_outside(self):
        course = Sampled([0.5, 1.0, 1.5], [1.0, 3.0, -1.0])
        inside = (T >= 0.5) & (T < 1.5)
        expected = np.where(inside, np.interp(T, [0.5, 1.0, 1.5], [1.0, 3.0, -1.0]), 0.0)
        assert_allclose(course.history(2.0).at(T), expected, rtol=0, atol=1e-14)

    def test_samples_are_a_copy_that_nobody_can_change(self):
        time = np.array([0.0, 1.0])
        course = Sampled(time, [1.0, 2.0])
        time[0] = 7.0
        assert course.time[0] == 0.0
        with pytest.raises(ValueError, match="read-only"):
            course.time[0] = 3.0

    @pytest.mark.parametrize("function", [np.sin, math.sin, lambda t: math.exp(-t) if t >= 0 else 1.0])
    @pytest.mark.parametrize("tolerance", [1e-6, 1e-10])
    def test_functions_of_one_time_serve_as_well_as_those_of_many(self, function, tolerance):
        found = Smooth(function, tolerance).history(2.0).at(T)
        expected = np.array([function(t) for t in T.tolist()])
        assert np.max(np.abs(found - expected)) <= tolerance * np.max(np.abs(expected)) + 1e-14

    @pytest.mark.parametrize("value", [2.0, 0.0, -1])
    def test_a_function_that_gives_one_number_is_a_constant(self, value):
        assert_allclose(Smooth(lambda t: value).history(2.0).at(T), value, rtol=0, atol=1e-14)

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

    def test_a_run_shorter_than_the_sweep_takes_its_beginning(self):
        sweep = Sweep(1.0, 5.0, 50.0, 10.0)
        history = sweep.history(2.0)
        assert history.breaks[-1] == 2.0
        assert_allclose(history.at(T), np.cos(sweep.phase(T)), rtol=0, atol=2e-9)


class TestLoads:
    @pytest.mark.parametrize("given", [9.81, np.float64(9.81), 3])
    def test_gravity_without_a_direction_is_refused_where_it_is_made(self, refused, given):
        refused(TypeError, f"gravity direction: got {given!r}, need a row (n,): 1 at every", Gravity, given)

    def test_static_rows(self):
        structure = chain(3, mass=2.0)
        assert ConstantLoad("m1", 3.0).row(structure).tolist() == [0, 3, 0]
        assert ConstantLoad({"m0": 1.0, "m2": -2.0}, 3.0).row(structure).tolist() == [3, 0, -6]
        assert Gravity(np.ones(3), -9.81).row(structure).tolist() == pytest.approx([-19.62] * 3)

    def test_every_varying_load_has_its_course(self):
        assert HarmonicLoad("m0", 2.0, 3.0, 0.1).course == Harmonic(2.0, 3.0, 0.1)
        assert SweepLoad("m0", 2.0, 1.0, 9.0, 4.0, "logarithmic").course == Sweep(2.0, 1.0, 9.0, 4.0, "logarithmic")
        assert FunctionLoad("m0", math.sin, 1e-6).course == Smooth(math.sin, 1e-6)
        assert SampledLoad("m0", [0, 1], [2, 3]).course.values.tolist() == [2.0, 3.0]


class TestFiles:
    def test_columns_of_a_csv_file(self, tmp_path):
        file = tmp_path / "force.csv"
        file.write_text("# time, force, other\n0.0, 1.0, 5\n0.5, -2.0, 6\n1.5, 0.25, 7\n")
        assert Sampled.from_csv(file).values.tolist() == [1.0, -2.0, 0.25]
        assert Sampled.from_csv(str(file), 2).values.tolist() == [5.0, 6.0, 7.0]

    @pytest.mark.parametrize(
        "content",
        [
            b"",
            b"# only a comment\n",
            b"0.0, 1.0\n0.5\n",
            b"0.0, one\n1.0, two\n",
            b"0.0\n1.0\n",
            b"0.0, 1.0\n",
            b"0.0, 1.0\n0.0, 2.0\n",
            b"0.0, nan\n1.0, 2.0\n",
            b"0.0, inf\n1.0, 2.0\n",
            b"\xff\xfe\x00\x01binary\x00",
            b"1.0, 1.0\n0.5, 2.0\n",
        ],
    )
    def test_a_file_that_holds_no_samples_is_refused_by_name(self, tmp_path, content):
        file = tmp_path / "wrong.csv"
        file.write_bytes(content)
        with pytest.raises(MultiPhiError, match="need") as caught:
            Sampled.from_csv(file)
        assert "wrong.csv" in str(caught.value)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize("column", [0, -1, 2, 1.5, "1", True, None])
    def test_a_column_that_is_not_there_is_refused(self, tmp_path, column):
        (tmp_path / "a.csv").write_text("0, 1\n1, 2\n")
        with pytest.raises(MultiPhiError, match="column"):
            Sampled.from_csv(tmp_path / "a.csv", column)

    @pytest.mark.parametrize("path", ["nowhere.csv", ".", 3, None])
    def test_no_file_is_refused(self, path):
        with pytest.raises(MultiPhiError, match="need"):
            Sampled.from_csv(path)


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

    @pytest.mark.parametrize("function", [lambda t: math.floor(10 * t), lambda t: math.fmod(7 * t, 1.0)])
    def test_jumps_are_found_in_calls_that_are_no_more_than_the_samples_and_their_search_need(self, function):
        calls = 0

        def counted(t):
            nonlocal calls
            calls += 1
            return function(t)

        history = Smooth(counted).history(1.0)
        assert_allclose(history.at(T[T < 1]), [function(t) for t in T[T < 1].tolist()], rtol=0, atol=1e-12)
        assert len(history.jump_times()) in (10, 7)
        assert calls < 25_000

    @pytest.mark.parametrize("breaks", [3.0, "0.1", [None], [math.nan], ["a"]])
    def test_breaks_that_are_no_times_are_refused(self, breaks):
        with pytest.raises(MultiPhiError, match="breaks"):
            FunctionLoad("m0", math.sin, breaks=breaks)
