"""Levels under held forces are those under the load that they come from, whatever forces were held before."""

import gc
import itertools
import weakref

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from small_structures import chain

import multiphi_exudyn as mp
import multiphi_exudyn._core as core
from multiphi_exudyn.exudyn_plugin.interface import direct_reactions
from multiphi_exudyn.levels.core_model import core_model
from multiphi_exudyn.time.loaded_levels import LoadedLevels

STRUCTURE = chain(3, damping=mp.ModalDamping([0.02, 0.01, 0.03]), stiffness=10.0)
STOP = mp.UnilateralContact("stop", "m2", 0.1, 50.0)
CASES = {
    "compliant": [STOP],
    "rigid": [mp.UnilateralContact("stop", "m2", 0.1), mp.UnilateralContact("above", {"m0": -1.0}, 0.02)],
    "friction": [mp.Friction("ring", "m1", 0.3, stiffness=40.0), STOP],
    "friction of a contact": [mp.UnilateralContact("floor", "m1", 0.1, 50.0, friction=0.2, tangential={"m2": 1.0})],
}
FORCE = 0.7


def model_of(case):
    return mp.MultiPhiModel(STRUCTURE, CASES[case], modes="all")


def held_levels(model):
    levels = LoadedLevels.static(model, np.zeros(model.base.modes.count))
    return core.HeldLevels(core_model(model), levels.core_excitation())


def forces(model, point, force):
    in_base = STRUCTURE.row(point)[None, :] @ model.base.modes.shapes

    def acting(states):
        level = model.level_at(model.active_links(states))
        rows = in_base @ level.vectors
        return force * rows[0], force * direct_reactions(level, in_base, rows)[:, 0]

    return acting


def keys_of(model):
    return list(itertools.product(*(range(len(element.states)) for element in model.contacts)))


@pytest.mark.parametrize("point", ["m0", "m2"])
@pytest.mark.parametrize("case", CASES)
def test_a_held_force_is_a_load(case, point):
    model = model_of(case)
    load = model.base.modes.shapes.T @ STRUCTURE.row(point) * FORCE
    loaded, held = LoadedLevels.static(model, load).in_core, held_levels(model)
    for earlier in (-3.0, FORCE):  # only the forces that were set last count
        held.set_forces(forces(model, point, earlier))
        for key in keys_of(model):
            held.level(key)
    random = np.random.default_rng(1)
    for key in keys_of(model):
        one, other = held.level(key), loaded.level(key)
        n = one.modes + one.channels
        assert_allclose(one.gap_constants, other.gap_constants, rtol=0, atol=1e-13)
        constants = [[guard.signal.constant for guard in level.guards] for level in (one, other)]
        assert_allclose(*constants, rtol=0, atol=1e-12)
        xi, xi_t = random.normal(size=n), random.normal(size=n)
        assert core.energies(one, xi, xi_t)[3] == pytest.approx(core.energies(other, xi, xi_t)[3], rel=1e-12)
        for k in range(len(one.guards)):
            entered = [levels.entered_signal(level, k).constant for levels, level in ((held, one), (loaded, other))]
            assert_allclose(*entered, rtol=0, atol=1e-12)
        for target in keys_of(model):
            ways = held.transition(one, held.level(target)), loaded.transition(other, loaded.level(target))
            assert_allclose(*(way.offset for way in ways), rtol=0, atol=1e-13)
            assert_array_equal(*(way.matrix for way in ways))


@pytest.mark.parametrize("case", CASES)
def test_without_forces_and_inertia_they_are_the_plain_levels_again(case):
    model = model_of(case)
    plain, held = LoadedLevels.static(model, np.zeros(model.base.modes.count)).in_core, held_levels(model)
    keys = keys_of(model)
    inertia = (
        lambda states: 0.5 * np.eye(model.level_at(model.active_links(states)).modes),
        lambda source, target, matrix: 0.5 * matrix,
    )
    held.set_forces(forces(model, "m1", FORCE), inertia)
    before, after = held.level(keys[0]), held.level(keys[1])
    found = held.transition(before, after).velocity_matrix[: after.modes, : before.modes]
    matrix = plain.transition(plain.level(keys[0]), plain.level(keys[1])).velocity_matrix
    assert_array_equal(found, 0.5 * matrix[: after.modes, : before.modes])
    held.set_forces(forces(model, "m1", 0.0))
    for key in keys:
        one, other = held.level(key), plain.level(key)
        assert_array_equal(one.gap_constants, other.gap_constants)
        assert [g.signal.constant for g in one.guards] == [g.signal.constant for g in other.guards]
        for target in keys:
            ways = held.transition(one, held.level(target)), plain.transition(other, plain.level(target))
            assert_array_equal(*(way.velocity_matrix for way in ways))
            assert_array_equal(*(way.offset for way in ways))


def test_forces_that_refer_to_their_levels_do_not_keep_them():
    class Owner:
        pass

    owner = Owner()
    owner.levels = held_levels(model_of("compliant"))
    owner.levels.set_forces(lambda states, kept=owner: (kept, states))
    alive = weakref.ref(owner)
    del owner
    gc.collect()
    assert alive() is None
