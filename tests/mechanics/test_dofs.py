"""A structure knows its rows by node and component, and supports leave the numbering of what is given as it was."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_array_equal

from multiphi_exudyn import LinearStructure, ModalDamping, MultiPhiModel, assemble

ROWS = [(1, "ux"), (1, "uz"), (7, 1), (7, 3), (9, "UX"), (9, 3)]
N = len(ROWS)
MASS = np.diag(np.arange(1.0, N + 1))
STIFFNESS = 3 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
KINDS = {"dense": np.asarray, "sparse": scipy.sparse.csr_array}


def structure(kind=np.asarray, **changes):
    return LinearStructure(**{"mass": kind(MASS), "stiffness": kind(STIFFNESS), "dofs": ROWS} | changes)


class TestPoints:
    def test_are_found_by_node_and_component(self):
        found = structure(points={"tip": (7, "uz"), "same": (7, 3), "side": (9, "ux"), "row": np.arange(N) == 0})
        assert [int(np.flatnonzero(found.row(name))[0]) for name in found.points] == [3, 3, 4, 0]

    def test_a_table_may_be_an_array(self):
        found = structure(dofs=np.array([[node, c] for node in (1, 7, 9) for c in (1, 2)]), points={"p": (9, "uy")})
        assert found.row("p")[5] == 1

    def test_two_numbers_are_a_row_where_no_node_is_known(self):
        assert_array_equal(LinearStructure(np.eye(2), np.eye(2), points={"p": (1, 2)}).row("p"), [1, 2])

    @pytest.mark.parametrize(
        ("place", "begins"),
        [
            ((8, "uz"), "points['tip']: got node 8, need one of 3 nodes from 1 to 9; did you mean 7?"),
            ((7, "uy"), "points['tip']: got 'uy' of node 7, need one of: ux, uz"),
            ((7, "uzz"), "points['tip']: got component 'uzz', need 1 to 6 or one of: ux, uy, uz, rx, ry, rz; did you"),
            ((7, 0), "points['tip']: got component 0, need 1 to 6"),
            ((7, None), "points['tip']: got component None, need 1 to 6"),
            (7, "points['tip']: got 7, need (node, component), as (7, 'uz'): the rows have nodes"),
            (0, "points['tip']: got 0, need (node, component)"),
        ],
    )
    def test_refuses(self, refused, place, begins):
        refused(ValueError, begins, structure, points={"tip": place})

    @pytest.mark.parametrize("node", ["seven", 7.5, None, True])
    def test_refuses_what_is_no_node(self, refused, node):
        refused(TypeError, f"points['tip']: got node {node!r}", structure, points={"tip": (node, "uz")})

    def test_refuses_a_node_where_none_is_known(self, refused):
        refused(ValueError, "points['tip']: got a node, but", structure, dofs=None, points={"tip": (7, "uz")})


class TestTable:
    @pytest.mark.parametrize(
        ("kind", "rows", "begins"),
        [
            (ValueError, ROWS[:-1], "dofs: got 5 rows, need 6 as the mass has"),
            (ValueError, [*ROWS[:-1], ROWS[0]], "dofs: got (1, 'ux') twice, need"),
            (ValueError, [*ROWS[:-1], (9, "w")], "dofs[5]: got component 'w'"),
            (ValueError, [*ROWS[:-1], (9, 3, 1)], "dofs[5]: got (9, 3, 1), need"),
            (TypeError, [*ROWS[:-1], 9], "dofs[5]: got 9, need"),
            (TypeError, [*ROWS[:-1], "9z"], "dofs[5]: got '9z', need"),
            (TypeError, "rows.txt", "dofs: got str, need"),
            (TypeError, 3, "dofs: got int, need"),
        ],
    )
    def test_refuses(self, refused, kind, rows, begins):
        refused(kind, begins, structure, dofs=rows)

    def test_a_mass_that_lacks_inertia_is_named_by_its_node(self, refused):
        refused(ValueError, "mass: diagonal entry 3 (uz of node 7) is 0", structure, mass=MASS * (np.arange(N) != 3))


class TestFixed:
    @pytest.mark.parametrize("kind", KINDS)
    def test_matrices_points_and_table_keep_their_numbering(self, kind):
        points = {"number": (9, 3), "node": (7, "uz"), "row": np.arange(N)}
        found = structure(KINDS[kind], damping=KINDS[kind](STIFFNESS), points=points, fixed=[(1, "all"), (7, "ux")])
        free = [3, 4, 5]
        assert_array_equal(found.free, free)
        for held, given in ((found.mass, MASS), (found.stiffness, STIFFNESS), (found.damping, STIFFNESS)):
            held = held.toarray() if kind == "sparse" else held
            assert_array_equal(held, given[np.ix_(free, free)])
        assert_array_equal(found.point_rows, [[0, 0, 1], [1, 0, 0], [3, 4, 5]])
        assert found.dofs.rows == ((7, "uz"), (9, "ux"), (9, "uz"))

    def test_nothing_fixed_leaves_everything(self):
        assert_array_equal(structure().free, np.arange(N))

    def test_what_is_fixed_needs_no_inertia(self):
        assert structure(mass=MASS * (np.arange(N) > 0), fixed=[(1, "ux")]).n == N - 1

    def test_a_change_keeps_what_is_free(self):
        changed = replace(structure(fixed=[(1, "ux"), (9, "uz")]), damping=ModalDamping(0.01))
        assert_array_equal(changed.free, [1, 2, 3, 4])
        assert_array_equal(replace(changed, fixed=[(1, "uz")]).free, [2, 3, 4])

    def test_is_what_ties_to_the_ground_are(self):
        held = structure(fixed=[(1, "ux"), (7, "uz")])
        tied = assemble({"a": structure(points={"p": (1, "ux"), "q": (7, "uz")})}, ties=[{"a.p": 1.0}, {"a.q": 1.0}])
        assert_array_equal(held.free, tied.free)
        assert_array_equal(held.stiffness, tied.stiffness)

    def test_makes_a_model(self):
        model = MultiPhiModel(structure(points={"tip": (9, "uz")}, fixed=[(1, "all")]))
        lowest = scipy.linalg.eigh(STIFFNESS[2:, 2:], MASS[2:, 2:], eigvals_only=True)[0]
        assert model.level(()).frequencies[0] == pytest.approx(np.sqrt(lowest) / (2 * np.pi))

    @pytest.mark.parametrize(
        ("kind", "changes", "begins"),
        [
            (ValueError, {"fixed": [6], "dofs": None}, "fixed: got DoF 6, need 0 <= DoF < 6"),
            (ValueError, {"fixed": [-1], "dofs": None}, "fixed: got DoF -1"),
            (ValueError, {"fixed": range(6), "dofs": None}, "fixed: got all 6 degrees of freedom"),
            (ValueError, {"fixed": [(2, "all")]}, "fixed: got node 2, need one of 3 nodes"),
            (ValueError, {"fixed": [(1, "uy")]}, "fixed: got 'uy' of node 1"),
            (ValueError, {"fixed": [(1, "all")], "dofs": None}, "fixed (1, 'all'): got a node, but"),
            (ValueError, {"fixed": [5], "dofs": None, "points": {"p": 5}}, "points['p']: got a place that is fixed"),
            (ValueError, {"fixed": [1]}, 'fixed: got 1, need (node, component) or (node, "all"), as (1, "all")'),
            (TypeError, {"fixed": 5}, "fixed: got 5, need a list"),
            (TypeError, {"fixed": "clamp"}, "fixed: got 'clamp', need a list"),
            (TypeError, {"fixed": [True]}, "fixed: got True, need a list"),
            (TypeError, {"fixed": [1.0]}, "fixed: got 1.0, need a list"),
        ],
    )
    def test_refuses(self, refused, kind, changes, begins):
        refused(kind, begins, structure, **changes)

    def test_an_assembly_has_ties_instead(self, refused):
        refused(ValueError, "fixed: got degrees of freedom of an", replace, assemble({"a": structure()}), fixed=[0])
