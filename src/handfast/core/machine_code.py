"""Machine code of compiled functions: made for a baseline of processors, kept in a file, loaded without numba.

A `Library` names its functions, what they take, and the files that they are made of. `compiler.py` makes an object
file of them for each `Baseline`, which any processor that has its features can run, so that files travel. The file's
name says for which baseline and of which sources it was made, so that a stale one is never found; its end is the
digest of the rest, so that a damaged one is made anew; and none is loaded that another user could have put there, in
its folder or in one above (`trusted.py`). To load it takes some hundredths of a second; to import numba, and to let it
find what it compiled before, takes more than one.
"""

from __future__ import annotations

import ctypes
import hashlib
import logging
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import llvmlite.binding as llvm
import numpy as np

from handfast.core.errors import InputError
from handfast.core.trusted import exposed, trusted, user_cache

CORE = Path(__file__).parent
OWN_SOURCES = tuple(CORE / name for name in ("compiled.py", "compiler.py", "groups.py", "machine_code.py"))
_TABLE = np.ctypeslib.ndpointer(np.int64, ndim=2, flags="C_CONTIGUOUS")
_TYPES: dict[type, Any] = {int: ctypes.c_int64, bool: ctypes.c_int64, float: ctypes.c_double}
_COMPILE = "import sys; sys.path[:] = sys.argv[4:]; from handfast.core.compiler import main; main(*sys.argv[1:4])"


@dataclass(frozen=True)
class Baseline:
    """Processors that the same machine code is for.

    Attributes:
        name: in the names of files, beside the architecture's.
        processor: the least of them, as LLVM calls it.
        needs: what it has that another one of this architecture may lack, as LLVM calls it.
    """

    name: str
    processor: str
    needs: frozenset[str] = frozenset()


ARCHITECTURE: str = llvm.get_process_triple().split("-")[0]
_X86_64_V3 = "avx avx2 bmi bmi2 cx16 f16c fma lzcnt movbe popcnt sahf sse3 sse4.1 sse4.2 ssse3 xsave"
_ARMV8 = (Baseline("armv8-a", "generic"),)
BASELINES = {  # of this architecture: the last is for every processor, those before it are preferred
    "x86_64": (Baseline("v3", "x86-64-v3", frozenset(_X86_64_V3.split())), Baseline("v1", "x86-64")),
    "aarch64": _ARMV8,
    "arm64": _ARMV8,
}.get(ARCHITECTURE, (Baseline("generic", "generic"),))


@dataclass(frozen=True)
class EntryPoint:
    """A function that Python may call.

    Attributes:
        module: the module it is in; its name is the entry's.
        takes: of each argument `int`, `float`, `bool`, or a named group (`groups.py`). It returns a whole number.
    """

    module: str
    takes: tuple[type, ...]


@dataclass(frozen=True)
class Library:
    """Functions that are compiled together.

    Attributes:
        name: that its files begin with.
        module: where it is declared, as `LIBRARY`.
        entries: what Python may call.
        sources: all files of this package that its functions are made of, but for `OWN_SOURCES`; of which the first is
            in the folder beside whose files the code is kept. Compiling fails if one is missing here.
    """

    name: str
    module: str
    entries: Mapping[str, EntryPoint]
    sources: tuple[Path, ...]

    @cached_property
    def functions(self) -> Any:
        """The entries as attributes, compiled if no code of these sources is kept, which takes a while and says so.

        They take numbers, and tables in place of groups (`groups.table`), and let other threads run meanwhile.
        """
        return loaded(self.machine_code(), {name: entry.takes for name, entry in self.entries.items()})

    def machine_code(self, baseline: Baseline | None = None) -> bytes:
        """The object file for a baseline, by default the one for this processor: as it is kept, or compiled and kept.

        Raises:
            InputError: it has to be compiled, and numba is not installed.
        """
        return self.machine_codes([baseline or own_baseline()])[0]

    def machine_codes(self, baselines: Sequence[Baseline]) -> list[bytes]:
        """The object files for baselines; those that are not kept are compiled together.

        Raises:
            InputError: they have to be compiled, and numba is not installed.
        """
        known = {x: code for x in baselines if (code := self._found(x)) is not None}
        missing = [x for x in baselines if x not in known]
        if missing:
            if find_spec("numba") is None:
                problem = f"is needed to compile the {self.name} engine, whose machine code is not kept here"
                raise InputError(f"{problem}; pip install 'handfast[compiler]'", source="numba")
            log = logging.getLogger("handfast")
            log.warning(f"compiling the {self.name} engine, once: about a minute")
            names = [self.file_name(x) for x in missing]
            codes = self.compiled(missing)
            known |= codes
            changed = names != [self.file_name(x) for x in missing]  # meanwhile: the code is not to be found again
            if not changed and not all(self._put(code, self.file_name(x)) for x, code in codes.items()):
                where = " or ".join(map(_described, self.folders()))
                log.warning(f"its code is not kept: no folder that only you can write to at {where}")
        return [known[x] for x in baselines]

    def _found(self, baseline: Baseline) -> bytes | None:
        """The object file as it is kept; None if it is not."""
        found = (_kept(folder / self.file_name(baseline)) for folder in self.folders())
        return next((code for code in found if code is not None), None)

    def _put(self, code: bytes, name: str) -> bool:
        """Keep an object file in the first folder that will do; False if none will."""
        for folder in self.folders():
            with suppress(OSError):  # not ours to write to
                if _keep(code, folder / name):
                    return True
        return False

    def compiled(self, baselines: Sequence[Baseline]) -> dict[Baseline, bytes]:
        """The object files, made in a process of its own, where numba is told to leave optimising to `compiler.py`.

        Settings of numba that stand in the environment or in the current folder do not count.

        Raises:
            subprocess.CalledProcessError: the compiler failed; why is on standard error.
        """
        environment = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
        environment |= {"NUMBA_OPT": "0", "NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING": "1"}  # which takes seconds
        environment |= {"NUMBA_CPU_NAME": BASELINES[-1].processor, "NUMBA_CPU_FEATURES": ""}
        with tempfile.TemporaryDirectory() as folder:
            what = [self.module, folder, " ".join(x.name for x in baselines)]
            command = [sys.executable, "-c", _COMPILE, *what, *(os.path.abspath(p) for p in sys.path)]
            subprocess.run(command, env=environment, cwd=CORE, check=True)
            return {x: (Path(folder) / x.name).read_bytes() for x in baselines}

    def file_name(self, baseline: Baseline) -> str:
        """Of the machine code for a baseline."""
        out = hashlib.sha256()
        for path in sorted({*self.sources, *OWN_SOURCES}):
            out.update(path.name.encode() + b"\0" + hashlib.sha256(path.read_bytes()).digest())
        kind = f"{ARCHITECTURE}-{baseline.name}-{sys.platform}"
        return f"kernel-{self.name}-{kind}-{out.hexdigest()[:16]}.o"

    @property
    def home(self) -> Path:
        """Where the package keeps the code: with what Python compiles of it."""
        return self.sources[0].parent / "__pycache__"

    def folders(self) -> tuple[Path, ...]:
        """Where machine code is kept: with the package, or if that is not ours to write to, with the user."""
        return tuple(folder for folder in (self.home, user_cache()) if folder.is_absolute())


def loaded(code: bytes, entries: Mapping[str, tuple[type, ...]]) -> Any:
    """The functions of an object file as attributes; entries: what each of them takes."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine(BASELINES[-1]))
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    out = SimpleNamespace(_engine=engine)  # it owns the code
    for name, takes in entries.items():
        prototype = ctypes.CFUNCTYPE(ctypes.c_int64, *(_TYPES.get(kind, _TABLE) for kind in takes))
        setattr(out, name, prototype(engine.get_function_address(name)))
    return out


def target_machine(baseline: Baseline) -> Any:
    """Of a baseline; a new one each time, as an engine owns its own."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    return target.create_target_machine(baseline.processor, "", opt=3, jit=True)


def own_baseline() -> Baseline:
    """The first one whose machine code this processor can run."""
    if len(BASELINES) == 1:
        return BASELINES[0]
    has = {name for name, there in llvm.get_host_cpu_features().items() if there}
    return next(x for x in BASELINES if x.needs <= has)


def sealed(code: bytes) -> bytes:
    """Machine code as it stands in its file: with its digest behind it."""
    return code + hashlib.sha256(code).digest()


def _kept(path: Path) -> bytes | None:
    """The machine code in a file; None if there is none, it is damaged, or others could have written it."""
    try:
        if any(map(exposed, (path, path.parent, path.resolve().parent))):
            return None
        with path.open("rb") as file:
            if not trusted(os.fstat(file.fileno())):
                return None
            whole = file.read()
    except OSError:
        return None
    code = whole[: -hashlib.sha256().digest_size]
    return code if sealed(code) == whole else None


def _described(folder: Path) -> str:
    """A folder, and another one because of which nothing is kept in it."""
    with suppress(OSError):
        open_ = exposed(folder)
        if open_ not in (None, folder):
            return f"{folder} (others can write to {open_})"
    return str(folder)


def _keep(code: bytes, path: Path) -> bool:
    """Write a file at once, whoever else may be writing it; False in a folder from which it would not be loaded."""
    path.parent.mkdir(mode=0o755, parents=True, exist_ok=True)
    if exposed(path.parent):
        return False
    draft = path.with_suffix(f".{os.getpid()}")
    with suppress(FileNotFoundError):
        draft.unlink()
    with open(os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644), "wb") as file:
        file.write(sealed(code))
    os.replace(draft, path)
    return True
