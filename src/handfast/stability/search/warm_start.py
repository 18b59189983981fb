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
from handfast.stability.search.arrays import SPLIT, ClosedLeaves, Pool
from handfast.stability.search.search import Search

TOLERANCES = 1e-6, 1e-4  # motions and forces of a starting point below this count as none


@dataclass(frozen=True, eq=False)
class WarmStart:
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
        r, worker = s.reduced, s.searchers[0]
        ahead = [2 * self.points[0] - self.points[1]] if len(self.points) > 1 else []
        for point, tolerance in itertools.product((*ahead, self.points[0]), TOLERANCES):
            z = exact.solve(r, point, tolerance=tolerance, hold=self.unbounded, worker=worker)
            if z is not None:
                s.set_incumbent(z)
                break
        if s.z is None or self.tree is None:
            return
        s.warm_start(self.tree)
        leaves = ClosedLeaves(nodes := np.flatnonzero(self.tree.status != SPLIT), np.empty(len(nodes), np.bool_))
        s.refute(leaves)
        s.reopen(leaves.nodes[~leaves.closed])
