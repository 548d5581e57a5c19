"""A structure knows its rows by node and component, and supports leave the numbering of what is given as it was."""

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_array_equal

from multiphi_exudyn import LinearStructure

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
