"""Where the fingers go that no contact needs: out of the way."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from holdfast.collision import Clearances, Collisions, Requested
from holdfast.hand.coupling import coupled, leader_ranges, led
from holdfast.mechanism import Array
from holdfast.synthesis.answers import Solution
from holdfast.synthesis.task import Task

TRIES = 48  # postures of one finger
SEED = 0


class Unused:
    """Fingers whose joints move no contact of a task, each a chain from the palm.

    A configuration of synthesis has their joints as near to 0 as the limits allow. If they penetrate anything
    there, fixed postures are tried, those nearest to that one first; the first that is clear is kept, or the
    one that penetrates least.
    """

    def __init__(self, task: Task, collisions: Collisions) -> None:
        self.task, self.collisions = task, collisions
        hand = task.hand
        follows, ranges = led(hand), leader_ranges(hand)
        used = {follows[j][0] for j in task.involved.tolist()}
        free = [j for j, (lo, hi) in ranges.items() if j not in used and lo < hi]
        chains: dict[int, list[int]] = {}
        for j in free:
            first = next(hand.moved_by(i)[0] for i in range(len(hand.links)) if j in hand.moved_by(i))
            chains.setdefault(first, []).append(j)
        self.fingers = list(chains.values())  # leaders, by finger
        rng = np.random.default_rng(SEED)
        self._postures = []
        for finger in self.fingers:
            lo, hi = np.array([ranges[j] for j in finger]).T
            rest = np.clip(0.0, lo, hi)
            x = lo + rng.random((TRIES, len(finger))) * (hi - lo)
            corners = np.array([hi, lo, (lo + hi) / 2])
            x = np.vstack([corners, x])
            self._postures.append(x[np.argsort(np.abs(x - rest).sum(axis=1), kind="stable")])

    def placed(self, solution: Solution, requested: Sequence[Requested]) -> tuple[Array, Clearances]:
        """All joints (l,), and the clearances there."""
        q, pose = solution.q, solution.pose
        now = self.collisions.clearances(q, pose, requested)
        for finger, postures in zip(self.fingers, self._postures, strict=True):
            links = self._links(finger)
            worst = _worst(now, links)
            if worst >= 0:
                continue
            for x in postures:
                moved = self._with(q, finger, x)
                there = self.collisions.clearances(moved, pose, requested)
                if _worst(there, links) > worst:
                    q, now, worst = moved, there, _worst(there, links)
                if worst >= 0:
                    break
        return q, now

    def _links(self, finger: list[int]) -> set[str]:
        hand = self.task.hand
        return {k.name for i, k in enumerate(hand.links) if set(finger) & set(hand.moved_by(i))}

    def _with(self, q: Array, finger: list[int], values: Array) -> Array:
        out = q.copy()
        out[finger] = values
        return coupled(self.task.hand, out)


def _worst(c: Clearances, links: set[str]) -> float:
    """The smallest distance that concerns some links, 0 if none is negative."""
    mine = [d for name, d in zip(c.links, c.to_object.tolist(), strict=True) if name in links]
    mine += [d for pair, d in zip(c.pairs, c.between.tolist(), strict=True) if links & set(pair)]
    return min([0.0, *mine])
