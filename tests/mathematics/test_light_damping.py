"""Modes that light damping couples: the motion of the matrix exponential; what is not light is left to eigenvalues."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.linalg import expm

from multiphi_exudyn.mathematics.response import free_response, light_damping
from multiphi_exudyn.mathematics.response.coupled_response import modal_response
from multiphi_exudyn.mathematics.response.free_response import lightly_coupled


def chain(seed, r, ratio):
    """omega^2 of modes apart from each other, and a damping of about that ratio, semidefinite."""
    random = np.random.default_rng(seed)
    omega = np.cumsum(random.uniform(0.7, 1.3, r))
    root = random.normal(size=(r, r)) / r**0.5
    return omega**2, 2 * ratio * omega[0] * root @ root.T + np.diag(ratio * omega)


def moved(response, start, t):
    return np.concatenate(response.state(response.coefficients(*start), t))


@given(st.integers(0, 2**31), st.integers(1, 8), st.floats(0, 0.03), st.floats(0, 5))
def test_equals_the_matrix_exponential(seed, r, ratio, t):
    squares, damping = chain(seed, r, ratio)
    response = lightly_coupled(squares, damping)
    if response is None:
        return
    system = np.block([[np.zeros((r, r)), np.eye(r)], [-np.diag(squares), -damping]])
    start = np.random.default_rng(seed).normal(size=(2, r))
    assert_allclose(moved(response, start, t), expm(system * t) @ start.ravel(), rtol=0, atol=1e-12 * r**2)


@pytest.mark.parametrize("ratio", [1e-6, 1e-3, 1e-2])
def test_is_taken_where_damping_is_light_in_few_steps(monkeypatch, ratio):
    squares, damping = chain(1, 12, ratio)
    monkeypatch.setattr(light_damping, "MOST_STEPS", 12)  # a compiled function has its own limit
    monkeypatch.setattr(free_response, "write_closed_form", free_response.closed_form)
    response = modal_response(squares, damping)
    assert not response.alone.any()
    assert np.array_equal(response.shapes.diagonal(), np.ones(12))
    left = squares[:, None] * response.shapes + damping @ response.shapes * response.basis.rates
    left += response.shapes * response.basis.rates**2
    assert np.max(np.abs(left)) < 1e-13 * np.max(squares)


def test_the_plain_iteration_is_the_compiled_one(monkeypatch):
    squares, damping = chain(3, 9, 1e-3)
    compiled = lightly_coupled(squares, damping)
    monkeypatch.setattr(free_response, "write_closed_form", free_response.closed_form)
    found = lightly_coupled(squares, damping)
    for name in ("shapes", "from_displacement", "from_velocity", "from_force"):
        own = getattr(found, name)
        assert_allclose(getattr(compiled, name), own, rtol=0, atol=1e-15 * np.max(np.abs(own)))
    assert_allclose(compiled.basis.rates, found.basis.rates, rtol=1e-15)


def test_an_iteration_that_leaves_the_numbers_is_given_up(monkeypatch):
    squares, damping = chain(1, 6, 1e-3)
    start = light_damping.start
    monkeypatch.setattr(free_response, "write_closed_form", free_response.closed_form)
    monkeypatch.setattr(light_damping, "start", lambda numbers, r: start(numbers, r) or 1)
    assert lightly_coupled(squares, 1e5 * damping) is None
    assert lightly_coupled(squares, np.full_like(damping, np.nan)) is None


def test_starts_are_their_own_to_round_off():
    squares, damping = chain(2, 10, 5e-3)
    response = lightly_coupled(squares, damping)
    places, speeds = response.shapes, response.shapes * response.basis.rates
    for rows, own, other in (
        (places, response.from_displacement, response.from_velocity),
        (speeds, response.from_velocity, response.from_displacement),
    ):
        assert_allclose((rows @ own).real, np.eye(10), atol=1e-14)
        assert_allclose((rows @ other).real, np.zeros((10, 10)), atol=1e-13 * np.max(squares) ** 0.5)


def test_modes_far_apart_start_where_they_are_put():
    """Their vectors are known after one step; a rate from before it would start 6e-11 beside."""
    response = lightly_coupled(np.array([6.9, 1.8e8]), np.array([[0.32, 0.12], [0.12, 0.22]]))
    given = np.array([-0.75, 1.5e-8])
    c = response.from_displacement @ given
    assert_allclose((response.shapes @ c).real, given, rtol=1e-15, atol=1e-20)
    assert_allclose((response.shapes @ (c * response.basis.rates)).real, 0.0, atol=1e-15)


@pytest.mark.parametrize("scale", [2.0**-20, 2.0**20])
def test_units_of_time_change_nothing(scale):
    squares, damping = chain(3, 6, 1e-2)
    plain, scaled = lightly_coupled(squares, damping), lightly_coupled(squares * scale**2, damping * scale)
    assert_allclose(scaled.basis.rates, plain.basis.rates * scale, rtol=1e-15)
    assert_allclose(scaled.shapes, plain.shapes, rtol=1e-15)


def test_what_is_not_light_is_left_to_eigenvalues():
    squares, damping = chain(4, 5, 5e-3)
    pairs = np.array([1.0, 1.0, 4.0, 9.0, 16.0])  # of equal frequencies any vector is one
    turned = damping.copy()
    turned[0, 1] *= 1.1
    assert lightly_coupled(squares, damping) is not None
    assert lightly_coupled(pairs, damping) is None
    assert lightly_coupled(np.array([0.0, 1.0, 4.0, 9.0, 16.0]), damping) is None
    assert lightly_coupled(np.array([-1.0, 1.0, 4.0, 9.0, 16.0]), damping) is None
    assert lightly_coupled(squares, 100 * damping) is None
    assert lightly_coupled(squares, turned) is None
