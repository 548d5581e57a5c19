"""Arguments of users: real numbers, arrays of real numbers, and the names that an error lists."""

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
REAL_KINDS = "biufO"  # numpy's codes of types that may be converted: numbers, and objects with a conversion
SHOWN = 12  # names that an error lists


def is_real(value: Any) -> bool:
    """True for a Python or numpy number that a float can represent, and that is neither complex nor a boolean."""
    if isinstance(value, int):
        return not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return isinstance(value, (float, np.integer, np.floating))


def real_array(name: str, given: Any, needed: str) -> Matrix:
    """A copy of ``given`` as real numbers, sparse if ``given`` is; raise for text and complex numbers."""
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
    """Raise for a string where a sequence of names is needed, as it would be read letter by letter."""
    if isinstance(given, str):
        raise MultiPhiTypeError(f"{name}: got {given!r}, need a sequence, as [{given!r}]")


def one_of(given: object, known: Iterable[object], what: str = "") -> str:
    """Text for an error about an unknown name: "one of: a, b", and the most similar name.

    what: kind of the names, for "one of the points: a, b".
    """
    names = [str(name) for name in known]
    listed = ", ".join(names[:SHOWN]) or "none"
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return f"one of{f' the {what}' if what else ''}: {listed}{more}{did_you_mean(given, names)}"


def did_you_mean(given: object, known: Iterable[str]) -> str:
    """The most similar known name, as the end of a sentence; "" if none is similar."""
    similar = difflib.get_close_matches(str(given), list(known), n=1)
    return f"; did you mean {similar[0]!r}?" if similar else ""
