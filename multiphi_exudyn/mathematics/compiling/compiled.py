"""Functions on flat buffers, run as plain Python or compiled.

A function marked ``compiled`` stays a plain function: called from Python it runs as Python, with NumPy arrays as
buffers. ``entry(function)`` is the same function, compiled with all its callees at its first call; the machine code is
stored on disk, and loaded from there without numba. Where numba is missing, an entry is the plain function.
"""

from __future__ import annotations

import ctypes
import functools
import importlib.util
import sys
import threading
import warnings
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from types import FunctionType, NoneType
from typing import Any

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiWarning
from multiphi_exudyn.mathematics.compiling.buffer_function import (
    Ints,
    Numbers,
    Shorts,
    Waves,
    call_tree,
    compiled,
    digest,
    signature,
    symbol,
)
from multiphi_exudyn.mathematics.compiling.compiled_cache import (
    cache_file,
    cached_objects,
    store_objects,
    writable_folder,
)

__all__ = ["Entry", "Ints", "Numbers", "Shorts", "Waves", "available", "compile_entries", "compiled", "entry"]

TYPES: dict[Any, np.dtype] = {
    Ints: np.dtype(np.int64),
    Shorts: np.dtype(np.int32),
    Numbers: np.dtype(float),
    Waves: np.dtype(complex),
}
SCALARS: dict[Any, Any] = {int: ctypes.c_int64, float: ctypes.c_double, NoneType: None}
start_of = (ctypes.c_char * 0).from_buffer  # where a contiguous, writable buffer begins; others are refused

_one_at_a_time = threading.RLock()  # numba and LLVM are not thread-safe
_entries: list[Entry] = []


def available() -> bool:
    """Return whether functions are compiled: numba is installed."""
    return importlib.util.find_spec("numba") is not None


def entry(function: Callable[..., Any]) -> Entry:
    """Return the compiled ``function``, to be called with contiguous NumPy arrays and scalars."""
    assert isinstance(function, FunctionType)
    _entries.append(Entry(function))
    return _entries[-1]


def compile_entries() -> Path | None:
    """Compile all entries of the loaded modules; return their file, None if it could not be written."""
    for each in _entries:
        each.native()
    return cache_file()


class Entry:
    """A compiled function for Python. ``plain``: the Python function, without warnings of overflow."""

    def __init__(self, function: FunctionType) -> None:
        self.function = function
        self.plain: Callable[..., Any] = np.errstate(all="ignore")(function)
        self._native: Callable[..., Any] | None = None
        self._code: Any = None  # owner of the machine code

    def __call__(self, *arguments: Any) -> Any:
        """Call the function."""
        try:
            return (self._native or self.native())(*arguments)
        except ctypes.ArgumentError as error:
            raise MultiPhiTypeError(f"{self.function.__qualname__}: {error}") from error

    def bound(self, *buffers: np.ndarray) -> Callable[..., Any]:
        """Return the function with fixed first arguments, at half the cost of a call; the caller owns the buffers."""
        native: Any = self.native()
        if native is self.plain:
            return functools.partial(native, *buffers)
        arguments, result = signature(self.function)
        kinds = [ctypes.c_void_p if kind in TYPES else SCALARS[kind] for kind in arguments]
        address = ctypes.cast(native, ctypes.c_void_p).value or 0
        addresses = [kind.from_param(buffer) for kind, buffer in zip(native.argtypes, buffers, strict=False)]
        function: Any = ctypes.CFUNCTYPE(SCALARS[result], *kinds)(address)
        function.entry = self  # owner of the machine code
        return functools.partial(function, *addresses)

    def native(self) -> Callable[..., Any]:
        """Return the ctypes function, built at the first call; ``plain`` without numba."""
        with _one_at_a_time:
            if self._native is None:
                self._native = self._loaded() if available() else self.plain
        return self._native

    def _loaded(self) -> Callable[..., Any]:
        try:
            from multiphi_exudyn.mathematics.compiling.machine_code import load

            address, self._code = load(_objects(call_tree(self.function)), symbol(self.function))
        except ImportError as error:
            warnings.warn(
                f"numba is installed but cannot be imported ({error}): the loop runs as plain Python, 50 times slower",
                MultiPhiWarning,
                stacklevel=4,
            )
            return self.plain
        arguments, result = signature(self.function)
        native: Any = ctypes.CFUNCTYPE(SCALARS[result])(address)
        native.argtypes = [_Buffer(TYPES[kind]) if kind in TYPES else SCALARS[kind] for kind in arguments]
        return native


def _objects(functions: Sequence[FunctionType]) -> list[bytes]:
    """Return the object files of functions, from the disk or compiled."""
    digests = _digests(functions)
    objects = cached_objects(digests)
    if len(objects) < len(digests):
        complete = _completed(functions)
        objects = {name: complete[name] for name in digests}
    return list(objects.values())


def _completed(functions: Sequence[FunctionType]) -> dict[str, bytes]:
    """Return the object files of all functions and entries; missing ones are compiled and stored.

    A run needs most of them, and processes share many functions better than a few.
    """
    needed = dict.fromkeys([*functions, *(each for one in _entries for each in call_tree(one.function))])
    digests = _digests(needed)
    cached = cached_objects(digests)
    missing = [function for function in needed if symbol(function) not in cached]
    compiled_now = dict(zip(map(symbol, missing), _compile(missing), strict=True))
    store_objects({name: (digests[name], code) for name, code in compiled_now.items()})
    return cached | compiled_now


def _digests(functions: Collection[FunctionType]) -> dict[str, str]:
    """Return the digests of functions by their symbols."""
    digests = {symbol(function): digest(function) for function in functions}
    assert len(digests) == len(functions), "two functions of one name"
    return digests


def _compile(functions: Sequence[FunctionType]) -> list[bytes]:
    """Return the object files of functions, compiled after a line on stderr."""
    from multiphi_exudyn.mathematics.compiling.compilation import compile_functions, expected_seconds

    often = "once on this machine" if writable_folder() else "in every process: no folder to keep it in is writable"
    print(f"compiling the loop: about {expected_seconds(functions):.0f} s, {often}", file=sys.stderr)
    return compile_functions(functions)


class _Buffer:
    """Argument type of a buffer for ctypes: the address of its first number."""

    def __init__(self, dtype: np.dtype) -> None:
        self._dtype = dtype

    def from_param(self, array: Any) -> ctypes.Array[ctypes.c_char]:
        """Return where an array begins."""
        try:
            dtype = array.dtype
            if (dtype is self._dtype or dtype == self._dtype) and array.flags.aligned:
                return start_of(array)
        except (AttributeError, TypeError):  # no array, or no such buffer
            pass
        got = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
        raise MultiPhiTypeError(f"got {got}, need a contiguous, writable array of {self._dtype}")
