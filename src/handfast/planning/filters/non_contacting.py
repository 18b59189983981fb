"""Fingers that touch nothing in a grasp: where they are kept out of the way."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from handfast.core.arrays import Array, Indices
from handfast.geometry.collision import Clearances, Collisions, Requested
from handfast.geometry.scene import beyond_rest
from handfast.model.hand.coupling import coupled, driver_ranges, drivers
from handfast.model.hand.hand import Hand
from handfast.synthesis.solution import Solution
from handfast.synthesis.task import Task

BENT = 0.9  # of a joint's range, where its finger is folded away
POSTURE_TRIES = 48  # postures of one finger
POSTURE_SEED = 0
POSTURE_CUTOFF = 1e-3  # [m] nothing further apart need be measured: only overlaps count

# --- two postures, by names -------------------------------------------------------------------------


def non_contacting_joints(hand: Hand, links: Sequence[str]) -> list[int]:
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
    away = non_contacting_joints(hand, links)
    out = []
    for share in (0.0, BENT) if away else (0.0,):
        values = {}
        for j in away:
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
    return np.where([driver in moved and driver != j for j, (driver, _, _) in drivers(hand).items()], after, q)


# --- the first of many that is clear ----------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class NonContactingFinger:
    """A chain whose joints move no contact.

    Attributes:
        joints: (f,) those that mimic no other.
        postures: (p, f) their values, nearest to 0 first.
        links: what they move; pairs: those of the scene's pairs of links, if judged, with one of these links.
    """

    joints: list[int]
    postures: Array
    links: Indices
    pairs: Indices


class NonContactingFingers:
    """Fingers whose joints move no contact of a task, each a chain from the palm.

    A configuration of synthesis has their joints as near to 0 as the limits allow. If they penetrate anything
    there, fixed postures are tried, those nearest to that one first; the first that is clear is kept, or the
    one that penetrates least.
    """

    def __init__(self, task: Task, collisions: Collisions) -> None:
        self.task, self.collisions = task, collisions
        hand, scene = task.hand, collisions.scene
        driven, ranges = drivers(hand), driver_ranges(hand)
        used = {driven[j][0] for j in task.involved.tolist()}
        free = [j for j, (lo, hi) in ranges.items() if j not in used and lo < hi]
        chains: dict[int, list[int]] = {}
        for j in free:
            first = next(hand.moved_by(i)[0] for i in range(len(hand.links)) if j in hand.moved_by(i))
            chains.setdefault(first, []).append(j)
        rng = np.random.default_rng(POSTURE_SEED)
        self.fingers = []
        for joints in chains.values():
            lo, hi = np.array([ranges[j] for j in joints]).T
            rest = np.clip(0.0, lo, hi)
            x = lo + rng.random((POSTURE_TRIES, len(joints))) * (hi - lo)
            x = np.vstack([hi, lo, (lo + hi) / 2, x])
            x = x[np.argsort(np.abs(x - rest).sum(axis=1), kind="stable")]
            links = [i for i in range(len(hand.links)) if set(joints) & set(hand.moved_by(i))]
            judged = [p not in collisions.left_out and bool({*p} & {*links}) for p in scene.self_pairs]
            self.fingers.append(NonContactingFinger(joints, x, np.array(links, dtype=np.intp), np.flatnonzero(judged)))
        self._links = [i for finger in self.fingers for i in finger.links]
        judged_pairs = [p for p in scene.self_pairs if p not in collisions.left_out]
        self._pairs = np.array([bool({*p} & {*self._links}) for p in judged_pairs], dtype=bool)

    def without(self, now: Clearances) -> Clearances:
        """Clearances as if these fingers were not there."""
        to_object = now.to_object.copy()
        to_object[self._links] = now.cutoff
        return replace(now, to_object=to_object, between=np.where(self._pairs, now.cutoff, now.between))

    def placed(self, solution: Solution, now: Clearances, requested: Sequence[Requested]) -> tuple[Array, Clearances]:
        """All joints (l,), and the clearances there; `now`: those of the solution."""
        q, pose = solution.q, solution.pose
        for finger in self.fingers:
            worst = self._overlap(finger, q, pose)
            for x in finger.postures:
                if worst == 0.0:
                    break
                moved = q.copy()
                moved[finger.joints] = x
                moved = coupled(self.task.hand, moved)
                there = self._overlap(finger, moved, pose)
                if there < worst:
                    q, worst = moved, there
        return q, now if q is solution.q else self.collisions.clearances(q, pose, requested)

    def _overlap(self, finger: NonContactingFinger, q: Array, pose: Array) -> float:
        """[m] how deep a finger is in anything, 0 if it is clear."""
        to_object, between = self.collisions.scene.clearances(q, pose, POSTURE_CUTOFF)
        between = beyond_rest(between, self.collisions.at_rest)
        nearest = min(to_object[finger.links].min(initial=0.0), between[finger.pairs].min(initial=0.0))
        return max(0.0, -float(nearest))
