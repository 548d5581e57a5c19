"""Functions on flat buffers compiled by numba, each by itself.

numba links and optimises a function again in every one that calls it: 60 functions of 20 lines that call one another
take minutes. Each by itself, calling the others by their symbols, they take 10 ms a line at most, nearly all of it
numba's reading of Python.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from types import FunctionType, NoneType
from typing import Any

import llvmlite.binding as llvm
import numba
from numba.core.registry import cpu_target
from tqdm import tqdm

from multiphi_exudyn.mathematics.flat_function import Ints, Numbers, Waves, callees, check, signature, symbol
from multiphi_exudyn.mathematics.machine_code import object_code

__all__ = ["compile_functions"]

KINDS = {
    Ints: numba.types.CPointer(numba.types.int64),
    Numbers: numba.types.CPointer(numba.types.float64),
    Waves: numba.types.CPointer(numba.types.complex128),
    int: numba.types.int64,
    float: numba.types.float64,
    NoneType: numba.types.void,
}
NEVER_CALLED = 1  # numba wants an address for a function that it will not run


def compile_functions(functions: Sequence[FunctionType]) -> list[bytes]:
    """The object files of functions, in their order, with a bar on a terminal."""
    with tqdm(functions, disable=None, leave=False, unit="function", file=sys.stderr) as bar:
        return [_compile(function) for function in bar]


def _compile(function: FunctionType) -> bytes:
    check(function)
    called = {name: _external(callee) for name, callee in callees(function).items()}
    alone = FunctionType(function.__code__, {**function.__globals__, **called}, function.__name__)
    native = numba.cfunc(_types(function), error_model="numpy")(alone)
    _, cpu, features = cpu_target.target_context.codegen().magic_tuple()
    return object_code(native.inspect_llvm(), native.native_name, symbol(function), cpu, features)


def _external(callee: FunctionType) -> Any:
    """A function to be found by its symbol."""
    llvm.add_symbol(symbol(callee), NEVER_CALLED)
    return numba.types.ExternalFunction(symbol(callee), _types(callee))


def _types(function: FunctionType) -> Any:
    """A signature in numba's types."""
    arguments, result = signature(function)
    return KINDS[result](*(KINDS[kind] for kind in arguments))
