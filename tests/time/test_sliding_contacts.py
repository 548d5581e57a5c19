"""Contacts that rub: with friction that tends to none they move as contacts without."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import multiphi_exudyn as mp


@pytest.mark.parametrize("speed", [2.0, -2.0, 0.3])
def test_a_viscous_contact_that_slides_opens_as_one_without_friction(speed):
    """Its damper leaves it inside its stop, however fast it slides: to stick first would take that speed away."""
    structure = mp.LinearStructure([[1.0, 0.4], [0.4, 1.0]], np.diag([4.0, 1.0]), points={"z": 0, "x": 1})
    runs = []
    for rubs in ({}, {"tangential": "x", "friction": 1e-10}):
        contact = mp.UnilateralContact("floor", "z", 0.05, 200.0, damping=8.0, **rubs)
        runs.append(mp.simulate(mp.MultiPhiModel(structure, [contact], modes="all"), 12.0, velocity=[-1.0, speed]))
    smooth, rubbing = runs
    assert len(smooth.contact_intervals("floor")) > 3
    assert_allclose(rubbing.contact_intervals("floor"), smooth.contact_intervals("floor"), rtol=0, atol=1e-7)
    assert_allclose(rubbing.at("z", 12.0), smooth.at("z", 12.0), rtol=0, atol=1e-7)
