"""How functions of kernels are compiled, and small ones that all kernels want."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

# compiled callers only; `compiler.py` adds to these
OPTIONS: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, "error_model": "numpy"}


def inner(function: Any) -> Any:
    """Compiled, for compiled callers only; nothing is checked, and division by zero gives infinity."""
    return njit(**OPTIONS)(function)


def quick(function: Any) -> Any:
    """The same, sums in any order: for what is checked afterwards."""
    return njit(**OPTIONS, fastmath={"reassoc", "contract"})(function)


@quick
def larger(a, b):
    """Of two numbers; `max` is a call that is not inlined."""
    return a if a > b else b


@quick
def smaller(a, b):
    return a if a < b else b


@quick
def length(x, y):
    """Of a vector in the plane."""
    return np.sqrt(x * x + y * y)
