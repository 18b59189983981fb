"""Where all joints of a hand are when those that the contacts determine are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.coupling import coupled, driver_ranges
from handfast.synthesis.task import Task


def whole(task: Task, joints: Mapping[str, float]) -> Array:
    """(l,) all joint values from those of the free joints; unused joints as near to 0 as their limits allow."""
    hand, free = task.hand, task.free
    q = np.zeros(hand.l)
    for j, (lower, upper) in driver_ranges(hand).items():
        name = hand.joint_names[j]
        q[j] = joints[name] if name in free else np.clip(0.0, lower, upper)
    return coupled(hand, q)
