"""What every test session begins with."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "src" / "holdfast"
ENGINES = (PACKAGE / "stability" / "engine", PACKAGE / "synthesis" / "engine")


def pytest_configure(config: pytest.Config) -> None:
    # numba renews a function's machine code when its own file changes, not when a file that it calls does
    for engine in ENGINES:
        newest = max(f.stat().st_mtime for f in engine.glob("*.py"))
        for code in engine.glob("__pycache__/*.nb[ic]"):
            with suppress(FileNotFoundError):  # another session may be doing the same
                if code.stat().st_mtime < newest:
                    code.unlink()
