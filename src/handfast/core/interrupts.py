"""Ctrl-C that comes while a module is imported is kept until it is there.

Libraries import their own parts within `except BaseException` (trimesh does), which swallows the interruption and
leaves them without the part; and Python ends by the signal itself, whatever is caught, if it came within `exec`.
"""

from __future__ import annotations

import signal
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SOON = 0.02  # [s] after which is looked again whether an import goes on


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


@contextmanager
def patient_interrupt() -> Iterator[None]:
    """Within it Ctrl-C waits for whatever is being imported: for programs, whose imports come late and everywhere."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    def handler(number: int, frame: FrameType | None) -> None:
        if _importing(frame):
            again = threading.Timer(SOON, interrupt_main)
            again.daemon = True
            again.start()
        else:
            before(number, frame)

    signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False
