"""The same question for motions up to a cap, searched beside a search that makes no progress.

Some states solve the model at endless motion only, and nothing near them does: where all contacts lie in one plane,
say, a contact that slides across it ever faster leaves a friction in the plane that vanishes, but only in the limit
does nothing have to balance it. Cases that hold such a limit cannot be closed, since rows are closed sets. With an
end to motions the limit is left out. The bound is then proved up to that motion only, and its answer says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from handfast.core.answer import SearchLimits, Stop
from handfast.core.arrays import Array
from handfast.stability.search import arrays
from handfast.stability.search.reduced import Reduced, reduce
from handfast.stability.search.search import INF, Search

MOTION_CAP = 2e4  # force scales
FARTHER_CAPS = 2e6, 2e8  # in turn, before it is said that no state exists up to a cap, or none with smaller commands
FIRST_HELP_NODES = 4096  # nodes of the other search when it is helped first, then whenever it has twice as many
STALLED = 1e-6  # relative: a bound that has moved by less while the nodes became four times as many makes no progress
HELP_SHARE = 0.25  # of the other search's nodes, where any state is sought and no bound shows whether there is progress


@dataclass(eq=False)
class Capped:
    """A search up to a cap, made when it is wanted first.

    Attributes:
        other: the question without a cap; gap, gap_absolute, workers: of both searches.
        bounds: may its bound be the answer? Else it finds states only.
        beyond: a point (n,) of the other question whose objective is a little below a value, sought without a cap
            with so many nodes and seconds; None if none was found.
        search: None while it is not wanted.
        cap: on motions, in force scales.
        better: point (n,) of the other question with more motion, better than the bound.
        due: nodes of the other search at which that is looked at next; before: its bounds the last times.
        made: all searches up to a cap, this one's and those up to farther ones.
    """

    other: Reduced
    gap: float
    gap_absolute: float
    workers: int
    bounds: bool
    beyond: Callable[[float, int, float], Array | None]
    search: Search | None = None
    cap: float = MOTION_CAP
    better: Array | None = None
    due: int = FIRST_HELP_NODES // 2
    before: tuple[float, ...] = ()
    made: list[Search] = field(default_factory=list)

    @property
    def possible(self) -> bool:
        """Not for an objective without end: forces have no bound then."""
        r = self.other
        return not r.objective or bool(np.isfinite([r.lo[0], r.hi[0]]).all())

    @property
    def closed(self) -> bool:
        """Has it answered the question, if only up to its cap?"""
        s = self.search
        return s is not None and s.stop is Stop.COMPLETE and (s.z is not None if self.any else self.bounds)

    @property
    def any(self) -> bool:
        """Is any state sought? Where nothing failed, that there is none is said without a cap, or not at all."""
        return self.other.objective == arrays.ANY

    @property
    def nodes(self) -> int:
        return sum(search.nodes for search in self.made)

    def watch(self, other: Search, node_limit: float, limits: SearchLimits) -> Search | None:
        """Look at the other search, help it if it makes no progress; returns this one if its answer is to be taken."""
        if not self.possible or other.stop is not None or other.nodes < self.due:
            return None
        bound = 0.0 if self.any else other.bound
        still = len(self.before) > 1 and bound <= self.before[-2] + STALLED * abs(bound)
        self.before = (*self.before, bound)
        if len(self.before) > 1 and (still or other.best == INF):
            s = self.run(other.z, min((HELP_SHARE if self.any else 1.0) * self.due, node_limit), limits)
            if s.z is not None:
                other.set_incumbent(s.z)
        self.due *= 2
        if not self.closed or not (still or self.any):
            return None
        if not self.contradicted(other.nodes, node_limit, limits):
            return self.search
        assert self.better is not None
        other.set_incumbent(self.better)
        return None

    def contradicted(self, nodes: int, node_limit: float, limits: SearchLimits) -> bool:
        """Does a state that moves more do better than the bound? Then it is none.

        Where commands are sought, or nothing was found, the bound is that of the farthest cap that gives one.
        """
        s, most = self.search, int(min(max(nodes, FIRST_HELP_NODES), node_limit))
        if self.any or not self.bounds or s is None:
            return not self.bounds and self.better is not None
        if s.z is not None and not self.other.goal.seeks_commands:
            self.better = self.beyond(float(s.hi[0]), most, limits.seconds_left)
        else:
            for farther in self.farther(None, most, limits):
                if farther.stop is not Stop.COMPLETE:
                    self.better = farther.z if farther.best < s.end else None
                    break
                self.search = s = farther
        self.bounds = self.better is None
        return not self.bounds

    def farther(self, point: Array | None, node_limit: float, limits: SearchLimits) -> Iterator[Search]:
        """Searches up to caps that are farther away, in turn, each with so many nodes, all within the time."""
        for cap in FARTHER_CAPS:
            yield replace(self, cap=cap, search=None).run(point, node_limit, limits)

    def run(self, point: Array | None, node_limit: float, limits: SearchLimits) -> Search:
        """Search on up to so many nodes, from an incumbent (n,) if there is one."""
        r = self.other
        if self.search is None:
            within = (float(r.lo[0]), float(r.hi[0])) if r.objective else None
            capped = reduce(r.p, r.goal, within=within, cap=self.cap)
            self.search = Search(capped, gap=self.gap, gap_absolute=self.gap_absolute, workers=self.workers)
            self.made.append(self.search)
        s = self.search
        if s.stop is not Stop.COMPLETE:
            s.node_limit, s.time_limit, s.stop = node_limit, limits.seconds_left, None
            if point is not None:
                s.set_incumbent(point)
            for _ in s:
                pass
        return s
