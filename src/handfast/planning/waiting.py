"""Fingers with one motor over several joints: the inner joints wait at their stops until the outer ones are stopped."""

from __future__ import annotations

import numpy as np

from handfast.model.hand.hand import Hand
from handfast.model.hand.joint_law import STOP_ANGLE, STOP_TRAVEL


def waiting(hand: Hand) -> dict[int, tuple[int, ...]]:
    """Which joints wait, each with the joints further out for which it waits.

    A motor that pulls at several joints of a finger gives them the same torque and leaves their difference free. A
    fingertip's contact has a longer arm about the inner joint, so that it opens that one and closes the outer one,
    whatever the motor pulls, until one of the two stands at a stop: the inner one open, or the outer one closed. A
    finger that closes in this order, the outer joint first and to its stop, rests wherever its tip touches. Those
    are the inner joints that wait: they close, driven by one motor that drives a closing joint further out, follow from
    no other, and have a stop at the end to which they open. Without stops nothing waits.
    """
    R, led = hand.mechanism.R != 0, {c.joint for c in hand.couplings} | set(hand.dependent)
    chains = [hand.moved_by(i) for i in range(len(hand.links))]
    out: dict[int, tuple[int, ...]] = {}
    for j in np.flatnonzero((R.sum(axis=0) == 1) & (hand.closing != 0)).tolist():
        row = R[R[:, j].argmax()]
        outer = {i for c in chains if j in c for i in c[c.index(j) + 1 :] if row[i] and hand.closing[i]}
        if outer and not led & {j, *outer} and np.isfinite(open_stop(hand, j)):
            out[j] = tuple(sorted(outer))
    return out


def open_stop(hand: Hand, joint: int) -> float:
    """The value beyond which something keeps a joint from opening; infinite if nothing does."""
    return hand.joints[joint].law.stops[0 if hand.closing[joint] > 0 else 1]


def stands_open(hand: Hand, joint: int, value: float) -> bool:
    """Whether a joint stands at the stop to which it opens."""
    near = STOP_ANGLE if hand.joints[joint].type == "revolute" else STOP_TRAVEL
    return bool(hand.closing[joint] * (value - open_stop(hand, joint)) <= near)
