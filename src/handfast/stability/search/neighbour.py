"""What an answered question leaves to the next one in nearly the same direction: points, and its tree.

Near a solution of the one is a solution of the other, which Newton finds; and what refuted a case mostly refutes
it again. So the search begins with an incumbent and with the finished tree: only leaves that their rays do not
close any more wait to be searched, each from its working set. The tree covers all states whatever the direction
is: it is as good a proof as one that was grown from its root.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.stability.search import exact
from handfast.stability.search.arrays import LEAVES, SPLIT, table
from handfast.stability.search.machine import kernel
from handfast.stability.search.search import Pool, Search

TOLERANCES = 1e-6, 1e-4  # motions and forces of a starting point below this count as none


@dataclass(frozen=True, eq=False)
class Neighbour:
    """The questions answered last, of the same grasp and in the same scales.

    Attributes:
        points: (n,) each, their solutions in the engine's unknowns, the latest first.
        unbounded: did the latest end at the end of the search?
        tree: the latest's, if its bound is proved.
    """

    points: tuple[Array, ...]
    unbounded: bool
    tree: Pool | None

    def start(self, s: Search) -> None:
        """Let a search begin with what is known."""
        r, lane = s.reduced, s.lanes[0]
        ahead = [2 * self.points[0] - self.points[1]] if len(self.points) > 1 else []
        for point, tol in itertools.product((*ahead, self.points[0]), TOLERANCES):
            z = exact.solve(r, point, tol=tol, hold=self.unbounded, lane=lane)
            if z is not None:
                s.know(z)
                break
        if s.z is None or self.tree is None:
            return
        s.follow(self.tree)
        pool, leaves = s.pool, np.flatnonzero(self.tree.status != SPLIT)
        closed = np.empty(len(leaves), np.bool_)
        tables = r.table, lane.table, pool.table, table(LEAVES, (leaves, closed)), lane.room.table
        kernel().refuted(*r.numbers[:5], *tables)
        s.reopen(leaves[~closed])
