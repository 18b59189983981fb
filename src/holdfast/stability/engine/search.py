"""A search as an iterator: allocates the tree, lets the compiled kernel run in slices, keeps the score."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from holdfast.answer import Stop
from holdfast.mechanism import Array
from holdfast.stability.engine import rows, tree
from holdfast.stability.engine.reduced import Reduced, box

SLICE = 0.05  # [s] of kernel time between looks at the clock
INF = float("inf")


@dataclass(eq=False)
class Pool:
    """The tree's arrays, one row per node; see `tree.run`."""

    states: Array
    ids: Array
    data: Array
    key: Array
    bound: Array
    parent: Array
    part: Array
    status: Array
    heap: Array

    @classmethod
    def of(cls, room: int, m: int, a: int, n: int) -> Pool:
        def whole(*shape: int) -> Array:
            return np.zeros(shape, np.int64)

        return cls(
            whole(room, 3 * m + a), whole(room, n + 1),
            np.zeros((room, n + 1)), np.zeros(room), np.zeros(room), whole(room), whole(room), whole(room), whole(room),
        )  # fmt: skip

    def arrays(self) -> tuple[Array, ...]:
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
        self.box = box(r, INF)
        self.pool = Pool.of(64, m, a, n)
        corner = np.where(r.cost >= 0, rows.BOX_UP, rows.BOX_DOWN)
        self.pool.ids[0, :n] = ((corner * 256 + np.arange(n)) << 50).astype(np.int64)
        self.pool.parent[0] = -1
        self.pool.bound[0] = r.lo[0] if r.objective else 0.0
        self.stats[tree.USED] = self.stats[tree.HEAP] = 1
        self._best, self._z = np.array([INF]), np.zeros(n)

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

    def close(self, bound: float, margin: float) -> bool:
        """Close what waits by a cut a little below `bound`; False if a node resists."""
        assert self.pool is not None
        self.hi[0] = bound - margin * max(abs(bound), 1e-3)
        if not self.hi[0] >= self.reduced.lo[0]:
            return False
        self._run(10**9, close=True)
        return not self.unresolved

    def _run(self, budget: int, close: bool = False) -> int:
        assert self.pool is not None
        r = self.reduced
        m, a = len(r.p.mu), len(r.active)
        cos, sin = float(np.cos(r.p.eta)), float(np.sin(r.p.eta))
        guess = np.array(self.guess).reshape(-1, len(r.cost)) if len(self.guess) else np.zeros((0, len(r.cost)))
        return int(
            tree.run(
                m,
                a,
                cos,
                sin,
                r.p.mdp,
                r.objective,
                r.motions,
                self.gap,
                self.gap_absolute,
                r.B,
                r.BT,
                r.off,
                r.p.mu,
                r.lo,
                self.hi,
                self.box,
                r.cost,
                r.driven,
                budget,
                close,
                guess,
                self._best,
                self._z,
                self.stats,
                *self.pool.arrays(),
            )  # fmt: skip
        )

    def __iter__(self) -> Iterator[Search]:
        """Yields itself after every slice of work; `stop` says how it ended."""
        assert self.pool is not None
        if not self.reduced.solvable:
            self.stop = Stop.COMPLETE
            self.pool.status[0] = tree.EMPTY
            return
        r, start = self.reduced, time.monotonic()
        budget = 16
        while self.stop is None:
            clock = time.monotonic()
            why = self._run(budget)
            if self._best[0] < self.best:
                self.best, self.z = float(self._best[0]), self._z.copy()
                self.box = box(r, float(self.hi[0]))
            if why == tree.ROOM:
                self.pool = self.pool.grown(4 * len(self.pool.key))
                continue
            now = time.monotonic()
            if why == tree.ENOUGH:
                if now - start > self.time_limit:
                    self.stop = Stop.TIME
                elif self.nodes > self.node_limit:
                    self.stop = Stop.NODES
                budget = int(np.clip(budget * SLICE / max(now - clock, 1e-6), 16, 4 * budget))
                budget = int(min(budget, max(1, self.node_limit - self.nodes))) if self.stop is None else budget
            else:
                self.stop = Stop.NUMERICAL if why == tree.EXHAUSTED and self.unresolved else Stop.COMPLETE
            yield self
