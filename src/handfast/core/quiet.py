"""Silence of libraries that write to standard output, standard error or files of their own."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager


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
