"""Functions on flat buffers, run as plain Python or compiled by numba.

A function marked ``compiled`` takes buffers and scalars only, returns one scalar or nothing and writes everything else
into the buffers. The name stays the plain function: called from Python it runs as Python, with NumPy arrays as buffers.
``entry(function)`` is the same function compiled, with all that it calls, on its first call.

Each function is compiled by itself and called through its address: numba's effort is then linear in the number of
lines, while functions that see one another are optimised again in every caller.
"""

from __future__ import annotations

import cmath
import ctypes
import importlib.util
import math
from collections.abc import Callable, Iterator
from types import CodeType, FunctionType
from typing import Any, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from multiphi_exudyn.errors import MultiPhiTypeError

__all__ = ["Ints", "Numbers", "Waves", "available", "compiled", "entry"]

Ints = NDArray[np.int64]
Numbers = NDArray[np.float64]
Waves = NDArray[np.complex128]
Function = TypeVar("Function", bound=Callable[..., Any])

BUFFERS: dict[Any, Any] = {Ints: np.dtype(np.int64), Numbers: np.dtype(np.float64), Waves: np.dtype(np.complex128)}
SCALARS: dict[Any, Any] = {int: ctypes.c_int64, float: ctypes.c_double, type(None): None}
MODULES = (math, cmath)  # what a compiled function may use beside numbers and compiled functions
BUILTINS = frozenset({"abs", "bool", "complex", "float", "int", "max", "min", "range", "round"})

_registered: set[FunctionType] = set()


def available() -> bool:
    """Whether functions can be compiled: numba is installed."""
    return importlib.util.find_spec("numba") is not None


def compiled(function: Function) -> Function:
    """Mark a function on flat buffers as one to compile; it stays the plain function."""
    assert isinstance(function, FunctionType)
    _registered.add(function)
    return function


def entry(function: Callable[..., Any]) -> Callable[..., Any]:
    """``function`` compiled, on its first call, for contiguous NumPy arrays and scalars; itself without numba."""
    assert isinstance(function, FunctionType)
    return _Entry(function) if available() else function


class _Entry:
    """A function of Python that calls compiled code."""

    def __init__(self, function: FunctionType) -> None:
        self.function = function
        self._types, _ = signature(function)
        self._native: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """The result of the compiled function."""
        if self._native is None:
            self._native = _native(self.function)
        return self._native(*map(_passed, self._types, arguments))


def _passed(kind: Any, argument: Any) -> Any:
    """An argument as ctypes takes it: a buffer by reference, a scalar as it is."""
    if kind in SCALARS:
        return argument
    if argument.dtype != BUFFERS[kind]:
        raise MultiPhiTypeError(f"buffer: got {argument.dtype}, need {BUFFERS[kind]}")
    return ctypes.byref(ctypes.c_int64.from_buffer(argument))


def signature(function: FunctionType) -> tuple[tuple[Any, ...], Any]:
    """(kinds of the arguments, kind of the result): a buffer's type, int, float, or None's type."""
    hints = get_type_hints(function)
    code = function.__code__
    kinds = tuple(hints.get(name) for name in code.co_varnames[: code.co_argcount])
    result = hints.get("return")
    if result not in SCALARS or any(kind not in BUFFERS and kind not in SCALARS for kind in kinds):
        raise MultiPhiTypeError(
            f"{function.__qualname__}: got the annotations {hints}, need Ints, Numbers, Waves, int and float, and one "
            "scalar or None as result"
        )
    return kinds, result


def callees(function: FunctionType) -> dict[str, FunctionType]:
    """The compiled functions that a function calls, under the names it uses."""
    return {name: value for name, value in used(function).items() if isinstance(value, FunctionType)}


def used(function: FunctionType) -> dict[str, Any]:
    """What a function takes from its module, by name: numbers, compiled functions, math and cmath."""
    found = {}
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, bool | int | float | complex) or value in MODULES or _is_compiled(value):
            found[name] = value
        elif value is not None:
            raise MultiPhiTypeError(
                f"{function.__qualname__}: got {name} of type {type(value).__name__}, need numbers, compiled functions "
                "and the modules math and cmath"
            )
    if any(isinstance(constant, CodeType) for constant in function.__code__.co_consts):
        raise MultiPhiTypeError(f"{function.__qualname__}: got a function inside, need loops")
    return found


def _is_compiled(value: Any) -> bool:
    return isinstance(value, FunctionType) and value in _registered


def reached(function: FunctionType) -> list[FunctionType]:
    """``function`` and all that it calls, callees first."""

    def visit(current: FunctionType, above: tuple[FunctionType, ...]) -> Iterator[FunctionType]:
        if current in above:
            raise MultiPhiTypeError(f"{current.__qualname__}: got a recursion, need loops")
        for callee in callees(current).values():
            if callee not in order:
                yield from visit(callee, (*above, current))
        yield current

    order: dict[FunctionType, None] = {}
    for each in visit(function, ()):
        order[each] = None
    return list(order)


_kept: dict[FunctionType, Any] = {}  # the compiled functions of this process


def _native(function: FunctionType) -> Callable[..., Any]:
    """The compiled function as ctypes calls it."""
    for each in reached(function):
        if each not in _kept:
            _kept[each] = _compile(each)
    kinds, result = signature(function)
    arguments = (ctypes.c_void_p if kind in BUFFERS else SCALARS[kind] for kind in kinds)
    return ctypes.CFUNCTYPE(SCALARS[result], *arguments)(_kept[function].address)


def _compile(function: FunctionType) -> Any:
    """A function compiled by itself; what it calls is called by its symbol."""
    import numba

    called = {
        name: numba.types.ExternalFunction(_kept[callee].native_name, _numba_signature(callee))
        for name, callee in callees(function).items()
    }
    alone = FunctionType(function.__code__, {**function.__globals__, **called}, function.__name__)
    return numba.cfunc(_numba_signature(function), error_model="numpy")(alone)


def _numba_signature(function: FunctionType) -> Any:
    """The signature in numba's types."""
    from numba import types

    kinds = {
        Ints: types.CPointer(types.int64),
        Numbers: types.CPointer(types.float64),
        Waves: types.CPointer(types.complex128),
        int: types.int64,
        float: types.float64,
        type(None): types.void,
    }
    arguments, result = signature(function)
    return kinds[result](*(kinds[kind] for kind in arguments))
