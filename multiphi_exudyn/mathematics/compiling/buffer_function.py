"""Functions on flat buffers: allowed types and names, the functions that they call, and a digest that shows changes.

Such a function takes buffers and scalars, returns one scalar or None, and writes all other results into the buffers:

    @compiled
    def kinetic(numbers: Numbers, velocity: int, r: int) -> float: ...

    Ints: int64 buffer   Numbers: float64 buffer   Waves: complex128 buffer   int: integer or offset   float: number
    Shorts: int32 buffer, for long records

It uses numbers of its module, functions marked ``compiled``, ``math``, ``cmath`` and Python's builtins.
"""

from __future__ import annotations

import cmath
import dis
import functools
import hashlib
import inspect
import math
import re
from collections.abc import Callable
from types import FunctionType, NoneType
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from multiphi_exudyn.errors import MultiPhiTypeError

__all__ = [
    "Ints",
    "Numbers",
    "Shorts",
    "Signature",
    "Waves",
    "callees",
    "check_globals",
    "compiled",
    "digest",
    "line_count",
]
__all__ += ["call_tree", "signature", "symbol"]

Ints = NDArray[np.int64]
Shorts = NDArray[np.int32]
Numbers = NDArray[np.float64]
Waves = NDArray[np.complex128]
Function = TypeVar("Function", bound=Callable[..., Any])

ARGUMENTS = (Ints, Shorts, Numbers, Waves, int, float)
RESULTS = (int, float, NoneType)

_marked: set[FunctionType] = set()


class Signature(NamedTuple):
    """Types of the arguments and of the result of a function, from ``ARGUMENTS`` and ``RESULTS``."""

    arguments: tuple[Any, ...]
    result: Any


def compiled(function: Function) -> Function:
    """Mark a function on flat buffers as one that can be compiled; it stays the plain function."""
    assert isinstance(function, FunctionType)
    _marked.add(function)
    return function


@functools.cache
def signature(function: FunctionType) -> Signature:
    """Return the types of a function's arguments and result, from its annotations."""
    hints = get_type_hints(function)
    types = Signature(tuple(map(hints.get, inspect.signature(function).parameters)), hints.get("return"))
    if types.result not in RESULTS or not set(types.arguments) <= set(ARGUMENTS):
        raise MultiPhiTypeError(
            f"annotations: got {function.__qualname__}{inspect.signature(function)}, need Ints, Shorts, Numbers, "
            "Waves, int or float for every argument, and int, float or None for the result"
        )
    return types


def _globals(function: FunctionType) -> dict[str, Any]:
    """Return the globals of a module that a function names; attributes of the same name may be among them."""
    return {name: function.__globals__[name] for name in function.__code__.co_names if name in function.__globals__}


def _is_marked(value: Any) -> bool:
    return isinstance(value, FunctionType) and value in _marked


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | complex)


def callees(function: FunctionType) -> dict[str, FunctionType]:
    """Return the compiled functions that a function calls, by the names it uses."""
    return {name: value for name, value in _globals(function).items() if _is_marked(value)}


def call_tree(function: FunctionType) -> list[FunctionType]:
    """Return ``function`` and all functions that it calls, callees first."""
    order: dict[FunctionType, None] = {}

    def visit(current: FunctionType, above: tuple[FunctionType, ...]) -> None:
        if current in above:
            raise MultiPhiTypeError(f"{current.__qualname__}: got a recursion, need loops")
        for callee in callees(current).values():
            if callee not in order:
                visit(callee, (*above, current))
        order[current] = None

    visit(function, ())
    return list(order)


def check_globals(function: FunctionType) -> None:
    """Raise an error for other globals than numbers and compiled functions: the digest would not show their changes."""
    used = {step.argval for step in dis.get_instructions(function) if step.opname == "LOAD_GLOBAL"}
    for name in sorted(used & function.__globals__.keys()):
        value = function.__globals__[name]
        if not (_is_marked(value) or _is_number(value) or value in (math, cmath)):
            raise MultiPhiTypeError(
                f"{function.__qualname__}: got {name} of type {type(value).__name__}, need numbers and compiled "
                "functions of its module, math and cmath"
            )


def line_count(function: FunctionType) -> int:
    """Return the number of code lines of a function."""
    return len({line for *_, line in function.__code__.co_lines()})


def symbol(function: FunctionType) -> str:
    """Return the name of a function in compiled code."""
    return re.sub(r"[^\w.]", "_", f"{function.__module__}.{function.__qualname__}")


def digest(function: FunctionType) -> str:
    """Return a hash of all that the compiled code depends on: own code, numbers, and how it calls others."""
    code = function.__code__
    constants = [constant for constant in code.co_consts if not isinstance(constant, str)]  # docstrings are no code
    used = {
        name: (symbol(value), signature(value)) if _is_marked(value) else value
        for name, value in _globals(function).items()
        if _is_marked(value) or _is_number(value)
    }
    parts = (symbol(function), signature(function), code.co_code, constants, code.co_names, code.co_varnames, used)
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()
