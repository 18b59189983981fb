"""Ctrl-C within an import comes after it."""

from __future__ import annotations

import signal
import threading
import time
from _thread import interrupt_main
from pathlib import Path

import pytest

from handfast.core.interrupts import deferred_interrupt, patient_interrupt


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
    """A module that swallows whatever comes while it is imported is whole, and then the interruption comes."""
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "swallows.py").write_text(
        "import _thread, time\n"
        "try:\n"
        "    _thread.interrupt_main()\n"
        "    time.sleep(0.1)\n"
        "    whole = True\n"
        "except BaseException:\n"
        "    whole = False\n"
    )

    def program() -> None:
        with patient_interrupt():
            import swallows

            done.append(swallows.whole)
            time.sleep(5)

    done: list[bool] = []
    with pytest.raises(KeyboardInterrupt):
        program()
    assert done == [True]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
