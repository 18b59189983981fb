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
from numba import njit

from holdfast.mechanism import Array
from holdfast.stability.engine import newton, tree
from holdfast.stability.engine.rows import row
from holdfast.stability.engine.search import Pool, Search
from holdfast.stability.engine.simplex import ROUNDING

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
        ahead = [2 * self.points[0] - self.points[1]] if len(self.points) > 1 else []
        for point, tol in itertools.product((*ahead, self.points[0]), TOLERANCES):
            z = newton.solve(s.reduced, point, tol=tol, hold=self.unbounded)
            if z is not None:
                s.know(z)
                break
        if s.z is None or self.tree is None:
            return
        s.follow(self.tree)
        r, pool, leaves = s.reduced, s.pool, np.flatnonzero(self.tree.status != tree.SPLIT)
        closed = np.empty(len(leaves), np.bool_)
        refute(
            *r.sizes, float(np.cos(r.p.eta)), float(np.sin(r.p.eta)), r.C, r.D, r.off, r.p.mu, r.lo, s.hi, s.box,
            pool.ids, pool.data, leaves, closed,
        )  # fmt: skip
        s.reopen(leaves[~closed])


@njit(cache=True, nogil=True, error_model="numpy")
def refute(m, a, F, cos, sin, C, D, off, mu, lo, hi, box, ids, data, leaves, closed):  # type: ignore[no-untyped-def]
    """Which leaves' rays prove infeasibility as things are now: the test of `simplex.solve`."""
    n = box.shape[0]
    term = np.empty(n)
    gradient = np.empty(6)
    total = np.empty(n)
    size = np.empty(n)
    for i in range(leaves.shape[0]):
        gap = 0.0
        slip = 0.0
        for j in range(n):
            total[j] = 0.0
            size[j] = 0.0
        for k in range(n + 1):
            y = data[leaves[i], k]
            if y <= 0.0:
                continue
            b = row(ids[leaves[i], k], m, a, F, cos, sin, C, D, off, mu, lo, hi, box, data, term, gradient)
            gap += y * b
            slip += ROUNDING * abs(y * b)
            for j in range(n):
                total[j] += y * term[j]
                size[j] += abs(y * term[j])
        for j in range(n):
            slip += (2.0 * abs(total[j]) + ROUNDING * size[j]) * box[j]
        closed[i] = gap > slip
