"""An ordered parallel map: items of work go to processes or threads, and their results come back in order.

Where processes can be forked they inherit what they share, so that nothing of it has to be sent, and a caller's script
needs no guarded main module. Elsewhere, and with a single job, the caller does the work itself. Worker processes leave
Ctrl-C to the process that they work for, and do not outlive it.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import islice
from typing import Any, Generic, TypeVar

from handfast.core.errors import InputError

START = "fork" if sys.platform.startswith("linux") else "spawn"  # how multiprocessing begins a process here
DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl
WAIT = 0.1  # [s] between looks at a result: Ctrl-C is heard in between, and the time is looked at
AHEAD = 16  # items for each worker that are begun before the first result is taken

Shared = TypeVar("Shared")
Item = TypeVar("Item")
Result = TypeVar("Result")


def default_jobs() -> int:
    """All cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class WorkerPool(Generic[Shared]):
    """Workers that share one object. A context: at its end the processes are gone.

    Args:
        shared: what every worker has; a process has a copy.
        jobs: how many workers.
        threads: threads instead of processes, for work that holds no interpreter lock.

    Raises:
        InputError: less than one worker.
    """

    def __init__(self, shared: Shared, jobs: int, *, threads: bool = False) -> None:
        if jobs < 1:
            raise InputError(f"is {jobs}; at least 1 is needed", field="jobs")
        self.shared, self.threads = shared, threads
        self.jobs = jobs if threads or START == "fork" else 1
        self._pool: Any = None

    def __enter__(self) -> WorkerPool[Shared]:
        if self.jobs <= 1:
            return self
        import multiprocessing.pool  # most commands need none of it

        if self.threads:
            self._pool = multiprocessing.pool.ThreadPool(self.jobs)
        else:
            context = multiprocessing.get_context(START)
            self._pool = context.Pool(self.jobs, _begin, (os.getpid(), self.shared))  # inherited, not sent
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()

    @property
    def alone(self) -> bool:
        """Does the caller do the work itself?"""
        return self._pool is None

    @property
    def forked(self) -> bool:
        """Are results sent from one process to another?"""
        return self._pool is not None and not self.threads

    def map(
        self,
        function: Callable[[Shared, Item], Result],
        items: Iterable[Item],
        *,
        until: float = float("inf"),
        ahead: int | None = None,
    ) -> Iterator[Result]:
        """`function(shared, item)` of each item, in the order of the items; items are drawn as they are needed.

        Args:
            function: of a module or of a class, as it is sent by name.
            until: on the monotonic clock; nothing is begun or waited for after that.
            ahead: items that are begun before the first result is taken.
        """
        if self._pool is None:
            for item in items:
                if time.monotonic() >= until:
                    return
                yield function(self.shared, item)
            return
        call = partial(function, self.shared) if self.threads else partial(_call, function)
        left, most = iter(items), AHEAD * self.jobs if ahead is None else ahead
        begun: deque[Any] = deque()
        while True:
            begun.extend(self._pool.apply_async(call, (item,)) for item in islice(left, most - len(begun)))
            if not begun:
                return
            while time.monotonic() < until and not begun[0].ready():
                begun[0].wait(WAIT)
            if time.monotonic() >= until:
                return
            yield begun.popleft().get()


def end_with(parent: int) -> None:
    """To be called first in a process that works for the process `parent`.

    Whatever ends that process, kill -9 too, ends this one. Only Linux can promise it; elsewhere none is forked.
    """
    import ctypes

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != parent:  # it was gone before it could be told
            os._exit(1)


_shared: Any  # of the process that this is


def _begin(parent: int, shared: Any) -> None:
    global _shared
    end_with(parent)
    _shared = shared


def _call(function: Callable[[Any, Any], Any], item: Any) -> Any:
    return function(_shared, item)
