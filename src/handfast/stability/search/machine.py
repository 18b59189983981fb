"""The kernel's machine code: made by numba once for this processor, kept in a file, loaded without numba.

Numba compiles the functions of `kernel` to LLVM's representation, llvmlite makes machine code of it. The file's name
says for which processor and of which source it was made, so that a stale one is never found; its end is the digest of
the rest, so that a damaged one is made anew; and none is loaded that someone else could have put there. To load it
takes some hundredths of a second; to import numba, and to let it find what it compiled before, takes more than one.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from handfast.core.trusted import trusted

HERE = Path(__file__).parent
SOURCES = (HERE / "rows.py", HERE / "arrays.py", *sorted((HERE / "kernel").glob("*.py")))

_WHOLE, _REAL = ctypes.c_int64, ctypes.c_double
_TABLE = np.ctypeslib.ndpointer(np.int64, ndim=2, flags="C_CONTIGUOUS")
# module and arguments of the functions, each of which returns a whole number
FUNCTIONS = {
    "run": ("tree", 3 * [_WHOLE] + 2 * [_REAL] + 3 * [_WHOLE] + 2 * [_REAL] + 2 * [_WHOLE] + 4 * [_TABLE]),
    "polished": ("newton", 2 * [_WHOLE] + 2 * [_REAL] + 3 * [_WHOLE] + [_REAL] + 4 * [_TABLE]),
    "refuted": ("refute", 3 * [_WHOLE] + 2 * [_REAL] + 5 * [_TABLE]),
}

# arrays of the kernel have no owners, whose references numba would count at every use
NO_REFERENCES = """
define void @NRT_incref(ptr %x) alwaysinline { ret void }
define void @NRT_decref(ptr %x) alwaysinline { ret void }
"""


class Kernel:
    """The compiled functions of `kernel.tree`, `kernel.newton` and `kernel.refute`.

    They take numbers and tables (see `arrays`), and let other threads run meanwhile.
    """

    run: Callable[..., int]
    polished: Callable[..., int]
    refuted: Callable[..., int]

    def __init__(self, code: bytes) -> None:
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())  # owns the code
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        for name, (_, arguments) in FUNCTIONS.items():
            made = ctypes.CFUNCTYPE(_WHOLE, *arguments)(self._engine.get_function_address(name))
            setattr(self, name, made)


@cache
def kernel() -> Kernel:
    """The kernel, compiled if this processor has not seen it yet, which takes half a minute and says so."""
    return Kernel(machine_code())


def machine_code() -> bytes:
    """The object file for this processor: as it is kept, or compiled and kept."""
    name = file_name()
    for folder in _folders():
        code = _kept(folder / name)
        if code is not None:
            return code
    logging.getLogger("handfast").warning("compiling the engine for this processor, once: about half a minute")
    code = compiled()
    for folder in _folders():
        with suppress(OSError):  # not ours to write to
            if _keep(code, folder / name):
                return code
    where = " or ".join(str(folder) for folder in _folders())
    logging.getLogger("handfast").warning(f"its code is not kept: no folder that only you can write to at {where}")
    return code


def compiled() -> bytes:
    """Compile the kernel for this processor: an object file.

    Numba leaves optimising to one pass over all functions together, of which none but `FUNCTIONS` is seen outside:
    it takes half as long, and arguments that are the same in every call vanish.
    """
    from numba import cfunc, types
    from numba.core import config

    kinds: dict[Any, Any] = {_WHOLE: types.int64, _REAL: types.float64, _TABLE: types.CPointer(types.int64)}
    whole = llvm.parse_assembly(NO_REFERENCES)
    usual = config.OPT
    try:
        config.OPT = type(usual)(0)
        for name, (module, arguments) in FUNCTIONS.items():
            function = getattr(import_module(f"{__package__}.kernel.{module}"), name)
            made = cfunc(types.int64(*(kinds[kind] for kind in arguments)), error_model="numpy")(function)
            part = llvm.parse_assembly(made.inspect_llvm())
            part.get_function(made.native_name).name = name
            whole.link_in(part)
    finally:
        config.OPT = usual
    whole.link_in(llvm.parse_assembly(_traps(whole)))
    for function in whole.functions:
        if not function.is_declaration and function.name not in FUNCTIONS:
            function.linkage = "internal"
    target = _target()
    tuning = llvm.create_pipeline_tuning_options(speed_level=3)
    tuning.slp_vectorization = True
    passes = llvm.create_pass_builder(target, tuning)
    passes.getModulePassManager().run(whole, passes)
    return bytes(target.emit_object(whole))


def _traps(whole: Any) -> str:
    """What numba's runtime would do on errors, of which the kernel raises none."""
    out = ["declare void @llvm.trap()"]
    for function in whole.functions:
        if function.is_declaration and function.name.startswith(("numba_", "NRT_")):
            head = re.match(r"declare (.*@\w+\(.*?\))", str(function))
            assert head, str(function)
            out.append(f"define {head[1]} {{\n  call void @llvm.trap()\n  unreachable\n}}")
    return "\n".join(out)


def _target() -> Any:
    """A new one each time: an engine owns its own."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(*_processor(), opt=3, jit=True)


def _processor() -> tuple[str, str]:
    """The processor's name and what it can do."""
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def file_name() -> str:
    """Of the machine code that this processor wants."""
    out = hashlib.sha256()
    for text in (llvmlite.__version__, llvm.get_process_triple(), *_processor()):
        out.update(text.encode() + b"\0")
    for path in SOURCES:
        out.update(path.read_bytes())
    return f"kernel-{out.hexdigest()[:16]}.o"


def _folders() -> tuple[Path, ...]:
    """Where machine code is kept: with the package, or if that is not ours to write to, with the user."""
    variable, usual = ("LOCALAPPDATA", "AppData/Local") if sys.platform == "win32" else ("XDG_CACHE_HOME", ".cache")
    user = Path(os.environ.get(variable, ""))
    if not user.is_absolute():  # to be ignored, says the XDG specification: what the current folder holds is anybody's
        user = Path(os.path.expanduser("~")) / usual
    return tuple(folder for folder in (HERE / "__pycache__", user / "handfast") if folder.is_absolute())


def sealed(code: bytes) -> bytes:
    """Machine code as it stands in its file: with its digest behind it."""
    return code + hashlib.sha256(code).digest()


def _kept(path: Path) -> bytes | None:
    """The machine code in a file; None if there is none, it is damaged, or others could have written it."""
    try:
        with path.open("rb") as file:
            if not (trusted(os.fstat(file.fileno())) and trusted(path.parent.stat())):
                return None
            whole = file.read()
    except OSError:
        return None
    code = whole[: -hashlib.sha256().digest_size]
    return code if sealed(code) == whole else None


def _keep(code: bytes, path: Path) -> bool:
    """Write a file at once, whoever else may be writing it; False in a folder from which it would not be loaded."""
    path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    if not trusted(path.parent.stat()):
        return False
    draft = path.with_suffix(f".{os.getpid()}")
    with suppress(FileNotFoundError):
        draft.unlink()
    with open(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as file:
        file.write(sealed(code))
    os.replace(draft, path)
    return True
