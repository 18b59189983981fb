"""Work in a process of its own: results, faults and logs come back, and whatever ends the process is one line."""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import time
from typing import Any

import numpy as np
import pytest

from handfast.core import limited as module
from handfast.core.errors import InputError
from handfast.core.limited import TIMEOUT_REASON, limited, within
from tests.support.interruptions import python

LOG = logging.getLogger("handfast")
KINDS = [False, True]  # forked, a new interpreter
linux = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="others have no limit of memory")


def squared(numbers: Any) -> Any:
    print("nobody reads this")
    os.write(2, b"nor this")
    LOG.warning("squares of %d numbers", len(numbers))
    return numbers**2, os.getpid()


def refuses(what: str) -> None:
    LOG.warning("soon")
    raise InputError("is wrong", source="a file", field=what)


def fails() -> None:
    raise KeyError("a fault of ours")


def grows(by: int) -> None:
    kept = []
    while True:
        kept.append(bytes(by))


def spins() -> None:
    while True:
        pass


def ends(number: int) -> None:
    os.kill(os.getpid(), number)


def leaves() -> None:
    os._exit(3)


@pytest.mark.parametrize("new", KINDS)
def test_result_and_log_come_back_and_nothing_is_printed(
    new: bool, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    found, process = limited(squared, np.arange(1_000_000), new=new)  # more than a pipe holds
    assert np.array_equal(found, np.arange(1_000_000) ** 2)
    assert process != os.getpid()
    assert capfd.readouterr() == ("", "")
    assert caplog.messages == ["squares of 1000000 numbers"]


@pytest.mark.parametrize("new", KINDS)
def test_faults_come_back(new: bool, caplog: pytest.LogCaptureFixture) -> None:
    with pytest.raises(InputError, match=r"^a file: mass: is wrong$") as caught:
        limited(refuses, "mass", new=new)
    assert (caught.value.source, caught.value.field, caught.value.problem) == ("a file", "mass", "is wrong")
    assert caplog.messages == ["soon"]
    with pytest.raises(KeyError, match="a fault of ours") as fault:
        limited(fails, new=new)
    assert "in fails" in fault.value.__notes__[0]  # where it was


@linux
@pytest.mark.parametrize("new", KINDS)
@pytest.mark.parametrize("by", [1 << 24, 1 << 8])
def test_memory_ends(new: bool, by: int) -> None:
    with pytest.raises(InputError, match=r"^takes more than 0.0625 GiB of memory, or than there is$"):
        limited(grows, by, memory=1 << 26, new=new)
    assert limited(len, bytes(1 << 20), new=new) == 1 << 20  # and the caller has no limit


@pytest.mark.skipif(sys.platform == "win32", reason="it has no limit of processor time")
@pytest.mark.parametrize("new", KINDS)
def test_processor_time_ends(new: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CLOCK_FACTOR", 200)  # however little of the processor it gets
    with pytest.raises(InputError, match=r"^takes more than 1 s of processor time$"):
        limited(spins, seconds=1, new=new)


@pytest.mark.parametrize("new", KINDS)
def test_waiting_ends(new: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CLOCK_FACTOR", 1)
    with pytest.raises(InputError, match=r"^is not done after 1 s$"):
        limited(time.sleep, 3600, seconds=1, new=new)


@pytest.mark.parametrize("new", KINDS)
def test_time_given_for_all_ends(new: bool) -> None:
    """The nearer end counts, and it counts no more outside."""
    with within(3600), within(0.2), within(3600), pytest.raises(InputError, match=f"^{TIMEOUT_REASON}$"):
        limited(time.sleep, 3600, seconds=3600, new=new)
    assert limited(len, "abc", new=new) == 3


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
@pytest.mark.parametrize("new", KINDS)
def test_a_process_that_ends_is_one_line(new: bool) -> None:
    for number, name in ((signal.SIGSEGV, "SIGSEGV"), (signal.SIGABRT, "SIGABRT"), (signal.SIGKILL, "SIGKILL")):
        with pytest.raises(InputError, match=rf"^ends its process \({name}\): it is damaged, or takes more than 2 GiB"):
            limited(ends, int(number), new=new)
    with pytest.raises(InputError, match=r"^ends its process \(status 3\)"):
        limited(leaves, new=new)


@pytest.mark.skipif(sys.platform == "win32", reason="processes are waited for on POSIX")
def test_no_process_is_left() -> None:
    code = (
        "import os\n"
        "from handfast.core.limited import limited\n"
        "limited(len, 'abc')\n"
        "try: limited(os._exit, 3)\n"
        "except ValueError: pass\n"
        "try: os.waitpid(-1, os.WNOHANG)\n"
        "except ChildProcessError: print('none')\n"
    )
    done = python(code)
    assert done.stdout == "none\n"


def test_from_a_thread() -> None:
    found: list[int] = []
    threads = [threading.Thread(target=lambda n=n: found.append(limited(len, "x" * n))) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found) == [0, 1, 2, 3]


@pytest.mark.skipif(sys.platform == "win32", reason="signals are POSIX's")
def test_ctrl_c_ends_both() -> None:
    code = (
        "import os, signal\n"
        "from handfast.core.limited import limited\n"
        "def work():\n"
        "    os.write(told, str(os.getpid()).encode() + b'\\n')\n"
        "    os.kill(os.getppid(), signal.SIGINT)\n"
        "    while True: pass\n"
        "told = os.dup(1)\n"
        "try: limited(work)\n"
        "except KeyboardInterrupt: os.write(told, b'interrupted\\n')\n"
    )
    done = python(code)
    process, said = done.stdout.split()
    assert (said, done.returncode) == ("interrupted", 0)
    with pytest.raises(ProcessLookupError):
        os.kill(int(process), 0)
