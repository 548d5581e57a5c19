"""Matrix files: linear structures from matrices that finite element programs have written.

.mtx, .mtx.gz            Matrix Market, sparse or dense; of a symmetric matrix one triangle is enough
                         (R. F. Boisvert, R. Pozo, K. Remington, The Matrix Market exchange formats, NISTIR 5935, 1996)
.mtx, .mtx.gz            Abaqus *MATRIX GENERATE and *MATRIX OUTPUT, with or without nodes (text_matrices.py)
.mtx                     Abaqus *SUBSTRUCTURE MATRIX OUTPUT
.sti, .mas               CalculiX, its *FREQUENCY, SOLVER=MATRIXSTORAGE
.rsa, .rua, .hb, .rb     Harwell-Boeing and Rutherford-Boeing; Ansys HBMAT writes .matrix
.mat                     MATLAB (array_files.py)
.op4                     Nastran OUTPUT4
.npz                     NumPy arrays with names, or one sparse matrix as ``scipy.sparse.save_npz`` writes it
.npy                     one dense array, as ``numpy.save`` writes it
"""

from __future__ import annotations

import gzip
import io
import os
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import numpy as np
import scipy.io
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.files.array_files import ARRAY_READERS, npz_arrays, selected_name
from multiphi_exudyn.mechanics.files.text_matrices import (
    NodalMatrix,
    complete,
    harwell_boeing,
    lines_of,
    same_rows,
    substructure_matrices,
    triplets,
)
from multiphi_exudyn.mechanics.structures.arguments import Matrix
from multiphi_exudyn.mechanics.structures.condensed_structure import condensed_structure
from multiphi_exudyn.mechanics.structures.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.structures.dofs import DofTable, Place
from multiphi_exudyn.mechanics.structures.structure import LinearStructure

__all__ = ["MatrixFile", "read_array", "read_arrays", "read_structure"]

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
