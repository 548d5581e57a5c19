"""Runs of structures that a far softer spring holds than bend them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp


def chain(ground):
    """Three masses in a row, and a spring to the ground."""
    stiffness = np.array([[5.5, -5.5, 0.0], [-5.5, 23.5, -18.0], [0.0, -18.0, 18.0]])
    stiffness[0, 0] += ground
    return mp.LinearStructure(np.diag([0.7, 0.9, 2.0]), stiffness, points={"left": 0, "middle": 1, "right": 2})


@pytest.mark.parametrize("ground", [1e-10, 1e-9, 1e-8])
def test_friction_beside_rigid_stops_sticks_as_on_a_free_structure(ground):
    """The force of its spring is at the limit as it sticks: a rest of it would make it slip on, against its slip."""
    contacts = [
        mp.UnilateralContact("below", {"right": -1.0}, 0.0),
        mp.UnilateralContact("across", {"left": 0.9, "middle": 1.0, "right": 0.2}, 0.0),
        mp.Friction("rubs", {"left": 1.0, "right": -1.0}, 1.3, stiffness=11.0),
    ]

    def run(ground):
        model = mp.MultiPhiModel(chain(ground), contacts, modes="all")
        return mp.simulate(model, 1.0, displacement=np.zeros(3), velocity=[-1.6, 0.1, 0.7])

    held, free = run(ground), run(0.0)
    assert [event.kind for event in held.events][:4] == ["close", "close", "slip", "stick"]
    assert [(event.kind, event.contact) for event in held.events] == [(e.kind, e.contact) for e in free.events]
    times = np.linspace(0.0, 1.0, 50)
    assert_allclose(held.displacement(times), free.displacement(times), rtol=0, atol=1e-7)
