"""Ctrl-C that comes while a library is imported is kept until it is there.

Libraries import their own parts within `except BaseException` (trimesh does), which swallows the interruption and
leaves them without the part.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def deferred_interrupt() -> Iterator[None]:
    """Within it Ctrl-C is kept, and comes at its end. Other threads than the main one receive none anyway."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    came: list[tuple[int, Any]] = []
    before = signal.signal(signal.SIGINT, lambda *signalled: came.append(signalled))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before if before is not None else signal.SIG_DFL)
        if came and callable(before):
            before(*came[-1])
