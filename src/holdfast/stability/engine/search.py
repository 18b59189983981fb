"""A search as an iterator: allocates the tree, lets the compiled kernel run in slices, keeps the score."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from holdfast.answer import Stop
from holdfast.mechanism import Array, Indices
from holdfast.stability.engine import rows, tree
from holdfast.stability.engine.reduced import Reduced

CLOSING = (1e-6, 1e-4, 1e-2, 1e-1)  # relative
FIRST, LEAST = 64, 16  # nodes before the first look at the clock, and between two at least
SLICE = 0.05  # [s] of kernel time between looks at the clock
INF = float("inf")


@dataclass(eq=False)
class Pool:
    """The tree's arrays, one row per node; see `tree.run`."""

    states: Indices
    ids: Indices
    data: Array
    key: Array
    bound: Array
    parent: Indices
    part: Indices
    status: Indices
    heap: Indices

    @classmethod
    def of(cls, room: int, m: int, a: int, n: int) -> Pool:
        def whole(*shape: int) -> Indices:
            return np.zeros(shape, np.int64)

        return cls(
            whole(room, 3 * m + a), whole(room, n + 1),
            np.zeros((room, n + 1)), np.zeros(room), np.zeros(room), whole(room), whole(room), whole(room), whole(room),
        )  # fmt: skip

    def arrays(self) -> tuple[Any, ...]:
        return (
            self.states, self.ids, self.data,
            self.key, self.bound, self.parent, self.part, self.status, self.heap,
        )  # fmt: skip

    def grown(self, room: int) -> Pool:
        out = []
        for old in self.arrays():
            new = np.zeros((room, *old.shape[1:]), old.dtype)
            new[: len(old)] = old
            out.append(new)
        return Pool(*out)


@dataclass(eq=False)
class Search:
    """Best-first search for a smallest objective (or any solution) over a reduced problem.

    Attributes:
        best: the smallest objective found so far, inf if none; z: its point (n,).
        stop: None while it runs.
        unresolved: nodes that neither a ray nor Newton settled.
    """

    reduced: Reduced
    gap: float = 1e-3
    gap_absolute: float = 1e-9
    node_limit: float = INF
    time_limit: float = INF
    guess: Sequence[Array] = ()
    best: float = INF
    z: Array | None = None
    stop: Stop | None = None
    stats: Array = field(default_factory=lambda: np.zeros(9, np.int64))
    pool: Pool | None = None

    def __post_init__(self) -> None:
        r = self.reduced
        m, a, n = len(r.p.mu), len(r.active), len(r.cost)
        self.hi = r.hi.copy()
        self.box = r.box(INF)
        self.pool = Pool.of(512, m, a, n)
        corner = np.where(r.cost >= 0, rows.BOX_UP, rows.BOX_DOWN)
        self.pool.ids[0, :n] = (corner << rows.KIND) | (np.arange(n) << rows.INDEX)
        self.pool.parent[0] = -1
        self.pool.bound[0] = r.lo[0] if r.objective else 0.0
        self.stats[tree.USED] = self.stats[tree.HEAP] = 1
        self._best, self._z = np.array([INF, INF]), np.zeros(n)

    @property
    def nodes(self) -> int:
        """Programs solved."""
        return int(self.stats[tree.NODES]) + 1

    @property
    def bound(self) -> float:
        """No exact solution has a smaller objective than this: over what waits, what is unresolved, and the cut."""
        assert self.pool is not None
        used = self.stats[tree.USED]
        open_ = np.isin(self.pool.status[:used], (tree.WAITING, tree.UNRESOLVED))
        return float(min(self.pool.bound[:used][open_].min(initial=INF), self.hi[0] if self.best < INF else INF))

    @property
    def unresolved(self) -> int:
        assert self.pool is not None
        return int((self.pool.status[: self.stats[tree.USED]] == tree.UNRESOLVED).sum())

    def trim(self) -> None:
        """Give back the room that no node took; nothing can be expanded afterwards."""
        assert self.pool is not None
        used = int(self.stats[tree.USED])
        self.pool = Pool(*(a[:used].copy() for a in self.pool.arrays()))

    def close(self) -> float:
        """Close all that waits by a cut below its bounds, as high as succeeds; returns it, -inf if none does.

        The bounds of waiting nodes are those of their programs' points, good to `reduced.PREFERENCE` only, so
        that several cuts are tried.
        """
        assert self.pool is not None
        r, status = self.reduced, self.pool.status
        used = self.stats[tree.USED]
        if not r.objective:
            return -INF
        bound = self.bound
        for margin in CLOSING:
            waiting = np.flatnonzero(np.isin(status[:used], (tree.WAITING, tree.UNRESOLVED)))
            cut = bound - margin * max(abs(bound), margin)
            if not r.lo[0] <= cut < INF:
                break
            status[waiting] = tree.WAITING
            self.pool.heap[: len(waiting)] = waiting  # any order: nothing is split
            self.pool.key[waiting] = 0.0
            self.stats[tree.HEAP], self.hi[0] = len(waiting), min(cut, self.hi[0])
            self._run(10**9, close=True)
            if not self.unresolved:
                return float(self.hi[0])
        return -INF

    def _run(self, budget: int, close: bool = False) -> int:
        assert self.pool is not None
        r = self.reduced
        m, a = len(r.p.mu), len(r.active)
        cos, sin = float(np.cos(r.p.eta)), float(np.sin(r.p.eta))
        guess = np.array(self.guess).reshape(-1, len(r.cost)) if len(self.guess) else np.zeros((0, len(r.cost)))
        why = tree.run(
            m, a, cos, sin, r.p.mdp, r.objective, r.motions, self.gap, self.gap_absolute,
            r.B, r.BT, r.off, r.p.mu, r.lo, self.hi, self.box, r.cost, r.driven,
            budget, close, guess, self._best, self._z, self.stats, *self.pool.arrays(),
        )  # fmt: skip
        return int(why)

    def __iter__(self) -> Iterator[Search]:
        """Yields itself after every slice of work; `stop` says how it ended."""
        assert self.pool is not None
        if not self.reduced.solvable:
            self.stop = Stop.COMPLETE
            self.pool.status[0] = tree.EMPTY
            return
        r = self.reduced
        if not tree.run.signatures:  # the first search compiles, or loads what was: no search's time
            self._run(0)
        start = time.monotonic()
        budget = int(min(FIRST, max(1, self.node_limit)))
        while self.stop is None:
            clock = time.monotonic()
            why = self._run(budget)
            if self._best[0] < self.best:
                self.best, self.z = float(self._best[0]), self._z.copy()
                if r.objective and why in (tree.ROOM, tree.ENOUGH):
                    self.box = r.box(float(self.hi[0]))
            if why == tree.ROOM:
                self.pool = self.pool.grown(4 * len(self.pool.key))
                continue
            now = time.monotonic()
            if why == tree.ENOUGH:
                if now - start > self.time_limit:
                    self.stop = Stop.TIME
                elif self.nodes > self.node_limit:
                    self.stop = Stop.NODES
                budget = int(np.clip(budget * SLICE / max(now - clock, 1e-6), LEAST, 4 * budget))
                budget = int(min(budget, max(1, self.node_limit - self.nodes))) if self.stop is None else budget
            else:
                self.stop = Stop.NUMERICAL if why == tree.EXHAUSTED and self.unresolved else Stop.COMPLETE
            yield self
