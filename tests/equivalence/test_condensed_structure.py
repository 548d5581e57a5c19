"""A mass of lower rank is condensed exactly: against the generalised eigenproblem, and against springs in series."""

import math

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

KINDS = {"dense": np.asarray, "sparse": scipy.sparse.csr_array}
CHAIN = 4e4 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])  # N/m


def finite_frequencies(mass, stiffness):
    """Hz, from M x = mu K x, which is definite in K: mu = 0 of the motions without mass."""
    inverse = scipy.linalg.eigh(mass, stiffness, eigvals_only=True)[::-1]
    return np.sqrt(1 / inverse[inverse > 1e-9 * inverse[0]]) / 2 / np.pi


def random_problem(rng, n, z, local):
    """M (n, n) of rank n - z with a null space of random or of local motions in scaled rows, K positive definite."""
    if local:  # z pairs of rows that move with one mass each, at offsets
        root = np.eye(n)[:, : n - z]
        for j in range(z):
            root[n - z + j, j] = rng.uniform(0.1, 2.0)
        mass = root @ np.diag(rng.uniform(1, 3, n - z)) @ root.T
    else:
        root = rng.standard_normal((n, n - z))
        mass = root @ root.T
    square = rng.standard_normal((n, n))
    scales = np.diag(10.0 ** rng.integers(-3, 4, n))  # units of single rows
    return scales @ mass @ scales, scales @ (square @ square.T + n * np.eye(n)) @ scales


class TestFrequencies:
    @pytest.mark.parametrize("kind", KINDS)
    @pytest.mark.parametrize("seed", range(6))
    def test_are_those_of_the_whole_problem(self, kind, seed):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(4, 12))
        z = int(rng.integers(1, n // 2 + 1))
        mass, stiffness = random_problem(rng, n, z, local=kind == "sparse" or seed % 2 == 0)
        built = mp.condensed_structure(KINDS[kind](mass), KINDS[kind](stiffness))
        assert built.n == n - z
        assert scipy.sparse.issparse(built.mass) == (kind == "sparse")
        frequencies = mp.MultiPhiModel(built, modes="all").level(()).frequencies
        assert_allclose(frequencies, finite_frequencies(mass, stiffness), rtol=1e-8)


class TestPoints:
    @pytest.mark.parametrize("at", [0, 1])
    def test_statics_at_a_mass_with_an_offset_is_that_of_all_rows(self, at):
        offset = np.array([1.0, 0.1])
        built = mp.condensed_structure(2 * np.outer(offset, offset), np.diag([1e4, 300.0]), points={"u": 0, "r": 1})
        x = mp.MultiPhiModel(built).static_equilibrium({"ur"[at]: 6.0})
        expected = np.zeros(2)
        expected[at] = 6.0 / [1e4, 300.0][at]
        assert_allclose(built.full(x), expected, atol=1e-12)

    @pytest.mark.parametrize("stiffness", [1e6, math.inf])
    def test_a_stop_at_a_point_without_mass_is_in_series_with_its_spring(self, stiffness):
        first, second = 4e4, 1e5  # N/m: of the mass to the ground, of the point to the mass
        whole = np.array([[first + second, -second], [-second, second]])
        built = mp.condensed_structure(np.diag([1.0, 0.0]), whole, points={"mass": 0, "end": 1})
        model = mp.MultiPhiModel(built, [mp.UnilateralContact("stop", "end", 1e-3, stiffness)])
        run = mp.simulate(model, 0.02, velocity=built.condensed(np.array([-1.0, -1.0])))
        alone = mp.LinearStructure([[1.0]], [[first]], points={"mass": 0})
        series = 1 / (1 / second + 1 / stiffness)
        exact = mp.simulate(
            mp.MultiPhiModel(alone, [mp.UnilateralContact("stop", "mass", 1e-3, series)]),
            0.02,
            velocity=np.array([-1.0]),
        )
        t = np.linspace(0, 0.02, 401)
        assert_allclose(run.at("mass", t), exact.at("mass", t), atol=1e-3 * np.max(np.abs(exact.at("mass", t))))


class TestDamping:
    @pytest.mark.parametrize("beta", [0.0, 1e-4])
    def test_by_the_matrices_keeps_its_ratios(self, beta):
        mass = np.diag([1.0, 0.0, 1.0])
        given = mp.condensed_structure(mass, CHAIN, 3.0 * mass + beta * CHAIN)
        by_ratios = mp.condensed_structure(mass, CHAIN, mp.RayleighDamping(3.0, beta))
        first, second = (mp.MultiPhiModel(built).level(()).ratios for built in (given, by_ratios))
        assert_allclose(first, second, rtol=1e-12)

    def test_a_damper_at_a_row_without_mass_is_refused(self, refused):
        damper = np.diag([0.0, 5.0, 0.0])
        refused(ValueError, "damping: got a damper at row 1", mp.condensed_structure, np.diag([1, 0, 1]), CHAIN, damper)


class TestRefusals:
    def test_a_structure_names_the_row_and_the_function(self):
        offset = np.array([1.0, 0.1, 0.0])
        mass = np.outer(offset, offset) + np.diag([0.0, 0.0, 1.0])
        with pytest.raises(mp.MultiPhiValueError, match=r"lower rank, 1 .* row 1, .*condensed_structure"):
            mp.LinearStructure(mass, np.diag([1e4, 1e2, 1e4]))
        sparse = mp.LinearStructure(scipy.sparse.csr_array(mass), scipy.sparse.csr_array(np.diag([1e4, 1e2, 1e4])))
        with pytest.raises(mp.MultiPhiValueError, match=r"lower rank, 1 .* row 1, "):
            mp.MultiPhiModel(sparse).level(())
