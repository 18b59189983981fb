"""What an answered question leaves to the next one in nearly the same direction: points, and its tree.

Near a solution of the one is a solution of the other, which Newton finds; and what a case was refuted by mostly
refutes it again. So the search begins with an incumbent and with the leaves of the finished tree, each from the
working set that closed it, and splits only those that do not close any more. The tree covers all states
whatever the direction is: it is as good a proof as one that was grown from its root.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from holdfast.mechanism import Array
from holdfast.stability.engine import newton
from holdfast.stability.engine.search import Pool, Search

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
        if s.z is not None and self.tree is not None:
            s.follow(self.tree)
