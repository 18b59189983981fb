"""What couplings make of a hand's joints: which one drives, what that leaves of its range, where the others follow."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.model.hand.hand import Hand

LIMIT_MISMATCH = 1e-9  # [rad, m] by which the limits of a joint and those of one that follows it may miss each other


def drivers(hand: Hand) -> dict[int, tuple[int, float, float]]:
    """For each joint (driver, ratio, offset): its value is ratio q[driver] + offset; driver -1: a constant."""
    tied = {c.joint: c for c in hand.couplings}
    out = {}
    for j in range(hand.l):
        driver, ratio, offset = j, 1.0, 0.0
        while driver in tied:
            c = tied[driver]
            offset += ratio * c.offset
            driver, ratio = c.driver, ratio * c.ratio
            if driver < 0:
                ratio = 0.0
                break
        out[j] = (driver, ratio, offset)
    return out


def driver_ranges(hand: Hand, needed: Iterable[int] = ()) -> dict[int, tuple[float, float]]:
    """For each joint that no other drives: what its own limits and those of all that follow it leave of its range.

    Args:
        needed: joints that have to move.

    Raises:
        InputError: nothing is left, or, for the driver of a needed joint, a single value where its own limits
            leave a range.
    """
    follows = drivers(hand)
    ranges = {j: (joint.lower, joint.upper) for j, joint in enumerate(hand.joints) if follows[j][0] == j}
    moving = {follows[j][0] for j in needed}
    for j, (driver, ratio, offset) in follows.items():
        if driver in (j, -1) or not ratio:
            continue
        (lo, hi), own = ranges[driver], hand.joints[driver]
        ends = sorted((float(end) - offset) / ratio for end in hand.limits[j])
        low, high = ranges[driver] = max(lo, ends[0]), min(hi, ends[1])
        empty = low - high > LIMIT_MISMATCH * max(1.0, abs(low))
        if empty or (driver in moving and own.lower < own.upper and low >= high):
            left, field = "nothing" if empty else "a single value", f"limits.{hand.joint_names[j]}"
            right = f"widen them, or fix {own.name} itself by equal limits"
            raise InputError(f"leave {left} for {own.name}, to which it is coupled; {right}", field=field)
    return ranges


def coupled(hand: Hand, q: Array) -> Array:
    """q (..., l) with the coupled joints where their drivers put them, whatever their limits.

    The joints of loops are as near to q as the loops, and the limits of those that follow, let them come.
    """
    out = q.copy()
    for j, (driver, ratio, offset) in drivers(hand).items():
        if driver != j:
            out[..., j] = offset + (ratio * q[..., driver] if driver >= 0 else 0.0)
    if hand.loops:
        rows = out.reshape(-1, hand.l)
        out = np.array([hand.closed(row, as_far_as_possible=True) for row in rows]).reshape(out.shape)
    return np.asarray(out)
