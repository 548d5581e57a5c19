"""A structure refuses what it cannot be built from, in one line, and leaves its inputs alone."""

import math
from fractions import Fraction

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.testing import assert_allclose, assert_array_equal

from multiphi_exudyn.errors import MultiPhiError
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

    @pytest.mark.parametrize("which", ["stiffness", "damping"])
    def test_refuses_another_size_than_the_mass(self, refused, which):
        refused(ValueError, f"{which}: got shape (3, 3), need (2, 2)", structure, **{which: np.eye(3)})

    @pytest.mark.parametrize("kind", [np.asarray, scipy.sparse.csr_array])
    def test_says_which_entries_are_asymmetric_and_by_how_much(self, refused, kind):
        matrix = kind(changed(STIFFNESS, 0, 1, -1.3))
        begins = "stiffness: got -1.3 at (0, 1) and -1 at (1, 0), 0.1 of its largest entry apart"
        refused(ValueError, begins, structure, stiffness=matrix)

    @pytest.mark.parametrize(("diagonal", "beside"), [(1.0, 2.0), (1.0, 1.0), (0.0, 0.0)])
    def test_refuses_a_mass_that_is_not_positive_definite(self, refused, diagonal, beside):
        refused(ValueError, "mass: ", structure, mass=[[diagonal, beside], [beside, 1.0]])

    def test_refuses_a_sparse_mass_without_inertia(self, refused):
        refused(ValueError, "mass: ", structure, mass=scipy.sparse.diags_array([1.0, 0.0]))

    def test_a_damping_ratio_is_told_where_it_goes(self, refused):
        refused(
            ValueError, "damping: got shape (), need (n, n); a ratio is ModalDamping(0.01)", structure, damping=0.01
        )

    def test_a_number_in_place_of_a_point_is_told_what_it_could_be(self, refused):
        refused(TypeError, "point: got 1, need the name of a point: points={'name': 1}", structure().row, 1)

    def test_refuses_no_mass_and_no_stiffness(self, refused):
        refused(ValueError, "mass: ", structure, mass=None)
        refused(ValueError, "stiffness: ", structure, stiffness=None)

    @pytest.mark.parametrize("kind", ["csr_array", "csc_matrix", "coo_array", "dia_array"])
    def test_accepts_sparse(self, kind):
        sparse = getattr(scipy.sparse, kind)
        built = structure(mass=sparse(MASS), stiffness=sparse(STIFFNESS), damping=sparse(0.1 * STIFFNESS))
        assert built.n == 2
        for held, dense in zip((built.mass, built.stiffness), (MASS, STIFFNESS), strict=True):
            assert scipy.sparse.issparse(held)
            assert_array_equal(held.toarray(), dense)
        assert_array_equal(built.damping.toarray(), 0.1 * STIFFNESS)

    def test_accepts_lists_and_integers(self):
        built = structure(mass=[[2, 0], [0, 1]], stiffness=[[3, -1], [-1, 1]])
        assert_array_equal(built.mass, MASS)
        assert built.stiffness.dtype == float

    def test_accepts_exact_numbers(self):
        assert_array_equal(structure(mass=[[Fraction(2), 0], [0, Fraction(1)]]).mass, MASS)

    def test_accepts_a_structure_without_any_stiffness(self):
        assert_array_equal(structure(stiffness=np.zeros((2, 2))).stiffness, 0)

    def test_accepts_what_round_off_leaves_of_a_zero_on_the_diagonal(self):
        built = structure(stiffness=np.diag([1e6, -1e-11]))
        assert built.stiffness[1, 1] == -1e-11

    @pytest.mark.parametrize("damping", [None, RayleighDamping(0.1, 1e-4), ModalDamping([0.01])])
    def test_keeps_a_damping_that_is_not_a_matrix(self, damping):
        assert structure(damping=damping).damping is damping

    def test_symmetrises_what_assembling_leaves(self):
        built = structure(stiffness=changed(STIFFNESS, 0, 1, -1.0 + 1e-12))
        assert_array_equal(built.stiffness, built.stiffness.T)

    def test_inputs_are_neither_modified_nor_shared(self):
        mass, stiffness, row = MASS.copy(), STIFFNESS.copy(), np.array([1.0, 2.0])
        built = structure(mass=mass, stiffness=stiffness, points={"p": row})
        mass[0, 0], stiffness[0, 0], row[0] = 9.0, 9.0, 9.0
        assert (built.mass[0, 0], built.stiffness[0, 0], built.row("p")[0]) == (2.0, 3.0, 1.0)

    def test_what_it_holds_cannot_be_overwritten(self):
        built = structure()
        for array in (built.mass, built.stiffness, built.row("tip")):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0

    def test_is_compared_by_identity_so_that_it_can_be_a_key(self):
        first, second = structure(), structure()
        assert first == first
        assert first != second
        assert {first: 1}[first] == 1


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

    def test_the_mapping_given_can_change_afterwards(self):
        points = {"tip": 1}
        built = structure(points=points)
        points["root"] = 0
        assert set(built.points) == {"tip"}


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

    def test_of_a_misspelt_name_says_what_may_be_meant(self):
        with pytest.raises(MultiPhiError, match="got 'tpi', need one of: root, tip; did you mean 'tip'"):
            structure().row("tpi")

    def test_of_an_unknown_name_lists_a_dozen_of_many(self):
        built = LinearStructure(np.eye(40), np.eye(40), points={f"p{i:02d}": i for i in range(40)})
        with pytest.raises(MultiPhiError, match=r"need one of: p00, .*p11 and 28 more$"):
            built.row("elsewhere")

    def test_of_a_structure_without_points_says_so(self, refused):
        refused(ValueError, "point: got 'tip', need one of: none", structure(points={}).row, "tip")


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

    def test_modal_ratios_do_not_follow_the_list_they_came_from(self):
        ratios = [0.04, 0.02]
        damping = ModalDamping(ratios)
        ratios[0] = 0.5
        assert_array_equal(damping.of(2), [0.04, 0.02])
        assert damping == ModalDamping((0.04, 0.02))


FINITE = st.floats(-1e6, 1e6)


class TestProperties:
    @given(arrays(float, (4, 4), elements=FINITE), arrays(float, (4, 2), elements=FINITE))
    def test_any_gram_matrices_make_a_structure(self, root, thin):
        mass, stiffness = root @ root.T + np.eye(4) * (1 + np.sum(root**2)), thin @ thin.T
        built = LinearStructure(mass, stiffness)
        assert_allclose(built.mass, mass, rtol=0, atol=1e-9 * np.max(mass))
        assert_array_equal(built.stiffness, built.stiffness.T)

    @given(arrays(float, 2, elements=FINITE), arrays(float, 2, elements=FINITE))
    def test_row_is_linear_in_its_coefficients(self, first, second):
        built = structure(points={"a": first, "b": second})
        assert_allclose(built.row({"a": 2.0, "b": -3.0}), 2 * first - 3 * second, rtol=1e-15, atol=1e-9)

    @given(st.integers(0, 3), st.integers(0, 3), st.sampled_from(["mass", "stiffness"]), st.booleans())
    def test_one_value_that_is_not_finite_anywhere_is_found(self, refused, i, j, which, sparse):
        matrices = {"mass": np.eye(4), "stiffness": np.eye(4)}
        matrices[which] = changed(changed(np.eye(4), i, j, math.nan), j, i, math.nan)
        if sparse:
            matrices[which] = scipy.sparse.csr_array(matrices[which])
        refused(ValueError, f"{which}: got a value that is NaN", LinearStructure, **matrices)

    @settings(max_examples=40)
    @given(st.one_of(st.none(), st.text(), st.booleans(), st.complex_numbers(), st.lists(st.text()), st.binary()))
    def test_nothing_else_is_taken_for_a_matrix(self, thing):
        with pytest.raises(MultiPhiError):
            LinearStructure(thing, thing)
