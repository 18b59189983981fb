"""Libraries kept in order: nothing of their own on standard output, and Ctrl-C that waits while they are imported.

Libraries import their own parts within `except BaseException` (trimesh does), which swallows the interruption and
leaves them without the part; and Python ends by the signal itself, whatever is caught, if it came within `exec`. Ctrl-C
also waits for threads that write to the same arrays.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import FrameType
from typing import Any

from handfast.core.errors import InputError

IMPORT_WAIT = 0.02  # [s] after which is looked again whether an import goes on


def optional(module: str, problem: str, source: object = None) -> Any:
    """A package that need not be installed; `InputError` that says what to do if it is not."""
    try:
        return import_module(module)
    except ImportError:
        raise InputError(problem, source=None if source is None else str(source)) from None


@contextmanager
def deferred_interrupt() -> Iterator[None]:
    """Within it Ctrl-C is kept, and comes at its end, whatever it does then.

    Other threads than the main one receive none anyway; where Python does not know who hears it, it is not kept.
    """
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is None:
        yield
        return
    came: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def patient_interrupt() -> Iterator[None]:
    """Within it Ctrl-C waits for whatever is being imported: for programs, whose imports come late and everywhere."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    looks: list[threading.Timer] = []  # kept: Python drops what is raised while a thread's object is taken apart

    def handler(number: int, frame: FrameType | None) -> None:
        if _importing(frame):
            again = threading.Timer(IMPORT_WAIT, interrupt_main)
            again.daemon = True
            looks.append(again)
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


@contextmanager
def quiet() -> Iterator[None]:
    """Without warnings of mujoco, also in a file: what is wrong with a model is found by those who read it."""
    import mujoco  # slow to import

    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)


@contextmanager
def silent(descriptor: int) -> Iterator[None]:
    """Nothing is written to a file descriptor, 1 or 2: for compiled libraries, which know no `sys.stdout`."""
    (sys.stdout if descriptor == 1 else sys.stderr).flush()
    saved = os.dup(descriptor)
    sink = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(sink, descriptor)
        yield
    finally:
        os.dup2(saved, descriptor)
        os.close(saved)
        os.close(sink)
