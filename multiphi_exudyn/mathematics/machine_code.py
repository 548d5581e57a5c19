"""Machine code without its compiler: LLVM's text to the code of an object file, and object files to addresses."""

from __future__ import annotations

import functools
import re
import sys
from collections.abc import Iterable

import llvmlite.binding as llvm

from multiphi_exudyn.errors import MultiPhiTypeError

__all__ = ["load", "object_code", "this_cpu"]

RAISES = re.compile(r"@\.const\.picklebuf|@numba_unpickle")  # what numba keeps of an exception to raise
IN_NUMBA = re.compile(r"^declare [^\n]*@(?:numba|NRT)_\w+", re.MULTILINE)  # what numba's own library has
OF_C = re.compile(r"@numba_(ldexp|frexp)\b")  # what numba's own library has of C's, under a name of its own
ERROR_FUNCTION = re.compile(r"^declare (?P<rest>[^\n]*@(?:numba_gil_|Py)\w+\([^\n]*)$", re.MULTILINE)


@functools.cache
def _target() -> llvm.Target:
    if sys.platform == "win32":
        import numba  # noqa: F401  tells LLVM of what C's library lacks there
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple())


def this_cpu() -> tuple[str, str, str]:
    """Kind of machine, name of the processor and its features."""
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _machine(cpu: str, features: str) -> llvm.TargetMachine:
    """What emits code for a processor, set as numba sets it: code that stays in the process."""
    reloc = "static" if _target().name.startswith("x86") else "default"
    return _target().create_target_machine(cpu, features, opt=3, reloc=reloc, codemodel="jitdefault", jit=True)


def object_code(text: str, wrapper: str, symbol: str, cpu: str, features: str) -> bytes:
    """The object file of one function that numba has compiled and optimised.

    text: in LLVM's language, what numba gives. wrapper: the function in it that C could call, to be named ``symbol``.
    That function would print an error; as nothing here can raise, what it would print with is left out, and the code
    needs nothing but the C library and the functions it calls.
    """
    text = OF_C.sub(r"@\1", ERROR_FUNCTION.sub(r"define internal \g<rest> { unreachable }", text))
    if RAISES.search(text) or IN_NUMBA.search(text):
        raise MultiPhiTypeError(
            f"{symbol}: got an operation that raises an error or is numba's own, need none (a complex number divided "
            "or to a power, int ** int, a range with a variable step, arrays, lists and gamma are)"
        )
    module = llvm.parse_assembly(text)
    for function in module.functions:
        if not function.is_declaration and function.name != wrapper:
            function.linkage = "internal"
        elif function.name == wrapper:
            function.name = symbol
    return _machine(cpu, features).emit_object(module)


def load(objects: Iterable[bytes], symbol: str) -> tuple[int, llvm.ExecutionEngine]:
    """(address of a function, what keeps it there) of object files that call one another."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine("", ""))
    for each in objects:
        engine.add_object_file(llvm.ObjectFileRef.from_data(each))
    engine.finalize_object()
    return engine.get_function_address(symbol), engine
