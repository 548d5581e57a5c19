"""Arguments: what counts as a real number, and arrays of real numbers from what a user gives."""

from __future__ import annotations

import sys
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError

__all__ = ["Matrix", "is_real", "real_array"]

Matrix: TypeAlias = Any  # (n, n) numpy array or scipy.sparse array

REAL_KINDS = "biufO"  # numpy's codes of what may be converted: numbers, and objects that know how


def is_real(value: Any) -> bool:
    """True for a Python or numpy number that a float can hold and that is neither complex nor a truth value."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, (float, np.integer, np.floating))


def real_array(name: str, given: Any, needed: str) -> Matrix:
    """A copy of ``given`` as real numbers, sparse if it is; text and complex numbers are not converted."""
    if scipy.sparse.issparse(given) and given.dtype.kind in REAL_KINDS:
        return scipy.sparse.csr_array(given, dtype=float)
    try:
        array = np.array(given)
        if array.dtype.kind in REAL_KINDS:
            return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise MultiPhiTypeError(f"{name}: got {type(given).__name__}, need {needed}") from error
    raise MultiPhiTypeError(f"{name}: got {type(given).__name__} of {array.dtype}, need {needed}")
