"""Rigid-body modes of a stiffness with few digits are rigid, soft suspensions are not, and soft modes are exact.

Exact values are of the stiffness with all its digits, or of springs in closed form.
"""

import functools
import math

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

FREE = mp.Clamp(translation=0.0, rotation=0.0)


@functools.cache
def free_beam(elements=20, length=1.0):
    section = mp.Section.rectangle(0.0, length, width=0.03, height=0.01, youngs_modulus=2.1e11, density=7850.0)
    return mp.planar_beam(mp.Beam([section], {"tip": length, "root": 0.0}, clamp=FREE), elements)


def printed(matrix, digits):
    if digits == "single":
        return matrix.astype(np.float32).astype(float)
    return np.array([[float(f"{value:.{digits - 1}e}") for value in row] for row in matrix])


def with_digits(structure, digits, scale=1.0, held=0.0):
    """The structure with so many digits in K, in other units of mass, and a spring [N/m] to the ground at its tip."""
    row = np.array(structure.row("tip"))
    stiffness = printed(scale * (np.array(structure.stiffness) + held * np.outer(row, row)), digits)
    points = {"tip": row, "root": np.array(structure.row("root"))}
    return mp.LinearStructure(scale * np.array(structure.mass), stiffness, mp.ModalDamping(0.01), points)


class TestFewDigits:
    @pytest.mark.parametrize("digits", [8, 9, 10, 11, 12, 13, 14, 15, "single"])
    @pytest.mark.parametrize("scale", [1.0, 1e-3, 2.0**-30])
    def test_a_free_beam_stays_free(self, digits, scale):
        structure = with_digits(free_beam(), digits, scale)
        model, exact = mp.MultiPhiModel(structure), mp.MultiPhiModel(free_beam())
        frequencies = model.level(()).frequencies
        assert_allclose(frequencies[:4], exact.level(()).frequencies[:4], rtol=1e-4, atol=0)
        assert np.count_nonzero(frequencies == 0) == 2
        x = model.static_equilibrium({"tip": 10.0 * scale}, inertia_relief=True)
        relieved = exact.static_equilibrium({"tip": 10.0}, inertia_relief=True)
        assert_allclose(structure.row("tip") @ x, exact.structure.row("tip") @ relieved, rtol=1e-3)

    @pytest.mark.parametrize("digits", [8, 10])
    def test_a_large_sparse_one_too(self, digits):
        beam = free_beam(elements=40)
        row = np.array(beam.row("tip"))
        stiffness = scipy.linalg.block_diag(*[printed(np.array(beam.stiffness), digits)] * 8)
        mass = scipy.linalg.block_diag(*[np.array(beam.mass)] * 8)
        structure = mp.LinearStructure(*map(scipy.sparse.csr_array, (mass, stiffness)), points={"a": np.tile(row, 8)})
        model = mp.MultiPhiModel(structure, modes=20)
        assert structure.n > 600
        assert np.count_nonzero(model.level(()).frequencies == 0) == 16

    @pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.csr_array])
    @pytest.mark.parametrize("elements", [16, 20])
    @pytest.mark.parametrize(
        ("told", "rounded"),
        [
            ("5 decimals", lambda k: np.round(k, 5)),
            ("3 decimals", lambda k: np.round(k, 3)),
            ("steps of 1", np.round),
            ("single precision", lambda k: printed(k, "single")),
            ("8 digits in some", lambda k: np.where(np.add(*np.indices(k.shape)) < len(k) // 2, k, printed(k, 8))),
            ("10 digits in some", lambda k: np.where(np.minimum(*np.indices(k.shape)) % 2 == 0, printed(k, 10), k)),
        ],
    )
    def test_a_free_beam_stays_free_however_it_was_rounded(self, told, rounded, elements, kind):
        exact, whole = mp.MultiPhiModel(free_beam(elements)), free_beam(elements)
        stiffness = rounded(np.array(whole.stiffness))
        points = {"tip": np.array(whole.row("tip"))}
        model = mp.MultiPhiModel(
            mp.LinearStructure(np.array(whole.mass), kind((stiffness + stiffness.T) / 2), points=points)
        )
        assert np.count_nonzero(model.level(()).frequencies == 0) == 2
        with pytest.warns(mp.MultiPhiWarning, match=f"^digits: the stiffness has {told}"):
            x = model.static_equilibrium({"tip": 10.0}, inertia_relief=True)
        relieved = exact.static_equilibrium({"tip": 10.0}, inertia_relief=True)
        assert_allclose(points["tip"] @ x, exact.structure.row("tip") @ relieved, rtol=5e-3)

    @pytest.mark.parametrize("steps", [1.0, 1e3])
    @pytest.mark.parametrize("seed", range(3))
    def test_whole_numbers_of_springs_are_exact(self, seed, steps):
        rng = np.random.default_rng(seed)
        springs, n = steps * np.round(10.0 ** rng.uniform(4.5, 9, 12)), 12
        stiffness = np.diag(springs) + np.diag(np.r_[springs[1:], 0.0])
        stiffness -= np.diag(springs[1:], 1) + np.diag(springs[1:], -1)
        stiffness[0, 0] += steps - springs[0]  # a soft spring to the ground
        model = mp.MultiPhiModel(mp.LinearStructure(np.eye(n), stiffness))
        assert_allclose(model.level(()).frequencies[0], math.sqrt(steps / n) / 2 / math.pi, rtol=1e-3)
        assert not model.stiffness_warnings()

    def test_a_refusal_names_the_digits_where_they_may_be_the_cause(self):
        mass, stiffness = np.array(free_beam().mass), np.array(free_beam().stiffness)
        row = np.array(free_beam().row("tip"))
        for kind in (np.asarray, scipy.sparse.csr_array):
            below = mp.LinearStructure(mass, kind(stiffness - 2e3 * np.outer(row, row)))
            with pytest.raises(mp.MultiPhiValueError, match="matrix, with all its digits if this one was rounded"):
                mp.MultiPhiModel(below).level(())
            below = mp.LinearStructure(mass, kind(np.round(stiffness - 2e4 * np.outer(row, row), 3)))
            with pytest.raises(mp.MultiPhiValueError, match="matrix with more than the 3 decimals of this one"):
                mp.MultiPhiModel(below).level(())
        far = mp.LinearStructure(np.eye(2), [[1.0, 2.0], [2.0, 1.0]])
        with pytest.raises(mp.MultiPhiValueError, match=r"need a positive semidefinite matrix$"):
            mp.MultiPhiModel(far).level(())

    def test_the_digits_are_told_with_what_they_leave_open(self):
        model = mp.MultiPhiModel(with_digits(free_beam(), 9))
        with pytest.warns(
            mp.MultiPhiWarning, match=r"^digits: the stiffness has 9 digits, which leave 2 rigid-body modes"
        ):
            x = model.static_equilibrium({"tip": 10.0}, inertia_relief=True)
        run = mp.simulate(model, 0.02, displacement=x)
        assert any(warning.startswith("digits: the stiffness has 9 digits") for warning in run.warnings)

    def test_all_digits_are_no_cause_of_a_warning(self):
        model = mp.MultiPhiModel(free_beam())
        run = mp.simulate(model, 0.02, displacement=model.static_equilibrium({"tip": 10.0}, inertia_relief=True))
        assert not any(warning.startswith("digits") for warning in run.warnings)

    @pytest.mark.parametrize(("digits", "held"), [(17, 1e-3), (12, 0.1), (10, 10.0), (9, 100.0), ("single", 3e3)])
    def test_a_soft_suspension_is_none(self, digits, held):
        """One spring to the ground: the beam turns freely, and moves on it."""
        exact = mp.MultiPhiModel(with_digits(free_beam(), 17, held=held)).level(()).frequencies
        found = mp.MultiPhiModel(with_digits(free_beam(), digits, held=held)).level(()).frequencies
        assert np.count_nonzero(found == 0) == 1
        assert_allclose(found[1], exact[1], rtol=0.05)

    @pytest.mark.parametrize("soft", [1e-3, 1e-5, 1e-7])
    def test_short_numbers_of_a_few_springs_are_exact(self, soft):
        stiffness = np.array([[1000.0 + soft, -1000.0], [-1000.0, 1000.0]])
        found = mp.MultiPhiModel(mp.LinearStructure(np.eye(2), stiffness)).level(()).frequencies
        assert_allclose(found[0], math.sqrt(soft / 2) / 2 / math.pi, rtol=1e-5)


class TestSoftBesideStiff:
    @pytest.mark.parametrize("power", [27, 33, 40, 43, 45, 49])
    @pytest.mark.parametrize("scale", [1.0, 2.0**-60])
    def test_exact_numbers_have_an_exact_frequency(self, power, scale):
        k, stiff = 8.0 * scale, 8.0 * scale * 2.0**power
        structure = mp.LinearStructure(scale * np.eye(2), [[k + stiff, -stiff], [-stiff, stiff]], points={"end": 1})
        run = mp.simulate(mp.MultiPhiModel(structure), 1.0, velocity=np.ones(2))
        k, stiff = k / scale, stiff / scale
        square = 2 * k * stiff / (k + 2 * stiff + math.hypot(k, 2 * stiff))  # the product of both by the larger one
        assert_allclose(run.model.level(()).frequencies[0], math.sqrt(square) / 2 / math.pi, rtol=1e-13)
        few = power > 45  # units of the last bit, which are exact by chance as well: 8.3 beside 5e15 leaves 8
        assert [warning.split(":")[0] for warning in run.warnings] == ["digits"] * few

    @pytest.mark.parametrize("seed", range(4))
    def test_of_several_soft_modes_in_any_order_of_rows(self, seed):
        """Groups of masses that stiff springs tie, on soft springs: those of rigid groups, but for the ratio."""
        rng = np.random.default_rng(seed)
        groups, size, stiff = 3, 4, 2.0**44
        soft = rng.integers(1, 9, groups).astype(float)
        stiffness, among = np.zeros((groups * size,) * 2), np.zeros((groups, groups))
        for g in range(groups):
            first = g * size
            for i in range(first, first + size - 1):
                stiffness[np.ix_([i, i + 1], [i, i + 1])] += stiff * np.array([[1, -1], [-1, 1]])
            if g == 0:
                stiffness[first, first] += soft[g]
                among[g, g] += soft[g]
            else:
                spring = soft[g] * np.array([[1, -1], [-1, 1]])
                stiffness[np.ix_([first - 1, first], [first - 1, first])] += spring
                among[np.ix_([g - 1, g], [g - 1, g])] += spring
        masses = rng.integers(1, 5, groups * size).astype(float)
        exact = scipy.linalg.eigh(among, np.diag(masses.reshape(groups, size).sum(axis=1)), eigvals_only=True)
        order = rng.permutation(groups * size)
        structure = mp.LinearStructure(np.diag(masses[order]), stiffness[np.ix_(order, order)])
        found = mp.MultiPhiModel(structure, modes="all").level(()).frequencies[:groups]
        assert_allclose(found, np.sqrt(exact) / 2 / math.pi, rtol=1e-11)

    def test_free_ones_of_exact_numbers_are_free(self):
        stiffness = 2.0**50 * np.array([[1.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
        found = mp.MultiPhiModel(mp.LinearStructure(np.diag([1.0, 3.0, 7.0]), stiffness)).level(()).frequencies
        assert found[0] == 0
        assert found[1] > 1e6

    @pytest.mark.parametrize("seed", range(6))
    def test_free_directions_that_no_spring_touches_are_free(self, seed):
        """Springs of exact numbers on some of the coordinates, which a coupled mass moves with the others."""
        rng = np.random.default_rng(seed)
        for n in (2, 3, 5):
            springs = int(rng.integers(1, n))
            factor, scale = rng.integers(-2, 3, (springs, springs)), 10.0 ** rng.integers(-12, 13)
            mass, stiffness = np.eye(n) + 0.1 * np.ones((n, n)), np.zeros((n, n))
            stiffness[:springs, :springs] = factor @ factor.T + np.eye(springs)
            coordinates = rng.permutation(n)
            mass, stiffness = (
                m[np.ix_(coordinates, coordinates)] for m in (mass + np.diag(rng.uniform(size=n)), stiffness)
            )
            found = mp.MultiPhiModel(mp.LinearStructure(mass, scale * stiffness)).level(()).frequencies
            assert np.count_nonzero(found == 0) == n - springs

    def test_a_negative_spring_beside_stiff_ones_is_refused(self, refused):
        stiff = 2.0**46
        structure = mp.LinearStructure(np.eye(2), [[stiff - 8.0, -stiff], [-stiff, stiff]])
        refused(ValueError, "stiffness: indefinite", mp.MultiPhiModel(structure).level, ())

    @pytest.mark.parametrize("ratio", [1e13, 1e14, 5e14, 7e14, 1e15])
    @pytest.mark.parametrize("scale", [1.0, 2.0**-40])
    def test_other_numbers_are_told_how_far_they_hold_it(self, ratio, scale):
        """Down to a soft spring of four units of the last bit; one of two is the round-off of an assembly."""
        k, stiff = 8.3 * scale, 11.371 * ratio * scale
        structure = mp.LinearStructure(np.eye(2), [[k + stiff, -stiff], [-stiff, stiff]], points={"end": 1})
        run = mp.simulate(mp.MultiPhiModel(structure), 1.0, velocity=np.ones(2))
        assert any(warning.startswith("digits: ") and "of far stiffer springs" in warning for warning in run.warnings)

    @pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.csr_array])
    @pytest.mark.parametrize("ratio", [1e13, 3e13, 1e14, 5e14, 1e15])
    @pytest.mark.parametrize("scale", [1.0, 1e-6])
    @pytest.mark.parametrize("soft", [8.0, 8.1])
    def test_three_masses_in_a_row_too_dense_and_sparse(self, kind, ratio, scale, soft):
        k, s = soft * scale, ratio * scale
        stiffness = np.array([[k + s, -s, 0.0], [-s, 2 * s, -s], [0.0, -s, s]])
        model = mp.MultiPhiModel(mp.LinearStructure(kind(scale * np.eye(3)), kind(stiffness)))
        found, exact = model.level(()).frequencies[0], math.sqrt(soft / 3) / 2 / math.pi
        is_right = abs(found - exact) < 1e-3 * exact
        assert is_right or any(warning.startswith("digits: ") for warning in model.stiffness_warnings())

    @pytest.mark.parametrize("soft", [0.0, 8.1])
    def test_a_long_sparse_chain_tells_its_soft_spring(self, soft):
        n, stiff = 700, 1e13
        diagonal = np.r_[soft + stiff, np.full(n - 2, 2 * stiff), stiff]
        stiffness = scipy.sparse.diags_array([diagonal, -stiff, -stiff], offsets=[0, 1, -1], shape=(n, n))
        model = mp.MultiPhiModel(mp.LinearStructure(scipy.sparse.eye_array(n), stiffness), modes=5)
        assert any("of far stiffer springs" in warning for warning in model.stiffness_warnings()) == (soft > 0)

    @pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.csr_array])
    @pytest.mark.parametrize("seed", range(6))
    def test_free_springs_of_many_additions_are_no_cause_of_a_warning(self, seed, kind):
        """Parallel ones too, of far apart stiffnesses, added in any order or by a product of matrices."""
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 7))
        ends = [(a, int(rng.integers(0, a))) for a in range(1, n)] + [(n - 1, 0)] * n
        first, second = np.transpose(rng.permutation(ends * 3))
        stiffnesses = 10.0 ** rng.uniform(0, 6, len(first))
        stretches = np.eye(n)[first] - np.eye(n)[second]
        added = np.zeros((n, n))
        for k, row in zip(stiffnesses, stretches, strict=True):
            added += k * np.outer(row, row)
        for stiffness in (added, stretches.T @ np.diag(stiffnesses) @ stretches):
            model = mp.MultiPhiModel(mp.LinearStructure(np.eye(n), kind((stiffness + stiffness.T) / 2)))
            assert model.level(()).frequencies[0] == 0
            assert not model.stiffness_warnings()
