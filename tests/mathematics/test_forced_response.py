"""Forced response in closed form: it satisfies its equation, near to poles and far from them alike."""

import numpy as np
import pytest
from carriers import CARRIERS
from numpy.testing import assert_allclose

from multiphi_exudyn.mathematics.response.coupled_response import modal_response
from multiphi_exudyn.mathematics.response.forced_response import particular

OMEGA = np.array([0.0, 1.0, 1.0001, 5.0, 25.0, 300.0])
DIAGONAL = np.diag([0.0, 0.0, 0.02, 10.0, 50.0, 3.0])  # rigid, undamped, lightly damped, critical twice, stiff


def coupled(rigid_alone):
    root = 0.5 * np.random.default_rng(1).normal(size=(6, 6))
    damping = root @ root.T
    if rigid_alone:
        damping[0] = damping[:, 0] = 0.0
    return damping


def powers(x, rate, t, derivative, unit):
    """The k-th derivative at t of exp(rate t) sum_k x_k (t / unit)^k, complex (r,)."""
    for _ in range(derivative):
        moved = np.zeros_like(x)
        moved[:-1] = np.arange(1, len(x))[:, None] / unit * x[1:]
        x = rate * x + moved
    return np.exp(rate * t) * ((t / unit) ** np.arange(len(x)) @ x)


@pytest.mark.parametrize("damping", [DIAGONAL, coupled(True), coupled(False)], ids=["diagonal", "rigid-alone", "all"])
@pytest.mark.parametrize(
    ("rate", "horizon", "degree"),
    CARRIERS,
)
def test_the_particular_response_satisfies_its_equation(rate, horizon, degree, damping):
    random = np.random.default_rng(0)
    forces = random.normal(size=(degree + 1, 6)) + 0j
    x = particular(OMEGA**2, damping, modal_response(OMEGA**2, damping), rate, forces, horizon)
    for t in np.linspace(0, horizon, 5):
        eta, eta_t, eta_tt = (powers(x, rate, t, k, horizon).real for k in range(3))
        left, right = eta_tt + damping @ eta_t + OMEGA**2 * eta, powers(forces, rate, t, 0, horizon).real
        size = np.abs(eta_tt) + np.abs(damping) @ np.abs(eta_t) + OMEGA**2 * np.abs(eta)
        assert_allclose(left, right, rtol=0, atol=3e-12 * float(np.max(size)))


def test_nothing_grows_beyond_the_load_near_a_pole():
    """At 1e-9 from resonance the finite polynomial would be 1e9 times too large and cancel with the free response."""
    damping = np.zeros((1, 1))
    response = modal_response(np.array([4.0]), damping)
    for offset in (0.0, 1e-12, 1e-9, 1e-6, 1e-3):
        x = particular(np.array([4.0]), damping, response, 2j * (1 + offset), np.ones((1, 1), complex), 10.0)
        assert np.max(np.abs(x)) < 10.0


def test_no_force_gives_no_response():
    response = modal_response(OMEGA**2, DIAGONAL)
    assert not np.any(particular(OMEGA**2, DIAGONAL, response, 3j, np.zeros((4, 6), complex), 1.0))
