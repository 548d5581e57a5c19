"""Modes of one frequency: their basis, their number and the answer do not hang on what an eigensolver leaves open."""

import json

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from kernels import KERNELS, output_on
from numpy.testing import assert_allclose
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.levels.base import build_base
from multiphi_exudyn.mathematics import lowest_modes, modes
from multiphi_exudyn.mechanics.structure import damping_matrix


def square(side, *, damping=None, stiffness=30.0, free=False, sparse=False):
    """A square net of side x side masses: modes (i, j) and (j, i) have one frequency."""
    along = np.array(chain(side, ends=0 if free else 1).stiffness)
    if not free:
        along[-1, -1] = 2.0
    matrix = stiffness * (np.kron(along, np.eye(side)) + np.kron(np.eye(side), along))
    matrix = scipy.sparse.csr_array(matrix) if sparse else matrix
    points = {"p": 1, "q": side + 2}
    mass = scipy.sparse.eye_array(side**2) if sparse else np.eye(side**2)
    return mp.LinearStructure(mass, matrix, damping, points=points)


STOPS = [mp.UnilateralContact("rigid", "p", 0.1), mp.UnilateralContact("soft", {"q": -1.0}, 0.2, 300.0)]


@pytest.fixture(params=range(3))
def arbitrary(request, monkeypatch):
    """Eigensolvers with another sign of every mode, and another basis of modes of one frequency."""
    random = np.random.default_rng(request.param)
    solver, lanczos = modes.right_singular_vectors, lowest_modes.lanczos

    def mixed(values, vectors):
        vectors = vectors * random.choice([-1.0, 1.0], vectors.shape[1])
        edges = np.flatnonzero(np.diff(values) > 1e-9 * values[1:]) + 1
        for index in np.split(np.arange(len(values)), edges):
            vectors[:, index] = vectors[:, index] @ scipy.linalg.qr(random.normal(size=(len(index),) * 2))[0]
        return values, vectors

    monkeypatch.setattr(modes, "right_singular_vectors", lambda matrix: mixed(*solver(matrix)))
    monkeypatch.setattr(lowest_modes, "lanczos", lambda *given: mixed(*lanczos(*given)))


class TestTurned:
    def turned(self, squares, shapes, rows):
        return modes.aligned_modes(np.array(squares), shapes, rows, np.ones(len(rows) + len(shapes)))[:2]

    def test_gives_one_basis_whatever_basis_it_is_given(self):
        random = np.random.default_rng(0)
        squares = [0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 5.0]
        shapes, rows = scipy.linalg.qr(random.normal(size=(7, 7)))[0], random.normal(size=(2, 7))
        first = self.turned(squares, shapes, rows)[1]
        for _ in range(5):
            other = shapes.copy()
            for index in ([0, 1], [2], [3, 4, 5], [6]):
                other[:, index] = other[:, index] @ scipy.linalg.qr(random.normal(size=(len(index),) * 2))[0]
            assert_allclose(self.turned(squares, other, rows)[1], first, atol=1e-13)

    def test_lets_the_first_row_see_one_mode_of_a_cluster_and_the_second_one_more(self):
        random = np.random.default_rng(1)
        rows = random.normal(size=(2, 6))
        shapes = self.turned([3.0] * 4 + [5.0, 6.0], scipy.linalg.qr(random.normal(size=(6, 6)))[0], rows)[1]
        seen = rows @ shapes
        assert_allclose(seen[0, 1:4], 0.0, atol=1e-14)
        assert_allclose(seen[1, 2:4], 0.0, atol=1e-14)
        assert np.all(seen[[0, 0, 0, 1], [0, 4, 5, 1]] > 0)
        assert_allclose(shapes.T @ shapes, np.eye(6), atol=1e-14)

    def test_takes_the_sign_from_the_first_row_that_moves_by_more_than_round_off(self):
        shapes = np.array([[1e-16, -1.0], [-1.0, 1e-16]])
        assert_allclose(self.turned([1.0, 2.0], shapes, np.zeros((1, 2)))[1], [[0, 1], [1, 0]], atol=1e-15)
        rows = np.array([[1.0, 0.0], [0.0, -1.0]])
        assert_allclose(self.turned([1.0, 2.0], shapes, rows)[1], [[0, 1], [-1, 0]], atol=1e-15)

    def test_leaves_frequencies_that_differ_by_more_than_round_off_apart(self):
        squares, shapes = self.turned([1.0, 1.0 + 1e-10], np.eye(2), np.ones((1, 2)))
        assert squares[1] - squares[0] == 1.0 + 1e-10 - 1.0
        assert np.array_equal(shapes, np.eye(2))


@pytest.mark.parametrize("free", [False, True])
@pytest.mark.parametrize("sparse", [False, True])
def test_modes_of_every_level_are_the_same_from_any_eigensolver(arbitrary, monkeypatch, free, sparse):
    if sparse:
        monkeypatch.setattr(build_base, "COMPLETE", 30)
    closed = [(), ("rigid",), ("soft",), ("rigid", "soft")]
    count = 6
    model = mp.MultiPhiModel(square(7, free=free, sparse=sparse), STOPS, modes=count)
    shapes = [model.level(names).shapes for names in closed]
    monkeypatch.undo()
    if sparse:
        monkeypatch.setattr(build_base, "COMPLETE", 30)
    plain = mp.MultiPhiModel(square(7, free=free, sparse=sparse), STOPS, modes=count)
    for names, found in zip(closed, shapes, strict=True):
        assert_allclose(found, plain.level(names).shapes, atol=1e-10)


class TestACutCluster:
    """(1, 1), (1, 2) and (2, 1), (2, 2), (1, 3) and (3, 1), ...: two modes would part the first pair."""

    def test_is_kept_whole(self):
        model = mp.MultiPhiModel(square(4), STOPS, modes=2)
        assert (model.level(()).modes, model.level(()).kept_beyond) == (3, 1)
        assert (model.level(("rigid",)).modes, model.level(("rigid",)).kept_beyond) == (2, 0)

    def test_is_kept_whole_at_a_cut_off_frequency_that_parts_it_by_round_off(self):
        every = mp.MultiPhiModel(square(4), STOPS, modes="all").level(())
        for cut_off in every.frequencies[1:3]:
            assert mp.MultiPhiModel(square(4), STOPS, modes=mp.UpTo(cut_off)).level(()).modes == 3
            assert mp.MultiPhiModel(square(4), STOPS, modes=mp.UpTo(cut_off, most=2)).level(()).modes == 3

    def test_is_kept_whole_where_only_few_modes_of_a_level_are_computed(self, monkeypatch):
        monkeypatch.setattr(build_base, "COMPLETE", 30)
        structure = square(14, sparse=True)
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("c", structure.row("p"), 0.1, 50.0)], modes=5)
        for closed, count in (((), 6), (("c",), 5)):
            assert model.level(closed).modes == count

    def test_of_rigid_body_modes_too(self):
        structure = mp.LinearStructure(np.eye(3), np.zeros((3, 3)), points={"x": 0})
        assert mp.MultiPhiModel(structure, [], modes=1).level(()).modes == 3

    def test_is_said_by_a_run_that_visits_the_level(self):
        model = mp.MultiPhiModel(square(4), STOPS, modes=2)
        with pytest.warns(mp.MultiPhiWarning, match=r"^cluster: 1 of \d levels keep .* \(open\) 3 in place of 2, .*"):
            run = mp.simulate(model, 2.0, displacement=-0.05 * np.ones(16))
        assert "cluster" in [sentence.split(":")[0] for sentence in run.warnings]
        for loads in ((), [mp.HarmonicLoad("p", 1.0, 0.3)]):
            three = mp.simulate(mp.MultiPhiModel(square(4), STOPS, modes=3), 2.0, loads=loads)
            assert not [sentence for sentence in three.warnings if "(open)" in sentence]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_basis_of_a_large_structure_leaves_a_cluster_out_that_its_number_of_modes_would_part(count):
    structure = square(9, sparse=True)
    found = lowest_modes.lowest_modes(structure.mass, structure.stiffness, count, np.zeros((0, 81))).modes
    assert found.count == {2: 1, 3: 3, 4: 4}[count]


class TestModalRatiosOfACluster:
    RATIOS = (0.01, 0.02, 0.3, 0.05)

    def test_damp_the_same_motion_from_any_eigensolver(self, arbitrary, monkeypatch):
        found = damping_matrix(square(4, damping=mp.ModalDamping(self.RATIOS)))
        monkeypatch.undo()
        assert_allclose(found, damping_matrix(square(4, damping=mp.ModalDamping(self.RATIOS))), atol=1e-12)

    def test_damp_the_same_motion_whatever_the_contacts(self):
        structure = square(4, damping=mp.ModalDamping(self.RATIOS))
        for contacts in ([], STOPS, STOPS[::-1]):
            own = mp.MultiPhiModel(structure, contacts, modes="all").level(())
            assert_allclose(own.shapes @ own.damping @ own.shapes.T, damping_matrix(structure), atol=1e-12)

    def test_belong_to_the_motion_that_the_first_point_sees_and_to_that_which_it_does_not(self):
        structure = mp.LinearStructure(np.eye(2), 4 * np.eye(2), mp.ModalDamping([0.1, 0.4]), points={"x": [0.6, 0.8]})
        along, across = np.array([0.6, 0.8]), np.array([-0.8, 0.6])
        expected = 0.4 * np.outer(along, along) + 1.6 * np.outer(across, across)
        assert_allclose(damping_matrix(structure), expected, atol=1e-14)


def answers():
    """Motion of two points, and the instants of events, of truncated symmetric structures."""
    found = list[list[float]]()
    for free, damping in ((False, None), (False, mp.ModalDamping([0.01, 0.02, 0.3, 0.05])), (True, None)):
        model = mp.MultiPhiModel(square(5, damping=damping, free=free), STOPS, modes=4)
        velocity = np.random.default_rng(3).normal(size=25)
        run = mp.simulate(model, 2.0, velocity=velocity - np.mean(velocity) - 0.3 * free)
        t = np.linspace(0, 2, 30)
        found += [run.at("p", t).tolist(), run.at("q", t).tolist(), [event.time for event in run.events]]
    return found


@pytest.mark.parametrize("kernel", sorted(KERNELS))
def test_the_answer_of_a_truncated_symmetric_structure_is_the_same_on_every_kernel(kernel):
    code = (
        "import json, warnings, test_repeated_modes as tested; warnings.simplefilter('ignore');"
        "print(json.dumps(tested.answers()))"
    )
    for one, other in zip(answers(), json.loads(output_on(kernel, code)), strict=True):
        assert len(one) >= 2
        assert_allclose(one, other, rtol=1e-9, atol=1e-9)
