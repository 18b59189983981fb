"""Signals at a counted step of the work, never after a time.

A step is a function that the work calls anyway. The signal comes at the end of a call, where Python hears one that came
during it if the function is compiled code.
"""

from __future__ import annotations

import itertools
import multiprocessing
import os
import pkgutil
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
LONGEST = 240.0  # [s] a program that does not end is ended, before the test that waits for it is
PROGRAM = f"""
import sys, pytest
from {__name__} import interrupt, ctrl_c, killed
from handfast.cli import main
step, call, action, *arguments = sys.argv[1:]
interrupt(pytest.MonkeyPatch(), step, int(call), {{"ctrl_c": ctrl_c, "killed": killed}}[action])
sys.exit(main(arguments))
"""


def ctrl_c() -> None:
    signal.raise_signal(signal.SIGINT)


def killed() -> None:
    """Print the processes that work for this one, and end as by `kill -9`."""
    print(*(child.pid for child in multiprocessing.active_children()), flush=True)
    signal.raise_signal(signal.SIGKILL)


def interrupt(patch: pytest.MonkeyPatch, step: str, call: int = 1, action: Callable[[], None] = ctrl_c) -> None:
    """Interrupt this process at the end of a step's n-th call in the main thread.

    Args:
        step: `package.module.function` or `package.module.Class.method`.
        call: n, from 1 on.
    """
    work, calls = pkgutil.resolve_name(step), itertools.count(1)

    @wraps(work)
    def counted(*args: Any, **options: Any) -> Any:
        result = work(*args, **options)
        if threading.current_thread() is threading.main_thread() and next(calls) == call:
            action()
        return result

    patch.setattr(step, counted)


def interrupted_program(
    step: str, call: int, *arguments: str, action: Callable[[], None] = ctrl_c
) -> subprocess.CompletedProcess[str]:
    """What the program said and how it ended, interrupted at the end of a step's n-th call."""
    return python(PROGRAM, step, str(call), action.__name__, *arguments)


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """What a process said that runs this code, which may import these tests, and how it ended."""
    command = [sys.executable, "-c", code, *arguments]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *filter(None, sys.path)])}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=LONGEST, check=False)
