"""The flat response is that of ``ModalResponse``, whatever the damping."""

import numpy as np
import pytest
from flat_records import Buffers
from numpy.testing import assert_allclose

from multiphi_exudyn.mathematics import flat_response
from multiphi_exudyn.mathematics.free_response import modal_response

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
    record, state = (
        buffers.put_response(response),
        buffers.put_numbers(np.concatenate([eta, eta_t, force, np.zeros(12)])),
    )
    c = buffers.put_waves(np.zeros(3 * p))
    flat_response.coefficients_of(*buffers.all, record, state, state + 6, state + 12 if forced else -1, c)
    assert_allclose(buffers.waves[c : c + p], expected, rtol=1e-14, atol=1e-14)
    for t in (0.0, 0.1, 2.0):
        flat_response.state_of(*buffers.all, record, c, t, state + 18, state + 24, c + p)
        found = buffers.numbers[state + 18 : state + 30]
        assert_allclose(found, np.concatenate(response.state(expected, t)), rtol=1e-12, atol=1e-12)


def test_an_exponential_of_one_mode_reaches_that_mode_only():
    buffers, response = Buffers(), modal_response(SQUARES, DIAGONAL)
    record = buffers.put_response(response)
    at = buffers.ints[record + flat_response.REACHED]
    reached = buffers.ints[at : at + 2 * len(response.basis.rates)].reshape(-1, 2)
    modes = np.argmax(response.shapes, axis=0)
    assert reached.tolist() == [[mode, mode + 1] for mode in modes]
