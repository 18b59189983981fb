"""Wheels carry the engine's machine code for the processor that builds them: whoever installs one need not compile."""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Kernel(BuildHookInterface):
    """On another processor the first question compiles. What is made here is kept beside the sources, too: an editable
    installation, which is not built, finds it there."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        sys.path.insert(0, str(Path(self.root) / "src"))
        from handfast.stability.search import machine

        self._folder = tempfile.TemporaryDirectory()
        made = Path(self._folder.name) / machine.file_name()
        made.write_bytes(machine.sealed(machine.machine_code()))
        place = machine.HERE.relative_to(Path(self.root) / "src") / "__pycache__" / made.name
        build_data["force_include"][str(made)] = place.as_posix()
        build_data["pure_python"] = False
        build_data["infer_tag"] = True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            self._folder.cleanup()
