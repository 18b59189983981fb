"""What an answer is: a verdict, why the search stopped, what its JSON begins with; and the limits of a search."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from math import inf
from typing import Any, Protocol, TypeVar


class Verdict(StrEnum):
    """Does the grasp resist?"""

    HOLDS = "holds"  # an exact solution of the model was found and checked
    SLIPS = "slips"  # no solution exists
    UNDECIDED = "undecided"  # neither was shown; a limit was hit or the numbers did not suffice


class Reach(StrEnum):
    """Can the hand take the hold?"""

    FOUND = "found"  # a configuration was found and proved to exist
    NONE = "none"  # every part of the space was discarded by verified arithmetic
    UNDECIDED = "undecided"  # neither was shown; a limit was hit


class Stop(StrEnum):
    """Why the search ended."""

    COMPLETE = "complete"  # it answered as precisely as it was asked
    TIME = "time"  # the time limit
    NODES = "nodes"  # the node limit
    INTERRUPTED = "interrupted"  # Ctrl-C
    # of Algorithm 1: the finest sectors were reached and the bounds are still apart; of many configurations: no
    # further ones were met that differ
    RESOLUTION = "resolution"
    FRUITLESS = "fruitless"  # so many candidates came to nothing that no more were drawn
    NUMERICAL = "numerical"  # rounding left a case open, or a solver's answer did not stand up to the check


class Timed(Protocol):
    """Anything with a verdict and a cost."""

    @property
    def verdict(self) -> StrEnum: ...
    @property
    def stop(self) -> Stop: ...
    @property
    def seconds(self) -> float: ...
    @property
    def nodes(self) -> int: ...


class _Stopped(Protocol):
    @property
    def stop(self) -> Stop: ...


A = TypeVar("A", bound=_Stopped)


def uninterrupted(answer: A) -> A:
    """An answer as it is; `KeyboardInterrupt` if Ctrl-C ended it: for what is made of whole answers only."""
    if answer.stop is Stop.INTERRUPTED:
        raise KeyboardInterrupt
    return answer


def header(answer: Timed, query: str) -> dict[str, Any]:
    """The keys that every answer's JSON begins with."""
    return {
        "schema": "handfast/answer/1",
        "query": query,
        "verdict": str(answer.verdict),
        "stop": str(answer.stop),
        "seconds": round(answer.seconds, 6),
        "nodes": answer.nodes,
    }


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
