"""What every test session begins with."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest

ENGINE = Path(__file__).parents[1] / "src" / "holdfast" / "stability" / "engine"


def pytest_configure(config: pytest.Config) -> None:
    # numba renews a function's machine code when its own file changes, not when a file that it calls does
    newest = max(f.stat().st_mtime for f in ENGINE.glob("*.py"))
    for code in ENGINE.glob("__pycache__/*.nb[ic]"):
        with suppress(FileNotFoundError):  # another session may be doing the same
            if code.stat().st_mtime < newest:
                code.unlink()
