"""The flat search gives the answers of ``DescentFinder``, and exact ones where they are known."""

import numpy as np
import pytest
from flat_records import Search, fast
from numpy.testing import assert_allclose

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics import compiled, zero_crossing
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mathematics.first_descent import Descent, DescentFinder, Signals
from multiphi_exudyn.mathematics.round_off import ZERO

CASES = 30  # of every kind


def exponentials(kind, random):
    """Some basis of a kind, in units of time between microseconds and weeks."""
    count = int(random.integers(1, 8))
    rates, powers, unit = 1j * random.uniform(0.3, 60, count), np.zeros(count, int), 1.0
    if kind == "decaying":
        rates = rates - random.random(count) * random.choice([0.02, 1.0, 20.0])
    elif kind == "growing":
        rates = rates + random.uniform(-1, 1, count) * random.choice([0.02, 1.0])
    elif kind == "overdamped":
        rates = -random.uniform(0.1, 60, count) + 0j
    elif kind == "polynomial":
        rates, powers, unit = np.zeros(count), np.arange(count), 10 ** random.uniform(-1, 1)
    elif kind == "loaded":
        degree, carrier = int(random.integers(1, 5)), random.choice([0, 7j, -1 + 2j])
        rates = np.concatenate([rates - random.random(count), np.full(degree, carrier), np.zeros(3)])
        powers = np.concatenate([powers, np.arange(degree), np.arange(3)])
        unit = 10 ** random.uniform(-1, 1)
    scale = 10 ** random.uniform(-6, 6)
    return Exponentials(np.asarray(rates / scale, complex), powers, unit * scale), scale


def signals(basis, start, random):
    """Some signals that are not negative at the start; of some it begins at zero, or a hair above it."""
    shape = int(random.integers(1, 6)), len(basis.rates)
    weights = random.normal(size=shape) + 1j * random.normal(size=shape)
    size, now = np.abs(weights).sum(axis=1), (weights @ basis.at(start)).real
    constants = np.maximum(size * random.uniform(-0.2, 1.0, shape[0]), -now)
    touching = random.random(shape[0]) < 0.2
    constants = np.where(touching, -now + size * random.choice([1e-14, 1e-12, 1e-9, 1e-6], shape[0]), constants)
    noise = size * random.choice([0.0, 1e-15, 1e-13, 1e-12], shape[0])
    return Signals(weights, constants, noise)


def some(kind, seed):
    random = np.random.default_rng([seed, *kind.encode()])
    basis, scale = exponentials(kind, random)
    horizon = scale * random.uniform(0.5, 20) * random.choice([0.01, 1.0, 10.0])
    start = float(random.choice([0.0, random.uniform(0, horizon)]))
    return basis, signals(basis, start, random), start, float(horizon)


def round_off(basis, found, own, t):
    """How much of a signal at t is round-off, by itself or by what it is made of."""
    terms = np.abs(own.coefficients[found]) @ np.abs(basis.at(t)) + abs(own.constants[found])
    return max(ZERO * terms, own.noise[found])


KINDS = ["oscillating", "decaying", "growing", "overdamped", "polynomial", "loaded"]


@pytest.mark.parametrize("kind", KINDS)
def test_it_finds_what_the_descent_finder_finds(kind):
    found = 0
    for seed in range(CASES):
        basis, own, start, horizon = some(kind, seed)
        expected = DescentFinder(basis).first(own, horizon, start)
        signal, time = Search(basis, own).first(horizon, start)
        if expected is None:
            assert signal == zero_crossing.NONE
            continue
        found += 1
        slope = abs((basis.derivative(own.coefficients[signal]) @ basis.at(time)).real)
        allowed = 1e-12 * time + 2 * round_off(basis, signal, own, time) / max(slope, 1e-300)
        assert_allclose(time, expected.time, rtol=0, atol=allowed)
        at_once = (own.coefficients[signal] @ basis.at(expected.time)).real + own.constants[signal]
        assert signal == expected.signal or abs(at_once) <= 2 * round_off(basis, signal, own, time)
    assert found > 0.2 * CASES


@pytest.mark.parametrize("kind", KINDS)
def test_it_takes_no_more_samples_than_twice_those_of_the_descent_finder(kind):
    taken = np.zeros(2)
    for seed in range(CASES):
        basis, own, start, horizon = some(kind, seed)
        finder, search = DescentFinder(basis), Search(basis, own)
        finder.first(own, horizon, start)
        search.first(horizon, start)
        taken += finder.evaluations, search.samples
    assert taken[1] <= 2 * taken[0]


@pytest.mark.parametrize("kind", KINDS)
def test_it_sees_the_same_signals_fall_at_one_instant(kind):
    several = 0
    for seed in range(CASES):
        basis, own, start, horizon = some(kind, seed)
        alike = Signals(*(np.concatenate([values, values]) for values in (own.coefficients, own.constants, own.noise)))
        finder = DescentFinder(basis)
        found = finder.first(alike, horizon, start)
        if found is not None:
            together = finder.simultaneous(alike, found)
            assert Search(basis, alike).simultaneous(found) == together
            several += len(together) > 1
    assert several


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("since", [0, 1, 2])
def test_it_gives_the_same_signs(kind, since):
    seen = set()
    for seed in range(CASES):
        basis, own, _, _ = some(kind, seed)
        random = np.random.default_rng(seed)
        rows = own.coefficients * random.choice([1.0, 1e-14, 1e-30], own.coefficients.shape)
        held = np.where(random.random(len(rows)) < 0.5, -(rows @ basis.at(0.0)).real, own.constants)
        given, sizes = Signals(rows, held), np.abs(rows) * random.uniform(1, 3)
        signs = DescentFinder(basis).signs(given, sizes, since)
        assert Search(basis, given).signs(sizes, since) == signs
        seen |= set(signs)
    assert {1, -1} <= seen


def first(rates, weights, constant, horizon):
    basis = Exponentials(np.array(rates, complex), np.zeros(len(rates), int))
    return Search(basis, Signals(np.array([weights], complex), np.array([constant]))).first(horizon)


def test_a_quarter_period_of_a_cosine():
    signal, time = first([7j], [1.0], 0.0, 10.0)
    assert signal == 0
    assert_allclose(time, np.pi / 14, rtol=1e-15)


@pytest.mark.parametrize("dip", [1e-3, 1e-6, 1e-9, 1e-12])
def test_two_crossings_a_hair_apart_are_not_stepped_over(dip):
    """1 - dip + cos t reaches -dip at pi: below zero for 2 sqrt(2 dip) only."""
    signal, time = first([1j], [1.0], 1 - dip, 100.0)
    assert signal == 0
    assert_allclose(time, np.pi - np.arccos(1 - dip), rtol=0, atol=1e-15 / np.sqrt(dip) + 1e-14)


@pytest.mark.parametrize("clearance", [0.0, 1e-12, 1e-9, 1e-3])
def test_a_touch_from_above_is_no_descent(clearance):
    assert first([1j], [1.0], 1 + clearance, 100.0)[0] == zero_crossing.NONE


@pytest.mark.parametrize("horizon", [0.5, 0.8, 5.0])
def test_what_decays_below_the_smallest_number_never_falls(horizon):
    assert first([-1000.0], [1.0], 0.0, horizon)[0] == zero_crossing.NONE


def test_no_signals_never_fall():
    none = Signals(np.zeros((0, 1), complex), np.zeros(0))
    assert Search(Exponentials(np.array([1j]), np.zeros(1, int)), none).first(1.0)[0] == zero_crossing.NONE


def test_motion_that_is_not_finite_is_told():
    assert first([1e4 + 1j], [1.0], 1.0, 10.0)[0] == zero_crossing.NOT_FINITE  # it overflows before it falls
    assert first([1j], [np.inf], 1.0, 10.0)[0] == zero_crossing.NOT_FINITE
    assert first([1j], [np.nan], 1.0, 10.0)[0] == zero_crossing.NOT_FINITE
    assert first([1j], [1.0], np.nan, 10.0)[0] == zero_crossing.NOT_FINITE


def test_a_search_that_would_take_for_ever_is_refused_as_by_the_descent_finder():
    basis = Exponentials(np.array([1e9j, 2e9j]), np.zeros(2, int))
    never = Signals(np.array([[1, 1]], complex), np.array([1.2]))
    search = Search(basis, never, fast)
    assert search.first(1e-7)[0] == zero_crossing.NONE
    assert search.first(1.0)[0] == zero_crossing.TOO_LONG
    step, left = search.buffers.numbers[search.result + 2 : search.result + 4]
    with pytest.raises(NumericalFailure, match=f"every {step:g} s until the end, in {left:g} s"):
        DescentFinder(basis).first(never, 1.0)


def test_of_two_signals_that_fall_together_it_names_the_one_the_descent_finder_names():
    basis = Exponentials(np.array([3j]), np.zeros(1, int))
    twice = Signals(np.ones((2, 1), complex), np.zeros(2))
    found = DescentFinder(basis).first(twice, 10.0)
    assert Search(basis, twice).first(10.0)[0] == found.signal
    assert Search(basis, twice).simultaneous(Descent(found.time, found.signal)) == [0, 1]


@pytest.mark.skipif(not compiled.available(), reason="needs numba")
@pytest.mark.parametrize("kind", KINDS)
def test_compiled_it_gives_what_it_gives_as_plain_python(kind):
    for seed in range(CASES):
        basis, own, start, horizon = some(kind, seed)
        plain, quick = Search(basis, own), Search(basis, own, fast)
        (signal, time), (expected, exact) = quick.first(horizon, start), plain.first(horizon, start)
        assert signal == expected
        assert quick.samples == plain.samples
        assert_allclose(time, exact, rtol=1e-13)
        if signal >= 0:
            found = Descent(time, signal)
            assert quick.simultaneous(found) == plain.simultaneous(found)
        sizes = np.abs(own.coefficients)
        assert quick.signs(sizes) == plain.signs(sizes)
