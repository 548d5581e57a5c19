"""Frequencies told from a response: exact sums of exponentials, noise, the rig's levels, and what cannot be told."""

import math

import numpy as np
import pytest

from multiphi_exudyn import MultiPhiModel, UnilateralContact, planar_beam, simulate
from multiphi_exudyn.study.measures import response_frequencies as module
from multiphi_exudyn.study.measures.response_frequencies import level_frequencies, level_name, response_frequencies
from multiphi_exudyn.study.running.runs import ModelRun, interval_array
from reference_models.rig import rig_beam, rig_contact, rig_damping

STEP = 1e-4
FREQUENCIES = np.array([4.0, 36.84, 108.7, 204.6])
RATIOS = np.array([4.34e-2, 1.67e-2, 9e-5, 2.4e-3])
SIZES = np.array([1.0, 0.1, 0.03, 0.01])


def times(length):
    return STEP * np.arange(round(length / STEP))


def response(t, frequencies=FREQUENCIES, ratios=RATIOS, sizes=SIZES, points=3, noise=0.0, seed=0):
    """Histories (points, k) about a constant that is not zero."""
    random = np.random.default_rng(seed)
    amplitudes = sizes * (random.normal(size=(points, len(sizes))) + 1j * random.normal(size=(points, len(sizes))))
    omega, ratios = 2 * math.pi * np.asarray(frequencies), np.asarray(ratios)
    poles = omega * (-ratios + 1j * np.sqrt(1 - ratios**2))
    exact = random.normal(size=(points, 1)) + (amplitudes @ np.exp(np.outer(poles, t))).real
    return exact + noise * random.normal(size=exact.shape)


def identified(t, histories, most=12):
    """From everything after the first sample."""
    return response_frequencies(t, histories, (0.0, 2 * t[-1]), most)


def test_exact_sums_of_exponentials_give_their_frequencies_and_ratios():
    found = identified(times(0.1), response(times(0.1)))
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=1e-7)
    np.testing.assert_allclose(found.ratios, RATIOS, atol=1e-7)


def test_one_history_is_enough():
    found = identified(times(0.1), response(times(0.1), points=1))
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_millionth_costs_little(seed):
    found = identified(times(0.2), response(times(0.2), noise=1e-6, seed=seed))
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=1e-4)
    np.testing.assert_allclose(found.ratios, RATIOS, atol=1e-4)


def test_the_error_is_in_proportion_to_the_noise():
    t = times(0.2)
    errors = [
        np.linalg.norm(identified(t, response(t, noise=noise)).frequencies / FREQUENCIES - 1) for noise in (1e-8, 1e-6)
    ]
    assert errors[1] / errors[0] == pytest.approx(100, rel=0.01)


def test_noise_ten_times_below_the_weakest_mode_hides_none():
    found = identified(times(0.2), response(times(0.2), noise=1e-3))
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=5e-3)


def test_thinning_averages_noise_out():
    found = identified(times(1.0), response(times(1.0), [5.0, 12.0], [0.01, 0.02], np.ones(2), noise=1e-2))
    np.testing.assert_allclose(found.frequencies, [5.0, 12.0], rtol=2e-5)


def test_a_pole_that_the_response_does_not_carry_is_left_out():
    t = times(0.2)
    omega = 2 * math.pi * np.append(FREQUENCIES, 2000.0)
    ratios = np.append(RATIOS, 0.0)
    poles = omega * (-ratios + 1j * np.sqrt(1 - ratios**2))
    found = module._told(t, response(t, noise=1e-4), np.concatenate([poles, poles.conj()]), 12)
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=1e-12)


def test_two_frequencies_nearer_than_the_spectrums_resolution_are_two():
    t = times(0.3)  # 3.3 Hz
    found = identified(t, response(t, [50.0, 51.0], [1e-3, 1e-3], np.ones(2), noise=1e-6))
    np.testing.assert_allclose(found.frequencies, [50.0, 51.0], rtol=1e-3)


def test_a_growing_mode_has_a_negative_ratio():
    found = identified(times(0.3), response(times(0.3), [50.0], [-0.01], np.ones(1)))
    np.testing.assert_allclose(found.ratios, [-0.01], rtol=1e-6)


def test_overdamped_motion_is_no_frequency():
    t = times(0.3)
    decay = np.outer([1.0, 2.0, -1.0], np.exp(-20 * t))
    found = identified(t, decay + response(t, [50.0], [0.4], np.ones(1)))
    np.testing.assert_allclose(found.frequencies, [50.0], rtol=1e-6)
    np.testing.assert_allclose(found.ratios, [0.4], rtol=1e-6)
    assert len(identified(t, decay).frequencies) == 0


def test_thinning_does_not_bend_the_frequencies():
    """Ten times as many samples of the same motion are thinned, and say the same."""
    found = [
        response_frequencies(t, response(t, [10.0, 30.0], [0.01, 0.02], np.ones(2)), (0.0, 1.0), 12)
        for t in (1e-3 * np.arange(500), 1e-4 * np.arange(5000))
    ]
    np.testing.assert_allclose(found[0].frequencies, [10.0, 30.0], rtol=1e-8)
    np.testing.assert_allclose(found[1].frequencies, [10.0, 30.0], rtol=1e-8)


def test_a_frequency_above_the_thinned_sampling_leaves_no_alias():
    t = times(10.0)  # thinned to 60 samples per second
    found = identified(t, response(t, [5.0, 4003.0], [0.01, 0.0], np.array([1.0, 0.1])))
    np.testing.assert_allclose(found.frequencies, [5.0], rtol=1e-3)


def test_a_frequency_at_half_the_thinned_sampling_is_not_told_from_its_mirror():
    t = times(0.11)  # thinned to 5000 samples per second
    found = identified(t, response(t, [60.0, 2503.0], [0.01, 1e-4], np.array([1.0, 1e-3])))
    np.testing.assert_allclose(found.frequencies, [60.0], rtol=1e-6)


@pytest.mark.parametrize("seed", range(10))
def test_noise_alone_has_no_frequencies(seed):
    noise = np.random.default_rng(seed).normal(size=(3, 2000))
    for given in (noise, noise[:, :60], np.cumsum(noise, axis=1)):
        assert len(identified(times(1.0)[: given.shape[1]], given).frequencies) == 0


@pytest.mark.parametrize("length", [0.005, 0.01, 0.02, 0.05, 0.1])
@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-2])
def test_what_an_interval_is_too_short_for_is_left_out_not_guessed(length, noise):
    for seed in range(4):
        found = identified(times(length), response(times(length), noise=noise, seed=seed)).frequencies
        nearest = np.min(np.abs(np.subtract.outer(found, FREQUENCIES)) / FREQUENCIES, axis=1, initial=1.0)
        assert np.all(nearest < 0.015)
    assert len(found) == 4 or length < 0.1 or noise > 1e-6


def test_nothing_is_told_of_rest_or_of_a_few_samples():
    t = times(0.1)
    assert len(identified(t, np.ones((2, len(t)))).frequencies) == 0
    assert len(response_frequencies(t, response(t), (0.05, 0.0511), 12).frequencies) == 0
    assert len(response_frequencies(t, response(t), (0.05, 0.05), 12).frequencies) == 0


def test_only_the_interval_counts_and_its_ends_do_not():
    t = times(0.2)
    spoiled = response(t)
    spoiled[:, (t <= t[500]) | (t >= t[900])] = 7.0
    found = response_frequencies(t, spoiled, (t[500], t[900]), 12)
    np.testing.assert_allclose(found.frequencies, FREQUENCIES, rtol=1e-6)


def test_of_too_many_the_strongest_are_kept():
    found = identified(times(0.2), response(times(0.2)), most=2)
    np.testing.assert_allclose(found.frequencies, FREQUENCIES[:2], rtol=1e-6)


def test_units_change_nothing():
    t = times(0.2)
    for unit in (1e-6, 1e3):
        found = identified(t, unit * response(t, noise=1e-6))
        np.testing.assert_allclose(found.frequencies, identified(t, response(t, noise=1e-6)).frequencies, rtol=1e-9)


def test_histories_of_another_length_are_refused(refused):
    refused(ValueError, "histories: got shape (3, 10)", response_frequencies, times(0.1), np.ones((3, 10)), (0, 1), 3)


# ------------------------------------------------------------------ levels


def run_of(points, intervals, time):
    given = {name: interval_array(closed) for name, closed in intervals.items()}
    return ModelRun("run", "reduced", "run", time=time, points=points, contact_intervals=given)


def test_a_level_is_named_by_its_closed_contacts():
    assert [level_name(closed) for closed in ((), ("a",), ("a", "b"))] == ["open", "a", "a+b"]


def test_every_level_is_told_from_the_longest_interval_in_which_it_holds():
    """Two contacts: open to 0.1 s, a to 0.3, a and b to 0.5, b to 0.55, then open; a frequency for each level."""
    t = times(0.8)
    ends = {"open early": 0.1, "a": 0.3, "a+b": 0.5, "b": 0.55, "open": 0.8}
    heard = {"open early": 20.0, "a": 50.0, "a+b": 80.0, "b": 110.0, "open": 30.0}
    level = np.searchsorted(list(ends.values()), t, side="right")
    history = np.choose(np.minimum(level, 4), [np.cos(2 * math.pi * f * t) for f in heard.values()])
    run = run_of({"tip": history}, {"a": [(0.1, 0.5)], "b": [(0.3, 0.55)]}, t)
    found = level_frequencies(run, ["a", "b"])
    assert list(found) == ["open", "a", "a+b", "b"]
    for name, frequencies in found.items():
        np.testing.assert_allclose(frequencies, [heard[name]], rtol=1e-6)


def test_a_run_without_contacts_is_one_open_level():
    t = times(0.2)
    found = level_frequencies(run_of({"tip": np.cos(250 * t)}, {}, t), [])
    np.testing.assert_allclose(found["open"], [250 / (2 * math.pi)], rtol=1e-8)


@pytest.fixture(scope="module")
def rig():
    """The rig with its rigid support, six modes: the model, and its run to 0.5 s."""
    structure = planar_beam(rig_beam("measured-free"), 20, rig_damping())
    contact = rig_contact()
    assert isinstance(contact, UnilateralContact)
    model = MultiPhiModel(structure, [contact], modes=6)
    shape = model.static_equilibrium({"hole3": 1.0})
    trajectory = simulate(model, 0.5, displacement=0.02 / float(structure.row("node3") @ shape) * shape)
    t = STEP * np.arange(5001)
    points = {name: trajectory.at(name, t) for name in ("node1", "node2", "node3")}
    return model, run_of(points, {"support": trajectory.contact_intervals("support")}, t)


def test_the_rigs_open_level_is_told_from_its_histories(rig):
    model, run = rig
    found = level_frequencies(run, ["support"])["open"]
    np.testing.assert_allclose(found[:4], [4.00, 36.84, 108.68, 204.60], rtol=1.5e-3)
    np.testing.assert_allclose(found, model.level(()).frequencies, rtol=1e-6)


def test_the_rigs_pinned_level_is_told_as_far_as_its_short_contacts_allow(rig):
    model, run = rig
    longest = np.max(np.diff(run.contact_intervals["support"]))
    assert 5e-3 < longest < 8e-3  # less than half a period of its lowest frequency
    found = level_frequencies(run, ["support"])["support"]
    exact = model.level(("support",)).frequencies
    nearest = np.min(np.abs(np.subtract.outer(found, exact)) / exact, axis=1)
    assert len(found) >= 3
    assert np.all(nearest < 1e-2)
