"""Non-negative least squares: the conditions of a minimum hold, also where round-off alone tells columns apart."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.nonnegative import nonnegative_least_squares

ROUND_OFF = (-1e-15, -1e-16, -1e-17, 1e-17, 1e-16, 1e-15)
LARGE = (-1.0, -1e-3, -1e-7, 1e-7, 1e-3, 1.0)


def violation(matrix, target, x):
    """How far A^T (A x - b) >= 0 and x . A^T (A x - b) = 0 are from holding."""
    slope = matrix.T @ (matrix @ x - target)
    return max(-float(np.min(slope)), float(np.max(np.abs(slope * x))))


@settings(max_examples=200)
@given(st.integers(0, 2**31), st.integers(2, 5), st.lists(st.sampled_from(ROUND_OFF + LARGE), min_size=5, max_size=5))
def test_is_the_minimum_also_beside_pushes_of_round_off(seed, k, pushes):
    random = np.random.default_rng(seed)
    matrix = np.linalg.qr(random.normal(size=(7, 7)))[0][:, :k] @ (np.eye(k) + 0.2 * random.normal(size=(k, k)))
    other = random.normal(size=7)
    target = other - np.linalg.lstsq(matrix.T, matrix.T @ other - pushes[:k], rcond=None)[0]
    x = nonnegative_least_squares(matrix, target)
    assert np.all(x >= 0)
    assert violation(matrix, target, x) <= 1e-12 * max(1.0, float(target @ target))


def test_a_push_of_1e_7_beside_three_of_round_off_is_followed_alone():
    """Four contacts of which one is struck at 5e-7 m/s and three are at rest, at speeds of 1 m/s."""
    directions = np.array(
        [
            [0.4763534117074608, -1.6051835354026458, -0.78110294117309, -0.01143625155819365, 1.1803479246840436],
            [0.32334332529595033, 0.5660055091376993, 1.1714500451432335, 2.010104188511245, -0.7849019795188598],
            [1.3413227095114837, 1.0557334410652612, -0.24831985114464783, -0.5744633367268032, 1.0034044236929234],
            [-1.7552528499242865, 1.021879241490362, 1.782992073754951, 0.5778823446928602, -0.47899165846098807],
        ]
    )
    matrix = (directions / np.linalg.norm(directions, axis=1)[:, None]).T
    speeds = np.array([-0.5429800811419899, 0.5154840840829346, -0.9477921753720812, 0.6112485203433751])
    target = -np.append(speeds, 0.2988645189568965)
    x = nonnegative_least_squares(matrix, target)
    assert np.linalg.norm(matrix @ x - target) <= np.linalg.norm(target)
    assert violation(matrix, target, x) <= 1e-14


def test_clamping_a_negative_share_is_not_the_minimum():
    """Without bounds x = (-2, 5); the second column alone takes (b . a) / (a . a)."""
    matrix = np.array([[2.0, 1.0], [0.0, 1.0]])
    assert_allclose(nonnegative_least_squares(matrix, matrix @ [-2.0, 5.0]), [0.0, 3.0], rtol=1e-14)


def test_a_share_that_turns_negative_on_the_way_leaves():
    """The first column alone is the steepest; with both others it is not wanted."""
    matrix = np.array([[1.0, 1.0, 0.0], [1.0, 0.0, 1.0]]) / [np.sqrt(2), 1.0, 1.0]
    matrix = np.vstack([matrix, [0.5, 0.0, 0.0]])
    x = nonnegative_least_squares(matrix, np.array([1.0, 1.0, -0.4]))
    assert_allclose(x, [0.0, 1.0, 1.0], atol=1e-14)


@pytest.mark.parametrize("apart", [1e-8, 1e-11, 1e-14])
def test_columns_that_hardly_differ_are_no_failure(apart):
    """Round-off may give a willing column a negative share: it stays outside."""
    random = np.random.default_rng(3)
    for _ in range(100):
        column = random.normal(size=(6, 1))
        matrix = column + apart * random.normal(size=(6, 3))
        target = matrix @ random.uniform(size=3) + apart * random.normal(size=6)
        x = nonnegative_least_squares(matrix, target)
        assert violation(matrix, target, x) <= 1e-12 * float(np.sum(np.abs(matrix)) * np.sum(np.abs(target)))


def test_equal_columns_and_empty_ones_are_no_failure():
    row = np.array([[3.0, 3.0, 0.0]])
    x = nonnegative_least_squares(row, np.array([6.0]))
    assert_allclose(row @ x, [6.0], rtol=1e-14)
    assert x[2] == 0
    assert nonnegative_least_squares(np.zeros((2, 0)), np.ones(2)).shape == (0,)


def test_says_where_it_does_not_settle(monkeypatch):
    monkeypatch.setattr("multiphi_exudyn.nonnegative.SETS", 0)
    with pytest.raises(NumericalFailure, match="which contacts press"):
        nonnegative_least_squares(np.eye(2), np.ones(2))
