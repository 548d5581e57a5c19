"""Functions on flat buffers compiled by numba, each by itself.

numba links and optimises a function again in every one that calls it: 60 functions of 20 lines that call one another
take minutes. Each by itself, calling the others by their symbols, they take 0.05 s each, most of it numba's reading of
Python; and as none needs another one to be compiled before, processes can share them out. Of numba's passes those are
run that such a function needs, and LLVM optimises it once: half the time of a cfunc.
"""

from __future__ import annotations

import functools
import gc
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from types import FunctionType, NoneType
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, Flags, compile_extra
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import PassManager
from numba.core.errors import NumbaError
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering, NoPythonBackend, NopythonTypeInference, PreLowerStripPhis
from numba.core.typing import Context
from numba.core.untyped_passes import FixupArgs, IRProcessing, ReconstructSSA, TranslateByteCode
from tqdm import tqdm

from multiphi_exudyn.mathematics.buffer_function import (
    Ints,
    Numbers,
    Waves,
    callees,
    check,
    digest,
    lines,
    signature,
    symbol,
)
from multiphi_exudyn.mathematics.machine_code import RAISED, object_code, refusal

__all__ = ["answer", "compile_elsewhere", "compile_functions", "expected_seconds", "shares"]

KINDS = {
    Ints: numba.types.CPointer(numba.types.int64),
    Numbers: numba.types.CPointer(numba.types.float64),
    Waves: numba.types.CPointer(numba.types.complex128),
    int: numba.types.int64,
    float: numba.types.float64,
    NoneType: numba.types.void,
}
PASSES = (
    TranslateByteCode,
    FixupArgs,
    IRProcessing,
    ReconstructSSA,
    NopythonTypeInference,
    PreLowerStripPhis,
    NativeLowering,
    NoPythonBackend,
)  # of numba's thirty
START, EACH_FUNCTION, EACH_LINE = 2.0, 0.02, 0.004  # s, on one core of 2020 that has nothing else to do
WORTH_A_PROCESS = 4.0  # s of work; a process takes 1 to 2 s to start
MOST_PROCESSES = 4  # of some 250 MB each
ANSWER = "from multiphi_exudyn.mathematics.compilation import answer; answer()"


def compile_functions(functions: Sequence[FunctionType]) -> list[bytes]:
    """The object files of functions, in their order, shared out to processes, with a bar on a terminal."""
    own, *others = shares(functions)
    with ThreadPoolExecutor() as pool, tqdm(total=len(functions), disable=None, leave=False, unit="function") as bar:
        answers = [pool.submit(compile_elsewhere, share) for share in others]
        codes = _compile_all(own, bar.update)
        for each in answers:
            codes |= each.result()
            bar.update(len(each.result()))
    return [codes.get(function) or _compile(function) for function in functions]


def expected_seconds(functions: Sequence[FunctionType]) -> float:
    """About how long it will take to compile functions."""
    return START + max(sum(map(_seconds, share)) for share in shares(functions))


def _seconds(function: FunctionType) -> float:
    return EACH_FUNCTION + EACH_LINE * lines(function)


def _most_processes() -> int:
    """As many as this process has cores for; one in a frozen program, which is no interpreter that could be started."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return 1 if getattr(sys, "frozen", False) else min(MOST_PROCESSES, cores)


def shares(functions: Sequence[FunctionType]) -> list[list[FunctionType]]:
    """Functions in shares of about as much work, as many shares as are worth a process."""
    count = max(1, min(_most_processes(), int(sum(map(_seconds, functions)) / WORTH_A_PROCESS)))
    found: list[list[FunctionType]] = [[] for _ in range(count)]
    for function in sorted(functions, key=_seconds, reverse=True):
        min(found, key=lambda share: sum(map(_seconds, share))).append(function)
    return found


def compile_elsewhere(functions: Sequence[FunctionType]) -> dict[FunctionType, bytes]:
    """The object files of functions, made by another process; of those that it could import and that are the same."""
    try:
        answered = subprocess.run(
            [sys.executable, "-c", ANSWER],
            input=pickle.dumps(functions),
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
            check=True,
        )
    except (pickle.PicklingError, OSError, subprocess.SubprocessError):
        return {}
    codes = pickle.loads(answered.stdout)
    return {function: codes[digest(function)] for function in functions if digest(function) in codes}


def answer() -> None:
    """What another process does: read functions, give {digest: object file}."""
    codes = _compile_all(pickle.load(sys.stdin.buffer), lambda: None)
    pickle.dump({digest(function): code for function, code in codes.items()}, sys.stdout.buffer)


def _compile_all(functions: Sequence[FunctionType], tell: Callable[[], Any]) -> dict[FunctionType, bytes]:
    """The object files of functions; Python looks for no garbage meanwhile, a tenth of the time."""
    codes, collects = {}, gc.isenabled()
    gc.disable()
    try:
        for function in functions:
            codes[function] = _compile(function)
            tell()
    finally:
        if collects:
            gc.enable()
    return codes


def _compile(function: FunctionType) -> bytes:
    check(function)
    target = cpu_target.target_context
    library = _Library(target.codegen(), symbol(function))
    with global_compiler_lock:
        _add_c_function(library, _read(function, library), symbol(function))
        _, cpu, features = target.codegen().magic_tuple()
        return object_code(library.linked(), symbol(function), cpu, features)


class _Library(JITCodeLibrary):
    """What numba writes for LLVM, and would else optimise twice and load."""

    def add_ir_module(self, ir_module: ir.Module) -> None:
        """Take what has been written."""
        self._final_module.link_in(llvm.parse_assembly(str(ir_module)))

    def linked(self) -> llvm.ModuleRef:
        """All of it, with the functions of numba's own that it calls."""
        for library in self._linking_libraries:
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        return self._final_module


class _Types(Context):
    """numba's types of operations, each found once: it tries all that it knows whenever it is asked."""

    def __init__(self) -> None:
        super().__init__()
        self._found: dict[tuple[Any, Any], Any] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of a function for arguments of these types."""
        if kws or (func, args) not in self._found:
            self._found[func, args] = super().resolve_function_type(func, args, kws)
        return self._found[func, args]


class _Reading(CompilerBase):
    """What numba has to do where there are scalars and buffers alone; it looks for much else otherwise."""

    def define_pipelines(self) -> list[PassManager]:
        """From Python's code to types and to what LLVM reads."""
        manager = PassManager("buffers")
        for step in PASSES:
            manager.add_pass(step, step.__name__)
        manager.finalize()
        return [manager]


@functools.cache
def _known_types() -> _Types:
    return _Types()


def _read(function: FunctionType, library: _Library) -> Any:
    """Put a function in a library as numba calls it; numba's description of it."""
    called = {name: _external(callee) for name, callee in callees(function).items()}
    alone = FunctionType(function.__code__, {**function.__globals__, **called}, function.__name__)
    kinds = _types(function)
    flags: Any = Flags()
    flags.error_model = "numpy"
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    contexts = _known_types(), cpu_target.target_context
    try:
        result = compile_extra(*contexts, alone, kinds.args, kinds.return_type, flags, {}, library, _Reading)
    except NumbaError as error:
        raise refusal(symbol(function)) from error
    return result.fndesc


def _add_c_function(library: _Library, inner: Any, name: str) -> None:
    """Put it there as C calls it; numba's own returns whether there was an error."""
    target = cpu_target.target_context
    module = target.create_module(name)
    kinds = [target.get_value_type(kind) for kind in inner.argtypes]
    outer = ir.Function(module, ir.FunctionType(target.get_value_type(inner.restype), kinds), name)
    builder = ir.IRBuilder(outer.append_basic_block())
    callee = target.declare_function(module, inner)
    status, value = target.call_conv.call_function(builder, callee, inner.restype, inner.argtypes, outer.args)
    with builder.if_then(status.is_error):
        builder.call(ir.Function(module, ir.FunctionType(ir.VoidType(), []), RAISED), [])
    builder.ret(value)
    library.add_ir_module(module)


def _external(callee: FunctionType) -> Any:
    """A function to be found by its symbol."""
    return numba.types.ExternalFunction(symbol(callee), _types(callee))


def _types(function: FunctionType) -> Any:
    """A signature in numba's types."""
    arguments, result = signature(function)
    return KINDS[result](*(KINDS[kind] for kind in arguments))
