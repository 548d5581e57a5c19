"""Files of several arrays with names: NumPy .npz, MATLAB .mat, Nastran .op4.

.npz    ``numpy.savez``, or one sparse matrix by ``scipy.sparse.save_npz``
.mat    MATLAB to version 7 by scipy; version 7.3 is HDF5, for which h5py is needed: the extra ``matlab``
.op4    Nastran OUTPUT4, text or binary, dense or sparse, by pyYeti: the extra ``nastran``

The array is selected by (file, name). Without a name it is the only array, or among the largest square ones the only
one with a usual initial: M for mass; K for stiffness; C, D or B for damping.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from multiphi_exudyn.mechanics.structures.arguments import Matrix, one_of

__all__ = ["ARRAY_READERS", "npz_arrays", "select_array"]

INITIALS = {"mass": ("m",), "stiffness": ("k", "stif"), "damping": ("c", "d", "b")}
NUMBERS = "biufc"  # numpy's codes of numbers
HDF5 = b"\x89HDF"
HDF5_AT = (0, 512)  # offsets in bytes: MATLAB writes 512 bytes before


def npz_arrays(path: Path) -> dict[str, Matrix]:
    """All arrays of an .npz file by name; one that ``scipy.sparse.save_npz`` wrote is one sparse matrix, "matrix"."""
    with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
        arrays = dict(stored)
    if "format" not in arrays:
        return arrays
    return {"matrix": _with_valid_indices(scipy.sparse.load_npz(path))}


def mat_arrays(path: Path) -> dict[str, Matrix]:
    """All matrices of numbers in a .mat file by name."""
    with path.open("rb") as file:
        head = file.read(HDF5_AT[-1] + len(HDF5))
    if any(head[at:].startswith(HDF5) for at in HDF5_AT):
        return _mat_73_arrays(path)
    return _matrices(scipy.io.loadmat(path, appendmat=False))


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
        arrays = {name: _hdf5_array(item) for name, item in variables.items()}
    return _matrices(arrays)


def _hdf5_array(item: Any) -> Any:
    """A variable of MATLAB 7.3: dense ones are stored by columns, sparse ones as data, ir and jc; None: others."""
    if not hasattr(item, "keys"):
        return np.asarray(item).T
    if "MATLAB_sparse" not in item.attrs:
        return None
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


def select_array(name: str, arrays: Mapping[str, Matrix], array_name: str | None) -> Matrix:
    """The array ``array_name``, or for None the only candidate for ``name`` ("mass", "stiffness" or "damping")."""
    if array_name is not None:
        if array_name not in arrays:
            raise ValueError(f"it has no array {array_name!r}, need {one_of(array_name, arrays)}")
        return arrays[array_name]
    if len(arrays) == 1:
        return next(iter(arrays.values()))
    square = {key: array.shape[0] for key, array in arrays.items() if array.ndim == 2 and len({*array.shape}) == 1}
    candidates = [
        key for key, n in square.items() if n == max(square.values()) and key.lower().startswith(INITIALS.get(name, ()))
    ]
    if len(candidates) != 1:
        raise ValueError(f"it holds the arrays {', '.join(arrays) or 'none'}: say which, (file, name)")
    return arrays[candidates[0]]


def _matrices(arrays: Mapping[str, Any]) -> dict[str, Matrix]:
    """Those arrays that are numeric matrices."""
    dense = {name: array for name, array in arrays.items() if isinstance(array, np.ndarray)}
    sparse = {name: _with_valid_indices(array) for name, array in arrays.items() if scipy.sparse.issparse(array)}
    return {name: array for name, array in dense.items() if array.dtype.kind in NUMBERS} | sparse


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
