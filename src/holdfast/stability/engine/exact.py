"""From an approximate solution of a reduced problem to an exact one, by `kernel.newton`."""

from __future__ import annotations

import numpy as np

from holdfast.mechanism import Array
from holdfast.stability.engine.arrays import POLISHED, Room, table
from holdfast.stability.engine.machine import kernel
from holdfast.stability.engine.reduced import Reduced


def solve(r: Reduced, start: Array, *, tol: float = 1e-6, hold: bool = False) -> Array | None:
    """An exact solution (n,) of the reduced problem near `start` (n,); None if none was found.

    Args:
        tol: (scaled) motions and forces of the start below this count as none.
        hold: keep the objective at its lower bound.
    """
    m, a, _ = r.sizes
    z, start = np.empty_like(start), np.ascontiguousarray(start)
    question = table(POLISHED, (r.C, r.D, r.CT, r.DT, r.off, r.p.mu, r.lo, r.hi, r.driven, start, z))
    angle = float(np.cos(r.p.eta)), float(np.sin(r.p.eta))
    room = Room(r.room)
    tables = question.ctypes.data, room.table.ctypes.data
    found = kernel().polished(m, a, *angle, r.p.mdp, min(r.objective, 1), hold, tol, *tables)
    return z if found else None
