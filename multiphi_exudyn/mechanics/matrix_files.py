"""Matrices from files: what a finite element program writes becomes a linear structure.

.mtx, .mtx.gz   Matrix Market, sparse or dense; of a symmetric matrix one triangle is enough
                (R. F. Boisvert, R. Pozo, K. Remington, The Matrix Market exchange formats, NISTIR 5935, 1996)
.npz            one sparse matrix, as ``scipy.sparse.save_npz`` writes it
.npy            one dense array, as ``numpy.save`` writes it
"""

from __future__ import annotations

import gzip
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import scipy.io
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import Matrix
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.structure import LinearStructure

__all__ = ["read_array", "read_arrays", "read_structure"]

T = TypeVar("T")

NUMBERS = {  # of a Matrix Market file, by its field
    "integer": rb"[+-]?\d+",
    "real": rb"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?",
}
SHOWN = 40  # bytes of a wrong line that an error shows


def read_structure(
    mass: str | os.PathLike[str],
    stiffness: str | os.PathLike[str],
    damping: str | os.PathLike[str] | Matrix | ModalDamping | RayleighDamping | None = None,
    points: Mapping[str, int | np.ndarray] | None = None,
) -> LinearStructure:
    """A linear structure of matrices in files, as finite element programs write them.

        .mtx, .mtx.gz   Matrix Market, sparse or dense; of a symmetric matrix one triangle is enough
        .npz            one sparse matrix, as scipy.sparse.save_npz writes it
        .npy            one dense array, as numpy.save writes it

    Parameters
    ----------
    mass : path
        M (n, n) [kg, kg m2]; a sparse one stays sparse.
    stiffness : path
        K (n, n) [N/m, N m].
    damping : path, array (n, n), ModalDamping, RayleighDamping or None, default None
        C (n, n) [N s/m, N m s] in a file, or what LinearStructure takes.
    points : mapping of str to int or array (n,), default None
        Name to degree of freedom, counted from 0, or to row.

    Returns
    -------
    LinearStructure
        Of these matrices.

    Raises
    ------
    MultiPhiTypeError
        For what is no path.
    MultiPhiValueError
        Naming the file that cannot be read and why; and what LinearStructure raises.

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
    if isinstance(damping, (str, os.PathLike)):
        damping = read_array("damping", damping)
    places = {} if points is None else points
    return LinearStructure(read_array("mass", mass), read_array("stiffness", stiffness), damping, places)


def read_array(name: str, path: str | os.PathLike[str]) -> Matrix:
    """The one array in a file, sparse or dense of any shape; ``name`` is what an error calls it."""
    if not isinstance(path, (str, os.PathLike)):
        raise MultiPhiTypeError(f"{name}: got {type(path).__name__}, need the path of a file")
    file = Path(path)
    reader = next((read for ending, read in READERS.items() if file.name.endswith(ending)), None)
    if reader is None:
        raise MultiPhiValueError(f"{name}: got {str(file)!r}, need a file that ends in {', '.join(READERS)}")
    return _read(name, file, "a readable matrix", reader)


def read_arrays(name: str, path: Path) -> dict[str, np.ndarray]:
    """All arrays by name of an .npz file that ``numpy.savez`` wrote."""
    return _read(name, path, "an .npz file of arrays", _named_arrays)


def _read(name: str, path: Path, needed: str, read: Callable[[Path], T]) -> T:
    try:
        return read(path)
    except Exception as error:  # readers raise whatever a file that is cut short or changed leads them to
        cause = " ".join(str(error).split()) or type(error).__name__
        raise MultiPhiValueError(f"{name}: got {str(path)!r}, need {needed}: {cause}") from error


def _matrix_market(path: Path) -> Any:
    *_, layout, kind, _symmetry = scipy.io.mminfo(path)
    if kind not in NUMBERS:
        raise ValueError(f"it holds {'places without values' if kind == 'pattern' else f'{kind} numbers'}")
    place = rb"\d+\s+\d+\s+" if layout == "coordinate" else b""
    _check_entries(path, re.compile(rb"\s*" + place + NUMBERS[kind] + rb"(\s*\n)?"))
    return scipy.io.mmread(path)


def _check_entries(path: Path, entry: re.Pattern[bytes]) -> None:
    """Raises ValueError for a line that is no entry, such as a last one cut short: scipy's reader may crash on it."""
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as lines:
        given = (line for line in lines if line.strip() and not line.startswith(b"%"))
        next(given, None)  # the size
        wrong = next((line for line in given if not entry.fullmatch(line)), None)
    if wrong is not None:
        raise ValueError(f"an entry reads {wrong[:SHOWN]!r}")


def _sparse(path: Path) -> Any:
    arrays = _named_arrays(path)
    if "format" not in arrays:
        raise ValueError(f"it holds the arrays {', '.join(arrays) or 'none'}, not one sparse matrix")
    matrix = scipy.sparse.load_npz(path)
    if hasattr(matrix, "check_format"):
        matrix.check_format(full_check=True)  # indices outside of the shape are read as addresses
    return matrix


def _named_arrays(path: Path) -> dict[str, np.ndarray]:
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        return dict(stored)


def _dense(path: Path) -> np.ndarray:
    with path.open("rb") as file:
        return np.lib.format.read_array(file, allow_pickle=False)


READERS: Mapping[str, Callable[[Path], Any]] = {
    ".mtx": _matrix_market,
    ".mtx.gz": _matrix_market,
    ".npz": _sparse,
    ".npy": _dense,
}
