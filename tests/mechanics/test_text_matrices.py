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

    def test_a_node_without_mass_follows_statically(self, saved):
        files = saved("j_MASS1.mtx", nodal(MASS * (np.arange(N) != 3))), saved("j_STIF1.mtx", nodal(STIFFNESS))
        found = read_structure(*files, points={"follows": (10, "uz")})
        assert_array_equal(found.massless, [5])
        assert found.dofs.rows[5] == (10, "uz")
        assert_array_equal(found.row("follows"), [0, 0, 0, 0, 0, 1])
        for third in (2, 4):  # between ux of nodes 10 and 7
            assert_allclose(found.condensed(np.eye(6)[third])[5], 1 / 3, rtol=1e-12)
        assert_allclose(read_structure(*files).transformation.toarray()[5], [0, 0, 1 / 3, 0, 1 / 3], rtol=1e-12)

    def test_a_size_with_a_point_is_a_size_or_refused(self, saved):
        entries = "1 1 2\n2 2 2\n3 3 2\n"
        found = read_array("mass", saved("m.mtx", "3 3 3.0\n" + entries))
        assert_array_equal(found.toarray(), 2 * np.eye(3))
        with pytest.raises(ValueError, match=r"'3 3 3.0', which may be a size or an entry"):
            read_array("mass", saved("m.mtx", "3 3 3.0\n1 1 2\n2 2 2\n1 3 2\n"))

    def test_exponents_of_fortran_are_read(self, saved):
        found = read_array("mass", saved("m.mtx", "1 1 2.5D0\n2 2 1.d+01\n3 3 2D-1\n"))
        assert_array_equal(found.diagonal(), [2.5, 10.0, 0.2])

    def test_files_with_and_without_nodes_do_not_mix(self, saved, refused):
        files = saved("j_MASS1.mtx", coordinate(MASS)), saved("j_STIF1.mtx", nodal(STIFFNESS))
        refused(ValueError, "mass: got a file without nodes", read_structure, *files)

    def test_a_table_beside_nodes_is_one_too_many(self, saved, refused):
        files = saved("j_MASS1.mtx", nodal(MASS)), saved("j_STIF1.mtx", nodal(STIFFNESS))
        refused(ValueError, "dofs: got a table", read_structure, *files, dofs=NODES)

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

    @pytest.mark.parametrize("value", ["5", "6", "5.0", "6.0"])
    def test_an_entry_that_looks_like_a_size_is_an_entry(self, saved, value):
        lines = [f"{N} {N} {value}", *(f"{i} {i} {i}" for i in range(N - 1, 0, -1))]
        found = read_array("mass", saved("m.mtx", "\n".join(lines)))
        assert_array_equal(found.toarray(), np.diag([*range(1, N), float(value)]))

    @pytest.mark.parametrize("entries", [N - 1, N + 1])
    def test_a_size_that_does_not_fit_is_refused(self, saved, entries):
        text = f"{N} {N} {entries}\n" + coordinate(MASS)
        with pytest.raises(
            MultiPhiError, match=r"its first line reads '6 6 \d', which is no size, as 6 entries follow"
        ):
            read_array("mass", saved("m.mtx", text))


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

    def test_that_end_early_are_refused(self, saved):
        file = saved("sub.mtx", self.text().rstrip(" \n0123456789."))
        with pytest.raises(MultiPhiError, match="mass matrix has 20 numbers, which are no triangle"):
            read_structure(file, file)


class TestTables:
    @pytest.mark.parametrize("pair", ["{0} {1}", "{0}, {1}", "{0}.{1}", " {0};{2}"])
    def test_of_nodes_in_a_file(self, saved, pair):
        lines = [pair.format(node, component, ["ux", "uy", "uz"][component - 1]) for node, component in NODES]
        files = [saved(name, coordinate(a)) for name, a in (("m.mtx", MASS), ("k.mtx", STIFFNESS))]
        table = saved("rows.dof", "\n".join(["# node component", *lines]))
        found = read_structure(*files, points={"tip": (10, "uz")}, dofs=table, fixed=[(2, "uz")])
        assert_array_equal(found.row("tip"), [0, 0, 1, 0, 0])

    @pytest.mark.parametrize("text", ["1 2 3\n", "a b\n", "1\n"])
    def test_refuses(self, saved, text):
        files = [saved(name, coordinate(a)) for name, a in (("m.mtx", MASS), ("k.mtx", STIFFNESS))]
        with pytest.raises(MultiPhiError, match=r"dofs: got .*rows.dof.*, need a readable table"):
            read_structure(*files, dofs=saved("rows.dof", text))


class TestHarwellBoeing:
    @pytest.mark.parametrize("ending", ["rsa", "hb", "rb", "matrix"])
    def test_symmetric(self, saved, ending):
        found = read_array("stiffness", saved(f"k.{ending}", harwell_boeing(STIFFNESS)))
        assert_allclose(found.toarray(), STIFFNESS, rtol=1e-15)

    def test_unsymmetric_as_scipy_writes_it(self, tmp_path):
        scipy.io.hb_write(tmp_path / "k.rua", scipy.sparse.csc_matrix(STIFFNESS))
        assert_allclose(read_array("stiffness", tmp_path / "k.rua").toarray(), STIFFNESS, rtol=1e-15)

    def test_diagonal(self, saved):
        assert_array_equal(read_array("mass", saved("m.rsa", harwell_boeing(MASS))).toarray(), MASS)

    def test_numbers_that_touch_and_fortran_exponents(self, saved):
        text = harwell_boeing(-STIFFNESS, layout="(1P,3D23.16)", width=23).replace("E+", "D+")
        assert "D+05-" in text
        assert_allclose(read_array("stiffness", saved("k.rsa", text)).toarray(), -STIFFNESS, rtol=1e-15)

    def test_right_hand_sides_are_left_out(self, saved):
        text = harwell_boeing(STIFFNESS, right=f"{'F':14}{1:14}{0:14}") + f"{1.0:25.16E}"
        assert_allclose(read_array("stiffness", saved("k.rsa", text)).toarray(), STIFFNESS, rtol=1e-15)

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
