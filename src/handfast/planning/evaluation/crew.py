"""The processes that work for `grasp_for`: copies of one worker, their results taken in order."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Iterator, Sequence
from typing import Any

from handfast.core.parallel import START
from handfast.core.parallel import end_with as serve
from handfast.planning.evaluation.local_search import Unit, Worker
from handfast.stability.hold import HoldAnswer
from handfast.synthesis.search.starts import Certified

WAIT = 0.1  # [s] between looks at a result: Ctrl-C is heard in between

_worker: Worker  # of the process that this is


class Crew:
    """As many copies of a worker as there are jobs; one job, or a platform that cannot copy a process, has none.

    A context: at its end the processes are gone.
    """

    def __init__(self, worker: Worker, jobs: int) -> None:
        self.worker = worker
        self.jobs = jobs if START == "fork" else 1
        self._pool: Any = None

    def __enter__(self) -> Crew:
        if self.jobs > 1:
            global _worker
            _worker = self.worker
            context = multiprocessing.get_context(START)
            self._pool = context.Pool(self.jobs, serve, (os.getpid(),))
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.terminate()
            self._pool.join()

    @property
    def alone(self) -> bool:
        """Whether this process does the work."""
        return self._pool is None

    def units(self, number: int = 0) -> Iterator[Unit]:
        """The results of units `number`, `number` + 1, ... until the worker is late."""
        if self._pool is None:
            while not self.worker.late():
                yield self.worker.run(number)
                number += 1
            return
        ahead = [self._pool.apply_async(_run, (number + k,)) for k in range(self.jobs)]
        number += len(ahead)
        while ahead:
            if not self.worker.late():
                ahead.append(self._pool.apply_async(_run, (number,)))
                number += 1
            yield _waited(ahead.pop(0))

    def proofs(self, found: Sequence[Certified]) -> list[HoldAnswer]:
        """`Worker.proof` of each."""
        if self._pool is None:
            return [self.worker.proof(certified) for certified in found]
        return [_waited(r) for r in [self._pool.apply_async(_proof, (certified,)) for certified in found]]


def _waited(result: Any) -> Any:
    while not result.ready():
        result.wait(WAIT)
    return result.get()


def _run(number: int) -> Unit:
    return _worker.run(number)


def _proof(certified: Certified) -> HoldAnswer:
    return _worker.proof(certified)
