"""Natural frequencies keep relative accuracy at both ends; rigid-body modes are told by their strain energy.

Chains and beams whose frequencies are known in closed form are the reference.
"""

import functools
import math

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn import Beam, Clamp, MultiPhiValueError, NumericalFailure, Section, planar_beam
from multiphi_exudyn.mathematics import lowest_modes as lowest
from multiphi_exudyn.mathematics.lowest_modes import lowest_modes
from multiphi_exudyn.mathematics.modes import complete_modes, right_singular_vectors


def chain(n, *, ends=1):
    """Unit masses on unit springs, held at ``ends`` ends: omega = 2 sin(...) in closed form."""
    stiffness = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    if ends < 2:
        stiffness[-1, -1] = 1.0
    if ends < 1:
        stiffness[0, 0] = 1.0
    return np.eye(n), stiffness


def chain_frequencies(n, *, ends=1):
    k = np.arange(n)
    angle = {0: math.pi * k / (2 * n), 1: math.pi * (2 * k + 1) / (4 * n + 2), 2: math.pi * (k + 1) / (2 * n + 2)}
    return 2 * np.sin(angle[ends])


def free_beam(elements, *, scale=1.0):
    """A slender free-free steel beam, in units of length scaled by ``scale``."""
    section = Section.rectangle(
        0.0, scale, width=0.02 * scale, height=0.005 * scale,
        youngs_modulus=2.1e11 / scale, density=7800 / scale**3,
    )  # fmt: skip
    return planar_beam(Beam([section], {"tip": scale}, clamp=Clamp(0.0, 0.0)), elements=elements)


@functools.cache
def free_beam_modes(elements, *, scale=1.0):
    """That beam and all its modes."""
    structure = free_beam(elements, scale=scale)
    return structure, complete_modes(np.asarray(structure.mass), np.asarray(structure.stiffness))


def seen_of(cluster, omega, given):
    """What an iteration without round-off sees of modes (n, k) of one frequency: omega^2 (1,) and the shape (n, 1)."""
    shape = cluster @ (cluster.T @ given[-1])
    return np.array([omega**2]), (shape / np.linalg.norm(shape))[:, None]


FREE_FREE = np.array([4.730040744862704, 7.853204624095838, 10.99560783800167])  # beta L, Euler-Bernoulli


class TestCompleteModes:
    @pytest.mark.parametrize("ends", [0, 1, 2])
    @pytest.mark.parametrize("n", [2, 3, 40, 200])
    def test_frequencies_of_a_chain_are_exact_at_both_ends(self, n, ends):
        modes = complete_modes(*chain(n, ends=ends))
        assert_allclose(modes.omega, chain_frequencies(n, ends=ends), rtol=1e-12, atol=0)
        assert modes.rigid == (ends == 0)

    def test_lowest_frequency_survives_a_stiffness_spread_of_ten_decades(self):
        k = np.array([1.0, 1e5, 1e10])
        stiffness = np.diag(k) + np.diag(np.r_[k[1:], 0]) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
        omega = complete_modes(np.eye(3), stiffness).omega
        # K's own round-off, 1e-16 of its largest entry, is 1e-6 of its lowest eigenvalue: no method does better
        assert_allclose(np.prod(omega**2), np.prod(k), rtol=1e-5)  # det K
        assert_allclose(omega[0] ** 2, 1 / 3, rtol=1e-5)  # three masses as one on the softest spring

    def test_shapes_are_mass_orthonormal_and_diagonalise_the_stiffness(self):
        random = np.random.default_rng(3)
        a, b = random.normal(size=(2, 30, 30))
        mass, stiffness = a @ a.T + 30 * np.eye(30), b @ b.T
        modes = complete_modes(mass, stiffness)
        assert_allclose(modes.shapes.T @ mass @ modes.shapes, np.eye(30), atol=1e-13)
        assert_allclose(modes.shapes.T @ stiffness @ modes.shapes, np.diag(modes.omega**2), atol=1e-11)
        assert np.all(np.diff(modes.omega) >= 0)

    @pytest.mark.parametrize(("elements", "scale"), [(10, 1e3), (40, 1.0), (120, 1e3), (300, 1.0)])
    def test_a_free_beam_has_two_rigid_body_modes_however_fine(self, elements, scale):
        structure, modes = free_beam_modes(elements, scale=scale)
        assert modes.rigid == 2
        assert np.all(modes.omega[:2] == 0)
        section = math.sqrt(2.1e11 / 7800) * 0.005 / math.sqrt(12)
        assert_allclose(modes.omega[2:5], FREE_FREE**2 * section, rtol=1e-3)  # Timoshenko: lower by < 0.1 %
        gram = modes.shapes.T @ (structure.mass @ modes.shapes)
        assert_allclose(gram, np.eye(modes.count), atol=1e-11)

    @pytest.mark.parametrize("lowest", [-1.0, -1e-3])
    def test_an_indefinite_stiffness_is_refused_with_its_lowest_eigenvalue(self, lowest):
        with pytest.raises(MultiPhiValueError, match=f"indefinite, lowest eigenvalue .*{lowest:g}"):
            complete_modes(np.eye(3), np.diag([5.0, lowest, 2.0]))

    @given(st.integers(2, 12), st.integers(0, 2**31))
    def test_unequal_units_change_no_frequency(self, n, seed):
        random = np.random.default_rng(seed)
        mass, stiffness = chain(n, ends=1)
        units = 10.0 ** random.uniform(-4, 4, n)
        scaled = complete_modes(units[:, None] * mass * units, units[:, None] * stiffness * units)
        assert_allclose(scaled.omega, chain_frequencies(n, ends=1), rtol=1e-11)
        free_mass, free = chain(n, ends=0)
        assert complete_modes(units[:, None] * free_mass * units, units[:, None] * free * units).rigid == 1


class TestLowestModes:
    @pytest.mark.parametrize("ends", [0, 1])
    def test_are_those_of_the_complete_set(self, ends):
        n, count = 800, 12
        mass, stiffness = (scipy.sparse.csr_array(matrix) for matrix in chain(n, ends=ends))
        row = np.eye(n)[[n // 3]]
        found = lowest_modes(mass, stiffness, count, row).modes
        assert found.count == count + 1
        assert found.rigid == (ends == 0)
        assert_allclose(found.omega[:count], chain_frequencies(n, ends=ends)[:count], rtol=1e-8, atol=0)
        assert_allclose(found.shapes.T @ (mass @ found.shapes), np.eye(count + 1), atol=1e-11)

    @pytest.mark.parametrize("rows", [0, 2, 60])
    @pytest.mark.parametrize("held", [1e6, 0.0], ids=["clamped", "free"])
    def test_of_a_fine_beam_are_the_complete_ones_and_its_static_shapes_exact(self, held, rows):
        structure = planar_beam(
            Beam(
                [Section.rectangle(0.0, 1.0, width=0.02, height=0.005, youngs_modulus=2.1e11, density=7800)],
                {"tip": 1.0},
                clamp=Clamp(held, held),
            ),
            elements=80,
        )
        exact = complete_modes(structure.mass, structure.stiffness)
        at = np.eye(structure.n)[np.linspace(20, structure.n - 1, rows).astype(int)]
        found = lowest_modes(scipy.sparse.csr_array(structure.mass), structure.stiffness, 20, at).modes
        assert found.rigid == exact.rigid
        assert_allclose(found.omega[:20], exact.omega[:20], rtol=1e-8, atol=0)
        assert_allclose(found.shapes.T @ (structure.mass @ found.shapes), np.eye(found.count), atol=1e-9)
        if not exact.rigid:
            expected, flexibility = (at @ (m.shapes / m.omega**2) @ m.shapes.T @ at.T for m in (exact, found))
            assert_allclose(flexibility, expected, rtol=0, atol=1e-8 * np.max(np.abs(expected), initial=0))

    @pytest.mark.parametrize("copies", [2, 7, 12])
    def test_all_are_found_where_an_iteration_sees_one_of_a_frequency_alone(self, monkeypatch, copies):
        """As without round-off: of modes of one frequency an iteration sees the part of its start among them."""
        mass, stiffness = (scipy.sparse.block_diag([m] * copies, format="csr") for m in chain(60, ends=2))
        exact = lowest_modes(mass, stiffness, 3 * copies, np.zeros((0, 60 * copies))).modes
        first = exact.shapes[:, :copies]
        monkeypatch.setattr(lowest, "lanczos", lambda *given: seen_of(first, exact.omega[0], given))
        found = lowest_modes(mass, stiffness, 1, np.zeros((0, 60 * copies)))
        assert found.exact == copies
        assert_allclose(found.modes.omega, exact.omega[0], rtol=1e-11)

    def test_that_do_not_converge_are_a_failure_with_its_cause(self, monkeypatch):
        eigsh = scipy.sparse.linalg.eigsh
        monkeypatch.setattr(scipy.sparse.linalg, "eigsh", lambda *a, **k: eigsh(*a, **{**k, "maxiter": 1, "ncv": 6}))
        mass, stiffness = (scipy.sparse.csr_array(matrix) for matrix in chain(400))
        with pytest.raises(NumericalFailure, match="Lanczos iteration for 5 of 400 modes failed"):
            lowest_modes(mass, stiffness, 4, np.zeros((0, 400)))


class TestRightSingularVectors:
    def test_small_singular_values_of_a_graded_matrix_are_relatively_accurate(self):
        grading = 10.0 ** -np.arange(0, 24, 3)
        matrix = scipy.linalg.hilbert(8) * 0.1 + np.eye(8)
        values, vectors = right_singular_vectors(matrix * grading)
        exact_product = abs(np.linalg.det(matrix)) * np.prod(grading)
        assert_allclose(np.prod(values), exact_product, rtol=1e-12)
        assert_allclose(vectors.T @ vectors, np.eye(8), atol=1e-14)
        assert np.all(np.diff(values) > 0)
