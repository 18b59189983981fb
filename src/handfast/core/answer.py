"""What an answer is: a verdict, why the search stopped, and what its JSON begins with."""

from __future__ import annotations

from enum import StrEnum
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
