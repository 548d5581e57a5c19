"""Sparse structures stay sparse: nothing of size n x n, and points weigh what is not zero of them."""

import tracemalloc

import numpy as np
import pytest
import scipy.sparse

from multiphi_exudyn import LinearStructure, ModalDamping, MultiPhiModel, RayleighDamping, UnilateralContact
from multiphi_exudyn.time.simulate import Run

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


def test_a_base_holds_nothing_beside_its_shapes_that_is_as_large():
    tracemalloc.start()
    try:
        points = {f"p{i}": i * N // POINTS for i in range(POINTS)}
        structure = LinearStructure(scipy.sparse.eye_array(N), STIFFNESS, points=points)
        model = MultiPhiModel(structure, [UnilateralContact("stop", "p1", 1e-3, 10.0)], modes=MODES)
        shapes = model.level(("stop",)).base.modes.shapes
        held = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert shapes.nbytes < held < 1.2 * shapes.nbytes


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


def string(n, stops=16):
    """A string of unit mass and tension over its stops, in n pieces: its motion is the same for every n."""
    tension = n * scipy.sparse.diags_array([2 * np.ones(n), -np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1, -1])
    places = {f"p{i}": (i + 1) * n // (stops + 1) for i in range(stops)}
    structure = LinearStructure(scipy.sparse.eye_array(n) / n, tension.tocsr(), points=places)
    contacts = [UnilateralContact(f"c{i}", f"p{i}", 1e-2 * (1 + i % 3), 50.0) for i in range(stops)]
    return MultiPhiModel(structure, contacts, modes=8)


def test_events_take_what_they_take_whatever_the_size_of_the_structure():
    """The second run knows its levels; the first builds them. Neither makes an array of n numbers."""
    taken = []
    sizes = 1020, 20_400
    for n in sizes:
        model = string(n)
        velocity = -np.sign(model.level(()).shapes[n // 2, 0]) * model.level(()).shapes[:, 0]
        for _ in range(2):
            motion = Run(model, 0.3, velocity=velocity).begun()
            _, most = peak(lambda motion=motion: motion.advance(0.3))
            assert motion.message == ""
            events = len(motion.trajectory(0.3).events)
            assert events > 15
            taken.append((events, most))
    assert taken[0][0] == taken[2][0]
    few, many = np.array(taken)[:2, 1], np.array(taken)[2:, 1]
    assert all(many < few + 0.75 * 8 * sizes[1])  # an array of n numbers would be seen; garbage is not always gone
