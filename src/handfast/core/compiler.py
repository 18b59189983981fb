"""From the functions of a `Library` to one object file: numba makes LLVM's representation of them, LLVM optimises it.

Public interfaces are used, `cfunc`, `carray` and `intrinsic` of numba, and of llvmlite modules and passes, but for
what `_not_to_be_run` does. The environment variable NUMBA_OPT is 0 here, so that functions come as they were written,
and one pass over all of them together does the work: it takes half as long, and arguments that are the same in every
call vanish.

Kernels neither allocate nor raise, and their arrays have no owners. Numba writes the counting of references and
the handling of errors all the same; once LLVM sees that owners are always null and errors never occur, all of it
disappears. What is left may want nothing but functions of C's mathematical library, which is checked.
"""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import carray, cfunc, types
from numba.core import codegen
from numba.extending import intrinsic

from handfast.core.groups import LINE, FieldKind, kinds
from handfast.core.machine_code import OWN_SOURCES, EntryPoint, Library, target_machine

NUMBERS: dict[type, Any] = {int: types.int64, bool: types.int64, float: types.float64}
# of C's library: what machine code may leave to be found in the process
KNOWN = {"acos", "asin", "atan", "atan2", "ceil", "cos", "exp", "fabs", "floor", "fmod", "hypot", "log", "pow", "rint"}
KNOWN |= {"sin", "sqrt", "tan", "memset", "memcpy", "memmove"}


def main(module: str) -> None:
    """Write the object file of the library that a module declares to standard output."""
    _not_to_be_run()
    library: Library = import_module(module).LIBRARY
    code = compiled(library)
    sys.stdout.buffer.write(code)


def compiled(library: Library) -> bytes:
    """The object file for this processor.

    Raises:
        RuntimeError: the functions want something of numba's runtime, because they allocate or raise; or they are made
            of files that the library does not name, a change of which would go unseen.
    """
    whole = llvm.parse_assembly("")
    for name, entry in library.entries.items():
        signature = types.int64(*(NUMBERS.get(kind, types.voidptr) for kind in entry.takes))
        made = cfunc(signature, error_model="numpy")(_wrapper(name, entry))
        part = llvm.parse_assembly(made.inspect_llvm())
        part.get_function(made.native_name).name = name
        whole.link_in(part)
    _check_sources(library)
    for function in whole.functions:
        if not function.is_declaration and function.name not in library.entries:
            function.linkage = "internal"
    target = target_machine()
    _optimise(whole, target)
    if wanted := _wanted(whole):
        raise RuntimeError(f"{library.name}: kernels must not allocate or raise, but want {', '.join(sorted(wanted))}")
    return bytes(target.emit_object(whole))


def _not_to_be_run() -> None:
    """Nothing that numba compiles in this process is called here, only written: it makes no machine code then.

    It would for each function, and again for all that this one calls, which is half of all the time. Where a numba
    has not these methods, it does as it always did.
    """
    methods: list[tuple[Any, str, Any]] = [
        (getattr(codegen, "JITCodeLibrary", None), "_finalize_specific", lambda library: None),
        (getattr(codegen, "JITCodeLibrary", None), "get_pointer_to_function", _no_address),
        (getattr(codegen, "JITCPUCodegen", None), "set_env", lambda engine, name, environment: None),
    ]
    if all(hasattr(owner, name) for owner, name, _ in methods):
        for owner, name, instead in methods:
            setattr(owner, name, instead)


def _no_address(library: Any, name: str) -> int:
    """Of a function that is linked with what it calls, and that is all."""
    library._ensure_finalized()
    return 0


def _wanted(whole: Any) -> set[str]:
    """What the functions want of numba's runtime."""
    wanted = {x.name for x in (*whole.functions, *whole.global_variables) if x.is_declaration} - KNOWN
    return {name for name in wanted if not name.startswith("llvm.")}


def _optimise(whole: Any, target: Any) -> None:
    """Twice: what the first time leaves of owners and errors is all known to be nothing, which the second removes.

    Where functions are too large to become parts of their callers, that goes one level of calls deeper each time:
    if anything is left, once more.
    """
    plain = llvm.create_pipeline_tuning_options(speed_level=2)
    plain.loop_vectorization = plain.slp_vectorization = plain.loop_unrolling = False
    final = llvm.create_pipeline_tuning_options(speed_level=3)
    final.slp_vectorization = True
    references = llvm.create_new_module_pass_manager()
    references.add_refprune_pass()
    first, last = (llvm.create_pass_builder(target, options) for options in (plain, final))
    first.getModulePassManager().run(whole, first)
    references.run(whole, first)
    last.getModulePassManager().run(whole, last)
    if _wanted(whole):
        again = llvm.create_pass_builder(target, final)
        again.getModulePassManager().run(whole, again)


@intrinsic
def _pointer(typing: Any, address: Any) -> Any:
    """An address as a pointer, which `carray` takes."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.voidptr(address), code


def _wrapper(name: str, entry: EntryPoint) -> Any:
    """A function of plain C arguments that gives an entry its groups: its text has a line for each argument."""
    known: dict[str, Any] = {"function": getattr(import_module(entry.module), name), "carray": carray}
    known |= {"pointer": _pointer} | {x.__name__: x for x in (np.int64, np.float64, np.bool_)}
    arguments = [f"argument{k}" for k in range(len(entry.takes))]
    lines = [f"def wrapper({', '.join(arguments)}):"]
    values = []
    for argument, kind in zip(arguments, entry.takes, strict=True):
        if kind in NUMBERS:
            values.append(f"{argument} != 0" if kind is bool else argument)
            continue
        known[f"Group{argument}"] = kind
        fields = kinds(kind)
        lines += [
            f"    whole{argument} = carray({argument}, ({len(fields)}, {LINE}), int64)",
            f"    real{argument} = carray({argument}, ({len(fields)}, {LINE}), float64)",
        ]
        each = [_field(k, field, f"whole{argument}", f"real{argument}") for k, field in enumerate(fields.values())]
        values.append(f"Group{argument}({', '.join(each)})")
    lines.append(f"    return function({', '.join(values)})")
    exec("\n".join(lines), known)
    return known["wrapper"]


def _field(k: int, kind: FieldKind, whole: str, real: str) -> str:
    """The expression that reads the k-th field of a group from its table."""
    if kind.dimensions == 0 and kind.dtype is np.float64:
        return f"{real}[{k}, 0]"
    if kind.dimensions == 0:
        return f"{whole}[{k}, 0]" + (" != 0" if kind.dtype is np.bool_ else "")
    lengths = "".join(f"{whole}[{k}, {1 + i}], " for i in range(kind.dimensions))
    return f"carray(pointer({whole}[{k}, 0]), ({lengths}), {kind.dtype.__name__})"


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
