"""Force closure by a linear program."""

from __future__ import annotations

import numpy as np

from handfast.core.arrays import Array

FLAT = 1e-9
LEAST = 1e-7  # a margin below is rounding


def force_closure(wrenches: Array) -> tuple[bool, float]:
    """Can contact forces balance every wrench? The test, and how far inside the cones forces balance each other.

    Some forces strictly inside all friction cones must balance, and the cones' wrenches must span all six
    dimensions (Prattichizzo and Trinkle, *Grasping*, in the Springer Handbook of Robotics, the linear program of
    frictional form closure; there over the cones' faces, here over their edges). The margin is the smallest
    coefficient of an edge, as a share of the mean one: 1 if equal forces at all contacts balance, 0 at the border.

    Args:
        wrenches: (m, edges, 6), see `edge_wrenches`.
    """
    from scipy.optimize import linprog

    columns = wrenches.reshape(-1, 6).T
    n = columns.shape[1]
    # maximise d: columns @ x = 0, x >= d, mean of x = 1; with x = y + d, y >= 0
    total = columns.sum(axis=1)
    rows = np.vstack([np.c_[columns, total], np.r_[np.ones(n), n][None]])
    found = linprog(np.r_[np.zeros(n), -1.0], A_eq=rows, b_eq=np.r_[np.zeros(6), n], bounds=[(0, None)] * (n + 1))
    margin = float(found.x[-1]) if found.status == 0 else 0.0
    sizes = np.linalg.svd(columns, compute_uv=False)
    spans = n >= 6 and bool(sizes[-1] > FLAT * sizes[0])
    return spans and margin > LEAST, margin
