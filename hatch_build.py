"""Wheels carry the engines' machine code, for all processors of an architecture: who installs one never compiles."""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

LIBRARIES = ("handfast.stability.search.machine", "handfast.synthesis.search.library")  # modules that declare one


class MachineCode(BuildHookInterface):
    """What is made here is kept beside the sources, too, where an editable installation finds it: for that, the code
    for this processor will do."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        sources = Path(self.root) / "src"
        sys.path.insert(0, str(sources))
        from handfast.core.machine_code import BASELINES, own_baseline, sealed

        baselines = [own_baseline()] if version == "editable" else BASELINES
        libraries = [import_module(name).LIBRARY for name in LIBRARIES]
        with ThreadPoolExecutor() as pool:  # each is compiled in a process of its own, which takes a minute or two
            codes = list(pool.map(lambda library: library.machine_codes(baselines), libraries))
        if version == "editable":
            return
        self._folder = tempfile.TemporaryDirectory()
        for library, made in zip(libraries, codes, strict=True):
            for baseline, code in zip(baselines, made, strict=True):
                file = Path(self._folder.name) / library.file_name(baseline)
                file.write_bytes(sealed(code))
                build_data["force_include"][str(file)] = (library.home.relative_to(sources) / file.name).as_posix()
        build_data["pure_python"] = False
        platform = next(x for x in platform_tags() if not x.startswith(("manylinux", "musllinux")))
        build_data["tag"] = f"py3-none-{platform}"  # any Python: llvmlite loads what is in it

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            self._folder.cleanup()
