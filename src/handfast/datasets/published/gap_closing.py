"""Fingers that a published grasp leaves short of its object, closed onto it towards where their motors push them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handfast.core.arrays import Array
from handfast.datasets.published.separating import Separator
from handfast.geometry.contacts import THRESHOLD
from handfast.geometry.scene import Scene
from handfast.model.hand.hand import Hand

TOUCH = 2e-5  # [m] a finger this near touches
REACH = 0.05  # [m] beyond this, distances are not computed
LOOKS = 24  # along the way to the target; the search for the touch halves one of these steps
HALVINGS = 14
MEETING = 1e-4  # [m] by which two links may go deeper into each other
FARTHEST = 0.05  # [m] that a gripper pushes an object before it


@dataclass(frozen=True, eq=False)
class GapsClosed:
    """Where the fingers are that did not touch.

    Attributes:
        q: (l,) configuration.
        closed: [m] the gap of each finger that now touches, by the name of its last link.
        open: [m] the gap of each finger that does not meet the object on its way, or another finger first, as it was.
    """

    q: Array
    closed: dict[str, float]
    open: dict[str, float]


def gaps_closed(scene: Scene, q: Array, pose: Array, target: Array) -> GapsClosed:
    """Move each finger that does not touch along the straight way to its target until it does; else leave it.

    A finger's joints all move in proportion. One that touches with any link stays as it is, and so does one that would
    meet another link of the hand.

    Args:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame.
        target: (l,) configuration, the squeeze of the file or of the mapping.
    """
    hand = scene.hand
    fingers = [f for f in fingers_of(hand) if any(hand.links[i].shapes for i in f[1])]
    joints = [list(j) for j, _ in fingers]
    links = [list(i) for _, i in fingers]
    names = [hand.links[i[-1]].name for i in links]
    way = target - q

    def gaps(t: Array) -> Array:
        at = q.copy()
        for own, share in zip(joints, t, strict=True):
            at[own] += share * way[own]
        distance = scene.distance(at, pose, REACH)
        return np.array([distance[own].min() for own in links])

    count = len(fingers)
    first = gaps(np.zeros(count)) if count else np.zeros(0)
    moving = np.array([bool(first[k] > TOUCH and np.abs(way[joints[k]]).max() > 0) for k in range(count)], dtype=bool)
    low, high = np.zeros(count), np.full(count, np.nan)
    for step in range(1, LOOKS + 1):
        if not (moving & np.isnan(high)).any():
            break
        t = np.where(moving & np.isnan(high), step / LOOKS, 0.0)
        met = (gaps(t) <= TOUCH) & (t > 0)
        high[met] = t[met]
        low = np.where((t > 0) & ~met, t, low)
    met = ~np.isnan(high)
    for _ in range(HALVINGS if met.any() else 0):
        middle = np.where(met, (low + high) / 2, 0.0)
        found = gaps(middle)
        low, high = np.where(met & (found > 0), middle, low), np.where(met & (found <= 0), middle, high)
    while True:
        out = q.copy()
        for k in np.flatnonzero(met):
            out[joints[k]] += low[k] * way[joints[k]]
        meeting = _meeting(scene, q, out, pose) if met.any() else set()
        into = met & np.array([bool(meeting.intersection(own)) for own in links], dtype=bool)
        if not into.any():
            break
        met &= ~into
    short = [k for k in range(count) if first[k] > TOUCH]
    return GapsClosed(
        out,
        {names[k]: float(first[k]) for k in short if met[k]},
        {names[k]: float(first[k]) for k in short if not met[k]},
    )


def _meeting(scene: Scene, before: Array, after: Array, pose: Array) -> set[int]:
    """Links of pairs of the hand that one configuration puts deeper into each other than another one did."""
    was, now = (scene.clearances(x, pose, MEETING)[1] for x in (before, after))
    deeper = now < np.minimum(was, 0.0) - MEETING
    return {link for pair, yes in zip(scene.self_pairs, deeper, strict=True) if yes for link in pair}


def pushed_on(separator: Separator, q: Array, pose: Array, target: Array) -> tuple[Array, Array, float]:
    """A gripper closed on, from where it first touches: it pushes the object before it until that is held.

    The joints go straight towards their target in steps that are halved where the object cannot give way; it gives
    way by the least motion. What was pushed to the target without being held by a second link stays where it was.

    Args:
        q: (l,) configuration; pose: (4, 4) of the object in the hand's base frame; target: (l,).

    Returns:
        configuration, object's pose, and how far its centre was pushed [m].
    """
    scene, first = separator.scene, (q, pose)
    if (scene.distance(q, pose, REACH) <= THRESHOLD).sum() != 1:
        return q, pose, 0.0
    way, t, step, moved = target - q, 0.0, 1 / LOOKS, 0.0
    while step > 2.0**-HALVINGS and t < 1 and moved < FARTHEST:
        further = q + min(1.0, t + step) * way
        done = separator.separated(further, pose, joints=False)
        if done.apart:
            t, pose = min(1.0, t + step), done.pose
            moved += done.object_moved
        else:
            step /= 2
    held = (scene.distance(q + t * way, pose, REACH) <= THRESHOLD).sum() > 1
    return (q + t * way, pose, moved) if held else (*first, 0.0)


def fingers_of(hand: Hand) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Joints and links of each finger; one begins at the first joint that not all of them share.

    Fingers whose joints are coupled, or driven by one motor, count as one.
    """
    chains = [hand.moved_by(i) for i in range(len(hand.links))]
    moving = [i for i, chain in enumerate(chains) if chain]
    last = [i for i in moving if not any(hand.links[k].parent == i for k in moving)]
    shared = set(chains[last[0]]).intersection(*(chains[i] for i in last)) if len(last) > 1 else set()
    groups = [set(chains[i]) - shared for i in last]
    rows = np.vstack([hand.mechanism.R, hand.mechanism.A]) != 0
    groups += [{int(j) for j in np.flatnonzero(row)} - shared for row in rows]
    merged: list[set[int]] = []
    for group in groups:
        joined = [g for g in merged if g & group]
        merged = [g for g in merged if not g & group] + [group.union(*joined)]
    found = []
    for group in sorted((g for g in merged if g), key=min):
        own = tuple(i for i in moving if set(chains[i]) & group)
        if own:
            found.append((tuple(sorted(group)), own))
    return found
