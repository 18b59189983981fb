"""From the functions of a `Library` to object files: numba makes LLVM's representation of them, LLVM optimises it.

Numba compiles each function by itself (`_Compiler`, a pipeline of its own as numba's manual has it), and one pass of
LLVM over all of them together does the work, once to remove what is not needed and once for each baseline. The
environment variable NUMBA_OPT is 0 here, so that functions come as they were written.

Kernels neither allocate nor raise, and their arrays have no owners, so that references are not counted. Numba writes
the handling of errors all the same; once LLVM sees that errors never occur, all of it disappears. What is left may want
nothing but functions of C's mathematical library, which is checked.
"""

from __future__ import annotations

import ast
import gc
import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir
from numba import cfunc, types
from numba.core import cgutils
from numba.core.codegen import AOTCPUCodegen
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import LoweringPass, register_pass
from numba.core.dispatcher import Dispatcher
from numba.core.typed_passes import NativeLowering
from numba.extending import intrinsic

from handfast.core.compiled import OPTIONS
from handfast.core.groups import LINE_NUMBERS, FieldKind, kinds
from handfast.core.machine_code import BASELINES, OWN_SOURCES, Baseline, Library, target_machine

WORD = ir.IntType(64)
NUMBA_SCALARS: dict[type, Any] = {int: types.int64, bool: types.boolean, float: types.float64}
NUMBA_DTYPES: dict[type, Any] = {np.int64: types.int64, np.bool_: types.boolean, np.float64: types.float64}
# of C's library: what machine code may leave to be found in the process
KNOWN = {"acos", "asin", "atan", "atan2", "ceil", "cos", "exp", "fabs", "floor", "fmod", "hypot", "log", "pow", "rint"}
KNOWN |= {"sin", "sqrt", "tan", "memset", "memcpy", "memmove"}


def main(module: str, folder: str, names: str) -> None:
    """Write the object files of the library that a module declares: for each baseline one, with its name."""
    gc.set_threshold(200_000)  # numba makes millions of objects and keeps them: to look through them takes an eighth
    OPTIONS["pipeline_class"] = _Compiler  # of the functions that are declared from here on
    dispatcher: Any = Dispatcher
    dispatcher.get_call_template = _of_any_constant
    library: Library = import_module(module).LIBRARY
    baselines = [x for x in BASELINES if x.name in names.split()]
    for baseline, code in zip(baselines, compiled(library, baselines), strict=True):
        (Path(folder) / baseline.name).write_bytes(code)


_call_template = Dispatcher.get_call_template


def _of_any_constant(function: Any, arguments: Any, named: Any) -> Any:
    """What a call calls: numba would compile the function once for each constant that is given."""
    of_type = {name: types.unliteral(argument) for name, argument in named.items()}
    return _call_template(function, tuple(map(types.unliteral, arguments)), of_type)


def compiled(library: Library, baselines: Sequence[Baseline]) -> list[bytes]:
    """The object file of each baseline.

    Raises:
        RuntimeError: the functions want something of numba's runtime, because they allocate or raise; or they are made
            of files that the library does not name, a change of which would go unseen.
    """
    whole = llvm.parse_assembly(_made_by())
    for name, entry in library.entries.items():
        function = getattr(import_module(entry.module), name)
        made = cfunc(types.int64(types.voidptr), error_model="numpy")(_called(function, entry.takes))
        whole.link_in(llvm.parse_assembly(made.inspect_llvm()))
        whole.link_in(llvm.parse_assembly(_front(name, entry.takes, made.native_name)))
    for part in _PARTS:
        whole.link_in(llvm.parse_bitcode(part))
    _check_sources(library)
    for function in whole.functions:
        if not function.is_declaration and function.name not in library.entries:
            function.linkage = "internal"
    _simplify(whole, target_machine(BASELINES[-1]))
    plain, out = whole.as_bitcode(), []
    for baseline in baselines:
        target, copy = target_machine(baseline), llvm.parse_bitcode(plain)
        _optimise(copy, target)
        if wanted := _wanted(copy):
            wants = ", ".join(sorted(wanted))
            raise RuntimeError(f"{library.name}: kernels must not allocate or raise, but want {wants}")
        out.append(bytes(target.emit_object(copy)))
    return out


def _made_by() -> str:
    """Which compiler it was, for whoever looks at an object file: nothing else depends on it."""
    text = ", ".join(f"{name} {version(name)}" for name in ("numba", "llvmlite"))
    return f'!llvm.ident = !{{!0}}\n!0 = !{{!"{text}"}}\n'


_CODE = AOTCPUCodegen("parts")
_PARTS: list[bytes] = []  # LLVM's representation of each function that is only called by others


@register_pass(mutates_CFG=False, analysis_only=True)
class _Part(LoweringPass):
    """What calls a function is compiled without it.

    Else numba would link and compile it again with each caller, and with each caller's callers. Nothing of this is run
    here, so that an address which leads nowhere will do.
    """

    _name = "part"

    def __init__(self) -> None:
        LoweringPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        _PARTS.append(state.library.emit_bitcode())
        state.cr = made = state.cr._replace(cfunc=[].append)  # a function by which numba knows it, and never calls
        state.targetctx.insert_user_function(made.cfunc, made.fndesc)
        llvm.add_symbol(made.fndesc.llvm_func_name, 1)
        return True


class _Compiler(CompilerBase):
    """Numba's own, and `_Part` after it: without machine code of each function, and without owners of arrays."""

    def __init__(self, typing: Any, target: Any, library: Any, arguments: Any, returns: Any, flags: Any, *rest: Any):
        flags.no_compile, flags.nrt = True, False
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        library = library or _CODE.create_library("part")
        super().__init__(typing, target, library, arguments, returns, flags, *rest)

    def define_pipelines(self) -> list[Any]:
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.add_pass_after(_Part, NativeLowering)
        pipeline.finalize()
        return [pipeline]


def _wanted(whole: Any) -> set[str]:
    """What the functions want of numba's runtime."""
    wanted = {x.name for x in (*whole.functions, *whole.global_variables) if x.is_declaration} - KNOWN
    return {name for name in wanted if not name.startswith("llvm.")}


def _simplify(whole: Any, target: Any) -> None:
    """What this leaves of errors is all known to be nothing, which `_optimise` removes."""
    plain = llvm.create_pipeline_tuning_options(speed_level=2)
    plain.loop_vectorization = plain.slp_vectorization = plain.loop_unrolling = False
    passes = llvm.create_pass_builder(target, plain)
    passes.getModulePassManager().run(whole, passes)


def _optimise(whole: Any, target: Any) -> None:
    """Where functions are too large to become parts of their callers, what is known goes one level of calls deeper each
    time: if anything is left, once more.
    """
    final = llvm.create_pipeline_tuning_options(speed_level=3)
    final.slp_vectorization = True
    for _ in range(2):
        passes = llvm.create_pass_builder(target, final)
        passes.getModulePassManager().run(whole, passes)
        if not _wanted(whole):
            return


def _front(name: str, takes: tuple[type, ...], entry: str) -> str:
    """A function of plain C arguments that hands an entry the address of them all."""
    module = ir.Module()
    module.triple = llvm.get_process_triple()
    arguments = [ir.DoubleType() if kind is float else WORD for kind in takes]
    front = ir.Function(module, ir.FunctionType(WORD, arguments), name)
    behind = ir.Function(module, ir.FunctionType(WORD, [cgutils.voidptr_t]), entry)
    builder = ir.IRBuilder(front.append_basic_block())
    words = builder.alloca(WORD, len(takes))
    for k, argument in enumerate(front.args):
        place = builder.gep(words, [WORD(k)])
        builder.store(argument, builder.bitcast(place, argument.type.as_pointer()))
    builder.ret(builder.call(behind, [builder.bitcast(words, cgutils.voidptr_t)]))
    return str(module)


def _called(function: Any, takes: tuple[type, ...]) -> Any:
    """A function that calls another one with what the words at an address say."""
    given = _given(takes)

    def entry(words: Any) -> Any:
        return function(*given(words))

    return entry


def _given(takes: tuple[type, ...]) -> Any:
    """The function that makes a call's arguments of its words."""
    made = types.BaseTuple.from_types([NUMBA_SCALARS.get(kind) or _group_type(kind) for kind in takes])

    @intrinsic
    def given(typing: Any, address: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            words = builder.bitcast(arguments[0], WORD.as_pointer())
            values = []
            for k, (kind, type_) in enumerate(zip(takes, made, strict=True)):
                if kind in NUMBA_SCALARS:
                    values.append(_number(builder, words, k, type_))
                    continue
                table = builder.inttoptr(_number(builder, words, k, types.int64), words.type)
                fields = enumerate(zip(kinds(kind).values(), type_, strict=True))
                group = [_field(context, builder, table, i * LINE_NUMBERS, *x) for i, x in fields]
                values.append(context.make_tuple(builder, type_, group))
            return context.make_tuple(builder, made, values)

        return made(address), code

    return given


def _group_type(group: type) -> Any:
    """Numba's type of a group."""
    fields = [
        types.Array(NUMBA_DTYPES[x.dtype], x.dimensions, "C") if x.dimensions else NUMBA_DTYPES[x.dtype]
        for x in kinds(group).values()
    ]
    return types.BaseTuple.from_types(fields, group)


def _number(builder: Any, words: Any, k: int, type_: Any) -> Any:
    """The k-th word."""
    place = builder.gep(words, [WORD(k)])
    if type_ is types.float64:
        return builder.load(builder.bitcast(place, ir.DoubleType().as_pointer()))
    word = builder.load(place)
    return builder.icmp_signed("!=", word, WORD(0)) if type_ is types.boolean else word


def _field(context: Any, builder: Any, table: Any, k: int, kind: FieldKind, type_: Any) -> Any:
    """The field of a group whose line of the table begins at the k-th word: a number, or an array without an owner."""
    if kind.dimensions == 0:
        return _number(builder, table, k, type_)
    address, *shape = (_number(builder, table, k + i, types.int64) for i in range(1 + kind.dimensions))
    array = cgutils.create_struct_proxy(type_)(context, builder)
    array.itemsize = size = WORD(np.dtype(kind.dtype).itemsize)
    strides = []
    for length in reversed(shape):
        strides.append(size)
        size = builder.mul(size, length)
    array.data = builder.inttoptr(address, array.data.type)
    array.shape, array.strides = (cgutils.pack_array(builder, x) for x in (shape, strides[::-1]))
    array.nitems = builder.sdiv(size, array.itemsize)
    return array._getvalue()  # as numba's manual has it


def _check_sources(library: Library) -> None:
    """Everything of the library's package that was imported to make its functions is among its sources."""
    named = {path.resolve() for path in (*library.sources, *OWN_SOURCES)}
    for name, module in list(sys.modules.items()):
        if name in BEFORE or name.split(".")[0] != library.module.split(".")[0]:
            continue
        path = Path(str(module.__file__)).resolve()
        statements = ast.parse(path.read_bytes()).body  # of which a docstring compiles to nothing
        if path not in named and any(not isinstance(x, ast.Expr) for x in statements):
            raise RuntimeError(f"{library.name}: {path} is compiled, too, but not among the library's sources")


BEFORE = frozenset(sys.modules)  # what this file needs: of the package, `OWN_SOURCES` and what is never compiled
