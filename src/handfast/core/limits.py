"""The limits of a search: a wall clock and a number of nodes, looked at from outside between two of its steps."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf

from handfast.core.answer import Stop


class SearchLimits:
    """When a search has to end, counted from now on.

    Args:
        seconds: of wall time; None: any.
        nodes: that the search spends; None: any.
    """

    def __init__(self, seconds: float | None = None, nodes: int | None = None) -> None:
        self.begin = time.monotonic()
        self.end = inf if seconds is None else self.begin + seconds  # [s] of `time.monotonic`
        self._nodes = nodes

    @property
    def seconds(self) -> float:
        """[s] since it began."""
        return time.monotonic() - self.begin

    @property
    def seconds_left(self) -> float:
        """[s] 0 once the time is over, inf without a limit."""
        return max(self.end - time.monotonic(), 0.0)

    def nodes_left(self, spent: int) -> int | None:
        """None without a limit."""
        return None if self._nodes is None else max(self._nodes - spent, 0)

    @property
    def late(self) -> bool:
        """Is the time over?"""
        return time.monotonic() >= self.end

    def stop(self, spent: int) -> Stop | None:
        """The limit that is reached by a search that has spent this many nodes; None: it may go on."""
        if self._nodes is not None and spent >= self._nodes:
            return Stop.NODES
        return Stop.TIME if self.late else None

    @contextmanager
    def paused(self) -> Iterator[None]:
        """What is done meanwhile takes none of the time."""
        begin = time.monotonic()
        try:
            yield
        finally:
            self.end += time.monotonic() - begin
