"""Orthonormal vectors of the core: beside NumPy's least squares, on independent, dependent and zero directions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from multiphi_exudyn._core import are_independent, following
from multiphi_exudyn.mathematics.orthonormal import product_error, without


def directions(random, m, d):
    """Independent directions (d, m) of lengths from 1e-3 to 1e3."""
    return random.normal(size=(d, m)) * 10.0 ** random.uniform(-3, 3, size=(d, 1))


def lengths(given):
    return np.linalg.norm(given, axis=1)


@pytest.mark.parametrize("d", [0, 1, 3, 6])
@pytest.mark.parametrize("shape", [(8,), (8, 1), (8, 4)])
def test_what_directions_leave_of_vectors_is_the_residual_of_least_squares(d, shape):
    random = np.random.default_rng(d)
    given, vectors = directions(random, 8, d).T, random.normal(size=shape)
    residual = vectors - given @ np.linalg.lstsq(given, vectors, rcond=None)[0]
    before = vectors.copy()
    found = without(given, vectors)
    assert found.shape == shape
    assert_array_equal(vectors, before)
    assert_allclose(found, residual, rtol=0, atol=1e-13 * np.abs(vectors).max())
    assert_allclose(found.T @ (given / np.linalg.norm(given, axis=0)), 0.0, atol=1e-14)


def test_directions_that_depend_on_others_and_zero_ones_remove_nothing_more():
    random = np.random.default_rng(1)
    given, vectors = directions(random, 8, 3), random.normal(size=(8, 2))
    more = np.vstack([given, given[0] - 2.0 * given[2], np.zeros(8)])
    assert_allclose(without(more.T, vectors), without(given.T, vectors), rtol=0, atol=1e-13)
    assert_array_equal(without(np.zeros((8, 1)), vectors), vectors)
    assert_allclose(without(random.normal(size=(8, 8)), vectors), 0.0, atol=1e-13)


def test_links_are_independent_unless_one_depends_on_others_to_1e_10():
    random = np.random.default_rng(2)
    given = directions(random, 6, 5)
    assert are_independent(given, lengths(given), [4, 0, 2, 1, 3])
    assert are_independent(given, lengths(given), [])
    for nearly, independent in ((0.0, False), (1e-11, False), (1e-9, True)):
        turned = given[1] / lengths(given)[1] + given[2] / lengths(given)[2]
        given[3] = 1e4 * (turned / np.linalg.norm(turned) + nearly * given[4] / lengths(given)[4])
        assert are_independent(given, lengths(given), [1, 2, 3]) == independent
    given[0] = 0.0
    assert not are_independent(given, lengths(given), [0])


def test_more_links_than_unknowns_are_not_independent():
    given = np.random.default_rng(3).normal(size=(4, 3))
    assert are_independent(given, lengths(given), [0, 1, 2])
    assert not are_independent(given, lengths(given), [0, 1, 2, 3])


def test_links_that_held_ones_span_follow_and_so_do_those_that_nothing_moves():
    random = np.random.default_rng(4)
    given = directions(random, 6, 6)
    given[3] = 2.0 * given[0] - given[1]
    given[4] = 0.0
    given[5] = given[0] / lengths(given)[0] + 0.05 * given[2] / lengths(given)[2]  # close, and free to move
    assert following(given, lengths(given), [0, 1]) == [True, True, False, True, True, False]
    assert following(given, lengths(given), []) == [False, False, False, False, True, False]


@pytest.mark.parametrize("m", [1, 2, 3, 4, 5, 8, 11])
def test_the_error_of_products_is_the_largest_one(m):
    random = np.random.default_rng(m)
    vectors = np.linalg.qr(random.normal(size=(m, m)))[0][:, : (m + 1) // 2]
    vectors += 1e-9 * random.normal(size=vectors.shape)
    expected = np.abs(vectors.T @ vectors - np.eye(vectors.shape[1])).max()
    assert product_error(vectors) == pytest.approx(expected, abs=1e-15)
    vectors[-1, -1] = np.nan
    assert np.isnan(product_error(vectors))


def test_arrays_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="one length"):
        without(np.ones((3, 1)), np.ones((4, 1)))
    with pytest.raises(ValueError, match="numbers of directions"):
        are_independent(np.eye(3), np.ones(3), [3])
    with pytest.raises(ValueError, match="one of every direction"):
        are_independent(np.eye(3), np.ones(2), [0])
