"""Starts in coordinates of the base, and which of them are seen at once to touch nothing."""

import copy
import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from small_structures import chain, stop

import multiphi_exudyn as mp
from multiphi_exudyn.mathematics.round_off import drop_round_off
from multiphi_exudyn.time.simulate import Run
from multiphi_exudyn.time.start import StartProjection, first_start

END = 2.0
N = 6


def model(stiffness=math.inf):
    stops = [stop("m5", 0.3, stiffness), stop({"m2": -1.0}, 0.4, 40.0, name="above")]
    return mp.MultiPhiModel(chain(N, damping=mp.RayleighDamping(0.02, 0.01), stiffness=30.0), stops)


def setting_out(base, near=0.0):
    units = base.directions / np.linalg.norm(base.directions, axis=0)
    return StartProjection(base, np.ones(N), units, np.full(units.shape[1], -1.0), near)


numbers = st.lists(st.sampled_from([0.0, 1.0, -2.0, 1e-15, 3e-9, 0.1, 1e4]), min_size=N, max_size=N)


@settings(max_examples=50)
@given(x=numbers, modes=st.sets(st.integers(0, N - 1)), scale=st.sampled_from([1.0, 1e-200, 1e150]))
def test_coordinates_without_their_round_off(x, modes, scale):
    """Whatever is round-off of its terms is zero, and nothing else, however large the start is."""
    base = model().base
    onto, sizes = base.projection
    x = np.array(x)
    x -= base.modes.shapes[:, sorted(modes)] @ (onto[sorted(modes)] @ x)  # modes that have round-off alone
    x *= scale
    y, v, _ = setting_out(base).coordinates(x, -x)
    assert_array_equal(y, drop_round_off(onto @ x, sizes @ np.abs(x)))
    assert_array_equal(v, -y)
    y, v, far = setting_out(base).coordinates(None, None)
    assert far
    assert not np.concatenate([y, v]).any()


def test_numbers_that_overflow_are_not_far():
    with np.errstate(over="ignore"):
        assert not setting_out(model().base).coordinates(np.full(N, 1e200), None)[2]


@pytest.mark.parametrize("stiffness", [math.inf, 500.0], ids=["rigid", "compliant"])
@settings(max_examples=50)
@given(
    distance=st.sampled_from([0.0, 1e-16, 1e-13, 1e-11, 1e-10, 1e-9, 3e-9, 1e-8, 1e-4, 0.1, 1.0]),
    speed=st.sampled_from([None, 0.0, 1e-3, 1.0, 1e6]),
    others=numbers,
)
def test_what_is_seen_at_once_is_what_every_contact_is_asked(stiffness, distance, speed, others):
    """A start at some distance from its stop is the same whether or not it is looked at in short."""
    levels = Run(model(stiffness), END).levels()
    x = np.array(others) * 1e-2
    x[2], x[5] = min(x[2], 0.39), distance - 0.3
    x_t = None if speed is None else speed * np.arange(1.0, N + 1)
    short = first_start(levels, END, x, x_t)
    scales = levels.starts.get_or_build(END, lambda: None)
    object.__setattr__(scales, "apart", None)
    long = first_start(levels, END, x, x_t)
    assert (short.states, short.touching, short.penetrating) == (long.states, long.touching, long.penetrating)
    for name in ("displacement", "velocity", "gaps", "held"):
        assert_array_equal(getattr(short, name), getattr(long, name))


def test_a_copied_model_looks_at_its_own_starts():
    """The start of a run before the copy was far from its stop; those of the copy touch it, or are inside."""
    given, x = model(), np.zeros(N)
    mp.simulate(given, END, displacement=x)
    copied = pickle.loads(pickle.dumps(given))
    x[5] = -0.3
    runs = [mp.simulate(each, END, displacement=x) for each in (given, copied)]
    assert [run.start.touching for run in runs] == [(0,), (0,)]
    x[5] = -0.31
    with pytest.raises(mp.MultiPhiValueError, match="inside the rigid contact"):
        mp.simulate(copied, END, displacement=x)


@pytest.mark.parametrize("stiffness", [math.inf, 500.0], ids=["rigid", "compliant"])
@pytest.mark.parametrize("force", [0.5, -40.0], ids=["far", "on its stop"])
def test_a_run_from_an_equilibrium_is_one_from_its_displacement_without_a_projection(stiffness, force, monkeypatch):
    given = model(stiffness)
    rest = given.equilibrium({"m5": force})
    expected = mp.simulate(given, END, displacement=rest.displacement)
    base, other = given.base, model(stiffness)
    assert rest.coordinates(other.base) is None
    runs = [mp.simulate(each, END, start=start) for each in (given, other) for start in (rest, copy.deepcopy(rest))]
    monkeypatch.setattr(type(base), "coordinates", None)
    base.projection[0][:] = np.nan
    runs.append(mp.simulate(given, END, start=rest))
    for run in runs:
        assert_array_equal(run.start.displacement, expected.start.displacement)
        assert_array_equal(run.events.table(), expected.events.table())
        assert run.start.states == expected.start.states
    for array in (rest.displacement, runs[-1].start.displacement):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0  # one would no longer be the other


def test_an_equilibrium_that_is_replaced_is_another_start():
    given = model(500.0)
    rest = given.equilibrium({"m5": 0.5})
    twice = dataclasses.replace(rest, displacement=2 * rest.displacement)
    assert_allclose(mp.simulate(given, END, start=twice).displacement(0.0), 2 * rest.displacement, rtol=1e-12)


def test_a_start_is_far_by_how_far_it_is_and_where_its_speed_takes_it():
    base = model().base
    x, x_t = np.linspace(-0.2, 0.3, N), np.linspace(1.0, -2.0, N)
    y, v = base.coordinates(x), base.coordinates(x_t)
    gaps = 1.0 + y @ (base.directions / np.linalg.norm(base.directions, axis=0))
    limit = gaps.min() / (np.linalg.norm(y) + np.linalg.norm(v))
    assert setting_out(base, 0.999 * limit).coordinates(x, x_t)[2]
    assert not setting_out(base, 1.001 * limit).coordinates(x, x_t)[2]
