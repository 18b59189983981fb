"""Workers for tasks that depend on nothing but themselves: processes of this machine, or those of a Dask cluster.

Both have one method, `run`, which hands out tasks as there is room and gives back what became of each as it is done, in
any order. A task whose process ends before it does (killed, out of memory, a crash in compiled code) comes back as
`Died`, and the others go on. What a task raises ends the run: a function that is to survive bad items says so in its
result.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from types import TracebackType
from typing import Any, TypeVar

from handfast.core import parallel
from handfast.core.errors import InputError
from handfast.core.parallel import Died, WorkerProcess

WAIT = 0.1  # [s] between two looks, so that Ctrl-C is heard
PATIENCE = 20.0  # [s] for a scheduler to answer
AHEAD = 2  # tasks for each worker of a cluster that are sent before it is free: a message takes a while
COMMAND = "handfast[cluster]"

Item = TypeVar("Item")
Result = TypeVar("Result")


class Workers(ABC):
    """A context; at its end nothing of it runs any more."""

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, kind: type[BaseException] | None, fault: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """End what runs."""

    @property
    @abstractmethod
    def count(self) -> int:
        """How many tasks are done at a time, at this moment."""

    @abstractmethod
    def run(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[tuple[Item, Result | Died]]:
        """Every item with `function(item)`, as they are done; items are drawn as there is room for them.

        Args:
            function: of a module, or a `partial` of one: a cluster is told it by its name.

        Raises:
            InputError: the workers are gone.
        """


class ProcessWorkers(Workers):
    """Processes of this machine, one task each at a time. Where none can be forked the caller does the work.

    Args:
        jobs: how many.
    """

    def __init__(self, jobs: int) -> None:
        self.jobs = jobs if parallel.START == "fork" else 1
        self._crew: list[_Hand[Any, Any]] = []

    @property
    def count(self) -> int:
        return self.jobs

    def run(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[tuple[Item, Result | Died]]:
        left = iter(items)
        if parallel.START != "fork":
            yield from ((item, function(item)) for item in left)
            return
        from multiprocessing.connection import wait

        self._crew = [_Hand(function) for _ in range(self.jobs)]
        busy = {p.pipe: p for p in self._crew if p.take(left)}
        while busy:
            for pipe in wait(list(busy), WAIT):
                process = busy.pop(pipe)  # type: ignore[call-overload]
                item, result = process.item, process.result()
                if isinstance(result, Died):
                    process.begin()
                if process.take(left):  # before the caller looks at the result: nobody waits for that
                    busy[process.pipe] = process
                yield item, result
        self.close()

    def close(self) -> None:
        for process in self._crew:
            process.kill()
            process.pipe.close()
        self._crew = []


class _Hand(WorkerProcess[Item, Result]):
    """A process and the `item` that it has in hand."""

    item: Item

    def take(self, left: Iterator[Item]) -> bool:
        """Give it the next item; False if there is none."""
        for item in left:
            self.item = item
            try:
                self.pipe.send(item)
            except OSError:  # it ended between two items, which is none of this item's doing
                self.begin()
                self.pipe.send(item)
            return True
        return False


def _address_in(file: str) -> str:
    """The address in a scheduler file, read here: Dask waits for a file that is not there; raises `InputError`."""
    from handfast.core.files import read_json

    told = read_json(file, "scheduler file")
    if not (isinstance(told, dict) and isinstance(told.get("address"), str)):
        raise InputError("is missing; `dask scheduler --scheduler-file` writes it", source=file, field="address")
    return str(told["address"])


class DaskWorkers(Workers):
    """The workers of a Dask cluster (`dask scheduler`, `dask worker`, dask-jobqueue), however many there are.

    A task whose worker is lost is begun again elsewhere by the scheduler; it has `Died` only when that happened to
    several workers (`distributed.scheduler.allowed-failures`).

    Args:
        address: of the scheduler, such as `tcp://10.0.0.1:8786`, or the file that `--scheduler-file` names.

    Raises:
        InputError: Dask is not installed, or no scheduler answers there.
    """

    def __init__(self, address: str) -> None:
        try:
            from distributed import Client
        except ImportError:
            raise InputError(f"needs Dask: pip install '{COMMAND}'", field="--scheduler") from None
        self.address, where = address, _address_in(address) if address.endswith(".json") else address
        try:
            self._client = Client(where, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as fault:
            problem = f"no Dask scheduler answers ({' '.join(str(fault).split())[:100] or type(fault).__name__})"
            raise InputError(problem, source=address) from None

    @property
    def count(self) -> int:
        return max(1, sum(self._client.nthreads().values()))

    def run(self, function: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[tuple[Item, Result | Died]]:
        from distributed import as_completed

        left = iter(items)
        begun: dict[str, Item] = {}
        done = as_completed(loop=self._client.loop)

        def send() -> None:
            room = AHEAD * self.count - len(begun)
            for item in left if room > 0 else ():
                future = self._client.submit(function, item, pure=False)
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
        self._client.close(timeout=WAIT)
