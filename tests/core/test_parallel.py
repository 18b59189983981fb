"""Items of work: the same results in the same order whoever does it; one that ends its process is told."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from handfast.core import parallel
from handfast.core.errors import InputError
from handfast.core.parallel import DaskWorkers, Died, WorkerPool
from tests.support.interruptions import python

needs_fork = pytest.mark.skipif(parallel.START != "fork", reason="there are no workers")
WAYS = [pytest.param(1, False, id="alone"), pytest.param(3, True, id="threads")]
WAYS += [pytest.param(3, False, id="processes", marks=needs_fork)]


def scaled(factor: int, item: int) -> int:
    time.sleep(0.01 * (item % 3))  # the later ones are done first
    return factor * item


def refused(_: object, item: int) -> int:
    if item == 2:
        raise ValueError("two")
    return item


def worker(_: object, __: int) -> tuple[int, int]:
    time.sleep(0.02)
    return os.getpid(), threading.get_ident()


def endless(_: object, item: int) -> int:
    """The first item is done at once, the others never."""
    while item:
        time.sleep(1.0)
    return item


@pytest.mark.parametrize(("jobs", "threads"), WAYS)
def test_results_come_in_the_order_of_the_items(jobs: int, threads: bool) -> None:
    with WorkerPool(7, jobs, threads=threads) as pool:
        assert list(pool.map(scaled, range(40))) == [7 * i for i in range(40)]
        assert list(pool.map(scaled, [])) == []
        assert list(pool.map(scaled, range(5), ahead=1)) == [7 * i for i in range(5)]


@pytest.mark.parametrize(("jobs", "threads"), WAYS)
def test_an_error_is_raised_where_its_result_was_due(jobs: int, threads: bool) -> None:
    with WorkerPool(None, jobs, threads=threads) as pool:
        results = pool.map(refused, range(5))
        assert [next(results), next(results)] == [0, 1]
        with pytest.raises(ValueError, match="two"):
            next(results)


@pytest.mark.parametrize(("jobs", "threads"), WAYS)
def test_items_are_drawn_as_they_are_needed(jobs: int, threads: bool) -> None:
    drawn: list[int] = []

    def items() -> Iterator[int]:
        for i in range(10**9):
            drawn.append(i)
            yield i

    with WorkerPool(1, jobs, threads=threads) as pool:
        results = pool.map(scaled, items(), ahead=4)
        assert [next(results) for _ in range(3)] == [0, 1, 2]
    assert len(drawn) <= 7


def test_who_does_the_work() -> None:
    me = os.getpid(), threading.get_ident()
    with WorkerPool(None, 1) as pool:
        assert pool.alone
        assert set(pool.map(worker, range(3))) == {me}
    with WorkerPool(None, 2, threads=True) as pool:
        found = set(pool.map(worker, range(8)))
        assert not pool.alone
        assert not pool.forked
        assert {process for process, _ in found} == {me[0]}
        assert me not in found


@needs_fork
def test_processes_are_others_and_end_with_the_pool() -> None:
    with WorkerPool(None, 2) as pool:
        found = {process for process, _ in pool.map(worker, range(8))}
        assert pool.forked
        assert os.getpid() not in found
    for process in found:
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)


@needs_fork
def test_a_process_that_never_comes_back_ends_with_the_pool() -> None:
    before = set(multiprocessing.active_children())
    with WorkerPool(None, 2) as pool:
        assert next(pool.map(endless, range(3))) == 0
        assert len(set(multiprocessing.active_children()) - before) == 2
    assert set(multiprocessing.active_children()) <= before


def test_where_processes_cannot_be_forked_the_caller_works(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "START", "spawn")
    with WorkerPool(None, 4) as pool:
        assert pool.alone
        assert set(pool.map(worker, range(3))) == {(os.getpid(), threading.get_ident())}


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=needs_fork)])
def test_nothing_is_waited_for_once_the_time_is_up(jobs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    now = 0.0
    monkeypatch.setattr(parallel, "time", SimpleNamespace(monotonic=lambda: now))
    with WorkerPool(None, jobs) as pool:
        results = pool.map(endless, range(3), until=1.0)
        assert next(results) == 0
        now = 1.0
        assert list(results) == []


def deadly(_: object, item: int) -> int:
    if item == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


@needs_fork
def test_a_process_that_ends_is_an_error_and_not_waited_for() -> None:
    with WorkerPool(None, 2) as pool:
        results = pool.map(deadly, range(5))
        assert [next(results), next(results)] == [0, 1]
        with pytest.raises(RuntimeError, match="a worker is gone: its process was ended by SIGKILL"):
            next(results)


SENDING = """
from handfast.core.parallel import WorkerPool
def bulky(_, item):
    return bytes(100_000)  # more than a pipe holds
for _ in range(30):
    with WorkerPool(None, 3) as pool:
        print(len(next(pool.map(bulky, range(1000), ahead=40))))
"""


@needs_fork
@pytest.mark.slow
def test_a_pool_ends_while_its_processes_send_results() -> None:
    """In a process of its own: it is small, so that others are forked from it quickly."""
    assert python(SENDING).stdout.split() == 30 * ["100000"]


# --- items in any order, and processes that end by themselves ---------------------------------------


def product(factor: int, item: int) -> int:
    return factor * item


def ending(_: object, item: int) -> tuple[int, int]:
    """The third item kills its process, the fifth ends it."""
    if item == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 4:
        os._exit(7)
    return item, os.getpid()


def odd(_: object, item: int) -> int:
    raise InputError(f"item {item} is odd")


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_item_is_done_once(jobs: int) -> None:
    with WorkerPool(7, jobs) as workers:
        found = dict(workers.run(product, range(20)))
        assert found == {k: 7 * k for k in range(20)}
        assert list(workers.run(product, ())) == []
        assert workers.jobs == (jobs if parallel.START == "fork" else 1)


@needs_fork
def test_an_item_that_ends_its_process_is_named_and_the_others_are_done() -> None:
    with WorkerPool(1, 2) as workers:
        found = dict(workers.run(ending, range(8)))
    assert found[2] == Died("its process was ended by SIGKILL")
    assert found[4] == Died("its process ended with status 7")
    assert [found[k][0] for k in (0, 1, 3, 5, 6, 7)] == [0, 1, 3, 5, 6, 7]  # type: ignore[index]
    assert os.getpid() not in {found[k][1] for k in (0, 1, 3, 5, 6, 7)}  # type: ignore[index]


def test_what_a_task_raises_ends_the_run() -> None:
    with WorkerPool(1, 2) as workers, pytest.raises(InputError, match="item 0 is odd"):
        list(workers.run(odd, [0]))


@needs_fork
def test_items_of_a_run_are_drawn_as_there_is_room() -> None:
    drawn: list[int] = []

    def items() -> Iterator[int]:
        for k in range(10**9):
            drawn.append(k)
            yield k

    with WorkerPool(1, 2) as workers:
        run = workers.run(product, items())
        assert {next(run)[0] for _ in range(3)} <= set(range(6))
    assert len(drawn) <= 6


def test_dask_does_the_same() -> None:
    distributed = pytest.importorskip("distributed")
    quiet = {"dashboard_address": None, "silence_logs": 50}
    with (
        distributed.LocalCluster(1, threads_per_worker=1, processes=False, **quiet) as cluster,
        DaskWorkers(3, cluster.scheduler_address) as workers,
    ):
        assert workers.count == 1
        assert dict(workers.run(product, range(5))) == {k: 3 * k for k in range(5)}
        assert list(workers.map(product, range(7))) == [3 * k for k in range(7)]
        assert list(workers.map(product, range(7), until=0.0)) == []
        with pytest.raises(InputError, match="item 0 is odd"):
            list(workers.map(odd, [0]))
        with pytest.raises(InputError, match="item 0 is odd"):
            list(workers.run(odd, [0]))


def test_no_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("handfast.core.parallel.SCHEDULER_TIMEOUT", 0.5)
    with pytest.raises(InputError, match=r"tcp://127.0.0.1:1: no Dask scheduler answers \("):
        DaskWorkers(None, "tcp://127.0.0.1:1")


@pytest.mark.parametrize(
    ("text", "fault"), [(None, "no such file"), ("{", "is not valid JSON"), ("{}", "address: is missing")]
)
def test_a_scheduler_file_that_says_nothing_is_one_line(tmp_path: Path, text: str | None, fault: str) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "dask.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=fault):
        DaskWorkers(None, str(file))
