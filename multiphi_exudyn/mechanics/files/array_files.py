"""Files of several arrays with names: NumPy .npz, MATLAB .mat, Nastran .op4.

.npz    ``numpy.savez``, or one sparse matrix by ``scipy.sparse.save_npz``
.mat    MATLAB to version 7 by scipy; version 7.3 is HDF5, for which h5py is needed: the extra ``matlab``
.op4    Nastran OUTPUT4, text or binary, dense or sparse, by pyYeti: the extra ``nastran``

A field of a MATLAB struct has the name "model.M". The array is selected by (file, name). Without a name it is the only
array, if not by its name another quantity, or among the largest square ones the only one with a usual initial,
variables before fields: M for mass; K for stiffness; C, D or B for damping.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
import scipy.sparse

from multiphi_exudyn.mechanics.structures.arguments import Matrix, one_of

__all__ = ["ARRAY_READERS", "npz_arrays", "selected_name"]

INITIALS = {"mass": ("m",), "stiffness": ("k", "stif"), "damping": ("c", "d", "b")}
SUFFIX = r"([a-z]{2})?(\d.*|_.*|red.*)?"  # after an initial: Maa, K1, C_red
OWN_NAMES = {  # of one quantity alone, by which it is no other
    "mass": re.compile(rf"mass.*|m(?!at){SUFFIX}"),
    "stiffness": re.compile(r"k.*|stif.*"),
    "damping": re.compile(rf"damp.*|[cdb](?!at){SUFFIX}"),
}
FEM_INTERFACE = {"massMatrix", "stiffnessMatrix", "nodes"}  # arrays of a file that Exudyn's FEMinterface has saved
NUMBERS = "biufc"  # numpy's codes of numbers
HDF5 = b"\x89HDF"
HDF5_AT = (0, 512)  # offsets in bytes: MATLAB writes 512 bytes before


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
        head = file.read(HDF5_AT[-1] + len(HDF5))
    if any(head[at:].startswith(HDF5) for at in HDF5_AT):
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
