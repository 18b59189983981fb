"""Wheels carry the engines' machine code for the processor that builds them: whoever installs one need not compile."""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LIBRARIES = ("handfast.stability.search.machine", "handfast.synthesis.search.library")  # modules that declare one


class MachineCode(BuildHookInterface):
    """On another processor the first question compiles. What is made here is kept beside the sources, too: an editable
    installation, which is not built, finds it there."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        sources = Path(self.root) / "src"
        sys.path.insert(0, str(sources))
        from handfast.core.machine_code import sealed

        self._folder = tempfile.TemporaryDirectory()
        libraries = [import_module(name).LIBRARY for name in LIBRARIES]
        with ThreadPoolExecutor() as pool:  # each is compiled in a process of its own, which takes a minute or two
            codes = list(pool.map(lambda library: library.machine_code(), libraries))
        for library, code in zip(libraries, codes, strict=True):
            made = Path(self._folder.name) / library.file_name()
            made.write_bytes(sealed(code))
            build_data["force_include"][str(made)] = (library.home.relative_to(sources) / made.name).as_posix()
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            self._folder.cleanup()
