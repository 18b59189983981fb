"""An ordered parallel map: items of work go to processes or threads, and their results come back in order.

A process has a pipe of its own and shares no lock with others, so that it can be killed at any moment.

Where processes can be forked they inherit what they share, so that nothing of it has to be sent, and a caller's script
needs no guarded main module. Elsewhere, and with a single job, the caller does the work itself. Worker processes leave
Ctrl-C to the process that they work for, and do not outlive it.
"""

from __future__ import annotations

import os
import queue
import signal
import sys
import time
import traceback
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from handfast.core.errors import InputError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

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
        self._processes: list[WorkerProcess[Any, Any]] = []
        self._idle: queue.SimpleQueue[WorkerProcess[Any, Any]] = queue.SimpleQueue()

    def __enter__(self) -> WorkerPool[Shared]:
        if self.jobs <= 1:
            return self
        import multiprocessing.pool  # most commands need none of it

        if not self.threads:
            self._processes = [WorkerProcess(partial(_call, self.shared)) for _ in range(self.jobs)]
        for process in self._processes:
            self._idle.put(process)
        self._pool = multiprocessing.pool.ThreadPool(self.jobs)  # each process is waited for by a thread
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            for process in self._processes:
                process.kill()
            self._pool.terminate()
            self._pool.join()
            for process in self._processes:
                process.pipe.close()

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
        call = partial(function, self.shared) if self.threads else partial(self._sent, function)
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

    def _sent(self, function: Callable[[Shared, Item], Result], item: Item) -> Result:
        """The result of an item that a process is given."""
        process = self._idle.get()
        try:
            process.pipe.send((function, item))
            result = process.result()
        finally:
            self._idle.put(process)
        if isinstance(result, Died):
            raise RuntimeError(f"a worker is gone: {result.reason}")
        return result


@dataclass(frozen=True)
class Died:
    """What a task left whose process ended before it did: why, one line."""

    reason: str


class WorkerProcess(Generic[Item, Result]):
    """A process that does what is sent through `pipe`, one item after the other.

    Args:
        function: of an item, inherited.
    """

    pipe: Connection

    def __init__(self, function: Callable[[Item], Result]) -> None:
        self.function = function
        self.begin()

    def begin(self) -> None:
        """Begin it, or begin it again where it ended by itself."""
        import multiprocessing

        context = multiprocessing.get_context(START)
        self.pipe, theirs = context.Pipe()
        self.process: BaseProcess = context.Process(  # type: ignore[attr-defined]
            target=_serve, args=(os.getpid(), theirs, self.function), daemon=True
        )
        self.process.start()
        theirs.close()  # what is left of it is the process's own: the pipe ends with the process

    def result(self) -> Result | Died:
        """Of the item that was sent. Raises what the function raised."""
        try:
            good, result = self.pipe.recv()
        except (EOFError, OSError):
            self.process.join()
            return Died(_ending(self.process.exitcode))
        if not good:
            raise result
        return result

    def kill(self) -> None:
        """End it, whatever it does."""
        self.process.kill()
        self.process.join()


def _serve(parent: int, pipe: Connection, function: Callable[[Any], Any]) -> None:
    """What a process does: items in, results out, until its parent is gone."""
    end_with(parent)
    while True:
        item = pipe.recv()
        try:
            answer = True, function(item)
        except Exception as fault:
            if not isinstance(fault, InputError):
                fault.add_note(traceback.format_exc())
            answer = False, fault
        pipe.send(answer)


def _ending(code: int | None) -> str:
    """How a process ended, in words."""
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended with status {code}"


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


def _call(shared: Any, asked: tuple[Callable[[Any, Any], Any], Any]) -> Any:
    function, item = asked
    return function(shared, item)
