"""Roots of the secular equation are eigenvalues to round-off, for symmetric structures too."""

import math

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import multiphi_exudyn._core as core

COUNT = 12
STIFFNESSES = [1e-6, 1.0, 1e3, 1e9, math.inf]


def rank_one_modes(d, p, k, count, **settings):
    """Values and vectors, one a column."""
    found = core.rank_one_modes(d, p, k, count, **settings)
    return found and (found[0], found[1].T)


def whole(d, p, k, count):
    """The same from the whole matrix; its round-off is that of its largest number."""
    if math.isinf(k):
        free = scipy.linalg.null_space(p[None, :])
        values, vectors = scipy.linalg.eigh(free.T @ (d[:, None] * free))
        return values[:count], free @ vectors[:, :count]
    values, vectors = scipy.linalg.eigh(np.diag(d) + k * np.outer(p, p))
    return values[:count], vectors[:, :count]


def check(d, p, k, found):
    values, vectors = found
    assert_allclose(vectors.T @ vectors, np.eye(len(values)), atol=1e-12)
    forces = p @ vectors if math.isfinite(k) else np.zeros(len(values))
    left = d[:, None] * vectors - vectors * values
    if math.isinf(k):
        assert np.max(np.abs(p @ vectors)) < 1e-12 * np.linalg.norm(p)
        left -= np.outer(p, (p @ left) / (p @ p))
    else:
        left += k * np.outer(p, forces)
    largest = np.max(d) + (k * (p @ p) if math.isfinite(k) else 0.0)
    assert np.max(np.abs(left)) < 1e-13 * largest
    assert np.all(np.diff(values) >= 0)


@pytest.mark.parametrize("k", STIFFNESSES)
def test_are_those_of_the_whole_matrix(k):
    random = np.random.default_rng(1)
    d, p = np.sort(random.uniform(1, 100, 60)), random.normal(size=60)
    found = rank_one_modes(d, p, k, COUNT)
    check(d, p, k, found)
    values, vectors = whole(d, p, k, COUNT)
    assert_allclose(found[0], values, rtol=1e-11 if k < 1e6 or math.isinf(k) else 1e-6)
    if k < 1e6 or math.isinf(k):
        signs = np.sign(np.sum(vectors * found[1], axis=0))
        assert_allclose(found[1] * signs, vectors, atol=1e-10)


def test_soft_modes_keep_their_digits_beside_stiff_ones():
    """omega^2 over sixteen orders: those of the whole matrix would have none left."""
    d = 10.0 ** np.arange(-8, 9)
    values, _ = rank_one_modes(d, np.ones(17), math.inf, 8)
    residual = np.sum(1 / (d - values[:, None]), axis=1)
    slope = np.sum(1 / (d - values[:, None]) ** 2, axis=1)
    assert np.max(np.abs(residual / slope) / values) < 1e-14


@given(st.integers(0, 2**31), st.sampled_from(STIFFNESSES), st.integers(0, 3))
def test_all_of_them_are_those_of_the_whole_matrix(seed, k, absent):
    """The highest of a spring is above all d; of a rigid direction there is one less."""
    random = np.random.default_rng(seed)
    d, p = np.sort(random.uniform(1, 100, 20)), random.normal(size=20)
    p[random.choice(20, absent, replace=False)] = 0.0
    count = 19 if math.isinf(k) else 20
    found = rank_one_modes(d, p, k, count)
    check(d, p, k, found)
    values, _ = whole(d, p, k, count)
    assert_allclose(found[0], values, rtol=1e-11, atol=0 if k < 1e6 or math.isinf(k) else 1e-15 * k * (p @ p) * 20)
