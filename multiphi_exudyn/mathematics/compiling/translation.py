"""Translation of functions on flat buffers to LLVM by numba.

numba reads Python's bytecode and infers the types; only the passes that scalars and buffers need are run. A variable
has one type in the whole function. Functions call one another by their symbols, as C does.
"""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping
from types import FunctionType, NoneType
from typing import Any

import llvmlite.binding as llvm
import numba
from llvmlite import ir
from numba.core import cgutils
from numba.core import ir as statements
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, Flags, compile_extra
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import FunctionPass, PassManager, register_pass
from numba.core.errors import NumbaError
from numba.core.lowering import Lower
from numba.core.registry import cpu_target
from numba.core.typed_passes import NativeLowering, NoPythonBackend, NopythonTypeInference
from numba.core.typing import Context
from numba.core.untyped_passes import FixupArgs, TranslateByteCode

from multiphi_exudyn.mathematics.compiling.buffer_function import (
    Ints,
    Numbers,
    Shorts,
    Waves,
    callees,
    signature,
    symbol,
)
from multiphi_exudyn.mathematics.compiling.machine_code import RAISED, object_code, refusal

__all__ = ["object_file_of"]

KINDS = {
    Ints: numba.types.CPointer(numba.types.int64),
    Shorts: numba.types.CPointer(numba.types.int32),
    Numbers: numba.types.CPointer(numba.types.float64),
    Waves: numba.types.CPointer(numba.types.complex128),
    int: numba.types.int64,
    float: numba.types.float64,
    NoneType: numba.types.void,
}


def object_file_of(function: FunctionType) -> bytes:
    """Return the object file of a function."""
    target = cpu_target.target_context
    library = _Library(target.codegen(), symbol(function))
    with global_compiler_lock:
        _write(function, library)
        _, cpu, features = target.codegen().magic_tuple()
        return object_code(library.linked(), library.name, cpu, features)


def _write(function: FunctionType, library: _Library) -> None:
    """Add a function to a library, callable from C."""
    called = {name: _external(callee) for name, callee in callees(function).items()}
    alone = FunctionType(function.__code__, {**function.__globals__, **called}, function.__name__)
    kinds = _types(function)
    flags: Any = Flags()
    flags.error_model = "numpy"
    flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    contexts = _known_types(), cpu_target.target_context
    try:
        compile_extra(*contexts, alone, kinds.args, kinds.return_type, flags, {}, library, _Reading)
    except (NumbaError, NotImplementedError) as error:
        raise refusal(symbol(function)) from error


class _Library(JITCodeLibrary):
    """Library of LLVM modules that are neither optimised twice nor loaded, unlike numba's own."""

    def add_ir_module(self, ir_module: ir.Module) -> None:
        """Link a module into the library."""
        self._final_module.link_in(llvm.parse_assembly(str(ir_module)))

    def linked(self) -> llvm.ModuleRef:
        """Return the module, with the numba functions that it calls."""
        for library in self._linking_libraries:
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        return self._final_module


class _Types(Context):
    """numba's types of operations, cached: numba would try all candidates for every request."""

    def __init__(self) -> None:
        super().__init__()
        self._found: dict[tuple[Any, Any], Any] = {}
        self._operators: dict[tuple[Any, Any], Any] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a function for arguments of these types."""
        if kws or (func, args) not in self._found:
            self._found[func, args] = super().resolve_function_type(func, args, kws)
        return self._found[func, args]

    def operator(self, op: Any, args: Any) -> Any:
        """Return an operator for arguments of these types."""
        if (op, args) not in self._operators:
            self._operators[op, args] = function = self.resolve_value_type(op)
            function.get_call_type(self, args, {})  # registers its implementation
        return self._operators[op, args]


@register_pass(mutates_CFG=False, analysis_only=False)
class _Constants(FunctionPass):
    """Numbers of the module, and their sums, are constants: numba would give each a type of its own."""

    _name = "constants_of_buffers"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Replace numbers of the module by constants in every block."""
        for block in state.func_ir.blocks.values():
            numbers = dict[str, float]()
            for assignment in block.find_insts(statements.Assign):
                number = _number(assignment.value, numbers)
                if number is not None:  # a temporary, assigned once; variables are copies of temporaries
                    numbers[assignment.target.name] = number
                    assignment.value = statements.Const(number, assignment.loc)
        return True


def _number(value: Any, known: Mapping[str, float]) -> float | None:
    """Return the number of a value, from ``known`` temporaries, or None."""
    if isinstance(value, statements.Global | statements.Const):
        return value.value if type(value.value) in (int, float) else None
    if isinstance(value, statements.Expr) and value.op == "binop" and value.fn is operator.add:
        left, right = known.get(value.lhs.name), known.get(value.rhs.name)
        return None if left is None or right is None else left + right
    return None


class _Lowering(Lower):
    """numba's lowering to LLVM without reference counts and errors, which only objects need.

    The types of operators are taken from the cache; numba would infer them again.
    """

    def lower(self) -> None:
        """Write the function for numba's and for C's calling convention."""
        self.lower_normal_function(self.fndesc)
        _add_c_function(self.module, self.fndesc, self.library.name)
        self.library.add_ir_module(self.module)

    def lower_block(self, block: Any) -> None:
        """Lower one block of statements."""
        self.pre_block(block)
        for statement in block.body:
            self.loc = statement.loc
            self.lower_inst(statement)
        self.post_block(block)

    def lower_inst(self, inst: Any) -> None:
        """Lower one statement."""
        if not isinstance(inst, statements.Assign):
            super().lower_inst(inst)
            return
        name = inst.target.name
        self.storevar(self.lower_assign(self.typeof(name), inst), name)

    def storevar(self, value: Any, name: str, argidx: Any = None) -> None:
        """Assign to a variable."""
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def alloca(self, name: str, type: Any) -> Any:
        """Allocate a variable."""
        return cgutils.alloca_once(self.builder, self.context.get_value_type(type), name=name)

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Lower an operation of two numbers."""
        kind, context = self.fndesc.calltypes[expr], self.context
        numbers = [
            context.cast(self.builder, self.loadvar(side.name), self.typeof(side.name), type_)
            for side, type_ in zip((expr.lhs, expr.rhs), kind.args, strict=True)
        ]
        result = context.get_function(_known_types().operator(op, kind.args), kind)(self.builder, numbers)
        return context.cast(self.builder, result, kind.return_type, resty)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Writing(NativeLowering):
    """numba's lowering pass."""

    _name = "buffers"
    lowering_class = _Lowering


PASSES = TranslateByteCode, FixupArgs, _Constants, NopythonTypeInference, _Writing, NoPythonBackend


class _Passes(PassManager):
    """A few of numba's thirty passes, which keep the order of statements."""

    _ENFORCING = False

    def __init__(self) -> None:
        super().__init__("buffers")
        for step in PASSES:
            self.add_pass(step, step.__name__)
        self.finalize()


class _Reading(CompilerBase):
    """numba's compiler with the passes for scalars and buffers only."""

    def define_pipelines(self) -> list[PassManager]:
        """Return the passes from bytecode to types and LLVM."""
        return [_Passes()]


@functools.cache
def _known_types() -> _Types:
    return _Types()


def _add_c_function(module: ir.Module, inner: Any, name: str) -> None:
    """Add a C function that calls ``inner``, whose own convention returns an error status."""
    target = cpu_target.target_context
    kinds = [target.get_value_type(kind) for kind in inner.argtypes]
    outer = ir.Function(module, ir.FunctionType(target.get_value_type(inner.restype), kinds), name)
    builder = ir.IRBuilder(outer.append_basic_block())
    callee = target.declare_function(module, inner)
    status, value = target.call_conv.call_function(builder, callee, inner.restype, inner.argtypes, outer.args)
    with builder.if_then(status.is_error):
        builder.call(ir.Function(module, ir.FunctionType(ir.VoidType(), []), RAISED), [])
    builder.ret(value)


def _external(callee: FunctionType) -> Any:
    """Return an external function, found by its symbol."""
    return numba.types.ExternalFunction(symbol(callee), _types(callee))


def _types(function: FunctionType) -> Any:
    """Return a signature in numba's types."""
    arguments, result = signature(function)
    return KINDS[result](*(KINDS[kind] for kind in arguments))
