"""Foreign files are read in a process of their own, with limits of memory and time.

Libraries that read the files of strangers (MuJoCo's compiler, trimesh, CoACD) take what a file of a hundred bytes asks
for: all memory, no end, or a crash in compiled code. Here all of it ends the process that reads, never the one that
asked, which has one line to say. On Linux that process is forked, in some milliseconds, and has what is imported
already; elsewhere, and where a library must not be forked, a new interpreter begins, in about a second.

Limits are the system's: bytes of memory that can be written to (RLIMIT_DATA, which Linux alone keeps), seconds of
processor time (RLIMIT_CPU, not on Windows), so that a busy machine refuses nothing. A wall clock, `CLOCK_FACTOR` times
as long, ends everywhere what waits instead of working, and is the only limit on Windows.
"""

from __future__ import annotations

import faulthandler
import logging
import math
import os
import pickle
import select
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any, TypeVar

from handfast.core import parallel
from handfast.core.errors import InputError

if sys.platform != "win32":
    import resource

EXTRA_MEMORY = 2 << 30  # [bytes] beyond what is there at the beginning
CPU_SECONDS = 30  # of processor time
CLOCK_FACTOR = 5  # times as long is waited
TIMEOUT_REASON = "is not done in the time that was given"
LOG = logging.getLogger("handfast")
_NEW = "import sys; sys.path[:] = sys.argv[4:]; from handfast.core.limited import main; main(*map(int, sys.argv[1:4]))"

_UNTIL: ContextVar[float] = ContextVar("_UNTIL", default=math.inf)  # on the monotonic clock

Result = TypeVar("Result")
Limits = tuple[int, int]  # bytes of memory, seconds of processor time


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """A context in which `limited` refuses what is not done when so many seconds have passed, whatever it works on."""
    before = _UNTIL.set(min(_UNTIL.get(), time.monotonic() + seconds))
    try:
        yield
    finally:
        _UNTIL.reset(before)


def limited(
    function: Callable[..., Result],
    *arguments: Any,
    memory: int = EXTRA_MEMORY,
    seconds: int = CPU_SECONDS,
    threads: int = 1,
    new: bool = False,
) -> Result:
    """`function(*arguments)`, done by a process that ends with it; what it logs is logged here.

    Args:
        function: of a module, and its arguments such that they can be pickled, as its result.
        memory: [bytes] that it may take.
        seconds: of processor time for each of its threads; `CLOCK_FACTOR` times as long by the clock.
        threads: that it may use all the time.
        new: in a new interpreter, for libraries that do not work in a forked process.

    Raises:
        InputError: it takes more memory or time, or ends its process; one line, without the name of a file.
        Exception: what the function raises.
    """
    forked = parallel.START == "fork" and not new
    wait, left = float(CLOCK_FACTOR * seconds), max(_UNTIL.get() - time.monotonic(), parallel.POLL_INTERVAL)
    limits = memory, seconds * threads
    reply, code = (_forked if forked else _begun)(function, arguments, limits, min(wait, left))
    if code is None and left < wait:
        raise InputError(TIMEOUT_REASON)
    if code != 0 or not reply:
        raise InputError(_ending(code, memory, seconds))
    good, result, records = pickle.loads(reply)  # of our own process
    for record in records:
        logging.getLogger(record.name).handle(record)
    if not good:
        raise result
    return result


def _forked(function: Callable[..., Any], arguments: Any, limits: Limits, wait: float) -> tuple[bytes, int | None]:
    """The reply of a forked process and how it ended: 0 with its whole reply, None if it did not in time."""
    ours, theirs = os.pipe()
    parent, process = os.getpid(), os.fork()
    if not process:
        with suppress(BaseException):  # nothing of the caller goes on here
            parallel.end_with(parent)
            _silence()
            with open(theirs, "wb") as file:
                file.write(_reply(function, arguments, limits))
            os._exit(0)
        os._exit(1)
    os.close(theirs)
    late = True
    try:
        reply = _received(ours, time.monotonic() + wait)
        late = reply is None
    finally:
        os.close(ours)
        if late:  # or Ctrl-C came
            os.kill(process, signal.SIGKILL)
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    return (b"", None) if reply is None else (reply, code)


def _received(pipe: int, until: float) -> bytes | None:
    """All that comes through a pipe until it is closed; None if that is not in time."""
    poll = select.poll()
    parts: list[bytes] = []
    poll.register(pipe, select.POLLIN)
    while time.monotonic() < until:
        if poll.poll(1000 * parallel.POLL_INTERVAL):
            part = os.read(pipe, 1 << 20)
            if not part:
                return b"".join(parts)
            parts.append(part)
    return None


def _begun(function: Callable[..., Any], arguments: Any, limits: Limits, wait: float) -> tuple[bytes, int | None]:
    """As `_forked`, of a new interpreter."""
    numbers = [str(number) for number in (os.getpid(), *limits)]
    command = [sys.executable, "-P", "-c", _NEW, *numbers, *(os.path.abspath(path) for path in sys.path)]
    asked = pickle.dumps((function, arguments))
    try:
        done = subprocess.run(command, input=asked, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=wait)
    except subprocess.TimeoutExpired:
        return b"", None
    return done.stdout, done.returncode


def main(parent: int, memory: int, seconds: int) -> None:
    """What a new interpreter does: the question comes on standard input, the reply goes to standard output."""
    parallel.end_with(parent)
    asked, out = sys.stdin.buffer.read(), os.dup(1)
    _silence()
    function, arguments = pickle.loads(asked)
    reply = _reply(function, arguments, (memory, seconds))
    with open(out, "wb") as file:
        file.write(reply)


def _silence() -> None:
    """Nothing that libraries print is seen."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    sys.stdout = sys.stderr = os.fdopen(nothing, "w")
    faulthandler.disable()  # a crash is told by the one that asked


class _Kept(logging.Handler):
    """What is logged, in a list."""

    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        record.msg, record.args, record.exc_info = record.getMessage(), None, None  # can be pickled
        self.records.append(record)


def _reply(function: Callable[..., Any], arguments: Any, limits: Limits) -> bytes:
    """Whether it is done, the result or what was raised, and what was logged, pickled."""
    kept = _Kept()
    LOG.handlers, LOG.propagate = [kept], False
    _limit(*limits)
    try:
        try:
            return pickle.dumps((True, function(*arguments), kept.records), pickle.HIGHEST_PROTOCOL)
        except MemoryError:
            _unlimit()  # what is to be said takes memory, too
            raise InputError(f"takes more than {limits[0] / (1 << 30):g} GiB of memory, or than there is") from None
    except Exception as fault:
        if not isinstance(fault, InputError):
            fault.add_note(traceback.format_exc())
        return pickle.dumps((False, fault, kept.records))


def _limit(memory: int, seconds: int) -> None:
    """The limits of this process, as far as the system has them."""
    if sys.platform == "win32":
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    used = resource.getrusage(resource.RUSAGE_SELF)
    _lower(resource.RLIMIT_CPU, int(used.ru_utime + used.ru_stime) + seconds)
    if sys.platform.startswith("linux"):
        with open("/proc/self/statm") as file:
            data = int(file.read().split()[5])  # pages that it can write to and shares with nobody
        _lower(resource.RLIMIT_DATA, data * resource.getpagesize() + memory)


def _lower(kind: int, limit: int) -> None:
    if sys.platform == "win32":
        return
    hard = resource.getrlimit(kind)[1]
    resource.setrlimit(kind, (limit if hard == resource.RLIM_INFINITY else min(limit, hard), hard))


def _unlimit() -> None:
    """Take as much memory as the caller may."""
    if sys.platform == "win32":
        return
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _ending(code: int | None, memory: int, seconds: int) -> str:
    """Why there is no whole reply."""
    if code is None:
        return f"is not done after {CLOCK_FACTOR * seconds} s"
    if sys.platform != "win32" and code == -signal.SIGXCPU:
        return f"takes more than {seconds} s of processor time"
    name = signal.Signals(-code).name if code < 0 else f"status {code}"
    return f"ends its process ({name}): it is damaged, or takes more than {memory / (1 << 30):g} GiB of memory"
