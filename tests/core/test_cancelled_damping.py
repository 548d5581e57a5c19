"""Friction that cancels the damping of a free body: the motion has no quotient of a rate that is (nearly) zero."""

import numpy as np
import pytest
from long_exponential import long_expm
from numpy.testing import assert_allclose

import multiphi_exudyn._core as core

RESTS = [0.0, 1e-16, -1e-15, 1e-14, -1e-12, 1e-9, -1e-6, 1e-4, -1e-2, 0.3]
DASHPOTS = [(0.5, 1.0), (-0.5, 1.0), (0.3, 0.7), (1.1, 0.1), (1e-3, 2e-3)]


def cancelled(beside, dashpot=(0.5, 1.0), stiffness=1000.0, driven=0.7):
    """A dashpot between a free mode and an elastic one, on which friction acts; another free mode that it drives.

    Friction takes the damping of the free mode away, but for a relative rest.
    """
    squares, row = np.array([0.0, 0.0, stiffness]), np.array([0.0, *dashpot])
    coupling = np.zeros((3, 3))
    coupling[:2, 2] = driven * stiffness, (1 + beside) * dashpot[0] / dashpot[1] * stiffness
    return squares, np.outer(row, row), coupling


def exactly(squares, damping, coupling, start, force, t):
    """(eta, eta') at t: the matrix exponential of the first-order system, the constant force as one more state."""
    r = len(squares)
    system = np.zeros((2 * r + 1, 2 * r + 1))
    system[:r, r : 2 * r], system[r : 2 * r, :r] = np.eye(r), -np.diag(squares) - coupling
    system[r : 2 * r, r : 2 * r], system[r : 2 * r, -1] = -damping, force
    return (long_expm(system * t) @ np.concatenate([*start, [1.0]]))[: 2 * r]


def moved(response, start, force, t):
    return np.concatenate(response.state(response.coefficients(*start, force), t))


@pytest.mark.parametrize("duration", [0.1, 3.0])
@pytest.mark.parametrize("driven", [0.0, 0.7])
@pytest.mark.parametrize("dashpot", DASHPOTS)
@pytest.mark.parametrize("beside", RESTS)
def test_moves_as_the_matrix_exponential(beside, dashpot, driven, duration):
    for stiffness in (1000.0, 90.0, 7.3):
        matrices = cancelled(beside, dashpot, stiffness, driven)
        response = core.modal_response(*matrices, duration)
        start, force = np.array([[1.0, -0.4, 0.02], [0.3, -2.0, 1.0]]), np.array([-0.6, 0.8, 0.0])
        for t in (duration, duration / 3):
            exact = exactly(*matrices, start, force, t)
            found = moved(response, start, force, t)
            assert_allclose(found, exact, rtol=0, atol=3e-11 * np.max(np.abs(exact)))


@pytest.mark.parametrize("dashpot", DASHPOTS)
def test_exactly_cancelled_damping_has_no_need_of_a_duration(dashpot):
    for stiffness in (1000.0, 90.0, 7.3):
        rates = core.modal_response(*cancelled(0.0, dashpot, stiffness)).basis.rates
        assert np.all((rates == 0) | (np.abs(rates) > 1e-8))


def test_beside_modes_that_are_critically_damped_alike():
    """These form a cluster, and all rates come from another decomposition."""
    squares, damping, coupling = (np.pad(given, [(0, 2)] * np.ndim(given)) for given in cancelled(0.0))
    squares[3:], damping[3:, 3:], coupling[3, 4] = 4.0, 0.6 * np.eye(2), 1.0
    response = core.modal_response(squares, damping, coupling)
    start, t = np.array([[1.0, -0.4, 0.02, 0.1, -0.3], [0.3, -2.0, 1.0, 0.0, 0.5]]), 2.0
    exact = exactly(squares, damping, coupling, start, np.zeros(5), t)
    assert_allclose(moved(response, start, np.zeros(5), t), exact, rtol=0, atol=1e-9)


@pytest.mark.parametrize("beside", RESTS)
@pytest.mark.parametrize("rate", [0.0, 0.7j, 30j, -0.5 + 2j])
def test_solves_its_equation_under_forces(beside, rate):
    (squares, damping, coupling), horizon = cancelled(beside), 2.0
    response = core.modal_response(squares, damping, coupling, horizon)
    forces = np.array([[1.0, -0.5j, 2.0], [0.3, 0.8, -1.0]], complex)
    x = core.particular(response, rate, forces, horizon)
    k = np.arange(len(x))

    def differentiated(c):
        return rate * c + np.vstack([c[1:], np.zeros((1, 3))]) * (k + 1)[:, None] / horizon

    velocity = differentiated(x)
    acceleration = differentiated(velocity)
    left = acceleration + velocity @ damping.T + x @ (np.diag(squares) + coupling).T
    size = np.max(np.abs(acceleration)) + np.max(np.abs(x)) * np.max(squares)
    for t in np.linspace(0, horizon, 5):
        rest = (t / horizon) ** k @ left - (t / horizon) ** np.arange(2) @ forces
        if rate == 0.0:  # of a force that does not turn the real part is all
            rest = rest.real
        assert_allclose(rest, 0.0, rtol=0, atol=1e-11 * size)


@pytest.mark.parametrize("rate", [0.0, 1e-14, 1e-6, -1e-6, 1e-2])
def test_a_free_mode_that_hardly_anything_damps_drives_another(rate):
    """Its part is the only one, and slow: the mode that it drives is not on its own."""
    squares, damping, duration = np.zeros(2), np.array([[0.0, 0.3], [0.0, rate]]), 3.0
    response = core.modal_response(squares, damping, duration=duration)
    assert not response.alone.any()
    start, force = np.array([[1.0, -0.4], [0.3, -2.0]]), np.array([-0.6, 0.8])
    for t in (duration, duration / 3):
        exact = exactly(squares, damping, 0.0, start, force, t)
        assert_allclose(moved(response, start, force, t), exact, rtol=0, atol=1e-13 * np.max(np.abs(exact)))
