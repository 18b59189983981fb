"""How a query is solved, and what it tells while it runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from handfast.core.errors import InputError, refuse_other_kinds
from handfast.core.parallel import default_jobs as default_jobs

MIN_SEARCH_TIME = 1e-3  # [s] that a search has where no time is left
INF = float("inf")
Loading = Literal["together", "preload-first"]  # commands and load at once, or first the commands, then the load


@dataclass(frozen=True)
class Settings:
    """How a query is solved.

    Attributes:
        gap: relative distance between witnessed and certified bound at which a maximum or an optimal
            torque is precise enough.
        timeout: [s] for one query.
        nodes: for one query.
        jobs: cores for one question, 1 or 2; 0 takes two where there are two. They change nothing but the
            time.
        verify: replay every proof with the independent checker before it is answered; what does not
            pass is searched again more finely. Many questions are quicker without, and their answers say so.

    Raises:
        InputError: limits that are not positive.
    """

    gap: float = 1e-3
    timeout: float = INF
    nodes: float = INF
    jobs: int = 0
    verify: bool = True

    def __post_init__(self) -> None:
        refuse_other_kinds(self)
        if not self.gap > 0:
            raise InputError(f"is {self.gap:g}; a positive number is needed", field="gap")
        if not self.timeout > 0:
            raise InputError(f"is {self.timeout:g} s; a positive number is needed", field="timeout")
        if not self.nodes > 0:
            raise InputError(f"is {self.nodes:g}; a positive number is needed", field="nodes")
        if self.jobs not in (0, 1, 2):
            raise InputError(f"is {self.jobs}; 1 or 2 is possible, or 0 for as many as there are", field="jobs")


@dataclass(frozen=True)
class Progress:
    """Where a query is: the bounds so far, and nodes."""

    lower: float
    upper: float
    nodes: int


OnStep = Callable[[Progress], None]
