"""Fingers that take no part in a grasp: where they may be kept out of the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from handfast.core.arrays import Array
from handfast.model.hand.coupling import coupled, drivers
from handfast.model.hand.hand import Hand

BENT = 0.9  # of a joint's range, where its finger is folded away


def idle_joints(hand: Hand, links: Sequence[str]) -> list[int]:
    """Closing joints, none of them coupled to another, that no link of some has anything to do with."""
    busy = {j for link in links for j in hand.moved_by(hand.link(link))}
    for _ in hand.couplings:
        busy |= {c.driver for c in hand.couplings if c.joint in busy} - {-1}
        busy |= {c.joint for c in hand.couplings if c.driver in busy}
    tied = {c.joint for c in hand.couplings}
    return [j for j in range(hand.l) if j not in busy | tied and hand.closing[j]]


def postures(hand: Hand, links: Sequence[str]) -> list[dict[str, float]]:
    """Values by joint name for the fingers that move none of some links: wide open, and folded; [{}] if all take part.

    Coupled joints are not named: they follow.
    """
    idle = idle_joints(hand, links)
    out = []
    for share in (0.0, BENT) if idle else (0.0,):
        values = {}
        for j in idle:
            joint = hand.joints[j]
            near, far = (joint.lower, joint.upper) if hand.closing[j] > 0 else (joint.upper, joint.lower)
            values[joint.name] = near + share * (far - near)
        out.append(values)
    return out


def placed(hand: Hand, q: Array, values: dict[str, float]) -> Array:
    """(l,) a configuration with some joints set and those that follow them after them, within their limits."""
    q, moved = q.copy(), [hand.joint(name) for name in values]
    q[moved] = list(values.values())
    after = np.clip(coupled(hand, q), *hand.limits.T)
    return np.where([leader in moved and leader != j for j, (leader, _, _) in drivers(hand).items()], after, q)
