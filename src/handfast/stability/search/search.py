"""A search as an iterator: allocates the tree, lets the compiled kernel run in slices, keeps the score.

A slice is a fixed number of nodes. As soon as enough nodes wait they are dealt to two lanes, which are searched
side by side, in two threads if there are as many cores. Within a slice neither lane knows of the other; after it
both have the better incumbent. So what comes out depends neither on the number of cores nor on their speed.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from handfast.core.answer import Stop
from handfast.core.arrays import Array, Indices, Mask
from handfast.stability.search import arrays, branch, rows
from handfast.stability.search.arrays import Block
from handfast.stability.search.machine import kernel
from handfast.stability.search.reduced import Reduced

CLOSING = (1e-6, 1e-4, 1e-2, 1e-1)  # relative
SLICE = 64  # nodes that a lane expands between two looks at the clock and at the other lane,
BIG = 80  # fewer with more unknowns than this: a node takes time as their cube
CHILDREN, SPARE = 4, 8  # of a node at most; rows that the kernel wants beyond
SHARE = 16  # as many nodes must wait to be dealt, once more if one lane has UNEVEN times as many as the other
UNEVEN = 4
FEW, TROUBLE = 128, 0.2  # nodes from which on, and share of them for which programs that fail are too many
ROOM = 2048  # nodes at first
INF = float("inf")


@cache
def helpers() -> ThreadPoolExecutor:
    """The threads of second lanes, for all searches: starting one takes as long as a small search."""
    return ThreadPoolExecutor(thread_name_prefix="handfast")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=helpers.cache_clear)  # threads do not follow


@dataclass(eq=False)
class Pool:
    """The tree's arrays, one row per node; see `kernel.tree`. A row without a parent, but for the first, is no node.

    table: where they are, for the kernel; None if nothing is to be expanded.
    """

    states: Indices
    ids: Indices
    data: Array
    key: Array
    bound: Array
    parent: Indices
    part: Indices
    status: Indices
    table: Indices | None = None

    @classmethod
    def of(cls, room: int, width: int, n: int) -> Pool:
        rows = (room,)
        shapes = (room, width), (room, n + 1), (room, n + 1), rows, rows, rows, rows, rows
        block = Block(arrays.POOL, shapes)
        states, ids, data, key, bound, parent, part, status = block.arrays()
        parent[:] = -1
        return cls(states, ids, data, key, bound, parent, part, status, block.table)

    def arrays(self) -> tuple[Any, ...]:
        return self.states, self.ids, self.data, self.key, self.bound, self.parent, self.part, self.status

    def grown(self, room: int, used: int) -> Pool:
        """With other room, the first `used` rows as they are."""
        out = Pool.of(room, self.states.shape[1], self.ids.shape[1] - 1)
        for old, new in zip(self.arrays(), out.arrays(), strict=True):
            new[:used] = old[:used]
        return out


@dataclass(eq=False)
class Lane:
    """What one thread changes besides the tree: its incumbent and cut, a heap of nodes that wait; see `kernel.tree`.

    table: where the arrays are; room: `arrays.room`.
    """

    hi: Array
    best: Array
    z: Array
    stats: Indices
    guess: Array
    heap: Indices
    table: Indices
    room: Block

    @classmethod
    def of(cls, r: Reduced, guess: Sequence[Array] | Array = (), heap: int = ROOM) -> Lane:
        """That knows nothing yet; guess: points (n,) to start Newton's method from."""
        n = len(r.cost)
        shapes = r.hi.shape, (2,), (n,), (len(arrays.STATS),), (len(guess), n), (heap,)
        block = Block(arrays.LANE, shapes)
        hi, best, z, stats, points, waiting = block.arrays()
        hi[:], best[:], stats[:] = r.hi, INF, 0
        if len(guess):
            points[:] = guess
        return cls(hi, best, z, stats, points, waiting, block.table, arrays.room(r.room))

    @property
    def waiting(self) -> int:
        return int(self.stats[arrays.HEAP])

    def copy(self, r: Reduced) -> Lane:
        """Another one of the same question that knows as much and has no nodes."""
        out = Lane.of(r, self.guess, len(self.heap))
        for old, new in ((self.hi, out.hi), (self.best, out.best), (self.z, out.z)):
            new[:] = old
        out.stats[:] = self.stats
        out.stats[arrays.HEAP] = 0
        return out

    def give(self, nodes: Indices) -> None:
        """Let it have these nodes, in the order of their keys, instead of those it had."""
        self.reserve(len(nodes))
        self.heap[: len(nodes)] = nodes
        self.stats[arrays.HEAP] = len(nodes)

    def reserve(self, room: int) -> None:
        """Let as many nodes wait, or more."""
        if room > len(self.heap):
            heap = np.zeros(4 * room, np.int64)
            heap[: len(self.heap)] = self.heap
            self.heap, self.table[-1] = heap, arrays.table("i1", [heap])[0]


@dataclass(eq=False)
class Search:
    """Best-first search for a smallest objective (or any solution) over a reduced problem.

    Attributes:
        workers: threads, at most one per lane.
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
    lanes: list[Lane] = field(default_factory=list)

    def __post_init__(self) -> None:
        r = self.reduced
        (m, a, _), n = r.sizes, len(r.cost)
        self.hi = r.hi.copy()
        self.pool = Pool.of(ROOM, 3 * m + a, n)
        for x in self.pool.arrays():  # the root: all is undecided
            x[0] = 0
        self.pool.parent[0] = -1
        self.pool.ids[0, :n] = self._corner
        self.pool.bound[0] = r.lo[0] if r.objective else 0.0
        lane = Lane.of(r, self.guess)
        lane.stats[arrays.USED] = lane.stats[arrays.HEAP] = 1
        lane.heap[0] = 0
        self.lanes.append(lane)
        self._common = np.zeros_like(lane.stats)  # counted before there were two lanes

    def know(self, z: Array) -> None:
        """Begin with an exact solution (n,) as the incumbent."""
        r, lane = self.reduced, self.lanes[0]
        if r.objective != arrays.SCALAR:
            return
        value = r.scalar(z)
        if not r.lo[0] - 1e-9 * abs(r.lo[0]) <= value < self.best:
            return
        lane.best[0], lane.z[:] = value, z
        lane.hi[0] = min(lane.hi[0], value - self.gap * abs(value) - self.gap_absolute)
        self._compare()

    def follow(self, finished: Pool) -> None:
        """Begin with a finished, trimmed tree of the same grasp, balances of energy under the cut of this search."""
        used = len(finished.parent)
        self.pool, self.used = finished.grown(used + ROOM, used), used
        self.pool.data[:used][finished.status == arrays.SPLIT, -1] = self.hi[0]

    def refine(self, leaves: Indices) -> int:
        """Split these closed leaves of a trimmed tree, to be searched once more; returns how many could be split."""
        r, (m, _, _), n = self.reduced, self.reduced.sizes, len(self.reduced.cost)
        lane = self.lanes[0].copy(r)
        lane.stats[arrays.NODES] = self.nodes - 1  # of all lanes
        self.lanes, self.stop, self._common = [lane], None, np.zeros_like(lane.stats)
        self.pool = self.pool.grown(self.used + CHILDREN * len(leaves) + SPARE, self.used)
        pool, first, split = self.pool, self.used, 0
        for node in leaves:
            part, children = branch.cases(pool.states[node], m, r.p.mdp, r.p.eta > 0)
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
        lane.give(np.arange(first, self.used))
        lane.stats[arrays.NODES] += self.used - first
        return split

    def reopen(self, leaves: Indices) -> None:
        """Search these leaves of the tree."""
        lane = self.lanes[0]
        self.pool.status[leaves], self.pool.key[leaves] = arrays.WAITING, 0.0
        self.pool.bound[leaves] = self.reduced.lo[0]
        lane.give(leaves)
        lane.stats[arrays.NODES] = len(leaves) - 1

    @property
    def _corner(self) -> Indices:
        """(n,) the working set that a program begins with where there is no other."""
        corner = np.where(self.reduced.cost >= 0, rows.BOX_UP, rows.BOX_DOWN)
        out: Indices = (corner << rows.KIND) | (np.arange(len(corner)) << rows.INDEX)
        return out

    @property
    def stats(self) -> Indices:
        """What was counted, at the places that `arrays` names."""
        out: Indices = np.sum([lane.stats for lane in self.lanes], axis=0) - (len(self.lanes) - 1) * self._common
        out[arrays.USED] = self.used
        return out

    @property
    def nodes(self) -> int:
        """Programs solved."""
        count = sum(int(lane.stats[arrays.NODES]) for lane in self.lanes)
        return count - (len(self.lanes) - 1) * int(self._common[arrays.NODES]) + 1

    @property
    def trouble(self) -> float:
        """The share of programs that were started again, loosened or given up."""
        stats = self.stats
        return float(stats[arrays.RESTARTS] + stats[arrays.DROPS] + stats[arrays.FAILURES]) / self.nodes

    @property
    def healthy(self) -> bool:
        """Are most programs solved?"""
        return self.nodes < FEW or self.trouble < TROUBLE

    @property
    def bound(self) -> float:
        """No exact solution has a smaller objective than this: over what waits, what is unresolved, and the cut."""
        bound = self.pool.bound[: self.used][self._open()]
        return float(min(bound.min(initial=INF), self.hi[0] if self.best < INF else INF))

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
        pool, number = Pool(*(a[: self.used][real] for a in self.pool.arrays())), np.cumsum(real) - 1
        pool.parent[1:] = number[pool.parent[1:]]
        named = (pool.ids >> rows.KIND == rows.ENERGY) & (pool.status == arrays.EMPTY)[:, None]  # after a node
        old = pool.ids[named] & rows.NODE
        pool.ids[named] += number[old] - old
        self.pool, self.used = pool, len(pool.parent)

    def close(self) -> float:
        """Close all that waits by a cut below its bounds, as high as succeeds; returns it, -inf if none does.

        The bounds of waiting nodes are those of their programs' points, good to `reduced.PREFERENCE` only, so
        that several cuts are tried.
        """
        r, pool, lane = self.reduced, self.pool, self.lanes[0]
        if not r.objective:
            return -INF
        bound = self.bound
        for margin in CLOSING:
            waiting = np.flatnonzero(self._open())
            cut = bound - margin * max(abs(bound), margin)
            if not r.lo[0] <= cut < INF:
                break
            pool.status[waiting] = arrays.WAITING
            pool.key[waiting] = 0.0
            lane.give(waiting)  # nothing is split
            self.hi[0] = lane.hi[0] = min(cut, self.hi[0])
            self._run(lane, 10**9, close=True)
            if not self.unresolved:
                return float(self.hi[0])
        return -INF

    def _run(self, lane: Lane, budget: int, close: bool = False) -> int:
        r = self.reduced
        tables = r.table, lane.table, self.pool.table, lane.room.table
        return kernel().run(*r.numbers, self.gap, self.gap_absolute, budget, close, *tables)

    def _slice(self, budget: int) -> list[int]:
        """Every lane expands up to `budget` nodes; returns why each of them stopped.

        Lanes number their new nodes apart, behind all there are, so that rows may be left over between them.
        """
        lanes = [lane for lane in self.lanes if lane.waiting]
        if not lanes:
            return []
        first, each = self.used, CHILDREN * budget
        self.used += len(lanes) * each
        if self.used + SPARE > len(self.pool.key):
            self.pool = self.pool.grown(2 * self.used + ROOM, first)
        for k, lane in enumerate(lanes):
            lane.stats[arrays.USED] = first + k * each
            lane.reserve(lane.waiting + each)
        try:
            if len(lanes) == 1 or self.workers == 1:
                return [self._run(lane, budget) for lane in lanes]
            other = helpers().submit(self._run, lanes[1], budget)
            try:
                why = self._run(lanes[0], budget)
            finally:  # Ctrl-C comes to this thread alone
                last = other.result()
            return [why, last]
        finally:
            self.used = int(lanes[-1].stats[arrays.USED])
            self._compare()

    def _compare(self) -> None:
        """The better incumbent and its cut for both."""
        lead = min(self.lanes, key=lambda lane: float(lane.best[0]))
        if lead.best[0] < self.best:
            self.best, self.z = float(lead.best[0]), lead.z.copy()
            self.hi[0] = min(lane.hi[0] for lane in self.lanes)
            for lane in self.lanes:
                lane.best[0], lane.hi[0] = self.best, self.hi[0]

    def _deal(self) -> None:
        """Let both lanes have every second node by rank, where that pays."""
        count = [lane.waiting for lane in self.lanes]
        if sum(count) < SHARE or (len(count) == 2 and UNEVEN * min(count) >= max(count)):
            return
        if len(self.lanes) == 1:
            self._common = self.stats
            self.lanes.append(self.lanes[0].copy(self.reduced))
        nodes = np.concatenate([lane.heap[: lane.waiting] for lane in self.lanes])
        nodes = nodes[np.lexsort((nodes, self.pool.key[nodes]))]
        for k, lane in enumerate(self.lanes):
            lane.give(nodes[k::2])

    def __iter__(self) -> Iterator[Search]:
        """Yields itself after every slice of work; `stop` says how it ended."""
        r = self.reduced
        if not r.solvable:
            self.stop = Stop.COMPLETE
            self.pool.status[0] = arrays.EMPTY
            return
        kernel()  # the first search compiles, or loads what was: no search's time
        start = time.monotonic()
        most = max(1, int(SLICE * min(1.0, BIG / len(r.cost)) ** 3))
        while self.stop is None:
            left = (self.node_limit - self.nodes + 1) / len(self.lanes)
            why = self._slice(int(min(most, max(1, left))))
            if arrays.FOUND in why or arrays.ENDLESS in why:
                self.stop = Stop.COMPLETE
            elif not any(lane.waiting for lane in self.lanes):
                self.stop = Stop.NUMERICAL if self.unresolved else Stop.COMPLETE
            elif time.monotonic() - start > self.time_limit:
                self.stop = Stop.TIME
            elif self.nodes > self.node_limit:
                self.stop = Stop.NODES
            else:
                self._deal()
            yield self
