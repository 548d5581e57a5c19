"""Truncation with friction on the rig's beam: own modes of every state against one basis for all."""

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp
from reference_models.massless_boundary import massless_boundary
from reference_models.rig import rig_beam, rig_damping

POINTS, T = ("node1", "node2", "node3"), np.linspace(0, 1, 2001)
RING = mp.Friction("ring", "node2", 0.6)
LOADS = {
    "3 Hz": mp.HarmonicLoad("node3", 0.5, 3.0, -math.pi / 2),
    "5 Hz": mp.HarmonicLoad("node3", 0.8, 5.0, -math.pi / 2),
}


@pytest.fixture(scope="module")
def beam():
    return mp.planar_beam(rig_beam(), elements=40, damping=rig_damping())


def histories(beam, modes, load):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = mp.simulate(mp.MultiPhiModel(beam, [RING], modes=modes), 1.0, loads=[load])
    assert run.status == "ok"
    assert len(run.stick_intervals("ring")) > 10
    return np.array([run.at(point, T) for point in POINTS])


def worst(found, true):
    return 100 * np.max(np.linalg.norm(found - true, axis=1) / np.linalg.norm(true, axis=1))


@pytest.mark.parametrize("load", LOADS.values(), ids=LOADS)
def test_eight_and_twelve_modes_of_every_state_suffice(beam, load):
    """NRMSE of the worst point over 1 s, per cent, of 86 modes; a massless boundary at the same number is behind."""
    true = histories(beam, "all", load)
    errors = {modes: worst(histories(beam, modes, load), true) for modes in (4, 6, 8, 12)}
    assert errors[4] < 0.5
    assert errors[6] < 0.1
    assert errors[8] < 0.05
    assert errors[12] < 0.005
    for modes in (6, 8, 12):
        other = massless_boundary(beam, RING, load, modes, 1.0)
        assert 1.2 * errors[modes] < worst(np.array([other.at(point, T) for point in POINTS]), true) < 0.2


class TestMasslessBoundary:
    load = mp.HarmonicLoad("m5", 1.3, 0.31, 0.4)

    @pytest.mark.parametrize("stiffness", [math.inf, 30.0])
    def test_with_all_modes_is_the_structure(self, stiffness):
        structure, friction = chain(6, stiffness=9.0), mp.Friction("ring", "m3", 0.3, stiffness=stiffness)
        run = mp.simulate(mp.MultiPhiModel(structure, [friction], modes="all"), 8.0, loads=[self.load])
        found = massless_boundary(structure, friction, self.load, 6, 8.0)
        t = np.linspace(0, 8, 81)
        assert len(run.events) > 3
        for point in ("m0", "m3", "m5"):
            assert_allclose(found.at(point, t), run.at(point, t), rtol=0, atol=1e-12)

    def test_at_rest_it_has_the_whole_flexibility(self):
        """A slow load below the limit: x = K_l^-1 b f, with the ring's place held, however few modes."""
        structure, friction = chain(6, stiffness=9.0), mp.Friction("ring", "m3", 3.0)
        slow = mp.HarmonicLoad("m5", 1.3, 1e-5, -math.pi / 2)
        t = np.linspace(0, 1e5, 11)[1:]
        run = mp.simulate(mp.MultiPhiModel(structure, [friction], modes="all"), 1e5, loads=[slow])
        found = massless_boundary(structure, friction, slow, 2, 1e5)
        for point in ("m0", "m3", "m5"):
            assert_allclose(found.at(point, t), run.at(point, t), rtol=0, atol=2e-4)
