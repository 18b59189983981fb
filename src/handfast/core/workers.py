"""Processes that work for another one: they leave Ctrl-C to it, and do not outlive it."""

from __future__ import annotations

import ctypes
import os
import signal
import sys

DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl


def serve(parent: int) -> None:
    """To be called first in a worker of the process `parent`.

    Whatever ends that process, kill -9 too, ends the worker. Only Linux can promise it; elsewhere none is forked.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != parent:  # it was gone before it could be told
            os._exit(1)
