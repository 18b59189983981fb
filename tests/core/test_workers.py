"""Workers: every item once, in whatever order; one that ends its process is told from the others."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from handfast.core import parallel
from handfast.core.errors import InputError
from handfast.core.workers import DaskWorkers, Died, ProcessWorkers

forks = pytest.mark.skipif(parallel.START != "fork", reason="processes cannot be forked here")


def product(factor: int, item: int) -> int:
    return factor * item


def deadly(item: int) -> tuple[int, int]:
    """The third item kills its process, the fifth ends it."""
    if item == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if item == 4:
        os._exit(7)
    return item, os.getpid()


def refused(item: int) -> int:
    raise InputError(f"item {item} is odd")


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_item_is_done_once(jobs: int) -> None:
    with ProcessWorkers(jobs) as workers:
        found = dict(workers.run(partial(product, 7), range(20)))
        assert found == {k: 7 * k for k in range(20)}
        assert list(workers.run(partial(product, 7), ())) == []
        assert workers.count == (jobs if parallel.START == "fork" else 1)


@forks
def test_an_item_that_ends_its_process_is_named_and_the_others_are_done() -> None:
    with ProcessWorkers(2) as workers:
        found = dict(workers.run(deadly, range(8)))
    assert found[2] == Died("its process was ended by SIGKILL")
    assert found[4] == Died("its process ended with status 7")
    assert [found[k][0] for k in (0, 1, 3, 5, 6, 7)] == [0, 1, 3, 5, 6, 7]  # type: ignore[index]
    assert os.getpid() not in {found[k][1] for k in (0, 1, 3, 5, 6, 7)}  # type: ignore[index]


def test_what_a_task_raises_ends_the_run() -> None:
    with ProcessWorkers(2) as workers, pytest.raises(InputError, match="item 0 is odd"):
        list(workers.run(refused, [0]))


@forks
def test_items_are_drawn_as_there_is_room() -> None:
    drawn: list[int] = []

    def items() -> Iterator[int]:
        for k in range(10**9):
            drawn.append(k)
            yield k

    with ProcessWorkers(2) as workers:
        run = workers.run(partial(product, 1), items())
        assert {next(run)[0] for _ in range(3)} <= set(range(6))
    assert len(drawn) <= 6


def test_dask_does_the_same() -> None:
    distributed = pytest.importorskip("distributed")
    quiet = {"dashboard_address": None, "silence_logs": 50}
    with (
        distributed.LocalCluster(1, threads_per_worker=1, processes=False, **quiet) as cluster,
        DaskWorkers(cluster.scheduler_address) as workers,
    ):
        assert workers.count == 1
        assert dict(workers.run(partial(product, 3), range(5))) == {k: 3 * k for k in range(5)}
        with pytest.raises(InputError, match="item 0 is odd"):
            list(workers.run(refused, [0]))


def test_no_scheduler_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("handfast.core.workers.PATIENCE", 0.5)
    with pytest.raises(InputError, match=r"tcp://127.0.0.1:1: no Dask scheduler answers \("):
        DaskWorkers("tcp://127.0.0.1:1")


@pytest.mark.parametrize(
    ("text", "fault"), [(None, "no such file"), ("{", "is not valid JSON"), ("{}", "address: is missing")]
)
def test_a_scheduler_file_that_says_nothing_is_one_line(tmp_path: Path, text: str | None, fault: str) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "dask.json"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=fault):
        DaskWorkers(str(file))
