"""From an approximate solution of a reduced problem to an exact one, by `kernel.newton`."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array
from handfast.stability.search.machine import LIBRARY
from handfast.stability.search.reduced import Reduced
from handfast.stability.search.search import SearchWorker


def solve(
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
