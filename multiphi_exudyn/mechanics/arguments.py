"""Arguments: what counts as a real number, arrays of real numbers from what a user gives, and names there are."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiTypeError

__all__ = ["FLOAT", "Matrix", "did_you_mean", "is_real", "no_text", "one_of", "real_array"]

Matrix: TypeAlias = Any  # (n, n) numpy array or scipy.sparse array

FLOAT = np.dtype(float)
REAL_KINDS = "biufO"  # numpy's codes of what may be converted: numbers, and objects that know how
SHOWN = 12  # names that an error lists


def is_real(value: Any) -> bool:
    """True for a Python or numpy number that a float can hold and that is neither complex nor a truth value."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, (float, np.integer, np.floating))


def real_array(name: str, given: Any, needed: str) -> Matrix:
    """A copy of ``given`` as real numbers, sparse if it is; text and complex numbers are not converted."""
    if type(given) is np.ndarray and given.dtype == FLOAT:
        return given.copy("K")
    if scipy.sparse.issparse(given) and given.dtype.kind in REAL_KINDS:
        return scipy.sparse.csr_array(given, dtype=float)
    try:
        array = np.array(given)
        if array.dtype.kind in REAL_KINDS:
            return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise MultiPhiTypeError(f"{name}: got {type(given).__name__}, need {needed}") from error
    raise MultiPhiTypeError(f"{name}: got {type(given).__name__} of {array.dtype}, need {needed}")


def no_text(name: str, given: object) -> None:
    """Refuses a name where several are needed: it would be taken letter by letter."""
    if isinstance(given, str):
        raise MultiPhiTypeError(f"{name}: got {given!r}, need a sequence, as [{given!r}]")


def one_of(given: object, known: Iterable[object], what: str = "") -> str:
    """What an error needs in place of an unknown name: "one of: a, b", and the name that may have been meant.

    what: of what they are, for "one of the points: a, b".
    """
    names = [str(name) for name in known]
    listed = ", ".join(names[:SHOWN]) or "none"
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"one of{f' the {what}' if what else ''}: {listed}{more}{did_you_mean(given, names)}"


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """The known name nearest to what was given, as the end of a sentence; "" where none is near."""
    near = difflib.get_close_matches(str(given), list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
