"""Signs and clusters of modes are chosen by rows and not by round-off."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import multiphi_exudyn._core as core


def signs(modes, rows, sizes):
    """By which modes of different frequencies are multiplied."""
    made = core.aligned_modes(np.arange(1.0, len(modes) + 1), modes, rows, sizes)[1]
    return np.sign(np.sum(made * modes, axis=1))


def test_equal_squares_form_clusters():
    assert core.clusters(np.array([1.0, 1.0 + 1e-13, 2.0, 3.0, 3.0 - 1e-12, 3.0])) == [(0, 2), (3, 6)]
    assert core.clusters(np.array([-2.0, -2.0, 0.0, 0.0, 1.0])) == [(0, 2), (2, 4)]
    assert core.clusters(np.array([1.0, 1.0 + 1e-9])) == []
    assert core.clusters(np.array([])) == []


def test_the_first_row_with_a_clear_value_chooses_the_sign():
    rows = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 0.0]])
    sizes = np.array([1.0, 2.0, 1.0, 1.0, 1.0])
    modes = np.array([[-0.6, 0.8, 0.0], [0.8, 0.6, -1e-3], [1.0, 0.0, -1e-7], [0.0, -1.0, 0.0]])
    assert_array_equal(signs(modes, rows, sizes), [-1.0, -1.0, 1.0, -1.0])


def test_without_a_clear_value_the_largest_one_chooses():
    modes = np.array([[1e-7, -2e-7], [-1e-7, 3e-7]])
    assert_array_equal(signs(modes, np.zeros((0, 2)), np.ones(2)), [-1.0, 1.0])


def test_a_row_that_no_mode_moves_chooses_nothing():
    assert_array_equal(signs(np.array([[-1.0]]), np.zeros((1, 1)), np.array([0.0, 1.0])), [-1.0])


@pytest.mark.parametrize(("rows", "sizes"), [(np.ones((1, 3)), np.ones(3)), (np.ones((1, 2)), np.ones(2))])
def test_other_shapes_are_told(rows, sizes):
    with pytest.raises(ValueError, match="need"):
        signs(np.ones((1, 2)), rows, sizes)
