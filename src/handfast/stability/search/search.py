"""A search as an iterator: allocates the tree, lets the compiled kernel run in slices, keeps the score.

A slice is a fixed number of nodes. As soon as enough nodes wait they are parted between two workers, which search
side by side, in two threads if there are as many cores. Within a slice neither worker knows of the other; after it
both have the better incumbent. So what comes out depends neither on the number of cores nor on their speed.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from handfast.core.answer import Stop
from handfast.core.arrays import Array, Indices, Mask
from handfast.core.groups import Block, table
from handfast.core.libraries import deferred_interrupt
from handfast.proofs import kinds
from handfast.stability.search import arrays, cases, rows
from handfast.stability.search.arrays import (
    CHILDREN,
    Pool,
    WorkerState,
    Workspace,
    pool_layout,
    worker_layout,
)
from handfast.stability.search.machine import LIBRARY
from handfast.stability.search.reduced import Reduced

WITNESS_INSET = 1e-3  # a witness of the largest magnitude stays below it by this share of the gap
CLOSING_MARGINS = (1e-6, 1e-4, 1e-2, 1e-1)  # relative
CLOSING_NODES = 4096  # nodes that are closed between two looks at the clock
SLICE_NODES = 64  # nodes that a worker expands between two looks at the clock and at the other worker,
BIG = 80  # fewer with more unknowns than this: a node takes time as their cube
SPARE = 8  # rows of the tree that the kernel wants beyond what it may fill
# as many nodes must wait to be parted, once more if one worker has UNEVEN times as many as the other
MIN_SHARED_NODES = 16
UNEVEN = 4
# nodes from which on, and share of them for which programs that fail are too many
MIN_FAILURE_NODES, MAX_FAILURE_SHARE = 128, 0.2
FIRST_POOL_NODES = 2048  # nodes at first
INF = float("inf")


@cache
def helpers() -> ThreadPoolExecutor:
    """The threads of second workers, for all searches: starting one takes as long as a small search."""
    return ThreadPoolExecutor(thread_name_prefix="handfast")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=helpers.cache_clear)  # threads do not follow


def new_pool(rows: int, width: int, n: int) -> tuple[Pool, Indices]:
    """Room for so many nodes of a tree, and the table of it; width: of their states."""
    block = Block(pool_layout(rows, width, n))
    pool = block.arrays()
    pool.parent[:] = -1
    return pool, block.table


def grown(pool: Pool, rows: int, used: int) -> tuple[Pool, Indices]:
    """The same tree with other room, the first `used` rows as they are."""
    out, lines = new_pool(rows, pool.states.shape[1], pool.ids.shape[1] - 1)
    for old, new in zip(pool, out, strict=True):
        new[:used] = old[:used]
    return out, lines


@dataclass(eq=False)
class SearchWorker:
    """What one thread changes besides the tree: its incumbent and cut, a heap of nodes that wait; and its workspace.

    table: where the arrays of `state` are.
    """

    state: WorkerState
    table: Indices
    workspace: Workspace

    @classmethod
    def of(cls, r: Reduced, guesses: Sequence[Array] | Array = (), heap: int = FIRST_POOL_NODES) -> SearchWorker:
        """That knows nothing yet; guesses: points (n,) to start Newton's method from."""
        block = Block(worker_layout(len(r.hi), r.cost.shape[-1], len(guesses), heap))
        state = block.arrays()
        state.hi[:], state.best[:], state.counts[:] = r.hi, INF, 0
        if len(guesses):
            state.guesses[:] = guesses
        return cls(state, block.table, Workspace(r.workspace))

    @property
    def waiting(self) -> int:
        return int(self.state.counts[arrays.HEAP])

    def copy(self, r: Reduced) -> SearchWorker:
        """Another one of the same question that knows as much and has no nodes."""
        out = SearchWorker.of(r, self.state.guesses, len(self.state.heap))
        for name in ("hi", "best", "best_z", "counts"):
            getattr(out.state, name)[:] = getattr(self.state, name)
        out.state.counts[arrays.HEAP] = 0
        return out

    def give(self, nodes: Indices) -> None:
        """Let it have these nodes, in the order of their keys, instead of those it had."""
        self.reserve(len(nodes))
        self.state.heap[: len(nodes)] = nodes
        self.state.counts[arrays.HEAP] = len(nodes)

    def reserve(self, room: int) -> None:
        """Let as many nodes wait, or more."""
        if room > len(self.state.heap):
            heap = np.zeros(4 * room, np.int64)
            heap[: len(self.state.heap)] = self.state.heap
            self.state = self.state._replace(heap=heap)
            self.table = table(self.state)


@dataclass(eq=False)
class Search:
    """Best-first search for a smallest objective (or any solution) over a reduced problem.

    Attributes:
        workers: threads, of which a searcher takes one at most.
        best: the smallest objective found so far, inf if none; z: its point (n,).
        stop: None while it runs.
        used: rows of the pool, a few of which may be no nodes until `trim`.
    """

    reduced: Reduced
    gap: float = 1e-3
    gap_absolute: float = 1e-9
    node_limit: float = INF
    time_limit: float = INF
    workers: int = 1
    guess: Sequence[Array] = ()
    best: float = INF
    z: Array | None = None
    stop: Stop | None = None
    used: int = 1
    searchers: list[SearchWorker] = field(default_factory=list)

    def __post_init__(self) -> None:
        r = self.reduced
        (m, a, _), n = r.sizes, len(r.cost)
        self.hi = r.hi.copy()
        self._pool_table: Indices | None  # of nodes that may be expanded
        self.pool, self._pool_table = new_pool(FIRST_POOL_NODES, 3 * m + a, n)
        for x in self.pool:  # the root: all is undecided
            x[0] = 0
        self.pool.parent[0] = -1
        self.pool.ids[0, :n] = self._corner
        self.pool.bound[0] = r.lo[0] if r.objective else 0.0
        first = SearchWorker.of(r, self.guess)
        first.state.counts[arrays.USED] = first.state.counts[arrays.HEAP] = 1
        first.state.heap[0] = 0
        self.searchers.append(first)
        self._common = np.zeros_like(first.state.counts)  # counted before there were two searchers

    def set_incumbent(self, z: Array) -> None:
        """Begin with an exact solution (n,) as the incumbent."""
        r, state = self.reduced, self.searchers[0].state
        if r.objective != arrays.SCALAR:
            return
        value = r.scalar(z)
        if not r.lo[0] - 1e-9 * abs(r.lo[0]) <= value < self.best:
            return
        state.best[0], state.best_z[:] = value, z
        state.hi[0] = min(state.hi[0], value - self.gap * abs(value) - self.gap_absolute)
        self._share_incumbent()

    def split_leaves(self, leaves: Indices) -> int:
        """Split these closed leaves of a trimmed tree, to be searched once more; returns how many could be split."""
        r, (m, _, _), n = self.reduced, self.reduced.sizes, len(self.reduced.cost)
        only = self.searchers[0].copy(r)
        only.state.counts[arrays.NODES] = self.nodes - 1  # of all searchers
        self.searchers, self.stop, self._common = [only], None, np.zeros_like(only.state.counts)
        self.pool, self._pool_table = grown(self.pool, self.used + CHILDREN * len(leaves) + SPARE, self.used)
        pool, first, split = self.pool, self.used, 0
        for node in leaves:
            part, children = cases.split(pool.states[node], m, r.p.mdp, r.p.limits.eta > 0, r.soft_fingers >= 0)
            if part < 0:
                continue
            split += 1
            pool.status[node] = arrays.SPLIT
            pool.data[node], pool.data[node, n] = 0.0, self.hi[0] if r.objective else 0.0
            for states in children:
                k = self.used
                self.used += 1
                pool.states[k], pool.parent[k], pool.part[k] = states, node, part
                pool.ids[k, :n], pool.data[k], pool.key[k] = self._corner, 0.0, 0.0
                pool.bound[k], pool.status[k] = pool.bound[node], arrays.WAITING
        only.give(np.arange(first, self.used))
        only.state.counts[arrays.NODES] += self.used - first
        return split

    @property
    def _corner(self) -> Indices:
        """(n,) the working set that a program begins with where there is no other."""
        corner = np.where(self.reduced.cost >= 0, rows.BOX_UP, rows.BOX_DOWN)
        out: Indices = (corner << rows.KIND_SHIFT) | (np.arange(len(corner)) << rows.INDEX)
        return out

    @property
    def counts(self) -> Indices:
        """What was counted, at the places that `arrays.WORKER_COUNTS` names."""
        each = [searcher.state.counts for searcher in self.searchers]
        out: Indices = np.sum(each, axis=0) - (len(each) - 1) * self._common
        out[arrays.USED] = self.used
        return out

    @property
    def nodes(self) -> int:
        """Programs solved."""
        count = sum(int(searcher.state.counts[arrays.NODES]) for searcher in self.searchers)
        return count - (len(self.searchers) - 1) * int(self._common[arrays.NODES]) + 1

    @property
    def trouble(self) -> float:
        """The share of programs that were started again, loosened or given up."""
        counts = self.counts
        return float(counts[arrays.RESTARTS] + counts[arrays.DROPS] + counts[arrays.FAILURES]) / self.nodes

    @property
    def healthy(self) -> bool:
        """Are most programs solved?"""
        return self.nodes < MIN_FAILURE_NODES or self.trouble < MAX_FAILURE_SHARE

    @property
    def end(self) -> float:
        """The objective at which nodes are cut off, inf if none is sought."""
        return float(self.hi[0]) if len(self.hi) else INF

    @property
    def bound(self) -> float:
        """No exact solution has a smaller objective than this: over what waits, what is unresolved, and the cut."""
        bound = self.pool.bound[: self.used][self._open()]
        return float(min(bound.min(initial=INF), self.end if self.best < INF else INF))

    @property
    def unresolved(self) -> int:
        """Nodes that neither a ray nor Newton settled."""
        return int((self._real() & (self.pool.status[: self.used] == arrays.UNRESOLVED)).sum())

    def _real(self) -> Mask:
        """(used,) which rows are nodes."""
        out: Mask = self.pool.parent[: self.used] >= 0
        out[0] = True
        return out

    def _open(self) -> Mask:
        """(used,) what is no leaf of a proof yet."""
        status = self.pool.status[: self.used]
        return self._real() & ((status == arrays.WAITING) | (status == arrays.UNRESOLVED))

    def trim(self) -> None:
        """Give back the room that no node took; nothing can be expanded afterwards."""
        real = self._real()
        pool, number = Pool._make(a[: self.used][real] for a in self.pool), np.cumsum(real) - 1
        pool.parent[1:] = number[pool.parent[1:]]
        named = (pool.ids >> rows.KIND_SHIFT == kinds.ENERGY) & (pool.status == arrays.EMPTY)[:, None]  # after a node
        old = pool.ids[named] & rows.NODE
        pool.ids[named] += number[old] - old
        self.pool, self._pool_table, self.used = pool, None, len(pool.parent)

    def close(self, until: float = INF) -> float:
        """Close all that waits by a cut below its bounds, as high as succeeds; returns it, -inf if none does.

        The bounds of waiting nodes are those of their programs' points, good to `reduced.PREFERENCE` only, so
        that several cuts are tried, until [s] of `time.monotonic`.
        """
        r, pool, first = self.reduced, self.pool, self.searchers[0]
        if not r.objective:
            return -INF
        bound = self.bound
        for margin in CLOSING_MARGINS:
            waiting = np.flatnonzero(self._open())
            cut = bound - margin * max(abs(bound), margin)
            if not r.lo[0] <= cut < INF:
                break
            pool.status[waiting] = arrays.WAITING
            pool.key[waiting] = 0.0
            first.give(waiting)  # nothing is split
            self.hi[0] = first.state.hi[0] = min(cut, self.hi[0])
            while first.waiting and time.monotonic() < until:
                self._run(first, CLOSING_NODES, close=True)
            if first.waiting:
                break
            if not self.unresolved:
                return float(self.hi[0])
        return -INF

    def _run(self, searcher: SearchWorker, budget: int, close: bool = False) -> int:
        tables = self.reduced.table, searcher.table, self._pool_table, *searcher.workspace.tables
        why: int = LIBRARY.functions.run(*tables, self.gap, self.gap_absolute, budget, close)
        return why

    def _slice(self, budget: int) -> list[int]:
        """Every searcher expands up to `budget` nodes; returns why each of them stopped.

        They number their new nodes apart, behind all there are, so that rows may be left over between them.
        """
        busy = [searcher for searcher in self.searchers if searcher.waiting]
        if not busy:
            return []
        first, each = self.used, CHILDREN * budget
        self.used += len(busy) * each
        if self.used + SPARE > len(self.pool.key):
            self.pool, self._pool_table = grown(self.pool, 2 * self.used + FIRST_POOL_NODES, first)
        for k, searcher in enumerate(busy):
            searcher.state.counts[arrays.USED] = first + k * each
            searcher.reserve(searcher.waiting + each)
        try:
            if len(busy) == 1 or self.workers == 1:
                return [self._run(searcher, budget) for searcher in busy]
            with deferred_interrupt():  # Ctrl-C comes to this thread alone, and both write to the tree
                other = helpers().submit(self._run, busy[1], budget)
                return [self._run(busy[0], budget), other.result()]
        finally:
            self.used = int(busy[-1].state.counts[arrays.USED])
            self._share_incumbent()

    def _share_incumbent(self) -> None:
        """The better incumbent and its cut for both."""
        states = [searcher.state for searcher in self.searchers]
        lead = min(states, key=lambda state: float(state.best[0]))
        if lead.best[0] < self.best:
            self.best, self.z = float(lead.best[0]), lead.best_z.copy()
            for state in states:
                state.best[0] = self.best
            if len(self.hi):  # without a number that is sought nothing may be bounded
                self.hi[0] = min(state.hi[0] for state in states)
                for state in states:
                    state.hi[0] = self.hi[0]

    def _partition(self) -> None:
        """Let both searchers have every second node by rank, where that pays."""
        count = [searcher.waiting for searcher in self.searchers]
        if sum(count) < MIN_SHARED_NODES or (len(count) == 2 and UNEVEN * min(count) >= max(count)):
            return
        if len(self.searchers) == 1:
            self._common = self.counts
            self.searchers.append(self.searchers[0].copy(self.reduced))
        nodes = np.concatenate([searcher.state.heap[: searcher.waiting] for searcher in self.searchers])
        nodes = nodes[np.lexsort((nodes, self.pool.key[nodes]))]
        for k, searcher in enumerate(self.searchers):
            searcher.give(nodes[k::2])

    def __iter__(self) -> Iterator[Search]:
        """Yields itself after every slice of work; `stop` says how it ended."""
        r = self.reduced
        if not r.solvable:
            self.stop = Stop.COMPLETE
            self.pool.status[0] = arrays.EMPTY
            return
        LIBRARY.functions  # noqa: B018  the first search compiles, or loads what was: no search's time
        start = time.monotonic()
        most = max(1, int(SLICE_NODES * min(1.0, BIG / len(r.cost)) ** 3))
        while self.stop is None:
            left = (self.node_limit - self.nodes + 1) / len(self.searchers)
            why = self._slice(int(min(most, max(1, left))))
            if arrays.FOUND in why or arrays.ENDLESS in why:
                self.stop = Stop.COMPLETE
            elif not any(searcher.waiting for searcher in self.searchers):
                self.stop = Stop.NUMERICAL if self.unresolved else Stop.COMPLETE
            elif time.monotonic() - start > self.time_limit:
                self.stop = Stop.TIME
            elif self.nodes > self.node_limit:
                self.stop = Stop.NODES
            else:
                self._partition()
            yield self


def exact_solution(
    r: Reduced, start: Array, *, tolerance: float = 1e-6, hold: bool = False, worker: SearchWorker | None = None
) -> Array | None:
    """An exact solution (n,) of the reduced problem near `start` (n,); None if none was found.

    Args:
        tolerance: (scaled) motions and forces of the start below this count as none.
        hold: keep the objective at its lower bound.
        worker: whose upper bounds hold, and whose workspace is used; by default those of the problem.
    """
    worker = worker or SearchWorker.of(r, heap=1)
    room = worker.workspace.refinement
    room.array("start")[:] = start
    found = LIBRARY.functions.refined(r.table, worker.table, room.table, tolerance, hold)
    return np.array(room.array("z")) if found else None
