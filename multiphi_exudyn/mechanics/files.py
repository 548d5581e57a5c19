"""Matrix files: linear structures from matrices that finite element programs have written.

Files of several arrays with names:

.npz    ``numpy.savez``, or one sparse matrix by ``scipy.sparse.save_npz``
.mat    MATLAB to version 7 by scipy; version 7.3 is HDF5, for which h5py is needed: the extra ``matlab``
.op4    Nastran OUTPUT4, text or binary, dense or sparse, by pyYeti: the extra ``nastran``

A field of a MATLAB struct has the name "model.M". The array is selected by (file, name). Without a name it is the only
array, if not by its name another quantity, or among the largest square ones the only one with a usual initial,
variables before fields: M for mass; K for stiffness; C, D or B for damping.

Matrices in text:

    row column value                           Abaqus *MATRIX OUTPUT, FORMAT=COORDINATE; CalculiX .sti and .mas; Matrix
                                               Market without its banner, after a line of rows, columns and entries
    node, component, node, component, value    Abaqus *MATRIX OUTPUT, FORMAT=MATRIX INPUT or LABELS
    rows of one triangle, after a keyword      Abaqus *SUBSTRUCTURE MATRIX OUTPUT
    four lines of header, then columns         Harwell-Boeing and Rutherford-Boeing, assembled, real or integer: Ansys
                                               HBMAT, LS-DYNA, the SuiteSparse collection

Rows and columns count from 1. One triangle of a symmetric matrix is enough. scipy.io.hb_read does not read symmetric
matrices, as those of structures are.

Sources: Abaqus Analysis User's Guide, 10.3.1; I. S. Duff, R. G. Grimes, J. G. Lewis, Users' guide for the
Harwell-Boeing sparse matrix collection, RAL-92-086, 1992.

Endings:

.mtx, .mtx.gz            Matrix Market, sparse or dense; of a symmetric matrix one triangle is enough
                         (R. F. Boisvert, R. Pozo, K. Remington, The Matrix Market exchange formats, NISTIR 5935, 1996)
.mtx, .mtx.gz            Abaqus *MATRIX GENERATE and *MATRIX OUTPUT, with or without nodes
.mtx                     Abaqus *SUBSTRUCTURE MATRIX OUTPUT
.sti, .mas               CalculiX, its *FREQUENCY, SOLVER=MATRIXSTORAGE
.rsa, .rua, .hb, .rb     Harwell-Boeing and Rutherford-Boeing; Ansys HBMAT writes .matrix
.mat                     MATLAB
.op4                     Nastran OUTPUT4
.npz                     NumPy arrays with names, or one sparse matrix as ``scipy.sparse.save_npz`` writes it
.npy                     one dense array, as ``numpy.save`` writes it
"""

from __future__ import annotations

import gzip
import io
import math
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
import scipy.io
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix, one_of
from multiphi_exudyn.mechanics.condensed_structure import condensed_structure
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.dofs import DofTable, Place, node_component
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = [
    "ARRAY_READERS",
    "MatrixFile",
    "NodalMatrix",
    "complete",
    "harwell_boeing",
    "lines_of",
    "npz_arrays",
    "read_array",
    "read_arrays",
    "read_structure",
    "same_rows",
    "selected_name",
    "substructure_matrices",
    "triplets",
]

INITIALS = {"mass": ("m",), "stiffness": ("k", "stif"), "damping": ("c", "d", "b")}
SUFFIX = r"([a-z]{2})?(\d.*|_.*|red.*)?"  # after an initial: Maa, K1, C_red
OWN_NAMES = {  # of one quantity alone, by which it is no other
    "mass": re.compile(rf"mass.*|m(?!at){SUFFIX}"),
    "stiffness": re.compile(r"k.*|stif.*"),
    "damping": re.compile(rf"damp.*|[cdb](?!at){SUFFIX}"),
}
FEM_INTERFACE = {"massMatrix", "stiffnessMatrix", "nodes"}  # arrays of a file that Exudyn's FEMinterface has saved
NUMBER_KINDS = "biufc"  # numpy's codes of numbers
SIGNATURE = b"\x89HDF"
SIGNATURE_AT = (0, 512)  # offsets in bytes: MATLAB writes 512 bytes before
HEADER = 4  # lines
CARD = 14  # characters of a number in the header
FORMAT = re.compile(r"\((?:(\d+)P,?)?(\d*)([IEDFG])(\d+)", re.IGNORECASE)
TYPES = "RI", "SU", "A"  # real or integer; symmetric or unsymmetric; assembled
SUBSTRUCTURE = re.compile(r"\*MATRIX,TYPE=(\w+)", re.IGNORECASE)
FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")  # of exponents in double precision
EMPTY_ROWS = 100  # rows for every entry: with more rows an index is wrong, and the matrix would take much memory
MatrixFile: TypeAlias = "str | os.PathLike[str] | tuple[str | os.PathLike[str], str]"  # a path, or (path, array's name)

T = TypeVar("T")

NUMBERS = {  # pattern of an entry in a Matrix Market file, by its field
    "integer": rb"[+-]?\d+",
    "real": rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?",
}
SHOWN = 40  # bytes of a wrong line that an error shows
SEARCHED = 4096  # bytes of a file that tell its kind
BANNER = b"%%MatrixMarket"
FIRST_BYTES = {  # of files, with their type and usual extension
    BANNER: "Matrix Market, .mtx",
    b"\x93NUMPY": "a NumPy array, .npy",
    b"PK\x03\x04": "NumPy arrays, .npz",
    b"MATLAB": "MATLAB, .mat",
    b"\x89HDF": "HDF5, of MATLAB 7.3, .mat",
    b"\x1f\x8b": "a packed file, .mtx.gz",
}
UNIVERSAL = (
    "a universal file: its modes with pyuff: sets = pyuff.UFF(file).read_sets(); structure_from_modes(frequencies, "
    "shapes, masses) of the sets of type 55"
)
HDF5 = "an HDF5 file: arrays of h5py.File(file) are arguments of LinearStructure; one of MATLAB 7.3 ends in .mat"
TEXT = "numbers in text: LinearStructure(numpy.loadtxt(file, delimiter=','), ...), or as .mtx row, column, value"
OTHER_FILES = {  # other files of programs, and what to write instead
    ".full": "an Ansys .full file: write its matrices by HBMAT, or with ansys-mapdl-reader: dofs, k, m = "
    "reader.read_binary(file).load_km(); LinearStructure(m + triu(m, 1).T, k + triu(k, 1).T)",
    ".rst": "Ansys results: write the matrices of .full by HBMAT, or with ansys-mapdl-reader: rst = "
    "reader.read_binary(file); structure_from_modes(rst.time_values, shapes) of rst.nodal_solution(i)",
    ".cdb": "an Ansys model: write its matrices by HBMAT",
    ".h5": HDF5,
    ".hdf5": HDF5,
    ".csv": TEXT,
    ".txt": TEXT,
    ".unv": UNIVERSAL,
    ".uff": UNIVERSAL,
    ".frd": "CalculiX results: *FREQUENCY, SOLVER=MATRIXSTORAGE writes .sti and .mas",
    ".med": "Code_Aster results: values, i, j, n = matrix.EXTR_MATR(sparse=True) in its command file; "
    "LinearStructure(...) of scipy.sparse.csr_array((values, (i, j)), (n, n))",
    ".rmed": "Code_Aster results: give its matrices, matrix.EXTR_MATR(sparse=True) in its command file",
    ".op2": "Nastran results: write the matrices by OUTPUT4, .op4",
    ".pch": "a Nastran punch file: write the matrices by OUTPUT4, .op4, or of DMIG with pyYeti: tables = "
    "pyyeti.nastran.bulk.rddmig(file); LinearStructure(tables['MAAX'].values, tables['KAAX'].values)",
    ".bdf": "a Nastran model: write its matrices by OUTPUT4, .op4",
    ".inp": "an Abaqus or CalculiX model: *MATRIX GENERATE and *MATRIX OUTPUT write .mtx",
    ".odb": "Abaqus results: *MATRIX GENERATE and *MATRIX OUTPUT write .mtx",
    ".sim": "an Abaqus database: *MATRIX OUTPUT writes .mtx",
}


def npz_arrays(path: Path) -> dict[str, Matrix]:
    """All arrays of an .npz file by name; one that ``scipy.sparse.save_npz`` wrote is one sparse matrix, "matrix"."""
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        if set(stored.files) >= FEM_INTERFACE:
            raise ValueError(
                "it is a FEMinterface of Exudyn, read by fem = exudyn.FEM.FEMinterface(); fem.LoadFromFile(file); "
                "structure = multiphi_exudyn.exudyn_plugin.linear_structure_from_fem(fem, fixed=..., points=...)"
            )
        arrays = dict(stored)
    if "format" not in arrays:
        return arrays
    return {"matrix": _with_valid_indices(scipy.sparse.load_npz(path))}


def mat_arrays(path: Path) -> dict[str, Matrix]:
    """All matrices of numbers in a .mat file by name, those in structs as "struct.field"."""
    with path.open("rb") as file:
        head = file.read(SIGNATURE_AT[-1] + len(SIGNATURE))
    if any(head[at:].startswith(SIGNATURE) for at in SIGNATURE_AT):
        return _mat_73_arrays(path)
    stored = scipy.io.loadmat(path, appendmat=False)
    return _matrices(_with_fields({name: item for name, item in stored.items() if not name.startswith("__")}))


def _with_fields(items: Mapping[str, Any]) -> dict[str, Any]:
    """Variables by name, with the fields of single structs in place of these."""
    found: dict[str, Any] = {}
    for name, item in items.items():
        if isinstance(item, np.ndarray) and item.dtype.names and item.size == 1:
            fields = {f"{name}.{field}": item.ravel()[0][field] for field in item.dtype.names}
            found |= _with_fields(fields)
        else:
            found[name] = item
    return found


def _mat_73_arrays(path: Path) -> dict[str, Matrix]:
    try:
        import h5py
    except ImportError as error:
        needed = (
            "it is of MATLAB 7.3, for which h5py is needed (pip install 'multiphi-exudyn[matlab]'), or save it as -v7"
        )
        raise ValueError(needed) from error
    with h5py.File(path, "r") as file:
        variables = {name: item for name, item in file.items() if not name.startswith("#")}
        return _matrices(_hdf5_arrays(variables))


def _hdf5_arrays(items: Mapping[str, Any]) -> dict[str, Any]:
    """Variables of MATLAB 7.3 by name, with the fields of structs, which are groups, in place of these."""
    found: dict[str, Any] = {}
    for name, item in items.items():
        if hasattr(item, "keys") and "MATLAB_sparse" not in item.attrs:
            found |= _hdf5_arrays({f"{name}.{field}": inner for field, inner in item.items()})
        else:
            found[name] = _hdf5_array(item)
    return found


def _hdf5_array(item: Any) -> Any:
    """A variable of MATLAB 7.3: dense ones are stored by columns, sparse ones as data, ir and jc."""
    if not hasattr(item, "keys"):
        return np.asarray(item).T
    pointers = np.asarray(item["jc"]).astype(np.int64)
    data, rows = (np.asarray(item[name]) if name in item else np.zeros(0) for name in ("data", "ir"))
    shape = (int(item.attrs["MATLAB_sparse"]), len(pointers) - 1)
    return scipy.sparse.csc_array((data, rows.astype(np.int64), pointers), shape=shape)


def op4_arrays(path: Path) -> dict[str, Matrix]:
    """All matrices of a Nastran OUTPUT4 file by name, in lower case."""
    try:
        with np.printoptions():  # which the import of pyYeti changes globally
            from pyyeti.nastran import op4
    except ImportError as error:
        raise ValueError("pyYeti is needed for it (pip install 'multiphi-exudyn[nastran]')") from error
    arrays: dict[str, Matrix] = op4.read(str(path), sparse=None)
    return arrays


def selected_name(name: str, arrays: Mapping[str, Matrix], array_name: str | None) -> str:
    """Name of the array: ``array_name``, or for None the only candidate for ``name`` ("mass", "stiffness", ...)."""
    if array_name is not None:
        if array_name not in arrays:
            raise ValueError(f"it has no array {array_name!r}, need {one_of(array_name, arrays)}")
        return array_name
    if len(arrays) == 1:
        only = next(iter(arrays))
        others = [other for other, names in OWN_NAMES.items() if names.fullmatch(_last_part(only))]
        if name in OWN_NAMES and others and name not in others:
            raise ValueError(
                f"its only array of numbers is {only!r}, by its name the {others[0]}; if it is the {name}, say so, "
                f"(file, {only!r})"
            )
        return only
    square = {key: array.shape[0] for key, array in arrays.items() if array.ndim == 2 and len({*array.shape}) == 1}
    candidates = [
        key
        for key, n in square.items()
        if n == max(square.values()) and _last_part(key).startswith(INITIALS.get(name, ()))
    ]
    candidates = [key for key in candidates if "." not in key] or candidates  # variables before fields
    if len(candidates) != 1:
        raise ValueError(
            f"it holds the arrays {', '.join(arrays)}: say which, (file, name)"
            if arrays
            else "it holds no array of numbers, by its own name or in a struct; need M and K as variables, or fields"
        )
    return candidates[0]


def _last_part(key: str) -> str:
    """The name of a variable, or of a field in its struct, in lower case."""
    return key.lower().rpartition(".")[2]


def _matrices(arrays: Mapping[str, Any]) -> dict[str, Matrix]:
    """Those arrays that are numeric matrices."""
    dense = {name: array for name, array in arrays.items() if isinstance(array, np.ndarray)}
    sparse = {name: _with_valid_indices(array) for name, array in arrays.items() if scipy.sparse.issparse(array)}
    return {name: array for name, array in dense.items() if array.dtype.kind in NUMBER_KINDS} | sparse


def _with_valid_indices(matrix: Matrix) -> Matrix:
    """The sparse matrix; raise for indices outside its shape, which would be read as addresses."""
    if hasattr(matrix, "check_format"):
        matrix.check_format(full_check=True)
    return matrix


ARRAY_READERS: Mapping[str, Callable[[Path], dict[str, Matrix]]] = {
    ".npz": npz_arrays,
    ".mat": mat_arrays,
    ".op4": op4_arrays,
}


@dataclass(frozen=True)
class NodalMatrix:
    """A matrix (n, n) with the node and component of every row."""

    matrix: Matrix
    dofs: DofTable

    def in_rows(self, dofs: DofTable) -> Matrix:
        """The matrix in the rows of another table, which contains all its rows."""
        indices = {row: index for index, row in enumerate(dofs.rows)}
        own_rows = np.array([indices[row] for row in self.dofs.rows])
        entries = scipy.sparse.coo_array(self.matrix)
        size = (len(dofs.rows),) * 2
        return scipy.sparse.csr_array((entries.data, (own_rows[entries.row], own_rows[entries.col])), shape=size)


def same_rows(matrices: Iterable[NodalMatrix]) -> DofTable:
    """Table of all rows of these matrices, by node and component."""
    return DofTable.of({row for matrix in matrices for row in matrix.dofs.rows})


def triplets(path: Path) -> Matrix | NodalMatrix:
    """A matrix of (row, column, value) or (node, component, node, component, value), one entry a line."""
    lines = [line.replace(",", " ") for line in lines_of(path) if line[0] not in "*%"]
    columns = len(lines[0].split()) if lines else 0
    if columns not in (3, 5):
        raise ValueError(
            f"a line has {columns} columns, and not 3 (row, column, value) or 5 (twice node and component, value)"
        )
    table = np.loadtxt([FORTRAN.sub("e", line) for line in lines], ndmin=2, dtype=float)
    labels = table[:, :-1].astype(np.int64)
    if not np.array_equal(labels, table[:, :-1]):
        raise ValueError("a row or column is no whole number")
    if columns == 3:
        first = 1 if _begins_with_size(lines[0], table) else 0
        rows, values = labels[first:], table[first:, 2]
        n = int(np.max(labels))
        if np.min(labels) < 1 or n > EMPTY_ROWS * len(lines):
            raise ValueError(f"its {len(lines)} entries are in rows and columns from {np.min(labels)} to {n}")
        return complete(scipy.sparse.csr_array((values, (rows[:, 0] - 1, rows[:, 1] - 1)), shape=(n, n)))
    own_rows, indices = np.unique(labels.reshape(-1, 2), axis=0, return_inverse=True)
    dofs = DofTable(tuple(node_component("a line", pair) for pair in own_rows.tolist()))
    i, j = indices.reshape(-1, 2).T
    return NodalMatrix(complete(scipy.sparse.csr_array((table[:, 4], (i, j)), shape=(len(own_rows),) * 2)), dofs)


def _begins_with_size(line: str, table: np.ndarray) -> bool:
    """Whether the first line of (row, column, value) is "rows columns entries", as its own numbers and the others say.

    table: (k, 3) of all lines. Raises ValueError for a first line that is neither a size nor an entry.
    """
    if not re.fullmatch(r"\s*(\d+)\s+\1\s+\d+(\.0*)?\s*", line) or len(table) < 2:
        return False
    n, _, entries = table[0]
    others = table[1:]
    is_entry = not np.any(np.all(others[:, :2] == n, axis=1))
    is_size = n == np.max(others[:, :2]) and entries == len(others)
    if not (is_entry or is_size):
        raise ValueError(
            f"its first line reads {line.strip()!r}, which is no size, as {len(others)} entries follow, in rows and "
            f"columns up to {np.max(others[:, :2]):g}, and no entry, as this one follows again"
        )
    if is_entry and is_size and "." in line:
        raise ValueError(
            f"its first line reads {line.strip()!r}, which may be a size or an entry; write a size in whole numbers, "
            "or that entry in another line"
        )
    return is_size


def substructure_matrices(path: Path) -> dict[str, np.ndarray]:
    """The matrices of an Abaqus substructure by type, "stiffness", "mass", ...; empty for another file."""
    triangles: dict[str, list[str]] = {}
    kind = None
    for line in lines_of(path):
        if line[0] == "*":
            found = SUBSTRUCTURE.match(line.replace(" ", ""))
            kind = found[1].lower() if found else None
        elif kind is not None:
            triangles.setdefault(kind, []).extend(number for number in line.replace(",", " ").split())
    return {kind: _from_triangle(kind, np.array(numbers, float)) for kind, numbers in triangles.items()}


def _from_triangle(kind: str, values: np.ndarray) -> np.ndarray:
    """A symmetric matrix from the rows of its lower triangle, one after the other."""
    n = math.isqrt(2 * len(values))
    if n * (n + 1) // 2 != len(values):
        raise ValueError(f"its {kind} matrix has {len(values)} numbers, which are no triangle")
    matrix = np.zeros((n, n))
    matrix[np.tril_indices(n)] = values
    return matrix + np.tril(matrix, -1).T


def harwell_boeing(path: Path) -> Matrix:
    """A matrix in the Harwell-Boeing or Rutherford-Boeing format."""
    with path.open(encoding="latin-1") as file:
        lines = file.read().splitlines()
    if len(lines) < HEADER:
        raise ValueError("it ends inside its header")
    kind = lines[2][:3].upper()
    if len(kind) < 3 or any(letter not in known for letter, known in zip(kind, TYPES, strict=True)):
        raise ValueError(f"its matrix is of the type {kind!r}; read are assembled real ones, RSA and RUA")
    cards, (rows, columns, entries) = _numbers(lines[1], 4), _numbers(lines[2], 3)
    if rows != columns:
        raise ValueError(f"its matrix has {rows} rows and {columns} columns")
    first = HEADER + (cards[3] > 0)  # a line on right-hand sides, which are left out
    arrays = []
    layouts = lines[3][:16], lines[3][16:32], lines[3][32:52]
    for layout, length, count in zip(layouts, cards[:3], (columns + 1, entries, entries), strict=True):
        arrays.append(_fields(lines[first : first + length], layout, count))
        first += length
    pointers, indices = (array.astype(np.int64) - 1 for array in arrays[:2])
    matrix = scipy.sparse.csc_array((arrays[2], indices, pointers), shape=(rows, columns))
    matrix.check_format(full_check=True)  # indices outside of the shape are read as addresses
    return complete(scipy.sparse.csr_array(matrix)) if kind[1] == "S" else matrix


def lines_of(path: Path) -> list[str]:
    """Lines of a text file, compressed or not, without empty lines and blanks at both ends."""
    with gzip.open(path, "rt", encoding="latin-1") if path.suffix == ".gz" else path.open(encoding="latin-1") as file:
        return [line.strip() for line in file if line.strip()]


def _numbers(line: str, count: int) -> list[int]:
    """Numbers of a line of the header, after its first field; zero if missing."""
    return [int(line[CARD * k : CARD * (k + 1)].strip() or 0) for k in range(1, count + 1)]


def _fields(lines: list[str], layout: str, count: int) -> np.ndarray:
    """Numbers (count,), separated by blanks or of fixed width without blanks."""
    form = FORMAT.search(layout.replace(" ", ""))
    if form is None or (form[1] and form[3].upper() == "F"):
        raise ValueError(f"its numbers have the format {layout.strip()!r}")
    fields = " ".join(lines).split()
    if len(fields) != count:
        width, each = int(form[4]), int(form[2] or 1)
        text = "".join(line[: width * each].ljust(width * each) for line in lines)
        if len(text) < width * count:
            raise ValueError(f"it has fewer than the {count} numbers that its header says")
        fields = [text[width * k : width * (k + 1)] for k in range(count)]
    return np.char.replace(np.char.upper(np.array(fields, dtype=str)), "D", "E").astype(float)


def complete(matrix: Matrix) -> Matrix:
    """A matrix (n, n), with both triangles if only one is given."""
    triangle = scipy.sparse.csr_array(matrix - scipy.sparse.diags_array(matrix.diagonal()))
    triangle.eliminate_zeros()
    if triangle.nnz and not (abs(triangle) * abs(triangle).T).nnz:
        return scipy.sparse.csr_array(matrix + triangle.T)
    return matrix


def read_structure(
    mass: MatrixFile,
    stiffness: MatrixFile,
    damping: MatrixFile | Matrix | ModalDamping | RayleighDamping | None = None,
    points: Mapping[str, Place | np.ndarray] | None = None,
    dofs: str | os.PathLike[str] | DofTable | Sequence[tuple[int, int | str]] | None = None,
    fixed: Iterable[Place] = (),
) -> LinearStructure:
    """A linear structure from matrices in files of finite element programs.

        .mtx, .mtx.gz          Matrix Market, and Abaqus *MATRIX OUTPUT and *SUBSTRUCTURE MATRIX OUTPUT
        .sti, .mas             CalculiX, SOLVER=MATRIXSTORAGE
        .rsa, .rua, .hb, .rb   Harwell-Boeing; Ansys HBMAT writes .matrix
        .mat                   MATLAB
        .op4                   Nastran OUTPUT4
        .npz, .npy             NumPy arrays; one sparse matrix by scipy.sparse.save_npz

    Parameters
    ----------
    mass : path, or (path, str)
        M (n, n) [kg, kg m2]; with the name of one array in a file of several. A sparse one stays sparse. Units are
        those of the files: lengths in mm need mass in t and stiffness in N/mm.
    stiffness : path, or (path, str)
        K (n, n) [N/m, N m].
    damping : path, (path, str), array (n, n), ModalDamping, RayleighDamping or None, default None
        C (n, n) [N s/m, N m s] in a file, or damping as of LinearStructure.
    points : mapping of str to int, (int, str) or array (n,), default None
        As of LinearStructure; degrees of freedom count from 0, and are (node, component) where the files have nodes.
    dofs : path, or sequence of (int, str or int), default None
        (node, component) of every row, or a text file with both in each line ("17 3", "17,uz", CalculiX's "17.3").
        Abaqus files with nodes (FORMAT=MATRIX INPUT) contain it; rows are then sorted by node and component.
    fixed : iterable of int or (int, str), default ()
        Degrees of freedom that supports fix, in the numbering of the files, as of LinearStructure.

    Returns
    -------
    LinearStructure
        The structure with these matrices; for a mass of lower rank a CondensedStructure, as by ``condensed_structure``.

    Raises
    ------
    MultiPhiTypeError
        For an argument that is not a path.
    MultiPhiValueError
        For a file that cannot be read, with its name and the reason, and for arguments that LinearStructure refuses.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> np.save("M.npy", chain.mass)
    >>> np.save("K.npy", chain.stiffness)
    >>> mp.read_structure("M.npy", "K.npy", mp.ModalDamping(0.01), points={"tip": 2})
    <LinearStructure: degrees of freedom 3; matrices dense; damping ModalDamping; points tip>
    """
    files = {"mass": mass, "stiffness": stiffness}
    if isinstance(damping, (str, os.PathLike, tuple)):
        files["damping"] = damping
    found = {name: _matrix(name, file) for name, file in files.items()}
    if found["mass"][1:] == found["stiffness"][1:] and not (isinstance(mass, tuple) or isinstance(stiffness, tuple)):
        array_name = found["mass"][2]
        shown = f"the array {array_name!r}" if array_name else "the matrix"
        raise MultiPhiValueError(f"stiffness: got {shown} of {found['mass'][1]!r}, which is the mass, need another one")
    matrices, table = _in_same_rows({name: matrix for name, (matrix, *_) in found.items()})
    if table is not None and dofs is not None:
        raise MultiPhiValueError("dofs: got a table beside files that name their nodes, need none")
    if isinstance(dofs, (str, os.PathLike)):
        dofs = _read("dofs", Path(dofs), "a readable table of nodes and components", _dof_rows)
    return condensed_structure(
        matrices["mass"],
        matrices["stiffness"],
        matrices.get("damping", damping),
        {} if points is None else points,
        dofs=dofs if table is None else table,
        fixed=fixed,
    )


def read_array(name: str, file: MatrixFile) -> Matrix:
    """One array in a file, sparse or dense, of any shape; name: of the argument, for errors."""
    matrix, *_ = _matrix(name, file)
    return matrix.matrix if isinstance(matrix, NodalMatrix) else matrix


def read_arrays(name: str, path: Path) -> dict[str, np.ndarray]:
    """All arrays by name of an .npz file that ``numpy.savez`` wrote."""
    return _read(name, path, "an .npz file of arrays", npz_arrays)


def _matrix(name: str, given: Any) -> tuple[Matrix | NodalMatrix, str, str]:
    """The matrix of an argument, with the file and the name of the array, "" in a file of one matrix."""
    array_name: str | None = None
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], str):
        given, array_name = given
    if not isinstance(given, (str, os.PathLike)):
        raise MultiPhiTypeError(f"{name}: got {type(given).__name__}, need the path of a file, or (path, array's name)")
    path = Path(given)
    several = ARRAY_READERS.get(path.suffix.lower(), substructure_matrices if _is_substructure(path) else None)
    if several is not None:
        arrays = _read(name, path, "a readable matrix", several)
        chosen = _read(name, path, "a readable matrix", lambda _: selected_name(name, arrays, array_name))
        return arrays[chosen], os.path.realpath(path), chosen
    reader = next((read for ending, read in READERS.items() if path.name.lower().endswith(ending)), None)
    if reader is None:
        instead = OTHER_FILES.get(path.suffix.lower())
        beside = f" ({instead})" if instead else ""
        raise MultiPhiValueError(f"{name}: got {str(path)!r}{beside}, need a file that ends in {', '.join(ENDINGS)}")
    if array_name is not None:
        raise MultiPhiValueError(f"{name}: got an array {array_name!r} of {str(path)!r}, need a file of several arrays")
    return _read(name, path, "a readable matrix", reader), os.path.realpath(path), ""


def _in_same_rows(matrices: Mapping[str, Matrix | NodalMatrix]) -> tuple[dict[str, Matrix], DofTable | None]:
    """The matrices in common rows, and the table of these rows if the files have nodes."""
    nodal = {name: matrix for name, matrix in matrices.items() if isinstance(matrix, NodalMatrix)}
    if not nodal:
        return dict(matrices), None
    if len(nodal) < len(matrices):
        without = ", ".join(name for name in matrices if name not in nodal)
        raise MultiPhiValueError(f"{without}: got a file without nodes beside others with nodes, need all of one kind")
    table = same_rows(nodal.values())
    return {name: matrix.in_rows(table) for name, matrix in nodal.items()}, table


def _read(name: str, path: Path, needed: str, read: Callable[[Path], T]) -> T:
    try:
        return read(path)
    except Exception as error:  # readers raise various errors for a truncated or modified file
        cause = " ".join(str(error).split()) or type(error).__name__
        raise MultiPhiValueError(f"{name}: got {str(path)!r}{_looks_like(path)}, need {needed}: {cause}") from error


def _looks_like(path: Path) -> str:
    """Type of a file by its first bytes, as text for an error, if the name has another extension; else empty."""
    try:
        with path.open("rb") as file:
            head = file.read(SHOWN)
    except OSError:
        return ""
    kind = next((kind for first, kind in FIRST_BYTES.items() if head.startswith(first)), None)
    return "" if kind is None or path.name.lower().endswith(kind.rpartition(" ")[2]) else f" (it looks like {kind})"


def _dof_rows(path: Path) -> list[tuple[int, int | str]]:
    """(node, component) of every line; "17.3" is component 3 of node 17."""
    rows: list[tuple[int, int | str]] = []
    for line in lines_of(path):
        if line[0] not in "#*%":
            node, component = re.split(r"[\s,;.]+", line.strip(",; "))
            rows.append((int(node), int(component) if component.isdigit() else component))
    return rows


def _mtx(path: Path) -> Matrix | NodalMatrix:
    """A matrix of Abaqus or Matrix Market, which have the same extension and differ in their first line."""
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        banner = file.read(len(BANNER))
    return _matrix_market(path) if banner == BANNER else triplets(path)


def _is_substructure(path: Path) -> bool:
    return path.suffix.lower() == ".mtx" and path.is_file() and b"*MATRIX" in path.read_bytes()[:SEARCHED].upper()


def _matrix_market(path: Path) -> Any:
    """A matrix of a file with a banner; under "symmetric" both triangles may be stored, as some programs do."""
    *_, layout, kind, symmetry = scipy.io.mminfo(path)
    if kind not in NUMBERS:
        raise ValueError(f"it holds {'places without values' if kind == 'pattern' else f'{kind} numbers'}")
    indices = rb"\d+\s+\d+\s+" if layout == "coordinate" else b""
    _check_entries(path, re.compile(rb"\s*" + indices + NUMBERS[kind] + rb"(\s*\n)?"))
    if (layout, symmetry) != ("coordinate", "symmetric"):
        return scipy.io.mmread(path)
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        banner, entries = file.readline(), file.read()
    as_stored = re.sub(rb"symmetric", b"general", banner, flags=re.IGNORECASE)
    return complete(scipy.sparse.csr_array(scipy.io.mmread(io.BytesIO(as_stored + entries))))


def _check_entries(path: Path, entry: re.Pattern[bytes]) -> None:
    """Raise ValueError for a line that is not an entry, such as a truncated one: scipy's reader may crash on it."""
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as lines:
        data_lines = (line for line in lines if line.strip() and not line.startswith(b"%"))
        next(data_lines, None)  # the size
        wrong = next((line for line in data_lines if not entry.fullmatch(line)), None)
    if wrong is not None:
        raise ValueError(f"an entry reads {wrong[:SHOWN]!r}")


def _dense(path: Path) -> np.ndarray:
    with path.open("rb") as file:
        return np.lib.format.read_array(file, allow_pickle=False)


READERS: Mapping[str, Callable[[Path], Any]] = {
    ".mtx": _mtx,
    ".mtx.gz": _mtx,
    ".sti": triplets,
    ".mas": triplets,
    ".rsa": harwell_boeing,
    ".rua": harwell_boeing,
    ".hb": harwell_boeing,
    ".rb": harwell_boeing,
    ".matrix": harwell_boeing,
    ".npy": _dense,
}
ENDINGS = (*READERS, *ARRAY_READERS)
