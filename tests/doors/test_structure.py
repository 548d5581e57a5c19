"""A structure refuses what it cannot be built from, in one line, and leaves its inputs alone."""

import math

import numpy as np
import pytest
import scipy.sparse
from numpy.testing import assert_array_equal

from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.structure import LinearStructure

MASS = np.diag([2.0, 1.0])
STIFFNESS = np.array([[3.0, -1.0], [-1.0, 1.0]])


def structure(**changes):
    return LinearStructure(
        **{"mass": MASS, "stiffness": STIFFNESS, "points": {"root": 0, "tip": np.array([0.0, 1.0])}} | changes
    )


def changed(matrix, i, j, value):
    copy = matrix.copy()
    copy[i, j] = value
    return copy


BAD_MATRICES = {
    "flat": (ValueError, np.ones(2)),
    "not square": (ValueError, np.ones((2, 3))),
    "empty": (ValueError, np.zeros((0, 0))),
    "scalar": (ValueError, 3.0),
    "nan": (ValueError, changed(MASS, 0, 0, math.nan)),
    "infinite": (ValueError, changed(MASS, 1, 1, math.inf)),
    "asymmetric": (ValueError, changed(MASS, 0, 1, 1e-3)),
    "negative diagonal": (ValueError, changed(MASS, 1, 1, -1.0)),
    "sparse nan": (ValueError, scipy.sparse.csr_array(changed(MASS, 0, 0, math.nan))),
    "sparse asymmetric": (ValueError, scipy.sparse.csr_array(changed(MASS, 0, 1, 1e-3))),
    "sparse not square": (ValueError, scipy.sparse.csr_array(np.ones((2, 3)))),
    "text": (TypeError, "heavy"),
    "text entries": (TypeError, [["1", "0"], ["0", "1"]]),
    "ragged": (TypeError, [[1.0, 0.0], [0.0]]),
    "objects": (TypeError, [[object(), 0], [0, 1]]),
    "complex": (TypeError, MASS + 0j),
    "sparse complex": (TypeError, scipy.sparse.csr_array(MASS + 0j)),
}


class TestMatrices:
    @pytest.mark.parametrize("which", ["mass", "stiffness", "damping"])
    @pytest.mark.parametrize("case", BAD_MATRICES)
    def test_refuses(self, refused, which, case):
        kind, matrix = BAD_MATRICES[case]
        refused(kind, f"{which}: ", structure, **{which: matrix})

    @pytest.mark.parametrize(("diagonal", "beside"), [(1.0, 2.0), (1.0, 1.0), (0.0, 0.0)])
    def test_refuses_a_mass_that_is_not_positive_definite(self, refused, diagonal, beside):
        refused(ValueError, "mass: ", structure, mass=[[diagonal, beside], [beside, 1.0]])

    @pytest.mark.parametrize("kind", ["csr_array", "csc_matrix", "coo_array", "dia_array"])
    def test_accepts_sparse(self, kind):
        sparse = getattr(scipy.sparse, kind)
        built = structure(mass=sparse(MASS), stiffness=sparse(STIFFNESS), damping=sparse(0.1 * STIFFNESS))
        assert built.n == 2
        for held, dense in zip((built.mass, built.stiffness), (MASS, STIFFNESS), strict=True):
            assert scipy.sparse.issparse(held)
            assert_array_equal(held.toarray(), dense)
        assert_array_equal(built.damping.toarray(), 0.1 * STIFFNESS)


class TestPoints:
    @pytest.mark.parametrize(
        ("kind", "points", "begins"),
        [
            (ValueError, {"tip": 2}, "points['tip']: got DoF 2, need 0 <= DoF < 2"),
            (ValueError, {"tip": -1}, "points['tip']: got DoF -1"),
            (ValueError, {"tip": [1.0, 0.0, 0.0]}, "points['tip']: got shape (3,), need (2,)"),
            (ValueError, {"tip": [math.nan, 0.0]}, "points['tip']: got a value that is NaN"),
            (ValueError, {"tip": 1.0}, "points['tip']: got shape ()"),
            (ValueError, {"tip": True}, "points['tip']: got shape ()"),
            (TypeError, {"tip": "end"}, "points['tip']: got str"),
            (TypeError, {"tip": np.array([1j, 0])}, "points['tip']: got "),
            (TypeError, {3: 0}, "points: got the name 3"),
            (TypeError, {"": 0}, "points: got the name ''"),
            (TypeError, ["tip"], "points: got list"),
            (TypeError, None, "points: got NoneType"),
        ],
    )
    def test_refuses(self, refused, kind, points, begins):
        refused(kind, begins, structure, points=points)


class TestRow:
    def test_of_a_name_a_combination_and_a_row(self):
        built = structure()
        assert_array_equal(built.row("root"), [1, 0])
        assert_array_equal(built.row({"root": -2.0, "tip": 0.5}), [-2, 0.5])
        assert_array_equal(built.row([0.25, 4]), [0.25, 4])

    @pytest.mark.parametrize(
        ("kind", "at", "begins"),
        [
            (ValueError, "top", "point: got 'top', need one of: root, tip"),
            (ValueError, {"top": 1.0}, "point: got 'top', need one of: root, tip"),
            (ValueError, {}, "direction: got an empty mapping"),
            (ValueError, {"tip": math.nan}, "direction['tip']: got nan"),
            (TypeError, {"tip": "up"}, "direction['tip']: got 'up'"),
            (TypeError, {"tip": True}, "direction['tip']: got True"),
            (TypeError, {"tip": 1j}, "direction['tip']: got 1j"),
            (TypeError, {1: 1.0}, "direction: got the name 1"),
            (ValueError, [1.0], "row: got shape (1,), need (2,)"),
            (TypeError, 1, "point: got 1"),
            (ValueError, [1.0, math.inf], "row: got a value that is NaN or infinite"),
            (TypeError, [1j, 0], "row: got list"),
            (TypeError, object(), "row: got object"),
            (TypeError, (3, "uz"), "point: got (3, 'uz'), need the name of a point"),
        ],
    )
    def test_refuses(self, refused, kind, at, begins):
        refused(kind, begins, structure().row, at)


class TestDamping:
    @pytest.mark.parametrize(
        ("kind", "arguments"),
        [
            (ValueError, {"ratios": [-0.1]}),
            (ValueError, {"ratios": [math.nan]}),
            (ValueError, {"ratios": [[0.1]]}),
            (TypeError, {"ratios": "slight"}),
            (TypeError, {"ratios": [0.1j]}),
            (ValueError, {"ratios": [], "beyond": -1.0}),
            (ValueError, {"ratios": [], "beyond": math.inf}),
            (TypeError, {"ratios": [], "beyond": "little"}),
        ],
    )
    def test_modal_refuses(self, refused, kind, arguments):
        refused(kind, "beyond: " if "beyond" in arguments else "ratios: ", ModalDamping, **arguments)

    @pytest.mark.parametrize(
        ("kind", "arguments"),
        [
            (ValueError, {"alpha": -1.0}),
            (ValueError, {"beta": math.inf}),
            (TypeError, {"beta": "little"}),
            (TypeError, {"alpha": None}),
        ],
    )
    def test_rayleigh_refuses(self, refused, kind, arguments):
        refused(kind, f"{next(iter(arguments))}: ", RayleighDamping, **arguments)

    def test_modal_ratios_are_filled_up_or_cut(self):
        damping = ModalDamping([0.04, 0.02], beyond=0.001)
        assert_array_equal(damping.of(4), [0.04, 0.02, 0.001, 0.001])
        assert_array_equal(damping.of(1), [0.04])
        assert_array_equal(damping.of(0), [])
