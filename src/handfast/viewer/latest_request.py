"""A thread that works at the newest request, and passes over those that came between."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable
from typing import Generic, TypeVar

from handfast.core.errors import InputError

T = TypeVar("T")
Work = Callable[[T, Callable[[], bool]], None]


class LatestRequest(Generic[T]):
    """Work on what was asked last, in a thread of its own.

    Args:
        work: called with a request and with a function that says whether a newer one waits.
        failed: called with a fault that `work` raised; the thread goes on.
    """

    def __init__(self, work: Work[T], failed: Callable[[Exception], None]) -> None:
        self._work, self._failed = work, failed
        self._changed = threading.Condition()
        self._waiting: list[T] = []  # one at most
        self._since: float | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="handfast-view", daemon=True)
        self._thread.start()

    def ask(self, request: T) -> None:
        """Let it be the next; what waits is passed over."""
        with self._changed:
            self._waiting[:] = [request]
            self._since = self._since or time.monotonic()
            self._changed.notify()

    @property
    def waited(self) -> float:
        """[s] for which something has been asked without an answer; 0 if all is answered. `answered` ends it."""
        with self._changed:
            return 0.0 if self._since is None else time.monotonic() - self._since

    def answered(self) -> None:
        """What is worked at has a first answer."""
        with self._changed:
            self._since = time.monotonic() if self._waiting else None

    def outdated(self) -> bool:
        """Does a newer request wait, or is it over?"""
        with self._changed:
            return bool(self._waiting) or self._closed

    def close(self) -> None:
        """No more requests; what is worked at hears that it is outdated."""
        with self._changed:
            self._closed = True
            self._changed.notify()
        self._thread.join(timeout=5.0)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._closed)
                if self._closed:
                    return
                request = self._waiting.pop()
            try:
                self._work(request, self.outdated)
            except Exception as fault:
                if not isinstance(fault, InputError):  # which says all there is to say
                    traceback.print_exc()
                self.answered()
                self._failed(fault)
