"""Forced response in closed form: it satisfies its equation, near to poles and far from them alike."""

import numpy as np
import pytest
from carriers import CARRIERS
from long_exponential import long_expm
from numpy.testing import assert_allclose
from scipy.linalg import expm

from multiphi_exudyn import _core

SQUARES = np.array([0.0, 1.0, 1.0001, 25.0, 625.0, 9e4])
DIAGONAL = np.diag([0.0, 0.0, 0.02, 10.0, 50.0, 3.0])  # rigid, undamped, lightly damped, critical twice, stiff


def coupled(rigid_alone):
    root = 0.5 * np.random.default_rng(1).normal(size=(6, 6))
    damping = root @ root.T
    if rigid_alone:
        damping[0] = damping[:, 0] = 0.0
    return damping


DAMPING = {"diagonal": DIAGONAL, "rigid-alone": coupled(True), "all": coupled(False)}


def differentiated(x, rate, unit):
    """Coefficients of the derivative of exp(rate t) sum_k x_k (t / unit)^k."""
    after = np.zeros_like(x)
    after[:-1] = np.arange(1, len(x))[:, None] / unit * x[1:]
    return rate * x + after


def value(x, rate, t, unit):
    return (np.exp(rate * t) * ((t / unit) ** np.arange(len(x)) @ x)).real


@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize(("rate", "horizon", "degree"), CARRIERS)
def test_it_satisfies_its_equation(rate, horizon, degree, damping):
    given = DAMPING[damping]
    forces = np.random.default_rng(0).normal(size=(degree + 1, 6)) + 0j
    x = _core.particular(_core.modal_response(SQUARES, given), rate, forces, horizon)
    x_t = differentiated(x, rate, horizon)
    x_tt = differentiated(x_t, rate, horizon)
    for t in np.linspace(0, horizon, 5):
        eta, eta_t, eta_tt, right = (value(rows, rate, t, horizon) for rows in (x, x_t, x_tt, forces))
        size = np.abs(eta_tt) + np.abs(given) @ np.abs(eta_t) + SQUARES * np.abs(eta)
        assert_allclose(eta_tt + given @ eta_t + SQUARES * eta, right, rtol=0, atol=3e-12 * float(np.max(size)))


@pytest.mark.parametrize("beside", [0.0, 1e-12, 1e-7, 1e-2])
@pytest.mark.parametrize("rate", [2j, 2.05j, -0.4 + 0.3j, 40j, 0.0])
def test_it_does_so_where_friction_couples_modes_at_resonance_too(beside, rate):
    squares, coupling, horizon = np.array([3.0, 5.0]), np.array([[0.0, 2.0], [-0.5 * (1 + beside), 0.0]]), 2.0
    forces = np.array([[1.0, -0.5j], [0.3, 0.8]], complex)
    x = _core.particular(_core.modal_response(squares, np.zeros((2, 2)), coupling), rate, forces, horizon)
    x_tt = differentiated(differentiated(x, rate, horizon), rate, horizon)
    for t in np.linspace(0, horizon, 5):
        left = value(x_tt + x @ (np.diag(squares) + coupling).T, rate, t, horizon)
        size = np.max((t / horizon) ** np.arange(len(x)) @ np.abs(x_tt)) + 1
        assert_allclose(left, value(forces, rate, t, horizon), rtol=0, atol=1e-11 * size)


def test_nothing_grows_beyond_the_load_near_a_pole():
    """At 1e-9 from resonance the finite polynomial would be 1e9 times too large and cancel with the free response."""
    response = _core.modal_response(np.array([4.0]), np.zeros((1, 1)))
    for offset in (0.0, 1e-12, 1e-9, 1e-6, 1e-3):
        x = _core.particular(response, 2j * (1 + offset), np.ones((1, 1), complex), 10.0)
        assert np.max(np.abs(x)) < 10.0


def test_a_mode_that_no_force_acts_on_stays_at_rest_and_adds_no_rows():
    response, forces = _core.modal_response(SQUARES, DIAGONAL), np.zeros((1, 6), complex)
    assert not np.any(_core.particular(response, 3j, np.zeros((4, 6), complex), 1.0))
    forces[0, 5] = 1.0
    x = _core.particular(response, 1j, forces, 30.0)
    assert np.flatnonzero(x).tolist() == [5]
    assert len(_core.particular(response, 1j, 0 * forces, 30.0)) == len(x) == 1


@pytest.mark.parametrize("damping", ["diagonal", "all"])
@pytest.mark.parametrize("rate", [0.0, 0.7j])
def test_beside_a_motion_it_has_no_more_powers_than_the_load(damping, rate):
    """Near its poles too, as long as it is no more than ten times the motion; it is another solution, as good."""
    squares, delta = np.array([1.0, 9.0, 100.0]), {"diagonal": 0.1 * np.eye(3), "all": 0.05 + 0.1 * np.eye(3)}[damping]
    horizon, forces = 2.0**-6, np.random.default_rng(0).normal(size=(2, 3)) + 0j
    response, forced = _core.modal_response(squares, delta), _core.ForcedResponse()
    rest = forced.compute(response, rate, forces, horizon)
    assert len(rest) > 6
    for size, rows in ((1e-9, len(rest)), (1e4, 2)):
        x = forced.compute(response, rate, forces, horizon, size * np.ones(3), size * np.ones(3))
        assert len(x) == rows
    from_rest = []
    for given in (x, rest):
        free = response.coefficients(-given[0].real, -differentiated(given, rate, horizon)[0].real)
        times = horizon * np.linspace(0.0, 1.0, 5)[1:]
        from_rest.append([value(given, rate, t, horizon) + response.state(free, t)[0] for t in times])
    assert_allclose(from_rest[0], from_rest[1], rtol=0, atol=1e-14 * np.max(np.abs(x)))


def test_a_driven_zero_frequency_mode_is_a_chain():
    squares, coupling = np.array([0.0, 9.0]), np.array([[0.0, 2.0], [0.0, 1.5]])
    response = _core.modal_response(squares, np.zeros((2, 2)), coupling)
    assert [chain.mixing.tolist() for chain in response.chains] == [[[0.0, 1.0], [0.0, 0.0]]]
    x = _core.particular(response, 0.7j, np.array([[1.0, 0.5]], complex), 3.0)
    start, t = (np.array([1.0, 0.3]), np.array([-0.2, 0.4])), 3.0
    c = response.coefficients(start[0] - x[0].real, start[1] - differentiated(x, 0.7j, 3.0)[0].real)
    system = np.zeros((6, 6))
    system[:2, 2:4], system[2:4, :2] = np.eye(2), -np.diag(squares) - coupling
    system[2:4, 4], system[4, 5], system[5, 4] = [1.0, 0.5], -0.7, 0.7
    exact = (expm(system * t) @ np.concatenate([*start, [1.0, 0.0]]))[:2]
    assert_allclose(response.state(c, t)[0] + value(x, 0.7j, t, 3.0), exact, rtol=0, atol=1e-12)


@pytest.mark.parametrize("carrier", [0.0, -1e-9, -0.3, -4.0])
@pytest.mark.parametrize("horizon", [0.5, 20.0])
def test_slowly_damped_masses_move_exactly_from_rest(carrier, horizon):
    """The force's exp(carrier t) as one more state of the matrix exponential."""
    for rate in 10.0 ** np.arange(-14, 0.1, 0.5):
        for squares, damping in (
            (np.zeros(1), np.array([[rate]])),
            (np.array([0.0, 2.0, 30.0]), np.outer(*2 * [[np.sqrt(rate), 0.7, -0.4]])),
        ):
            r, response = len(squares), _core.modal_response(squares, damping, duration=horizon)
            force = np.arange(1.0, r + 1)
            x = _core.particular(response, carrier, force[None].astype(complex), horizon)
            c = response.coefficients(-x[0].real, -differentiated(x, carrier, horizon)[0].real)
            system = np.zeros((2 * r + 1, 2 * r + 1))
            system[:r, r : 2 * r], system[r:-1, :r], system[r:-1, r:-1] = np.eye(r), -np.diag(squares), -damping
            system[r:-1, -1], system[-1, -1] = force, carrier
            expected = long_expm(system * horizon)[:r, -1]
            found = response.state(c, horizon)[0] + value(x, carrier, horizon, horizon)
            assert_allclose(found, expected, rtol=0, atol=3e-12 * np.max(np.abs(expected)))


def test_it_ends_where_poles_that_are_solved_together_are_far_apart_in_time():
    """Its series would grow beyond all numbers: it has no end, but for them."""
    delta = 1 - 2e-5
    response = _core.modal_response(np.ones(1), np.array([[2 * delta]]))
    x = _core.particular(response, complex(-delta, np.sqrt(1 - delta**2)), np.ones((1, 1), complex), 2.0**18)
    assert not np.all(np.isfinite(x))


def test_one_object_serves_levels_of_any_size():
    forced, random = _core.ForcedResponse(), np.random.default_rng(2)
    for r in (6, 2, 9, 1):
        response = _core.modal_response(np.arange(r) ** 2.0, 0.3 + np.eye(r))
        forces = random.normal(size=(3, r)) + 0j
        assert np.array_equal(forced.compute(response, 1j, forces, 0.5), _core.particular(response, 1j, forces, 0.5))


def test_loads_that_do_not_fit_are_refused():
    response = _core.modal_response(np.ones(2), np.eye(2))
    with pytest.raises(ValueError, match=r"forces: got shape \(1, 3\), need \(1, 2\)"):
        _core.particular(response, 1j, np.ones((1, 3), complex), 1.0)
    with pytest.raises(ValueError, match="need one for each power"):
        _core.particular(response, 1j, np.ones((0, 2), complex), 1.0)
    with pytest.raises(ValueError, match="need both or none"):
        _core.ForcedResponse().compute(response, 1j, np.ones((1, 2), complex), 1.0, np.ones(2))
