"""A transition is the best approximation in both energies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_structures import chain, random_model, stop

import multiphi_exudyn._core as core
from multiphi_exudyn import LinearStructure, MultiPhiModel
from multiphi_exudyn.time.loaded_levels import LoadedLevels


def loaded(model, closed, load=None):
    levels = LoadedLevels.static(model, np.zeros(model.base.modes.count) if load is None else load)
    return levels.level([int(contact.name in closed) for contact in model.contacts])


class Transition:
    """The map from one level into another, without channels."""

    def __init__(self, source, target):
        move = core.Transition(source.of_core, target.of_core)
        self.matrix, self.velocity_matrix, self.offset = move.matrix, move.velocity_matrix, move.offset

    def displacement(self, eta):
        return self.matrix @ eta + self.offset

    def velocity(self, eta_t):
        return self.velocity_matrix @ eta_t


class TestTransition:
    def test_between_complete_levels_and_back_loses_nothing(self):
        """A compliant contact closes: the whole space stays, so the map is orthogonal."""
        m = MultiPhiModel(chain(6), [stop("m2", 0.3, 50.0)], modes="all")
        there = Transition(loaded(m, ()), loaded(m, ("stop",)))
        back = Transition(loaded(m, ("stop",)), loaded(m, ()))
        assert_allclose(there.matrix @ there.matrix.T, np.eye(6), atol=1e-13)
        eta = np.random.default_rng(1).normal(size=6)
        assert_allclose(back.displacement(there.displacement(eta)), eta, atol=1e-12)

    def test_keeps_what_the_next_level_can_hold(self):
        m = MultiPhiModel(chain(6), [stop("m2", 0.3)], modes="all")
        opened, closed = loaded(m, ()), loaded(m, ("stop",))
        eta = np.random.default_rng(2).normal(size=5)
        released = Transition(closed, opened)
        assert_allclose(opened.configuration(released.displacement(eta)), closed.configuration(eta), atol=1e-13)
        assert_allclose(m.level(()).shapes @ released.velocity(eta), m.level(("stop",)).shapes @ eta, atol=1e-13)
        assert_allclose(opened.potential(released.displacement(eta)), closed.potential(eta), rtol=1e-12)

    def test_modes_without_a_part_in_each_other_do_not_mix(self):
        """A stop in the middle of a symmetric chain: its antisymmetric modes stay what they are."""
        between = 2 * np.eye(7) - np.eye(7, k=1) - np.eye(7, k=-1)
        structure = LinearStructure(np.eye(7), 30 * between, points={"middle": 3})
        m = MultiPhiModel(structure, [stop("middle", 0.3, 50.0)], modes="all")
        matrix = Transition(loaded(m, ()), loaded(m, ("stop",))).matrix
        symmetric = [[vector @ vector[::-1] > 0 for vector in m.level(c).shapes.T] for c in (("stop",), ())]
        other = np.logical_xor.outer(*symmetric)
        assert np.sum(other) == 24
        assert np.all(matrix[other] == 0)
        assert_allclose(matrix @ matrix.T, np.eye(7), atol=1e-13)

    def test_a_stiff_mode_keeps_its_small_part_in_a_soft_one(self):
        """One stop stays closed, another takes over from its twin at zero: no strain energy is lost.

        The load pulls the soft modes far from where the masses are, so the little that the stiff ones share with them
        is what the spring of the first stop is pressed by.
        """
        twins = [stop("m1", 0.0, 1.2e6, "below"), stop({"m1": -1.0}, 0.0, 1e6, "above")]
        m = MultiPhiModel(chain(3), [stop("m0", 0.0, 2e6, "held"), *twins], modes="all")
        load = m.base.modes.shapes.T @ np.full(3, -20.0)
        below, above = loaded(m, ("held", "below"), load), loaded(m, ("held", "above"), load)
        place = m.base.modes.shapes.T @ np.array([-1e-3, 0.0, 1.0])
        eta = below.modal.vectors.T @ (place - below.asymptotic.configuration)
        move = Transition(below, above)
        assert np.min(np.abs(below.modal.vectors.T @ above.modal.vectors)) < 1e-13
        assert_allclose(above.potential(move.displacement(eta)), below.potential(eta), rtol=3e-12)

    @settings(max_examples=80)
    @given(st.integers(0, 2**31), st.booleans(), st.booleans())
    def test_energies_never_rise(self, seed, rigid_body, complete_source):
        """From any admissible state: kinetic energy, and strain energy less the work of the static load."""
        m, random = random_model(seed, rigid_body=rigid_body, truncated=not complete_source)
        every = MultiPhiModel(m.structure, m.contacts, modes="all")
        load = every.base.modes.shapes.T @ random.normal(size=m.structure.n)
        names = [contact.name for contact in m.contacts]
        closed = tuple(name for name in names if random.random() < 0.5)
        source, target = loaded(every, closed, load), loaded(m, closed, load)
        eta, rate = random.normal(size=(2, source.level.modes))
        if m.modes == "all":  # the same space: a transition to itself is the identity
            assert_allclose(Transition(source, target).displacement(eta), eta, atol=1e-10)
        move = Transition(source, target)
        kinetic = rate @ rate
        assert move.velocity(rate) @ move.velocity(rate) <= kinetic * (1 + 1e-12)
        before, after = source.potential(eta), target.potential(move.displacement(eta))
        if not np.any(target.asymptotic.drive - move.matrix @ source.asymptotic.drive):
            assert after <= before + 1e-9 * max(1, abs(before))


class TestLoadedLevel:
    @pytest.mark.parametrize("closed", [(), ("stop",), ("soft",), ("stop", "soft")])
    @pytest.mark.parametrize("ends", [0, 1])
    def test_strain_and_potential_are_those_of_the_full_matrices(self, closed, ends):
        structure = chain(5, ends=ends)
        m = MultiPhiModel(structure, [stop("m1", 0.2), stop("m4", 0.1, 30.0, "soft")], modes="all")
        force = np.array([1.0, 0.0, -2.0, 0.5, 3.0])
        level = loaded(m, closed, m.base.modes.shapes.T @ force)
        eta = np.random.default_rng(3).normal(size=level.level.modes)
        x = m.base.modes.shapes @ level.configuration(eta)
        strain = 0.5 * x @ structure.stiffness @ x + (0.5 * 30 * (x[4] + 0.1) ** 2 if "soft" in closed else 0.0)
        assert_allclose(level.strain(eta), strain, rtol=1e-11)
        assert_allclose(level.potential(eta), strain - force @ x, rtol=1e-11)
        assert_allclose(level.level.gap_rows[0] @ eta + level.gap_constants[0], x[1] + 0.2, atol=1e-12)
