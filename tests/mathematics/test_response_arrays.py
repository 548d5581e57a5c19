"""The flat response is that of ``ModalResponse`` and ``particular``, whatever the damping."""

import numpy as np
import pytest
from buffer_records import Buffers, fast
from carriers import CARRIERS
from numpy.testing import assert_allclose

from multiphi_exudyn.mathematics.compiling import compiled
from multiphi_exudyn.mathematics.response import forced_arrays, response_arrays
from multiphi_exudyn.mathematics.response.coupled_response import modal_response
from multiphi_exudyn.mathematics.response.forced_response import particular

SQUARES = np.array([0.0, 1.0, 1.0001, 25.0, -4.0, 9e4])
DIAGONAL = np.diag([0.0, 0.0, 0.02, 10.0, 1.0, 3.0])


def coupled(free):
    root = 0.5 * np.random.default_rng(1).normal(size=(6, 6))
    damping = root @ root.T
    if free:
        damping[0] = damping[:, 0] = 0.0
    return damping


DAMPING = {
    "diagonal": DIAGONAL,
    "damped rigid": DIAGONAL + np.diag([2.0, 0, 0, 0, 0, 0]),
    "rigid alone": coupled(True),
    "all": coupled(False),
}


@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize("forced", [True, False])
def test_coefficients_and_state_are_those_of_the_modal_response(damping, forced):
    response, random = modal_response(SQUARES, DAMPING[damping]), np.random.default_rng(0)
    eta, eta_t, force = random.normal(size=(3, 6))
    force = np.where(SQUARES == 0, force, 0.0)
    expected = response.coefficients(eta, eta_t, force if forced else None)
    buffers, p = Buffers(), len(expected)
    record = buffers.put_response(response, SQUARES, DAMPING[damping])
    state = buffers.put_numbers(np.concatenate([eta, eta_t, force, np.zeros(12)]))
    c = buffers.put_waves(np.zeros(3 * p))
    response_arrays.coefficients_of(*buffers.all, record, state, state + 6, state + 12 if forced else -1, c)
    assert_allclose(buffers.waves[c : c + p], expected, rtol=1e-14, atol=1e-14)
    for t in (0.0, 0.1, 2.0):
        response_arrays.state_of(*buffers.all, record, c, t, state + 18, state + 24, c + p)
        found = buffers.numbers[state + 18 : state + 30]
        assert_allclose(found, np.concatenate(response.state(expected, t)), rtol=1e-12, atol=1e-12)


def test_an_exponential_of_one_mode_reaches_that_mode_only():
    buffers, response = Buffers(), modal_response(SQUARES, DIAGONAL)
    record = buffers.put_response(response, SQUARES, DIAGONAL)
    at = buffers.ints[record + response_arrays.REACHED]
    reached = buffers.ints[at : at + 2 * len(response.basis.rates)].reshape(-1, 2)
    modes = np.argmax(response.shapes, axis=0)
    assert reached.tolist() == [[mode, mode + 1] for mode in modes]


MOST = 80  # rows of a forced response


def forced(squares, damping, rate, forces, horizon, most=MOST, run=lambda function: function, motion=None):
    """Rows of the response, of which as many as there is room for; motion: eta and eta' (2, r) beside it, none."""
    buffers, (count, r) = Buffers(), forces.shape
    eta = buffers.put_numbers(np.zeros((2, r)) if motion is None else motion)
    record = buffers.put_response(modal_response(squares, damping), squares, damping)
    carrier, given = buffers.put_waves([rate]), buffers.put_waves(forces)
    scratch, x = buffers.put_waves(np.full(2 * most, np.nan)), buffers.put_waves(np.full(most * r, np.nan))
    rows = run(forced_arrays.forced_response)(
        *buffers.all, record, carrier, given, count - 1, horizon, eta, eta + r, most, scratch, x
    )
    return rows, buffers.waves[x : x + min(rows, most) * r].reshape(-1, r)


@pytest.mark.parametrize("damping", DAMPING)
@pytest.mark.parametrize(("rate", "horizon", "degree"), CARRIERS)
def test_the_forced_response_is_the_particular_one(damping, rate, horizon, degree):
    forces = np.random.default_rng(0).normal(size=(degree + 1, 6)) + 0j
    response = modal_response(SQUARES, DAMPING[damping])
    expected = particular(SQUARES, DAMPING[damping], response, rate, forces, horizon)
    rows, x = forced(SQUARES, DAMPING[damping], rate, forces, horizon)
    assert rows == len(expected)
    assert_allclose(x, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))


@pytest.mark.parametrize("seed", range(40))
def test_it_is_so_for_any_modes_and_loads(seed):
    random = np.random.default_rng(seed)
    r = int(random.integers(1, 6))
    omega = random.choice([0.0, 1.0, 3.0, 200.0], r) * random.choice([1.0, 1.001, 1.3], r)
    delta = np.maximum(omega, 1.0) * random.choice([0.0, 0.01, 0.99, 1.0, 1.00001, 4.0], r)
    damping = np.diag(2 * delta)
    if random.random() < 0.3:
        root = random.normal(size=(r, r))
        damping = damping + 0.3 * root @ root.T
    rate = random.choice([0.0, 1j, 3j, 200.0j, -1.0 + 0.1j]) * random.choice([1.0, 1 + 1e-9, 1 + 1e-3])
    horizon, degree = float(2.0 ** random.integers(-9, 6)), int(random.integers(0, 9))
    forces = random.normal(size=(degree + 1, r)) + 1j * random.normal(size=(degree + 1, r))
    expected = particular(omega**2, damping, modal_response(omega**2, damping), rate, forces, horizon)
    rows, x = forced(omega**2, damping, rate, forces, horizon)
    assert rows == len(expected)
    if rate == 0.0:  # of a force that does not turn the real part is all
        x, expected = x.real, expected.real
    assert_allclose(x, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))


@pytest.mark.parametrize("damping", ["diagonal", "all"])
@pytest.mark.parametrize("rate", [0.0, 0.7j])
def test_beside_a_motion_it_has_no_more_powers_than_the_load(damping, rate):
    """Near its poles too, as long as it is no more than ten times the motion; it is another solution, as good."""
    squares, delta = np.array([1.0, 9.0, 100.0]), {"diagonal": 0.1 * np.eye(3), "all": 0.05 + 0.1 * np.eye(3)}[damping]
    horizon, forces = 2.0**-6, np.random.default_rng(0).normal(size=(2, 3)) + 0j
    series, rest = forced(squares, delta, rate, forces, horizon)
    assert series > 6
    basis = modal_response(squares, delta)
    for size, rows in ((1e-9, series), (1e4, 2)):
        motion = size * np.ones((2, 3))
        found, x = forced(squares, delta, rate, forces, horizon, motion=motion)
        assert found == rows
    t = horizon * np.linspace(0.0, 1.0, 5)[1:]
    from_rest = []
    for given in (x, rest):
        unit = rate * given[0] + given[1] / horizon
        free = basis.coefficients(-given[0].real, -unit.real)
        forced_part = [(np.exp(rate * s) * ((s / horizon) ** np.arange(len(given)) @ given)).real for s in t]
        from_rest.append(np.array(forced_part) + [basis.state(free, s)[0] for s in t])
    assert_allclose(from_rest[0], from_rest[1], rtol=0, atol=1e-14 * np.max(np.abs(x)))


def test_a_mode_that_no_force_acts_on_stays_at_rest_and_adds_no_rows():
    forces = np.zeros((1, 6), complex)
    forces[0, 5] = 1.0
    rows, x = forced(SQUARES, DIAGONAL, 1j, forces, 30.0)
    assert rows == 1
    assert np.flatnonzero(x[0]).tolist() == [5]
    assert forced(SQUARES, DIAGONAL, 1j, 0 * forces, 30.0)[0] == 1


def test_it_says_how_many_rows_it_needs_where_there_are_too_few():
    forces = np.ones((3, 6), complex)
    enough, _ = forced(SQUARES, DIAGONAL, 1j, forces, 2.0)
    rows, x = forced(SQUARES, DIAGONAL, 1j, forces, 2.0, most=4)
    assert enough >= rows > 4
    assert not np.any(np.isnan(x[:1]))


@pytest.mark.skipif(not compiled.available(), reason="needs numba")
@pytest.mark.parametrize("damping", DAMPING)
def test_compiled_it_gives_what_it_gives_as_plain_python(damping):
    for rate, horizon, degree in CARRIERS:
        forces = np.random.default_rng(1).normal(size=(degree + 1, 6)) + 0j
        given = SQUARES, DAMPING[damping], rate, forces, horizon
        rows, x = forced(*given, run=fast)
        plain_rows, plain_x = forced(*given)
        assert rows == plain_rows
        assert_allclose(x, plain_x, rtol=0, atol=1e-14 * np.max(np.abs(plain_x)))
