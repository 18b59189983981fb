"""A bound on the loads that any placement of the contacts can hold: so many times them, and no more.

Where normal forces are limited, a twist refutes a box of placements from some factor on the loads on
(`handfast.proofs.unbalanced`). Branch and bound: the leaf with the largest factor is halved first, so the bound, the
largest of all leaves, falls as long as there is time. The twist of a box is the dual solution of a linear program: the
largest factor at which forces in pyramids about the friction cones, at the box's middle and corners, balance a load.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from handfast.core.arrays import Array
from handfast.core.errors import InputError
from handfast.planning.filters.balance import circumscribed, least_load_factor, load_factor
from handfast.planning.no_balance import (
    BALANCE_BATCH,
    MIN_BOX_SIDE,
    NO_MOTION,
    RANDOM_PLACEMENTS,
    BoxNode,
    Corners,
    NoBalance,
)
from handfast.proofs.fields import Integers
from handfast.proofs.unbalanced import MAX_TREE_ENTRIES, Motions, halves
from handfast.stability.answers.answer import finite

BOUND_ROUNDING = 1 + 1e-9  # on the bound, over that of the leaves' factors
BOUND_EDGES = 16  # of the pyramids about the friction cones
SOFT_EDGES = 8  # of those of soft fingers, on each of three circles
CLIMBED = 4  # placements of a step, near the best that was met
# share of the whole, of the steps to these; after one that was not better
MAX_BOUND_STEP, MIN_BOUND_STEP, SHORTER = 0.3, 0.01, 0.9
BOUND_TOLERANCE = 1e-3  # relative: a bound that is so near to what was reached is not improved


@dataclass(frozen=True)
class BoundSearched:
    """How far the search for the bound has come.

    Attributes:
        factor: no placement of the contacts holds the loads so many times; inf while nothing is shown.
        reached: so many times forces alone balance them at a placement that was met; computed, not proved.
        boxes: that were halved. proof: for files; None while nothing is shown.
    """

    factor: float
    reached: float
    boxes: int
    proof: Mapping[str, Any] | None = field(default=None, repr=False)

    def to_json(self) -> dict[str, Any]:
        """Without the proof."""
        return {"factor": finite(self.factor), "reached": self.reached, "boxes": self.boxes}


@dataclass(frozen=True, eq=False)
class Leaf:
    """A box with the factor from which on it is refuted.

    Attributes:
        halved: the parameter in whose middle it is to be halved.
        guesses: (k,) of each load a factor from which on it is not balanced, as it was in a box about this one.
    """

    node: BoxNode
    factor: float
    halved: int
    guesses: Array


class LoadBound(NoBalance):
    """The search; `run` goes on where it was left. Every leaf has a twist, and the factor from which on it is refuted.

    Arguments and errors are those of `NoBalance`; some contact force has to be limited.

    Attributes:
        reached: the largest factor at which forces alone balance every load at a placement that was met; by linear
            programs, a proof of nothing.
    """

    def __init__(self, *args: Any, saved: Any = None, **how: Any) -> None:
        super().__init__(*args, saved=saved, **how)
        if not self.placements.limited.any():
            raise InputError("is not there; without a limit forces hold any multiple of a load", field="force_limit")
        self.numbers, self.looked, self.random = itertools.count(), True, np.random.default_rng(self.seed)
        self.reached, self.at, self.length = 0.0, self.placements.root.mean(axis=1), MAX_BOUND_STEP
        self.heap: list[tuple[float, int, Leaf]] = []
        nodes = [node for node in self._nodes() if not node.halves]
        self._add(nodes, np.zeros((len(nodes), len(self.hits))), new=saved is None)
        self._climb(RANDOM_PLACEMENTS)

    @property
    def factor(self) -> float:
        """No placement holds the loads so many times; inf while nothing is shown."""
        return -self.heap[0][0] * BOUND_ROUNDING

    @property
    def over(self) -> bool:
        return (
            self.stuck
            or self.factor <= self.reached * (1 + BOUND_TOLERANCE)
            or 2 * self.boxes > MAX_TREE_ENTRIES - 4 * BALANCE_BATCH
        )

    @property
    def bound(self) -> BoundSearched:
        """How far it has come."""
        proof = self.to_json() if np.isfinite(self.factor) else None
        return BoundSearched(self.factor, self.reached, self.boxes, proof)

    def to_json(self) -> dict[str, Any]:
        """The factor with its tree, as `replay_unbalanced` reads it."""
        return {"factor": self.factor} | super().to_json()

    def _restore(self, data: Any) -> None:
        factor = data.get("factor") if isinstance(data, dict) else None
        if not isinstance(factor, float) or not factor > 0:
            raise InputError("is no positive number", field="factor")
        placements, self.placements = self.placements, replace(self.placements, factor=factor)
        super()._restore({key: value for key, value in data.items() if key != "factor"})
        self.placements = placements

    def _nodes(self) -> list[BoxNode]:
        """All boxes of the tree."""
        out, stack = [], [self.root]
        while stack:
            out.append(stack.pop())
            stack += out[-1].halves
        return out

    def _step(self) -> None:
        """Halve the leaves with the largest factors."""
        some = [heapq.heappop(self.heap)[2] for _ in range(min(BALANCE_BATCH, len(self.heap)))]
        self.stuck = any((np.ptp(leaf.node.box, axis=1) <= MIN_BOX_SIDE * self.whole).all() for leaf in some)
        new: list[BoxNode] = []
        for leaf in some:
            node, k = leaf.node, leaf.halved
            motion = NO_MOTION if node.entry is None else -1 - node.entry
            node.entry, node.halves = k, tuple(BoxNode(half, motion) for half in halves(node.box, k))
            new += node.halves
        self._add(new, np.repeat([leaf.guesses for leaf in some], 2, axis=0))
        self.boxes += len(some)
        self._climb(CLIMBED)

    def _climb(self, steps: int) -> None:
        """Placements near the best that was met, for one at which forces balance more."""
        low, high = self.placements.root.T
        p = self.placements
        for _ in range(steps):
            at = np.clip(self.at + self.length * (high - low) * self.random.normal(size=len(low)), low, high)
            points, normals = p.at(at[None])
            asked = points[0], normals[0], p.friction, p.force_limits, p.loads
            factor = least_load_factor(*asked, least=self.reached, torsion=p.torsion)
            if factor > self.reached:
                self.reached, self.at, self.length = factor, at, min(2 * self.length, MAX_BOUND_STEP)
            else:
                self.length = max(SHORTER * self.length, MIN_BOUND_STEP)

    def _add(self, nodes: list[BoxNode], guesses: Array, *, new: bool = True) -> None:
        """Leaves with the best twist of each: that of what they are half of, one about a line, or the dual one.

        new: False for the twist that each has alone. guesses: (N, k), see `Leaf`; changed.
        """
        boxes, its = np.array([node.box for node in nodes]), np.arange(len(nodes))
        corners = Corners.of(boxes, self.placements)
        best, least, halved = np.full(len(nodes), NO_MOTION), np.full(len(nodes), np.inf), corners.effect.argmax(axis=1)
        candidates = [np.array([node.tried if node.entry is None else -1 - node.entry for node in nodes])]
        if new:
            candidates += [self._lines(corners, its), self._duals(corners, guesses)]
        for given in candidates:
            some = its[given != NO_MOTION]
            factors, reach = self.placements.least_factors(boxes[some], self.motions[given[some]])
            better = factors < least[some]
            some, reach = some[better], np.nan_to_num(reach[better], nan=0.0)
            best[some], least[some] = given[some], factors[better]
            known = reach.any(axis=1)
            halved[some[known]] = reach[known].argmax(axis=1)
        for node, motion, *rest in zip(nodes, best.tolist(), least.tolist(), halved.tolist(), guesses, strict=True):
            node.entry = None if motion == NO_MOTION else -1 - motion
            heapq.heappush(self.heap, (-rest[0], next(self.numbers), Leaf(node, *rest)))

    def _duals(self, corners: Corners, guesses: Array) -> Integers:
        """The constant twist with the least factor over middles and corners, of the load with the least guess."""
        placed, edges = self.placements, BOUND_EDGES if not self.placements.torsion else SOFT_EDGES
        limits, loads = placed.force_limits, placed.loads
        wide = circumscribed(edges, soft=placed.torsion > 0)  # pyramids that hold the cones
        friction, torsion = wide * placed.friction, wide * placed.torsion
        weights, twists = np.zeros((len(guesses), len(loads))), np.zeros((len(guesses), 6))
        for n, guess in enumerate(guesses):
            p, normals = (np.swapaxes(a, 0, 1) for a in (corners.points[n], corners.normals[n]))
            least = np.inf
            for _ in loads:
                load = int(guess.argmin())
                if guess[load] >= least:
                    break
                guess[load], twist = load_factor(p, normals, friction, limits, loads[load], edges, torsion)
                if guess[load] < least:
                    least, weights[n], twists[n] = guess[load], np.eye(len(loads))[load], twist
        return self.add_motions(Motions(weights, np.full((len(guesses), 2), NO_MOTION), twists))
