"""A load in a thousand pieces is the load in two, whatever happens where pieces meet; and each piece costs little."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp

DAMPING = np.diag([0.1, 0.05, 0.2])
END = 6.0
RAMPS = mp.SampledLoad("m1", [0.0, 2.5, 9.0], [0.0, 4.0, -3.0])
ELEMENTS = {
    "compliant": [
        mp.UnilateralContact("below", "m2", 0.1, 50.0),
        mp.UnilateralContact("above", {"m0": -1.0}, 0.1, 30.0),
    ],
    "rigid": [mp.UnilateralContact("below", "m2", 0.1)],
    "restitution": [mp.UnilateralContact("below", "m2", 0.1, restitution=0.6)],
    "friction": [mp.Friction("ring", "m1", 0.5)],
    "friction and contact": [mp.Friction("ring", "m0", 0.4), mp.UnilateralContact("below", "m2", 0.1, 50.0)],
}


def run_of(elements, times=None):
    """Under two ramps; with noise at ``times`` that one more load takes back."""
    loads = [RAMPS]
    if times is not None:
        noise = np.random.default_rng(2).normal(size=len(times))
        loads += [mp.SampledLoad("m2", times, noise), mp.SampledLoad("m2", times, -noise)]
    model = mp.MultiPhiModel(chain(3, damping=DAMPING, stiffness=10.0), elements, modes="all")
    return mp.simulate(model, END, displacement=[0.03, 0.06, -0.09], loads=loads)


def assert_alike(found, expected, tolerance):
    assert found.status == expected.status == "ok"
    assert [(e.contact, e.state) for e in found.events] == [(e.contact, e.state) for e in expected.events]
    assert_allclose([e.time for e in found.events], [e.time for e in expected.events], rtol=0, atol=tolerance * END)
    times = np.linspace(0.0, END, 301)
    motion = expected.displacement(times)
    assert_allclose(found.displacement(times), motion, rtol=0, atol=tolerance * np.max(np.abs(motion)))


@pytest.mark.parametrize("elements", ELEMENTS)
def test_in_a_thousand_pieces_it_moves_and_strikes_as_in_two(elements):
    expected = run_of(ELEMENTS[elements])
    assert len(expected.events) > 1
    assert_alike(run_of(ELEMENTS[elements], np.linspace(0.0, 9.0, 1001)), expected, 1e-11)


@pytest.mark.parametrize("elements", ELEMENTS)
@pytest.mark.parametrize("apart", [0.0, 1e-14, 1e-12, 1e-9, 1e-4])
def test_pieces_that_end_with_an_event_or_close_to_it_neither_miss_nor_double_it(elements, apart):
    """Before each event, after it, and at it; so they are of very unequal lengths."""
    expected = run_of(ELEMENTS[elements])
    instants = np.unique([e.time for e in expected.events])
    times = np.unique(np.concatenate([[0.0, 9.0], np.linspace(0.0, 9.0, 38), instants - apart, instants + apart]))
    assert_alike(run_of(ELEMENTS[elements], times[times >= 0.0]), expected, 1e-9)
