"""Modes identified from a force and responses: exact on exact functions, within a modal test's limits on noisy ones."""

import numpy as np
import pytest

from multiphi_exudyn.study.measures.shaker_test import frequency_response_functions, identified_modes

HZ = np.array([4.0, 37.0, 108.0, 205.0])
RATIOS = np.array([4.34e-2, 1.67e-2, 9e-5, 2.4e-3])
LINES = np.arange(1, 20001) / 80.0  # Hz
RESIDUES = np.array([[1.0, -2.0, 3.0, -1.0], [0.5, 1.0, -1.0, 2.0]])


def accelerances(frequencies=LINES, hz=HZ, ratios=RATIOS):
    s, w = 2j * np.pi * frequencies, 2 * np.pi * hz
    modes = s**2 / (s**2 + 2 * (ratios * w)[:, None] * s + (w**2)[:, None])
    return RESIDUES[:, : len(hz)] @ modes + 0.3


def test_functions_of_four_modes_give_back_their_frequencies_and_ratios():
    found = identified_modes(LINES, accelerances(), 2.0, 250.0)
    assert found.frequencies == pytest.approx(HZ, rel=1e-4)
    assert found.ratios == pytest.approx(RATIOS, rel=1e-2)


def test_a_lone_mode_in_a_band_is_exact():
    found = identified_modes(LINES, accelerances(hz=HZ[2:3], ratios=RATIOS[2:3]), 2.0, 250.0)
    assert found.frequencies == pytest.approx(HZ[2:3], rel=1e-10)
    assert found.ratios == pytest.approx(RATIOS[2:3], rel=1e-6)


def test_neighbouring_modes_are_told_apart():
    hz, ratios = np.array([30.0, 32.0, 108.0, 205.0]), np.array([2e-3, 1e-3, 1e-2, 1e-2])
    found = identified_modes(LINES, accelerances(hz=hz, ratios=ratios), 2.0, 250.0)
    assert found.frequencies == pytest.approx(hz, rel=1e-5)
    assert found.ratios == pytest.approx(ratios, rel=1e-4)


def test_noise_on_the_functions_makes_no_modes_and_moves_none():
    functions = accelerances()
    random = np.random.default_rng(0)
    noise = 0.01 * (random.normal(size=functions.shape) + 1j * random.normal(size=functions.shape))
    found = identified_modes(LINES, functions + noise, 2.0, 250.0)
    assert found.frequencies == pytest.approx(HZ, rel=2e-3)
    assert found.ratios == pytest.approx(RATIOS, rel=5e-2)


def test_only_the_band_that_is_asked_for_is_looked_at():
    assert identified_modes(LINES, accelerances(), 20.0, 150.0).frequencies == pytest.approx(HZ[1:3], rel=1e-4)


def test_functions_follow_from_records_that_begin_and_end_at_rest():
    """A damped oscillator's free response to a force of one sample, convolved with any force."""
    step, count = 1 / 64, 4096
    time = step * np.arange(count)
    answer = np.exp(-0.5 * time) * np.sin(20 * time)
    force = np.zeros(count)
    force[:64] = np.random.default_rng(1).normal(size=64)
    f, functions = frequency_response_functions(force, np.convolve(force, answer)[None, :count], step)
    assert f[1] == pytest.approx(1 / 64)
    assert functions[0] == pytest.approx(np.fft.rfft(answer), abs=1e-9)


def test_records_that_do_not_fit_are_refused(refused):
    refused(ValueError, "responses: got", frequency_response_functions, np.ones(4), np.ones((2, 5)), 0.1)
    refused(ValueError, "force: got", frequency_response_functions, np.zeros(4), np.ones((2, 4)), 0.1)
    refused(ValueError, "frequencies: got", identified_modes, LINES, accelerances(), 300.0, 400.0)
