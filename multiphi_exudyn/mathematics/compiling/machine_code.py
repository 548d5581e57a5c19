"""Machine code: from LLVM modules to object files, and from object files to addresses."""

from __future__ import annotations

import functools
import sys
from collections.abc import Iterable

import llvmlite.binding as llvm

from multiphi_exudyn.errors import MultiPhiTypeError

__all__ = ["RAISED", "load", "object_code", "refusal", "this_cpu"]

RAISED = "multiphi_exudyn.raised"  # symbol that a function calls to raise an error
IN_NUMBA = ("numba_", "NRT_", "Py", RAISED)  # prefixes of symbols of numba, of Python, or undefined ones
OF_C = {"numba_ldexp": "ldexp", "numba_frexp": "frexp"}  # C functions under numba's names
LEVEL = 1  # of optimisation: more takes longer, and gains nothing


@functools.cache
def _target() -> llvm.Target:
    if sys.platform == "win32":
        import numba  # noqa: F401  tells LLVM of what C's library lacks there
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.Target.from_triple(llvm.get_process_triple())


def this_cpu() -> tuple[str, str, str]:
    """Return the kind of machine, the name of the processor and its features."""
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def _machine(cpu: str, features: str) -> llvm.TargetMachine:
    """Return a code emitter for a processor, with numba's settings for code that stays in the process."""
    reloc = "static" if _target().name.startswith("x86") else "default"
    return _target().create_target_machine(cpu, features, opt=3, reloc=reloc, codemodel="jitdefault", jit=True)


_emitter = functools.cache(_machine)  # shared by all functions; a loading engine owns its machine


def object_code(module: llvm.ModuleRef, symbol: str, cpu: str, features: str) -> bytes:
    """Return the object file of a module with the public function ``symbol``.

    The function calls RAISED after an error. Optimisation has to remove this call, as no error is possible; then the
    code needs only the C library and the functions that it calls.
    """
    machine = _emitter(cpu, features)
    for function in module.functions:
        if not function.is_declaration and function.name != symbol:
            function.linkage = "internal"
    options = llvm.create_pipeline_tuning_options(speed_level=LEVEL)
    options.loop_unrolling = options.loop_interleaving = options.loop_vectorization = False  # loops are short
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(module, passes)
    for function in module.functions:
        function.name = OF_C.get(function.name, function.name)
        if function.is_declaration and function.name.startswith(IN_NUMBA):
            raise refusal(symbol)
    return machine.emit_object(module)


def refusal(symbol: str) -> MultiPhiTypeError:
    """Return the error for a function that cannot be compiled."""
    return MultiPhiTypeError(
        f"{symbol}: got an operation that raises an error or is numba's own, need none (a complex number divided "
        "or to a power, int ** int, a range with a variable step, arrays, lists and gamma are)"
    )


def load(objects: Iterable[bytes], symbol: str) -> tuple[int, llvm.ExecutionEngine]:
    """Return the address of a function of object files that call one another, and the engine that owns its code."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine("", ""))
    for each in objects:
        engine.add_object_file(llvm.ObjectFileRef.from_data(each))
    engine.finalize_object()
    return engine.get_function_address(symbol), engine
