"""Levels are the constrained or sprung eigenproblems of the full matrices, whatever set of contacts is closed."""

import math

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_structures import chain, random_structure, stop

from multiphi_exudyn import (
    LevelOverride,
    LinearStructure,
    MultiPhiModel,
    NumericalFailure,
    RayleighDamping,
    UnilateralContact,
)


def model(seed=0, *stiffnesses, rigid_body=False, modes="all", damping=None):
    """A random structure with a contact per stiffness, in random directions, gaps 0.1, 0.2, ..."""
    n, mass, stiffness, _, random = random_structure(seed, rigid_body=rigid_body)
    contacts = [UnilateralContact(f"c{i}", random.normal(size=n), 0.1 * (i + 1), k) for i, k in enumerate(stiffnesses)]
    structure = LinearStructure(mass, stiffness, damping=damping, points={f"m{i}": i for i in range(n)})
    return MultiPhiModel(structure, contacts, modes=modes)


def rows(m):
    return np.array([contact.direction for contact in m.contacts])


def constrained_frequencies(m, pinned, sprung):
    """omega of (M, K + sum k h h^T) on the null space of the pinned rows, by scipy's dense eigensolver."""
    stiffness = np.array(m.structure.stiffness) + sum(
        m.contacts[i].stiffness * np.outer(rows(m)[i], rows(m)[i]) for i in sprung
    )
    free = scipy.linalg.null_space(rows(m)[pinned]) if pinned else np.eye(m.structure.n)
    mass = np.asarray(m.structure.mass)
    return np.sqrt(np.abs(scipy.linalg.eigh(free.T @ stiffness @ free, free.T @ mass @ free, eigvals_only=True)))


KINDS = [(math.inf,), (1e3,), (math.inf, math.inf), (math.inf, 50.0), (10.0, 1e4), (math.inf, 3.0, math.inf)]


class TestModesOfALevel:
    @pytest.mark.parametrize("kinds", KINDS)
    @pytest.mark.parametrize("rigid_body", [False, True])
    def test_are_those_of_the_constrained_and_sprung_matrices(self, kinds, rigid_body):
        for seed in range(5):
            m = model(seed, *kinds, rigid_body=rigid_body)
            if m.structure.n <= len(kinds):
                continue
            level = m.level([contact.name for contact in m.contacts])
            pinned = [i for i, k in enumerate(kinds) if math.isinf(k)]
            sprung = [i for i, k in enumerate(kinds) if not math.isinf(k)]
            assert_allclose(level.omega, constrained_frequencies(m, pinned, sprung), rtol=1e-9, atol=1e-6)
            gram = level.shapes.T @ m.structure.mass @ level.shapes
            assert_allclose(gram, np.eye(level.modes), atol=1e-12)
            assert_allclose(rows(m)[pinned] @ level.shapes, 0, atol=1e-12)

    def test_added_contacts_interlace(self):
        for seed in range(10):
            m = model(seed, math.inf, 1e3)
            opened = m.level(()).omega
            pinned, sprung = m.level(("c0",)).omega, m.level(("c1",)).omega
            assert np.all(pinned >= opened[:-1] * (1 - 1e-12))
            assert np.all(pinned <= opened[1:] * (1 + 1e-12))
            assert np.all(sprung >= opened * (1 - 1e-12))
            assert np.all(sprung[:-1] <= opened[1:] * (1 + 1e-12))

    def test_rigid_is_the_limit_of_stiffness_at_first_order(self):
        rigid = model(3, math.inf).level(("c0",)).omega
        low = slice(0, 2)
        errors = [np.abs(model(3, k).level(("c0",)).omega[low] / rigid[low] - 1).max() for k in (1e6, 1e7, 1e8)]
        assert errors[2] < 1e-6
        assert_allclose(np.divide(errors[:-1], errors[1:]), 10, rtol=1e-2)

    def test_truncated_level_has_the_low_modes_and_builds_no_new_base(self):
        full = model(1, math.inf, 1e3)
        few = MultiPhiModel(full.structure, full.contacts, modes=2)
        for closed in ((), ("c0",), ("c0", "c1")):
            assert_allclose(few.level(closed).omega, full.level(closed).omega[:2], rtol=1e-14)
            assert few.level(closed).shapes.shape == (full.structure.n, 2)

    def test_a_free_body_is_held_by_one_stop_and_keeps_its_rotation(self):
        mass, stiffness = np.diag([1.0, 2.0]), np.zeros((2, 2))  # two unconnected masses: two rigid-body modes
        m = MultiPhiModel(LinearStructure(mass, stiffness, points={"a": 0, "b": 1}), [stop("a")], modes="all")
        assert_allclose(m.level(()).omega, [0, 0])
        assert_allclose(m.level(("stop",)).omega, [0])
        assert_allclose(m.level(("stop",)).shapes[0], 0, atol=1e-15)

    @pytest.mark.parametrize("seed", range(20))
    def test_the_motion_of_all_masses_together_changes_no_gap_between_them(self, seed):
        """What round-off left of it was struck once with 1e17 times the momentum."""
        random = np.random.default_rng(seed)
        mass, springs = np.diag(random.uniform(0.5, 2, 5)), random.uniform(1, 1e4, 4)
        across = np.diff(np.eye(5), axis=0)
        structure = LinearStructure(mass, across.T @ (springs[:, None] * across))
        pairs = ((3, 2), (1, 0), (0, 4))
        stops = [UnilateralContact(f"c{k}", np.eye(5)[i] - np.eye(5)[j], 0.0) for k, (i, j) in enumerate(pairs)]
        free = MultiPhiModel(structure, stops, modes=1)
        for closed in ((), ("c0",), ("c1",), ("c0", "c1"), ("c0", "c1", "c2")):
            assert not np.any(free.level(closed).gap_rows)

    def test_dependent_rigid_contacts_are_a_failure_that_names_them(self):
        twice = [stop("m0", name="left"), stop("m0", name="right")]
        with pytest.raises(NumericalFailure, match="left, right"):
            MultiPhiModel(chain(3), twice, modes="all").level(("left", "right"))

    def test_damping_is_the_projected_matrix(self):
        m = model(2, math.inf, damping=RayleighDamping(0.3, 2e-3))
        level = m.level(("c0",))
        full = 0.3 * np.array(m.structure.mass) + 2e-3 * np.array(m.structure.stiffness)
        assert_allclose(level.damping, level.shapes.T @ full @ level.shapes, rtol=0, atol=1e-10)
        assert_allclose(level.ratios, np.diagonal(level.damping) / (2 * level.omega), rtol=1e-14)


class TestAsymptoticConfiguration:
    def test_is_the_guyan_shape(self):
        """Eq. (38.5): x = [-K_uu^-1 K_uk; I] x_k for a boundary DoF held at -gap."""
        structure = chain(5)
        m = MultiPhiModel(structure, [stop("m3", gap=0.7)], modes="all")
        stiffness, held, others = np.array(structure.stiffness), [3], [0, 1, 2, 4]
        shape = np.zeros(5)
        shape[held] = -0.7
        shape[others] = -np.linalg.solve(stiffness[np.ix_(others, others)], stiffness[np.ix_(others, held)] @ [-0.7])
        assert_allclose(m.level(("stop",)).asymptotic_configuration, shape, rtol=1e-13)

    @pytest.mark.parametrize("kinds", KINDS)
    def test_solves_the_static_equations_with_load_and_contact_forces(self, kinds):
        for seed in range(5):
            m = model(seed, *kinds)
            if m.structure.n <= len(kinds):
                continue
            level = m.level([contact.name for contact in m.contacts])
            load = np.random.default_rng(seed).normal(size=m.structure.n)
            rest = level.asymptotic(m.base.modes.shapes.T @ load)
            x = m.base.modes.shapes @ rest.configuration
            gaps = rows(m) @ x + m.base.gaps
            assert_allclose(m.structure.stiffness @ x, load + rows(m).T @ rest.forces, atol=1e-9)
            compliance = np.where(np.isinf(kinds), 0.0, 1 / np.array(kinds))
            assert_allclose(gaps, -compliance * rest.forces, atol=1e-10)
            springs = [0.5 * k * g**2 for k, g in zip(kinds, gaps, strict=True) if not math.isinf(k)]
            assert_allclose(rest.strain, 0.5 * x @ m.structure.stiffness @ x + sum(springs), rtol=1e-9)
            assert_allclose(rest.potential, rest.strain - load @ x, rtol=1e-8, atol=1e-10)

    def test_of_a_soft_mode_keeps_to_its_stops_as_exactly_as_a_stiff_one(self):
        """The load would carry the soft mass 300 m away; what is left of a gap is round-off of the 1e-6 m it moves."""
        structure = LinearStructure(np.diag([76.0, 1.1, 1.0]), np.diag([2.0, 4e8, 3e9]), points={"m0": 0})
        directions = [1.2, 1.3, 0.8], [-0.1, -0.7, 0.7]
        m = MultiPhiModel(structure, [UnilateralContact(f"c{i}", d, 0.0) for i, d in enumerate(directions)], "all")
        rest = m.level(["c0", "c1"]).asymptotic(m.base.modes.shapes.T @ [-746.0, -10.8, -10.2])
        x = m.base.modes.shapes @ rest.configuration
        assert np.all(np.abs(rows(m) @ x) <= 4e-15 * np.abs(rows(m)) @ np.abs(x))

    def test_of_springs_beside_a_rigid_contact_of_their_direction_is_held_by_it_alone(self):
        """Each spring pushes with what its gap there says, the rigid contact with the rest."""
        above = UnilateralContact("above", {"m0": -1.0}, -0.3, 1e9)
        m = MultiPhiModel(chain(3), [above, stop(gap=0.1), UnilateralContact("same", "m0", 0.04, 5e9)], "all")
        level = m.level(["above", "stop", "same"])
        rest = level.asymptotic(np.zeros(3))
        assert_allclose(level.asymptotic_configuration, -0.1, rtol=1e-14)
        assert_allclose(rest.forces, [2e8, 2e8 - 3e8 - 0.1, 3e8], rtol=1e-15, atol=1e-15 * 1e9)
        assert_allclose(rest.strain, 0.5 * (0.1**2 + 1e9 * 0.2**2 + 5e9 * 0.06**2), rtol=1e-14)
        assert_allclose(level.omega, m.level(["stop"]).omega, rtol=1e-14)
        assert not np.any(level.force_rows[[0, 2]])

    def test_of_a_free_body_on_a_stop_carries_the_whole_weight(self):
        m = MultiPhiModel(chain(4, ends=0), [stop("m0", gap=0.3)], modes="all")
        weight = -9.81 * np.ones(4)
        rest = m.level(("stop",)).asymptotic(m.base.modes.shapes.T @ weight)
        assert_allclose(rest.forces, 4 * 9.81, rtol=1e-12)
        assert_allclose(m.base.modes.shapes[0] @ rest.configuration, -0.3, rtol=1e-12)
        assert_allclose(rest.drive, 0, atol=1e-12)

    def test_of_a_free_body_in_the_air_leaves_the_weight_to_drive_it(self):
        m = MultiPhiModel(chain(4, ends=0), [stop("m0")], modes="all")
        rest = m.level(()).asymptotic(m.base.modes.shapes.T @ (-9.81 * np.ones(4)))
        assert_allclose(m.level(()).shapes @ rest.drive, -9.81, rtol=1e-12)

    def test_of_bodies_that_touch_each_other_resists_no_common_motion(self):
        """A contact between two free masses has no rigid-body part but round-off."""
        m = MultiPhiModel(chain(4, ends=0), [stop({"m3": -1.0, "m2": 1.0}, 0.1, 500.0)], modes="all")
        level = m.level(("stop",))
        assert level.omega[0] == 0
        assert np.all(level.omega[1:] > 0.1)
        assert abs(level.asymptotic_configuration).max() < 0.2


class TestReactions:
    @settings(max_examples=40)
    @given(st.integers(0, 2**31), st.sampled_from(KINDS), st.booleans())
    def test_are_the_residual_of_the_full_equations(self, seed, kinds, rigid_body):
        n, _, _, damping, random = random_structure(seed, rigid_body=rigid_body)
        if n <= len(kinds):
            return
        m = model(seed, *kinds, rigid_body=rigid_body, damping=damping["given"])
        level = m.level([contact.name for contact in m.contacts])
        load = random.normal(size=n)
        rest = level.asymptotic(m.base.modes.shapes.T @ load)
        eta, rate = random.normal(size=(2, level.modes))
        acceleration = rest.drive - level.omega**2 * eta - level.damping @ rate
        x = m.base.modes.shapes @ rest.configuration + level.shapes @ eta
        s = m.structure
        residual = s.mass @ level.shapes @ acceleration + s.damping @ level.shapes @ rate + s.stiffness @ x - load
        force = level.force_rows @ eta + level.force_rate_rows @ rate + rest.forces
        assert_allclose(rows(m).T @ force, residual, rtol=0, atol=1e-8 * max(1, np.abs(residual).max()))


class TestLevelOverride:
    def test_replaces_frequencies_and_ratios_of_the_lowest_modes_only(self):
        plain = model(4, math.inf, damping=RayleighDamping(0.1, 1e-3), modes="all")
        override = {("c0",): LevelOverride([1.5, 7.0], [0.01])}
        given_model = MultiPhiModel(plain.structure, plain.contacts, "all", override)
        own, theirs = plain.level(("c0",)), given_model.level(("c0",))
        assert_allclose(theirs.frequencies, np.r_[1.5, 7.0, own.frequencies[2:]], rtol=1e-14)
        assert_allclose(theirs.ratios[0], 0.01, rtol=1e-14)
        assert_allclose(theirs.damping[1:, 1:], own.damping[1:, 1:])
        assert_allclose(theirs.damping[0, 1:], 0)
        assert_allclose(theirs.shapes, own.shapes)
        assert_allclose(given_model.level(()).omega, plain.level(()).omega)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_stiff_springs_in_preload_at_one_place_are_one_spring_to_round_off(side):
    """The level of both rests as one mass on k1 + k2 does; solved one by one they lose k / K of all digits."""
    structure = LinearStructure(mass=np.eye(1), stiffness=np.eye(1), points={"m": 0})
    stiffness, gaps, way = np.array([2.2e7, 4.1e7]), np.array([-0.018, side * -0.094]), np.array([1.0, side])
    contacts = [
        UnilateralContact(f"c{i}", {"m": way[i]}, gap=gaps[i], stiffness=stiffness[i]) for i in range(len(gaps))
    ]
    level = MultiPhiModel(structure, contacts, modes="all").level_at((0, 1))
    rest = -np.sum(stiffness * way * gaps) / (1 + np.sum(stiffness))
    strain = 0.5 * rest**2 + 0.5 * np.sum(stiffness * (way * rest + gaps) ** 2)
    found = level.asymptotic(np.zeros(1))
    assert found.configuration == pytest.approx([rest], rel=1e-14)
    assert found.strain == pytest.approx(strain, rel=1e-13)
    assert found.forces == pytest.approx(-stiffness * (way * rest + gaps), rel=1e-13)
