"""Measures of two histories: their values where they are known, and what they do not depend on."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from multiphi_exudyn.study import measures as metrics

TIME = np.linspace(0, 1, 101)
HISTORY = np.cos(40 * TIME)
PAIR = arrays(float, (2, 20), elements=st.floats(-1e3, 1e3).map(lambda value: round(value, 6)))


def test_nrmse_is_the_share_by_which_a_history_is_scaled():
    assert metrics.nrmse(1.03 * HISTORY, HISTORY, TIME, 1.0) == pytest.approx(0.03, rel=1e-12)


def test_nrmse_of_an_offset_is_its_size_over_the_references_own():
    shifted = np.array([3.0, 4.0]) + 1.0
    expected = math.sqrt(2) / 5
    assert metrics.nrmse(shifted, np.array([3.0, 4.0]), np.array([0.0, 1.0]), 1.0) == pytest.approx(expected)


def test_nrmse_looks_at_its_window_only_and_the_windows_end_belongs_to_it():
    spoiled = HISTORY + (TIME > 0.305)
    assert metrics.nrmse(spoiled, HISTORY, TIME, 0.3) == 0.0
    assert metrics.nrmse(spoiled, HISTORY, TIME, 0.31) > 0
    assert metrics.nrmse(HISTORY + (np.arange(101) == 30), HISTORY, TIME, 0.3) > 0


def test_nrmse_without_a_reference_signal_is_not_a_number():
    assert math.isnan(metrics.nrmse(HISTORY, np.zeros_like(HISTORY), TIME, 1.0))


def test_the_largest_difference_is_that_of_its_window():
    spoiled = HISTORY - 2e-3 * (TIME > 0.305) + 1e-3 * (np.arange(101) == 7)
    assert metrics.max_difference(spoiled, HISTORY, TIME, 0.3) == pytest.approx(1e-3)
    assert metrics.max_difference(spoiled, HISTORY, TIME, 1.0) == pytest.approx(2e-3)


@given(PAIR)
def test_running_nrmse_is_the_nrmse_of_every_window_in_which_the_reference_moves(pair):
    values, reference = pair
    time = np.arange(20.0)
    moves = np.sqrt(np.cumsum(reference**2)) > 1.001 * metrics.SMALLEST_NORM * np.linalg.norm(reference)
    expected = np.array([metrics.nrmse(values, reference, time, until) for until in time])
    found = metrics.running_nrmse(values, reference)
    np.testing.assert_allclose(found[moves], expected[moves], rtol=1e-9)
    assert np.all(np.diff(found[~moves]) >= 0)


def test_a_point_still_at_rest_does_not_end_agreement():
    moving = np.where(TIME > 0.5, HISTORY, 0.0)
    noise = moving + 1e-12 * np.sin(300 * TIME)
    assert metrics.agreement_horizon([(noise, moving)], TIME, 0.01) == 1.0
    assert metrics.agreement_horizon([(noise + 0.02 * (TIME > 0.3), moving)], TIME, 0.05) == pytest.approx(0.31)


def test_levels_held_are_those_between_the_ends_of_intervals():
    intervals = {"a": np.array([[0.0, 0.2], [0.5, 0.7]]), "b": np.array([[0.1, 0.6]]), "c": np.empty((0, 2))}
    held = metrics.level_durations(intervals, 1.0)
    assert held == pytest.approx({("a",): 0.2, ("a", "b"): 0.2, ("b",): 0.3, (): 0.3})
    assert metrics.union(intervals.values()) == pytest.approx(np.array([[0.0, 0.7]]))
    assert metrics.union([intervals["c"]]).shape == (0, 2)
    assert metrics.level_durations({}, 2.0) == {(): 2.0}


@given(PAIR, st.sampled_from([1e-3, 1e3]))
def test_units_change_no_error(pair, unit):
    time = np.arange(20.0)
    errors = [metrics.nrmse(*(scale * pair), time, 19.0) for scale in (1.0, unit)]
    np.testing.assert_allclose(*errors, rtol=1e-9)


def test_agreement_ends_where_the_error_first_exceeds_the_tolerance():
    off = np.where(TIME < 0.5, HISTORY, 2 * HISTORY)
    horizon = metrics.agreement_horizon([(off, HISTORY)], TIME, 0.05)
    before, after = (metrics.nrmse(off, HISTORY, TIME, end) for end in (horizon - 0.01, horizon))
    assert before <= 0.05 < after


def test_agreement_is_that_of_the_worst_point_and_lasts_to_the_end_without_error():
    off = np.where(TIME < 0.5, HISTORY, 2 * HISTORY)
    pairs = [(HISTORY, HISTORY), (off, HISTORY)]
    assert metrics.agreement_horizon(pairs, TIME, 0.05) == pytest.approx(0.5, abs=0.02)
    assert metrics.agreement_horizon(pairs[:1], TIME, 0.05) == 1.0


# Closed at 1, with two short openings; away for longer than a quarter of the period 2; closed again.
INTERVALS = np.array([[1.0, 1.2], [1.3, 1.4], [1.6, 1.7], [2.5, 2.6], [2.65, 2.7]])


def test_the_first_contact_phase_ends_with_the_first_long_opening():
    np.testing.assert_array_equal(metrics.first_phase(INTERVALS, 2.0), INTERVALS[:3])
    assert metrics.inner_losses(INTERVALS, 2.0) == 2


def test_a_phase_that_no_long_opening_ends_goes_on_to_the_end():
    assert metrics.inner_losses(INTERVALS, 100.0) == 4


def test_contact_measures_without_contact():
    none = np.zeros((0, 2))
    assert metrics.first_contact(none) is None
    assert metrics.inner_losses(none, 1.0) == 0
    assert metrics.closed_time(none) == 0


def test_first_contact_and_closed_time():
    assert metrics.first_contact(INTERVALS) == 1.0
    assert metrics.closed_time(INTERVALS) == pytest.approx(0.55)


def test_every_measure_has_a_label_a_unit_and_a_definition():
    assert all(metric.label and metric.unit and metric.definition.endswith(".") for metric in metrics.METRICS.values())
