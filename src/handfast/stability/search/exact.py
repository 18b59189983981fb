"""From an approximate solution of a reduced problem to an exact one, by `kernel.newton`."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.stability.search.arrays import POINTS, table
from handfast.stability.search.machine import kernel
from handfast.stability.search.reduced import Reduced
from handfast.stability.search.search import Lane


def solve(r: Reduced, start: Array, *, tol: float = 1e-6, hold: bool = False, lane: Lane | None = None) -> Array | None:
    """An exact solution (n,) of the reduced problem near `start` (n,); None if none was found.

    Args:
        tol: (scaled) motions and forces of the start below this count as none.
        hold: keep the objective at its lower bound.
        lane: whose upper bounds hold, and whose room is used; by default those of the problem.
    """
    lane = lane or Lane.of(r)
    m, a, _, cos, sin, mdp, objective, _ = r.numbers
    start, z = np.ascontiguousarray(start), np.empty(len(start))
    tables = r.table, lane.table, table(POINTS, (start, z)), lane.room.table
    found = kernel().polished(m, a, cos, sin, mdp, min(objective, 1), hold, tol, *tables)
    return z if found else None
