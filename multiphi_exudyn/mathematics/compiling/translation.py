"""Functions on flat buffers as numba writes them for LLVM.

numba reads Python's code and finds the types; of its passes those are run that scalars and buffers need. A variable has
one type in all of its function. Functions call one another by their symbols, as C does.
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

__all__ = ["translated"]

KINDS = {
    Ints: numba.types.CPointer(numba.types.int64),
    Shorts: numba.types.CPointer(numba.types.int32),
    Numbers: numba.types.CPointer(numba.types.float64),
    Waves: numba.types.CPointer(numba.types.complex128),
    int: numba.types.int64,
    float: numba.types.float64,
    NoneType: numba.types.void,
}


def translated(function: FunctionType) -> bytes:
    """The object file of a function."""
    target = cpu_target.target_context
    library = _Library(target.codegen(), symbol(function))
    with global_compiler_lock:
        _write(function, library)
        _, cpu, features = target.codegen().magic_tuple()
        return object_code(library.linked(), library.name, cpu, features)


def _write(function: FunctionType, library: _Library) -> None:
    """Put a function in a library, for C to call."""
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
        self._operators: dict[tuple[Any, Any], Any] = {}

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """The signature of a function for arguments of these types."""
        if kws or (func, args) not in self._found:
            self._found[func, args] = super().resolve_function_type(func, args, kws)
        return self._found[func, args]

    def operator(self, op: Any, args: Any) -> Any:
        """An operator for arguments of these types."""
        if (op, args) not in self._operators:
            self._operators[op, args] = found = self.resolve_value_type(op)
            found.get_call_type(self, args, {})  # which it then knows how to write
        return self._operators[op, args]


@register_pass(mutates_CFG=False, analysis_only=False)
class _Constants(FunctionPass):
    """Numbers of the module, and their sums, are constants: numba would give each a type of its own."""

    _name = "constants_of_buffers"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """In every block, whose statements follow one another."""
        for block in state.func_ir.blocks.values():
            known = dict[str, float]()
            for assignment in block.find_insts(statements.Assign):
                number = _number(assignment.value, known)
                if number is not None:  # then it is a temporary, which is assigned once; variables are copies of these
                    known[assignment.target.name] = number
                    assignment.value = statements.Const(number, assignment.loc)
        return True


def _number(value: Any, known: Mapping[str, float]) -> float | None:
    """The number that a value is, of temporaries that are ``known``, or None."""
    if isinstance(value, statements.Global | statements.Const):
        return value.value if type(value.value) in (int, float) else None
    if isinstance(value, statements.Expr) and value.op == "binop" and value.fn is operator.add:
        left, right = known.get(value.lhs.name), known.get(value.rhs.name)
        return None if left is None or right is None else left + right
    return None


class _Lowering(Lower):
    """What numba writes for LLVM, but for what objects need: counts of references, and errors anywhere.

    The types of operators are known by now; numba would find them once more.
    """

    def lower(self) -> None:
        """The function as numba calls it, and as C does."""
        self.lower_normal_function(self.fndesc)
        _add_c_function(self.module, self.fndesc, self.library.name)
        self.library.add_ir_module(self.module)

    def lower_block(self, block: Any) -> None:
        """One block of statements."""
        self.pre_block(block)
        for statement in block.body:
            self.loc = statement.loc
            self.lower_inst(statement)
        self.post_block(block)

    def lower_inst(self, inst: Any) -> None:
        """One statement."""
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
        """Where a variable stands."""
        return cgutils.alloca_once(self.builder, self.context.get_value_type(type), name=name)

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """Two numbers made one."""
        kind, context = self.fndesc.calltypes[expr], self.context
        numbers = [
            context.cast(self.builder, self.loadvar(side.name), self.typeof(side.name), wanted)
            for side, wanted in zip((expr.lhs, expr.rhs), kind.args, strict=True)
        ]
        found = context.get_function(_known_types().operator(op, kind.args), kind)(self.builder, numbers)
        return context.cast(self.builder, found, kind.return_type, resty)


@register_pass(mutates_CFG=True, analysis_only=False)
class _Writing(NativeLowering):
    """Numba's pass that writes for LLVM."""

    _name = "buffers"
    lowering_class = _Lowering


PASSES = TranslateByteCode, FixupArgs, _Constants, NopythonTypeInference, _Writing, NoPythonBackend


class _Passes(PassManager):
    """Some of numba's thirty passes, which leave the order of statements as it was."""

    _ENFORCING = False

    def __init__(self) -> None:
        super().__init__("buffers")
        for step in PASSES:
            self.add_pass(step, step.__name__)
        self.finalize()


class _Reading(CompilerBase):
    """What numba has to do where there are scalars and buffers alone; it looks for much else otherwise."""

    def define_pipelines(self) -> list[PassManager]:
        """From Python's code to types and to what LLVM reads."""
        return [_Passes()]


@functools.cache
def _known_types() -> _Types:
    return _Types()


def _add_c_function(module: ir.Module, inner: Any, name: str) -> None:
    """Put the function ``inner`` there as C calls it; numba's own returns whether there was an error."""
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
    """A function to be found by its symbol."""
    return numba.types.ExternalFunction(symbol(callee), _types(callee))


def _types(function: FunctionType) -> Any:
    """A signature in numba's types."""
    arguments, result = signature(function)
    return KINDS[result](*(KINDS[kind] for kind in arguments))
