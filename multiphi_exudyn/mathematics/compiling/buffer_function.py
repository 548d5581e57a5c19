"""A function on flat buffers: what it may be made of, what it calls, and when it is no longer the same.

It takes buffers and scalars, returns one scalar or nothing, and writes everything else into the buffers:

    @compiled
    def kinetic(numbers: Numbers, velocity: int, r: int) -> float: ...

    Ints: int64 buffer   Numbers: float64 buffer   Waves: complex128 buffer   int: integer or offset   float: number
    Shorts: int32 buffer, of what is kept long

Of its module it uses numbers and functions marked ``compiled``; beside these ``math``, ``cmath`` and what Python has
built in.
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

__all__ = ["Ints", "Numbers", "Shorts", "Signature", "Waves", "callees", "check", "compiled", "digest", "lines"]
__all__ += ["reached", "signature", "symbol"]

Ints = NDArray[np.int64]
Shorts = NDArray[np.int32]
Numbers = NDArray[np.float64]
Waves = NDArray[np.complex128]
Function = TypeVar("Function", bound=Callable[..., Any])

ARGUMENTS = (Ints, Shorts, Numbers, Waves, int, float)
RESULTS = (int, float, NoneType)

_marked: set[FunctionType] = set()


class Signature(NamedTuple):
    """What a function takes and gives: of ``ARGUMENTS`` and of ``RESULTS``."""

    arguments: tuple[Any, ...]
    result: Any


def compiled(function: Function) -> Function:
    """Mark a function on flat buffers as one that can be compiled; it stays the plain function."""
    assert isinstance(function, FunctionType)
    _marked.add(function)
    return function


@functools.cache
def signature(function: FunctionType) -> Signature:
    """The kinds of a function's arguments and result, from its annotations."""
    hints = get_type_hints(function)
    found = Signature(tuple(map(hints.get, inspect.signature(function).parameters)), hints.get("return"))
    if found.result not in RESULTS or not set(found.arguments) <= set(ARGUMENTS):
        raise MultiPhiTypeError(
            f"annotations: got {function.__qualname__}{inspect.signature(function)}, need Ints, Shorts, Numbers, "
            "Waves, int or float for every argument, and int, float or None for the result"
        )
    return found


def _globals(function: FunctionType) -> dict[str, Any]:
    """What a function names and its module has; names of attributes may be among them."""
    return {name: function.__globals__[name] for name in function.__code__.co_names if name in function.__globals__}


def _is_marked(value: Any) -> bool:
    return isinstance(value, FunctionType) and value in _marked


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | complex)


def callees(function: FunctionType) -> dict[str, FunctionType]:
    """The compiled functions that a function calls, by the names it uses."""
    return {name: value for name, value in _globals(function).items() if _is_marked(value)}


def reached(function: FunctionType) -> list[FunctionType]:
    """``function`` and all that it calls, callees first."""
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


def check(function: FunctionType) -> None:
    """Refuse what a change would not be seen of: anything of the module but numbers and compiled functions."""
    taken = {step.argval for step in dis.get_instructions(function) if step.opname == "LOAD_GLOBAL"}
    for name in sorted(taken & function.__globals__.keys()):
        value = function.__globals__[name]
        if not (_is_marked(value) or _is_number(value) or value in (math, cmath)):
            raise MultiPhiTypeError(
                f"{function.__qualname__}: got {name} of type {type(value).__name__}, need numbers and compiled "
                "functions of its module, math and cmath"
            )


def lines(function: FunctionType) -> int:
    """How many lines of a function are code."""
    return len({line for *_, line in function.__code__.co_lines()})


def symbol(function: FunctionType) -> str:
    """The name of a function in compiled code."""
    return re.sub(r"[^\w.]", "_", f"{function.__module__}.{function.__qualname__}")


def digest(function: FunctionType) -> str:
    """A hash of all that the compiled code of a function depends on: its own code, numbers, and how it calls others."""
    code = function.__code__
    constants = [constant for constant in code.co_consts if not isinstance(constant, str)]  # docstrings are no code
    taken = {
        name: (symbol(value), signature(value)) if _is_marked(value) else value
        for name, value in _globals(function).items()
        if _is_marked(value) or _is_number(value)
    }
    parts = (symbol(function), signature(function), code.co_code, constants, code.co_names, code.co_varnames, taken)
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()
