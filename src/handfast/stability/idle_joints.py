"""Joints that touch nothing: can their own equations be met at all, whatever the contacts do?

A finger in the air that is pulled and held by nothing moves on for ever, and no load makes a difference. Beside loads
that are ten thousand times as large as what pulls it, a search cannot tell that from rounding.
"""

from __future__ import annotations

import numpy as np

from handfast.model.grasp import Grasp
from handfast.stability import model


def runs_away(grasp: Grasp) -> bool:
    """Is there no torque balance of the joints that touch nothing, by (2), (8) and what they can carry themselves?

    What anything moves by is left aside, so that False says nothing; True is a proof that nothing is resisted.
    """
    idle = ~grasp.touches
    mech, given = grasp.mechanism, grasp.given_torques
    if not idle.any() or not (grasp.command.any() or given[idle].any()):
        return False
    moves, back = model.commanded(grasp), np.array(mech.backdrivable, dtype=bool)
    f_c = grasp.command
    low = np.where(back, f_c, np.where(moves & (f_c >= 0), f_c, -np.inf))
    high = np.where(back, f_c, np.where(moves & (f_c < 0), f_c, np.inf))
    lo, hi = model.reaction_range(grasp)
    of_idle = mech.R[:, idle].any(axis=1)
    rest = not given[idle].any() and ((low <= 0) & (high >= 0))[of_idle].all() and ((lo <= 0) & (hi >= 0))[idle].all()
    if rest:  # nothing pulls them
        return False
    from scipy.optimize import linprog  # slow to import, and seldom needed

    free = np.full(len(mech.A), np.inf)
    columns = np.hstack([mech.R.T, mech.A.T, np.eye(grasp.l)])[idle]
    bounds = np.column_stack([np.concatenate([low, -free, lo]), np.concatenate([high, free, hi])])
    found = linprog(np.zeros(columns.shape[1]), A_eq=columns, b_eq=-given[idle], bounds=bounds)
    return bool(found.status == 2)
