"""Abaqus, CalculiX and Harwell-Boeing text is the matrix that was written, whole or by one triangle."""

import gzip

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from numpy.testing import assert_allclose, assert_array_equal

from multiphi_exudyn import MultiPhiError, read_structure
from multiphi_exudyn.mechanics.files import read_array

N = 6
MASS = np.diag(np.arange(1.0, N + 1))
STIFFNESS = 3e5 * (3 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
NODES = [(2, 1), (2, 3), (10, 1), (10, 3), (7, 1), (7, 3)]  # of the rows as the program numbers them


def entries(matrix, triangle="whole"):
    kept = {"whole": matrix, "lower": np.tril(matrix), "upper": np.triu(matrix)}[triangle]
    return [(i, j, kept[i, j]) for i, j in np.argwhere(kept).tolist()]


def coordinate(matrix, triangle="whole"):
    return "".join(f"{i + 1} {j + 1}  {value:.15e}\n" for i, j, value in entries(matrix, triangle))


def nodal(matrix, triangle="lower"):
    lines = [
        "{0[0]},{0[1]}, {1[0]},{1[1]}, {2:.15e}\n".format(NODES[i], NODES[j], value)
        for i, j, value in entries(matrix, triangle)
    ]
    return "** Assembled nodal matrix\n" + "".join(lines)


def harwell_boeing(matrix, kind="RSA", layout="(3E25.16)", right="", width=25):
    """A matrix by its header and fixed fields, columns of the lower triangle where it is symmetric."""
    stored = scipy.sparse.csc_array(np.tril(matrix) if kind[1] == "S" else matrix)
    values = [f"{value:{width}.16E}" for value in stored.data]
    places, pointers = ([f"{k + 1:8}" for k in array] for array in (stored.indices, stored.indptr))
    cards = [cut(pointers, 10), cut(places, 10), cut(values, 3)]
    counts = [len(card) for card in cards]
    head = [
        f"{'a matrix':72}{'key':8}",
        "".join(f"{k:14}" for k in (sum(counts), *counts, 1 if right else 0)),
        f"{kind:14}" + "".join(f"{k:14}" for k in (N, N, len(values), 0)),
        f"{'(10I8)':16}{'(10I8)':16}{layout:20}{'(3E25.16)' if right else '':20}",
    ]
    return "\n".join([*head, *([right] if right else []), *(line for card in cards for line in card), ""])


def cut(fields, each):
    return ["".join(fields[k : k + each]) for k in range(0, len(fields), each)]


@pytest.fixture
def saved(tmp_path):
    def save(name, text):
        content = text.encode()
        (tmp_path / name).write_bytes(gzip.compress(content, mtime=0) if name.endswith(".gz") else content)
        return tmp_path / name

    return save


class TestAbaqus:
    @pytest.mark.parametrize("triangle", ["whole", "lower", "upper"])
    @pytest.mark.parametrize("name", ["job_STIF1.mtx", "job_STIF1.mtx.gz", "job.sti"])
    def test_coordinates(self, saved, name, triangle):
        found = read_array("stiffness", saved(name, coordinate(STIFFNESS, triangle)))
        assert scipy.sparse.issparse(found)
        assert_array_equal(found.toarray(), STIFFNESS)

    @pytest.mark.parametrize("triangle", ["whole", "lower", "upper"])
    def test_nodes_and_components(self, saved, triangle):
        """A mass without entries beside the diagonal, in other lines than the stiffness: rows are by node."""
        files = saved("j_MASS1.mtx", nodal(MASS[::-1, ::-1])), saved("j_STIF1.mtx", nodal(STIFFNESS, triangle))
        found = read_structure(*files, files[1], points={"tip": (7, "uz")}, fixed=[(2, "all")])
        assert found.dofs.rows == ((7, "ux"), (7, "uz"), (10, "ux"), (10, "uz"))
        order = [4, 5, 2, 3]
        assert_array_equal(found.stiffness.toarray(), STIFFNESS[np.ix_(order, order)])
        assert_array_equal(found.damping.toarray(), STIFFNESS[np.ix_(order, order)])
        assert_array_equal(found.mass.diagonal(), np.diag(MASS)[::-1][order])
        assert_array_equal(found.row("tip"), [0, 1, 0, 0])

    @pytest.mark.parametrize(
        ("text", "cause"),
        [
            ("", "a line has 0 columns"),
            ("** nothing\n", "a line has 0 columns"),
            ("1 2 3 4\n", "a line has 4 columns"),
            ("1 1 2.0\n2 2\n", "columns"),
            ("0 1 2.0\n", "in rows and columns from 0"),
            ("1.5 1 2.0\n", "no whole number"),
            ("1 1 two\n", "two"),
            ("1 1 1.0\n900000000 1 2.0\n", "from 1 to 900000000"),
            ("1,1,1,11, 3.0\n", "got component 11"),
        ],
    )
    def test_refuses(self, saved, text, cause):
        with pytest.raises(MultiPhiError, match=r"stiffness: got .*need a readable matrix: ") as caught:
            read_array("stiffness", saved("job_STIF1.mtx", text))
        assert cause in str(caught.value)
        assert "\n" not in str(caught.value)


class TestWithoutBanner:
    """Matrix Market files that lack their first line begin with "rows columns entries"."""

    @pytest.mark.parametrize("triangle", ["whole", "lower", "upper"])
    @pytest.mark.parametrize("comments", ["", "% by hand\n%\n"])
    @pytest.mark.parametrize("matrix", [MASS, STIFFNESS, np.eye(7), np.ones((3, 3)) + np.eye(3)])
    def test_the_size_is_no_entry(self, saved, triangle, comments, matrix):
        text = coordinate(matrix, triangle)
        size = f"{len(matrix)} {len(matrix)} {len(text.splitlines())}\n"
        assert_array_equal(read_array("mass", saved("m.mtx", comments + size + text)).toarray(), matrix)


class TestSubstructures:
    def text(self):
        lower = [[f"{value:.1E}" for value in row[: i + 1]] for i, row in enumerate(STIFFNESS.tolist())]
        stiffness = ",\n".join(", ".join(row) for row in lower)
        mass = ", ".join(f"{MASS[i, j]}" for i in range(N) for j in range(i + 1))
        head = "** ABAQUS\n*USER ELEMENT, NODES=2, LINEAR\n1, 2, 3\n"
        return f"{head}*MATRIX,TYPE=STIFFNESS\n{stiffness}\n*matrix, type=mass\n{mass}\n"

    def test_of_abaqus_hold_both_matrices(self, saved):
        file = saved("sub.mtx", self.text())
        found = read_structure(file, file, points={"tip": 5})
        assert_array_equal(found.mass, MASS)
        assert_array_equal(found.stiffness, STIFFNESS)


class TestHarwellBoeing:
    @pytest.mark.parametrize("ending", ["rsa", "hb", "rb", "matrix"])
    def test_symmetric(self, saved, ending):
        found = read_array("stiffness", saved(f"k.{ending}", harwell_boeing(STIFFNESS)))
        assert_allclose(found.toarray(), STIFFNESS, rtol=1e-15)

    @pytest.mark.parametrize(
        ("spoil", "cause"),
        [
            (lambda text: text[:200], "ends inside its header"),
            (lambda text: text.replace("RSA", "RSE"), "of the type 'RSE'; read are assembled real ones"),
            (lambda text: text.replace("RSA", "CSA"), "of the type 'CSA'"),
            (lambda text: text.replace("RSA", "PSA"), "of the type 'PSA'"),
            (lambda text: text[:-200], "fewer than the"),
            (lambda text: text.replace("3E25.16", "1P3F25.16"), "the format '(1P3F25.16)'"),
            (lambda text: text.replace("3E25.16", "A80"), "the format '(A80)'"),
            (lambda text: text.replace(f"{N:14}{N:14}", f"{N:14}{N - 1:14}"), "6 rows and 5 columns"),
            (lambda text: text.replace(f"{N:14}{N:14}", f"{10**12:14}{10**12:14}"), "fewer than the"),
        ],
    )
    def test_refuses(self, saved, spoil, cause):
        with pytest.raises(MultiPhiError, match=r"stiffness: got .*need a readable matrix: ") as caught:
            read_array("stiffness", saved("k.rsa", spoil(harwell_boeing(STIFFNESS))))
        assert cause in str(caught.value)
        assert "\n" not in str(caught.value)
