"""Pieces of kernels that tests ask one by one."""

from __future__ import annotations

from typing import Any

from handfast.core.groups import table
from handfast.core.machine_code import Library


def asked(library: Library, name: str, *arguments: Any) -> int:
    """What an entry of a library returns: it takes numbers, and groups, some of which it writes to."""
    answer: int = getattr(library.functions, name)(*(table(x) if isinstance(x, tuple) else x for x in arguments))
    return answer
