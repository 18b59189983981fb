"""How functions are compiled, and where numba may keep what it made of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from numba import njit

from handfast.core.trusted import trusted

BESIDE = Path(__file__).parent / "__pycache__"  # as safe as the package: Python loads its own code from there


def kernel(function: Any) -> Any:
    """Compiled, to be called from Python."""
    return _compiled(function)


def inner(function: Any) -> Any:
    """Compiled, for compiled callers only."""
    return _compiled(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def _compiled(function: Any, **options: bool) -> Any:
    """Kept for later where nobody else can write: what numba finds there it runs.

    It takes any folder from the environment, one relative to the current folder, too.
    """
    made = njit(cache=True, nogil=True, error_model="numpy", **options)(function)
    if _safe(Path(made.stats.cache_path)):
        return made
    return njit(nogil=True, error_model="numpy", **options)(function)


def _safe(folder: Path) -> bool:
    return folder == BESIDE or (folder.is_absolute() and trusted(folder.stat()))
