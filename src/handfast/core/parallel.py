"""Items of work done in parallel: by processes or threads of this machine, or by a Dask cluster.

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
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar

from handfast.core.errors import InputError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

START = "fork" if sys.platform.startswith("linux") else "spawn"  # how multiprocessing begins a process here
DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl
POLL_INTERVAL = 0.1  # [s] between looks at a result: Ctrl-C is heard in between, and the time is looked at
LOOK = 0.005  # [s] between looks at a result of a cluster
ITEMS_AHEAD = 16  # items for each worker that are begun before the first result is taken,
AHEAD_IN_CLUSTER = 2  # and of a cluster that are sent before it is free: a message takes a while
SCHEDULER_TIMEOUT = 20.0  # [s] for a scheduler to answer

Shared = TypeVar("Shared")
Item = TypeVar("Item")
Result = TypeVar("Result")


def default_jobs() -> int:
    """All cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workers(ABC, Generic[Shared]):
    """Workers that share one object. A context: at its end nothing of it runs any more."""

    shared: Shared

    @property
    @abstractmethod
    def count(self) -> int:
        """How many items are done at a time, at this moment."""

    @property
    def alone(self) -> bool:
        """Does the caller do the work itself?"""
        return False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """End what runs."""

    @abstractmethod
    def run(
        self, function: Callable[[Shared, Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result | Died]]:
        """Every item with `function(shared, item)`, as they are done; items are drawn as there is room for them.

        An item whose process ends before it is done (killed, out of memory, a crash in compiled code) comes back with
        `Died`, and the others go on. What the function raises ends the run.

        Args:
            function: of a module or of a class, as it is sent by name.

        Raises:
            InputError: the workers are gone.
        """

    @abstractmethod
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


def workers_of(shared: Shared, jobs: int | None, scheduler: str | None) -> Workers[Shared]:
    """The workers of a Dask scheduler, if an address is given, or processes of this machine: all cores by default."""
    return DaskWorkers(shared, scheduler) if scheduler else WorkerPool(shared, jobs or default_jobs())


class WorkerPool(Workers[Shared]):
    """Processes or threads of this machine.

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
        self._pool: Any = None  # of threads
        self._processes: list[WorkerProcess[Any, Any]] = []
        self._idle: queue.SimpleQueue[WorkerProcess[Any, Any]] = queue.SimpleQueue()

    def __enter__(self) -> Self:
        if self.forked:
            self._begin()
        return self

    def close(self) -> None:
        for process in self._processes:
            process.kill()
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()
        for process in self._processes:
            process.pipe.close()
        self._processes, self._pool = [], None

    def _begin(self) -> None:
        if not self._processes:
            self._processes = [WorkerProcess(partial(_call, self.shared)) for _ in range(self.jobs)]

    @property
    def count(self) -> int:
        return self.jobs

    @property
    def alone(self) -> bool:
        return self.jobs == 1

    @property
    def forked(self) -> bool:
        """Are results sent from one process to another?"""
        return self.jobs > 1 and not self.threads

    def map(
        self,
        function: Callable[[Shared, Item], Result],
        items: Iterable[Item],
        *,
        until: float = float("inf"),
        ahead: int | None = None,
    ) -> Iterator[Result]:
        """As `Workers.map`."""
        if self.alone:
            for item in items:
                if time.monotonic() >= until:
                    return
                yield function(self.shared, item)
            return
        if self._pool is None:
            import multiprocessing.pool  # most commands need none of it

            for process in self._processes:
                self._idle.put(process)
            self._pool = multiprocessing.pool.ThreadPool(self.jobs)  # each process is waited for by a thread
        call = partial(function, self.shared) if self.threads else partial(self._sent, function)
        left, most = iter(items), ITEMS_AHEAD * self.jobs if ahead is None else ahead
        begun: deque[Any] = deque()
        while True:
            begun.extend(self._pool.apply_async(call, (item,)) for item in islice(left, most - len(begun)))
            if not begun:
                return
            while time.monotonic() < until and not begun[0].ready():
                begun[0].wait(POLL_INTERVAL)
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

    def run(
        self, function: Callable[[Shared, Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result | Died]]:
        """As `Workers.run`, by processes, a single one, too; where none can be forked the caller does the work."""
        if START != "fork":
            yield from ((item, function(self.shared, item)) for item in items)
            return
        from multiprocessing.connection import wait

        self._begin()
        left, busy = iter(items), dict[Any, tuple[WorkerProcess[Any, Any], Item]]()

        def give(process: WorkerProcess[Any, Any]) -> None:
            for item in left:
                try:
                    process.pipe.send((function, item))
                except OSError:  # it ended between two items, which is none of this item's doing
                    process.begin()
                    process.pipe.send((function, item))
                busy[process.pipe] = process, item
                return

        try:
            for process in self._processes:
                give(process)
            while busy:
                for pipe in wait(list(busy), POLL_INTERVAL):
                    process, item = busy.pop(pipe)
                    result = process.result()
                    if isinstance(result, Died):
                        process.begin()
                    give(process)  # before the caller looks at the result: nobody waits for that
                    yield item, result
        finally:
            if busy:
                self.close()


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


def _address_in(file: str) -> str:
    """The address in a scheduler file, read here: Dask waits for a file that is not there; raises `InputError`."""
    from handfast.core.files import read_json

    told = read_json(file, "scheduler file")
    if not (isinstance(told, dict) and isinstance(told.get("address"), str)):
        raise InputError("is missing; `dask scheduler --scheduler-file` writes it", source=file, field="address")
    return str(told["address"])


class DaskWorkers(Workers[Shared]):
    """The workers of a Dask cluster (`dask scheduler`, `dask worker`, dask-jobqueue), however many there are.

    An item whose worker is lost is begun again elsewhere by the scheduler; it has `Died` only when that happened to
    several workers (`distributed.scheduler.allowed-failures`).

    Args:
        shared: what every item is sent with.
        address: of the scheduler, such as `tcp://10.0.0.1:8786`, or the file that `--scheduler-file` names.

    Raises:
        InputError: Dask is not installed, or no scheduler answers there.
    """

    def __init__(self, shared: Shared, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError("needs Dask: pip install 'handfast[cluster]'", field="--scheduler") from None
        self.shared, self.address = shared, address
        where = _address_in(address) if address.endswith(".json") else address
        try:
            self._client = Client(where, timeout=SCHEDULER_TIMEOUT, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as fault:
            problem = f"no Dask scheduler answers ({' '.join(str(fault).split())[:100] or type(fault).__name__})"
            raise InputError(problem, source=address) from None

    @property
    def count(self) -> int:
        """How many items are done at a time, at this moment."""
        return max(1, sum(self._client.nthreads().values()))

    def map(
        self,
        function: Callable[[Shared, Item], Result],
        items: Iterable[Item],
        *,
        until: float = float("inf"),
        ahead: int | None = None,
    ) -> Iterator[Result]:
        """As `Workers.map`."""
        left, begun = iter(items), deque[Any]()
        try:
            while True:
                most = AHEAD_IN_CLUSTER * self.count if ahead is None else ahead
                for item in islice(left, most - len(begun)):
                    begun.append(self._client.submit(function, self.shared, item, pure=False))
                if not begun:
                    return
                while time.monotonic() < until and not begun[0].done():
                    time.sleep(LOOK)
                if time.monotonic() >= until:
                    return
                future = begun.popleft()
                result = self._result(future)
                future.release()
                if isinstance(result, Died):
                    raise RuntimeError(f"a worker is gone: {result.reason}")
                yield result
        finally:
            self._client.cancel(list(begun))

    def run(
        self, function: Callable[[Shared, Item], Result], items: Iterable[Item]
    ) -> Iterator[tuple[Item, Result | Died]]:
        from distributed import as_completed

        left = iter(items)
        begun: dict[str, Item] = {}
        done = as_completed(loop=self._client.loop)

        def send() -> None:
            room = AHEAD_IN_CLUSTER * self.count - len(begun)
            for item in left if room > 0 else ():
                future = self._client.submit(function, self.shared, item, pure=False)
                begun[future.key] = item
                done.add(future)
                room -= 1
                if room <= 0:
                    return

        send()
        while begun:
            future = next(done)
            item, result = begun.pop(future.key), self._result(future)
            future.release()
            send()
            yield item, result

    def _result(self, future: Any) -> Any:
        from distributed import KilledWorker

        try:
            return future.result()
        except KilledWorker as fault:
            return Died(f"it ended {getattr(fault, 'allowed_failures', 0) + 1} workers")
        except Exception:
            if future.status != "error":  # cancelled or lost: there is nobody who knows of it
                raise InputError("the scheduler is gone; begin it again and go on", source=self.address) from None
            raise

    def close(self) -> None:
        self._client.close(timeout=POLL_INTERVAL)
