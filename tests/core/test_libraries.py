"""Ctrl-C within an import comes after it."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from _thread import interrupt_main
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from handfast.core import libraries
from handfast.core.libraries import deferred_interrupt, patient_interrupt


def test_it_is_kept_and_not_lost() -> None:
    done = []

    def swallowing() -> None:
        with deferred_interrupt():
            try:
                interrupt_main()
                done.append("all")
            except BaseException:
                done.append("swallowed")

    with pytest.raises(KeyboardInterrupt):
        swallowing()
    assert done == ["all"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_it_does_at_the_end_what_it_would_have_done() -> None:
    """Ends the process, where the system's own handling was asked for."""
    code = (
        "import signal; from handfast.core.libraries import deferred_interrupt as deferred;"
        "signal.signal(signal.SIGINT, signal.SIG_DFL)\n"
        "with deferred(): signal.raise_signal(signal.SIGINT); print('all', flush=True)\n"
        "print('more')"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stdout) == (-signal.SIGINT, "all\n")


def test_a_handler_that_python_does_not_know_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(signal, "getsignal", lambda number: None)
    with deferred_interrupt(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_nothing_comes_of_nothing() -> None:
    with deferred_interrupt():
        pass
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_error_goes_on_as_it_is() -> None:
    with pytest.raises(ImportError, match="none"), deferred_interrupt():
        raise ImportError("none")


def test_other_threads_leave_the_handler_alone() -> None:
    seen = []

    def other() -> None:
        with deferred_interrupt():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert seen == [signal.default_int_handler]


def test_a_program_lets_imports_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that swallows whatever comes while it is imported is whole, and then the interruption comes.

    Until then no timer is taken apart: what comes meanwhile is lost.
    """
    waiting: list[Look] = []
    gone: list[Look] = []

    class Look:
        """A timer whose time is over when the test says so."""

        def __init__(self, seconds: float, function: Callable[[], None]) -> None:
            assert seconds == libraries.IMPORT_WAIT
            self.function = function

        def start(self) -> None:
            waiting.append(self)

        def __del__(self) -> None:
            gone.append(self)

    def over() -> None:
        waiting.pop().function()

    monkeypatch.setattr(libraries, "threading", SimpleNamespace(**vars(threading) | {"Timer": Look}))
    monkeypatch.setitem(sys.modules, "time_of_look", SimpleNamespace(over=over))
    monkeypatch.delitem(sys.modules, "swallows", raising=False)  # where this test is run again in the same process
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "swallows.py").write_text(
        "import _thread, time_of_look\n"
        "try:\n"
        "    _thread.interrupt_main()\n"
        "    time_of_look.over()\n"
        "    time_of_look.over()\n"
        "    whole = True\n"
        "except BaseException:\n"
        "    whole = False\n"
    )
    done: list[object] = []

    def program() -> None:
        with patient_interrupt():
            import swallows

            done.extend([swallows.whole, len(waiting), len(gone)])
            over()
            done.append("too late")

    with pytest.raises(KeyboardInterrupt):
        program()
    assert done == [True, 1, 0]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
