"""Where all joints of a hand are when those that the contacts determine are known."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from holdfast.errors import InputError
from holdfast.mechanism import Array
from holdfast.synthesis.existence import free_joints
from holdfast.synthesis.problem import led
from holdfast.synthesis.task import Task

ROUNDING = 1e-9  # [rad, m] by which the limits of a joint and those of one that follows it may miss each other


def leader_ranges(task: Task) -> dict[int, tuple[float, float]]:
    """For each joint that leads itself: what its own limits and those of all that follow it leave of its range.

    Raises:
        InputError: nothing is left, or, for a joint that moves a contact, a single value where its own limits
            leave a range.
    """
    hand, follows = task.hand, led(task.hand)
    ranges = {j: (joint.lower, joint.upper) for j, joint in enumerate(hand.joints) if follows[j][0] == j}
    moving = {follows[j][0] for j in task.involved.tolist()}
    for j, (leader, ratio, offset) in follows.items():
        if leader in (j, -1) or not ratio:
            continue
        (lo, hi), own = ranges[leader], hand.joints[leader]
        ends = sorted((float(end) - offset) / ratio for end in hand.limits[j])
        low, high = ranges[leader] = max(lo, ends[0]), min(hi, ends[1])
        empty = low - high > ROUNDING * max(1.0, abs(low))
        if empty or (leader in moving and own.lower < own.upper and low >= high):
            left, field = "nothing" if empty else "a single value", f"limits.{hand.joint_names[j]}"
            right = f"widen them, or fix {own.name} itself by equal limits"
            raise InputError(f"leave {left} for {own.name}, to which it is coupled; {right}", field=field)
    return ranges


def whole(task: Task, joints: Mapping[str, float]) -> Array:
    """(l,) all joint values from those of the free joints; unused joints as near to 0 as their limits allow."""
    hand, follows, ranges = task.hand, led(task.hand), leader_ranges(task)
    free = free_joints(task)
    q = np.zeros(hand.l)
    for j, (leader, ratio, offset) in follows.items():
        if leader < 0:
            q[j] = offset
            continue
        name = hand.joint_names[leader]
        value = joints[name] if name in free else float(np.clip(0.0, *ranges[leader]))
        q[j] = value if leader == j else ratio * value + offset
    return q
