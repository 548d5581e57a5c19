"""Sparse structures stay sparse: nothing of size n x n, and points weigh what is not zero of them."""

import tracemalloc

import numpy as np
import pytest
import scipy.sparse

from multiphi_exudyn import LinearStructure, ModalDamping, MultiPhiModel, RayleighDamping, UnilateralContact

N, POINTS, MODES = 20_000, 20, 2
VECTOR = 8 * N  # bytes
STIFFNESS = scipy.sparse.diags_array([2 * np.ones(N), -np.ones(N - 1), -np.ones(N - 1)], offsets=[0, 1, -1]).tocsr()
DAMPINGS = {
    "none": None,
    "modal": ModalDamping([0.01], beyond=0.02),
    "Rayleigh": RayleighDamping(0.1, 1e-4),
    "given": 1e-3 * STIFFNESS,
}
COPIES = 8  # of the base's shapes, while it is computed: statics, their residuals, products with M, Lanczos vectors


def peak(build):
    """What ``build`` gives, and the most bytes of arrays that stood at one time."""
    tracemalloc.start()
    try:
        return build(), tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("damping", DAMPINGS)
def test_a_base_takes_a_few_times_its_shapes_whatever_the_damping(damping):
    points = {f"p{i}": i * N // POINTS for i in range(POINTS)}

    def build():
        structure = LinearStructure(scipy.sparse.eye_array(N), STIFFNESS, DAMPINGS[damping], points)
        model = MultiPhiModel(structure, [UnilateralContact("stop", "p1", 1e-3, 10.0)], modes=MODES)
        return model.level(("stop",)).base

    base, taken = peak(build)
    assert base.modes.shapes.nbytes <= taken < COPIES * base.modes.shapes.nbytes


def test_points_keep_only_what_is_not_zero_of_their_rows():
    def build():
        points = {f"p{i}": i for i in range(100)} | {"mean": np.r_[0.5, 0.5, np.zeros(N - 2)]}
        return LinearStructure(scipy.sparse.eye_array(N), STIFFNESS, points=points)

    structure, _ = peak(build)
    again, taken = peak(lambda: LinearStructure(structure.mass, structure.stiffness, points=structure.points))
    plain, bare = peak(lambda: LinearStructure(structure.mass, structure.stiffness))
    assert taken - bare < VECTOR
    assert (len(again.points), len(plain.points)) == (101, 0)
    np.testing.assert_array_equal(np.flatnonzero(again.points["p7"]), [7])
    np.testing.assert_array_equal(again.row("mean")[:3], [0.5, 0.5, 0.0])
    assert peak(build)[1] < bare + 5 * VECTOR
