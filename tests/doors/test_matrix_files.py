"""Matrices from files are those that were written, whatever the kind of file; a broken one is told in one line."""

import gzip

import numpy as np
import pytest
import scipy.io
import scipy.sparse
from numpy.testing import assert_array_equal

from multiphi_exudyn import MultiPhiModel, MultiPhiTypeError, MultiPhiValueError, read_structure
from multiphi_exudyn.mechanics.files import read_array

N = 5
MASS = scipy.sparse.csc_array(np.diag(np.arange(1.0, N + 1)))
STIFFNESS = scipy.sparse.csc_array(3 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
HEADER = b"%%MatrixMarket matrix coordinate "
ENDINGS = (".mtx", ".mtx.gz", ".npz", ".npy")


def write(file, matrix):
    """``matrix`` in the kind of file that its name says."""
    if file.name.endswith(".npz"):
        scipy.sparse.save_npz(file, matrix)
    elif file.name.endswith(".npy"):
        np.save(file, matrix.toarray())
    elif file.name.endswith(".mat"):
        scipy.io.savemat(file, {"k": matrix})
    elif file.name.endswith(".rsa"):
        scipy.io.hb_write(file, scipy.sparse.csc_matrix(matrix))
    elif file.name.endswith(".sti"):
        found = matrix.tocoo()
        np.savetxt(file, np.column_stack([found.row + 1, found.col + 1, found.data]), fmt="%d %d %.15e")
    else:
        plain = file.with_name("plain.mtx")
        scipy.io.mmwrite(plain, matrix, symmetry="symmetric")
        content = plain.read_bytes()
        file.write_bytes(gzip.compress(content, mtime=0) if file.name.endswith(".gz") else content)
    return file


@pytest.fixture
def mass(tmp_path):
    return write(tmp_path / "mass.npz", MASS)


class TestMatrices:
    @pytest.mark.parametrize("triangle", ["lower", "upper", "both"])
    @pytest.mark.parametrize("name", ["k.mtx", "k.mtx.gz"])
    def test_of_a_banner_that_says_symmetric_are_not_doubled(self, tmp_path, triangle, name):
        matrix = STIFFNESS.toarray()
        kept = {"lower": np.tril(matrix), "upper": np.triu(matrix), "both": matrix}[triangle]
        places = np.argwhere(kept)
        entries = "".join(f"{i + 1} {j + 1} {kept[i, j]}\n" for i, j in places.tolist())
        text = HEADER + f"real Symmetric\n% by hand\n{N} {N} {len(places)}\n{entries}".encode()
        (tmp_path / name).write_bytes(gzip.compress(text, mtime=0) if name.endswith(".gz") else text)
        assert_array_equal(read_array("stiffness", tmp_path / name).toarray(), matrix)

    @pytest.mark.parametrize("ending", ENDINGS)
    def test_are_those_that_were_written(self, tmp_path, ending):
        files = [write(tmp_path / f"{name}{ending}", a) for name, a in (("mass", MASS), ("stiffness", STIFFNESS))]
        found = read_structure(*files, damping=files[1], points={"tip": N - 1})
        assert scipy.sparse.issparse(found.stiffness) == (ending != ".npy")
        for got, need in ((found.mass, MASS), (found.stiffness, STIFFNESS), (found.damping, STIFFNESS)):
            np.testing.assert_array_equal(got.toarray() if ending != ".npy" else got, need.toarray())
        assert MultiPhiModel(found, modes=1).level(()).frequencies[0] > 0

    def test_of_one_symmetric_triangle_and_of_the_whole_are_the_same(self, tmp_path, mass):
        half = write(tmp_path / "half.mtx", STIFFNESS)
        scipy.io.mmwrite(tmp_path / "whole.mtx", STIFFNESS, symmetry="general")
        assert b"symmetric" in half.read_bytes()
        found = [read_structure(mass, file).stiffness for file in (half, tmp_path / "whole.mtx")]
        assert abs(found[0] - found[1]).max() == 0


BROKEN = {
    "a.mtx": [
        b"", b"text", HEADER + b"pattern symmetric\n5 5 1\n1 1\n", HEADER + b"complex general\n5 5 1\n1 1 1 1\n",
        HEADER + b"real symmetric\n5 5 3\n1 1 1\n", HEADER + b"real symmetric\n5 5 1\n6 1 1\n",
        HEADER + b"real general\n5 4 1\n1 1 1\n", HEADER + b"real general\n5 5 1\n1 1 nan\n",
        HEADER + b"real general\n5 5 1\n1 2 1\n", HEADER + b"real general\n4 4 1\n1 1 1\n",
        HEADER + b"real general\n5 5 1\n1 1 3e", HEADER + b"integer general\n5 5 1\n1 1 1.5\n",
        HEADER + b"real general\n5 5 1\n1 1 1 2\n", b"%%MatrixMarket matrix array real general\n5 5\n1\n",
    ],
    "a.mtx.gz": [b"", b"text", gzip.compress(HEADER + b"real symmetric\n5 5 1\n1 1 1\n", mtime=0)[:-9]],
    "a.npz": [b"", b"text", b"PK\x03\x04 broken"],
    "a.npy": [b"", b"text", b"\x93NUMPY\x01\x00\x00\x00"],
    "a.txt": [b"1 2 3"],
    "none.mtx": [None],
}  # fmt: skip


@pytest.mark.parametrize(("name", "content"), [(name, c) for name, contents in BROKEN.items() for c in contents])
def test_a_broken_file_is_one_line(tmp_path, mass, name, content):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises((MultiPhiValueError, MultiPhiTypeError), match="stiffness: ") as caught:
        read_structure(mass, tmp_path / name)
    assert "\n" not in str(caught.value)


SEVERAL = (".npz", ".mat", ".op4")


def write_several(file, arrays):
    """Arrays by name in the kind of file that its name says."""
    if file.suffix == ".npz":
        np.savez(file, **arrays)
    elif file.suffix == ".mat":
        scipy.io.savemat(file, {**arrays, "title": "a structure"})
    else:
        with np.printoptions():  # which importing it changes
            op4 = pytest.importorskip("pyyeti.nastran.op4")
        op4.write(str(file), arrays)
    return file


def write_mat_73(file, arrays):
    """As MATLAB writes them: 512 bytes of its own, dense matrices by columns, sparse ones in three arrays."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(file, "w", userblock_size=512) as stored:
        for name, array in arrays.items():
            if not scipy.sparse.issparse(array):
                stored[name] = array.T
                continue
            group = stored.create_group(name)
            group.attrs["MATLAB_sparse"] = array.shape[0]
            group["data"], group["ir"], group["jc"] = array.data, array.indices, array.indptr
        stored.create_group("#refs#")
        stored.create_group("results")["stiffness"] = np.eye(N)
    with file.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file")
    return file


class TestSeveralArrays:
    @pytest.mark.parametrize("ending", SEVERAL)
    def test_are_told_by_the_names_of_the_field(self, tmp_path, ending):
        arrays = {"MAA": MASS.toarray(), "KAA": STIFFNESS, "bgg": 2 * STIFFNESS.toarray(), "modes": np.eye(2)}
        if ending == ".npz":
            arrays["KAA"] = STIFFNESS.toarray()
        file = write_several(tmp_path / f"model{ending}", arrays)
        found = read_structure(file, file, damping=file)
        for got, need in ((found.mass, MASS), (found.stiffness, STIFFNESS), (found.damping, 2 * STIFFNESS)):
            np.testing.assert_array_equal(got.toarray() if scipy.sparse.issparse(got) else got, need.toarray())
        assert scipy.sparse.issparse(found.stiffness) == (ending != ".npz")

    @pytest.mark.parametrize("ending", SEVERAL)
    def test_are_taken_by_name(self, tmp_path, ending):
        file = write_several(tmp_path / f"model{ending}", {"k1": STIFFNESS.toarray(), "k2": MASS.toarray()})
        found = read_structure((file, "k2"), (file, "k1"))
        np.testing.assert_array_equal(found.stiffness, STIFFNESS.toarray())
        with pytest.raises(MultiPhiValueError, match="it holds the arrays k1, k2: say which, \\(file, name\\)"):
            read_structure((file, "k2"), file)
        with pytest.raises(MultiPhiValueError, match=r"no array 'k3', need one of: k1, k2$"):
            read_structure((file, "k2"), (file, "k3"))

    @pytest.mark.parametrize("version", ["7", "7.3"])
    def test_of_matlab_structs_are_their_fields(self, tmp_path, version):
        file, fields = tmp_path / "model.mat", {"M": MASS.toarray(), "K": STIFFNESS, "name": "boom"}
        if version == "7":
            scipy.io.savemat(file, {"model": {"beam": fields, "other": np.eye(2)}, "title": "a structure"})
        else:
            arrays = {f"model/beam/{name}": fields[name] for name in "MK"}
            write_mat_73(file, arrays | {"model/other": np.eye(2)})
        for files in ((file, file), ((file, "model.beam.M"), (file, "model.beam.K"))):
            if version == "7.3" and files[1] == file:
                continue  # another stiffness stands in a further struct
            found = read_structure(*files)
            np.testing.assert_array_equal(found.mass, MASS.toarray())
            assert_array_equal(found.stiffness.toarray(), STIFFNESS.toarray())
        with pytest.raises(MultiPhiValueError, match=r"no array 'model.M', need one of: model.beam.M, "):
            read_structure((file, "model.M"), (file, "model.beam.K"))
