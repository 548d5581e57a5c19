"""A level with channels is the level without them in eta, and in w what the full equations say."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, stop

import multiphi_exudyn as mp
import multiphi_exudyn._core as core
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_levels import LoadedLevels

STOPS = (stop("m1", 0.2), stop("m4", 0.1, 30.0, "soft"), stop("m2", 0.1, 20.0, "law"))
LOADS = (
    mp.HarmonicLoad("m3", 2.0, 0.3),
    mp.StopMotion("stop", mp.Harmonic(0.1, 0.7)),
    mp.StopMotion("soft", mp.Harmonic(0.2, 0.5)),
)
CLOSED = [(), ("stop",), ("soft",), ("stop", "soft"), ("law", "soft")]
GIVEN = {closed: mp.LevelOverride([0.3, 0.9], [0.1, 0.05]) for closed in CLOSED}


def model(overrides=None, modes=4):
    return mp.MultiPhiModel(chain(5, stiffness=10.0), STOPS, modes, overrides or {})


def with_and_without(m, closed, loads=LOADS):
    """A level under a static load alone, and under loads that vary as well."""
    load = m.base.modes.shapes.T @ np.array([0.0, -1.0, 0.5, 0.0, 2.0])
    varying = dataclasses.replace(Excitation.of(m, loads, 1.0), static=load)
    states = [int(contact.name in closed) for contact in m.contacts]
    levels = LoadedLevels.under(m, varying, 0.0, 1.0)
    return levels.alone.level(states), levels.level(states)


@pytest.mark.parametrize("overrides", [None, GIVEN], ids=["computed", "given"])
@pytest.mark.parametrize("closed", CLOSED)
class TestWhileNothingVaries:
    def test_energies_are_those_without_channels(self, closed, overrides):
        alone, level = with_and_without(model(overrides), closed)
        eta = np.random.default_rng(1).normal(size=(level.modal.modes, 3))
        xi = np.pad(eta, ((0, level.excitation.channels), (0, 0)))
        rest = alone.asymptotic
        expected = (
            0.5 * alone.level.squares @ eta**2 + (alone.level.vectors.T @ rest.load - rest.drive) @ eta + rest.strain
        )
        assert_allclose(alone.strain(eta), expected, rtol=1e-12)
        assert_allclose(level.strain(xi), expected, rtol=1e-12)
        assert_allclose(level.kinetic(xi), alone.kinetic(eta), rtol=1e-13)
        assert_allclose(level.potential(xi[:, 0]), alone.potential(eta[:, 0]), rtol=1e-13)

    def test_the_maps_are_those_without_channels(self, closed, overrides):
        m = model(overrides)
        others = with_and_without(m, ("soft",))
        for other, level in zip(others, with_and_without(m, closed), strict=True):
            move, r, s = core.Transition(other.of_core, level.of_core), level.modal.modes, other.modal.modes
            assert_allclose(move.matrix[:r, :s], level.modal.vectors.T @ other.modal.vectors, atol=1e-13)
            assert_allclose(move.matrix[r:], np.eye(len(move.matrix) - r, len(move.matrix[0]), s), atol=0)


@pytest.mark.parametrize("modes", [2, "all"])
@pytest.mark.parametrize("closed", CLOSED)
def test_energies_in_xi_are_those_of_the_configuration(closed, modes):
    """The strain energy of base and springs; less the loads at their present values it is the form of the level."""
    m = model(modes=modes)
    _, level = with_and_without(m, closed)
    xi = np.random.default_rng(2).normal(size=level.level.modes)
    y, w = level.configuration(xi), level.split(xi)[1]
    gaps = m.base.gaps_at(y, m.base.gaps - level.excitation.moved(w))
    index = list(level.level.indices)
    springs = 0.5 * float(m.base.springs[index] @ gaps[index] ** 2)
    strain = 0.5 * float(m.base.squares @ y**2) + springs + m.base.energy_offset - float(m.base.preload @ y)
    assert_allclose(level.strain(xi), strain, rtol=1e-12)
    assert_allclose(level.potential(xi), level.strain(xi) - level.excitation.load(w) @ y, rtol=1e-12, atol=1e-12)


def test_the_strain_of_a_stop_that_moves_far_is_no_difference_of_large_energies():
    m = mp.MultiPhiModel(chain(1, stiffness=1e-6), [stop("m0", 0.0, 1e8, "soft")], "all")
    level = LoadedLevels.under(m, Excitation.of(m, [mp.StopMotion("soft", mp.Harmonic(1.0, 1.0))], 1.0), 0, 1).level(
        [1]
    )
    vector, shown = level.level.vectors[0]
    xi = np.array([(1.0 - 1e-4 - shown) / vector, 1.0])  # 0.1 mm inside a stop that has moved by 1 m
    assert_allclose(level.strain(xi), 0.5 * 1e8 * 1e-8 + 0.5 * level.level.base.modes.omega[0] ** 2, rtol=1e-9)
