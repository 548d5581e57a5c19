"""Spectra: what they tell of known signals, and what they do not depend on."""

import math

import numpy as np
import pytest

from multiphi_exudyn.study.measures import FREQUENCIES, spectral_difference, wavelet_map

STEP = 1e-4


def times(length):
    return STEP * np.arange(round(length / STEP) + 1)


def sine(t, frequency, phase=0.0):
    return np.sin(2 * math.pi * frequency * t + phase)


def away(found, row=0, cones=2.0):
    """Columns further from the ends than ``cones`` times the cone of influence of a row."""
    edge = cones * found.cone[row]
    return (found.time > edge) & (found.time < found.time[0] + found.time[-1] - edge)


def test_the_spectral_difference_is_the_share_by_which_a_history_is_scaled():
    history = sine(times(1.0), 17.3)
    assert spectral_difference(1.03 * history, history, times(1.0), 1.0) == pytest.approx(0.03, rel=1e-9)


def test_the_spectral_difference_ignores_phase():
    t = times(1.0)
    assert spectral_difference(-sine(t, 40), sine(t, 40), t, 1.0) == 0.0
    assert spectral_difference(sine(t, 40, 1.0), sine(t, 40), t, 1.0) < 1e-4


def test_the_spectral_difference_of_two_frequencies_is_that_of_two_histories():
    """Two lines apart share nothing: the root of two."""
    t = times(1.0)
    assert spectral_difference(sine(t, 80), sine(t, 40), t, 1.0) == pytest.approx(math.sqrt(2), rel=1e-3)


def test_the_spectral_difference_looks_at_its_window_only():
    t = times(1.0)
    spoiled = sine(t, 40) + (t > 0.3)
    assert spectral_difference(spoiled, sine(t, 40), t, 0.3) == 0.0
    assert spectral_difference(spoiled, sine(t, 40), t, 0.4) > 0.01


def test_the_spectral_difference_without_a_reference_signal_is_not_a_number():
    assert math.isnan(spectral_difference(np.ones(11), np.zeros(11), np.linspace(0, 1, 11), 1.0))


def test_the_mean_does_not_show():
    t = times(0.5)
    history = sine(t, 40)
    np.testing.assert_allclose(wavelet_map(history + 5.0, t).amplitude, wavelet_map(history, t).amplitude, atol=1e-12)


def test_a_high_frequency_leaves_no_alias_where_the_sampling_is_low():
    """Rows of 2 Hz are transformed at 39 samples per second, of which 392.6 Hz are ten times as many and two."""
    t = times(5.0)
    assert np.max(wavelet_map(sine(t, 392.625), t, np.array([2.0])).amplitude) < 2e-3


@pytest.mark.parametrize("frequency", [7.0, 19.2, 39.0, 79.3, 156.0, 157.0, 312.0, 313.0, 500.0])
def test_a_sine_shows_its_amplitude_on_its_ridge(frequency):
    t = times(1.5)
    found = wavelet_map(0.1 + 2.5 * sine(t, frequency, 0.3), t, np.array([frequency]))
    np.testing.assert_allclose(found.amplitude[0, away(found)], 2.5, rtol=0.005)


def test_a_sine_shows_its_amplitude_at_the_highest_frequency_a_record_can_tell():
    t = 1e-3 * np.arange(1001)
    found = wavelet_map(sine(t, 250.0, 0.3), t, np.array([250.0]))
    np.testing.assert_allclose(found.amplitude[0, away(found)], 1.0, rtol=0.02)


def test_the_ridge_lies_at_the_signals_frequency_and_is_as_wide_as_the_wavelet_says():
    t = times(1.0)
    found = wavelet_map(sine(t, 60), t)
    column = found.amplitude[:, 300]
    assert found.frequencies[np.argmax(column)] == pytest.approx(60, rel=0.02)
    expected = np.exp(-3 * (math.pi * (60 / FREQUENCIES - 1)) ** 2)  # B = 3, C = 1
    np.testing.assert_allclose(column[FREQUENCIES > 10], expected[FREQUENCIES > 10], atol=0.003)


def test_two_sines_are_two_ridges():
    t = times(1.0)
    found = wavelet_map(sine(t, 79.3) + 0.5 * sine(t, 36.8), t)
    column = found.amplitude[:, 300]
    peaks = np.flatnonzero((column[1:-1] > column[:-2]) & (column[1:-1] > column[2:]) & (column[1:-1] > 0.1)) + 1
    np.testing.assert_allclose(found.frequencies[peaks], [36.8, 79.3], rtol=0.03)


def test_a_frequency_that_changes_is_followed():
    t = times(1.0)
    found = wavelet_map(np.sin(2 * math.pi * (50 * t + 100 * t**2)), t)  # 50 to 250 Hz
    middle = slice(100, -100)
    ridge = found.frequencies[np.argmax(found.amplitude[:, middle], axis=0)]
    np.testing.assert_allclose(ridge, 50 + 200 * found.time[middle], rtol=0.04)


def test_at_the_cone_the_cut_costs_what_the_envelope_says():
    """A cut sine has (1 + erf(d / (sqrt(B) s))) / 2 of its amplitude at the distance d: 0.921 at the cone."""
    t = times(1.0)
    found = wavelet_map(sine(t, 40), t, np.array([40.0]))
    at_cone = np.interp(found.cone[0], found.time, found.amplitude[0])
    assert at_cone == pytest.approx((1 + math.erf(1)) / 2, abs=0.01)


def test_columns_are_means_and_alias_nothing():
    """Beats faster than the columns can follow show their mean, not a slow wave."""
    t = times(10.0)  # 100 001 samples in 600 columns: 60 columns a second
    beating = sine(t, 400) * (1 + 0.5 * sine(t, 61))  # seen at 60 columns a second it would beat once a second
    found = wavelet_map(beating, t, np.array([400.0]))
    assert found.amplitude.shape == (1, 600)
    inside = found.amplitude[0, away(found)]
    assert np.ptp(inside) < 0.02
    assert np.mean(inside) == pytest.approx(1.0, rel=0.02)


def test_a_short_record_keeps_its_samples():
    t = times(0.02)
    found = wavelet_map(sine(t, 300), t, np.array([300.0]))
    np.testing.assert_allclose(found.time, t)


def test_the_map_of_every_default_frequency_is_the_same_as_of_one_by_itself():
    t = times(0.5)
    history = sine(t, 30) + sine(t, 200)
    whole = wavelet_map(history, t)
    for row in (0, 60, 110, 159):
        single = wavelet_map(history, t, FREQUENCIES[row : row + 1])
        np.testing.assert_allclose(whole.amplitude[row], single.amplitude[0], atol=1e-12)


def test_frequencies_the_record_cannot_tell_are_refused(refused):
    t = 1e-3 * np.arange(1001)
    refused(ValueError, "frequencies: got 251 Hz", wavelet_map, t, t, np.array([100.0, 251.0]))
    refused(ValueError, "frequencies: got 0 Hz", wavelet_map, t, t, np.array([0.0]))
